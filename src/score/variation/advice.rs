//! Planned runs: [`Design`], and the half of the combinations under which a question is asked: [`random_half`].

use super::components::{Components, Source};
use super::observation::Facet;
use crate::comparisons::paired::Spread;
use crate::significance::ALPHA;
use darkqa_base::types::Digest;

/// Design of a run: how many questions of how many scenes, under how many levels of each facet. All numbers are at
/// least 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Design {
    pub scenes: usize,
    /// Questions of all scenes together.
    pub questions: usize,
    pub wordings: usize,
    pub orders: usize,
    pub draws: usize,
    pub repeats: usize,
    /// True if each question has a random half of the combinations of wording, order and draw ([`random_half`]).
    pub is_half: bool,
}

impl Design {
    /// Number of combinations of wording, order and draw under which a question is asked.
    #[must_use]
    pub fn combinations(&self) -> usize {
        let all = self.wordings * self.orders * self.draws;
        if self.is_half { all.div_ceil(2) } else { all }
    }

    /// Number of requests to one model in one condition; a difference needs twice as many.
    #[must_use]
    pub fn requests(&self) -> usize {
        self.questions * self.combinations() * self.repeats
    }

    fn levels(&self, facet: Facet) -> usize {
        match facet {
            Facet::Wording => self.wordings,
            Facet::Order => self.orders,
            Facet::Draw => self.draws,
        }
    }
}

impl Components {
    /// Standard error of the mean of a design, for other scenes, questions and levels of the facets, and its degrees of
    /// freedom (Brennan 2001, section 4.1; Satterthwaite 1946, Biometrics Bull. 2:110).
    ///
    /// For a difference, take the components of the differences. A facet that was not varied has no component, and is
    /// missing in the error. If the data have one repeat, more repeats do not reduce the error, because the replies may
    /// be the same in all of them. Half of the combinations double the variance of combinations and rest, and leave the
    /// others.
    #[must_use]
    pub fn spread(&self, design: &Design) -> Spread {
        let count = |number: usize| number.max(1) as f64;
        let (scenes, questions) = (count(design.scenes), count(design.questions));
        let combinations = count(design.combinations());
        let repeats = if self.deviation(Source::Combination).is_some() { count(design.repeats) } else { 1.0 };
        let mut by_question = self.variance(Source::Question)
            + (self.variance(Source::Combination) + self.variance(Source::Rest) / repeats) / combinations;
        let (mut facets, mut squares) = (0.0, 0.0);
        for facet in Facet::ALL {
            let levels = count(design.levels(facet));
            by_question += self.variance(Source::QuestionFacet(facet)) / levels.min(combinations);
            let variance = self.variance(Source::Facet(facet)) / levels;
            facets += variance;
            squares += variance * variance / (levels - 1.0).max(1.0);
        }
        let between_scenes = self.variance(Source::Scene) / scenes + by_question / questions;
        squares += between_scenes * between_scenes / (scenes - 1.0).max(1.0);
        let variance = between_scenes + facets;
        let degrees = if squares > 0.0 { variance * variance / squares } else { (scenes - 1.0).max(1.0) };
        Spread { error: variance.sqrt(), degrees }
    }
}

/// Largest number of scenes of a planned run (chosen): a design that needs more is out of reach.
const MOST_SCENES: usize = 100_000;

impl Components {
    /// The same components, for the wordings, orders and draws that are asked: their own effects are no error.
    #[must_use]
    pub fn of_asked_levels(&self) -> Self {
        let others = self.components.iter().filter(|component| !matches!(component.source, Source::Facet(_)));
        Self { components: others.copied().collect() }
    }

    /// The design with the fewest scenes that detects a difference with a power of 80 % at a level of 5 %, with as many
    /// questions in each scene as `design`; `None` if no number of scenes suffices. These are the components of the
    /// differences of such a comparison.
    ///
    /// A facet that is not asked under several levels may still vary: with one wording, the difference must be larger
    /// than what another wording could change.
    #[must_use]
    pub fn smallest(&self, design: &Design, difference: f64) -> Option<Design> {
        let of = |scenes: usize| {
            let questions = (scenes * design.questions).div_ceil(design.scenes.max(1));
            Design { scenes, questions, ..*design }
        };
        let detects = |scenes: usize| self.spread(&of(scenes)).detectable(ALPHA) <= difference;
        if !detects(MOST_SCENES) {
            return None;
        }
        let (mut too_few, mut enough) = (1, MOST_SCENES);
        while enough - too_few > 1 {
            let middle = usize::midpoint(too_few, enough);
            if detects(middle) {
                enough = middle;
            } else {
                too_few = middle;
            }
        }
        Some(of(enough))
    }
}

/// A random half of the combinations of wordings, orders and draws, given by their numbers, in which the levels of each
/// facet are as equally frequent as possible; of an odd number, the larger half.
///
/// The levels of each facet are put in random order by the digest of `key`, and the combinations are taken whose places
/// have an even sum, as in the half fraction of a two-level design (Box, Hunter and Hunter 2005, Statistics for
/// Experimenters, chapter 6). Over many keys, every combination is equally frequent.
#[must_use]
pub fn random_half(levels: [usize; 3], key: &str) -> Vec<[u16; 3]> {
    let places = Facet::ALL.map(|facet| {
        let facet = facet as usize;
        let mut order: Vec<usize> = (0..levels[facet]).collect();
        order.sort_by_cached_key(|level| {
            let parts = [b"half".as_slice(), key.as_bytes(), &[facet as u8], &(*level as u64).to_le_bytes()];
            *Digest::from_parts(parts).as_bytes()
        });
        let mut places = vec![0; levels[facet]];
        for (place, level) in order.into_iter().enumerate() {
            places[level] = place;
        }
        places
    });
    let mut half = Vec::new();
    for (wording, first) in (0..).zip(&places[0]) {
        for (order, second) in (0..).zip(&places[1]) {
            let draws = (0..).zip(&places[2]).filter(|(_, third)| (first + second + **third) % 2 == 0);
            half.extend(draws.map(|(draw, _)| [wording, order, draw]));
        }
    }
    half
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_design_detects_the_difference_and_one_scene_less_does_not() {
        use crate::variation::tests::known;
        // 10 points between questions, 5 between wordings.
        let components = known([0.0, 0.1, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3]);
        let one = Design { scenes: 10, questions: 40, wordings: 1, orders: 1, draws: 1, repeats: 1, is_half: false };
        assert_eq!(components.smallest(&one, 0.05), None, "another wording may change as much");
        assert!(components.of_asked_levels().smallest(&one, 0.05).is_some());
        let many = Design { wordings: 12, ..one };
        let found = components.smallest(&many, 0.05).unwrap();
        let detects = |design| components.spread(&design).detectable(ALPHA) <= 0.05;
        assert_eq!(found.questions, 4 * found.scenes);
        assert!(detects(found));
        assert!(!detects(Design { scenes: found.scenes - 1, questions: found.questions - 4, ..found }));
    }

    #[test]
    fn a_half_is_balanced() {
        for levels in [[1, 1, 1], [3, 1, 1], [3, 2, 1], [2, 2, 2], [3, 3, 2], [3, 3, 3], [1, 4, 5]] {
            let all: usize = levels.iter().product();
            for key in 0..20 {
                let half = random_half(levels, &key.to_string());
                assert_eq!(half.len(), all.div_ceil(2));
                for facet in 0..3 {
                    let mut counts = vec![0_usize; levels[facet]];
                    for combination in &half {
                        counts[usize::from(combination[facet])] += 1;
                    }
                    let ends = counts.iter().min().zip(counts.iter().max());
                    assert!(ends.is_some_and(|(least, most)| most - least <= 1), "{levels:?} {half:?}");
                }
            }
        }
    }

    #[test]
    fn halves_differ_by_key_and_have_every_combination_equally_often() {
        let mut counts = [0_usize; 9];
        for key in 0..900 {
            for [wording, order, _] in random_half([3, 3, 1], &key.to_string()) {
                counts[usize::from(3 * wording + order)] += 1;
            }
        }
        // 500 on average, with a standard deviation of 15.
        assert!(counts.iter().all(|count| count.abs_diff(500) < 60), "{counts:?}");
        assert_eq!(random_half([3, 3, 2], "a"), random_half([3, 3, 2], "a"));
    }
}
