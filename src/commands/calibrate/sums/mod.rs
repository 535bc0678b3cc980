//! Sums over frames as integers, which are exact, so that the result does not depend on the order or the number of
//! threads.

mod frame;
mod pair;
mod residuals;

pub(super) use frame::{PlaneSums, TopCode};
pub(super) use pair::{NeighbourSums, PairNoise, PairSums, TileSums};
pub(super) use residuals::{Centres, Residuals, STEPS};

use super::layout::Layout;

/// Copies the samples of a part of a row to `part`.
fn gather(layout: Layout, samples: &[u16], plane_row: usize, part: &mut Vec<u16>) {
    let [row, parity] = layout.place(plane_row);
    let row = &samples[row * layout.width..][..layout.width];
    part.clear();
    part.extend(row[parity..].iter().step_by(layout.cfa.step()));
}
