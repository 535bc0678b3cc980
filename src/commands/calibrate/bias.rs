//! Measurement of the bias frames of a setting: [`BiasFit`].
//!
//! The frames are read twice, so that only a few are in memory at once: first for their mean, which reveals light, hot
//! pixels and a fixed pattern, then for their noise without the hot pixels.
//!
//! Plausibility checks of the calibration frames of one camera setting: severe problems are errors, others become
//! notes.
//!
//! Mean of all bias frames of a setting, with its hot pixels, fixed pattern and unevenness: [`MeanFrame`].

use std::path::PathBuf;

use rayon::prelude::*;

use super::frames::{Frame, FrameReader, HotPixels, Inputs, Layout, TILES, in_batches};
use super::read_noise::{PlotFit, ReadNoise, plot_fit};
use super::recording::SettingFiles;
use super::sums::{Centres, PairNoise, PairSums, PlaneSums, ResidualHistogram};
use darkqa_base::error::{Error, Result};

/// Results of the bias frames of a setting.
#[derive(Debug)]
pub(super) struct BiasFit {
    /// Number of frames.
    pub(super) frames: usize,
    pub(super) hot: HotPixels,
    /// Residuals of all frames, for the probability plot.
    pub(super) residuals: ResidualHistogram,
    /// Read noise by maximum likelihood, not yet multiplied by `widened`.
    pub(super) read: ReadNoise,
    /// Read noise by the probability plot, already multiplied by `widened`.
    pub(super) plot: PlotFit,
    /// Factor of σ_TL that compensates for the noise removed with the mean frame.
    pub(super) widened: f64,
    /// Sums of pairs of frames; the last group may have a single frame.
    groups: Vec<FramePair>,
}

/// Two successive frames, or the last frame of an odd number.
#[derive(Debug)]
struct FramePair {
    /// Number and sum of the samples of each plane, over all frames of the group.
    planes: Vec<[u64; 2]>,
    /// `None` for a single frame.
    noise: Option<PairNoise>,
}

/// Sums of a group, and the residuals of its frames.
struct GroupWork {
    group: FramePair,
    residuals: ResidualHistogram,
    correlation: f64,
}

impl BiasFit {
    /// Measures the bias frames of a setting. Adds warnings to `notes`.
    ///
    /// # Errors
    /// If a frame cannot be read, or a check fails.
    pub(super) fn measure(
        reader: &FrameReader,
        files: &SettingFiles,
        inputs: &mut Inputs,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let refused = |problem: String| {
            let place = files.bias[0].parent().map(|folder| folder.display().to_string());
            Error::data(place.unwrap_or_default(), problem)
        };
        let first = FirstPass::read(reader, &files.bias, inputs)?;
        let check = BiasCheck::new(&first.mean, first.noise()).map_err(refused)?;
        notes.extend(check.notes(files.bias.len()));
        let removes_pattern = check.removes_pattern(files.bias.len());
        let centres = if removes_pattern {
            Centres::MeanFrame { sums: &first.mean.sums, frames: first.mean.frames() }
        } else {
            Centres::RowsAndPlanes
        };
        let works = second_pass(reader, &files.bias, &check.hot, centres)?;
        let frames = files.bias.len() as f64;
        let widened = if removes_pattern {
            // Subtracting a mean of n frames removes 1/n of their variance.
            (frames / (frames - 1.0)).sqrt()
        } else {
            1.0
        };
        let (groups, residuals): (Vec<FramePair>, Vec<ResidualHistogram>) =
            works.into_iter().map(|work| (work.group, work.residuals)).unzip();
        let read = ReadNoise::fit(&residuals).map_err(refused)?;
        let mut all = ResidualHistogram::default();
        for group in &residuals {
            all.add(group);
        }
        let plot = plot_fit(&all);
        Ok(Self {
            frames: files.bias.len(),
            hot: check.hot,
            plot: PlotFit { scale: widened * plot.scale, ..plot },
            residuals: all,
            read,
            widened,
            groups,
        })
    }

    /// Number of groups of frames.
    pub(super) fn groups(&self) -> usize {
        self.groups.len()
    }

    /// Number of pairs of frames.
    pub(super) fn pairs(&self) -> usize {
        self.groups.iter().filter(|group| group.noise.is_some()).count()
    }

    /// Weighted means of the planes in ADU, with one weight for each group.
    pub(super) fn offsets(&self, weights: &[f64]) -> Vec<f64> {
        let planes = self.groups.first().map_or(0, |group| group.planes.len());
        (0..planes)
            .map(|plane| {
                let (mut count, mut sum) = (0.0, 0.0);
                for (group, weight) in self.groups.iter().zip(weights) {
                    let [n, more] = group.planes[plane];
                    count += weight * n as f64;
                    sum += weight * more as f64;
                }
                sum / count
            })
            .collect()
    }

    /// Weighted variances of the noise within rows and of the row noise in ADU², with one weight for each group.
    pub(super) fn noise(&self, weights: &[f64]) -> PairNoise {
        let groups = self.groups.iter().zip(weights);
        mean_noise(groups.filter_map(|(group, weight)| Some((group.noise?, *weight))))
    }
}

/// Weighted mean of noise variances.
fn mean_noise(noises: impl Iterator<Item = (PairNoise, f64)>) -> PairNoise {
    let [mut sum, mut within, mut row] = [0.0; 3];
    for (noise, weight) in noises {
        sum += weight;
        within += weight * noise.within;
        row += weight * noise.row;
    }
    PairNoise { within: within / sum, row: row / sum }
}

/// Result of reading the frames for the first time.
struct FirstPass {
    mean: MeanFrame,
    /// Noise of each pair. Hot pixels are included, because their constant offset cancels in a difference.
    noises: Vec<PairNoise>,
}

impl FirstPass {
    fn read(reader: &FrameReader, files: &[PathBuf], inputs: &mut Inputs) -> Result<Self> {
        let groups: Vec<&[PathBuf]> = files.chunks(2).collect();
        let mut pass = Self { mean: MeanFrame::new(reader.layout), noises: Vec::new() };
        let none = HotPixels::none(reader.layout.plane_rows());
        in_batches(
            &groups,
            2 * reader.bytes_of_frame(),
            |group| {
                let frames = read_group(reader, group)?;
                for (path, frame) in group.iter().zip(&frames) {
                    codes(&frame.samples).map_err(|problem| Error::data(path.display(), problem))?;
                }
                let noise = match &frames[..] {
                    [a, b] => {
                        let sums = PairSums::new(reader.layout, [&a.samples, &b.samples], &none);
                        Some(sums.noise())
                    }
                    _ => None,
                };
                Ok((frames, noise))
            },
            |group, (frames, noise)| {
                for (path, frame) in group.iter().zip(&frames) {
                    inputs.add_unique(path, &frame.facts)?;
                    pass.mean.add(&frame.samples);
                }
                pass.noises.extend(noise);
                Ok(())
            },
        )?;
        Ok(pass)
    }

    fn noise(&self) -> PairNoise {
        mean_noise(self.noises.iter().map(|noise| (*noise, 1.0)))
    }
}

/// Computes the sums and residuals of all groups, without hot pixels.
fn second_pass(
    reader: &FrameReader,
    files: &[PathBuf],
    hot: &HotPixels,
    centres: Centres<'_>,
) -> Result<Vec<GroupWork>> {
    let groups: Vec<&[PathBuf]> = files.chunks(2).collect();
    let mut works = Vec::with_capacity(groups.len());
    in_batches(
        &groups,
        2 * reader.bytes_of_frame(),
        |group| {
            let frames = read_group(reader, group)?;
            let work = group_work(reader, &frames, hot, centres);
            correlation(work.correlation).map_err(|problem| Error::data(group[0].display(), problem))?;
            Ok(work)
        },
        |_, work| {
            works.push(work);
            Ok(())
        },
    )?;
    Ok(works)
}

fn read_group(reader: &FrameReader, group: &[PathBuf]) -> Result<Vec<Frame>> {
    group.iter().map(|path| reader.read(path)).collect()
}

fn group_work(reader: &FrameReader, frames: &[Frame], hot: &HotPixels, centres: Centres<'_>) -> GroupWork {
    let layout = reader.layout;
    let mut planes = vec![[0; 2]; layout.cfa.planes()];
    let mut residuals = ResidualHistogram::default();
    for frame in frames {
        let sums = PlaneSums::new(layout, &frame.samples, hot);
        for (plane, more) in planes.iter_mut().zip(sums.planes()) {
            plane[0] += more[0];
            plane[1] += more[1];
        }
        residuals.add(&ResidualHistogram::new(layout, &frame.samples, &sums, hot, centres));
    }
    let pair = match frames {
        [a, b] => Some(PairSums::new(layout, [&a.samples, &b.samples], hot)),
        _ => None,
    };
    GroupWork {
        correlation: pair.as_ref().map_or(0.0, |pair| {
            let equal = vec![1.0; layout.cfa.planes()];
            pair.neighbours().correlation(&equal)
        }),
        group: FramePair { planes, noise: pair.as_ref().map(PairSums::noise) },
        residuals,
    }
}

/// Maximum share of zeros among the samples of a bias frame (heuristic).
const MAX_ZERO_SHARE: f64 = 1e-3;

/// Maximum share of hot pixels (heuristic).
const MAX_HOT_SHARE: f64 = 5e-3;

/// Maximum correlation of neighbours in the difference of two frames (heuristic: smoothing gives 0.5, independent noise
/// 0.004).
const MAX_CORRELATION: f64 = 0.02;

/// Maximum variance of a fixed pattern, relative to the noise variance (heuristic).
const MAX_PATTERN_SHARE: f64 = 0.2;

/// Minimum number of bias frames whose mean may be subtracted as the fixed pattern (heuristic: the mean of fewer frames
/// is too noisy).
const MIN_PATTERN_FRAMES: usize = 16;

/// Maximum difference between tile means of a bias frame, in standard deviations of the noise (heuristic). A difference
/// beyond both this limit and [`MAX_TILE_ERRORS`] means that light reached the sensor.
const MAX_TILE_DEVIATIONS: f64 = 0.5;

/// Maximum difference between tile means of a bias frame, in standard errors (heuristic).
const MAX_TILE_ERRORS: f64 = 8.0;

/// Checks the raw codes of a single bias frame.
///
/// # Errors
/// If negative noise was clipped to 0, or the codes were scaled by a power of two.
pub(super) fn codes(samples: &[u16]) -> Result<(), String> {
    let zeros = samples.iter().filter(|sample| **sample == 0).count();
    let share = zeros as f64 / samples.len().max(1) as f64;
    if share > MAX_ZERO_SHARE {
        return Err(format!(
            "{:.1} % of a bias frame are 0: bias frames must keep negative noise; export without subtracting the black level",
            100.0 * share
        ));
    }
    // Trailing zero bits that all codes share come from scaling, such as 12-bit codes in a 16-bit range.
    let bits = samples.iter().fold(0, |bits, sample| bits | sample);
    let factor = 1_u32 << bits.trailing_zeros().min(15);
    if factor > 1 {
        return Err(format!(
            "every code is a multiple of {factor}: the codes of the sensor were multiplied, so that rounding and K are in other units; export them as they are, or divide by {factor}"
        ));
    }
    Ok(())
}

/// Checks that neighbouring sites of one colour have independent noise, given their correlation in the difference of
/// two frames.
///
/// # Errors
/// If the correlation exceeds its limit: the frames were smoothed or resized.
pub(super) fn correlation(correlation: f64) -> Result<(), String> {
    if correlation.abs() > MAX_CORRELATION {
        return Err(format!(
            "not raw: the noise of neighbours of one colour correlates by {correlation:.2} in the difference of this frame and its partner (limit {MAX_CORRELATION}): the camera, or the export, has smoothed or resized the frames"
        ));
    }
    Ok(())
}

/// Hot pixels and fixed pattern in the mean of the bias frames.
#[derive(Debug)]
pub(super) struct BiasCheck {
    pub(super) hot: HotPixels,
    /// Variance of the fixed pattern, relative to the noise variance.
    pattern_share: f64,
    /// Number of sites in the mean frame.
    sites: usize,
}

impl BiasCheck {
    /// Checks the mean frame, given the noise variances of a single frame in ADU².
    ///
    /// # Errors
    /// If the frames have no noise, light reached the sensor, or too many pixels are hot.
    pub(super) fn new(mean: &MeanFrame, noise: PairNoise) -> Result<Self, String> {
        if noise.within <= 0.0 {
            return Err("bias frames without any noise: copies of one frame?".to_owned());
        }
        let hot = mean.hot_pixels(noise.within);
        let sites = mean.sums.len();
        let hot_share = hot.count() as f64 / sites as f64;
        let uneven = mean.unevenness(&hot, noise);
        let deviation = noise.within.sqrt();
        if uneven.difference > (MAX_TILE_DEVIATIONS * deviation).max(MAX_TILE_ERRORS * uneven.error) {
            return Err(format!(
                "light on bias frames: the means of parts of one colour differ by {:.2} ADU over the frame, where noise has a deviation of {deviation:.2} ADU; close the lens and the viewfinder, take the shortest exposure",
                uneven.difference
            ));
        }
        if hot_share > MAX_HOT_SHARE {
            return Err(format!(
                "{:.2} % of the pixels are hot (limit {} %): bias frames need the shortest exposure and a cool sensor",
                100.0 * hot_share,
                100.0 * MAX_HOT_SHARE
            ));
        }
        let pattern_share = mean.pattern(&hot, noise) / (noise.within + noise.row.max(0.0));
        Ok(Self { hot, pattern_share, sites })
    }

    /// True if the mean of `frames` bias frames is subtracted: the fixed pattern is strong, and the frames suffice to
    /// measure it.
    pub(super) fn removes_pattern(&self, frames: usize) -> bool {
        self.pattern_share > MAX_PATTERN_SHARE && frames >= MIN_PATTERN_FRAMES
    }

    /// Notes on hot pixels and the fixed pattern, for `frames` bias frames.
    pub(super) fn notes(&self, frames: usize) -> Vec<String> {
        let mut notes = Vec::new();
        if self.hot.count() > 0 {
            notes.push(format!(
                "{} hot pixels ({:.3} %) are left out",
                self.hot.count(),
                100.0 * self.hot.count() as f64 / self.sites as f64
            ));
        }
        if self.pattern_share > MAX_PATTERN_SHARE {
            let finding =
                format!("a fixed pattern has {:.0} % of the variance of the noise", 100.0 * self.pattern_share);
            let treatment = if self.removes_pattern(frames) {
                "the mean of all bias frames is taken off".to_owned()
            } else {
                format!("σ_TL holds it, too; with {MIN_PATTERN_FRAMES} bias frames or more their mean is taken off")
            };
            notes.push(format!("{finding}: {treatment}; the model has no fixed pattern"));
        }
        notes
    }
}

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
struct FrameSite {
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
    fn sums_by_part<const N: usize>(
        &self,
        hot: &HotPixels,
        add: impl Fn(&mut [f64; N], FrameSite) + Sync,
    ) -> Vec<[f64; N]> {
        (0..self.layout.plane_rows())
            .into_par_iter()
            .with_min_len(64)
            .map(|plane_row| {
                let mut hot = hot.columns(plane_row).peekable();
                let mut sums = [0.0; N];
                for (column, sum) in self.part(&self.sums, plane_row).enumerate() {
                    if hot.next_if_eq(&column).is_none() {
                        let site = FrameSite { plane_row, column, mean: f64::from(*sum) / self.frames() };
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
    use crate::commands::calibrate::frames::Cfa;

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
