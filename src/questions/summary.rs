//! What a set of questions is like, as the paper's figure of its statistics and more: [`QuestionSummary`].

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::generate::{FamilyCounts, Generated, OmissionReason, QuestionRequest, stated};
use super::reason::Reason;
use super::rule_context::GeneratedQuestion;
use super::rules::RuleBook;
use super::statistics::FrameStatistics;
use crate::types::{Digest, Family};

/// The schema of the summary as JSON.
const SCHEMA: &str = "darkqa.questions/1";

/// What a set of questions is like. Shares are pairs of counts.
#[derive(Debug, Serialize)]
pub(crate) struct QuestionSummary {
    schema: &'static str,
    /// The data set's name for itself.
    pub dataset: String,
    /// The content of the rulebook.
    pub rules: Digest,
    /// The content of the table of colours.
    pub colors: Digest,
    /// The version of the rulebook.
    pub rules_version: String,
    /// How the answers were evened out.
    pub balance: String,
    /// Scenes.
    pub scenes: usize,
    /// Frames that were measured.
    pub frames: usize,
    /// Frames that could not be.
    pub failed: usize,
    /// Frames that are too dark.
    pub dark: usize,
    /// All questions.
    pub questions: usize,
    /// What became of the candidates, by family.
    pub candidates: BTreeMap<Family, CandidateCounts>,
    /// Frames by how many questions are asked of them.
    pub per_frame: BTreeMap<usize, usize>,
    /// Questions by family and answer.
    pub answers: BTreeMap<Family, BTreeMap<String, usize>>,
    /// Questions by their words.
    pub texts: BTreeMap<String, usize>,
    /// Questions by how many choices they have.
    pub choices: BTreeMap<usize, usize>,
    /// Yes and no by what is asked about, of the families that are answered so.
    pub polarity: BTreeMap<Family, BTreeMap<String, [usize; 2]>>,
    /// What of each class there is.
    pub classes: BTreeMap<String, ClassCoverage>,
    /// Frames and questions about rooms by room.
    pub rooms: BTreeMap<String, RoomCoverage>,
    /// Frames whose room is stated and seen, and those of them where both say the same.
    pub room_agreement: [usize; 2],
    /// Gaps between the two nearest objects, by 250 mm.
    pub gaps: BTreeMap<u64, usize>,
    /// Questions that say the same as another of their scene: the same words, the same answer.
    pub repeats: usize,
    /// Numbers of maps that the label space has not, by pixels.
    pub unknown: BTreeMap<u16, u64>,
    /// What answering without looking would score, by family and, under "all", over all.
    pub baselines: BTreeMap<String, Baselines>,
}

/// What became of the candidates of a family.
#[derive(Debug, Default, Serialize)]
pub(crate) struct CandidateCounts {
    /// Those that hold.
    pub viable: u64,
    /// Those that are asked.
    pub asked: u64,
    /// Those that hold and were not the one of their frame.
    pub not_chosen: u64,
    /// Those that a person has rejected.
    pub rejected: u64,
    /// Those whose answer would be too frequent.
    pub unbalanced: u64,
    /// Those that do not hold, by reason.
    pub fallen: BTreeMap<Reason, u64>,
}

/// What of a class there is.
#[derive(Debug, Default, Serialize)]
pub(crate) struct ClassCoverage {
    /// Pixels.
    pub pixels: u64,
    /// Segments that are not tiny.
    pub segments: u64,
    /// Frames that show it.
    pub frames: u64,
    /// Questions that are about it.
    pub questions: u64,
}

/// What of a room there is.
#[derive(Debug, Default, Serialize)]
pub(crate) struct RoomCoverage {
    /// Frames that show it.
    pub frames: usize,
    /// Questions whose answer it is.
    pub questions: usize,
}

/// What answering without looking would score: right answers, or their expectation, out of the questions.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Baselines {
    /// Questions.
    pub questions: usize,
    /// The expected right answers of a uniform guess.
    pub chance: f64,
    /// Those of the commonest answer of the family.
    pub majority: usize,
    /// Those of the commonest answer to the same words in other scenes, else of the family there, else a guess: what a model
    /// can know that has seen such questions and not the image.
    pub prior: f64,
}

impl QuestionSummary {
    /// What came of the frames; `failed` of them could not be measured.
    #[must_use]
    pub(crate) fn new(
        frames: &[FrameStatistics],
        made: &Generated,
        order: &QuestionRequest<'_>,
        failed: usize,
    ) -> Self {
        let asked = &made.asked;
        let mut summary = Self {
            schema: SCHEMA,
            dataset: order.dataset.to_owned(),
            rules: order.rules.digest(),
            colors: order.palette.digest(),
            rules_version: order.rules.book().version.clone(),
            balance: order.balance.to_string(),
            scenes: frames
                .iter()
                .map(|frame| &frame.scene)
                .collect::<BTreeSet<_>>()
                .len(),
            frames: frames.len(),
            failed,
            dark: made.dark.len(),
            questions: asked.len(),
            candidates: made
                .tallies
                .iter()
                .map(|(family, tally)| (family.clone(), CandidateCounts::of(tally)))
                .collect(),
            per_frame: BTreeMap::new(),
            answers: BTreeMap::new(),
            texts: count(asked, |asked| asked.question.text.clone()),
            choices: count(asked, |asked| asked.question.choices.len()),
            polarity: BTreeMap::new(),
            classes: coverage(frames, asked),
            rooms: rooms(made),
            room_agreement: room_agreement(frames, made, order.rules.book()),
            gaps: BTreeMap::new(),
            repeats: 0,
            unknown: BTreeMap::new(),
            baselines: baselines(asked),
        };
        let per_frame = count(asked, |asked| asked.question.frame.clone());
        for frame in frames {
            let questions = per_frame.get(&frame.frame).copied().unwrap_or(0);
            *summary.per_frame.entry(questions).or_insert(0) += 1;
            for (id, pixels) in &frame.unknown {
                *summary.unknown.entry(*id).or_insert(0) += pixels;
            }
        }
        for asked in asked {
            summary.take(asked);
        }
        let same = count(asked, GeneratedQuestion::said);
        summary.repeats = same.values().map(|count| count - 1).sum();
        summary
    }

    fn take(&mut self, asked: &GeneratedQuestion) {
        let question = &asked.question;
        let answers = self.answers.entry(question.family.clone()).or_default();
        *answers.entry(asked.answer().to_owned()).or_insert(0) += 1;
        if matches!(question.family, Family::Affordance | Family::Presence) {
            let subjects = self.polarity.entry(question.family.clone()).or_default();
            subjects.entry(asked.about.clone()).or_default()[question.choices.truth()] += 1;
        }
        if let Some(gap) = question
            .evidence
            .get("gap_mm")
            .and_then(serde_json::Value::as_u64)
        {
            *self.gaps.entry(gap / 250 * 250).or_insert(0) += 1;
        }
        if question.family == Family::RoomType {
            self.rooms
                .entry(asked.answer().to_owned())
                .or_default()
                .questions += 1;
        }
    }
}

impl CandidateCounts {
    fn of(tally: &FamilyCounts) -> Self {
        let left = |why| tally.left.get(&why).copied().unwrap_or(0);
        Self {
            viable: tally.viable,
            asked: tally.asked,
            not_chosen: left(OmissionReason::NotChosen),
            rejected: left(OmissionReason::Rejected),
            unbalanced: left(OmissionReason::Unbalanced),
            fallen: tally.fallen.clone(),
        }
    }
}

fn count<'a, K: Ord>(
    asked: impl IntoIterator<Item = &'a GeneratedQuestion>,
    key: impl Fn(&'a GeneratedQuestion) -> K,
) -> BTreeMap<K, usize> {
    let mut counts = BTreeMap::new();
    for asked in asked {
        *counts.entry(key(asked)).or_insert(0) += 1;
    }
    counts
}

/// The right answers to expect of guesses, by how many choices there are.
fn chance(sizes: &BTreeMap<usize, usize>) -> f64 {
    let right = sizes
        .iter()
        .map(|(size, count)| *count as f64 / *size as f64);
    right.sum()
}

fn coverage(
    frames: &[FrameStatistics],
    asked: &[GeneratedQuestion],
) -> BTreeMap<String, ClassCoverage> {
    let mut classes: BTreeMap<String, ClassCoverage> = BTreeMap::new();
    for frame in frames {
        for (class, pixels) in &frame.classes {
            let coverage = classes.entry(class.clone()).or_default();
            coverage.pixels += pixels;
            coverage.frames += 1;
        }
        for segment in &frame.segments {
            classes.entry(segment.class.clone()).or_default().segments += 1;
        }
    }
    for asked in asked {
        let of_class = matches!(
            asked.question.family,
            Family::Presence | Family::Color | Family::Closest
        );
        if of_class {
            classes.entry(asked.about.clone()).or_default().questions += 1;
        }
    }
    classes
}

/// Frames whose room is stated and seen, and those of them where both say the same.
fn room_agreement(frames: &[FrameStatistics], made: &Generated, book: &RuleBook) -> [usize; 2] {
    let signs: BTreeMap<_, _> = made
        .rooms
        .iter()
        .map(|(name, signs)| (name, signs))
        .collect();
    let mut agreement = [0, 0];
    for frame in frames {
        let signs = signs.get(&frame.frame);
        let seen = signs.and_then(|signs| signs.room.as_ref().ok());
        if let (Some(seen), Some(stated)) = (seen, stated(frame, book)) {
            agreement[0] += 1;
            agreement[1] += usize::from(*seen == stated);
        }
    }
    agreement
}

fn rooms(made: &Generated) -> BTreeMap<String, RoomCoverage> {
    let mut rooms: BTreeMap<String, RoomCoverage> = BTreeMap::new();
    for room in made
        .rooms
        .iter()
        .filter_map(|(_, signs)| signs.room.as_ref().ok())
    {
        rooms.entry(room.clone()).or_default().frames += 1;
    }
    rooms
}

fn baselines(asked: &[GeneratedQuestion]) -> BTreeMap<String, Baselines> {
    let mut families: BTreeMap<&Family, Vec<&GeneratedQuestion>> = BTreeMap::new();
    for asked in asked {
        families
            .entry(&asked.question.family)
            .or_default()
            .push(asked);
    }
    let mut all: BTreeMap<String, Baselines> = BTreeMap::new();
    let mut total = Baselines::default();
    for (family, list) in families {
        let answers = count(list.iter().copied(), GeneratedQuestion::answer);
        let sizes = count(list.iter().copied(), |asked| asked.question.choices.len());
        let baselines = Baselines {
            questions: list.len(),
            chance: chance(&sizes),
            majority: answers.values().copied().max().unwrap_or(0),
            prior: prior(&list),
        };
        total.questions += baselines.questions;
        total.chance += baselines.chance;
        total.majority += baselines.majority;
        total.prior += baselines.prior;
        all.insert(family.name().to_owned(), baselines);
    }
    all.insert(Family::TOTAL.to_owned(), total);
    all
}

/// How many questions the commonest answer in other scenes gets right: to the same words, else of the family, else a guess.
fn prior(list: &[&GeneratedQuestion]) -> f64 {
    // By words, then by answer: how many in each scene. No words are those of all.
    let mut seen: BTreeMap<&str, BTreeMap<&str, BTreeMap<&str, usize>>> = BTreeMap::new();
    for asked in list {
        for words in ["", &asked.question.text] {
            let scenes = seen
                .entry(words)
                .or_default()
                .entry(asked.answer())
                .or_default();
            *scenes.entry(&asked.scene).or_insert(0) += 1;
        }
    }
    let commonest = |words: &str, but: &str| {
        let counts = seen.get(words).into_iter().flatten();
        let counts = counts.map(|(answer, scenes)| {
            let others = scenes.iter().filter(|(scene, _)| **scene != but);
            (*answer, others.map(|(_, count)| count).sum::<usize>())
        });
        let best = counts.filter(|(_, count)| *count > 0);
        best.min_by_key(|&(answer, count)| (std::cmp::Reverse(count), answer))
            .map(|(answer, _)| answer)
    };
    let (mut right, mut guesses) = (0_usize, BTreeMap::<usize, usize>::new());
    for asked in list {
        match commonest(&asked.question.text, &asked.scene).or_else(|| commonest("", &asked.scene))
        {
            Some(answer) => right += usize::from(answer == asked.answer()),
            None => *guesses.entry(asked.question.choices.len()).or_insert(0) += 1,
        }
    }
    right as f64 + chance(&guesses)
}
