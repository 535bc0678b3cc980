//! Tables of darkness thresholds and areas: all families together, and by family.

use crate::report::table::ColumnKind::{Number, Share, Text, Threshold};
use crate::report::table::{Table, TableBuilder, TableCell};
use crate::report::words::{counted, light};
use crate::score::curve::Curve;
use crate::score::findings::Findings;
use crate::score::threshold::{NoThreshold, ThinLevel};

pub(super) fn thresholds(findings: &Findings<'_>) -> Vec<Table> {
    let curves = findings.curves.iter();
    let (whole, by_family): (Vec<&Curve>, Vec<&Curve>) =
        curves.partition(|curve| curve.family.is_none());
    let heading = format!(
        "Darkness threshold in EV (half-way from L0 to chance) and mean accuracy in %, with 95 % intervals by {}",
        findings.unit
    );
    let mut whole = table("Thresholds and areas", &whole);
    whole.heading = (!whole.rows.is_empty()).then_some(heading);
    whole.notes = notes(findings.curves.iter());
    let mut by_family = table("Thresholds and areas by family", &by_family);
    by_family.is_folded = true;
    vec![whole, by_family]
}

/// A threshold is `inf` beyond the darkest level, and empty if it is not known.
fn table(caption: &str, curves: &[&Curve]) -> Table {
    TableBuilder::new("thresholds", curves)
        .page("thresholds", caption)
        .line(|curve| (&curve.model, &curve.variant, curve.enhancer.as_ref()))
        .column(Text, "terminal light | page light", |curve| {
            light(&curve.variant, curve.enhancer.as_ref())
        })
        .family(|curve| curve.family.as_ref())
        .column(Number, "csv darkest_ev", |curve| {
            curve.summary.darkest.value()
        })
        .column(
            Threshold,
            "csv threshold_ev low high | terminal threshold, interval | page threshold in EV [95 %]",
            |curve| {
                let darkest = curve.summary.darkest.value();
                match &curve.summary.threshold {
                    Ok(threshold) => TableCell::Threshold(*threshold, darkest),
                    Err(reason) => TableCell::Unknown(why(reason)),
                }
            },
        )
        .column(
            Share,
            "csv area area_low area_high n | terminal mean accuracy | page area in % [95 %]",
            |curve| curve.summary.area,
        )
        .column(Text, "page EV", |curve| {
            format!("0–{}", curve.summary.darkest.value())
        })
        .column(Text, "csv reason", |curve| reason(curve))
        .build()
}

/// Why a threshold is not known.
fn why(reason: &NoThreshold) -> String {
    match reason {
        NoThreshold::NotAboveChance => "not clearly above chance at L0".to_owned(),
        NoThreshold::Thin(level) => thin(level),
    }
}

fn thin(level: &ThinLevel) -> String {
    let replies = match level.replies {
        1 => "1 reply".to_owned(),
        replies => format!("{replies} replies"),
    };
    format!(
        "{} has {replies} in {}",
        level.level,
        counted(level.clusters, "cluster")
    )
}

/// Why the threshold of a curve is not known, or which levels are left out; empty if neither.
fn reason(curve: &Curve) -> String {
    let left_out = curve.summary.left_out.iter();
    let left_out = left_out.map(|level| format!("left out: {}", thin(level)));
    let unknown = curve.summary.threshold.as_ref().err().map(why);
    let reasons: Vec<String> = unknown.into_iter().chain(left_out).collect();
    reasons.join("; ")
}

/// A line for each curve of all families together of which levels are left out.
fn notes<'a>(curves: impl Iterator<Item = &'a Curve>) -> Vec<String> {
    let curves = curves.filter(|curve| curve.family.is_none());
    let thinned = curves.filter(|curve| !curve.summary.left_out.is_empty());
    let notes = thinned.map(|curve| {
        let light = light(&curve.variant, curve.enhancer.as_ref());
        let left_out: Vec<String> = curve.summary.left_out.iter().map(thin).collect();
        format!(
            "left out of {}, {light}: {}",
            curve.model,
            left_out.join(", ")
        )
    });
    notes.collect()
}
