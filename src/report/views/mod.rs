//! Figures of views that few runs have the data for: [`drawings`].

mod fidelity;
mod real;
mod reliability;

use super::figures::Drawing;
use crate::score::findings::Findings;

/// The figures for which there are data.
pub(super) fn drawings(findings: &Findings<'_>) -> impl Iterator<Item = Drawing> {
    let all = [
        fidelity::drawing(findings),
        real::drawing(findings),
        reliability::drawing(findings),
    ];
    all.into_iter().flatten()
}
