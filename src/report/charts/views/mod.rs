//! Figures that need data of few runs: image fidelity, photographs in the dark, or probabilities of answers
//! ([`figure_specs`]).

mod fidelity;
mod real;
mod reliability;

use crate::report::charts::figures::FigureSpec;
use darkqa_score::findings::Findings;

/// The figures that have data.
pub(crate) fn figure_specs(findings: &Findings<'_>) -> impl Iterator<Item = FigureSpec> {
    [fidelity::figure_spec(findings), real::figure_spec(findings), reliability::figure_spec(findings)]
        .into_iter()
        .flatten()
}
