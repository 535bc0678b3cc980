//! Probabilities by the position of a choice: [`PositionShare`].

use super::confident_reply::usable_probabilities;
use crate::grid::Grid;

/// Mean probability of the choices at one position, and share of true choices at this position. The difference of both
/// is a preference for a letter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionShare {
    /// Index of the position; 0 is A.
    pub position: usize,
    /// Mean probability of the choices at this position.
    pub p: f64,
    /// Share of the questions whose true choice is at this position.
    pub truth: f64,
    /// Number of replies to questions with a choice at this position.
    pub n: usize,
}

/// Computes the shares of each position for a subject.
pub(super) fn shares(grid: &Grid<'_>, subject: usize) -> Vec<PositionShare> {
    let mut shares: Vec<PositionShare> = Vec::new();
    for (index, item) in grid.items.iter().enumerate() {
        let Some(options) = usable_probabilities(grid.trial(subject, index)) else {
            continue;
        };
        for (position, p) in options.p.iter().enumerate() {
            if shares.len() == position {
                shares.push(PositionShare { position, p: 0.0, truth: 0.0, n: 0 });
            }
            let share = &mut shares[position];
            share.p += p;
            share.truth += f64::from(u8::from(item.asked.truth == Some(position)));
            share.n += 1;
        }
    }
    for share in &mut shares {
        share.p /= share.n as f64;
        share.truth /= share.n as f64;
    }
    shares
}
