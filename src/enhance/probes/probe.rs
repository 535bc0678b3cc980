//! Plausibility of a model's images of a few dark frames, by value ranges: [`Probe`].
//!
//! A graph does not declare its value ranges. So every pair of ranges that sidecar, preset and element types allow is
//! tried. A pair is implausible if at least half of the frames have a flaw.
//!
//! Mean output of a model for black and for white input: [`OutputEnds`].
//!
//! The value ranges of a model's input and output: [`RangePair`].

use std::fmt;
use std::ops::Range;

use super::plausible::{Gravity, MeasuredFlaw, UnclampedImage, judge};
use crate::conventions::sidecar::ADD;
use crate::conventions::{ValueRange, ValueScale};
use crate::outputs::light_map_line;
use darkqa_base::types::{Flaw, Rgb};

/// Number of dark frames of a probe. With 6, none of 9 trained models was flagged; with one frame, 5 % were.
pub const FRAMES: usize = 6;

/// Message that no range explains a flaw, with the ranges that were tried.
const NONE_FITS: &str = "No usual value range fits (0..1, 0..255, -1..1, -0.5..0.5, mean and std of ImageNet or CLIP)";

/// Placeholder in remedies for the name of the output that is read.
pub(super) const OUTPUT: &str = "OUTPUT";

/// Difference in [`PairTrial::distance`], in codes, by which the best pair must beat the second to be advised alone.
/// Chosen.
const CLEAR_MARGIN: f64 = 25.0;

/// A model's images of the dark frames, with one pair of ranges.
#[derive(Debug, Clone)]
pub(super) struct PairTrial {
    pub(super) ranges: RangePair,
    /// Output of the model for each frame.
    pub(super) made: Vec<UnclampedImage>,
    /// Flaw of each output.
    pub(super) verdicts: Vec<Option<MeasuredFlaw>>,
    /// Output for black and white; `None` if it was not measured.
    pub(super) endpoints: Option<OutputEnds>,
}

impl PairTrial {
    pub(super) fn new(ranges: RangePair, dark: &[UnclampedImage], made: Vec<UnclampedImage>) -> Self {
        let verdicts = dark.iter().zip(&made).map(|(dark, made)| judge(dark, made));
        Self { ranges, verdicts: verdicts.collect(), made, endpoints: None }
    }

    /// True if no frame has a flaw.
    pub(super) fn is_clean(&self) -> bool {
        self.verdicts.iter().all(Option::is_none)
    }

    /// Distance of the outputs for black and white from black and white, in codes; infinite if it was not measured.
    pub(super) fn distance(&self) -> f64 {
        self.endpoints.map_or(f64::INFINITY, |endpoints| endpoints.distance)
    }

    /// True if black stays nearly black and white nearly white.
    pub(super) fn is_near(&self) -> bool {
        self.endpoints.is_some_and(OutputEnds::are_near)
    }

    /// Description of the ranges, with the outputs for black and white if they were measured.
    fn description(&self) -> String {
        match self.endpoints {
            None => self.ranges.to_string(),
            Some(OutputEnds { black, white, .. }) => format!(
                "{} (black becomes {black:.0} of 255, white {white:.0}{})",
                self.ranges,
                if self.is_near() { "" } else { ", so it may be another range" }
            ),
        }
    }

    /// MeasuredFlaw on the pair: the most frequent flaw, if at least half of the frames have one.
    pub(super) fn verdict(&self) -> Option<FlawedFrames> {
        self.most_frequent_flaw().filter(|seen| 2 * seen.flawed >= seen.frames)
    }

    /// The most frequent flaw; `None` if no frame has one.
    fn most_frequent_flaw(&self) -> Option<FlawedFrames> {
        let flawed: Vec<MeasuredFlaw> = self.verdicts.iter().flatten().copied().collect();
        // Reversed, because `max_by_key` returns the last of equally frequent flaws and the first is wanted.
        let example = flawed
            .iter()
            .rev()
            .max_by_key(|verdict| flawed.iter().filter(|other| other.flaw == verdict.flaw).count())?;
        let impossible = flawed.iter().filter(|verdict| verdict.gravity == Gravity::Impossible).count();
        Some(FlawedFrames {
            gravity: if 2 * impossible >= self.verdicts.len().max(1) { Gravity::Impossible } else { Gravity::Doubtful },
            example: *example,
            flawed: flawed.len(),
            frames: self.verdicts.len(),
        })
    }
}

/// The verdict on a model with one pair of ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FlawedFrames {
    pub(super) gravity: Gravity,
    /// The first image with the most frequent flaw.
    pub(super) example: MeasuredFlaw,
    pub(super) flawed: usize,
    pub(super) frames: usize,
}

impl fmt::Display for FlawedFrames {
    /// Writes the verdict, to follow the file's name.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { example, flawed, frames, .. } = self;
        write!(f, "on {flawed} of {frames} dark frames its images {example}")
    }
}

/// Which ranges the sidecar, a preset or the element types state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StatedRanges {
    /// Both ranges.
    Both,
    /// The range of either input or output.
    One,
    /// Neither range.
    Neither,
}

/// Trials of a model with all pairs of ranges.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    pub(super) ranges: StatedRanges,
    /// Ranges that are used unless the probe finds a flaw with them.
    pub(super) usual: RangePair,
    pub(super) pairs: Vec<PairTrial>,
}

/// Conclusion of a probe.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Conclusion {
    /// The ranges are stated, and the images are plausible.
    Plausible,
    /// The images are plausible with the usual ranges, which are assumed.
    Assumed,
    /// The ranges are stated, and the images have a flaw that some models have.
    Doubtful(FlawedFrames),
    /// The images are implausible with the stated ranges, or with all ranges.
    Implausible(FlawedFrames),
    /// The images are implausible with the usual ranges, and plausible only or most clearly with this pair.
    Other(RangePair, FlawedFrames),
    /// The images are implausible with the usual ranges, and plausible with these pairs, the likely ones first.
    Several(Vec<RangePair>, FlawedFrames),
}

impl Probe {
    /// Pairs with which the images are plausible.
    pub(super) fn plausible(&self) -> Vec<RangePair> {
        self.pairs.iter().filter(|pair| pair.verdict().is_none()).map(|pair| pair.ranges).collect()
    }

    /// Conclusion from all trials.
    pub(super) fn conclusion(&self) -> Conclusion {
        let usual = self.usual_pair();
        let advised = self.advised();
        let seen = usual.and_then(|usual| {
            // A flaw on a few frames, other than dim images, counts if another pair has no flaw at all.
            let mixed = usual.most_frequent_flaw().filter(|seen| {
                let is_open = self.ranges != StatedRanges::Both && !advised.is_empty();
                is_open && seen.example.flaw != Flaw::Unlit
            });
            usual.verdict().or(mixed)
        });
        match (self.ranges, seen) {
            (StatedRanges::Both, None) => Conclusion::Plausible,
            (_, None) => Conclusion::Assumed,
            (StatedRanges::Both, Some(seen)) if seen.gravity == Gravity::Doubtful => Conclusion::Doubtful(seen),
            (StatedRanges::Both, Some(seen)) => Conclusion::Implausible(seen),
            (_, Some(seen)) => match (clear_first(&advised), advised.as_slice()) {
                (Some(first), _) => Conclusion::Other(first.ranges, seen),
                (None, []) => Conclusion::Implausible(seen),
                (None, several) => Conclusion::Several(several.iter().map(|pair| pair.ranges).collect(), seen),
            },
        }
    }

    /// Trial of the usual pair; `None` if it was not tried.
    pub(super) fn usual_pair(&self) -> Option<&PairTrial> {
        self.pairs.iter().find(|pair| pair.ranges == self.usual)
    }

    /// Pairs that may be advised instead of the usual one: those without a flaw on any frame.
    fn advised(&self) -> Vec<&PairTrial> {
        self.pairs.iter().filter(|pair| pair.ranges != self.usual && pair.is_clean()).collect()
    }

    /// The plausible pair that preserves black and white clearly best; `None` without such a pair.
    pub(super) fn likeliest(&self) -> Option<RangePair> {
        let plausible: Vec<&PairTrial> = self.pairs.iter().filter(|pair| pair.verdict().is_none()).collect();
        clear_first(&plausible).map(|pair| pair.ranges)
    }

    /// Sorts the pairs by how well they preserve black and white, and removes normalised pairs that do not preserve
    /// them.
    pub(super) fn rank(&mut self) {
        self.pairs.retain(|pair| pair.ranges.is_plain() || pair.is_near());
        self.pairs.sort_by(|a, b| a.distance().total_cmp(&b.distance()));
    }

    /// Removes pairs that are plausible on most frames, but not on all.
    pub(super) fn leave_out_mixed(&mut self) {
        self.pairs.retain(|pair| pair.is_clean() || pair.verdict().is_some());
    }

    /// True if the only flaw in the usual ranges is that images are not brighter, and ranges are not stated.
    fn is_dim(&self, seen: &FlawedFrames) -> bool {
        self.ranges != StatedRanges::Both && seen.example.flaw == Flaw::Unlit && seen.gravity == Gravity::Doubtful
    }

    /// The first plausible pair, else the usual one.
    pub(super) fn best(&self) -> RangePair {
        self.plausible().first().copied().unwrap_or(self.usual)
    }

    /// Message about the flaw and the sidecar lines that would repair it, to follow the file's name; `None` if the
    /// images are plausible.
    pub(super) fn problem(&self) -> Option<String> {
        Some(match self.conclusion() {
            Conclusion::Plausible | Conclusion::Assumed => return None,
            Conclusion::Doubtful(seen) => format!("{seen}"),
            Conclusion::Implausible(seen) => {
                format!("{seen}. {}", self.remedy(&seen))
            }
            Conclusion::Other(pair, seen) => format!(
                "{seen}. {}With {} they are plausible; if the model's code uses these, {ADD}: {}",
                self.advice_for_dim(&seen),
                self.pair_description(pair),
                pair.stated()
            ),
            Conclusion::Several(pairs, seen) => {
                let list: Vec<String> = pairs.iter().map(|pair| self.pair_description(*pair)).collect();
                format!(
                    "{seen}. {}With other value ranges they are plausible ({}); {ADD} those of the model's code, such as {}",
                    self.advice_for_dim(&seen),
                    list.join("; "),
                    pairs[0].stated()
                )
            }
        })
    }

    /// Advice for a model whose images may be dim on purpose; empty for other flaws.
    fn advice_for_dim(&self, seen: &FlawedFrames) -> String {
        if self.is_dim(seen) {
            let usual = self.usual.stated();
            format!("If its images should be this dim, {ADD}: {usual}. ")
        } else {
            String::new()
        }
    }

    /// Description of a pair of ranges, see [`PairTrial::description`].
    fn pair_description(&self, ranges: RangePair) -> String {
        self.pairs.iter().find(|pair| pair.ranges == ranges).map_or_else(|| ranges.to_string(), PairTrial::description)
    }

    /// Remedy for a flaw that no other range explains.
    fn remedy(&self, seen: &FlawedFrames) -> String {
        match (seen.example.flaw, self.ranges) {
            (Flaw::Unlit, StatedRanges::Neither | StatedRanges::One) => {
                format!("If its images should be this dim, {ADD}: {}", self.usual.stated())
            }
            (Flaw::White | Flaw::Haze, StatedRanges::Neither | StatedRanges::One) => {
                format!(
                    "{NONE_FITS}; {ADD} `range_in`, `mean`, `std`, `range_out`, `mean_out` and `std_out` of the model's code"
                )
            }
            (flaw, ranges) => remedy(flaw, ranges),
        }
    }
}

/// The first of ranked pairs, if it is the only one or preserves black and white clearly better than the second.
fn clear_first<'p>(ranked: &[&'p PairTrial]) -> Option<&'p PairTrial> {
    match ranked {
        [] => None,
        [only] => Some(only),
        [first, second, ..] => {
            let is_clear = first.is_near() && first.distance() + CLEAR_MARGIN <= second.distance();
            is_clear.then_some(*first)
        }
    }
}

/// Remedy for a flaw that no other range explains.
fn remedy(flaw: Flaw, ranges: StatedRanges) -> String {
    match (flaw, ranges) {
        (Flaw::Hue, _) => format!(
            "If its output is BGR, {ADD}: `color_out = \"bgr\"` (or \"rgb\", if \"bgr\" is set); if its input is, `color = \"bgr\"` and `color_out = \"rgb\"`"
        ),
        (Flaw::Inverted, _) => format!(
            "If the model's code inverts the output, {ADD}: `image = \"1 - OUTPUT\"`; if it divides the input by it: `image = \"input / OUTPUT\"`; or another output is the image"
        ),
        (Flaw::Grey, _) => format!(
            "If the output is a light map that the input is divided by, {ADD}: `{}`; or it is the luma alone",
            light_map_line(OUTPUT)
        ),
        (Flaw::Shuffled, _) => format!(
            "Perhaps another output is the image, or the dimensions have another order; {ADD} `output`, `layout_in` or `layout_out`"
        ),
        (Flaw::Nan, StatedRanges::Neither) => "Check its weights and its divisions by zero".to_owned(),
        (Flaw::Nan, _) => {
            "Check `range_in` in MODEL.onnx.toml, because values that are too large can cause this; else its weights and its divisions by zero".to_owned()
        }
        (_, StatedRanges::Both) => {
            "Check `range_in`, `range_out`, `mean_out`, `std_out` and `output` in MODEL.onnx.toml, and the preset".to_owned()
        }
        (_, StatedRanges::One) => {
            "One range is set, by MODEL.onnx.toml or the element type, and no other fits it; without a line in that file all are tried".to_owned()
        }
        (_, StatedRanges::Neither) => format!(
            "{NONE_FITS}; perhaps it needs another `mean` and `std` (or `mean_out` and `std_out`), another output is the image, or the export has lost its weights"
        ),
    }
}

/// Height and width, in pixels, of the black and white test image if the model accepts any size; equal to the first
/// size of the probe.
pub(super) const SIZE: [usize; 2] = [96, 144];

/// Mean output of a model for black and for white, in codes of 0..255.
///
/// With the right value ranges, a low-light enhancer keeps black nearly black and white nearly white. Measured on 9
/// trained models: the distances add up to at most 20 codes (RUAS); with wrong ranges that still give plausible images,
/// mostly to 100 and more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OutputEnds {
    pub(super) black: f64,
    pub(super) white: f64,
    /// Sum of the two mean distances of the channels from 0 and 255.
    pub(super) distance: f64,
}

/// Maximum [`OutputEnds::distance`], in codes, at which black and white count as preserved. Chosen.
const MAX_DISTANCE: f64 = 50.0;

impl OutputEnds {
    /// True if black stays nearly black and white nearly white.
    pub(super) fn are_near(self) -> bool {
        self.distance <= MAX_DISTANCE
    }

    /// Means of the output for [`black_and_white`], in the middle of each half.
    pub(super) fn from_codes(codes: &UnclampedImage) -> Self {
        let half = codes.width / 2;
        let quarter = half / 4;
        let black = channel_means(codes, quarter..half - quarter);
        let white = channel_means(codes, half + quarter..codes.width - quarter);
        Self {
            black: mean(black),
            white: mean(white),
            distance: mean(black.map(f64::abs)) + mean(white.map(|code| (code - 255.0).abs())),
        }
    }
}

/// Means of red, green and blue in these columns of the middle half of the rows, in codes.
fn channel_means(codes: &UnclampedImage, columns: Range<usize>) -> [f64; 3] {
    let UnclampedImage { height, width, .. } = *codes;
    let rows = height / 4..(height - height / 4).max(1);
    let pixels = rows.len() * columns.len();
    let mut sums = [0.0; 3];
    for row in rows {
        let row = &codes.samples[3 * row * width..][..3 * width];
        for pixel in row[3 * columns.start..3 * columns.end].chunks_exact(3) {
            for (sum, sample) in sums.iter_mut().zip(pixel) {
                *sum += f64::from(*sample);
            }
        }
    }
    sums.map(|sum| sum / pixels.max(1) as f64)
}

fn mean(channels: [f64; 3]) -> f64 {
    channels.iter().sum::<f64>() / 3.0
}

/// An image with a black left half and a white right half. Both are in one image, because some models stretch an image
/// to its darkest and brightest pixels.
pub(super) fn black_and_white([height, width]: [usize; 2]) -> Rgb {
    let mut image = Rgb::black(height, width);
    for row in image.samples_mut().chunks_exact_mut(3 * width) {
        row[3 * (width / 2)..].fill(u8::MAX);
    }
    image
}

/// Scale of the values of a model's input, and that of its output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RangePair {
    pub(crate) input: ValueScale,
    pub(crate) output: ValueScale,
}

impl RangePair {
    /// All pairs of plain ranges with these stated ranges; `None` stands for every range.
    pub(super) fn plain(input: Option<ValueRange>, output: Option<ValueRange>) -> Vec<Self> {
        let ranges = ValueRange::ALL.map(ValueScale::Range);
        pairs(&scales(input, &ranges), &scales(output, &ranges))
    }

    /// All pairs of these scales that are normalised by a mean and a deviation on at least one side.
    pub(super) fn normalised(inputs: &[ValueScale], outputs: &[ValueScale]) -> Vec<Self> {
        let mut all = pairs(inputs, outputs);
        all.retain(|pair| !pair.is_plain());
        all
    }

    /// True if neither side is normalised.
    pub(super) fn is_plain(self) -> bool {
        matches!(self, Self { input: ValueScale::Range(_), output: ValueScale::Range(_) })
    }

    /// Sidecar lines that state the pair.
    pub(super) fn lines(self) -> Vec<String> {
        let mut lines = scale_lines(self.input, ["range_in", "mean", "std"]);
        lines.extend(scale_lines(self.output, ["range_out", "mean_out", "std_out"]));
        lines
    }

    /// The lines of [`Self::lines`], joined for a sentence.
    pub(super) fn stated(self) -> String {
        self.lines().into_iter().map(|line| format!("`{line}`")).collect::<Vec<_>>().join(" and ")
    }
}

impl fmt::Display for RangePair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in and {} out", self.input, self.output)
    }
}

/// Only the stated range, or `all` scales if none is stated.
fn scales(stated: Option<ValueRange>, all: &[ValueScale]) -> Vec<ValueScale> {
    match stated {
        Some(range) => vec![ValueScale::Range(range)],
        None => all.to_vec(),
    }
}

/// Each input scale with each output scale, grouped by input.
fn pairs(inputs: &[ValueScale], outputs: &[ValueScale]) -> Vec<RangePair> {
    inputs.iter().flat_map(|&input| outputs.iter().map(move |&output| RangePair { input, output })).collect()
}

/// Sidecar lines for one side, with its keys for range, mean and deviation.
fn scale_lines(scale: ValueScale, [range, mean, std]: [&str; 3]) -> Vec<String> {
    match scale.mean_and_std() {
        None => vec![format!("{range} = \"{}\"", scale.range())],
        Some([means, deviations]) => vec![format!("{mean} = {means:?}"), format!("{std} = {deviations:?}")],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::{Normalisation, ValueRange, ValueScale};

    const UNIT: RangePair =
        RangePair { input: ValueScale::Range(ValueRange::Unit), output: ValueScale::Range(ValueRange::Unit) };

    const BYTES: RangePair =
        RangePair { input: ValueScale::Range(ValueRange::Bytes), output: ValueScale::Range(ValueRange::Bytes) };

    /// A pair with these verdicts on the frames.
    fn pair(ranges: RangePair, verdicts: &[Option<MeasuredFlaw>]) -> PairTrial {
        PairTrial { ranges, made: Vec::new(), verdicts: verdicts.to_vec(), endpoints: None }
    }

    /// A plausible pair with this distance of black and white, in codes.
    fn pair_at_distance(ranges: RangePair, distance: f64) -> PairTrial {
        let endpoints = OutputEnds { black: distance, white: 255.0, distance };
        PairTrial { endpoints: Some(endpoints), ..pair(ranges, &[None; 6]) }
    }

    fn probe(ranges: StatedRanges, pairs: Vec<PairTrial>) -> Probe {
        Probe { ranges, usual: UNIT, pairs }
    }

    /// Conclusion from these pairs after ranking.
    fn ranked_conclusion(pairs: Vec<PairTrial>) -> Conclusion {
        let mut probe = probe(StatedRanges::Neither, pairs);
        probe.rank();
        probe.conclusion()
    }

    const FLAT: Option<MeasuredFlaw> =
        Some(MeasuredFlaw { flaw: Flaw::Flat, gravity: Gravity::Impossible, figure: 0.0 });

    const WHITE: Option<MeasuredFlaw> =
        Some(MeasuredFlaw { flaw: Flaw::White, gravity: Gravity::Doubtful, figure: 0.0 });

    const UNLIT: Option<MeasuredFlaw> =
        Some(MeasuredFlaw { flaw: Flaw::Unlit, gravity: Gravity::Doubtful, figure: 0.0 });

    #[test]
    fn usual_ranges_are_assumed_if_they_are_plausible() {
        for bytes in [None, FLAT] {
            let usual = probe(StatedRanges::Neither, vec![pair(UNIT, &[None; 6]), pair(BYTES, &[bytes; 6])]);
            assert_eq!(usual.conclusion(), Conclusion::Assumed);
            assert_eq!(usual.problem(), None);
        }
    }

    #[test]
    fn another_pair_is_advised_if_the_usual_one_is_implausible() {
        let other = probe(StatedRanges::Neither, vec![pair(UNIT, &[FLAT; 6]), pair(BYTES, &[None; 6])]);
        assert!(matches!(other.conclusion(), Conclusion::Other(BYTES, _)));
        let problem = other.problem().unwrap();
        assert!(problem.contains("on 6 of 6 dark frames its images are flat"), "{problem}");
        assert!(problem.contains("`range_in = \"0..255\"` and `range_out = \"0..255\"`"), "{problem}");
    }

    #[test]
    fn usual_ranges_with_a_flaw_give_way_to_a_pair_without() {
        let mut flaws = [None; 6];
        flaws[2] = WHITE;
        let one_white = vec![pair(UNIT, &flaws), pair(BYTES, &[None; 6])];
        let other = probe(StatedRanges::Neither, one_white.clone()).conclusion();
        assert!(matches!(other, Conclusion::Other(BYTES, _)), "{other:?}");
        let alone = probe(StatedRanges::Neither, one_white[..1].to_vec());
        assert_eq!(alone.conclusion(), Conclusion::Assumed);
        flaws[2] = UNLIT;
        let dim = vec![pair(UNIT, &flaws), pair(BYTES, &[None; 6])];
        assert_eq!(probe(StatedRanges::Neither, dim).conclusion(), Conclusion::Assumed);
    }

    #[test]
    fn a_pair_with_a_flaw_on_one_frame_is_not_advised() {
        let mut flaws = [None; 6];
        flaws[2] = WHITE;
        let dim = probe(StatedRanges::Neither, vec![pair(UNIT, &[UNLIT; 6]), pair(BYTES, &flaws)]);
        let problem = dim.problem().unwrap();
        assert!(!problem.contains("0..255"), "{problem}");
        assert!(problem.contains("`range_in = \"0..1\"`"), "{problem}");
    }

    #[test]
    fn the_usual_ranges_are_named_first_if_the_images_are_dim() {
        let dim = probe(StatedRanges::Neither, vec![pair(UNIT, &[UNLIT; 6]), pair(BYTES, &[None; 6])]);
        let problem = dim.problem().unwrap();
        let [usual, other] = ["range_in = \"0..1\"", "range_in = \"0..255\""].map(|line| problem.find(line).unwrap());
        assert!(usual < other, "{problem}");
    }

    #[test]
    fn black_and_white_choose_among_plausible_pairs() {
        let signed = RangePair { input: UNIT.input, output: ValueScale::Range(ValueRange::Signed) };
        let [clear, close, far] = [(2.0, 120.0), (2.0, 9.0), (90.0, 200.0)].map(|distances| {
            ranked_conclusion(vec![
                pair(UNIT, &[FLAT; 6]),
                pair_at_distance(signed, distances.1),
                pair_at_distance(BYTES, distances.0),
            ])
        });
        assert!(matches!(clear, Conclusion::Other(BYTES, _)));
        assert!(matches!(close, Conclusion::Several(pairs, _) if pairs == [BYTES, signed]));
        assert!(matches!(far, Conclusion::Several(..)));
    }

    #[test]
    fn a_normalised_pair_needs_black_and_white() {
        let clip = RangePair { input: ValueScale::Normalised(Normalisation::Clip), output: UNIT.output };
        let [near, far] = [10.0, 60.0]
            .map(|distance| ranked_conclusion(vec![pair(UNIT, &[FLAT; 6]), pair_at_distance(clip, distance)]));
        assert!(matches!(near, Conclusion::Other(pair, _) if pair == clip));
        assert!(matches!(far, Conclusion::Implausible(_)));
    }

    #[test]
    fn no_plausible_pair_names_the_flaw_of_the_usual_one() {
        let none = probe(StatedRanges::Neither, vec![pair(UNIT, &[WHITE; 6]), pair(BYTES, &[FLAT; 6])]);
        let Conclusion::Implausible(seen) = none.conclusion() else {
            panic!("{:?}", none.conclusion());
        };
        assert_eq!(seen.example.flaw, Flaw::White);
    }

    #[test]
    fn half_of_the_frames_decide() {
        let two = pair(UNIT, &[FLAT, FLAT, None, None, None, None]);
        let conclusion = probe(StatedRanges::Both, vec![two]).conclusion();
        assert_eq!(conclusion, Conclusion::Plausible);
        let three = pair(UNIT, &[FLAT, FLAT, FLAT, None, None, None]);
        let conclusion = probe(StatedRanges::Both, vec![three]).conclusion();
        assert!(matches!(conclusion, Conclusion::Implausible(_)));
    }

    #[test]
    fn stated_ranges_may_be_doubtful_but_not_impossible() {
        let doubtful = probe(StatedRanges::Both, vec![pair(UNIT, &[WHITE; 6])]);
        assert!(matches!(doubtful.conclusion(), Conclusion::Doubtful(_)));
        let mixed = probe(StatedRanges::Both, vec![pair(UNIT, &[WHITE, WHITE, WHITE, FLAT, FLAT, FLAT])]);
        assert!(matches!(mixed.conclusion(), Conclusion::Implausible(_)));
    }

    #[test]
    fn black_and_white_have_their_own_codes() {
        let codes = UnclampedImage::from_rgb(&black_and_white([96, 144]));
        let expected = OutputEnds { black: 0.0, white: 255.0, distance: 0.0 };
        assert_eq!(OutputEnds::from_codes(&codes), expected);
    }

    #[test]
    fn smallest_images_have_finite_endpoints() {
        for size in [[1, 1], [1, 2], [2, 1]] {
            let codes = UnclampedImage::from_rgb(&black_and_white(size));
            assert!(OutputEnds::from_codes(&codes).distance.is_finite(), "{size:?}");
        }
    }

    #[test]
    fn a_mean_and_a_deviation_are_lines_of_a_sidecar() {
        let imagenet = RangePair {
            input: ValueScale::Normalised(Normalisation::ImageNet),
            output: ValueScale::Range(ValueRange::Unit),
        };
        assert_eq!(
            imagenet.lines(),
            ["mean = [0.485, 0.456, 0.406]", "std = [0.229, 0.224, 0.225]", "range_out = \"0..1\""]
        );
        let centred = RangePair { output: ValueScale::Normalised(Normalisation::Centred), ..imagenet };
        assert_eq!(centred.lines()[2], "mean_out = [0.5, 0.5, 0.5]");
    }

    #[test]
    fn only_ranges_that_are_not_stated_are_tried() {
        let unit = Some(ValueRange::Unit);
        assert_eq!(RangePair::plain(None, None).len(), 9);
        assert_eq!(RangePair::plain(Some(ValueRange::Signed), None).len(), 3);
        assert_eq!(RangePair::plain(unit, unit).len(), 1);
        let (all, plain) = (ValueScale::ALL, [ValueScale::Range(ValueRange::Unit)]);
        assert_eq!(RangePair::normalised(&all, &all).len(), 27);
        assert_eq!(RangePair::normalised(&all, &plain).len(), 3);
        assert!(RangePair::normalised(&plain, &plain).is_empty());
    }
}
