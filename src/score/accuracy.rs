//! The accuracy of each model in each condition: [`Summary`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use serde::Serialize;

use super::chance::{Offer, chance};
use super::choice::Mode;
use super::estimate::Estimate;
use crate::types::{
    EnhancerName, Family, Level, Outcome, QuestionId, Reading, Record, Variant, View, Why,
};

/// The name under which guessing stands among the models.
pub const CHANCE: &str = "chance";

/// What a cell of a table is about.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Subject {
    /// The model, or [`CHANCE`].
    pub model: String,
    /// Whether it saw the images; `None` for chance.
    pub view: Option<View>,
    /// How dark they were; `None` where none was seen.
    pub level: Option<Level>,
    /// The variant.
    pub variant: Variant,
    /// What mended them; `None` for raw.
    pub enhancer: Option<EnhancerName>,
}

/// The accuracy of one subject on one family, in one reading.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// What it is about.
    #[serde(flatten)]
    pub subject: Subject,
    /// The family; `None` for all together.
    pub family: Option<Family>,
    /// How the replies were read.
    pub mode: Mode,
    /// Replies that named the true choice.
    pub right: usize,
    /// Replies in which no choice could be read: they count as wrong.
    pub unparsed: usize,
    /// Trials without a reply: they do not count.
    pub failed: usize,
    /// The share of right ones among the replies; `None` where none came.
    pub accuracy: Option<Estimate>,
    /// The share of questions answered rightly every time, where some were asked more than once: in every order of their
    /// choices (MMBench's circular evaluation, Liu et al. 2023, arXiv:2307.06281, section 4.2) and every repeat.
    pub always: Option<Estimate>,
}

/// All cells of a run, ordered by subject, family and reading.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The cells.
    pub cells: Vec<Cell>,
    /// Why replies were unparsed in the strict reading, and how many.
    pub unread: BTreeMap<Why, usize>,
}

#[derive(Default)]
struct Tally<'a> {
    right: usize,
    unparsed: usize,
    failed: usize,
    replies: usize,
    /// How often each question was answered, and how often rightly.
    questions: HashMap<&'a QuestionId, (usize, usize)>,
}

/// Scores the records of a run; `questions` are what it asks, for the chance line.
#[must_use]
pub fn summarize(records: &[Record], questions: impl IntoIterator<Item = Offer>) -> Summary {
    let questions: Vec<Offer> = questions.into_iter().collect();
    let mut tallies = BTreeMap::<(Subject, Option<Family>, Mode), Tally<'_>>::new();
    for record in records {
        let subject = Subject {
            model: record.model.clone(),
            view: Some(record.view),
            level: record.level,
            variant: record.variant,
            enhancer: record.enhancer.clone(),
        };
        for family in [None, Some(record.family.clone())] {
            for mode in Mode::ALL {
                let reading = match mode {
                    Mode::Strict => record.strict,
                    Mode::Lenient => record.lenient,
                };
                tallies
                    .entry((subject.clone(), family.clone(), mode))
                    .or_default()
                    .count(record, reading);
            }
        }
    }
    let scored = tallies
        .into_iter()
        .map(|((subject, family, mode), tally)| Cell {
            subject,
            family,
            mode,
            right: tally.right,
            unparsed: tally.unparsed,
            failed: tally.failed,
            accuracy: tally.accuracy(),
            always: tally.always(),
        });
    Summary {
        cells: scored.chain(guesses(&questions)).collect(),
        unread: unread(records),
    }
}

fn unread(records: &[Record]) -> BTreeMap<Why, usize> {
    let mut unread = BTreeMap::new();
    for why in records.iter().filter_map(|record| record.strict?.why) {
        *unread.entry(why).or_default() += 1;
    }
    unread
}

impl<'a> Tally<'a> {
    fn count(&mut self, record: &'a Record, reading: Option<Reading>) {
        match reading {
            Some(reading) if record.outcome != Outcome::Failed => {
                let right = usize::from(reading.chosen == Some(record.truth));
                self.replies += 1;
                self.right += right;
                self.unparsed += usize::from(reading.chosen.is_none());
                let (replies, rights) = self.questions.entry(&record.question).or_default();
                (*replies, *rights) = (*replies + 1, *rights + right);
            }
            _ => self.failed += 1,
        }
    }

    fn accuracy(&self) -> Option<Estimate> {
        Estimate::over(self.right, self.replies, self.questions.len())
    }

    fn always(&self) -> Option<Estimate> {
        let mut counts = self.questions.values();
        if counts.clone().all(|(replies, _)| *replies == 1) {
            return None;
        }
        let always = counts.by_ref().filter(|(replies, right)| replies == right);
        Estimate::share(always.count(), self.questions.len())
    }
}

fn guesses(questions: &[Offer]) -> Vec<Cell> {
    let families: BTreeSet<&Family> = questions.iter().map(|question| &question.family).collect();
    let groups = std::iter::once(None).chain(families.into_iter().map(Some));
    let cells = groups.flat_map(|family| {
        let asked = questions
            .iter()
            .filter(|question| family.is_none_or(|family| question.family == *family));
        let accuracy = chance(asked);
        Mode::ALL.map(|mode| Cell {
            subject: Subject {
                model: CHANCE.to_owned(),
                view: None,
                level: None,
                variant: Variant::None,
                enhancer: None,
            },
            family: family.cloned(),
            mode,
            right: 0,
            unparsed: 0,
            failed: 0,
            accuracy,
            always: None,
        })
    });
    cells.collect()
}
