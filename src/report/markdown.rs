//! Report as Markdown, for an issue or a README: [`markdown`].

use std::fmt::Write;
use std::path::Path;

use crate::content::Report;
use crate::finding_groups::FindingGroups;
use crate::text::table::{Column, ColumnKind, Table, TableFormat};
use crate::text::terminal::readable;
use crate::text::words::{ends, interval, words};
use darkqa_base::types::text::counted;
use darkqa_runs::outcome::ReportLength;
use darkqa_runs::stored::run_name;

/// Writes a report as Markdown. `folders` are those of its runs.
pub fn markdown(report: &Report<'_>, folders: &[&Path], length: ReportLength) -> String {
    let names: Vec<String> = folders.iter().map(|folder| inline(&run_name(folder))).collect();
    let mut text = format!("### Seeing in the dark: {}\n\n", names.join(", "));
    let _ = writeln!(text, "{}\n", block(&report.head()));
    for alert in &report.alerts {
        let _ = writeln!(text, "> **Note:** {}\n", inline(&alert.text));
    }
    text += &findings(report, length);
    let tables = match length {
        ReportLength::Summary => report.measure.short_markdown_tables(&report.tables),
        ReportLength::Findings => Vec::new(),
        ReportLength::Full => {
            report.tables.iter().filter(|table| !table.section.is_empty() && !table.rows.is_empty()).collect()
        }
    };
    for table in tables {
        text += &markdown_table(table);
    }
    text + &format!("Made by darkqa-eval {}.\n", env!("CARGO_PKG_VERSION"))
}

/// Summary, main finding of each group, and all findings; empty without findings. In a short report, the list of all
/// findings is folded below the main findings.
fn findings(report: &Report<'_>, length: ReportLength) -> String {
    let groups = FindingGroups::new(&report.sentences);
    if groups.count() == 0 {
        return String::new();
    }
    let is_folded = length == ReportLength::Summary;
    let mut text = format!("**{}**\n\n", inline(&groups.summary()));
    if is_folded {
        for (group, first) in groups.main_findings() {
            let sign = first.main_sentence().tone.sign();
            text += &list_item(sign, group, &(first.text() + "."), &first.intervals_text());
        }
        let count = counted(groups.count(), "finding");
        let _ = writeln!(text, "\n<details><summary>All {count}</summary>\n");
    }
    for group in groups.all() {
        let _ = writeln!(text, "#### {}\n", group.title);
        for sentence in group.sentences() {
            text += &list_item(sentence.tone.sign(), "", &sentence.text, &sentence.detail);
        }
        text.push('\n');
    }
    let _ = writeln!(text, "{}\n", block(&report.how_to_read));
    if is_folded {
        text += "</details>\n\n";
    }
    text
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
pub fn inline(text: &str) -> String {
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
    use crate::text::table::ColumnKind::{Accuracy, Text};
    use crate::text::table::TableBuilder;
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
        let table = TableBuilder::new("levels", [("a|b\n`c`", Some(share)), ("plain", None)])
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
