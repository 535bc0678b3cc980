//! The probe: whether a model's images of a few dark frames are plausible, and in which value ranges ([`Probe`]).
//!
//! A graph does not state its value ranges. So where they are not stated, each pair of ranges is tried. The verdict on a pair is
//! that of at least half of the frames.

use std::fmt;

use super::endpoints::Endpoints;
use super::plausible::{Gravity, UnclampedImage, Verdict, judge};
use super::range_pair::RangePair;
use crate::conventions::sidecar::ADD;
use crate::outputs::light_map_line;
use darkqa_ground::types::Flaw;

/// Number of dark frames that a model is tried on: with 6, none of 9 trained models was flagged; with one, 5 % were.
pub const FRAMES: usize = 6;

/// The finding that no range explains a flaw, with the ranges that were tried.
const NONE_FITS: &str =
    "No usual value range fits (0..1, 0..255, -1..1, -0.5..0.5, mean and std of ImageNet or CLIP)";

/// Placeholder for the output that is read, in the remedy for a flaw.
pub(super) const OUTPUT: &str = "OUTPUT";

/// By how many codes black and white must be nearer to themselves with one pair than with the next for it to be advised alone. Chosen.
const CLEAR_MARGIN: f64 = 25.0;

/// A model's images of the dark frames, with one pair of ranges.
#[derive(Debug, Clone)]
pub(super) struct PairTrial {
    pub(super) ranges: RangePair,
    /// Output of the model for each frame.
    pub(super) made: Vec<UnclampedImage>,
    /// Flaw of each output.
    pub(super) verdicts: Vec<Option<Verdict>>,
    /// Output for black and white; `None` if it was not measured.
    pub(super) endpoints: Option<Endpoints>,
}

impl PairTrial {
    pub(super) fn new(
        ranges: RangePair,
        dark: &[UnclampedImage],
        made: Vec<UnclampedImage>,
    ) -> Self {
        let verdicts = dark.iter().zip(&made).map(|(dark, made)| judge(dark, made));
        Self {
            ranges,
            verdicts: verdicts.collect(),
            made,
            endpoints: None,
        }
    }

    /// Whether no frame has a flaw.
    pub(super) fn is_clean(&self) -> bool {
        self.verdicts.iter().all(Option::is_none)
    }

    /// Distance of black and white from themselves, in codes; infinite if it was not measured.
    pub(super) fn distance(&self) -> f64 {
        self.endpoints
            .map_or(f64::INFINITY, |endpoints| endpoints.distance)
    }

    /// Whether black and white stay near to themselves.
    pub(super) fn is_near(&self) -> bool {
        self.endpoints.is_some_and(Endpoints::are_near)
    }

    /// The ranges, and what black and white become with them, if it was measured.
    fn description(&self) -> String {
        match self.endpoints {
            None => self.ranges.to_string(),
            Some(Endpoints { black, white, .. }) => format!(
                "{} (black becomes {black:.0} of 255, white {white:.0}{})",
                self.ranges,
                if self.is_near() {
                    ""
                } else {
                    ", so it may be another range"
                }
            ),
        }
    }

    /// The verdict on the model: the most frequent flaw, if at least half of the frames have one.
    pub(super) fn verdict(&self) -> Option<FlawedFrames> {
        self.most_frequent_flaw()
            .filter(|seen| 2 * seen.flawed >= seen.frames)
    }

    /// The most frequent flaw, if a frame has one.
    fn most_frequent_flaw(&self) -> Option<FlawedFrames> {
        let flawed: Vec<Verdict> = self.verdicts.iter().flatten().copied().collect();
        let half = |count: usize| 2 * count >= self.verdicts.len().max(1);
        let count = |flaw: Flaw| flawed.iter().filter(|one| one.flaw == flaw).count();
        // Reversed, because `max_by_key` returns the last of equally frequent flaws and the first is wanted.
        let example = flawed.iter().rev().max_by_key(|one| count(one.flaw))?;
        let impossible = flawed
            .iter()
            .filter(|one| one.gravity == Gravity::Impossible);
        Some(FlawedFrames {
            gravity: if half(impossible.count()) {
                Gravity::Impossible
            } else {
                Gravity::Doubtful
            },
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
    pub(super) example: Verdict,
    pub(super) flawed: usize,
    pub(super) frames: usize,
}

impl fmt::Display for FlawedFrames {
    /// The finding as it follows the file's name.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            example,
            flawed,
            frames,
            ..
        } = self;
        write!(
            f,
            "on {flawed} of {frames} dark frames its images {example}"
        )
    }
}

/// Ranges that the user, a preset or the element types state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StatedRanges {
    /// Both.
    Both,
    /// Range of either the input or the output.
    One,
    /// None.
    Neither,
}

/// All that was tried.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    pub(super) ranges: StatedRanges,
    /// The ranges that are used if the probe does not decide.
    pub(super) usual: RangePair,
    pub(super) pairs: Vec<PairTrial>,
}

/// Conclusion of a probe.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Conclusion {
    /// The ranges are stated, and the images are plausible.
    Plausible,
    /// The images are plausible with the usual ranges, which nothing states.
    Assumed,
    /// The ranges are stated, and the images are odd, but some models do that.
    Doubtful(FlawedFrames),
    /// The ranges are stated or all were tried, and the images are implausible.
    Implausible(FlawedFrames),
    /// Only these ranges give plausible images, or they keep black and white nearest to themselves, and they are not the usual ones.
    Other(RangePair, FlawedFrames),
    /// Several pairs of ranges give plausible images, the likely ones first, but not the usual ones.
    Several(Vec<RangePair>, FlawedFrames),
}

impl Probe {
    /// The pairs whose images are plausible.
    pub(super) fn plausible(&self) -> Vec<RangePair> {
        self.pairs
            .iter()
            .filter(|pair| pair.verdict().is_none())
            .map(|pair| pair.ranges)
            .collect()
    }

    /// Draws the conclusion.
    pub(super) fn conclusion(&self) -> Conclusion {
        let usual = self.usual_pair();
        let advised = self.advised();
        let seen = usual.and_then(|usual| {
            // With a flaw on some frames, other than dim images, it gives way to a pair without any.
            let mixed = usual.most_frequent_flaw().filter(|seen| {
                let is_open = self.ranges != StatedRanges::Both && !advised.is_empty();
                is_open && seen.example.flaw != Flaw::Unlit
            });
            usual.verdict().or(mixed)
        });
        match (self.ranges, seen) {
            (StatedRanges::Both, None) => Conclusion::Plausible,
            (_, None) => Conclusion::Assumed,
            (StatedRanges::Both, Some(seen)) if seen.gravity == Gravity::Doubtful => {
                Conclusion::Doubtful(seen)
            }
            (StatedRanges::Both, Some(seen)) => Conclusion::Implausible(seen),
            (_, Some(seen)) => match (clear_first(&advised), advised.as_slice()) {
                (Some(first), _) => Conclusion::Other(first.ranges, seen),
                (None, []) => Conclusion::Implausible(seen),
                (None, several) => {
                    Conclusion::Several(several.iter().map(|pair| pair.ranges).collect(), seen)
                }
            },
        }
    }

    /// The usual pair; `None` if it was not tried.
    pub(super) fn usual_pair(&self) -> Option<&PairTrial> {
        self.pairs.iter().find(|pair| pair.ranges == self.usual)
    }

    /// The pairs that may be advised in place of the usual one: those whose images of all frames are plausible.
    fn advised(&self) -> Vec<&PairTrial> {
        self.pairs
            .iter()
            .filter(|pair| pair.ranges != self.usual && pair.is_clean())
            .collect()
    }

    /// The plausible pair that black and white point to; `None` if several are as likely.
    pub(super) fn likeliest(&self) -> Option<RangePair> {
        let plausible: Vec<&PairTrial> = self
            .pairs
            .iter()
            .filter(|pair| pair.verdict().is_none())
            .collect();
        clear_first(&plausible).map(|pair| pair.ranges)
    }

    /// Puts the pairs first with which black and white stay nearest to themselves, and removes those with a mean and a deviation with
    /// which they do not.
    pub(super) fn rank(&mut self) {
        self.pairs
            .retain(|pair| pair.ranges.is_plain() || pair.is_near());
        self.pairs
            .sort_by(|a, b| a.distance().total_cmp(&b.distance()));
    }

    /// Leaves out pairs that are plausible on most frames, but not on all.
    pub(super) fn leave_out_mixed(&mut self) {
        self.pairs
            .retain(|pair| pair.is_clean() || pair.verdict().is_some());
    }

    /// Whether the images in the usual ranges are merely not brighter.
    fn is_dim(&self, seen: &FlawedFrames) -> bool {
        self.ranges != StatedRanges::Both
            && seen.example.flaw == Flaw::Unlit
            && seen.gravity == Gravity::Doubtful
    }

    /// The first plausible pair, else the usual one.
    pub(super) fn best(&self) -> RangePair {
        self.plausible().first().copied().unwrap_or(self.usual)
    }

    /// The finding and the sidecar lines that would repair it, to follow the file's name; `None` if the images are plausible.
    pub(super) fn problem(&self) -> Option<String> {
        let usual = self.usual.stated();
        let dim = |seen: &FlawedFrames| {
            if self.is_dim(seen) {
                format!("If its images should be this dim, {ADD}: {usual}. ")
            } else {
                String::new()
            }
        };
        Some(match self.conclusion() {
            Conclusion::Plausible | Conclusion::Assumed => return None,
            Conclusion::Doubtful(seen) => format!("{seen}"),
            Conclusion::Implausible(seen) => {
                format!("{seen}. {}", self.remedy(&seen))
            }
            Conclusion::Other(pair, seen) => format!(
                "{seen}. {}With {} they are plausible; if the model's code uses these, {ADD}: {}",
                dim(&seen),
                self.pair_description(pair),
                pair.stated()
            ),
            Conclusion::Several(pairs, seen) => {
                let list: Vec<String> = pairs
                    .iter()
                    .map(|pair| self.pair_description(*pair))
                    .collect();
                format!(
                    "{seen}. {}With other value ranges they are plausible ({}); {ADD} those of the model's code, such as {}",
                    dim(&seen),
                    list.join("; "),
                    pairs[0].stated()
                )
            }
        })
    }

    /// A pair, and what black and white become with it.
    fn pair_description(&self, ranges: RangePair) -> String {
        self.pairs
            .iter()
            .find(|pair| pair.ranges == ranges)
            .map_or_else(|| ranges.to_string(), PairTrial::description)
    }

    /// Remedy for a flaw that no other range explains.
    fn remedy(&self, seen: &FlawedFrames) -> String {
        match (seen.example.flaw, self.ranges) {
            (Flaw::Unlit, StatedRanges::Neither | StatedRanges::One) => format!(
                "If its images should be this dim, {ADD}: {}",
                self.usual.stated()
            ),
            (Flaw::White | Flaw::Haze, StatedRanges::Neither | StatedRanges::One) => {
                format!(
                    "{NONE_FITS}; {ADD} `range_in`, `mean`, `std` and `range_out` of the model's code"
                )
            }
            (flaw, ranges) => remedy(flaw, ranges),
        }
    }
}

/// The first of ranked pairs if it is the only one, or if black and white are clearly nearer to themselves with it than with the second.
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
            "Check `range_in`, `range_out` and `output` in MODEL.onnx.toml, and the preset".to_owned()
        }
        (_, StatedRanges::One) => {
            "One range is set, by MODEL.onnx.toml or the element type, and no other fits it; without a line in that file all are tried".to_owned()
        }
        (_, StatedRanges::Neither) => format!(
            "{NONE_FITS}; perhaps it needs another `mean` and `std`, another output is the image, or the export has lost its weights"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::{Normalisation, ValueRange, ValueScale};

    const UNIT: RangePair = RangePair {
        input: ValueScale::Range(ValueRange::Unit),
        output: ValueScale::Range(ValueRange::Unit),
    };
    const BYTES: RangePair = RangePair {
        input: ValueScale::Range(ValueRange::Bytes),
        output: ValueScale::Range(ValueRange::Bytes),
    };

    fn pair(ranges: RangePair, flaws: &[Option<(Flaw, Gravity)>]) -> PairTrial {
        let verdict = |(flaw, gravity)| Verdict {
            flaw,
            gravity,
            figure: 0.0,
        };
        PairTrial {
            ranges,
            made: Vec::new(),
            verdicts: flaws.iter().map(|flaw| flaw.map(verdict)).collect(),
            endpoints: None,
        }
    }

    /// A plausible pair with black and white so far from themselves, in codes.
    fn far(ranges: RangePair, distance: f64) -> PairTrial {
        let endpoints = Endpoints {
            black: distance,
            white: 255.0,
            distance,
        };
        PairTrial {
            endpoints: Some(endpoints),
            ..pair(ranges, &[None; 6])
        }
    }

    fn probe(ranges: StatedRanges, pairs: Vec<PairTrial>) -> Probe {
        Probe {
            ranges,
            usual: UNIT,
            pairs,
        }
    }

    const FLAT: Option<(Flaw, Gravity)> = Some((Flaw::Flat, Gravity::Impossible));
    const WHITE: Option<(Flaw, Gravity)> = Some((Flaw::White, Gravity::Doubtful));
    const UNLIT: Option<(Flaw, Gravity)> = Some((Flaw::Unlit, Gravity::Doubtful));

    #[test]
    fn usual_ranges_are_assumed_if_they_are_plausible() {
        for bytes in [None, FLAT] {
            let usual = probe(
                StatedRanges::Neither,
                vec![pair(UNIT, &[None; 6]), pair(BYTES, &[bytes; 6])],
            );
            assert_eq!(usual.conclusion(), Conclusion::Assumed);
            assert_eq!(usual.problem(), None);
        }
    }

    #[test]
    fn another_pair_is_advised_if_the_usual_one_is_implausible() {
        let other = probe(
            StatedRanges::Neither,
            vec![pair(UNIT, &[FLAT; 6]), pair(BYTES, &[None; 6])],
        );
        assert!(matches!(other.conclusion(), Conclusion::Other(BYTES, _)));
        let problem = other.problem().unwrap();
        assert!(
            problem.contains("on 6 of 6 dark frames its images are flat"),
            "{problem}"
        );
        assert!(
            problem.contains("`range_in = \"0..255\"` and `range_out = \"0..255\"`"),
            "{problem}"
        );
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
        assert_eq!(
            probe(StatedRanges::Neither, dim).conclusion(),
            Conclusion::Assumed
        );
    }

    #[test]
    fn a_pair_with_a_flaw_on_one_frame_is_not_advised() {
        let mut flaws = [None; 6];
        flaws[2] = WHITE;
        let dim = probe(
            StatedRanges::Neither,
            vec![pair(UNIT, &[UNLIT; 6]), pair(BYTES, &flaws)],
        );
        let problem = dim.problem().unwrap();
        assert!(!problem.contains("0..255"), "{problem}");
        assert!(problem.contains("`range_in = \"0..1\"`"), "{problem}");
    }

    #[test]
    fn the_usual_ranges_are_named_first_if_the_images_are_dim() {
        let dim = probe(
            StatedRanges::Neither,
            vec![pair(UNIT, &[UNLIT; 6]), pair(BYTES, &[None; 6])],
        );
        let problem = dim.problem().unwrap();
        let place = |words: &str| problem.find(words).unwrap();
        assert!(place("range_in = \"0..1\"") < place("range_in = \"0..255\""));
    }

    #[test]
    fn black_and_white_choose_among_plausible_pairs() {
        let signed = RangePair {
            input: UNIT.input,
            output: ValueScale::Range(ValueRange::Signed),
        };
        let ranked = |first: f64, second: f64| {
            let pairs = vec![
                pair(UNIT, &[FLAT; 6]),
                far(signed, second),
                far(BYTES, first),
            ];
            let mut probe = probe(StatedRanges::Neither, pairs);
            probe.rank();
            probe.conclusion()
        };
        assert!(matches!(ranked(2.0, 120.0), Conclusion::Other(BYTES, _)));
        let Conclusion::Several(pairs, _) = ranked(2.0, 9.0) else {
            panic!("nearly as near");
        };
        assert_eq!(pairs, [BYTES, signed]);
        let Conclusion::Several(..) = ranked(90.0, 200.0) else {
            panic!("none is near");
        };
    }

    #[test]
    fn a_normalised_pair_needs_black_and_white() {
        let clip = RangePair {
            input: ValueScale::Normalised(Normalisation::Clip),
            output: UNIT.output,
        };
        let conclusion = |distance: f64| {
            let mut probe = probe(
                StatedRanges::Neither,
                vec![pair(UNIT, &[FLAT; 6]), far(clip, distance)],
            );
            probe.rank();
            probe.conclusion()
        };
        assert!(matches!(conclusion(10.0), Conclusion::Other(pair, _) if pair == clip));
        assert!(matches!(conclusion(60.0), Conclusion::Implausible(_)));
    }

    #[test]
    fn no_plausible_pair_names_the_flaw_of_the_usual_one() {
        let none = probe(
            StatedRanges::Neither,
            vec![pair(UNIT, &[WHITE; 6]), pair(BYTES, &[FLAT; 6])],
        );
        let Conclusion::Implausible(seen) = none.conclusion() else {
            panic!("{:?}", none.conclusion());
        };
        assert_eq!(seen.example.flaw, Flaw::White);
    }

    #[test]
    fn half_of_the_frames_decide() {
        let flawed = |count: usize| {
            let flaws: Vec<_> = (0..6).map(|i| FLAT.filter(|_| i < count)).collect();
            probe(StatedRanges::Both, vec![pair(UNIT, &flaws)]).conclusion()
        };
        assert_eq!(flawed(2), Conclusion::Plausible);
        assert!(matches!(flawed(3), Conclusion::Implausible(_)));
    }

    #[test]
    fn stated_ranges_may_be_doubtful_but_not_impossible() {
        let doubtful = probe(StatedRanges::Both, vec![pair(UNIT, &[WHITE; 6])]);
        assert!(matches!(doubtful.conclusion(), Conclusion::Doubtful(_)));
        let mixed = probe(
            StatedRanges::Both,
            vec![pair(UNIT, &[WHITE, WHITE, WHITE, FLAT, FLAT, FLAT])],
        );
        assert!(matches!(mixed.conclusion(), Conclusion::Implausible(_)));
    }
}
