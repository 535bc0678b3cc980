//! Tables of the calibration of confidence, and of probabilities by the position of a choice.

use crate::text::table::ColumnKind::{Count, Number, Percent, Points, Ratio, Share, Text};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::light;
use darkqa_base::types::questions::letter;
use darkqa_score::auc::Auc;
use darkqa_score::calibration::{Calibration, PositionShare, ReliabilityBin};
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

/// Id of the section on the page.
pub(super) const CONFIDENCE: &str = "confidence";

/// Builds the tables; none if no probabilities of choices are known.
pub(super) fn calibration(findings: &Findings<'_>) -> Vec<Table> {
    let all = &findings.calibrations;
    if all.is_empty() {
        return Vec::new();
    }
    vec![confidence(findings, all), reliability(all), positions(all)]
}

/// Reads the value of a column from a row.
type ColumnValue = fn(&Calibration) -> Option<Estimate>;

fn confidence(findings: &Findings<'_>, all: &[Calibration]) -> Table {
    let mut table = TableBuilder::new("calibration", all)
        .page(CONFIDENCE, "Confidence against accuracy")
        .subject(|row| &row.subject, ToString::to_string)
        .column(Text, "terminal model", |row| row.subject.model.clone())
        .column(Text, "terminal condition", |row| condition(&row.subject))
        .column(Count, "csv replies | terminal n | page n", |row| row.replies)
        .column(Count, "csv reasoned | page reasoned", |row| row.reasoned)
        .column(Count, "csv unstated | page not stated", |row| row.unstated)
        .column(
            Share,
            "csv confidence confidence_low confidence_high | terminal confidence | page confidence in % [95 %]",
            |row| row.confidence,
        )
        .column(
            Share,
            "csv accuracy accuracy_low accuracy_high | terminal accuracy | page accuracy in % [95 %]",
            |row| row.accuracy,
        )
        .column(
            Points,
            "csv overconfidence overconfidence_low overconfidence_high | terminal overconfidence, interval | page overconfidence [95 %]",
            |row| row.overconfidence.difference,
        );
    let ratio_columns: [(&str, ColumnValue); 6] = [
        ("csv ece ece_low ece_high | terminal calibration error | page calibration error [95 %]", |row| row.error),
        ("csv brier brier_low brier_high | page Brier score [95 %]", |row| Some(row.brier)),
        ("csv brier_skill brier_skill_low brier_skill_high | terminal Brier skill | page Brier skill [95 %]", |row| {
            Some(row.skill)
        }),
        ("csv nll nll_low nll_high | page −ln p [95 %]", |row| Some(row.nll)),
        ("csv auroc auroc_low auroc_high | terminal AUROC | page AUROC [95 %]", |row| {
            row.auroc.map(|Auc { estimate, .. }| estimate)
        }),
        ("csv blind_shift blind_shift_low blind_shift_high | terminal blind shift | page blind shift [95 %]", |row| {
            row.blind_shift
        }),
    ];
    for (heads, value) in ratio_columns {
        table = table.column(Ratio, heads, move |row| value(row));
    }
    let mut table = table
        .column(Percent, "csv risk_100 | page risk in %", |row| row.risk.at_100)
        .column(Percent, "csv risk_80 | page at 80 %", |row| row.risk.at_80)
        .column(Percent, "csv risk_50 | page at 50 %", |row| row.risk.at_50)
        .column(Number, "csv aurc | page area under risk", |row| row.risk.area)
        .column(Share, "csv over_orders over_orders_low over_orders_high | page over all orders in % [95 %]", |row| {
            row.over_orders
        })
        .build();
    table.heading = Some(format!(
        "Confidence (mean greatest probability of a choice) against accuracy in %, with 95 % intervals by {}",
        findings.unit
    ));
    table
}

/// Condition as the terminal names it.
fn condition(subject: &ModelInCondition) -> String {
    match subject.level {
        None => "without images".to_owned(),
        Some(level) => format!("{level}, {}", light(&subject.variant, subject.enhancer.as_ref())),
    }
}

/// Bin of the reliability diagram of one subject.
struct BinRow<'a> {
    subject: &'a ModelInCondition,
    /// Number of the bin, from 1.
    number: usize,
    bin: ReliabilityBin,
}

/// Table of the bins of the reliability diagram.
fn reliability(all: &[Calibration]) -> Table {
    let rows = all.iter().flat_map(|row| {
        row.bins.iter().zip(1..).map(|(bin, number)| BinRow { subject: &row.subject, number, bin: *bin })
    });
    TableBuilder::new("reliability", rows)
        .subject(|row: &BinRow<'_>| row.subject, ToString::to_string)
        .column(Count, "csv bin", |row| row.number)
        .column(Number, "csv confidence", |row| row.bin.confidence)
        .column(Share, "csv accuracy accuracy_low accuracy_high n", |row| row.bin.accuracy)
        .build()
}

/// Table of probabilities by the position of a choice.
fn positions(all: &[Calibration]) -> Table {
    let rows = all.iter().flat_map(|row| row.positions.iter().map(|share| (&row.subject, *share)));
    let mut table = TableBuilder::new("positions", rows)
        .page(CONFIDENCE, "Probability by the place of a choice")
        .subject(|row: &(&ModelInCondition, PositionShare)| row.0, ToString::to_string)
        .column(Text, "csv letter | page letter", |row| TableCell::from(letter(row.1.position).to_string()))
        .column(Percent, "csv probability | page mean probability in %", |row| row.1.p)
        .column(Percent, "csv true | page true in %", |row| row.1.truth)
        .column(Count, "csv n | page n", |row| row.1.n)
        .build();
    table.is_folded = true;
    table
}
