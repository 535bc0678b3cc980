//! Tables of paired differences and their tests. Each kind of comparison has a table over all families and one by
//! family.
//!
//! File of first failing levels, with a row for each item and curve: [`write_flips`]. The table can be large, so it is
//! written in parts.

use std::io::Write;
use std::ops::Range;

use super::pooled::too_few_clusters;
use super::sections::{COMPARISONS, ENHANCERS, REAL};
use crate::text::table::ColumnKind::{self, Count, Number, P, Percent, Points, Text};
use crate::text::table::{self, Column, Table, TableBuilder, TableCell, TableFormat};
use crate::text::words::{marked_reference, name};
use darkqa_base::error::Result;
use darkqa_base::types::text::counted;
use darkqa_score::accuracies::FirstFailure;
use darkqa_score::choice::ParsingMode;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Comparison, ComparisonKind, MAX_COMPARED_MODELS, MIN_PAIRS};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::models_under_test;
use darkqa_score::significance::Verdict;

/// Maximum number of rows that the terminal shows of one kind of comparison. The CSV file has all rows.
const MAX_ROWS: usize = 40;

/// Tables of the differences in accuracy. Files also have the rows with lenient parsing of replies.
pub(super) fn comparisons(findings: &Findings<'_>) -> Vec<Table> {
    let mut tables = tables_by_kind(&findings.comparisons, findings.unit, |kind| kind.accuracy);
    let note = compared_models_note(findings);
    for table in tables.iter_mut().filter(|table| table.caption == KindTable::of(ComparisonKind::Model).accuracy.0) {
        table.foot.clone_from(&note);
    }
    for kind in ComparisonKind::ALL {
        let all: Vec<&Comparison> = findings.comparisons.iter().filter(|comparison| comparison.kind == kind).collect();
        tables.push(table(kind, "", &all, ParsingMode::Lenient).in_files_only());
    }
    tables
}

/// Tables of the differences in agreement with the answers at L0. The file's last column is the name of the measure.
pub fn agreement_comparisons(comparisons: &[Comparison], unit: ClusterUnit, measure: &'static str) -> Vec<Table> {
    let mut tables = tables_by_kind(comparisons, unit, |kind| kind.agreement);
    for table in &mut tables {
        let caption = format!("{}, paired by question, in percentage points.", table.caption);
        table.latex = table.latex.as_ref().map(|_| caption);
        table.columns.push(Column { kind: Text, heads: "csv measure".into() });
        for row in &mut table.rows {
            for cell in &mut row.cells {
                // An answer that differs from the one at L0 is not necessarily worse.
                let verdict = match cell {
                    TableCell::Verdict(Verdict::Better) => "agrees more",
                    TableCell::Verdict(Verdict::Worse) => "agrees less",
                    _ => continue,
                };
                *cell = TableCell::Text(verdict.to_owned());
            }
            row.cells.push(measure.into());
        }
    }
    tables
}

/// Two tables for each kind of comparison: over all families, and by family.
///
/// `titles` chooses those of the measure.
fn tables_by_kind(comparisons: &[Comparison], unit: ClusterUnit, titles: fn(KindTable) -> Titles) -> Vec<Table> {
    let mut tables = Vec::new();
    for kind in ComparisonKind::ALL {
        let (overall, by_family): (Vec<&Comparison>, Vec<&Comparison>) = comparisons
            .iter()
            .filter(|comparison| comparison.kind == kind)
            .partition(|comparison| comparison.family.is_none());
        let (caption, heading) = titles(KindTable::of(kind));
        let least_p_values = overall.iter().map(|comparison| (comparison.least_holm, comparison.strict.clusters));
        let clusters_note = too_few_clusters(least_p_values, &unit.to_string());
        let mut overall_table = table(kind, caption, &overall, ParsingMode::Strict);
        overall_table.is_folded = KindTable::of(kind).is_folded;
        if !overall.is_empty() {
            overall_table.heading = heading.map(str::to_owned);
            if kind == ComparisonKind::Enhancer {
                let caption = "Enhanced against raw, paired by question, in percentage points.";
                overall_table.latex = Some(caption.to_owned());
            }
            hide_rows_in_terminal(&mut overall_table, kind, &overall);
            overall_table.notes.extend(clusters_note);
            overall_table.notes.extend(too_few_items(&overall));
        }
        let caption = format!("{caption}, by family");
        let mut family_table = table(kind, &caption, &by_family, ParsingMode::Strict);
        family_table.is_folded = true;
        tables.extend([overall_table, family_table]);
    }
    tables
}

/// What the tables of a kind of comparison have of their own.
struct KindTable {
    section: &'static str,
    /// True if the page shows the table only after a click.
    is_folded: bool,
    /// True if a column names the second side. Otherwise the kind determines it.
    names_second_side: bool,
    accuracy: Titles,
    /// Titles for differences in agreement with the answers at L0. L0 is then a second request with the same images.
    agreement: Titles,
}

/// Caption on the page, and heading in the terminal. A table without a heading is not in the terminal: it would repeat
/// another one.
type Titles = (&'static str, Option<&'static str>);

impl KindTable {
    const fn of(kind: ComparisonKind) -> Self {
        match kind {
            ComparisonKind::Level => Self {
                section: COMPARISONS,
                is_folded: true,
                names_second_side: false,
                accuracy: ("Each dark level less L0, raw", None),
                agreement: (
                    "Agreement at each dark level less that of L0 again, raw",
                    Some("Agreement in the dark against that of L0 asked again, paired by question"),
                ),
            },
            ComparisonKind::Variant => Self {
                section: COMPARISONS,
                is_folded: true,
                names_second_side: false,
                accuracy: (
                    "Sensor noise less exposure drop alone",
                    Some("Sensor noise against exposure drop alone, paired by question"),
                ),
                agreement: (
                    "Agreement with sensor noise less exposure drop alone",
                    Some("Agreement with sensor noise against exposure drop alone, paired by question"),
                ),
            },
            ComparisonKind::Enhancer => Self {
                section: ENHANCERS,
                is_folded: false,
                names_second_side: false,
                accuracy: ("Enhanced less raw", Some("Enhanced against raw, paired by question")),
                agreement: (
                    "Agreement of enhanced less raw",
                    Some("Agreement of enhanced against raw, paired by question"),
                ),
            },
            ComparisonKind::EnhancerPair => Self {
                section: ENHANCERS,
                is_folded: true,
                names_second_side: true,
                accuracy: ("One enhancer less another", Some("One enhancer against another, paired by question")),
                agreement: (
                    "Agreement with one enhancer less another",
                    Some("Agreement with one enhancer against another, paired by question"),
                ),
            },
            ComparisonKind::Model => Self {
                section: COMPARISONS,
                is_folded: true,
                names_second_side: true,
                accuracy: ("Model less model", Some("Model against model, paired by question")),
                agreement: ("Model less model", None),
            },
            ComparisonKind::Blind => Self {
                section: COMPARISONS,
                is_folded: true,
                names_second_side: true,
                accuracy: ("With images less without", Some("With images against without, paired by question")),
                agreement: (
                    "Agreement with images less without",
                    Some("Agreement with images against without, paired by question"),
                ),
            },
            ComparisonKind::Light => Self {
                section: COMPARISONS,
                is_folded: true,
                names_second_side: true,
                accuracy: ("Light less light", Some("One light against another, same model, paired by question")),
                agreement: (
                    "Agreement in one light less another",
                    Some("Agreement in one light against another, same model, paired by question"),
                ),
            },
            ComparisonKind::RealSynthetic => Self {
                section: REAL,
                is_folded: false,
                names_second_side: true,
                accuracy: (
                    "Photographed in the dark less synthetic",
                    Some("Photographed in the dark against synthetic, paired by question"),
                ),
                agreement: (
                    "Agreement on photographs in the dark less synthetic",
                    Some("Agreement on photographs in the dark against synthetic, paired by question"),
                ),
            },
            ComparisonKind::RealEnhanced => Self {
                section: REAL,
                is_folded: false,
                names_second_side: false,
                accuracy: (
                    "Photographed in the dark: enhanced less raw",
                    Some("Photographed in the dark, enhanced against raw, paired by question"),
                ),
                agreement: (
                    "Agreement on photographs in the dark: enhanced less raw",
                    Some("Agreement on photographs in the dark, enhanced against raw, paired by question"),
                ),
            },
        }
    }
}

/// Note with the number of models that are compared; `None` if all are.
fn compared_models_note(findings: &Findings<'_>) -> Option<String> {
    let models = models_under_test(findings.grid.subjects.iter().map(|subject| &*subject.model)).len();
    (models > MAX_COMPARED_MODELS).then(|| {
        format!(
            "Compared are the {MAX_COMPARED_MODELS} of {models} models with the highest accuracy in the dark; records.parquet has the replies of all."
        )
    })
}

/// Note with the number of rows whose sides share too few items for a verdict; `None` if all share enough.
fn too_few_items(comparisons: &[&Comparison]) -> Option<String> {
    let count = comparisons.iter().filter(|comparison| comparison.is_too_small()).count();
    (count > 0).then(|| {
        let rows = counted(count, "row");
        format!("too few: fewer than {MIN_PAIRS} items are shared in {rows}, so no verdict is given")
    })
}

/// Hides rows beyond [`MAX_ROWS`] in the terminal, and adds notes about them.
///
/// For blind models, hides the enhanced conditions too, and all rows if images help in each condition.
fn hide_rows_in_terminal(table: &mut Table, kind: ComparisonKind, comparisons: &[&Comparison]) {
    let mut shown: Vec<usize> = (0..comparisons.len()).collect();
    if kind == ComparisonKind::Blind {
        // The terminal compares blind models with raw images only. The file also has the enhanced images.
        shown.retain(|index| comparisons[*index].first.enhancer.is_none());
        let all_are_better = shown.iter().all(|index| comparisons[*index].verdict() == Some(Verdict::Better));
        if !shown.is_empty() && all_are_better {
            let line = format!("better in all {} conditions", shown.len());
            table.notes.push(line);
            shown.clear();
        }
    }
    if shown.len() > MAX_ROWS {
        let hidden = shown.len() - MAX_ROWS;
        let line = format!("{hidden} more rows are in comparisons.csv");
        table.notes.push(line);
        shown.truncate(MAX_ROWS);
    }
    for (index, row) in table.rows.iter_mut().enumerate() {
        if !shown.contains(&index) {
            row.hidden_in.push(TableFormat::Terminal);
        }
    }
}

fn table(kind: ComparisonKind, caption: &str, comparisons: &[&Comparison], mode: ParsingMode) -> Table {
    let section = KindTable::of(kind).section;
    let builder = TableBuilder::new("comparisons", comparisons.iter().copied()).page(section, caption);
    let has_models_under_test = comparisons.iter().any(|one| !one.first.is_reference());
    let builder = number_columns(subject_columns(builder, kind, has_models_under_test), mode);
    builder
        .column(ColumnKind::Verdict, "csv verdict | terminal | page | latex", |comparison| {
            TableCell::verdict(comparison.verdict())
        })
        .column(Text, "csv shown", |comparison| {
            let verdict = comparison.verdict();
            verdict.is_some_and(Verdict::is_shown).to_string()
        })
        .column(Text, "csv mode", move |_| mode.name())
        .build()
}

fn subject_columns(
    builder: TableBuilder<&Comparison>,
    kind: ComparisonKind,
    has_models_under_test: bool,
) -> TableBuilder<&Comparison> {
    let builder = builder
        .column(Text, "csv kind", |comparison| comparison.kind.name())
        .column(Text, "csv model", |comparison| comparison.first.model.clone())
        .column(Text, "latex Model", move |comparison| {
            let is_reference = comparison.first.is_reference() && has_models_under_test;
            marked_reference(comparison.first.model.clone(), is_reference)
        })
        .column(Text, "csv condition | latex Condition", |comparison| comparison.first.condition())
        .column(Text, "csv against_model", |comparison| comparison.second.model.clone())
        .column(Text, "csv against_condition", |comparison| comparison.second.condition())
        .column(Text, "terminal model | page model", |comparison| comparison.first.model.clone())
        .column(Text, "terminal condition | page condition", |comparison| comparison.first.condition());
    let builder = if KindTable::of(kind).names_second_side {
        builder.column(Text, "terminal less | page less", |comparison| second_side_label(comparison))
    } else {
        builder
    };
    builder.family(|comparison| comparison.family.as_ref())
}

fn number_columns(builder: TableBuilder<&Comparison>, mode: ParsingMode) -> TableBuilder<&Comparison> {
    let difference = "csv difference low high | terminal difference, 95 % interval | page difference [95 %] \
                      | latex Difference [95\\,\\%]";
    builder
        .column(Count, "csv n | terminal n", |comparison| comparison.parsed(mode).tested.difference.n)
        .column(Number, "csv first", |comparison| comparison.parsed(mode).first)
        .column(Percent, "csv second | latex Raw", |comparison| comparison.parsed(mode).second)
        .column(Percent, "latex Enhanced", |comparison| comparison.parsed(mode).first)
        .column(Points, difference, |comparison| comparison.parsed(mode).tested.difference)
        .column(Count, "latex Rescued / harmed", |comparison| {
            format!("{} / {}", comparison.parsed(mode).gained, comparison.parsed(mode).lost)
        })
        .column(Count, "csv only_first | terminal only first | page only first", |comparison| {
            comparison.parsed(mode).gained
        })
        .column(Count, "csv only_second | terminal only second | page only second", |comparison| {
            comparison.parsed(mode).lost
        })
        .column(Count, "page n", |comparison| comparison.parsed(mode).tested.difference.n)
        .column(P, "csv p_mcnemar | page p (McNemar)", |comparison| comparison.parsed(mode).mcnemar)
        .column(P, "csv p | page p", |comparison| comparison.parsed(mode).tested.p)
        .column(P, "csv p_holm | terminal p (Holm) | page p (Holm) | latex $p$ (Holm)", |comparison| {
            comparison.parsed(mode).tested.holm
        })
}

/// Model or condition of the second side, or both, without what the first side shares.
fn second_side_label(comparison: &Comparison) -> String {
    let (first, second) = (&comparison.first, &comparison.second);
    match (first.model != second.model, comparison.kind) {
        (true, ComparisonKind::Light) => name(second),
        (true, _) => second.model.clone(),
        (false, ComparisonKind::EnhancerPair) => second.enhancer.as_ref().map_or_else(String::new, ToString::to_string),
        (false, ComparisonKind::Light | ComparisonKind::RealSynthetic) => second.condition(),
        (false, _) => String::new(),
    }
}

/// Name of the file.
pub const FLIPS: &str = "flips.csv";

/// Number of rows in a part (chosen): small enough for memory, large enough for speed.
const PART_ROWS: usize = 4096;

/// Writes the first failing levels. The level is empty if the item never fails or if an earlier level has no reply.
///
/// # Errors
/// If the output cannot be written.
pub fn write_flips(findings: &Findings<'_>, out: &mut dyn Write) -> Result<()> {
    let items = findings.grid.items.len();
    let parts = findings.first_failures.iter().flat_map(|failure| {
        (0..items).step_by(PART_ROWS).map(move |start| part(findings, failure, start..items.min(start + PART_ROWS)))
    });
    table::write(out, parts)
}

/// Part of the file: the rows of one curve for some items.
fn part(findings: &Findings<'_>, failure: &FirstFailure, items: Range<usize>) -> Table {
    let grid = &findings.grid;
    let rows = items
        .filter(|item| failure.has_item(grid, *item))
        .map(|item| (grid.items[item].asked, grid.items[item].draw, failure.first(grid, item)));
    let curve = &failure.curve;
    let mut table = TableBuilder::new("flips", rows)
        .column(Text, "csv question", |(asked, ..)| asked.question.to_string())
        .column(Text, "csv frame", |(asked, ..)| asked.frame.to_string())
        .family(|(asked, ..)| Some(&*asked.family))
        .column(Count, "csv repeat", |(asked, ..)| asked.repeat as usize);
    if findings.variation.is_some() {
        table = table
            .column(Text, "csv wording", |(asked, ..)| asked.key().wording.map(str::to_owned))
            .column(Count, "csv order", |(asked, ..)| asked.order as usize)
            .column(Count, "csv draw", |(_, draw, _)| usize::from(*draw));
    }
    table
        .curve(|_| (&curve.model, &curve.variant, curve.enhancer.as_ref()))
        .column(Text, "csv first_failing", |(.., first)| first.map(|level| level.to_string()))
        .build()
}
