//! Every difference with its test, a table a kind of comparison: all families together, and by family.

use super::sections::ENHANCERS;
use crate::report::table::ColumnKind::{self, Count, Number, P, Percent, Points, Text};
use crate::report::table::{Table, TableBuilder, TableFormat};
use crate::report::words::name;
use crate::score::comparison::{Comparison, ComparisonKind, Significance};
use crate::score::findings::Findings;

/// The most rows of a kind in the terminal; all of them are in the file.
const MOST: usize = 40;

pub(super) fn comparisons(findings: &Findings<'_>) -> Vec<Table> {
    let mut tables = Vec::new();
    for kind in ComparisonKind::ALL {
        let all = findings.comparisons.iter().filter(|one| one.kind == kind);
        let (whole, parts): (Vec<&Comparison>, Vec<&Comparison>) =
            all.partition(|one| one.family.is_none());
        let (caption, heading) = titles(kind);
        let mut total = table(kind, caption, &whole);
        total.is_folded = kind != ComparisonKind::Enhancer;
        if !whole.is_empty() {
            total.heading = heading.map(str::to_owned);
            if kind == ComparisonKind::Enhancer {
                let caption = "Enhanced against raw, paired by question, in percentage points.";
                total.latex = Some(caption.to_owned());
            }
            shorten(&mut total, kind, &whole);
        }
        let mut parts = table(kind, &format!("{caption}, by family"), &parts);
        parts.is_folded = true;
        tables.extend([total, parts]);
    }
    tables
}

/// The caption on the page, and the line above the table in the terminal, where what darkness costs is read from the levels.
fn titles(kind: ComparisonKind) -> (&'static str, Option<&'static str>) {
    match kind {
        ComparisonKind::Level => ("Each dark level less L0, raw", None),
        ComparisonKind::Variant => (
            "Sensor noise less exposure drop alone",
            Some("Sensor noise against exposure drop alone, paired by question"),
        ),
        ComparisonKind::Enhancer => (
            "Enhanced less raw",
            Some("Enhanced against raw, paired by question"),
        ),
        ComparisonKind::Model => (
            "Model less model",
            Some("Model against model, paired by question"),
        ),
        ComparisonKind::Blind => (
            "With images less without",
            Some("With images against without, paired by question"),
        ),
    }
}

/// Leaves out of the terminal what is there too much.
fn shorten(table: &mut Table, kind: ComparisonKind, comparisons: &[&Comparison]) {
    let mut printed: Vec<usize> = (0..comparisons.len()).collect();
    if kind == ComparisonKind::Blind {
        // Blind models are held against raw images here; against enhanced ones in the file.
        printed.retain(|index| comparisons[*index].first.enhancer.is_none());
        let is_better = |index: &usize| comparisons[*index].verdict == Significance::Better;
        if !printed.is_empty() && printed.iter().all(is_better) {
            let line = format!("better in all {} conditions", printed.len());
            table.notes.push(line);
            printed.clear();
        }
    }
    if printed.len() > MOST {
        let more = printed.len() - MOST;
        let line = format!("{more} more rows are in comparisons.csv");
        table.notes.push(line);
        printed.truncate(MOST);
    }
    for (index, row) in table.rows.iter_mut().enumerate() {
        if !printed.contains(&index) {
            row.hidden_in.push(TableFormat::Terminal);
        }
    }
}

fn table(kind: ComparisonKind, caption: &str, comparisons: &[&Comparison]) -> Table {
    let section = match kind {
        ComparisonKind::Enhancer => ENHANCERS,
        _ => "comparisons",
    };
    let layout =
        TableBuilder::new("comparisons", comparisons.iter().copied()).page(section, caption);
    let layout = numbers(whom(layout));
    layout
        .column(
            ColumnKind::Significance,
            "csv verdict | terminal | page | latex",
            |one| one.verdict,
        )
        .made()
}

/// What is compared with what.
fn whom(layout: TableBuilder<&Comparison>) -> TableBuilder<&Comparison> {
    layout
        .column(Text, "csv kind", |one| one.kind.name())
        .column(Text, "csv model | latex Model", |one| {
            one.first.model.clone()
        })
        .column(Text, "csv condition | latex Condition", |one| {
            one.first.condition()
        })
        .column(Text, "csv against_model", |one| one.second.model.clone())
        .column(Text, "csv against_condition", |one| one.second.condition())
        .column(Text, "terminal", |one| named(one))
        .column(Text, "page first", |one| name(&one.first))
        .column(Text, "page second", |one| name(&one.second))
        .family(|one| one.family.as_ref())
}

fn numbers(layout: TableBuilder<&Comparison>) -> TableBuilder<&Comparison> {
    let difference = "csv difference low high | terminal difference, 95 % interval | page difference [95 %] \
                      | latex Difference [95\\,\\%]";
    layout
        .column(Count, "csv n", |one| one.paired.difference.n)
        .column(Number, "csv first", |one| one.paired.first)
        .column(Percent, "csv second | latex Raw", |one| one.paired.second)
        .column(Percent, "latex Enhanced", |one| one.paired.first)
        .column(Points, difference, |one| one.paired.difference)
        .column(Count, "latex Rescued / harmed", |one| {
            format!("{} / {}", one.paired.gained, one.paired.lost)
        })
        .column(
            Count,
            "csv only_first | terminal only first | page only first",
            |one| one.paired.gained,
        )
        .column(
            Count,
            "csv only_second | terminal only second | page only second",
            |one| one.paired.lost,
        )
        .column(Count, "page n", |one| one.paired.difference.n)
        .column(P, "csv p_mcnemar | page p (McNemar)", |one| {
            one.paired.mcnemar
        })
        .column(P, "csv p | page p", |one| one.paired.p)
        .column(
            P,
            "csv p_holm | terminal p (Holm) | page p (Holm) | latex $p$ (Holm)",
            |one| one.holm,
        )
}

/// What is compared, in one cell.
fn named(one: &Comparison) -> String {
    let (first, second) = (&one.first, &one.second);
    match one.kind {
        ComparisonKind::Model => {
            format!("{} – {}, {}", first.model, second.model, first.condition())
        }
        _ if first.model == second.model => name(first),
        _ => format!("{} – {}", name(first), second.model),
    }
}
