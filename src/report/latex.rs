//! The main tables for a paper, as LaTeX with booktabs: [`tables`].

use std::fmt::Write;

use super::ladder::Ladder;
use super::subject::{family as family_name, p, percent, points};
use crate::score::accuracy::Cell;
use crate::score::choice::Mode;
use crate::score::comparison::{Kind, Verdict};
use crate::score::findings::Findings;

/// The tables: accuracy by level, accuracy by family with what is below blind marked, enhanced against raw.
#[must_use]
pub fn tables(findings: &Findings<'_>) -> String {
    let mut text =
        String::from("% Tables of darkqa-eval; \\usepackage{booktabs} in the preamble.\n");
    text += &accuracy(findings);
    text += &families(findings);
    text += &enhancers(findings).unwrap_or_default();
    text
}

/// Escapes what LaTeX reads as its own.
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

pub(super) fn table(caption: &str, columns: &str, head: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("    {} \\\\\n", cells.join(" & "));
    let mut text = String::from("\n\\begin{table}\n  \\centering\n");
    let _ = writeln!(text, "  \\caption{{{caption}}}");
    let _ = writeln!(text, "  \\begin{{tabular}}{{{columns}}}\n    \\toprule");
    text += &line(head);
    text += "    \\midrule\n";
    for row in rows {
        text += &line(row);
    }
    text + "    \\bottomrule\n  \\end{tabular}\n\\end{table}\n"
}

/// Accuracy with half of its interval.
fn shown(cell: Option<&Cell>) -> String {
    cell.and_then(|cell| cell.accuracy).map_or_else(
        || "--".to_owned(),
        |a| {
            format!(
                "{} {{\\scriptsize$\\pm${}}}",
                percent(a.value),
                percent((a.high - a.low) / 2.0)
            )
        },
    )
}

/// A row a model, variant and enhancer; a column a level.
fn accuracy(findings: &Findings<'_>) -> String {
    let Ladder {
        levels,
        series,
        floors,
    } = Ladder::new(&findings.summary);
    let rows = series.iter().map(|(series, cells)| {
        let at = levels.iter().map(|level| {
            let cell = cells.get(level);
            cell.map_or(String::new(), |cell| shown(Some(cell)))
        });
        let name = [escaped(series.model), escaped(&series.light())];
        name.into_iter().chain(at).collect()
    });
    let mut rows: Vec<Vec<String>> = rows.collect();
    for cell in floors {
        let name = match cell.subject.view {
            Some(_) => format!("{} without images", cell.subject.model),
            None => "chance".to_owned(),
        };
        let mut row = vec![escaped(&name), String::new(), shown(Some(cell))];
        row.resize(levels.len() + 2, String::new());
        rows.push(row);
    }
    let head: Vec<String> = ["Model", "Light"]
        .map(str::to_owned)
        .into_iter()
        .chain(levels.iter().map(ToString::to_string))
        .collect();
    let caption = format!(
        "Accuracy in \\% (strict reading) with half of the 95\\,\\% interval by {}; {} items.",
        findings.unit,
        findings.grid.items.len()
    );
    table(
        &caption,
        &format!("ll{}", "r".repeat(levels.len())),
        &head,
        &rows,
    )
}

/// A row a subject with images and without; a column a family. What is below a model without images is underlined.
fn families(findings: &Findings<'_>) -> String {
    let families = findings.grid.families();
    let rows = findings.grid.subjects.iter().map(|subject| {
        let cells = families.iter().map(|family| {
            let summary = &findings.summary;
            let cell = shown(summary.cell(subject, Some(family), Mode::Strict));
            if findings.below_blind(subject, Some(family)) {
                format!("\\underline{{{cell}}}")
            } else {
                cell
            }
        });
        let name = [escaped(&subject.model), escaped(&subject.condition())];
        name.into_iter().chain(cells).collect()
    });
    let mut rows: Vec<Vec<String>> = rows.collect();
    let chance = families.iter().map(|family| {
        let mut cells = findings.summary.of(Some(family), Mode::Strict);
        let cell = cells.find(|cell| cell.subject.view.is_none());
        let share = cell.and_then(|cell| cell.accuracy);
        share.map_or("--".to_owned(), |share| percent(share.value))
    });
    let name = ["chance".to_owned(), String::new()];
    rows.push(name.into_iter().chain(chance).collect());
    let names = families
        .iter()
        .map(|family| escaped(family_name(Some(family))));
    let head: Vec<String> = ["Model".to_owned(), "Condition".to_owned()]
        .into_iter()
        .chain(names)
        .collect();
    let caption = "Accuracy in \\% by family. Underlined: below a model without images (its own, where it was asked so).";
    table(
        caption,
        &format!("ll{}", "r".repeat(families.len())),
        &head,
        &rows,
    )
}

fn enhancers(findings: &Findings<'_>) -> Option<String> {
    let all = findings.comparisons.iter();
    let rows = all.filter(|one| one.kind == Kind::Enhancer && one.family.is_none());
    let rows = rows.map(|one| {
        let (paired, difference) = (&one.paired, one.paired.difference);
        vec![
            escaped(&one.first.model),
            escaped(&one.first.condition()),
            percent(paired.second),
            percent(paired.first),
            escaped(&format!(
                "{} [{}, {}]",
                points(difference.value),
                points(difference.low),
                points(difference.high)
            )),
            format!("{} / {}", paired.gained, paired.lost),
            escaped(&p(one.holm)),
            match one.verdict {
                Verdict::Better => "helps",
                Verdict::Worse => "harms",
                Verdict::Tied => "tied",
            }
            .to_owned(),
        ]
    });
    let rows: Vec<Vec<String>> = rows.collect();
    let head = [
        "Model",
        "Condition",
        "Raw",
        "Enhanced",
        "Difference [95\\,\\%]",
        "Rescued / harmed",
        "$p$ (Holm)",
        "",
    ];
    let caption = "Enhanced against raw, paired by question, in percentage points.";
    (!rows.is_empty()).then(|| table(caption, "llrrrrrl", &head.map(str::to_owned), &rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_breaks_a_table() {
        assert_eq!(
            escaped("50% a_b & {c} \\ ^~#$ −1 <"),
            "50\\% a\\_b \\& \\{c\\} \\textbackslash{} \\textasciicircum{}\\textasciitilde{}\\#\\$ $-$1 $<$"
        );
    }
}
