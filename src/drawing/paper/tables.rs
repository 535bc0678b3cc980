//! Tables of a paper as LaTeX that fit its columns: [`tables`].
//!
//! A table is set in letters of 8 pt, its intervals in 5 pt. Whether it fits is reckoned with the widths of the bundled font, which is
//! wider than Times, in which these papers are set; the first form that fits is taken: intervals with a decimal, without, names in
//! several lines, and at last the columns in several parts below one another.

use std::fmt::Write;
use std::ops::Range;

use super::font::Font;
use super::look::Look;
use crate::text::latex::{MAX_ROWS, escape};
use crate::text::table::{Column, ColumnKind, Table, TableCell, TableFormat, TableRow};
use crate::text::words::{interval, words};

/// Heights of letters of tables and of intervals, in points.
const LETTERS: f64 = 8.0;
const TINY: f64 = 5.0;
/// How much wider letters are than those of Arial: of 8 points, and tiny ones. Digits of Computer Modern have 0.531 em at 8 points and
/// 0.681 em at 5 points, those of Arial 0.556 em; letters of Times are narrower than both.
const WIDER: f64 = 1.08;
const TINY_WIDER: f64 = 1.23;
/// Half of the room between two columns, in points.
const TABCOLSEP: f64 = 2.6;
/// Least width of the column of names, in points, and the least beside intervals with a decimal.
const LEAST_NAME: f64 = 45.0;
const AMPLE_NAME: f64 = 60.0;

/// The commands of the tables: a number above its interval, a name in lines, and a head in lines.
const COMMANDS: &str = "\
\\providecommand{\\dqci}[2]{\\begin{tabular}[t]{@{}r@{}}#1\\\\[-3.5pt]{\\fontsize{5}{5.5}\\selectfont #2}\\end{tabular}}
\\providecommand{\\dqname}[1]{\\begin{tabular}[t]{@{}l@{}}#1\\end{tabular}}
\\providecommand{\\dqhead}[1]{\\begin{tabular}[b]{@{}r@{}}#1\\end{tabular}}
";

/// Decimals of the ends of intervals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ends {
    Tenths,
    Whole,
}

/// How a table is set.
#[derive(Debug, Clone, PartialEq)]
struct Form {
    ends: Ends,
    /// Room for names, in points.
    names: f64,
    /// The columns of each part; the first column of a table is its names.
    parts: Vec<Range<usize>>,
}

/// The files of the tables by name, and the number of long tables: `tables.tex`, and `tables-full.tex` if there are tables of more than
/// forty rows.
pub(crate) fn tables(all: &[Table], look: &Look, is_wide: bool) -> (Vec<(String, Vec<u8>)>, usize) {
    let (long, short): (Vec<&Table>, Vec<&Table>) =
        all.iter().partition(|table| table.rows.len() > MAX_ROWS);
    let float = if is_wide { "table*" } else { "table" };
    let mut text =
        format!("% Tables of darkqa-eval. In the preamble: \\usepackage{{booktabs}}\n{COMMANDS}");
    for table in &short {
        text += &floating(table, float, look.width);
    }
    let mut files = vec![("tables.tex".to_owned(), text.into_bytes())];
    if !long.is_empty() {
        let mut text = String::from(
            "% Long tables of darkqa-eval, for text in one column. In the preamble: \\usepackage{booktabs,longtable}\n",
        ) + COMMANDS;
        for table in &long {
            text += &breaking(table, look.width);
        }
        files.push(("tables-full.tex".to_owned(), text.into_bytes()));
    }
    (files, long.len())
}

/// The ends of an interval in tiny letters.
fn ends(cell: &TableCell, ends: Ends) -> Option<String> {
    let of = interval(ColumnKind::Accuracy, cell)?;
    let number = |share: f64| {
        let text = match ends {
            Ends::Tenths => format!("{:.1}", 100.0 * share),
            Ends::Whole => format!("{:.0}", 100.0 * share),
        };
        match text.as_str() {
            "-0.0" => "0.0".to_owned(),
            "-0" => "0".to_owned(),
            _ => text.replace('-', "−"),
        }
    };
    // "to" is a comma where ends have signs.
    let between = if value(cell).contains(['+', '−']) {
        ", "
    } else {
        "–"
    };
    Some(format!("{}{between}{}", number(of.low), number(of.high)))
}

fn value(cell: &TableCell) -> String {
    words(ColumnKind::Accuracy, cell)
}

fn name(row: &TableRow) -> String {
    words(ColumnKind::Text, &row.cells[0])
}

fn head(column: &Column) -> &str {
    column.heads.page.as_deref().unwrap_or_default()
}

/// Width in points of a column of numbers.
fn column_width(table: &Table, column: usize, form: Ends) -> f64 {
    let font = Font::bundled();
    let head = head_lines(head(&table.columns[column]));
    let head = head.iter().map(|line| font.width(line, LETTERS));
    let cells = table.rows.iter().map(|row| {
        let cell = &row.cells[column];
        let arrow = match cell {
            TableCell::Below(_) => font.width("↓", LETTERS),
            _ => 0.0,
        };
        let value = font.width(&value(cell), LETTERS) * WIDER + arrow;
        value.max(ends(cell, form).map_or(0.0, |ends| font.width(&ends, TINY) * TINY_WIDER))
    });
    head.chain(cells).fold(0.0, f64::max)
}

/// The words of a head, one a line.
fn head_lines(head: &str) -> Vec<&str> {
    head.split_whitespace().collect()
}

/// Width in points of the widest name, all on one line.
fn names_width(table: &Table) -> f64 {
    let font = Font::bundled();
    table
        .rows
        .iter()
        .map(|row| font.width(&name(row), LETTERS) * WIDER)
        .fold(0.0, f64::max)
}

/// The first form in which the table is no wider than `width` points.
fn form(table: &Table, width: f64) -> Form {
    let columns = table.columns.len();
    let room = |ends: Ends, part: &Range<usize>| {
        let numbers: f64 = part
            .clone()
            .map(|column| column_width(table, column, ends) + 2.0 * TABCOLSEP)
            .sum();
        width - numbers
    };
    let names = names_width(table);
    // One long name costs a line of its own sooner than a decimal of all intervals.
    for (ends, least) in [
        (Ends::Tenths, names.min(AMPLE_NAME)),
        (Ends::Whole, names.min(LEAST_NAME)),
    ] {
        let all = 1..columns;
        let room = room(ends, &all);
        if room >= least {
            return Form {
                ends,
                names: room.min(names),
                parts: vec![all],
            };
        }
    }
    let least = names.min(LEAST_NAME);
    for number in 2..columns.max(3) {
        let each = (columns - 1).div_ceil(number).max(1);
        let starts = (1..columns).step_by(each);
        let parts: Vec<Range<usize>> = starts
            .map(|start| start..(start + each).min(columns))
            .collect();
        let room = parts
            .iter()
            .map(|part| room(Ends::Whole, part))
            .fold(f64::INFINITY, f64::min);
        if room >= least || each == 1 {
            return Form {
                ends: Ends::Whole,
                names: room.min(names).max(least.min(room)),
                parts,
            };
        }
    }
    Form {
        ends: Ends::Whole,
        names: least,
        parts: std::iter::once(1..columns).collect(),
    }
}

/// A name in lines of at most `room` points, broken after "-", "/", "_", ":" and spaces, and where nothing else is left, anywhere.
fn name_lines(name: &str, room: f64) -> Vec<String> {
    let font = Font::bundled();
    let fits = |text: &str| font.width(text.trim_end(), LETTERS) * WIDER <= room;
    let mut lines = vec![String::new()];
    for piece in name.split_inclusive(['-', '/', '_', ':', ' ']) {
        let last = lines.last().map_or("", String::as_str);
        if !last.is_empty() && !fits(&format!("{last}{piece}")) {
            lines.push(String::new());
        }
        for letter in piece.chars() {
            let last = lines.last().map_or("", String::as_str);
            if !last.is_empty() && !fits(&format!("{last}{letter}")) {
                lines.push(String::new());
            }
            if let Some(line) = lines.last_mut() {
                line.push(letter);
            }
        }
    }
    lines
        .into_iter()
        .map(|line| line.trim().to_owned())
        .filter(|line| !line.is_empty())
        .collect()
}

fn name_text(row: &TableRow, room: f64) -> String {
    let lines = name_lines(&name(row), room);
    let lines: Vec<String> = lines
        .iter()
        .map(|line| {
            let line = text(line);
            if row.is_best {
                format!("\\textbf{{{line}}}")
            } else {
                line
            }
        })
        .collect();
    match &*lines {
        [single] => single.clone(),
        _ => format!("\\dqname{{{}}}", lines.join("\\\\")),
    }
}

/// Text of LaTeX.
fn text(plain: &str) -> String {
    escape(plain)
        .replace('–', "--")
        .replace('↓', "$\\downarrow$")
}

fn cell_text(cell: &TableCell, form: Ends) -> String {
    let number = text(&value(cell));
    let Some(ends) = ends(cell, form) else {
        return number;
    };
    let number = match cell {
        TableCell::Below(_) => format!("{number}$\\downarrow$"),
        TableCell::Effect(_, result) if result.is_shown() => format!("\\textbf{{{number}}}"),
        _ => number,
    };
    format!("\\dqci{{{number}}}{{{}}}", text(&ends))
}

/// The rows of a part with rules between their groups; `after_heads` is written after the heads.
fn body(table: &Table, form: &Form, part: &Range<usize>, after_heads: &str) -> String {
    let mut body = String::from("    \\toprule\n   ");
    for column in &table.columns[part.clone()] {
        let lines: Vec<String> = head_lines(head(column)).into_iter().map(text).collect();
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
    let rows = table.headed_rows_in(TableFormat::Latex);
    for (index, (heading, row)) in rows.enumerate() {
        if index == 0 || heading.is_some() {
            body += "    \\midrule\n";
        }
        if let Some(heading) = heading.filter(|heading| !heading.is_empty()) {
            let _ = writeln!(
                body,
                "    \\multicolumn{{{}}}{{@{{}}l@{{}}}}{{\\textit{{{}}}}} \\\\",
                part.len() + 1,
                text(heading)
            );
        }
        let cells: Vec<String> = row.cells[part.clone()]
            .iter()
            .map(|cell| cell_text(cell, form.ends))
            .collect();
        let name = name_text(row, form.names);
        let _ = writeln!(body, "    {name} & {} \\\\", cells.join(" & "));
    }
    body + "    \\bottomrule\n"
}

fn floating(table: &Table, float: &str, width: f64) -> String {
    let form = form(table, width);
    let mut all = format!(
        "\n\\begin{{{float}}}\n  \\centering\n  \\caption{{{}}}\n  \\fontsize{{8}}{{9.5}}\\selectfont\\setlength{{\\tabcolsep}}{{{TABCOLSEP}pt}}\n",
        text(&table.caption)
    );
    for (index, part) in form.parts.iter().enumerate() {
        if index > 0 {
            all += "\n  \\medskip\n";
        }
        let columns = format!("@{{}}l*{{{}}}{{r}}@{{}}", part.len());
        let _ = write!(
            all,
            "  \\begin{{tabular}}{{{columns}}}\n{}  \\end{{tabular}}\n",
            body(table, &form, part, "")
        );
    }
    all + &format!("\\end{{{float}}}\n")
}

fn breaking(table: &Table, width: f64) -> String {
    let form = form(table, width);
    let mut all =
        String::from("\n{\\fontsize{8}{9.5}\\selectfont\\setlength{\\tabcolsep}{2.6pt}\n");
    for part in &form.parts {
        let columns = format!("@{{}}l*{{{}}}{{r}}@{{}}", part.len());
        let _ = write!(
            all,
            "\\begin{{longtable}}{{{columns}}}\n    \\caption{{{}}} \\\\\n{}\\end{{longtable}}\n",
            text(&table.caption),
            body(table, &form, part, "    \\endhead\n")
        );
    }
    all + "}\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::paper::Palette;
    use crate::text::table::ColumnHeads;
    use darkqa_score::estimate::Estimate;

    fn table(names: &[&str], columns: usize) -> Table {
        let cell = TableCell::Below(Estimate {
            value: 1.0,
            low: 0.788,
            high: 1.0,
            n: 40,
        });
        let column = |head: String| Column {
            kind: ColumnKind::Accuracy,
            heads: ColumnHeads {
                page: Some(head),
                ..ColumnHeads::default()
            },
        };
        let heads = (0..columns).map(|level| format!("L{level}"));
        let rows = names.iter().map(|name| TableRow {
            cells: std::iter::once(TableCell::from(*name))
                .chain(vec![cell.clone(); columns])
                .collect(),
            group: Some("raw".to_owned()),
            is_best: *name == names[0],
            ..TableRow::default()
        });
        Table {
            caption: "50 % of a_b & c".to_owned(),
            columns: std::iter::once(String::new())
                .chain(heads)
                .map(column)
                .collect(),
            rows: rows.collect(),
            ..Table::default()
        }
    }

    /// The width of a part in a form, by the widths of the letters.
    fn width(table: &Table, form: &Form, part: &Range<usize>) -> f64 {
        let font = Font::bundled();
        let names = table
            .rows
            .iter()
            .flat_map(|row| name_lines(&name(row), form.names))
            .map(|line| font.width(&line, LETTERS))
            .fold(0.0, f64::max);
        let columns = part
            .clone()
            .map(|column| column_width(table, column, form.ends));
        names + columns.map(|width| width + 2.0 * TABCOLSEP).sum::<f64>()
    }

    #[test]
    fn tables_fit_the_columns_of_papers() {
        let long = "a-model-with-a-name-of-30-letters";
        let unbroken = "amodelwithanameofthirtylettersandnohyphen";
        for names in [vec!["sim-A", "sim-B"], vec![long, "sim"], vec![unbroken]] {
            for columns in [1, 6, 12] {
                let table = table(&names, columns);
                for room in [219.1, 237.1, 252.0, 397.5, 516.0] {
                    let form = form(&table, room);
                    for part in &form.parts {
                        let width = width(&table, &form, part);
                        assert!(
                            width <= room + 1e-9,
                            "{names:?} {columns} {room}: {form:?} {width}"
                        );
                    }
                    let all: usize = form.parts.iter().map(Range::len).sum();
                    assert_eq!(all, columns);
                    let whole = name_lines(names[0], form.names).concat();
                    assert_eq!(whole, names[0]);
                }
            }
        }
        // What fits whole stays whole.
        let easy = form(&table(&["sim-A"], 6), 516.0);
        assert_eq!((easy.ends, easy.parts.len()), (Ends::Tenths, 1));
        assert!(form(&table(&[long], 12), 219.1).parts.len() > 1);
    }

    #[test]
    fn marks_are_latex_and_long_tables_are_no_floats() {
        let look = |width| Look {
            width,
            letters: 8.0,
            palette: Palette::Colour,
        };
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
        assert!(
            !String::from_utf8(files[0].1.clone())
                .unwrap()
                .contains("\\begin{table")
        );
    }
}
