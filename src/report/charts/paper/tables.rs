//! LaTeX tables that fit the columns of a paper: [`tables`].
//!
//! A table is set at 8 pt, its intervals at 5 pt. Widths are estimated with the bundled font, which is wider than
//! Times, the font of these papers. The first layout that fits is used: intervals with one decimal, intervals without
//! decimals, names on several lines, and last the columns in several parts below one another.

use std::fmt::Write;
use std::ops::Range;

use super::font::Font;
use super::look::Look;
use crate::text::latex::{MAX_ROWS, escape};
use crate::text::table::{Column, ColumnKind, Table, TableCell, TableFormat, TableRow};
use crate::text::words::{interval, words};
use darkqa_score::estimate::Estimate;

/// Font size of tables in points.
const FONT_SIZE: f64 = 8.0;
/// Font size of intervals in points.
const INTERVAL_FONT_SIZE: f64 = 5.0;
/// Maximum width of a text relative to Arial, at the font size of tables. Digits of Computer Modern are 0.531 em wide
/// at 8 points and 0.681 em at 5 points, digits of Arial 0.556 em; Times is narrower than both.
const WIDER: f64 = 1.08;
/// Maximum width of a text relative to Arial, at the font size of intervals.
const TINY_WIDER: f64 = 1.23;
/// Half of the space between two columns, in points.
const TABCOLSEP: f64 = 2.6;
/// Minimum width of the column of names in points (chosen).
const MIN_NAME_WIDTH: f64 = 45.0;
/// Minimum width of the column of names in points if intervals have a decimal (chosen).
const MIN_NAME_WIDTH_WITH_DECIMALS: f64 = 60.0;

/// Definitions of the commands in the tables: a number above its interval, a name on several lines, and a head on
/// several lines.
const COMMANDS: &str = "\
\\providecommand{\\dqci}[2]{\\begin{tabular}[t]{@{}r@{}}#1\\\\[-3.5pt]{\\fontsize{5}{5.5}\\selectfont #2}\\end{tabular}}
\\providecommand{\\dqname}[1]{\\begin{tabular}[t]{@{}l@{}}#1\\end{tabular}}
\\providecommand{\\dqhead}[1]{\\begin{tabular}[b]{@{}r@{}}#1\\end{tabular}}
";

/// Precision of the ends of intervals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Precision {
    Tenths,
    Whole,
}

/// Layout of a table.
#[derive(Debug, Clone, PartialEq)]
struct TableLayout {
    precision: Precision,
    /// Width of the column of names in points.
    name_width: f64,
    /// Columns of each part, without column 0, which has the names.
    parts: Vec<Range<usize>>,
}

/// Writes the tables as files, by name, and returns the number of long tables: `tables.tex`, and `tables-full.tex` if
/// some tables have more than forty rows.
pub fn tables(all: &[Table], look: &Look, is_wide: bool) -> (Vec<(String, Vec<u8>)>, usize) {
    let (long, short): (Vec<&Table>, Vec<&Table>) = all.iter().partition(|table| table.rows.len() > MAX_ROWS);
    let float = if is_wide { "table*" } else { "table" };
    let mut text = format!("% Tables of darkqa-eval. In the preamble: \\usepackage{{booktabs}}\n{COMMANDS}");
    for table in &short {
        text += &float_table(table, float, look.width);
    }
    let mut files = vec![("tables.tex".to_owned(), text.into_bytes())];
    if !long.is_empty() {
        let mut text = String::from(
            "% Long tables of darkqa-eval, for text in one column. In the preamble: \\usepackage{booktabs,longtable}\n",
        ) + COMMANDS;
        for table in &long {
            text += &long_table(table, look.width);
        }
        files.push(("tables-full.tex".to_owned(), text.into_bytes()));
    }
    (files, long.len())
}

/// Formats the interval of a cell; `None` if the cell has no interval.
fn interval_text(cell: &TableCell, precision: Precision) -> Option<String> {
    let Estimate { low, high, .. } = interval(ColumnKind::Accuracy, cell)?;
    // A dash next to minus signs would be confusing.
    let separator = if value_text(cell).contains(['+', '−']) { ", " } else { "–" };
    let [low, high] = [low, high].map(|share| percent_text(share, precision));
    Some(format!("{low}{separator}{high}"))
}

/// Share in percent, without the sign of a negative zero.
fn percent_text(share: f64, precision: Precision) -> String {
    let text = match precision {
        Precision::Tenths => format!("{:.1}", 100.0 * share),
        Precision::Whole => format!("{:.0}", 100.0 * share),
    };
    match text.as_str() {
        "-0.0" => "0.0".to_owned(),
        "-0" => "0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

fn value_text(cell: &TableCell) -> String {
    words(ColumnKind::Accuracy, cell)
}

fn row_name(row: &TableRow) -> String {
    words(ColumnKind::Text, &row.cells[0])
}

/// Lines of a column's head: one word on each.
fn head_lines(column: &Column) -> Vec<&str> {
    let head = column.heads.page.as_deref().unwrap_or_default();
    head.split_whitespace().collect()
}

/// Width in points of a column of numbers.
fn column_width(table: &Table, column: usize, precision: Precision) -> f64 {
    let font = Font::bundled();
    let head = head_lines(&table.columns[column]);
    let head = head.iter().map(|line| font.width(line, FONT_SIZE));
    let cells = table.rows.iter().map(|row| {
        let cell = &row.cells[column];
        let arrow = match cell {
            TableCell::Below(_) => font.width("↓", FONT_SIZE),
            _ => 0.0,
        };
        let value = font.width(&value_text(cell), FONT_SIZE) * WIDER + arrow;
        let interval = interval_text(cell, precision);
        value.max(interval.map_or(0.0, |text| font.width(&text, INTERVAL_FONT_SIZE) * TINY_WIDER))
    });
    head.chain(cells).fold(0.0, f64::max)
}

/// Width in points of the widest name, each on one line.
fn names_width(table: &Table) -> f64 {
    let font = Font::bundled();
    table.rows.iter().map(|row| font.width(&row_name(row), FONT_SIZE) * WIDER).fold(0.0, f64::max)
}

/// Width in points that some columns of numbers leave for the names in a table of `width` points.
fn width_for_names(table: &Table, width: f64, precision: Precision, columns: &Range<usize>) -> f64 {
    let numbers: f64 = columns.clone().map(|column| column_width(table, column, precision) + 2.0 * TABCOLSEP).sum();
    width - numbers
}

/// Selects the first layout in which the table is at most `width` points wide.
fn layout(table: &Table, width: f64) -> TableLayout {
    let columns = table.columns.len();
    let names = names_width(table);
    // Prefer breaking a long name over dropping the decimals of all intervals.
    for (precision, min_width) in
        [(Precision::Tenths, names.min(MIN_NAME_WIDTH_WITH_DECIMALS)), (Precision::Whole, names.min(MIN_NAME_WIDTH))]
    {
        let all = 1..columns;
        let available = width_for_names(table, width, precision, &all);
        if available >= min_width {
            return TableLayout { precision, name_width: available.min(names), parts: vec![all] };
        }
    }
    let min_width = names.min(MIN_NAME_WIDTH);
    for number in 2..columns.max(3) {
        let part_columns = (columns - 1).div_ceil(number).max(1);
        let parts: Vec<Range<usize>> =
            (1..columns).step_by(part_columns).map(|start| start..(start + part_columns).min(columns)).collect();
        let available = parts
            .iter()
            .map(|part| width_for_names(table, width, Precision::Whole, part))
            .fold(f64::INFINITY, f64::min);
        if available >= min_width || part_columns == 1 {
            return TableLayout {
                precision: Precision::Whole,
                name_width: available.min(names).max(min_width.min(available)),
                parts,
            };
        }
    }
    TableLayout { precision: Precision::Whole, name_width: min_width, parts: std::iter::once(1..columns).collect() }
}

/// True if a text, without white space at its end, is at most `width` points wide.
fn fits(font: &Font, text: &str, width: f64) -> bool {
    font.width(text.trim_end(), FONT_SIZE) * WIDER <= width
}

/// Breaks a name into lines of at most `width` points: after "-", "/", "_", ":" or a space, and within a piece only if
/// it is too wide.
fn name_lines(name: &str, width: f64) -> Vec<String> {
    let font = Font::bundled();
    let mut lines = vec![String::new()];
    for piece in name.split_inclusive(['-', '/', '_', ':', ' ']) {
        let last = lines.last().map_or("", String::as_str);
        if !last.is_empty() && !fits(&font, &format!("{last}{piece}"), width) {
            lines.push(String::new());
        }
        for letter in piece.chars() {
            let last = lines.last().map_or("", String::as_str);
            if !last.is_empty() && !fits(&font, &format!("{last}{letter}"), width) {
                lines.push(String::new());
            }
            if let Some(line) = lines.last_mut() {
                line.push(letter);
            }
        }
    }
    lines.into_iter().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect()
}

/// LaTeX of a row's name, broken into lines and bold if the row is the best.
fn name_latex(row: &TableRow, width: f64) -> String {
    let lines: Vec<String> = name_lines(&row_name(row), width)
        .iter()
        .map(|line| {
            let line = latex(line);
            if row.is_best { format!("\\textbf{{{line}}}") } else { line }
        })
        .collect();
    match &*lines {
        [single] => single.clone(),
        _ => format!("\\dqname{{{}}}", lines.join("\\\\")),
    }
}

/// Escapes a text for LaTeX.
fn latex(plain: &str) -> String {
    escape(plain).replace('–', "--").replace('↓', "$\\downarrow$")
}

/// LaTeX of a number above its interval.
fn cell_latex(cell: &TableCell, precision: Precision) -> String {
    let number = latex(&value_text(cell));
    let Some(interval) = interval_text(cell, precision) else {
        return number;
    };
    let number = match cell {
        TableCell::Below(_) => format!("{number}$\\downarrow$"),
        TableCell::Effect(_, result) if result.is_shown() => format!("\\textbf{{{number}}}"),
        _ => number,
    };
    format!("\\dqci{{{number}}}{{{}}}", latex(&interval))
}

/// LaTeX of the heads and rows of a part, with rules between groups of rows. `after_heads` is written after the heads.
fn body(table: &Table, layout: &TableLayout, part: &Range<usize>, after_heads: &str) -> String {
    let mut body = String::from("    \\toprule\n   ");
    for column in &table.columns[part.clone()] {
        let lines: Vec<String> = head_lines(column).into_iter().map(latex).collect();
        match &*lines {
            [single] => {
                let _ = write!(body, " & {single}");
            }
            _ => {
                let _ = write!(body, " & \\dqhead{{{}}}", lines.join("\\\\"));
            }
        }
    }
    body += " \\\\\n";
    body += after_heads;
    for (index, (heading, row)) in table.headed_rows_in(TableFormat::Latex).enumerate() {
        if index == 0 || heading.is_some() {
            body += "    \\midrule\n";
        }
        if let Some(heading) = heading.filter(|heading| !heading.is_empty()) {
            let _ = writeln!(
                body,
                "    \\multicolumn{{{}}}{{@{{}}l@{{}}}}{{\\textit{{{}}}}} \\\\",
                part.len() + 1,
                latex(heading)
            );
        }
        let cells: Vec<String> =
            row.cells[part.clone()].iter().map(|cell| cell_latex(cell, layout.precision)).collect();
        let name = name_latex(row, layout.name_width);
        let _ = writeln!(body, "    {name} & {} \\\\", cells.join(" & "));
    }
    body + "    \\bottomrule\n"
}

/// LaTeX of a table as a float of the given environment.
fn float_table(table: &Table, float: &str, width: f64) -> String {
    let layout = layout(table, width);
    let mut all = format!(
        "\n\\begin{{{float}}}\n  \\centering\n  \\caption{{{}}}\n  \\fontsize{{8}}{{9.5}}\\selectfont\\setlength{{\\tabcolsep}}{{{TABCOLSEP}pt}}\n",
        latex(&table.caption)
    );
    for (index, part) in layout.parts.iter().enumerate() {
        if index > 0 {
            all += "\n  \\medskip\n";
        }
        let columns = format!("@{{}}l*{{{}}}{{r}}@{{}}", part.len());
        let _ =
            write!(all, "  \\begin{{tabular}}{{{columns}}}\n{}  \\end{{tabular}}\n", body(table, &layout, part, ""));
    }
    all + &format!("\\end{{{float}}}\n")
}

/// LaTeX of a table that can break across pages.
fn long_table(table: &Table, width: f64) -> String {
    let layout = layout(table, width);
    let mut all = String::from("\n{\\fontsize{8}{9.5}\\selectfont\\setlength{\\tabcolsep}{2.6pt}\n");
    for part in &layout.parts {
        let columns = format!("@{{}}l*{{{}}}{{r}}@{{}}", part.len());
        let _ = write!(
            all,
            "\\begin{{longtable}}{{{columns}}}\n    \\caption{{{}}} \\\\\n{}\\end{{longtable}}\n",
            latex(&table.caption),
            body(table, &layout, part, "    \\endhead\n")
        );
    }
    all + "}\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::charts::paper::FigureColours;
    use crate::text::table::ColumnHeads;

    fn table(names: &[&str], columns: usize) -> Table {
        let cell = TableCell::Below(Estimate { value: 1.0, low: 0.788, high: 1.0, n: 40 });
        let heads = (0..columns).map(|level| format!("L{level}"));
        let rows = names.iter().map(|name| TableRow {
            cells: std::iter::once(TableCell::from(*name)).chain(vec![cell.clone(); columns]).collect(),
            group: Some("raw".to_owned()),
            is_best: *name == names[0],
            ..TableRow::default()
        });
        Table {
            caption: "50 % of a_b & c".to_owned(),
            columns: std::iter::once(String::new())
                .chain(heads)
                .map(|head| Column {
                    kind: ColumnKind::Accuracy,
                    heads: ColumnHeads { page: Some(head), ..ColumnHeads::default() },
                })
                .collect(),
            rows: rows.collect(),
            ..Table::default()
        }
    }

    /// Width of a part in points.
    fn width(table: &Table, layout: &TableLayout, part: &Range<usize>) -> f64 {
        let font = Font::bundled();
        let names = table
            .rows
            .iter()
            .flat_map(|row| name_lines(&row_name(row), layout.name_width))
            .map(|line| font.width(&line, FONT_SIZE))
            .fold(0.0, f64::max);
        let columns: f64 =
            part.clone().map(|column| column_width(table, column, layout.precision) + 2.0 * TABCOLSEP).sum();
        names + columns
    }

    #[test]
    fn tables_fit_the_columns_of_papers() {
        let long = "a-model-with-a-name-of-30-letters";
        let unbroken = "amodelwithanameofthirtylettersandnohyphen";
        for names in [vec!["sim-A", "sim-B"], vec![long, "sim"], vec![unbroken]] {
            for columns in [1, 6, 12] {
                let table = table(&names, columns);
                for max_width in [219.1, 237.1, 252.0, 397.5, 516.0] {
                    let layout = layout(&table, max_width);
                    for part in &layout.parts {
                        let width = width(&table, &layout, part);
                        assert!(width <= max_width + 1e-9, "{names:?} {columns} {max_width}: {layout:?} {width}");
                    }
                    let all: usize = layout.parts.iter().map(Range::len).sum();
                    assert_eq!(all, columns);
                    let joined = name_lines(names[0], layout.name_width).concat();
                    assert_eq!(joined, names[0]);
                }
            }
        }
        // A table that fits is not divided and keeps its decimals.
        let narrow = layout(&table(&["sim-A"], 6), 516.0);
        assert_eq!((narrow.precision, narrow.parts.len()), (Precision::Tenths, 1));
        assert!(layout(&table(&[long], 12), 219.1).parts.len() > 1);
    }

    fn look(width: f64) -> Look {
        Look { width, font_size: 8.0, palette: FigureColours::Colour }
    }

    #[test]
    fn short_tables_are_floats_and_long_ones_longtables() {
        let (files, long) = tables(&[table(&["a_1", "b"], 2)], &look(252.0), false);
        let text = String::from_utf8(files[0].1.clone()).unwrap();
        assert_eq!((files.len(), long), (1, 0));
        for part in [
            "\\begin{table}",
            "50 \\% of a\\_b \\& c",
            "\\textbf{a\\_1} & \\dqci{100.0$\\downarrow$}{78.8--100.0}",
            "\\multicolumn{3}{@{}l@{}}{\\textit{raw}}",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!text.contains("\\textbf{b}"));
        let names: Vec<String> = (0..41).map(|model| format!("m{model}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let (files, long) = tables(&[table(&names, 2)], &look(252.0), true);
        assert_eq!((files.len(), long), (2, 1));
        let full = String::from_utf8(files[1].1.clone()).unwrap();
        assert!(full.contains("\\begin{longtable}") && full.contains("\\endhead"));
        assert!(!String::from_utf8(files[0].1.clone()).unwrap().contains("\\begin{table"));
    }
}
