//! A compact table of the trials of runs for reports: [`Trials`], with a view of one trial ([`TrialRef`]).
//!
//! Facts that many trials share are stored once, and the texts of replies stay in the file of the run. A trial with
//! choices therefore takes 60 bytes, and 16 more while its key is needed.

mod asked_item;
mod asked_model;
mod choice_facts;
mod encoding;
mod interner;
mod trial_ref;

use std::collections::BTreeMap;
use std::hash::BuildHasher;

use hashbrown::hash_table::Entry;
use hashbrown::{DefaultHashBuilder, HashTable};
use rayon::slice::ParallelSliceMut;

use super::record::{Record, StoredDetail};
use crate::error::Error;
use crate::types::{ChoiceDetail, Condition, Distinct, Family, Finish, FrameId, LostAttempts, QuestionId, TrialKey};
use asked_model::{AskedModel, Ending};
use choice_facts::{TrialFacts, hash_reply};
use interner::Interner;

pub use asked_item::{AskedItem, AskedParts, ItemKey};
pub use asked_model::Stopped;
pub use choice_facts::{ChoiceFacts, ChoiceTables, SentImages};
pub use interner::TextPlace;
pub use trial_ref::TrialRef;

/// Trials with the tables that they refer to.
#[derive(Debug, Clone)]
pub struct Trials<D: StoredDetail> {
    facts: Vec<TrialFacts<D::Facts>>,
    /// The key of each trial; empty if the keys were dropped.
    keys: Vec<TrialKey>,
    items: Interner<AskedItem>,
    asked: Interner<AskedModel>,
    endings: Interner<Ending>,
    tables: D::Tables,
    /// Number of record files that the places of texts refer to.
    logs: usize,
    texts: Texts,
}

/// Which of two trials with the same key is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeptTrial {
    /// The trial that was added first.
    First,
    /// The trial that was added later.
    Later,
}

/// Texts that several items share.
#[derive(Debug, Clone, Default)]
struct Texts {
    questions: Distinct<QuestionId>,
    frames: Distinct<FrameId>,
    families: Distinct<Family>,
    choices: Distinct<Vec<String>>,
    wordings: Distinct<String>,
}

impl<D: StoredDetail> Default for Trials<D> {
    fn default() -> Self {
        Self {
            facts: Vec::new(),
            keys: Vec::new(),
            items: Interner::default(),
            asked: Interner::default(),
            endings: Interner::default(),
            tables: D::Tables::default(),
            logs: 1,
            texts: Texts::default(),
        }
    }
}

impl<D: StoredDetail> Trials<D> {
    /// Adds the trial of a record; `text` is the place of its line.
    pub fn add(&mut self, record: Record<D>, text: TextPlace) {
        let facts = D::extract_facts(&record, &mut self.tables);
        let reply = hash_reply(record.reply.as_deref(), record.refusal.as_deref());
        let item = self.intern_item(&record.question, &record.detail.asked());
        let asked =
            self.asked.intern(AskedModel { model: record.model, view: record.view, condition: record.condition });
        let failure = record.failure.map(|failure| (failure.kind, failure.status));
        let stopped = record.finish.as_ref().into();
        let ended_by = ended_by(record.finish, record.refusal.as_deref(), failure.is_some());
        let ending = self.endings.intern(Ending {
            served_model: record.served_model,
            provider: record.provider,
            via: record.via,
            failure,
            ended_by,
            stopped,
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

    /// True if the table contains no trial.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.facts.is_empty()
    }

    /// Number of record files that the places of texts refer to.
    #[must_use]
    pub fn logs(&self) -> usize {
        self.logs
    }

    /// The trial at a place; `None` beyond the last one.
    #[must_use]
    pub fn get(&self, place: usize) -> Option<TrialRef<'_, D>> {
        (place < self.facts.len()).then(|| TrialRef::new(self, place))
    }

    /// The trial at a place.
    ///
    /// # Panics
    /// If the place is beyond the last trial.
    #[must_use]
    pub fn at(&self, place: usize) -> TrialRef<'_, D> {
        assert!(place < self.facts.len(), "a place of {} trials", self.len());
        TrialRef::new(self, place)
    }

    /// All trials in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = TrialRef<'_, D>> + ExactSizeIterator + Clone {
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

    /// Number of items, unused ones included.
    pub fn item_count(&self) -> usize {
        self.items.len()
    }

    /// The items by number; `None` for an unused one, whose trials were removed.
    #[must_use]
    pub fn items(&self) -> Vec<Option<&AskedItem>> {
        let mut is_used = vec![false; self.items.len()];
        for facts in &self.facts {
            is_used[facts.item as usize] = true;
        }
        self.items.all().iter().zip(is_used).map(|(item, is_used)| is_used.then_some(item)).collect()
    }

    /// The questions that were asked, with their frames; a question may occur several times.
    pub fn questions(&self) -> impl Iterator<Item = (&QuestionId, &FrameId)> {
        self.items().into_iter().flatten().map(|item| (&*item.question, &*item.frame))
    }

    /// The models and conditions that were asked, by number; `None` for an unused one, as in [`items`](Self::items).
    #[must_use]
    pub fn asked(&self) -> Vec<Option<(&str, Option<&Condition>)>> {
        let mut is_used = vec![false; self.asked.len()];
        for facts in &self.facts {
            is_used[facts.asked as usize] = true;
        }
        self.asked
            .all()
            .iter()
            .zip(is_used)
            .map(|(asked, is_used)| is_used.then_some((&*asked.model, asked.condition.as_ref())))
            .collect()
    }

    /// Renames each model for which `new` returns a name.
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

    /// Keeps the trials that `is_kept` accepts.
    pub fn retain(&mut self, is_kept: impl FnMut(TrialRef<'_, D>) -> bool) {
        let kept: Vec<bool> = self.iter().map(is_kept).collect();
        self.retain_marked(&kept);
    }

    /// Keeps the trials that have `true` at their place.
    fn retain_marked(&mut self, kept: &[bool]) {
        let mut marks = kept.iter();
        self.facts.retain(|_| marks.next() == Some(&true));
        let mut marks = kept.iter();
        self.keys.retain(|_| marks.next() == Some(&true));
    }

    /// Drops the keys of all trials, a fifth of the memory. Only merging with other trials needs them.
    pub fn drop_keys(&mut self) {
        self.keys = Vec::new();
    }

    /// Removes the trials that `is_taken` accepts and returns them.
    #[must_use]
    pub fn extract(&mut self, is_taken: impl Fn(TrialRef<'_, D>) -> bool) -> Self {
        let mut taken = Self { logs: self.logs, ..Self::default() };
        for trial in self.iter().filter(|trial| is_taken(*trial)) {
            taken.copy(trial, 0);
        }
        if !taken.is_empty() {
            self.retain(|trial| !is_taken(trial));
        }
        taken
    }

    /// Adds a copy of a trial from another table; `logs` is the number of record files before those of its run.
    pub fn copy(&mut self, trial: TrialRef<'_, D>, logs: usize) {
        let other = trial.trials();
        let facts = trial.facts();
        let item = self.share_texts(other.items.get(facts.item).clone());
        let new = TrialFacts {
            text: facts.text.after(logs),
            item: self.items.intern(item),
            asked: self.asked.intern(other.asked.get(facts.asked).clone()),
            ending: self.endings.intern(other.endings.get(facts.ending).clone()),
            facts: D::move_facts(&facts.facts, &other.tables, &mut self.tables),
            ..facts.clone()
        };
        self.keys.extend(trial.key_if_known());
        self.facts.push(new);
        self.logs = self.logs.max(other.logs + logs);
    }

    /// The number of the item with this question and these parts, which is added if it is new.
    fn intern_item(&mut self, question: &QuestionId, parts: &AskedParts<'_>) -> u32 {
        let key = (question, parts);
        let known = self.items.find(&key, |item| {
            let (known, known_parts) = item.parts();
            (known, &known_parts) == key
        });
        known.unwrap_or_else(|| {
            let item = self.share_texts(AskedItem::new(question, parts));
            self.items.push(item)
        })
    }

    /// Replaces the texts of an item by equal ones of earlier items.
    fn share_texts(&mut self, mut item: AskedItem) -> AskedItem {
        self.texts.questions.share(&mut item.question);
        self.texts.frames.share(&mut item.frame);
        self.texts.families.share(&mut item.family);
        self.texts.choices.share(&mut item.choices);
        if let Some(wording) = &mut item.wording {
            self.texts.wordings.share(wording);
        }
        item
    }

    /// Keeps one trial of each key. `choose` decides between two trials with the same key, in the order of their
    /// addition. The cost of a dropped trial is added to the kept one if both are in the same file.
    ///
    /// # Errors
    /// Errors of `choose`.
    pub fn keep_one_per_key(
        &mut self,
        mut choose: impl FnMut(TrialRef<'_, D>, TrialRef<'_, D>) -> Result<KeptTrial, Error>,
    ) -> Result<(), Error> {
        let hashes = DefaultHashBuilder::default();
        let mut kept_of_key = HashTable::<u32>::with_capacity(self.keys.len());
        let mut kept = vec![true; self.facts.len()];
        let mut paid = BTreeMap::<usize, LostAttempts>::new();
        for (later, key) in self.keys.iter().enumerate() {
            let entry = kept_of_key.entry(
                hashes.hash_one(key),
                |place| self.keys[*place as usize] == *key,
                |place| hashes.hash_one(self.keys[*place as usize]),
            );
            match entry {
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
            self.facts[place].ending = self.endings.intern(Ending { lost, ..ending });
        }
        self.retain_marked(&kept);
        Ok(())
    }

    /// Sorts the trials by the places of their questions, their conditions, the places of their models, and repeats.
    /// Questions without a place come first.
    pub fn sort(&mut self, question: impl Fn(&QuestionId) -> Option<usize>, model: impl Fn(&str) -> (usize, usize)) {
        let (items, asked) = (self.items.all(), self.asked.all());
        let questions: Vec<u32> =
            items.iter().map(|item| question(&item.question).map_or(0, |place| place as u32 + 1)).collect();
        let places: Vec<_> =
            asked.iter().map(|asked| (asked.condition.as_ref(), model(&asked.model), &*asked.model)).collect();
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
        order.par_sort_unstable_by(|(one_rank, one), (other_rank, other)| {
            let ranks = one_rank.cmp(other_rank);
            ranks.then_with(|| self.repeat_and_key(*one).cmp(&self.repeat_and_key(*other)))
        });
        self.reorder(order.into_iter().map(|(_, place)| place).collect());
    }

    /// The repeat and key of a trial, which order the trials of one question, condition and model.
    fn repeat_and_key(&self, place: u32) -> (u32, Option<&TrialKey>) {
        let facts = &self.facts[place as usize];
        let repeat = self.items.get(facts.item).repeat;
        (repeat, self.keys.get(place as usize))
    }

    /// Reorders the trials: `order` contains the current place of each trial at its new place.
    fn reorder(&mut self, mut order: Vec<u32>) {
        for start in 0..order.len() {
            let mut to = start;
            // Follow one cycle of the permutation: each swap moves the right trial to `to`.
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
    /// Adds a copy of a trial that is scored against the choice `reference` instead of the truth; its images are
    /// dropped.
    pub fn add_scored_against(&mut self, trial: TrialRef<'_, ChoiceDetail>, repeat: u32, reference: usize) {
        let other = trial.trials();
        let facts = trial.facts();
        let item =
            self.share_texts(AskedItem { truth: Some(reference), repeat, ..other.items.get(facts.item).clone() });
        let new = TrialFacts {
            item: self.items.intern(item),
            asked: self.asked.intern(other.asked.get(facts.asked).clone()),
            ending: self.endings.intern(Ending {
                served_model: None,
                provider: None,
                via: super::record::Via::Direct,
                ..other.endings.get(facts.ending).clone()
            }),
            facts: facts.facts.scored_against(reference),
            ..facts.clone()
        };
        self.keys.extend(trial.key_if_known());
        self.facts.push(new);
    }
}

/// Collects the trials of records in memory; the place of a text is the number of its record.
impl<D: StoredDetail> FromIterator<Record<D>> for Trials<D> {
    fn from_iter<I: IntoIterator<Item = Record<D>>>(records: I) -> Self {
        let mut trials = Self::default();
        for (number, record) in records.into_iter().enumerate() {
            trials.add(record, TextPlace::new(number as u64));
        }
        trials
    }
}

/// The word for a reply that the server ended early, or for a generation that broke off; `None` for others.
fn ended_by(finish: Option<Finish>, refusal: Option<&str>, has_failed: bool) -> Option<String> {
    match finish.filter(|finish| !finish.is_whole())? {
        Finish::Other(word) => Some(word),
        _ if has_failed => None,
        Finish::Length => Some("length".to_owned()),
        _ => Some(
            refusal
                .and_then(refused_status)
                .map_or_else(|| "content_filter".to_owned(), |status| format!("status {status}")),
        ),
    }
}

/// The HTTP status at the start of the refusal of a reply that was refused by a status.
fn refused_status(refusal: &str) -> Option<&str> {
    let (status, _) = refusal.split_once(": ")?;
    (status.len() == 3 && status.bytes().all(|byte| byte.is_ascii_digit())).then_some(status)
}
