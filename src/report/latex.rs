//! Tables as LaTeX with booktabs: [`tables`].

use std::fmt::Write;

use super::table::{Column, ColumnKind, Table, TableCell, TableFormat};
use super::words::{percent, points, words};
use crate::score::estimate::Estimate;
use crate::score::significance::Significance;

/// All tables that have a LaTeX caption; `head` names them in the first comment line.
#[must_use]
pub(super) fn tables(head: &str, tables: &[Table]) -> String {
    let mut text = format!("% {head} of darkqa-eval; \\usepackage{{booktabs}} in the preamble.\n");
    for entry in tables {
        if let Some(caption) = &entry.latex {
            text += &table(caption, entry);
        }
    }
    text
}

/// Text with the special characters of LaTeX escaped.
pub(super) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                escaped.push('\\');
                escaped.push(c);
            }
            '\\' => escaped.push_str("\\textbackslash{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '−' => escaped.push_str("$-$"),
            '<' | '>' => {
                let _ = write!(escaped, "${c}$");
            }
            _ => escaped.push(c),
        }
    }
    escaped
}

fn table(caption: &str, table: &Table) -> String {
    let named = |column: &&Column| column.heads.latex.is_some();
    let columns = table.columns.iter().filter(named);
    let alignments = columns.clone().map(|column| match column.kind {
        ColumnKind::Text | ColumnKind::Significance => 'l',
        _ => 'r',
    });
    let heads = columns.filter_map(|column| column.heads.latex.clone());
    let line = |cells: Vec<String>| format!("    {} \\\\\n", cells.join(" & "));
    let mut text = String::from("\n\\begin{table}\n  \\centering\n");
    let _ = writeln!(text, "  \\caption{{{caption}}}");
    let alignments: String = alignments.collect();
    let _ = writeln!(text, "  \\begin{{tabular}}{{{alignments}}}\n    \\toprule");
    text += &line(heads.collect());
    text += "    \\midrule\n";
    for row in table.rows_in(TableFormat::Latex) {
        let cells = table.cells(row).filter(|(column, _)| named(column));
        text += &line(
            cells
                .map(|(column, cell)| cell_text(column.kind, cell))
                .collect(),
        );
    }
    text + "    \\bottomrule\n  \\end{tabular}\n\\end{table}\n"
}

/// A share in percent with half of its interval.
fn half(share: Estimate) -> String {
    let half = percent((share.high - share.low) / 2.0);
    format!("{} {{\\scriptsize$\\pm${half}}}", percent(share.value))
}

fn cell_text(kind: ColumnKind, cell: &TableCell) -> String {
    match (kind, cell) {
        (_, TableCell::Absent | TableCell::Missing) => "--".to_owned(),
        (_, TableCell::Below(share)) => format!("\\underline{{{}}}", half(*share)),
        (ColumnKind::Accuracy | ColumnKind::Percent, TableCell::Estimate(share))
        | (_, TableCell::Guess(share) | TableCell::Strict(share, _)) => half(*share),
        (_, TableCell::Changed(share, None)) => percent(share.value),
        (_, TableCell::Changed(share, Some(change))) => {
            let change = escaped(&points(*change));
            format!("{} {{\\scriptsize({change})}}", percent(share.value))
        }
        (_, TableCell::Significance(Significance::Better)) => "helps".to_owned(),
        (_, TableCell::Significance(Significance::Worse)) => "harms".to_owned(),
        _ => escaped(&words(kind, cell)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn special_characters_are_escaped() {
        assert_eq!(
            escaped("50% a_b & {c} \\ ^~#$ −1 <"),
            "50\\% a\\_b \\& \\{c\\} \\textbackslash{} \\textasciicircum{}\\textasciitilde{}\\#\\$ $-$1 $<$"
        );
    }
}
