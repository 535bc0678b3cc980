//! Mean of all bias frames of a setting, with its hot pixels, fixed pattern and unevenness: [`MeanFrame`].

use rayon::prelude::*;

use super::hot_pixels::HotPixels;
use super::layout::{Layout, TILES};
use super::sums::PairNoise;

/// Minimum distance of the mean of a hot pixel from the median of its plane, in standard deviations of the read noise
/// (chosen). Each of its samples must also be at half this distance on the same side, because a single distant sample
/// is long-tailed noise.
const HOT_DISTANCE: f64 = 10.0;

/// Sum of frames at each site.
#[derive(Debug)]
pub(super) struct MeanFrame {
    layout: Layout,
    pub(super) sums: Vec<u32>,
    /// Minimum and maximum sample at each site.
    extremes: Vec<[u16; 2]>,
    frames: u32,
}

/// Difference between the means of the tiles of a plane, in ADU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unevenness {
    /// Maximum minus minimum of the tile means.
    pub(super) difference: f64,
    /// Standard error of the mean of a tile.
    pub(super) error: f64,
}

/// A site of the mean frame.
#[derive(Debug, Clone, Copy)]
struct Site {
    plane_row: usize,
    /// Column within the plane.
    column: usize,
    /// Mean of all frames, in ADU.
    mean: f64,
}

impl MeanFrame {
    pub(super) fn new(layout: Layout) -> Self {
        Self {
            layout,
            sums: vec![0; layout.width * layout.height],
            extremes: vec![[u16::MAX, 0]; layout.width * layout.height],
            frames: 0,
        }
    }

    /// Adds a frame.
    pub(super) fn add(&mut self, samples: &[u16]) {
        let width = self.layout.width;
        self.sums
            .par_chunks_mut(width)
            .zip(self.extremes.par_chunks_mut(width))
            .zip(samples.par_chunks(width))
            .for_each(|((sums, extremes), row)| {
                for ((sum, [min, max]), sample) in sums.iter_mut().zip(extremes).zip(row) {
                    *sum += u32::from(*sample);
                    *min = (*min).min(*sample);
                    *max = (*max).max(*sample);
                }
            });
        self.frames += 1;
    }

    /// Number of frames.
    pub(super) fn frames(&self) -> f64 {
        f64::from(self.frames)
    }

    /// Values of the sites in a part of a row, from the values of all sites.
    fn part<'a, T>(&self, values: &'a [T], plane_row: usize) -> impl Iterator<Item = &'a T> {
        let [row, parity] = self.layout.place(plane_row);
        let row = &values[row * self.layout.width..][..self.layout.width];
        row[parity..].iter().step_by(self.layout.cfa.step())
    }

    /// Plane of a part of a row.
    fn plane(&self, plane_row: usize) -> usize {
        let [row, parity] = self.layout.place(plane_row);
        self.layout.cfa.plane(row, parity)
    }

    /// Finds the sites whose mean is far from the median of their plane; `within` is the variance of the read noise.
    pub(super) fn hot_pixels(&self, within: f64) -> HotPixels {
        let medians = self.medians();
        let limit = HOT_DISTANCE * within.sqrt();
        let columns = (0..self.layout.plane_rows())
            .into_par_iter()
            .with_min_len(64)
            .map(|plane_row| {
                let median = f64::from(medians[self.plane(plane_row)]) / self.frames();
                self.part(&self.sums, plane_row)
                    .zip(self.part(&self.extremes, plane_row))
                    .enumerate()
                    .filter(|(_, (sum, [min, max]))| {
                        let mean = f64::from(**sum) / self.frames() - median;
                        let (above, below) = (f64::from(*min) - median, median - f64::from(*max));
                        mean.abs() > limit && above.max(below) > 0.5 * limit
                    })
                    .map(|(column, _)| column as u32)
                    .collect()
            })
            .collect();
        HotPixels::new(columns)
    }

    /// Median sum of each plane; the upper one of two middle sums.
    fn medians(&self) -> Vec<u32> {
        (0..self.layout.cfa.planes())
            .into_par_iter()
            .map(|plane| {
                let mut sums: Vec<u32> = (0..self.layout.plane_rows())
                    .filter(|part| self.plane(*part) == plane)
                    .flat_map(|part| self.part(&self.sums, part))
                    .copied()
                    .collect();
                let middle = sums.len() / 2;
                *sums.select_nth_unstable(middle).1
            })
            .collect()
    }

    /// Sums for each part of a row, in order. `add` adds one site to the sums; hot pixels are skipped.
    fn sums_by_part<const N: usize>(&self, hot: &HotPixels, add: impl Fn(&mut [f64; N], Site) + Sync) -> Vec<[f64; N]> {
        (0..self.layout.plane_rows())
            .into_par_iter()
            .with_min_len(64)
            .map(|plane_row| {
                let mut hot = hot.columns(plane_row).peekable();
                let mut sums = [0.0; N];
                for (column, sum) in self.part(&self.sums, plane_row).enumerate() {
                    if hot.next_if_eq(&column).is_none() {
                        let site = Site { plane_row, column, mean: f64::from(*sum) / self.frames() };
                        add(&mut sums, site);
                    }
                }
                sums
            })
            .collect()
    }

    /// Variance of the fixed pattern in ADU²: the variance of the mean frame around the means of its planes, minus the
    /// contribution of the noise. It may be negative by chance.
    pub(super) fn pattern(&self, hot: &HotPixels, noise: PairNoise) -> f64 {
        // Relative to the medians, to keep the squares small.
        let medians = self.medians();
        let parts = self.sums_by_part(hot, |sums: &mut [f64; 3], site| {
            let median = f64::from(medians[self.plane(site.plane_row)]) / self.frames();
            let d = site.mean - median;
            sums[0] += 1.0;
            sums[1] += d;
            sums[2] += d * d;
        });
        let mut planes = vec![[0.0; 3]; self.layout.cfa.planes()];
        for (plane_row, part) in parts.into_iter().enumerate() {
            let plane = &mut planes[self.plane(plane_row)];
            plane.iter_mut().zip(part).for_each(|(sum, more)| *sum += more);
        }
        let count: f64 = planes.iter().map(|[count, ..]| count).sum();
        let squares: f64 = planes.iter().map(|[count, sum, squares]| squares - sum * sum / count.max(1.0)).sum();
        let free = count - planes.len() as f64;
        squares / free - (noise.within + noise.row) / self.frames()
    }

    /// Unevenness of the plane whose tiles differ most. Row noise contributes to its error, because it shifts all sites
    /// of a row together.
    pub(super) fn unevenness(&self, hot: &HotPixels, noise: PairNoise) -> Unevenness {
        let [rows, columns] = self.layout.plane_size();
        let tiles: Vec<usize> = (0..columns)
            .map(|column| {
                let tile = (0..TILES).find(|tile| Layout::tile(columns, *tile).contains(&column));
                tile.unwrap_or(TILES - 1)
            })
            .collect();
        // Number of sites and sum of means for each tile column.
        let parts = self.sums_by_part(hot, |sums: &mut [f64; 2 * TILES], site| {
            let tile = 2 * tiles[site.column];
            sums[tile] += 1.0;
            sums[tile + 1] += site.mean;
        });
        let mut sums = vec![[0.0; 2]; self.layout.cfa.planes() * TILES * TILES];
        for (plane_row, part) in parts.into_iter().enumerate() {
            let [row, _] = self.layout.place(plane_row);
            let first = (self.plane(plane_row) * TILES + self.layout.tile_row(row)) * TILES;
            for (tile, [count, sum]) in sums[first..].iter_mut().zip(part.as_chunks().0) {
                tile[0] += count;
                tile[1] += sum;
            }
        }
        let sites = (rows / TILES * (columns / TILES)) as f64;
        let error = (noise.within / sites + noise.row.max(0.0) / (rows / TILES) as f64) / self.frames();
        sums.chunks(TILES * TILES)
            .map(|tiles| {
                let [low, high] = tiles
                    .iter()
                    .filter(|[count, _]| *count > 0.0)
                    .map(|[count, sum]| sum / count)
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], mean| [mean.min(low), mean.max(high)]);
                Unevenness { difference: high - low, error: error.sqrt() }
            })
            .max_by(|a, b| a.difference.total_cmp(&b.difference))
            .unwrap_or(Unevenness { difference: 0.0, error: 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::calibrate::layout::Cfa;

    const LAYOUT: Layout = Layout { cfa: Cfa::Rggb, height: 64, width: 64 };

    /// Frames of whole noise of the variance 2 (−2 to 2 evenly) about 100, changed by site and frame.
    fn mean_of(frames: usize, change: impl Fn(usize, usize) -> u16) -> MeanFrame {
        let mut mean = MeanFrame::new(LAYOUT);
        let mut state = 1_u64;
        for frame in 0..frames {
            let samples: Vec<u16> = (0..LAYOUT.height * LAYOUT.width)
                .map(|site| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    98 + ((state >> 33) % 5) as u16 + change(frame, site)
                })
                .collect();
            mean.add(&samples);
        }
        mean
    }

    const NOISE: PairNoise = PairNoise { within: 2.0, row: 0.0 };

    #[test]
    fn consistently_distant_sites_are_hot() {
        let sites = [5, 64 * 9 + 8, 64 * 63 + 63];
        let hot = mean_of(4, |_, site| if sites.contains(&site) { 30 } else { 0 });
        let found = hot.hot_pixels(NOISE.within);
        assert_eq!(found.count(), 3);
        // Site 5 is column 2 of the odd columns of row 0; row 9, column 8 is column 4 of the even ones.
        assert_eq!(found.columns(1).collect::<Vec<_>>(), [2]);
        assert_eq!(found.columns(2 * 9).collect::<Vec<_>>(), [4]);
        // As far in the mean, but by one sample.
        let single = mean_of(4, |frame, site| if frame == 0 && sites.contains(&site) { 120 } else { 0 });
        assert_eq!(single.hot_pixels(NOISE.within).count(), 0);
    }

    #[test]
    fn light_and_pattern_are_distinguished_from_noise() {
        let none = HotPixels::none(LAYOUT.plane_rows());
        let plain = mean_of(8, |_, _| 0);
        assert!(plain.pattern(&none, NOISE).abs() < 0.05);
        let even = plain.unevenness(&none, NOISE);
        // 16 sites a tile and 8 frames.
        assert!((even.error - (2.0_f64 / 128.0).sqrt()).abs() < 1e-12);
        assert!(even.difference < 6.0 * even.error, "{}", even.difference);
        // Green in the rows of blue alone is lit, from 0 to 3 ADU over the rows.
        let lit = mean_of(8, |_, site| {
            let (row, column) = (site / 64, site % 64);
            if row % 2 == 1 && column % 2 == 0 { (row / 16) as u16 } else { 0 }
        });
        let found = lit.unevenness(&none, NOISE);
        assert!((found.difference - 3.0).abs() < 6.0 * found.error, "{}", found.difference);
        // Each third site is 3 ADU above: a variance of 2.
        let pattern = mean_of(8, |_, site| if site % 3 == 0 { 3 } else { 0 });
        assert!((pattern.pattern(&none, NOISE) - 2.0).abs() < 0.1);
    }
}
