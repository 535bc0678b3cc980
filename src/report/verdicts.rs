//! What the numbers show, in the terminal: thresholds, and every comparison with its verdict.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table};

use super::subject::{light, name, p, percent, points, reach, stops};
use super::table::plain;
use crate::score::comparison::{Comparison, Kind, Verdict};
use crate::score::findings::Findings;

/// Thresholds and comparisons, all families together; nothing where there is one condition alone.
#[must_use]
pub fn render(findings: &Findings<'_>) -> String {
    let mut text = String::new();
    let unit = findings.unit;
    if let Some(table) = thresholds(findings) {
        let _ = writeln!(
            text,
            "Darkness threshold in EV (half-way from L0 to chance) and mean accuracy in %, with 95 % intervals by {unit}\n{table}"
        );
    }
    for kind in [Kind::Variant, Kind::Enhancer, Kind::Model, Kind::Blind] {
        if let Some(table) = compared(findings, kind) {
            let _ = writeln!(text, "{}\n{table}", title(kind));
        }
    }
    text
}

/// That models with images are better than without in every condition, where they are: the table of it says no more.
fn always_better(rows: &[&Comparison]) -> Option<String> {
    let better = rows.iter().all(|one| one.verdict == Verdict::Better);
    better.then(|| format!("better in all {} conditions\n", rows.len()))
}

fn title(kind: Kind) -> &'static str {
    match kind {
        Kind::Level => "Darkness against L0, paired by question",
        Kind::Variant => "Sensor noise against exposure drop alone, paired by question",
        Kind::Enhancer => "Enhanced against raw, paired by question",
        Kind::Model => "Model against model, paired by question",
        Kind::Blind => "With images against without, paired by question",
    }
}

fn thresholds(findings: &Findings<'_>) -> Option<Table> {
    let mut table = plain();
    table.set_header(["model", "light", "threshold", "interval", "mean accuracy"]);
    for curve in findings
        .curves
        .iter()
        .filter(|curve| curve.family.is_none())
    {
        let darkest = curve.darkest.value();
        let (value, interval) = match curve.threshold {
            None => ("–".to_owned(), "not above chance at L0".to_owned()),
            Some(threshold) => (
                stops(threshold.value, darkest),
                reach(threshold.low, threshold.high, darkest),
            ),
        };
        let half = percent((curve.area.high - curve.area.low) / 2.0);
        table.add_row([
            curve.model.clone(),
            light(&curve.variant, curve.enhancer.as_ref()),
            value,
            interval,
            format!("{} ±{half}", percent(curve.area.value)),
        ]);
    }
    (table.row_count() > 0).then_some(table)
}

/// The most rows of a kind that are printed; all of them are in `comparisons.csv`.
const MOST: usize = 40;

fn compared(findings: &Findings<'_>, kind: Kind) -> Option<String> {
    let all = findings.comparisons.iter();
    let rows: Vec<&Comparison> = all
        .filter(|one| one.kind == kind && one.family.is_none())
        // Blind models are held against raw images here; against enhanced ones in the file.
        .filter(|one| kind != Kind::Blind || one.first.enhancer.is_none())
        .collect();
    if rows.is_empty() {
        return None;
    }
    if kind == Kind::Blind
        && let Some(line) = always_better(&rows)
    {
        return Some(line);
    }
    let mut table = plain();
    table.set_header([
        "",
        "difference",
        "95 % interval",
        "only first",
        "only second",
        "p (Holm)",
        "",
    ]);
    for one in rows.iter().take(MOST) {
        let paired = &one.paired;
        let difference = paired.difference;
        table.add_row([
            named(one),
            points(difference.value),
            format!("{} to {}", points(difference.low), points(difference.high)),
            paired.gained.to_string(),
            paired.lost.to_string(),
            p(one.holm),
            one.verdict.word().to_owned(),
        ]);
    }
    for column in table.column_iter_mut().skip(1).take(5) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let mut text = table.to_string();
    if rows.len() > MOST {
        let more = rows.len() - MOST;
        let _ = write!(text, "\n{more} more rows are in comparisons.csv");
    }
    Some(text)
}

/// What is compared, in one cell.
fn named(one: &Comparison) -> String {
    let (first, second) = (&one.first, &one.second);
    match one.kind {
        Kind::Model => format!("{} – {}, {}", first.model, second.model, first.condition()),
        _ if first.model == second.model => name(first),
        _ => format!("{} – {}", name(first), second.model),
    }
}
