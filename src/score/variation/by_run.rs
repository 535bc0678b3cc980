//! Variation of the results of a run that asked in several wordings, orders or draws: [`RunVariation`].

use std::collections::BTreeSet;

use super::{
    Components, Design, Facet, FacetRange, FacetedDifference, Observation, PositionPreference, facet_ranges,
    rank_agreement,
};
use crate::choice::ParsingMode;
use crate::comparisons::{Comparison, ComparisonKind, pool};
use crate::estimate::Estimate;
use crate::grid::Grid;
use crate::model_in_condition::{ModelInCondition, is_reference};
use darkqa_base::types::text::counted;

/// How far wordings of the prompt, orders of the choices and draws of the noise move the results of a run, in the strict
/// parsing.
#[derive(Debug, Clone, PartialEq)]
pub struct RunVariation {
    /// Names of the wordings, sorted; empty if there is one.
    pub wordings: Vec<String>,
    /// Number of orders of the choices; 1 if each question has one.
    pub orders: usize,
    /// Number of draws of the noise.
    pub draws: usize,
    /// Accuracy of each subject.
    pub accuracies: Vec<AccuracyVariation>,
    /// Differences over all families, in the order of the comparisons.
    pub differences: Vec<DifferenceVariation>,
    /// Agreement of the wordings on the order of the models at the darkest level of the main variant (Kendall's W);
    /// `None` with one wording or one model.
    pub ranks: Option<Estimate>,
    /// Preference of each subject for a position of the choices; empty if each question has one order.
    pub positions: Vec<PositionPreference>,
    /// Designs of a further run that detect a change of 5 points from L0 at the darkest level of the main
    /// variant, for each model; those with the fewest requests first.
    pub plans: Vec<Plan>,
}

/// Largest number of wordings, orders and draws together (chosen): memory grows with its square, times the scenes.
const MOST_LEVELS: usize = 100;

/// Change that a planned run shall detect: 5 points (chosen).
const PLANNED_CHANGE: f64 = 0.05;

/// Design of a further run for one model, with what it needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The model at the dark level.
    pub subject: ModelInCondition,
    /// Numbers of wordings, orders and draws, and whether half of their combinations are asked.
    pub design: Design,
    /// What detects the change in these wordings, orders and draws; `None` if no number of scenes suffices.
    pub asked: Option<Needed>,
    /// What detects it whatever the wordings, orders and draws are.
    pub others: Option<Needed>,
}

/// Size of a run about one level and L0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needed {
    pub scenes: usize,
    pub questions: usize,
    pub requests: usize,
}

/// Variation of the accuracy of one subject.
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyVariation {
    pub subject: ModelInCondition,
    pub components: Components,
    /// How far apart the levels of each facet are.
    pub ranges: Vec<FacetRange>,
}

/// Variation of one difference.
#[derive(Debug, Clone, PartialEq)]
pub struct DifferenceVariation {
    pub kind: ComparisonKind,
    pub first: ModelInCondition,
    pub second: ModelInCondition,
    pub found: FacetedDifference,
    /// The difference in each wording in which both sides have replies.
    by_wording: Vec<f64>,
}

impl DifferenceVariation {
    /// The smallest and the largest difference over the wordings; `None` with one wording.
    #[must_use]
    pub fn by_wording(&self) -> Option<[f64; 2]> {
        let ends = self.by_wording.iter().copied();
        Some([ends.clone().reduce(f64::min)?, ends.reduce(f64::max)?])
    }
}

impl RunVariation {
    /// Number of levels of a facet.
    #[must_use]
    pub fn levels(&self, facet: Facet) -> usize {
        match facet {
            Facet::Wording => self.wordings.len().max(1),
            Facet::Order => self.orders,
            Facet::Draw => self.draws,
        }
    }

    /// Wordings, orders and draws in words: `3 wordings, 2 orders, 1 draw`.
    #[must_use]
    pub fn asked(&self) -> String {
        let of = |facet, one| counted(self.levels(facet), one);
        [of(Facet::Wording, "wording"), of(Facet::Order, "order"), of(Facet::Draw, "draw")].join(", ")
    }

    /// Computes the variation; `None` if every question was asked in one wording, one order and one draw, or in more than
    /// [`MOST_LEVELS`] of them.
    #[must_use]
    pub fn new(grid: &Grid<'_>, comparisons: &[Comparison]) -> Option<Self> {
        let wordings: BTreeSet<&str> = grid.items.iter().filter_map(|item| item.asked.key().wording).collect();
        let orders = grid.items.iter().map(|item| item.asked.order as usize + 1).max().unwrap_or(1);
        let draws = grid.items.iter().map(|item| usize::from(item.draw) + 1).max().unwrap_or(1);
        if (wordings.len() < 2 && orders < 2 && draws < 2) || wordings.len() + orders + draws > MOST_LEVELS {
            return None;
        }
        let places = places(grid, &wordings);
        let observations: Vec<Vec<Observation>> =
            (0..grid.subjects.len()).map(|subject| observations(grid, &places, subject)).collect();
        let accuracies = grid.subjects.iter().zip(&observations).filter(|(_, replies)| !replies.is_empty());
        let accuracies = accuracies.map(|(subject, replies)| AccuracyVariation {
            subject: subject.clone(),
            components: Components::new(replies),
            ranges: facet_ranges(replies),
        });
        let differences: Vec<DifferenceVariation> = comparisons
            .iter()
            .filter(|comparison| comparison.family.is_none())
            .filter_map(|comparison| {
                let [first, second] = [&comparison.first, &comparison.second].map(|side| grid.find(side));
                let pairs = pairs(grid, &places, [first?, second?]);
                Some(DifferenceVariation {
                    kind: comparison.kind,
                    first: comparison.first.clone(),
                    second: comparison.second.clone(),
                    found: FacetedDifference::new(&pairs)?,
                    by_wording: if wordings.len() > 1 { means(&pairs, wordings.len()) } else { Vec::new() },
                })
            })
            .collect();
        let mut found = Self {
            orders,
            draws,
            accuracies: accuracies.collect(),
            differences,
            ranks: ranks(grid, &observations),
            positions: if orders > 1 { PositionPreference::all(grid) } else { Vec::new() },
            wordings: wordings.into_iter().map(str::to_owned).collect(),
            plans: Vec::new(),
        };
        found.plans = found.plans(grid, &places);
        Some(found)
    }

    /// Changes from L0 at the darkest level of the main variant, with raw images, of the models that findings are about.
    #[must_use]
    pub fn darkest_changes(&self, grid: &Grid<'_>) -> Vec<&DifferenceVariation> {
        let Some(main) = grid.main_variant() else {
            return Vec::new();
        };
        let models = pool(grid);
        let changes = self.differences.iter().filter(|row| {
            row.kind == ComparisonKind::Level && row.first.variant == main && models.contains(&&*row.first.model)
        });
        let darkest = changes.clone().map(|row| row.first.level).max();
        changes.filter(|row| Some(row.first.level) == darkest).collect()
    }

    fn plans(&self, grid: &Grid<'_>, places: &[Observation]) -> Vec<Plan> {
        let questions = places.last().map_or(0, |last| last.question as usize + 1);
        let scenes: BTreeSet<u32> = grid.items.iter().map(|item| item.cluster).collect();
        let here = Design {
            scenes: scenes.len(),
            questions,
            wordings: self.levels(Facet::Wording),
            orders: self.orders,
            draws: self.draws,
            repeats: 1,
            is_half: false,
        };
        let mut plans = Vec::new();
        for change in self.darkest_changes(grid) {
            let [Some(first), Some(second)] = [&change.first, &change.second].map(|side| grid.find(side)) else {
                continue;
            };
            let components = Components::new(&pairs(grid, places, [first, second]));
            let plan = |design| Plan::new(&change.first, design, &components);
            let mut own: Vec<Plan> = candidates(&here).into_iter().map(plan).collect();
            own.sort_by_key(|plan| plan.asked.map_or(usize::MAX, |needed| needed.requests));
            plans.extend(own);
        }
        plans
    }
}

/// Designs to choose from: one level of each facet, all levels of one of them, all of all, and half of those; and four
/// times the wordings.
fn candidates(whole: &Design) -> Vec<Design> {
    let one = Design { wordings: 1, orders: 1, draws: 1, ..*whole };
    let mut designs = vec![
        one,
        Design { wordings: whole.wordings, ..one },
        Design { orders: whole.orders, ..one },
        Design { draws: whole.draws, ..one },
        *whole,
        Design { is_half: true, ..*whole },
    ];
    if whole.wordings > 1 {
        designs.push(Design { wordings: 4 * whole.wordings, ..one });
    }
    let mut seen = Vec::new();
    designs.retain(|design| {
        let is_new = !seen.contains(design);
        seen.push(*design);
        is_new
    });
    designs
}

impl Plan {
    /// `components` are those of the change of `subject` from L0.
    fn new(subject: &ModelInCondition, design: Design, components: &Components) -> Self {
        let needed = |components: &Components| {
            let found = components.smallest(&design, PLANNED_CHANGE)?;
            // L0 has one draw. With half of several draws, each wording and order is asked in some draw, and at L0.
            let light = Design { draws: 1, is_half: found.is_half && found.draws < 2, ..found };
            let requests = found.requests() + light.requests();
            Some(Needed { scenes: found.scenes, questions: found.questions, requests })
        };
        Self {
            subject: subject.clone(),
            design,
            asked: needed(&components.of_asked_levels()),
            others: needed(components),
        }
    }
}

/// The place of each item in the design, with a value of 0.
fn places(grid: &Grid<'_>, wordings: &BTreeSet<&str>) -> Vec<Observation> {
    let mut question = 0;
    let mut places = Vec::with_capacity(grid.items.len());
    for (index, item) in grid.items.iter().enumerate() {
        // Items are sorted by frame and question.
        if index > 0 && grid.items[index - 1].asked.question != item.asked.question {
            question += 1;
        }
        let wording = item.asked.key().wording.and_then(|name| wordings.iter().position(|other| *other == name));
        places.push(Observation {
            question,
            scene: item.cluster,
            wording: wording.unwrap_or(0) as u16,
            order: item.asked.order as u16,
            draw: item.draw,
            repeat: item.asked.repeat as u16,
            value: 0.0,
        });
    }
    places
}

/// The replies of a subject.
fn observations(grid: &Grid<'_>, places: &[Observation], subject: usize) -> Vec<Observation> {
    let replies = places.iter().enumerate().filter_map(|(index, place)| {
        let chosen = grid.result(subject, index).parsed(ParsingMode::Strict)?;
        Some(Observation { value: f64::from(u8::from(grid.items[index].is_right(chosen))), ..*place })
    });
    replies.collect()
}

/// The differences of two subjects on the items to which both replied.
fn pairs(grid: &Grid<'_>, places: &[Observation], subjects: [usize; 2]) -> Vec<Observation> {
    let pairs = places.iter().enumerate().filter_map(|(index, place)| {
        let [first, second] = grid.results(subjects, index).map(|result| {
            let chosen = result.parsed(ParsingMode::Strict)?;
            Some(f64::from(u8::from(grid.items[index].is_right(chosen))))
        });
        Some(Observation { value: first? - second?, ..*place })
    });
    pairs.collect()
}

/// Mean difference in each wording with pairs.
fn means(pairs: &[Observation], wordings: usize) -> Vec<f64> {
    (0..wordings)
        .filter_map(|wording| {
            let own = pairs.iter().filter(|pair| usize::from(pair.wording) == wording).map(|pair| pair.value);
            let count = own.clone().count();
            (count > 0).then(|| own.sum::<f64>() / count as f64)
        })
        .collect()
}

/// Kendall's W of the models over the wordings, with raw images at the darkest level of the main variant.
fn ranks(grid: &Grid<'_>, observations: &[Vec<Observation>]) -> Option<Estimate> {
    let main = grid.main_variant()?;
    let is_dark = |subject: &ModelInCondition| {
        subject.variant == main && subject.enhancer.is_none() && !is_reference(&subject.model)
    };
    let darkest = grid.subjects.iter().filter(|subject| is_dark(subject)).filter_map(|subject| subject.level).max();
    let models: Vec<&[Observation]> = grid
        .subjects
        .iter()
        .zip(observations)
        .filter(|(subject, replies)| is_dark(subject) && subject.level == darkest && !replies.is_empty())
        .map(|(_, replies)| &**replies)
        .collect();
    if models.len() < 2 { None } else { rank_agreement(&models, Facet::Wording) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparisons::comparisons;
    use crate::tests::{Answers, records, with_grid};
    use crate::variation::Source;
    use darkqa_base::types::{Digest, Record};

    /// The records of a model in a condition and a wording.
    fn worded(model: &str, condition: &str, wording: &str, answers: Answers) -> Vec<Record> {
        let mut records = records(model, condition, answers);
        for record in &mut records {
            record.detail.wording = Some(wording.to_owned());
            record.key = Digest::from_bytes(format!("{wording} {}", record.key).as_bytes()).into();
        }
        records
    }

    fn variation(records: &[Vec<Record>]) -> Option<RunVariation> {
        with_grid(&records.concat(), |grid| RunVariation::new(grid, &comparisons(grid)))
    }

    #[test]
    fn one_wording_has_no_variation() {
        let one = [records("m", "L0", |_| Some(true)), records("m", "L5-ev", |item| Some(item % 2 == 0))];
        assert_eq!(variation(&one), None);
    }

    #[test]
    fn wordings_that_change_a_loss_are_told_from_those_that_do_not() {
        let right: Answers = |_| Some(true);
        let half: Answers = |item| Some(item % 2 == 0);
        let of = |dark: [Answers; 2]| {
            let run = variation(&[
                worded("m", "L0", "a", right),
                worded("m", "L0", "b", right),
                worded("m", "L5-ev", "a", dark[0]),
                worded("m", "L5-ev", "b", dark[1]),
            ]);
            run.unwrap()
        };
        let found = of([half, right]);
        assert_eq!((&*found.asked(), found.ranks), ("2 wordings, 1 order, 1 draw", None));
        let loss = &found.differences[0];
        assert_eq!((loss.found.difference.value, loss.by_wording()), (-0.25, Some([-0.5, 0.0])));
        assert_eq!((loss.found.signs.same, loss.found.signs.of), (1, 2));
        let wording = |found: &RunVariation, subject: usize| {
            found.accuracies[subject].components.deviation(Source::Facet(Facet::Wording)).unwrap().value
        };
        assert!(wording(&found, 0).abs() < 1e-12 && wording(&found, 1) > 0.2);
        // Without an effect of the wording, the loss has the same sign in both, and the wording adds nothing.
        let control = of([half, half]);
        let loss = &control.differences[0];
        assert_eq!((loss.found.signs.same, loss.by_wording()), (2, Some([-0.5, -0.5])));
        assert!(wording(&control, 1).abs() < 1e-12);
    }

    #[test]
    fn a_reply_in_the_light_is_compared_with_each_draw_and_counts_once() {
        let run = [
            records("m", "L0", |_| Some(true)),
            records("m", "L5-noise", |item| Some(item % 2 == 0)),
            records("m", "L5-noise~1", |_| Some(true)),
        ];
        with_grid(&run.concat(), |grid| {
            let found = RunVariation::new(grid, &comparisons(grid)).unwrap();
            assert_eq!(&*found.asked(), "1 wording, 1 order, 2 draws");
            let loss = &found.differences[0];
            let [light, dark] = [&loss.second, &loss.first].map(|side| grid.find(side).unwrap());
            let counted =
                |subject| grid.counts(subject, None, ParsingMode::Strict).iter().map(|one| one.replies).sum::<u32>();
            assert_eq!(counted(dark), 2 * counted(light));
            assert_eq!(loss.found.difference.n as u32, counted(dark));
            assert_eq!((loss.found.difference.value, loss.found.signs.same, loss.found.signs.of), (-0.25, 1, 2));
            assert!(found.accuracies[dark].components.deviation(Source::Facet(Facet::Draw)).unwrap().value > 0.2);
            assert_eq!(found.accuracies[light].components.deviation(Source::Facet(Facet::Draw)), None);
        });
    }

    #[test]
    fn models_in_the_same_order_under_each_wording_agree() {
        let run = variation(&[
            worded("a", "L5-ev", "x", |item| Some(item % 2 == 0)),
            worded("a", "L5-ev", "y", |item| Some(item % 3 == 0)),
            worded("b", "L5-ev", "x", |item| Some(item % 3 > 0)),
            worded("b", "L5-ev", "y", |item| Some(item % 2 == 0)),
        ]);
        assert!(run.unwrap().ranks.is_some_and(|ranks| (ranks.value - 1.0).abs() < 1e-12));
    }
}
