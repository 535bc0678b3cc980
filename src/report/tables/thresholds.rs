//! Tables of darkness thresholds and areas: all families together, and by family.

use crate::report::table::ColumnKind::{Number, Share, Text, Threshold};
use crate::report::table::{Table, TableBuilder, TableCell};
use crate::report::words::light;
use crate::score::curve::Curve;
use crate::score::findings::Findings;

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
    let mut by_family = table("Thresholds and areas by family", &by_family);
    by_family.is_folded = true;
    vec![whole, by_family]
}

/// A threshold is `inf` beyond the darkest level, and empty if accuracy at L0 is not above chance.
fn table(caption: &str, curves: &[&Curve]) -> Table {
    TableBuilder::new("thresholds", curves)
        .page("thresholds", caption)
        .line(|curve| (&curve.model, &curve.variant, curve.enhancer.as_ref()))
        .column(Text, "terminal light | page light", |curve| {
            light(&curve.variant, curve.enhancer.as_ref())
        })
        .family(|curve| curve.family.as_ref())
        .column(Number, "csv darkest_ev", |curve| {
            curve.darkest.value()
        })
        .column(
            Threshold,
            "csv threshold_ev low high | terminal threshold, interval | page threshold in EV [95 %]",
            |curve| {
                let darkest = curve.darkest.value();
                curve
                    .threshold
                    .map(|threshold| TableCell::Threshold(threshold, darkest))
            },
        )
        .column(
            Share,
            "csv area area_low area_high n | terminal mean accuracy | page area in % [95 %]",
            |curve| curve.area,
        )
        .column(Text, "page EV", |curve| {
            format!("0–{}", curve.darkest.value())
        })
        .build()
}
