//! The trials of runs as reports need them: [`Trials`], and one of them ([`TrialRef`]).
//!
//! Facts that many trials share are stored once, and the texts of replies stay in the file of the run. A trial with choices therefore takes
//! 60 bytes, and 16 more while its key is needed.

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
use std::hash::BuildHasher;

use asked_model::{AskedModel, Ending};
use hashbrown::hash_table::Entry;
use hashbrown::{DefaultHashBuilder, HashTable};
use rayon::slice::ParallelSliceMut;
use trial_facts::{TrialFacts, reply_digest};
use values::Values;

use crate::error::Error;

use super::record::{Record, StoredDetail};
use crate::types::{
    ChoiceDetail, Condition, Distinct, Family, Finish, FrameId, LostAttempts, QuestionId, TrialKey,
};

/// Trials with the tables that they refer to.
#[derive(Debug, Clone)]
pub struct Trials<D: StoredDetail> {
    facts: Vec<TrialFacts<D::Facts>>,
    /// The key of each trial; empty if the keys were dropped.
    keys: Vec<TrialKey>,
    items: Values<AskedItem>,
    asked: Values<AskedModel>,
    endings: Values<Ending>,
    tables: D::Tables,
    /// Number of files of runs that the places of texts refer to.
    logs: usize,
    texts: Texts,
}

/// The trial to keep of two with one key.
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

impl<D: StoredDetail> Default for Trials<D> {
    fn default() -> Self {
        Self {
            facts: Vec::new(),
            keys: Vec::new(),
            items: Values::default(),
            asked: Values::default(),
            endings: Values::default(),
            tables: D::Tables::default(),
            logs: 1,
            texts: Texts::default(),
        }
    }
}

impl<D: StoredDetail> Trials<D> {
    /// Adds the trial of a record whose line is at this place.
    pub fn add(&mut self, record: Record<D>, text: TextPlace) {
        let facts = D::keep(&record, &mut self.tables);
        let reply = reply_digest(record.reply.as_deref(), record.refusal.as_deref());
        let item = self.item_of(&record.question, &record.detail.asked());
        let asked = self.asked.number(AskedModel {
            model: record.model,
            view: record.view,
            condition: record.condition,
        });
        let failure = record.failure.map(|failure| (failure.kind, failure.status));
        let broken_off = match record.finish {
            Some(Finish::Other(word)) if failure.is_some() => Some(word),
            _ => None,
        };
        let ending = self.endings.number(Ending {
            served_model: record.served_model,
            provider: record.provider,
            via: record.via,
            failure,
            broken_off,
            attempts: record.attempts,
            lost: record.lost,
            max_tokens: record.max_tokens,
        });
        self.keys.push(record.key);
        self.logs = self.logs.max(text.log() + 1);
        self.facts.push(TrialFacts {
            text,
            reply,
            item,
            asked,
            ending,
            tokens: record.usage.into(),
            latency: record.latency_ms.into(),
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
    pub fn item(&self, number: usize) -> &AskedItem {
        self.items.get(number as u32)
    }

    /// Number of items, with those that no trial is about any more.
    pub fn item_count(&self) -> usize {
        self.items.len()
    }

    /// The items that trials are about, by number; `None` for one that no trial is about any more.
    #[must_use]
    pub fn items(&self) -> Vec<Option<&AskedItem>> {
        let mut is_met = vec![false; self.items.len()];
        for facts in &self.facts {
            is_met[facts.item as usize] = true;
        }
        self.items
            .all()
            .iter()
            .zip(is_met)
            .map(|(item, is_met)| is_met.then_some(item))
            .collect()
    }

    /// The questions that were asked, with their frames; a question may be met several times.
    pub fn questions(&self) -> impl Iterator<Item = (&QuestionId, &FrameId)> {
        self.items()
            .into_iter()
            .flatten()
            .map(|item| (&*item.question, &*item.frame))
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
        self.keep(&kept);
    }

    /// Keeps the trials that have `true` at their place.
    fn keep(&mut self, kept: &[bool]) {
        let mut of_facts = kept.iter();
        self.facts.retain(|_| of_facts.next() == Some(&true));
        let mut of_keys = kept.iter();
        self.keys.retain(|_| of_keys.next() == Some(&true));
    }

    /// Drops the keys of all trials, which take a fifth of their memory. They are needed to join trials with others.
    pub fn drop_keys(&mut self) {
        self.keys = Vec::new();
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

    /// Adds a copy of a trial of other runs; `logs` is the number of log files before those of its run.
    pub fn copy(&mut self, trial: TrialRef<'_, D>, logs: usize) {
        let other = trial.trials();
        let facts = trial.facts();
        let item = self.shared(other.items.get(facts.item).clone());
        let new = TrialFacts {
            text: facts.text.after(logs),
            item: self.items.number(item),
            asked: self.asked.number(other.asked.get(facts.asked).clone()),
            ending: self.endings.number(other.endings.get(facts.ending).clone()),
            facts: D::move_facts(&facts.facts, &other.tables, &mut self.tables),
            ..facts.clone()
        };
        self.keys.extend(trial.key_if_there());
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
            let item = self.shared(AskedItem::new(question, parts));
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

    /// Keeps one trial of each key. `choose` is called for every two, in the order of their addition. The cost of a dropped trial is added
    /// to the kept one of the same file.
    ///
    /// # Errors
    /// Errors of `choose`.
    pub fn each_key_once(
        &mut self,
        mut choose: impl FnMut(TrialRef<'_, D>, TrialRef<'_, D>) -> Result<KeptTrial, Error>,
    ) -> Result<(), Error> {
        let hashes = DefaultHashBuilder::default();
        let mut kept_of_key = HashTable::<u32>::with_capacity(self.keys.len());
        let mut kept = vec![true; self.facts.len()];
        let mut paid = BTreeMap::<usize, LostAttempts>::new();
        for (later, key) in self.keys.iter().enumerate() {
            let is_same = |place: &u32| self.keys[*place as usize] == *key;
            let rehash = |place: &u32| hashes.hash_one(self.keys[*place as usize]);
            match kept_of_key.entry(hashes.hash_one(key), is_same, rehash) {
                Entry::Vacant(first) => {
                    first.insert(later as u32);
                }
                Entry::Occupied(mut known) => {
                    let first = *known.get() as usize;
                    let (one, dropped) = match choose(self.at(first), self.at(later))? {
                        KeptTrial::First => (first, later),
                        KeptTrial::Later => (later, first),
                    };
                    kept[dropped] = false;
                    *known.get_mut() = one as u32;
                    if self.at(one).text().log() == self.at(dropped).text().log() {
                        let earlier = paid.remove(&dropped).unwrap_or_default();
                        let more = earlier.plus(self.at(dropped).paid_besides(self.at(one)));
                        let sum = paid.entry(one).or_default();
                        *sum = sum.plus(more);
                    }
                }
            }
        }
        drop(kept_of_key);
        for (place, more) in paid.into_iter().filter(|(_, more)| !more.is_none()) {
            let ending = self.endings.get(self.facts[place].ending).clone();
            let lost = ending.lost.plus(more);
            self.facts[place].ending = self.endings.number(Ending { lost, ..ending });
        }
        self.keep(&kept);
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
        let questions: Vec<u32> = items
            .iter()
            .map(|item| question(&item.question).map_or(0, |place| place as u32 + 1))
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
        let mut order: Vec<(u64, u32)> = self
            .facts
            .iter()
            .map(|facts| {
                let question = u64::from(questions[facts.item as usize]);
                question << 32 | u64::from(places[facts.asked as usize])
            })
            .zip(0..)
            .collect();
        let rest = |place: u32| {
            let facts = &self.facts[place as usize];
            let repeat = self.items.get(facts.item).repeat;
            (repeat, self.keys.get(place as usize))
        };
        order.par_sort_unstable_by(|(one_rank, one), (other_rank, other)| {
            let ranks = one_rank.cmp(other_rank);
            ranks.then_with(|| rest(*one).cmp(&rest(*other)))
        });
        self.put_in(order.into_iter().map(|(_, place)| place).collect());
    }

    /// Puts the trial of each place in `order` there where its place stands.
    fn put_in(&mut self, mut order: Vec<u32>) {
        for start in 0..order.len() {
            let mut to = start;
            // The trials that take each other's places are a circle: each but the last is exchanged with the one that belongs there.
            while order[to] as usize != start {
                let from = order[to] as usize;
                self.facts.swap(to, from);
                if !self.keys.is_empty() {
                    self.keys.swap(to, from);
                }
                order[to] = to as u32;
                to = from;
            }
            order[to] = to as u32;
        }
    }
}

impl Trials<ChoiceDetail> {
    /// Adds a trial with a choice in the place of the truth, without its images.
    pub fn hold(&mut self, trial: TrialRef<'_, ChoiceDetail>, repeat: u32, reference: usize) {
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
            ending: self.endings.number(Ending {
                served_model: None,
                provider: None,
                via: super::record::Via::Direct,
                ..other.endings.get(facts.ending).clone()
            }),
            facts: facts.facts.held_against(reference),
            ..facts.clone()
        };
        self.keys.extend(trial.key_if_there());
        self.facts.push(new);
    }
}

/// The trials of records that are held in memory; the place of a text is the number of its record.
impl<D: StoredDetail> FromIterator<Record<D>> for Trials<D> {
    fn from_iter<I: IntoIterator<Item = Record<D>>>(records: I) -> Self {
        let mut trials = Self::default();
        for (number, record) in records.into_iter().enumerate() {
            trials.add(record, TextPlace::new(number as u64));
        }
        trials
    }
}
