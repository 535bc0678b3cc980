//! Sums of single frames: [`PlaneSums`] and [`TopCode`].

use rayon::prelude::*;

use super::super::hot_pixels::HotPixels;
use super::super::layout::Layout;
use super::gather;

/// Sums of the samples of a frame for each part of a row, without hot pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PlaneSums {
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
pub(crate) struct TopCode {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::calibrate::layout::Cfa;

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
}
