//! Measurement of the flats of a setting, pairs of evenly lit frames at several exposures, as points of photon
//! transfer: [`Flats`].
//!
//! Checks of pairs of flats.
//!
//! System gain K by photon transfer: [`TransferLine`].
//!
//! A signal of S ADU is S / K electrons. Their number has the variance S / K, which is K · S in ADU² (Janesick, *Photon
//! Transfer*, 2007; EMVA 1288 release 4 Linear, section 6).

use std::path::PathBuf;

use super::bias::correlation;
use super::frames::{Frame, FrameReader, HotPixels, Inputs, in_batches};
use super::mosaic::FrameFacts;
use super::recording::{ExposureFiles, MIN_EXPOSURES, SettingFiles};
use super::sums::{NeighbourSums, PairNoise, PairSums, PlaneSums, TileSums, TopCode};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Digest;

/// Range of light to use, as shares of white above the offset. EMVA 1288 release 4 Linear fits up to 70 % of
/// saturation. The lower end is chosen: below it, errors of the offset matter; the corners of a frame with 2 % in its
/// centre have 1.5 %.
const RANGE: [f64; 2] = [0.015, 0.7];

/// Usable exposures of a setting.
#[derive(Debug)]
pub(super) struct Flats {
    exposures: Vec<FlatPairs>,
}

/// Pairs of flats of one exposure.
#[derive(Debug)]
struct FlatPairs {
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
        notes.extend(far_below_white(&facts, settings.white));
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
            for (name, digest) in facts.iter().flat_map(FlatPairFacts::files) {
                inputs.check_unique(name, digest)?;
            }
            notes.extend(check.check_pairs()?);
            let pairs: Vec<Vec<Tile>> = facts.iter().map(|pair| in_range(pair, offsets, settings.white)).collect();
            let used: usize = pairs.iter().map(Vec::len).sum();
            if let Some(reason) = check.out_of_range(used, RANGE) {
                left_out.push(reason);
                continue;
            }
            exposures.push(FlatPairs { pairs, dark });
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
    pub(super) fn points(&self, base: Base<'_>, weights: &[f64]) -> Vec<TransferPoint> {
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
                points.extend(pair.iter().map(|tile| TransferPoint {
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
fn in_range(pair: &FlatPairFacts, offsets: &[f64], white: u16) -> Vec<Tile> {
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
) -> Result<Vec<Vec<FlatPairFacts>>> {
    let pairs: Vec<(usize, &[PathBuf])> = files
        .exposures
        .iter()
        .enumerate()
        .flat_map(|(index, exposure)| exposure.flats.chunks(2).map(move |pair| (index, pair)))
        .collect();
    let mut read: Vec<Vec<FlatPairFacts>> = files.exposures.iter().map(|_| Vec::new()).collect();
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
fn pair_facts(reader: &FrameReader, pair: &[PathBuf], hot: &HotPixels) -> Result<(FlatPairFacts, [FrameFacts; 2])> {
    let layout = reader.layout;
    let [a, b] = read_pair(reader, pair)?;
    let sums = PairSums::new(layout, [&a.samples, &b.samples], hot);
    let top = [&a, &b].map(|frame| TopCode::new(layout, &frame.samples, hot));
    let [first, second] = [0, 1].map(|frame| top[frame].largest_share());
    let facts = FlatPairFacts {
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

/// Maximum share of the samples of a plane at its maximum code (chosen).
const MAX_AT_TOP: f64 = 1e-3;

/// Share of white below which clipping is suspicious (chosen).
const MIN_CLIPPING: f64 = 0.9;

/// Minimum share of white that the maximum code of the flats should reach (chosen: users are asked for flats up to 60
/// %).
const MIN_REACH: f64 = 0.25;

/// Relative differences of light between the frames of a pair: a note above the first, an error above the second
/// (chosen).
const LIGHT: [f64; 2] = [0.01, 0.05];

/// Minimum share of the tiles of an exposure in the range of light; exposures with fewer are left out (chosen).
const MIN_IN_RANGE: f64 = 0.25;

/// Results of a pair of flats.
#[derive(Debug)]
pub(super) struct FlatPairFacts {
    /// Names of the two files.
    names: [String; 2],
    /// Digests of the two files.
    digests: [Digest; 2],
    /// Maximum code of both frames.
    greatest: u16,
    /// Largest share of the samples of a plane at its maximum code, and this code.
    at_top: (f64, u16),
    /// Means of both frames, in ADU.
    means: [f64; 2],
    neighbours: NeighbourSums,
    tiles: Vec<TileSums>,
}

/// Checks of the pairs of an exposure.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExposureCheck<'a> {
    name: &'a str,
    facts: &'a [FlatPairFacts],
    /// Offsets of the planes in ADU.
    offsets: &'a [f64],
    /// Code of white.
    white: u16,
}

/// An overexposed exposure.
#[derive(Debug)]
pub(super) struct Clipped {
    /// Reason for leaving it out.
    reason: String,
    /// Warning about the code of white, if the exposure is clipped far below it.
    doubt: Option<String>,
}

impl FlatPairFacts {
    /// Names and digests of both files.
    fn files(&self) -> [(&str, Digest); 2] {
        [0, 1].map(|frame| (&*self.names[frame], self.digests[frame]))
    }

    /// Ratio of the light of the first frame to that of the second, by plane. The ratio of a plane with little light is
    /// unreliable, so it is limited to twice the allowed difference; without light it is 1.
    fn light_ratios(&self, offsets: &[f64]) -> Vec<f64> {
        offsets.iter().enumerate().map(|(plane, offset)| self.light_ratio(plane, *offset)).collect()
    }

    fn light_ratio(&self, plane: usize, offset: f64) -> f64 {
        let [count, a, b] = self
            .tiles
            .iter()
            .filter(|tile| tile.plane == plane)
            .fold([0.0; 3], |[count, a, b], tile| [count + tile.count, a + tile.sums[0], b + tile.sums[1]]);
        let [a, b] = [a, b].map(|sum| sum - count * offset);
        if a > 0.0 && b > 0.0 { (a / b).clamp(1.0 - 2.0 * LIGHT[1], 1.0 + 2.0 * LIGHT[1]) } else { 1.0 }
    }
}

impl ExposureCheck<'_> {
    /// Checks that no code is above white.
    ///
    /// # Errors
    /// If a code is above white.
    fn check_white(&self) -> Result<()> {
        let white = self.white;
        match self.facts.iter().find(|pair| pair.greatest > white) {
            Some(pair) => Err(Error::data(
                format_args!("{} and {}", pair.names[0], pair.names[1]),
                format_args!(
                    "code {} is above white, {white}: state the greatest code of the sensor with --white, or see the frames in white/",
                    pair.greatest
                ),
            )),
            None => Ok(()),
        }
    }

    /// Checks for overexposure; `None` if the exposure is not overexposed.
    fn find_clipping(&self) -> Option<Clipped> {
        let (share, code) =
            self.facts.iter().map(|pair| pair.at_top).fold((0.0, 0), |max, top| if top.0 > max.0 { top } else { max });
        let Self { name, white, .. } = self;
        let at = if code == *white {
            format!("white, {white}")
        } else {
            format!("code {code}, the greatest, where white is {white}")
        };
        (share > MAX_AT_TOP).then(|| Clipped {
            reason: format!(
                "exposure {name}: clipped, {:.1} % of a colour are at {at}",
                100.0 * share
            ),
            doubt: (f64::from(code) < MIN_CLIPPING * f64::from(*white)).then(|| {
                format!(
                    "exposure {name} is clipped at {code}, far below white, {white}: if {code} is the greatest code of the sensor, state it with --white; with a white that is too large, the range of codes is, too"
                )
            }),
        })
    }

    /// Checks the pairs, and returns notes on small differences of light.
    ///
    /// # Errors
    /// If the light of the two frames differs too much, or neighbours correlate.
    fn check_pairs(&self) -> Result<Vec<String>> {
        let mut notes = Vec::new();
        let offset = self.offset();
        for pair in self.facts {
            let [a, b] = pair.means.map(|mean| mean - offset);
            let ratio = b / a - 1.0;
            let [first, second] = &pair.names;
            let percent = 100.0 * ratio.abs();
            let word = if ratio < 0.0 { "less" } else { "more" };
            if a > 0.0 && ratio.abs() > LIGHT[1] {
                return Err(Error::data(
                    first,
                    format_args!(
                        "{second} has {percent:.1} % {word} light than this frame; the two frames of a pair must have equal light (limit {} %); were exposures mixed, or does the lamp flicker?",
                        100.0 * LIGHT[1]
                    ),
                ));
            }
            if a > 0.0 && ratio.abs() > LIGHT[0] {
                notes.push(format!(
                    "{first} and {second}: a pair whose second frame has {percent:.1} % {word} light; this is taken off, and K is right if all parts of the frame changed alike; take flats under steadier light"
                ));
            }
            let ratios = pair.light_ratios(self.offsets);
            correlation(pair.neighbours.correlation(&ratios)).map_err(|problem| Error::data(first, problem))?;
        }
        Ok(notes)
    }

    /// Reason for leaving out the exposure if too few tiles are in the range of light, of which `used` are; otherwise
    /// `None`.
    fn out_of_range(&self, used: usize, range: [f64; 2]) -> Option<String> {
        let all: usize = self.facts.iter().map(|pair| pair.tiles.len()).sum();
        let share = used as f64 / all.max(1) as f64;
        (share < MIN_IN_RANGE).then(|| {
            let mean = self.facts.iter().flat_map(|pair| pair.means).sum::<f64>() / (2 * self.facts.len()) as f64
                - self.offset();
            let [low, high] = range.map(|share| 100.0 * share);
            format!(
                "exposure {}: {mean:.0} ADU of light are outside of {low} to {high} % of white, {}",
                self.name, self.white
            )
        })
    }

    /// Mean offset of the planes in ADU.
    fn offset(&self) -> f64 {
        self.offsets.iter().sum::<f64>() / self.offsets.len() as f64
    }
}

/// Warning about the code of white, if all codes of all exposures are far below it.
fn far_below_white(exposures: &[Vec<FlatPairFacts>], white: u16) -> Option<String> {
    let greatest = exposures.iter().flatten().map(|pair| pair.greatest).max()?;
    let share = f64::from(greatest) / f64::from(white);
    (share < MIN_REACH).then(|| {
        format!(
            "the greatest code of the flats, {greatest}, is {:.0} % of white, {white}: is white right? Flats of up to 60 % of white would show it",
            100.0 * share
        )
    })
}

/// Point of photon transfer: a tile of a pair of flats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TransferPoint {
    pub(crate) exposure: usize,
    pub(crate) plane: usize,
    /// Degrees of freedom of the variance, times the weight of the pair.
    pub(crate) weight: f64,
    /// Light above the offset, in ADU.
    pub(crate) signal: f64,
    /// Variance of one frame without read noise, in ADU².
    pub(crate) variance: f64,
    /// Variance of the read noise, in ADU².
    pub(crate) within: f64,
}

/// Straight line through points of photon transfer.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TransferLine {
    /// K of all planes together, in ADU per electron.
    pub(crate) gain: f64,
    /// K of each plane; `None` for a plane without points.
    pub(crate) by_plane: Vec<Option<f64>>,
    /// Change of variance / signal over the range of signals, relative to K.
    pub(crate) bend: f64,
    /// Intercept of a line that need not pass through 0: its variance without light, in ADU².
    pub(crate) intercept: f64,
    /// Standard error of `intercept` from the noise of the sites alone.
    pub(crate) intercept_error: f64,
}

impl TransferLine {
    /// Fits a line through points of this number of planes.
    pub(crate) fn fit(points: &[TransferPoint], planes: usize) -> Self {
        let gain = fitted_gain(points);
        let by_plane = (0..planes)
            .map(|plane| {
                let plane_points: Vec<TransferPoint> =
                    points.iter().filter(|point| point.plane == plane).copied().collect();
                (!plane_points.is_empty()).then(|| fitted_gain(&plane_points))
            })
            .collect();
        let [intercept, intercept_error] = intercept(points, gain);
        Self { gain, by_plane, bend: bend(points, gain), intercept, intercept_error }
    }
}

fn sum(points: &[TransferPoint], term: impl Fn(&TransferPoint) -> f64) -> f64 {
    points.iter().map(term).sum()
}

/// Gain K = Σ w S V / Σ w S² with w = n / (K S + read variance)², because a variance V has the variance 2 (K S + …)² /
/// n. The weights depend on K; three iterations are enough for them to converge.
pub(super) fn fitted_gain(points: &[TransferPoint]) -> f64 {
    let mut gain = sum(points, |p| p.weight * p.variance) / sum(points, |p| p.weight * p.signal);
    for _ in 0..3 {
        let product = sum(points, |p| weight(p, gain) * p.signal * p.variance);
        gain = product / sum(points, |p| weight(p, gain) * p.signal * p.signal);
    }
    gain
}

/// Weight of a point in the fit of the gain.
fn weight(point: &TransferPoint, gain: f64) -> f64 {
    point.weight / (gain * point.signal + point.within).powi(2)
}

/// Slope of V / S over S, weighted by the number of sites, times the range of S and relative to K.
fn bend(points: &[TransferPoint], gain: f64) -> f64 {
    let [slope, _] = line(points.iter().map(|p| (p.weight, p.signal, p.variance / p.signal)));
    let [low, high] = points
        .iter()
        .map(|p| p.signal)
        .fold([f64::INFINITY, 0.0], |[low, high], s| [f64::min(low, s), f64::max(high, s)]);
    slope * (high - low) / gain
}

/// Intercept of the weighted line, and its standard error from the variance 2 (K S + …)² / n of each point.
fn intercept(points: &[TransferPoint], gain: f64) -> [f64; 2] {
    let [slope, mean] = line(points.iter().map(|p| (weight(p, gain), p.signal, p.variance)));
    let [mut sum, mut first, mut second] = [0.0; 3];
    for point in points {
        let weight = weight(point, gain);
        sum += weight;
        first += weight * point.signal;
        second += weight * point.signal * point.signal;
    }
    let centre = first / sum;
    let spread = second - first * centre;
    let variance = 2.0 * (1.0 / sum + centre * centre / spread);
    [mean - slope * centre, variance.sqrt()]
}

/// Slope of the weighted regression of y on x, and the weighted mean of y. A point is (weight, x, y).
fn line(points: impl Iterator<Item = (f64, f64, f64)> + Clone) -> [f64; 2] {
    let [sum, x, y] =
        points.clone().fold([0.0; 3], |[sum, x, y], (weight, px, py)| [sum + weight, x + weight * px, y + weight * py]);
    let (x, y) = (x / sum, y / sum);
    let [products, squares] = points.fold([0.0; 2], |[products, squares], (weight, px, py)| {
        let dx = px - x;
        [products + weight * dx * (py - y), squares + weight * dx * dx]
    });
    [products / squares, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of exact variances, `of` the signal, at 40 signals.
    fn points(of: impl Fn(f64) -> f64) -> Vec<TransferPoint> {
        (0..40)
            .map(|i: i32| {
                let signal = 300.0 * 1.1_f64.powi(i);
                TransferPoint {
                    exposure: (i / 8) as usize,
                    plane: (i % 4) as usize,
                    weight: 1000.0 + f64::from(i),
                    signal,
                    variance: of(signal),
                    within: 2.0,
                }
            })
            .collect()
    }

    #[test]
    fn a_straight_line_gives_its_slope() {
        let fit = TransferLine::fit(&points(|signal| 0.75 * signal), 4);
        assert!((fit.gain - 0.75).abs() < 1e-12);
        assert!(fit.by_plane.iter().all(|k| (k.unwrap() - 0.75).abs() < 1e-12));
        assert!(fit.bend.abs() < 1e-10 && fit.intercept.abs() < 1e-8);
    }

    #[test]
    fn bends_and_intercepts_are_found() {
        let bent = TransferLine::fit(&points(|s| 0.75 * s * (1.1 - 0.2 * s / 12_300.0)), 4);
        // From 300 to 12 344 ADU, V / S falls from 0.821 to 0.674.
        assert!((bent.bend + 0.196).abs() < 0.01, "{}", bent.bend);
        let lifted = TransferLine::fit(&points(|signal| 0.75 * signal + 12.0), 4);
        assert!((lifted.intercept - 12.0).abs() < 1e-6, "{}", lifted.intercept);
        assert!(lifted.intercept_error > 0.0 && lifted.intercept_error < 12.0);
        let mut apart = points(|signal| 0.75 * signal);
        apart.iter_mut().filter(|p| p.plane == 3).for_each(|p| p.variance *= 1.1);
        let fit = TransferLine::fit(&apart, 5);
        assert!((fit.by_plane[3].unwrap() - 0.825).abs() < 1e-12);
        assert!((fit.by_plane[0].unwrap() - 0.75).abs() < 1e-12);
        assert_eq!(fit.by_plane[4], None);
    }

    /// The standard error is that of the scatter: V with the deviation (K S + read variance) · √(2 / n).
    #[test]
    fn the_intercept_error_matches_the_scatter() {
        let mut state = 1_u64;
        let mut normal = || {
            // The sum of twelve uniform numbers.
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                sum + (state >> 32) as f64 / 4_294_967_296.0
            })
        };
        let mut squares = 0.0;
        let mut error = 0.0;
        for _ in 0..400 {
            let mut noisy = points(|signal| 0.75 * signal);
            for point in &mut noisy {
                let deviation = (point.variance + point.within) * (2.0 / point.weight).sqrt();
                point.variance += deviation * normal();
            }
            let fit = TransferLine::fit(&noisy, 4);
            squares += fit.intercept * fit.intercept / 400.0;
            error += fit.intercept_error / 400.0;
        }
        assert!((squares.sqrt() / error - 1.0).abs() < 0.1, "{squares}, {error}");
    }
}
