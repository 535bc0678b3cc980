//! The probe: whether a model's images of a few dark frames can be enhanced images, and in which value ranges ([`Probe`]).
//!
//! A graph does not state its value ranges. So where they are not stated, each pair of ranges is tried. The verdict on a pair is
//! that of at least half of the frames.

use std::fmt;

use super::convention::ValueRange;
use super::plausible::{Codes, Gravity, Verdict, judge};
use darkqa_ground::types::Flaw;

/// Number of dark frames that a model is tried on: with 6, none of 9 trained models was flagged; with one, 5 % were.
pub const FRAMES: usize = 6;

/// The range in which a model is fed, and the one in which it is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RangePair {
    pub(super) input: ValueRange,
    pub(super) output: ValueRange,
}

impl RangePair {
    /// The pairs with these ranges, each of which is tried if it is `None`.
    pub(super) fn all(input: Option<ValueRange>, output: Option<ValueRange>) -> Vec<Self> {
        let of = |stated: Option<ValueRange>| {
            let all = ValueRange::ALL.into_iter();
            all.filter(move |range| stated.is_none_or(|stated| stated == *range))
        };
        of(input)
            .flat_map(|input| of(output).map(move |output| Self { input, output }))
            .collect()
    }
}

impl fmt::Display for RangePair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in and {} out", self.input, self.output)
    }
}

/// A model's images of the dark frames, with one pair of ranges.
#[derive(Debug, Clone)]
pub(super) struct PairTrial {
    pub(super) ranges: RangePair,
    /// What the model made of each frame.
    pub(super) made: Vec<Codes>,
    /// What is wrong with each of them.
    pub(super) verdicts: Vec<Option<Verdict>>,
}

impl PairTrial {
    pub(super) fn new(ranges: RangePair, dark: &[Codes], made: Vec<Codes>) -> Self {
        let verdicts = dark.iter().zip(&made).map(|(dark, made)| judge(dark, made));
        Self {
            ranges,
            verdicts: verdicts.collect(),
            made,
        }
    }

    /// The verdict on the model: the most frequent flaw, if at least half of the frames have one.
    pub(super) fn verdict(&self) -> Option<FlawedFrames> {
        let flawed: Vec<Verdict> = self.verdicts.iter().flatten().copied().collect();
        let half = |count: usize| 2 * count >= self.verdicts.len().max(1);
        if !half(flawed.len()) {
            return None;
        }
        let count = |flaw: Flaw| flawed.iter().filter(|one| one.flaw == flaw).count();
        // Of equally frequent flaws the first.
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
    /// What was seen, as it follows the file's name.
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

/// Which ranges the user, a preset or the element types state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ranges {
    /// Both.
    Stated,
    /// That of the input or that of the output.
    OneStated,
    /// None.
    Open,
}

/// All that was tried.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    pub(super) ranges: Ranges,
    /// The ranges that are used if the probe does not decide.
    pub(super) usual: RangePair,
    pub(super) pairs: Vec<PairTrial>,
}

/// What follows from a probe.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Conclusion {
    /// The ranges are stated or usual, and the images can be enhanced images.
    Plausible,
    /// The ranges are stated, and the images are odd, but some models do that.
    Doubtful(FlawedFrames),
    /// The ranges are stated or all were tried, and the images cannot be enhanced images.
    Implausible(FlawedFrames),
    /// Only these ranges give plausible images, and they are not the usual ones.
    Other(RangePair, FlawedFrames),
    /// Several pairs of ranges give plausible images.
    Several(Vec<RangePair>),
}

impl Probe {
    /// The pairs whose images are plausible.
    pub(super) fn plausible(&self) -> Vec<RangePair> {
        let pairs = self.pairs.iter().filter(|pair| pair.verdict().is_none());
        pairs.map(|pair| pair.ranges).collect()
    }

    /// What follows.
    pub(super) fn conclusion(&self) -> Conclusion {
        let usual = self.pairs.iter().find(|pair| pair.ranges == self.usual);
        let seen = usual.and_then(PairTrial::verdict);
        match (self.ranges, seen, self.plausible().as_slice()) {
            (Ranges::Stated, None, _) | (_, None, [] | [_]) => Conclusion::Plausible,
            (Ranges::Stated, Some(seen), _) if seen.gravity == Gravity::Doubtful => {
                Conclusion::Doubtful(seen)
            }
            (_, Some(seen), []) | (Ranges::Stated, Some(seen), _) => Conclusion::Implausible(seen),
            (_, Some(seen), [other]) => Conclusion::Other(*other, seen),
            (_, _, several) => Conclusion::Several(several.to_vec()),
        }
    }

    /// The first plausible pair, else the usual one.
    pub(super) fn best(&self) -> RangePair {
        self.plausible().first().copied().unwrap_or(self.usual)
    }

    /// What was seen and the lines of the sidecar that would repair it, as it follows the file's name; `None` if the images are
    /// plausible.
    pub(super) fn problem(&self) -> Option<String> {
        let stated = |pair: &RangePair| {
            format!(
                "`range_in = \"{}\"` and `range_out = \"{}\"`",
                pair.input, pair.output
            )
        };
        Some(match self.conclusion() {
            Conclusion::Plausible => return None,
            Conclusion::Doubtful(seen) => format!("{seen}"),
            Conclusion::Implausible(seen) => {
                format!("{seen}. {}", remedy(seen.example.flaw, self.ranges))
            }
            Conclusion::Other(pair, seen) => format!(
                "{seen}. With {pair} they can be enhanced images; if its authors use these ranges, state both in MODEL.onnx.toml beside it: {}",
                stated(&pair)
            ),
            Conclusion::Several(pairs) => {
                let list: Vec<String> = pairs.iter().map(ToString::to_string).collect();
                let likely = bytes_of_units(&pairs).map_or_else(String::new, |pair| {
                    format!(
                        "; perhaps {}: of 9 trained models for 0..1, none was plausible with these",
                        stated(&pair)
                    )
                });
                format!(
                    "its images are plausible with several value ranges ({}), so the right ones cannot be found; state those that its authors use in MODEL.onnx.toml beside it: `range_in = \"…\"` and `range_out = \"…\"`{likely}",
                    list.join("; ")
                )
            }
        })
    }
}

/// 0..255 in and out, if that and 0..1 in and out are the only plausible pairs: of 9 trained models for 0..1, none was plausible with
/// 0..255 in and out, but models for 0..255 are with both.
fn bytes_of_units(pairs: &[RangePair]) -> Option<RangePair> {
    let both = |range| RangePair {
        input: range,
        output: range,
    };
    let [unit, bytes] = [ValueRange::Unit, ValueRange::Bytes].map(both);
    (pairs == [unit, bytes]).then_some(bytes)
}

/// What may repair a flaw that no other range explains.
fn remedy(flaw: Flaw, ranges: Ranges) -> &'static str {
    match (flaw, ranges) {
        (Flaw::Hue, _) => {
            "If its output has blue first, state in MODEL.onnx.toml beside it: `color_out = \"bgr\"` (or \"rgb\", if that is stated)"
        }
        (Flaw::Inverted, _) => {
            "Perhaps another output is the image, or its authors subtract it from white: `image = \"1 - output\"` in MODEL.onnx.toml beside it"
        }
        (Flaw::Shuffled, _) => {
            "Perhaps another output is the image, or the dimensions have another order: `layout_in`, `layout_out` and `output` in MODEL.onnx.toml beside it"
        }
        (Flaw::Unlit | Flaw::White | Flaw::Haze, Ranges::Open | Ranges::OneStated) => {
            "If it is meant to do that, state its ranges in MODEL.onnx.toml beside it: `range_in = \"0..1\"` and `range_out = \"0..1\"`, or those that its authors use"
        }
        (Flaw::Nan, Ranges::Open) => "Check its weights and its divisions by zero",
        (Flaw::Nan, _) => {
            "Check `range_in` in its sidecar: values that are too large can do that; else its weights and its divisions by zero"
        }
        (_, Ranges::Stated) => {
            "Check `range_in`, `range_out` and `output` in its sidecar, and the preset"
        }
        (_, Ranges::OneStated) => {
            "Beside the one range that its sidecar states, or its element type, no other explains that: without a line in the sidecar all are tried"
        }
        (_, Ranges::Open) => {
            "No value range explains that; perhaps another output is the image, or the export has lost its weights"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: RangePair = RangePair {
        input: ValueRange::Unit,
        output: ValueRange::Unit,
    };
    const BYTES: RangePair = RangePair {
        input: ValueRange::Bytes,
        output: ValueRange::Bytes,
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
        }
    }

    fn probe(ranges: Ranges, pairs: Vec<PairTrial>) -> Probe {
        Probe {
            ranges,
            usual: UNIT,
            pairs,
        }
    }

    const FLAT: Option<(Flaw, Gravity)> = Some((Flaw::Flat, Gravity::Impossible));
    const WHITE: Option<(Flaw, Gravity)> = Some((Flaw::White, Gravity::Doubtful));

    #[test]
    fn open_ranges_follow_the_only_plausible_pair() {
        let usual = probe(
            Ranges::Open,
            vec![pair(UNIT, &[None; 6]), pair(BYTES, &[FLAT; 6])],
        );
        assert_eq!(usual.conclusion(), Conclusion::Plausible);
        assert_eq!(usual.problem(), None);
        let other = probe(
            Ranges::Open,
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
    fn several_plausible_pairs_stop_even_if_the_usual_one_is_among_them() {
        let both = probe(
            Ranges::Open,
            vec![pair(UNIT, &[None; 6]), pair(BYTES, &[None; 6])],
        );
        assert_eq!(both.conclusion(), Conclusion::Several(vec![UNIT, BYTES]));
        let problem = both.problem().unwrap();
        assert!(
            problem.contains("perhaps `range_in = \"0..255\"`"),
            "{problem}"
        );
        let signed = RangePair {
            input: ValueRange::Signed,
            ..UNIT
        };
        let other = probe(
            Ranges::Open,
            vec![pair(UNIT, &[None; 6]), pair(signed, &[None; 6])],
        );
        let problem = other.problem().unwrap();
        assert!(problem.contains("-1..1 in and 0..1 out"), "{problem}");
        assert!(!problem.contains("perhaps"), "{problem}");
    }

    #[test]
    fn no_plausible_pair_names_the_flaw_of_the_usual_one() {
        let none = probe(
            Ranges::Open,
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
            probe(Ranges::Stated, vec![pair(UNIT, &flaws)]).conclusion()
        };
        assert_eq!(flawed(2), Conclusion::Plausible);
        assert!(matches!(flawed(3), Conclusion::Implausible(_)));
    }

    #[test]
    fn stated_ranges_may_be_doubtful_but_not_impossible() {
        let doubtful = probe(Ranges::Stated, vec![pair(UNIT, &[WHITE; 6])]);
        assert!(matches!(doubtful.conclusion(), Conclusion::Doubtful(_)));
        let mixed = probe(
            Ranges::Stated,
            vec![pair(UNIT, &[WHITE, WHITE, WHITE, FLAT, FLAT, FLAT])],
        );
        assert!(matches!(mixed.conclusion(), Conclusion::Implausible(_)));
    }

    #[test]
    fn only_ranges_that_are_not_stated_are_tried() {
        assert_eq!(RangePair::all(None, None).len(), 9);
        assert_eq!(RangePair::all(Some(ValueRange::Signed), None).len(), 3);
        let stated = RangePair::all(Some(ValueRange::Unit), Some(ValueRange::Unit));
        assert_eq!(stated, [UNIT]);
    }
}
