//! The trials of runs as reports need them: [`Trials`], and one of them ([`TrialRef`]).
//!
//! What many trials have in common is held once, and the texts of replies stay in the file of the run. So a trial with choices takes
//! 80 bytes, and sixteen million of them less than 2 GB with all that a report makes of them.

mod asked_item;
mod asked_model;
mod choice_facts;
mod sent_images;
mod text_place;
mod trial_facts;
mod trial_ref;
mod values;

pub use asked_item::{AskedItem, AskedParts};
pub use choice_facts::{ChoiceFacts, ChoiceTables};
pub use sent_images::SentImages;
pub use text_place::TextPlace;
pub use trial_ref::TrialRef;

use std::collections::BTreeMap;

use asked_model::{AskedModel, Server};
use rayon::slice::ParallelSliceMut;
use trial_facts::{TrialFacts, reply_digest};
use values::Values;

use crate::error::Error;

use super::record::{Detail, FailureKind, Record};
use super::{ChoiceDetail, Condition, Distinct, Family, FrameId, QuestionId};

/// Trials with what they refer to.
#[derive(Debug, Clone)]
pub struct Trials<D: Detail> {
    facts: Vec<TrialFacts<D::Facts>>,
    items: Values<AskedItem>,
    asked: Values<AskedModel>,
    servers: Values<Server>,
    failures: Values<(FailureKind, Option<u16>)>,
    tables: D::Tables,
    /// Number of files of runs that the places of texts refer to.
    logs: usize,
    texts: Texts,
}

/// Which of two trials of one key is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeptTrial {
    /// The one whose text stands first.
    First,
    /// The other.
    Later,
}

/// The texts that items share.
#[derive(Debug, Clone, Default)]
struct Texts {
    questions: Distinct<QuestionId>,
    frames: Distinct<FrameId>,
    families: Distinct<Family>,
    choices: Distinct<Vec<String>>,
}

impl<D: Detail> Default for Trials<D> {
    fn default() -> Self {
        Self {
            facts: Vec::new(),
            items: Values::default(),
            asked: Values::default(),
            servers: Values::default(),
            failures: Values::default(),
            tables: D::Tables::default(),
            logs: 1,
            texts: Texts::default(),
        }
    }
}

impl<D: Detail> Trials<D> {
    /// Adds the trial of a record whose line is at this place.
    pub fn add(&mut self, record: Record<D>, text: TextPlace) {
        let facts = D::keep(&record, &mut self.tables);
        let reply = reply_digest(record.reply.as_deref(), record.refusal.as_deref());
        let failure = record.failure.map(|failure| (failure.kind, failure.status));
        let failure = failure.map(|failure| self.failures.number(failure) as u16);
        let item = self.item_of(&record.question, &record.detail.asked());
        let asked = self.asked.number(AskedModel {
            model: record.model,
            view: record.view,
            condition: record.condition,
        });
        let server = self.servers.number(Server {
            model: record.served_model,
            provider: record.provider,
            via: record.via,
        });
        self.logs = self.logs.max(text.log() + 1);
        self.facts.push(TrialFacts {
            key: record.key,
            text,
            reply,
            item,
            asked,
            server,
            tokens: record.usage.into(),
            latency: record.latency_ms.into(),
            attempts: record.attempts.min(u32::from(u16::MAX)) as u16,
            failure: failure.unwrap_or(u16::MAX),
            facts,
        });
    }

    /// Number of trials.
    #[must_use]
    pub fn len(&self) -> usize {
        self.facts.len()
    }

    /// Whether there is no trial.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.facts.is_empty()
    }

    /// Number of files of runs that the places of texts refer to.
    #[must_use]
    pub fn logs(&self) -> usize {
        self.logs
    }

    /// A trial by its place.
    #[must_use]
    pub fn get(&self, place: usize) -> Option<TrialRef<'_, D>> {
        (place < self.facts.len()).then(|| TrialRef::new(self, place))
    }

    /// The trial at a place.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn at(&self, place: usize) -> TrialRef<'_, D> {
        assert!(place < self.facts.len(), "a place of {} trials", self.len());
        TrialRef::new(self, place)
    }

    /// All trials in order.
    pub fn iter(
        &self,
    ) -> impl DoubleEndedIterator<Item = TrialRef<'_, D>> + ExactSizeIterator + Clone {
        (0..self.facts.len()).map(|place| TrialRef::new(self, place))
    }

    /// The first trial.
    #[must_use]
    pub fn first(&self) -> Option<TrialRef<'_, D>> {
        self.get(0)
    }

    /// An item by its number.
    pub(crate) fn item(&self, number: usize) -> &AskedItem {
        self.items.get(number as u32)
    }

    /// Number of items, with those that no trial is about any more.
    pub(crate) fn item_count(&self) -> usize {
        self.items.len()
    }

    /// The items that trials are about, by number; `None` for one that no trial is about any more.
    #[must_use]
    pub fn items(&self) -> Vec<Option<&AskedItem>> {
        let mut is_met = vec![false; self.items.len()];
        for facts in &self.facts {
            is_met[facts.item as usize] = true;
        }
        let items = self.items.all().iter().zip(is_met);
        items.map(|(item, is_met)| is_met.then_some(item)).collect()
    }

    /// The questions that were asked, with their frames; a question may be met several times.
    pub fn questions(&self) -> impl Iterator<Item = (&QuestionId, &FrameId)> {
        let items = self.items().into_iter().flatten();
        items.map(|item| (&*item.question, &*item.frame))
    }

    /// The models and conditions that were asked, by number, with `None` as [`items`](Self::items).
    #[must_use]
    pub fn asked(&self) -> Vec<Option<(&str, Option<&Condition>)>> {
        let mut is_met = vec![false; self.asked.len()];
        for facts in &self.facts {
            is_met[facts.asked as usize] = true;
        }
        let asked = self.asked.all().iter().zip(is_met);
        asked
            .map(|(asked, is_met)| is_met.then_some((&*asked.model, asked.condition.as_ref())))
            .collect()
    }

    /// Gives models other names, where `new` has one.
    pub fn rename(&mut self, new: impl Fn(&str) -> Option<String>) {
        for asked in self.asked.all_mut() {
            if let Some(name) = new(&asked.model) {
                asked.model = name;
            }
        }
    }

    /// Changes the conditions of the images.
    pub fn change_conditions(&mut self, change: impl Fn(&mut Condition)) {
        for asked in self.asked.all_mut() {
            if let Some(condition) = &mut asked.condition {
                change(condition);
            }
        }
    }

    /// Keeps some of the trials.
    pub fn retain(&mut self, is_kept: impl FnMut(TrialRef<'_, D>) -> bool) {
        let kept: Vec<bool> = self.iter().map(is_kept).collect();
        let mut kept = kept.into_iter();
        self.facts.retain(|_| kept.next() == Some(true));
    }

    /// Takes some of the trials out.
    #[must_use]
    pub fn extract(&mut self, is_taken: impl Fn(TrialRef<'_, D>) -> bool) -> Self {
        let mut taken = Self {
            logs: self.logs,
            ..Self::default()
        };
        for trial in self.iter().filter(|trial| is_taken(*trial)) {
            taken.copy(trial, 0);
        }
        if !taken.is_empty() {
            self.retain(|trial| !is_taken(trial));
        }
        taken
    }

    /// Adds a copy of a trial of other runs; `logs` files stand before those of its run.
    pub fn copy(&mut self, trial: TrialRef<'_, D>, logs: usize) {
        let other = trial.trials();
        let facts = trial.facts();
        let item = self.shared(other.items.get(facts.item).clone());
        let new = TrialFacts {
            text: facts.text.after(logs),
            item: self.items.number(item),
            asked: self.asked.number(other.asked.get(facts.asked).clone()),
            server: self.servers.number(other.servers.get(facts.server).clone()),
            failure: match trial.failure() {
                None => u16::MAX,
                Some(failure) => self.failures.number(failure) as u16,
            },
            facts: D::move_facts(&facts.facts, &other.tables, &mut self.tables),
            ..facts.clone()
        };
        self.facts.push(new);
        self.logs = self.logs.max(other.logs + logs);
    }

    /// The number of an item.
    fn item_of(&mut self, question: &QuestionId, parts: &AskedParts<'_>) -> u32 {
        let key = (question, parts);
        let known = |item: &AskedItem| {
            let (known, known_parts) = item.parts();
            (known, &known_parts) == key
        };
        self.items.find(&key, known).unwrap_or_else(|| {
            let item = self.shared(AskedItem::of(question, parts));
            self.items.push(item)
        })
    }

    /// The item with the texts that others have.
    fn shared(&mut self, mut item: AskedItem) -> AskedItem {
        self.texts.questions.share(&mut item.question);
        self.texts.frames.share(&mut item.frame);
        self.texts.families.share(&mut item.family);
        self.texts.choices.share(&mut item.choices);
        item
    }

    /// Keeps one trial of each key. `choose` is asked about each two in the order of the places of their texts.
    ///
    /// # Errors
    /// What `choose` returns.
    pub fn each_key_once(
        &mut self,
        mut choose: impl FnMut(TrialRef<'_, D>, TrialRef<'_, D>) -> Result<KeptTrial, Error>,
    ) -> Result<(), Error> {
        self.facts
            .par_sort_unstable_by_key(|facts| (facts.key, facts.text));
        let mut is_kept = vec![true; self.facts.len()];
        let mut first = 0;
        for later in 1..self.facts.len() {
            if self.facts[first].key == self.facts[later].key {
                match choose(self.at(first), self.at(later))? {
                    KeptTrial::First => {
                        is_kept[later] = false;
                        continue;
                    }
                    KeptTrial::Later => is_kept[first] = false,
                }
            }
            first = later;
        }
        let mut is_kept = is_kept.into_iter();
        self.facts.retain(|_| is_kept.next() == Some(true));
        Ok(())
    }

    /// Puts the trials in an order: by the places of their questions, their
    /// conditions, the places of their models, and repeats. Questions and models without a place stand first.
    pub fn sort(
        &mut self,
        question: impl Fn(&QuestionId) -> Option<usize>,
        model: impl Fn(&str) -> (usize, usize),
    ) {
        let (items, asked) = (self.items.all(), self.asked.all());
        let questions: Vec<(Option<usize>, u32)> = items
            .iter()
            .map(|item| (question(&item.question), item.repeat))
            .collect();
        let places: Vec<_> = asked
            .iter()
            .map(|asked| (asked.condition.as_ref(), model(&asked.model), &*asked.model))
            .collect();
        let mut distinct = places.clone();
        distinct.sort_unstable();
        distinct.dedup();
        let ranks: BTreeMap<_, u32> = distinct.into_iter().zip(0..).collect();
        let places: Vec<u32> = places.iter().map(|place| ranks[place]).collect();
        self.facts.par_sort_unstable_by_key(|facts| {
            let (question, repeat) = questions[facts.item as usize];
            (question, places[facts.asked as usize], repeat, facts.key)
        });
    }
}

impl Trials<ChoiceDetail> {
    /// Adds a trial with a choice in the place of the truth, without its images.
    pub(crate) fn hold(
        &mut self,
        trial: TrialRef<'_, ChoiceDetail>,
        repeat: u32,
        reference: usize,
    ) {
        let other = trial.trials();
        let facts = trial.facts();
        let item = self.shared(AskedItem {
            truth: Some(reference),
            repeat,
            ..other.items.get(facts.item).clone()
        });
        let new = TrialFacts {
            item: self.items.number(item),
            asked: self.asked.number(other.asked.get(facts.asked).clone()),
            server: self.servers.number(Server {
                model: None,
                provider: None,
                via: super::record::Via::Direct,
            }),
            failure: match trial.failure() {
                None => u16::MAX,
                Some(failure) => self.failures.number(failure) as u16,
            },
            facts: facts.facts.held_against(reference),
            ..facts.clone()
        };
        self.facts.push(new);
    }
}

/// The trials of records that are held in memory; the place of a text is the number of its record.
impl<D: Detail> FromIterator<Record<D>> for Trials<D> {
    fn from_iter<I: IntoIterator<Item = Record<D>>>(records: I) -> Self {
        let mut trials = Self::default();
        for (number, record) in records.into_iter().enumerate() {
            trials.add(record, TextPlace::new(number as u64));
        }
        trials
    }
}
