//! Report as Markdown, for an issue or a README: [`MarkdownReport`].

use std::borrow::Cow;
use std::fmt::Write;

use crate::report::choice_report::ChoiceReport;
use crate::report::finding_groups::FindingGroups;
use crate::report::openeqa::{OpenReport, coverage};
use crate::report::self_agreement;
use crate::report::self_agreement::AgreementReport;
use crate::report::sentences::how_to_read;
use crate::report::short::head;
use crate::report::text::alert::Alert;
use crate::report::text::table::{Column, ColumnKind, Table, TableFormat};
use crate::report::text::terminal::readable;
use crate::report::text::words::{ends, interval, words};
use crate::runs::outcome::ReportLength;
use crate::types::text::counted;

/// Name of the table of accuracies or scores by level.
const LEVELS: &str = "levels";

/// Content of a Markdown report.
pub(crate) struct MarkdownReport<'a> {
    /// Names of the runs.
    names: Vec<String>,
    /// Numbers of models, questions and replies.
    head: Vec<String>,
    alerts: &'a [Alert],
    groups: FindingGroups<'a>,
    /// Line below the findings.
    how_to_read: Cow<'static, str>,
    /// True if the list of all findings is open; false if it is folded below the main findings.
    is_open: bool,
    tables: Vec<&'a Table>,
}

impl<'a> MarkdownReport<'a> {
    /// Report on multiple-choice questions.
    pub(crate) fn for_choices(report: &'a ChoiceReport<'a>, names: Vec<String>, length: ReportLength) -> Self {
        let mut tables = tables(&report.tables, LEVELS, length);
        if length == ReportLength::Summary && report.findings.common.is_some() && tables.len() > 1 {
            // Models that were asked different questions are compared on the questions that they share.
            tables.retain(|table| table.caption.contains("all models"));
        }
        Self {
            names,
            head: vec![head(report)],
            alerts: &report.alerts,
            groups: FindingGroups::new(&report.sentences),
            how_to_read: how_to_read(&report.sentences).into(),
            is_open: length != ReportLength::Summary,
            tables,
        }
    }

    /// Report on questions without true answers.
    pub(crate) fn for_own_answers(report: &'a AgreementReport<'a>, names: Vec<String>, length: ReportLength) -> Self {
        let parts = self_agreement::markdown_parts(report);
        Self {
            names,
            head: vec![parts.head],
            alerts: parts.alerts,
            groups: FindingGroups::new(parts.sentences),
            how_to_read: parts.how_to_read.into(),
            is_open: length != ReportLength::Summary,
            tables: tables(parts.tables, parts.levels, length),
        }
    }

    /// Report on open questions, with all its tables.
    pub(crate) fn for_open(report: &'a OpenReport<'_>, all: &'a [Table], length: ReportLength) -> Self {
        let judge = report.judge.unwrap_or("nobody");
        let mut head = vec![format!("OpenEQA by LLM-Match, marked by {judge}, protocol {}", report.protocol)];
        head.extend(coverage(report));
        Self {
            names: report.names(),
            head,
            alerts: report.alerts,
            groups: FindingGroups::new(&[]),
            how_to_read: Cow::default(),
            is_open: false,
            tables: tables(all, LEVELS, length),
        }
    }

    /// Summary, main finding of each group, and all findings; empty without findings.
    fn findings(&self) -> String {
        if self.groups.count() == 0 {
            return String::new();
        }
        let mut text = format!("**{}**\n\n", inline(&self.groups.summary()));
        if !self.is_open {
            for (group, first) in self.groups.main_findings() {
                let sign = first.main_sentence().tone.sign();
                text += &list_item(sign, group, &(first.text() + "."), &first.intervals_text());
            }
            let count = counted(self.groups.count(), "finding");
            let _ = writeln!(text, "\n<details><summary>All {count}</summary>\n");
        }
        for group in self.groups.all() {
            let _ = writeln!(text, "#### {}\n", group.title);
            for sentence in group.sentences() {
                text += &list_item(sentence.tone.sign(), "", &sentence.text, &sentence.detail);
            }
            text.push('\n');
        }
        let _ = writeln!(text, "{}\n", block(&self.how_to_read));
        if !self.is_open {
            text += "</details>\n\n";
        }
        text
    }

    /// Writes the report.
    pub(crate) fn text(&self) -> String {
        let names: Vec<String> = self.names.iter().map(|name| inline(name)).collect();
        let mut text = format!("### Seeing in the dark: {}\n\n", names.join(", "));
        let _ = writeln!(text, "{}\n", block(&self.head.join(" · ")));
        for alert in self.alerts {
            let _ = writeln!(text, "> **Note:** {}\n", inline(&alert.text));
        }
        text += &self.findings();
        for table in &self.tables {
            text += &markdown_table(table);
        }
        text + &format!("Made by darkqa-eval {}.\n", env!("CARGO_PKG_VERSION"))
    }
}

/// List item of a finding: sign, title of its group (may be empty), text, and a line of details (may be empty).
fn list_item(sign: char, group: &str, text: &str, detail: &str) -> String {
    let sign = block(&sign.to_string());
    let [group, text, detail] = [group, text, detail].map(inline);
    let line = match &*group {
        "" => format!("- {sign} **{text}**"),
        _ => format!("- {sign} **{group}:** {text}"),
    };
    match &*detail {
        "" => line + "\n",
        _ => format!("{line}\\\n  {detail}\n"),
    }
}

/// Selects non-empty tables: those with a name in a summary, all tables of the page in a full report, none with only
/// the findings.
fn tables<'a>(tables: &'a [Table], name: &str, length: ReportLength) -> Vec<&'a Table> {
    tables
        .iter()
        .filter(|table| match length {
            ReportLength::Summary => table.name == name,
            ReportLength::Findings => false,
            ReportLength::Full => !table.section.is_empty(),
        })
        .filter(|table| !table.rows.is_empty())
        .collect()
}

/// Table with the columns and rows of the page. Each number is followed by its interval.
fn markdown_table(table: &Table) -> String {
    let columns: Vec<&Column> = table.columns.iter().filter(|column| is_on_page(column)).collect();
    let heads = columns.iter().filter_map(|column| column.heads.page.as_deref()).map(inline);
    let alignments = columns.iter().map(|column| {
        let is_text = matches!(column.kind, ColumnKind::Text | ColumnKind::Verdict);
        if is_text { "---" } else { "---:" }.to_owned()
    });
    let mut text = format!("{}\n\n", block(&table.caption));
    text += &row(heads);
    text += &row(alignments);
    for (heading, cells) in table.headed_rows_in(TableFormat::Page) {
        if let Some(heading) = heading.filter(|heading| !heading.is_empty()) {
            let empty = columns.iter().skip(1).map(|_| String::new());
            text += &row(std::iter::once(format!("**{}**", inline(heading))).chain(empty));
        }
        let cells = table.cells(cells).filter(|(column, _)| is_on_page(column)).map(|(column, cell)| {
            let ends = interval(column.kind, cell).map(|share| format!(" ({})", ends(share)));
            inline(&words(column.kind, cell)) + &ends.unwrap_or_default()
        });
        text += &row(cells);
    }
    text.push('\n');
    if let Some(foot) = &table.foot {
        let _ = writeln!(text, "{}\n", block(foot));
    }
    text
}

fn is_on_page(column: &Column) -> bool {
    column.heads.page.is_some()
}

fn row(cells: impl Iterator<Item = String>) -> String {
    let cells: Vec<String> = cells.collect();
    format!("| {} |\n", cells.join(" | "))
}

/// Escapes a text for use within a line or a table cell: without markup, HTML, links, mentions of users or line breaks.
pub(crate) fn inline(text: &str) -> String {
    let line = readable(&text.replace(['\n', '\r', '\t'], " "));
    let mut escaped = String::with_capacity(line.len());
    let mut before = None;
    for c in line.chars() {
        let is_url_slash = c == '/' && matches!(before, Some(':' | '/'));
        let is_www_dot = c == '.' && escaped.to_ascii_lowercase().ends_with("www");
        if is_url_slash || is_www_dot || "\\`*_{}[]<>#|~!&$\"".contains(c) {
            escaped.push('\\');
        }
        escaped.push(c);
        if matches!(c, '@' | '#') {
            // A zero-width space keeps GitHub from notifying a user or linking an issue.
            escaped.push_str("&#8203;");
        }
        before = Some(c);
    }
    escaped
}

/// Escapes a text for use at the start of a line, where it could also become a list, a heading or a rule.
fn block(text: &str) -> String {
    let text = inline(text);
    let digits = text.chars().take_while(char::is_ascii_digit).count();
    if digits > 0 && text[digits..].starts_with(['.', ')']) {
        return format!("{}\\{}", &text[..digits], &text[digits..]);
    }
    if text.starts_with(['-', '+', '=']) {
        return format!("\\{text}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::text::table::ColumnKind::{Accuracy, Text};
    use crate::report::text::table::TableBuilder;
    use darkqa_score::estimate::Estimate;

    #[test]
    fn names_are_escaped() {
        let names = [
            ("a|b", "a\\|b"),
            ("`x`", "\\`x\\`"),
            ("<img src=x>", "\\<img src=x\\>"),
            ("two\nlines", "two lines"),
            ("@team", "@&#8203;team"),
            ("[a](b)", "\\[a\\](b)"),
            ("http://x/y", "http:\\/\\/x/y"),
            ("WWW.x", "WWW\\.x"),
            ("\u{202e}x", "⟨U+202E⟩x"),
            ("&lt;", "\\&lt;"),
        ];
        for (name, expected) in names {
            assert_eq!(inline(name), expected);
        }
        // Plain text is unchanged.
        assert_eq!(inline("gpt-4o (max-side 512), 5 %"), "gpt-4o (max-side 512), 5 %");
        assert_eq!(block("1. a"), "1\\. a");
        assert_eq!(block("+ a"), "\\+ a");
        assert_eq!(block("10 models"), "10 models");
    }

    #[test]
    fn table_rows_have_equal_cell_counts() {
        let share = Estimate { value: 0.5, low: 0.25, high: 0.75, n: 10 };
        let table = TableBuilder::new(LEVELS, [("a|b\n`c`", Some(share)), ("plain", None)])
            .page("accuracy", "Accuracy")
            .column(Text, "page model", |row| row.0)
            .column(Accuracy, "page L0", |row| row.1)
            .column(Text, "csv hidden", |_| "no")
            .build();
        assert_eq!(
            markdown_table(&table),
            "Accuracy\n\n| model | L0 |\n| --- | ---: |\n| a\\|b \\`c\\` | 50.0 (25.0–75.0) |\n| plain | – |\n\n"
        );
    }
}
