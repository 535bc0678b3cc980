//! Tables in LaTeX, with the package booktabs: [`tables`].

use std::fmt::Write;

use crate::text::table::{ColumnKind, Table, TableCell, TableFormat};
use crate::text::words::{interval, percent, points, words};
use darkqa_base::types::text::escape_hidden;
use darkqa_score::estimate::Estimate;
use darkqa_score::significance::Verdict;

/// The findings as a list, then all tables that have a LaTeX caption. The first comment line begins with `head`.
#[must_use]
pub fn tables(head: &str, findings: &[String], tables: &[Table]) -> String {
    let mut text = format!(
        "% {head} of darkqa-eval; \\usepackage{{booktabs,graphicx}} in the preamble. Tables that are wider than the text are made smaller;\n\
         % `darkqa-eval figures RUN --format tex` sets the main ones at the width of a column.\n"
    );
    if !findings.is_empty() {
        text += "\n\\begin{itemize}\\sloppy\n";
        for finding in findings {
            let _ = writeln!(text, "  \\item {}", escape(finding));
        }
        text += "\\end{itemize}\n";
    }
    for entry in tables {
        if let Some(caption) = &entry.latex {
            text += &table(caption, entry);
        }
    }
    text
}

/// Escapes the special characters of LaTeX.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in escape_hidden(text).chars() {
        match c {
            '⟨' => escaped.push_str("$\\langle$"),
            '⟩' => escaped.push_str("$\\rangle$"),
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                escaped.push('\\');
                escaped.push(c);
            }
            '\\' => escaped.push_str("\\textbackslash{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '…' => escaped.push_str("\\ldots{}"),
            '−' => escaped.push_str("$-$"),
            'κ' => escaped.push_str("$\\kappa$"),
            '†' => escaped.push_str("$\\dagger$"),
            '<' | '>' => {
                let _ = write!(escaped, "${c}$");
            }
            _ => escaped.push(c),
        }
    }
    escaped
}

/// LaTeX code that scales the next group down if it is wider than the text.
const FIT: &str = "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}";

/// Maximum number of rows of a table on one page, in `\footnotesize` with caption and footnote; chosen.
pub const MAX_ROWS: usize = 40;

/// A table as one or more floats of at most [`MAX_ROWS`] rows, no wider than the text.
fn table(caption: &str, table: &Table) -> String {
    let columns = table.columns.iter().filter(|column| column.heads.latex.is_some());
    let alignments: String = columns
        .clone()
        .map(|column| match column.kind {
            ColumnKind::Text | ColumnKind::Verdict => 'l',
            _ => 'r',
        })
        .collect();
    let heads = line(columns.filter_map(|column| column.heads.latex.clone()));
    let rows: Vec<(Option<&str>, String)> = table
        .headed_rows_in(TableFormat::Latex)
        .map(|(heading, row)| {
            let cells = table
                .cells(row)
                .filter(|(column, _)| column.heads.latex.is_some())
                .map(|(column, cell)| cell_text(column.kind, cell));
            (heading, line(cells))
        })
        .collect();
    let foot = table.foot.as_deref().map(|foot| format!("\n  {{\\footnotesize {}}}\n", escape(foot)));
    let mut text = String::new();
    let parts = rows.len().div_ceil(MAX_ROWS).max(1);
    for part in 0..parts {
        let first = part * MAX_ROWS;
        let rows = &rows[first..rows.len().min(first + MAX_ROWS)];
        let place = match parts {
            1 => String::new(),
            _ => format!(" (part {} of {parts})", part + 1),
        };
        let body = body(rows, alignments.len());
        let _ = write!(
            text,
            "\n\\begin{{table}}\n  \\centering\n  \\caption{{{caption}{place}}}\n  {FIT}{{\\footnotesize\n  \
             \\begin{{tabular}}{{{alignments}}}\n    \\toprule\n{heads}    \\midrule\n{body}    \\bottomrule\n  \\end{{tabular}}}}\n{}\\end{{table}}\n",
            foot.as_deref().unwrap_or_default()
        );
    }
    text
}

/// A row of a LaTeX table.
fn line(cells: impl Iterator<Item = String>) -> String {
    let cells: Vec<String> = cells.collect();
    format!("    {} \\\\\n", cells.join(" & "))
}

/// Rows with their headings, and rules between groups.
fn body(rows: &[(Option<&str>, String)], width: usize) -> String {
    let mut text = String::new();
    for (index, (heading, row)) in rows.iter().enumerate() {
        if let Some(heading) = heading {
            if index > 0 {
                text += "    \\midrule\n";
            }
            if !heading.is_empty() {
                let heading = escape(heading);
                let _ = writeln!(text, "    \\multicolumn{{{width}}}{{l}}{{\\textit{{{heading}}}}} \\\\");
            }
        }
        text += row;
    }
    text
}

/// A number above its interval.
fn stacked(number: &str, share: Estimate) -> String {
    let [low, high] = [share.low, share.high].map(percent);
    format!("\\shortstack{{{number}\\\\{{\\tiny {low}--{high}}}}}")
}

fn cell_text(kind: ColumnKind, cell: &TableCell) -> String {
    match (kind, cell) {
        (_, TableCell::Absent | TableCell::Missing) => "--".to_owned(),
        (_, TableCell::Below(share)) => {
            let number = format!("{}\\rlap{{$\\downarrow$}}", percent(share.value));
            stacked(&number, *share)
        }
        (_, TableCell::Changed(share, Some(change))) => {
            let change = escape(&points(*change));
            let number = format!("{} {{\\scriptsize({change})}}", percent(share.value));
            stacked(&number, *share)
        }
        (_, TableCell::Verdict(Verdict::Better)) => "helps".to_owned(),
        (_, TableCell::Verdict(Verdict::Worse)) => "harms".to_owned(),
        _ => {
            let text = escape(&words(kind, cell));
            interval(kind, cell).map_or(text.clone(), |share| stacked(&text, share))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn special_characters_are_escaped() {
        assert_eq!(
            escape("50% a_b & {c} \\ ^~#$ −1 < †"),
            "50\\% a\\_b \\& \\{c\\} \\textbackslash{} \\textasciicircum{}\\textasciitilde{}\\#\\$ $-$1 $<$ $\\dagger$"
        );
    }
}
