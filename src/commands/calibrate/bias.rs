//! Measurement of the bias frames of a setting: [`BiasFit`].
//!
//! The frames are read twice, so that only a few are in memory at once: first for their mean, which reveals light, hot
//! pixels and a fixed pattern, then for their noise without the hot pixels.

use std::path::PathBuf;

use super::batches::in_batches;
use super::checks::{self, BiasCheck};
use super::frames::{Frame, FrameReader};
use super::hot_pixels::HotPixels;
use super::inputs::Inputs;
use super::mean_frame::MeanFrame;
use super::read_noise::{PlotFit, ReadNoise, plot_fit};
use super::recording::SettingFiles;
use super::sums::{Centres, PairNoise, PairSums, PlaneSums, Residuals};
use crate::error::{Error, Result};

/// Results of the bias frames of a setting.
#[derive(Debug)]
pub(super) struct BiasFit {
    /// Number of frames.
    pub(super) frames: usize,
    pub(super) hot: HotPixels,
    /// Residuals of all frames, for the probability plot.
    pub(super) residuals: Residuals,
    /// Read noise by maximum likelihood, not yet multiplied by `widened`.
    pub(super) read: ReadNoise,
    /// Read noise by the probability plot, already multiplied by `widened`.
    pub(super) plot: PlotFit,
    /// Factor of σ_TL that compensates for the noise removed with the mean frame.
    pub(super) widened: f64,
    /// Sums of pairs of frames; the last group may have a single frame.
    groups: Vec<Group>,
}

/// Two successive frames, or the last frame of an odd number.
#[derive(Debug)]
struct Group {
    /// Number and sum of the samples of each plane, over all frames of the group.
    planes: Vec<[u64; 2]>,
    /// `None` for a single frame.
    noise: Option<PairNoise>,
}

/// Sums of a group, and the residuals of its frames.
struct GroupWork {
    group: Group,
    residuals: Residuals,
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
        let (groups, residuals): (Vec<Group>, Vec<Residuals>) =
            works.into_iter().map(|work| (work.group, work.residuals)).unzip();
        let read = ReadNoise::fit(&residuals).map_err(refused)?;
        let mut all = Residuals::default();
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
                    checks::codes(&frame.samples).map_err(|problem| Error::data(path.display(), problem))?;
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
            checks::correlation(work.correlation).map_err(|problem| Error::data(group[0].display(), problem))?;
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
    let mut residuals = Residuals::default();
    for frame in frames {
        let sums = PlaneSums::new(layout, &frame.samples, hot);
        for (plane, more) in planes.iter_mut().zip(sums.planes()) {
            plane[0] += more[0];
            plane[1] += more[1];
        }
        residuals.add(&Residuals::new(layout, &frame.samples, &sums, hot, centres));
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
        group: Group { planes, noise: pair.as_ref().map(PairSums::noise) },
        residuals,
    }
}
