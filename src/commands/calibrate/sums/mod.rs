//! Sums over frames as integers, which are exact, so that the result does not depend on the order or the number of
//! threads.
//!
//! Sums of single frames: [`PlaneSums`] and [`TopCode`].
//!
//! Histogram of bias frames after removing offsets and row noise: [`ResidualHistogram`].

pub(crate) mod pair;

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::frames::{HotPixels, Layout};

pub(super) use pair::{NeighbourSums, PairNoise, PairSums, TileSums};

/// Copies the samples of a part of a row to `part`.
fn gather(layout: Layout, samples: &[u16], plane_row: usize, part: &mut Vec<u16>) {
    let [row, parity] = layout.place(plane_row);
    let row = &samples[row * layout.width..][..layout.width];
    part.clear();
    part.extend(row[parity..].iter().step_by(layout.cfa.step()));
}

/// Sums of the samples of a frame for each part of a row, without hot pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PlaneSums {
    layout: Layout,
    /// Number and sum of the samples of each part of a row.
    rows: Vec<[u64; 2]>,
}

impl PlaneSums {
    pub(crate) fn new(layout: Layout, samples: &[u16], hot: &HotPixels) -> Self {
        let rows = (0..layout.plane_rows())
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |part, plane_row| {
                gather(layout, samples, plane_row, part);
                let sum: u64 = part.iter().map(|sample| u64::from(*sample)).sum();
                hot.columns(plane_row)
                    .map(|column| part[column])
                    .fold([part.len() as u64, sum], |[count, sum], sample| [count - 1, sum - u64::from(sample)])
            })
            .collect();
        Self { layout, rows }
    }

    /// Number and sum of the samples of each part of a row.
    pub(crate) fn rows(&self) -> &[[u64; 2]] {
        &self.rows
    }

    /// Number and sum of the samples of each plane.
    pub(crate) fn planes(&self) -> Vec<[u64; 2]> {
        let mut planes = vec![[0; 2]; self.layout.cfa.planes()];
        for (plane_row, [count, sum]) in self.rows.iter().enumerate() {
            let [row, parity] = self.layout.place(plane_row);
            let plane = &mut planes[self.layout.cfa.plane(row, parity)];
            plane[0] += count;
            plane[1] += sum;
        }
        planes
    }
}

/// Maximum code of each plane of a frame, with its number of samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TopCode {
    /// For each plane: number of samples, maximum code, and number of samples with this code.
    pub(crate) planes: Vec<(u64, u16, u64)>,
}

impl TopCode {
    pub(crate) fn new(layout: Layout, samples: &[u16], hot: &HotPixels) -> Self {
        let rows: Vec<(u64, u16, u64)> = (0..layout.plane_rows())
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |part, plane_row| {
                gather(layout, samples, plane_row, part);
                for (removed, column) in hot.columns(plane_row).enumerate() {
                    // Each removal shifts the following columns by one.
                    part.remove(column - removed);
                }
                let top = part.iter().copied().max().unwrap_or(0);
                let with_it = part.iter().filter(|sample| **sample == top).count();
                (part.len() as u64, top, with_it as u64)
            })
            .collect();
        let mut planes = vec![(0, 0, 0); layout.cfa.planes()];
        for (plane_row, (count, top, with_it)) in rows.into_iter().enumerate() {
            let [row, parity] = layout.place(plane_row);
            let plane = &mut planes[layout.cfa.plane(row, parity)];
            plane.0 += count;
            if top > plane.1 {
                (plane.1, plane.2) = (top, 0);
            }
            if top == plane.1 {
                plane.2 += with_it;
            }
        }
        Self { planes }
    }

    /// Maximum code of the frame.
    pub(crate) fn max(&self) -> u16 {
        self.planes.iter().map(|(_, code, _)| *code).max().unwrap_or(0)
    }

    /// Largest share of the samples of a plane at its maximum code, and this code.
    pub(crate) fn largest_share(&self) -> (f64, u16) {
        self.planes
            .iter()
            .map(|(count, code, with_it)| {
                let share = *with_it as f64 / (*count).max(1) as f64;
                (share, *code)
            })
            .fold((0.0, 0), |max, plane| if plane.0 > max.0 { plane } else { max })
    }
}

/// Number of histogram steps in an ADU (chosen). Codes are integers but centres are not: residuals are rounded to
/// steps.
pub(super) const STEPS: i64 = 32;

/// Maximum residual in ADU that is counted in a list; larger ones are counted in a map (chosen far beyond read noise).
const WINDOW: i64 = 512;

/// Number of samples that a thread counts into one histogram (chosen).
const SAMPLES_PER_PART: usize = 1 << 20;

/// Centres to subtract from the codes of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) enum Centres<'a> {
    /// Means of the planes and rows of the frame itself.
    RowsAndPlanes,
    /// Mean of all frames at each site, then the row means of the differences. This removes a fixed pattern.
    MeanFrame {
        /// Sum of all frames at each site.
        sums: &'a [u32],
        frames: f64,
    },
}

/// Histogram of residuals, in steps of 1 / [`STEPS`] ADU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ResidualHistogram {
    /// Counts from −`WINDOW` to `WINDOW`.
    near: Vec<u64>,
    far: BTreeMap<i64, u64>,
}

impl Default for ResidualHistogram {
    fn default() -> Self {
        Self { near: vec![0; (2 * WINDOW * STEPS + 1) as usize], far: BTreeMap::new() }
    }
}

impl ResidualHistogram {
    /// Computes the residuals of a frame. `sums` must be the sums of the same frame without the same hot pixels.
    pub(crate) fn new(
        layout: Layout,
        samples: &[u16],
        sums: &PlaneSums,
        hot: &HotPixels,
        centres: Centres<'_>,
    ) -> Self {
        let rows_at_once = (SAMPLES_PER_PART / layout.width).max(1);
        let plane_means: Vec<f64> =
            sums.planes().into_iter().map(|[count, sum]| sum as f64 / count.max(1) as f64).collect();
        let counter = Counter { layout, samples, sums, hot, centres, plane_means };
        let starts: Vec<usize> = (0..layout.height).step_by(rows_at_once).collect();
        let parts: Vec<Self> = starts
            .into_par_iter()
            .map(|start| {
                let mut residuals = Self::default();
                let mut part = Vec::new();
                for row in start..(start + rows_at_once).min(layout.height) {
                    counter.count(row, &mut part, &mut residuals);
                }
                residuals
            })
            .collect();
        let mut sum = Self::default();
        for part in &parts {
            sum.add(part);
        }
        sum
    }

    /// Counts one residual, in steps.
    pub(crate) fn count(&mut self, steps: i64) {
        let index = usize::try_from(steps + WINDOW * STEPS).ok();
        match index.and_then(|index| self.near.get_mut(index)) {
            Some(count) => *count += 1,
            None => *self.far.entry(steps).or_insert(0) += 1,
        }
    }

    /// Adds another histogram.
    pub(crate) fn add(&mut self, other: &Self) {
        for (count, more) in self.near.iter_mut().zip(&other.near) {
            *count += more;
        }
        for (steps, more) in &other.far {
            *self.far.entry(*steps).or_insert(0) += more;
        }
    }

    /// All residuals in steps, in ascending order, with their counts.
    pub(crate) fn counts(&self) -> Vec<(i64, u64)> {
        let mut all: Vec<(i64, u64)> =
            (-WINDOW * STEPS..).zip(self.near.iter().copied()).filter(|(_, count)| *count > 0).collect();
        all.extend(self.far.iter().map(|(steps, count)| (*steps, *count)));
        all.sort_unstable();
        all
    }
}

/// Inputs for the residuals of all rows of a frame.
struct Counter<'a> {
    layout: Layout,
    samples: &'a [u16],
    sums: &'a PlaneSums,
    hot: &'a HotPixels,
    centres: Centres<'a>,
    plane_means: Vec<f64>,
}

impl Counter<'_> {
    /// Counts the residuals of a sensor row.
    fn count(&self, row: usize, part: &mut Vec<u16>, residuals: &mut ResidualHistogram) {
        match self.centres {
            Centres::RowsAndPlanes => self.count_around_planes(row, part, residuals),
            Centres::MeanFrame { sums, frames } => {
                self.count_around_mean_frame(row, &sums[row * self.layout.width..], frames, residuals);
            }
        }
    }

    fn plane_mean(&self, plane_row: usize) -> f64 {
        let [row, parity] = self.layout.place(plane_row);
        self.plane_means[self.layout.cfa.plane(row, parity)]
    }

    fn count_around_planes(&self, row: usize, part: &mut Vec<u16>, residuals: &mut ResidualHistogram) {
        let step = self.layout.cfa.step();
        let parts = row * step..(row + 1) * step;
        let (mut count, mut left) = (0.0, 0.0);
        for plane_row in parts.clone() {
            let [n, sum] = self.sums.rows()[plane_row];
            count += n as f64;
            left += sum as f64 - n as f64 * self.plane_mean(plane_row);
        }
        let row_mean = if count > 0.0 { left / count } else { 0.0 };
        for plane_row in parts {
            let centre = steps(self.plane_mean(plane_row) + row_mean);
            gather(self.layout, self.samples, plane_row, part);
            let mut hot = self.hot.columns(plane_row).peekable();
            for (column, code) in part.iter().enumerate() {
                if hot.next_if_eq(&column).is_none() {
                    residuals.count(i64::from(*code) * STEPS - centre);
                }
            }
        }
    }

    fn count_around_mean_frame(&self, row: usize, sums: &[u32], frames: f64, residuals: &mut ResidualHistogram) {
        let Layout { width, cfa, .. } = self.layout;
        let codes = &self.samples[row * width..][..width];
        let mut is_used = vec![true; width];
        for parity in 0..cfa.step() {
            for column in self.hot.columns(row * cfa.step() + parity) {
                is_used[column * cfa.step() + parity] = false;
            }
        }
        let sites = codes
            .iter()
            .zip(sums)
            .zip(is_used)
            .filter(|(_, is_used)| *is_used)
            .map(|((code, sum), _)| (i64::from(*code), f64::from(*sum) / frames));
        let (mut count, mut left) = (0.0, 0.0);
        for (code, mean) in sites.clone() {
            count += 1.0;
            left += code as f64 - mean;
        }
        let row_mean = if count > 0.0 { left / count } else { 0.0 };
        for (code, mean) in sites {
            residuals.count(code * STEPS - steps(mean + row_mean));
        }
    }
}

/// Rounds an ADU value to steps.
fn steps(adu: f64) -> i64 {
    (adu * STEPS as f64).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::calibrate::frames::Cfa;

    const LAYOUT: Layout = Layout { cfa: Cfa::Rggb, height: 2, width: 6 };

    const SAMPLES: [u16; 12] = [1, 10, 2, 10, 3, 10, 5, 7, 5, 7, 9, 8];

    #[test]
    fn planes_are_summed_separately() {
        let sums = PlaneSums::new(LAYOUT, &SAMPLES, &HotPixels::none(4));
        assert_eq!(sums.planes(), [[3, 6], [3, 30], [3, 19], [3, 22]]);
        let hot = HotPixels::new(vec![vec![0, 2], vec![], vec![1], vec![]]);
        let sums = PlaneSums::new(LAYOUT, &SAMPLES, &hot);
        assert_eq!(sums.planes(), [[1, 2], [3, 30], [2, 14], [3, 22]]);
    }

    #[test]
    fn samples_at_the_maximum_are_counted() {
        let top = TopCode::new(LAYOUT, &SAMPLES, &HotPixels::none(4));
        assert_eq!(top.planes, [(3, 3, 1), (3, 10, 3), (3, 9, 1), (3, 8, 1)]);
        assert_eq!((top.max(), top.largest_share()), (10, (1.0, 10)));
        let hot = HotPixels::new(vec![vec![], vec![0, 1], vec![2], vec![]]);
        let top = TopCode::new(LAYOUT, &SAMPLES, &hot);
        assert_eq!(top.planes, [(3, 3, 1), (1, 10, 1), (2, 5, 2), (3, 8, 1)]);
    }

    const RESIDUALS_LAYOUT: Layout = Layout { cfa: Cfa::Rggb, height: 2, width: 4 };

    fn residuals(samples: &[u16], hot: &HotPixels, centres: Centres<'_>) -> Vec<(i64, u64)> {
        let sums = PlaneSums::new(RESIDUALS_LAYOUT, samples, hot);
        ResidualHistogram::new(RESIDUALS_LAYOUT, samples, &sums, hot, centres).counts()
    }

    /// Offsets of planes and of rows leave nothing behind.
    #[test]
    fn offsets_are_subtracted() {
        let none = HotPixels::none(4);
        let flat = [10, 20, 10, 20, 30, 40, 30, 40];
        assert_eq!(residuals(&flat, &none, Centres::RowsAndPlanes), [(0, 8)]);
        // One site 4 ADU above: its plane's mean is 2 above, and the row's mean is then 0 for both planes.
        let mut one = flat;
        one[0] += 4;
        let found = residuals(&one, &none, Centres::RowsAndPlanes);
        assert_eq!(found, [(-2 * STEPS, 1), (0, 6), (2 * STEPS, 1)]);
        let hot = HotPixels::new(vec![vec![0], vec![], vec![], vec![]]);
        assert_eq!(residuals(&one, &hot, Centres::RowsAndPlanes), [(0, 7)]);
    }

    #[test]
    fn a_mean_frame_removes_the_pattern() {
        let none = HotPixels::none(4);
        let pattern = [10, 25, 17, 20, 30, 40, 33, 48];
        let sums: Vec<u32> = pattern.iter().map(|code| 16 * u32::from(*code)).collect();
        let centres = Centres::MeanFrame { sums: &sums, frames: 16.0 };
        assert_eq!(residuals(&pattern, &none, centres), [(0, 8)]);
        // A row that is brighter as a whole is row noise.
        let brighter: Vec<u16> =
            pattern.iter().enumerate().map(|(site, code)| code + 5 * u16::from(site < 4)).collect();
        assert_eq!(residuals(&brighter, &none, centres), [(0, 8)]);
        assert_ne!(residuals(&brighter, &none, Centres::RowsAndPlanes), [(0, 8)]);
    }

    #[test]
    fn distant_residuals_are_counted() {
        let mut frame = [100; 8];
        frame[7] = 60_100;
        let found = residuals(&frame, &HotPixels::none(4), Centres::RowsAndPlanes);
        assert_eq!(found.iter().map(|(_, count)| count).sum::<u64>(), 8);
        assert_eq!(found.last(), Some(&(30_000 * STEPS, 1)));
    }
}
