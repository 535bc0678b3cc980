//! Measurement of the flats of a setting, pairs of evenly lit frames at several exposures, as points of photon
//! transfer: [`Flats`].

mod checks;
mod transfer;

use std::path::PathBuf;

use super::batches::in_batches;
use super::frames::{Frame, FrameReader};
use super::hot_pixels::HotPixels;
use super::inputs::Inputs;
use super::mosaic::FrameFacts;
use super::recording::{ExposureFiles, MIN_EXPOSURES, SettingFiles};
use super::sums::{PairNoise, PairSums, PlaneSums, TopCode};
use crate::error::{Error, Result};
use checks::{ExposureCheck, PairFacts};
pub(super) use transfer::{Point, Transfer, gain};

/// Range of light to use, as shares of white above the offset. EMVA 1288 release 4 Linear fits up to 70 % of
/// saturation. The lower end is chosen: below it, errors of the offset matter; the corners of a frame with 2 % in its
/// centre have 1.5 %.
const RANGE: [f64; 2] = [0.015, 0.7];

/// Usable exposures of a setting.
#[derive(Debug)]
pub(super) struct Flats {
    exposures: Vec<Exposure>,
}

/// Pairs of flats of one exposure.
#[derive(Debug)]
struct Exposure {
    /// Tiles of each pair in the range of light.
    pairs: Vec<Vec<Tile>>,
    dark: Option<Dark>,
}

/// Light and noise of a tile of one plane of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tile {
    plane: usize,
    /// Degrees of freedom of the variance.
    free: f64,
    /// Mean of both frames, in ADU.
    mean: f64,
    /// Variance of one frame, without row noise and after equalizing the light of both frames, in ADU².
    variance: f64,
}

/// Results of the dark frames of an exposure.
#[derive(Debug)]
struct Dark {
    /// Means of the planes in ADU.
    offsets: Vec<f64>,
    /// Variance of the noise within rows, in ADU².
    within: f64,
}

/// Results of the bias frames that the flats need.
#[derive(Debug, Clone, Copy)]
pub(super) struct Base<'a> {
    /// Means of the planes in ADU.
    pub(super) offsets: &'a [f64],
    /// Variance of the noise within rows, in ADU².
    pub(super) within: f64,
}

/// Code of white, and sites to leave out.
#[derive(Debug, Clone, Copy)]
pub(super) struct FlatSettings<'a> {
    /// Code of white.
    pub(super) white: u16,
    pub(super) hot: &'a HotPixels,
}

impl Flats {
    /// Measures the flats of a setting. Adds notes on omissions and warnings to `notes`.
    ///
    /// # Errors
    /// If a frame cannot be read, is a copy or has codes above white, the frames of a pair differ in light, neighbours
    /// correlate, or too few exposures are usable.
    pub(super) fn measure(
        reader: &FrameReader,
        files: &SettingFiles,
        settings: FlatSettings<'_>,
        base: Base<'_>,
        inputs: &mut Inputs,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let mut exposures = Vec::new();
        let mut left_out = Vec::new();
        let facts = read(reader, files, settings.hot, inputs)?;
        notes.extend(checks::far_below_white(&facts, settings.white));
        for (exposure, facts) in files.exposures.iter().zip(facts) {
            let dark = dark(reader, exposure, settings.hot, inputs)?;
            let offsets = dark.as_ref().map_or(base.offsets, |dark| &dark.offsets[..]);
            let check = ExposureCheck { name: &exposure.name, facts: &facts, offsets, white: settings.white };
            check.check_white()?;
            if let Some(clipped) = check.find_clipping() {
                left_out.push(clipped.reason);
                notes.extend(clipped.doubt);
                continue;
            }
            for (name, digest) in facts.iter().flat_map(PairFacts::files) {
                inputs.check_unique(name, digest)?;
            }
            notes.extend(check.check_pairs()?);
            let pairs: Vec<Vec<Tile>> = facts.iter().map(|pair| in_range(pair, offsets, settings.white)).collect();
            let used: usize = pairs.iter().map(Vec::len).sum();
            if let Some(reason) = check.out_of_range(used, RANGE) {
                left_out.push(reason);
                continue;
            }
            exposures.push(Exposure { pairs, dark });
        }
        if exposures.len() < MIN_EXPOSURES {
            return Err(too_few(files, exposures.len(), &left_out));
        }
        notes.extend(left_out.into_iter().map(|reason| format!("{reason}; left out")));
        Ok(Self { exposures })
    }

    /// Number of usable exposures.
    pub(super) fn exposures(&self) -> usize {
        self.exposures.len()
    }

    /// Number of pairs of all exposures.
    pub(super) fn pairs(&self) -> usize {
        self.exposures.iter().map(|exposure| exposure.pairs.len()).sum()
    }

    /// True if every exposure has dark frames.
    pub(super) fn have_dark_frames(&self) -> bool {
        self.exposures.iter().all(|exposure| exposure.dark.is_some())
    }

    /// Points of photon transfer, with one weight for each pair.
    pub(super) fn points(&self, base: Base<'_>, weights: &[f64]) -> Vec<Point> {
        let mut points = Vec::new();
        let mut weights = weights.iter();
        for (index, exposure) in self.exposures.iter().enumerate() {
            let dark = exposure.dark.as_ref();
            let offsets = dark.map_or(base.offsets, |dark| &dark.offsets);
            let within = dark.map_or(base.within, |dark| dark.within);
            for (pair, weight) in exposure.pairs.iter().zip(weights.by_ref()) {
                if *weight <= 0.0 {
                    continue;
                }
                points.extend(pair.iter().map(|tile| Point {
                    exposure: index,
                    plane: tile.plane,
                    weight: weight * tile.free,
                    signal: tile.mean - offsets[tile.plane],
                    variance: tile.variance - within,
                    within,
                }));
            }
        }
        points
    }
}

/// Error for a setting with too few exposures, with the reasons.
fn too_few(files: &SettingFiles, usable: usize, reasons: &[String]) -> Error {
    let problem = format!(
        "{usable} of {} exposures can be used, at least {} are needed: {}",
        files.exposures.len(),
        MIN_EXPOSURES,
        reasons.join("; ")
    );
    Error::data(format_args!("flats of {}", files.name), problem)
}

/// Tiles of a pair whose light is in the range.
fn in_range(pair: &PairFacts, offsets: &[f64], white: u16) -> Vec<Tile> {
    let ratios = pair.light_ratios(offsets);
    pair.tiles
        .iter()
        .filter(|tile| {
            let offset = offsets[tile.plane];
            let share = (tile.mean() - offset) / (f64::from(white) - offset);
            (RANGE[0]..=RANGE[1]).contains(&share)
        })
        .map(|tile| Tile {
            plane: tile.plane,
            free: tile.free,
            mean: tile.mean(),
            variance: tile.variance(ratios[tile.plane]),
        })
        .collect()
}

/// Reads all pairs of all exposures.
fn read(
    reader: &FrameReader,
    files: &SettingFiles,
    hot: &HotPixels,
    inputs: &mut Inputs,
) -> Result<Vec<Vec<PairFacts>>> {
    let pairs: Vec<(usize, &[PathBuf])> = files
        .exposures
        .iter()
        .enumerate()
        .flat_map(|(index, exposure)| exposure.flats.chunks(2).map(move |pair| (index, pair)))
        .collect();
    let mut read: Vec<Vec<PairFacts>> = files.exposures.iter().map(|_| Vec::new()).collect();
    in_batches(
        &pairs,
        2 * reader.bytes_of_frame(),
        |(_, pair)| pair_facts(reader, pair, hot),
        |(exposure, pair), (facts, file_facts)| {
            for (path, facts) in pair.iter().zip(&file_facts) {
                inputs.add(path, facts);
            }
            read[*exposure].push(facts);
            Ok(())
        },
    )?;
    Ok(read)
}

/// Reads a pair of frames and computes its facts and those of its files.
fn pair_facts(reader: &FrameReader, pair: &[PathBuf], hot: &HotPixels) -> Result<(PairFacts, [FrameFacts; 2])> {
    let layout = reader.layout;
    let [a, b] = read_pair(reader, pair)?;
    let sums = PairSums::new(layout, [&a.samples, &b.samples], hot);
    let top = [&a, &b].map(|frame| TopCode::new(layout, &frame.samples, hot));
    let [first, second] = [0, 1].map(|frame| top[frame].largest_share());
    let facts = PairFacts {
        names: [&pair[0], &pair[1]].map(|path| path.display().to_string()),
        digests: [a.facts.digest, b.facts.digest],
        greatest: top[0].max().max(top[1].max()),
        at_top: if second.0 > first.0 { second } else { first },
        means: sums.means(),
        neighbours: sums.neighbours(),
        tiles: sums.tiles(),
    };
    Ok((facts, [a.facts, b.facts]))
}

/// Reads two frames on two threads.
fn read_pair(reader: &FrameReader, pair: &[PathBuf]) -> Result<[Frame; 2]> {
    let (a, b) = rayon::join(|| reader.read(&pair[0]), || reader.read(&pair[1]));
    Ok([a?, b?])
}

/// Reads the dark frames of an exposure; `None` if it has none.
fn dark(reader: &FrameReader, exposure: &ExposureFiles, hot: &HotPixels, inputs: &mut Inputs) -> Result<Option<Dark>> {
    let layout = reader.layout;
    let mut planes = vec![[0_u64; 2]; layout.cfa.planes()];
    let mut noises: Vec<PairNoise> = Vec::new();
    let groups: Vec<&[PathBuf]> = exposure.dark.chunks(2).collect();
    in_batches(
        &groups,
        2 * reader.bytes_of_frame(),
        |group| {
            let frames: Vec<Frame> = group.iter().map(|path| reader.read(path)).collect::<Result<_>>()?;
            let sums: Vec<Vec<[u64; 2]>> =
                frames.iter().map(|frame| PlaneSums::new(layout, &frame.samples, hot).planes()).collect();
            let noise = match &frames[..] {
                [a, b] => Some(PairSums::new(layout, [&a.samples, &b.samples], hot).noise()),
                _ => None,
            };
            let facts: Vec<_> = frames.into_iter().map(|frame| frame.facts).collect();
            Ok((sums, noise, facts))
        },
        |group, (sums, noise, facts)| {
            for (path, facts) in group.iter().zip(&facts) {
                inputs.add_unique(path, facts)?;
            }
            for sums in &sums {
                for (plane, more) in planes.iter_mut().zip(sums) {
                    plane[0] += more[0];
                    plane[1] += more[1];
                }
            }
            noises.extend(noise);
            Ok(())
        },
    )?;
    if noises.is_empty() {
        return Ok(None);
    }
    Ok(Some(Dark {
        offsets: planes.iter().map(|[count, sum]| *sum as f64 / (*count).max(1) as f64).collect(),
        within: noises.iter().map(|noise| noise.within).sum::<f64>() / noises.len() as f64,
    }))
}
