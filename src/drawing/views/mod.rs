//! Figures of views that few runs have the data for: [`drawings`].

mod fidelity;
mod real;
mod reliability;

use crate::drawing::figures::Drawing;
use darkqa_score::findings::Findings;

/// The figures for which there are data.
pub(crate) fn drawings(findings: &Findings<'_>) -> impl Iterator<Item = Drawing> {
    let all = [
        fidelity::drawing(findings),
        real::drawing(findings),
        reliability::drawing(findings),
    ];
    all.into_iter().flatten()
}
