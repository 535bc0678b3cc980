//! [`TrialRef`]: one trial in a table.

use super::asked_model::{Ending, Stopped};
use super::choice_facts::TrialFacts;
use super::{AskedItem, KeptTrial, SentImages, TextPlace, Trials};
use crate::types::records::record::{FailureKind, StoredDetail, Via, View};
use crate::types::records::small_number::Tokens;
use crate::types::{
    ChoiceDetail, Condition, Digest, Family, FrameId, LostAttempts, Observed, OpenDetail, OptionProbabilities,
    ParsedAnswer, QuestionId, Record, Step, TrialKey, TrialOutcome, Usage,
};

/// A view of one trial in [`Trials`].
#[derive(Debug)]
pub struct TrialRef<'t, D: StoredDetail = ChoiceDetail> {
    trials: &'t Trials<D>,
    place: usize,
}

#[expect(clippy::expl_impl_clone_on_copy, reason = "a derived impl would require `D: Clone`")]
impl<D: StoredDetail> Clone for TrialRef<'_, D> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<D: StoredDetail> Copy for TrialRef<'_, D> {}

impl<'t, D: StoredDetail> TrialRef<'t, D> {
    pub(super) fn new(trials: &'t Trials<D>, place: usize) -> Self {
        Self { trials, place }
    }

    pub(super) fn trials(self) -> &'t Trials<D> {
        self.trials
    }

    pub(super) fn facts(self) -> &'t TrialFacts<D::Facts> {
        &self.trials.facts[self.place]
    }

    fn ending(self) -> &'t Ending {
        self.trials.endings.get(self.facts().ending)
    }

    /// The digest of everything that decides the reply.
    ///
    /// # Panics
    /// If the keys of the trials were dropped.
    #[must_use]
    pub fn key(self) -> TrialKey {
        self.trials.keys[self.place]
    }

    /// The key; `None` if the keys of the trials were dropped.
    pub(super) fn key_if_known(self) -> Option<TrialKey> {
        self.trials.keys.get(self.place).copied()
    }

    /// Location of the texts of the trial.
    #[must_use]
    pub fn text(self) -> TextPlace {
        self.facts().text
    }

    /// The question as asked.
    #[must_use]
    pub fn item(self) -> &'t AskedItem {
        self.trials.items.get(self.facts().item)
    }

    /// Index of the item in [`Trials::items`].
    pub fn item_number(self) -> usize {
        self.facts().item as usize
    }

    /// The number of the model and condition among [`Trials::asked`].
    pub fn asked_number(self) -> usize {
        self.facts().asked as usize
    }

    /// The name of the question.
    #[must_use]
    pub fn question(self) -> &'t QuestionId {
        &self.item().question
    }

    /// The choices in the order shown.
    #[must_use]
    pub fn choices(self) -> &'t [String] {
        &self.item().choices
    }

    /// How many times the same question was asked before this trial.
    #[must_use]
    pub fn repeat(self) -> u32 {
        self.item().repeat
    }

    /// The name of the model, the judge or the group of people that was asked.
    #[must_use]
    pub fn model(self) -> &'t str {
        &self.trials.asked.get(self.facts().asked).model
    }

    /// Whether the model was shown the images.
    #[must_use]
    pub fn view(self) -> View {
        self.trials.asked.get(self.facts().asked).view
    }

    /// The condition of the images; `None` if the model was shown none.
    #[must_use]
    pub fn condition(self) -> Option<&'t Condition> {
        self.trials.asked.get(self.facts().asked).condition.as_ref()
    }

    /// Whether no reply came.
    #[must_use]
    pub fn failed(self) -> bool {
        self.failure().is_some()
    }

    /// The reason why no reply came, with the HTTP status if the server sent one; `None` if a reply came.
    #[must_use]
    pub fn failure(self) -> Option<(FailureKind, Option<u16>)> {
        self.ending().failure
    }

    /// The server's word for the reason why the last attempt broke off; `None` for other failures and for replies.
    #[must_use]
    pub fn broken_off(self) -> Option<&'t str> {
        self.ending().ended_by.as_deref().filter(|_| self.failed())
    }

    /// The word for a reply that the server ended early: its finish reason, or the status by which it refused the
    /// content; `None` for whole replies and for failures.
    #[must_use]
    pub fn ended_early(self) -> Option<&'t str> {
        self.ending().ended_by.as_deref().filter(|_| !self.failed())
    }

    /// The reason why the model stopped, as far as it decides whether the trial is asked again.
    pub fn stopped(self) -> Stopped {
        self.ending().stopped
    }

    /// Whether a reply or a refusal came.
    #[must_use]
    pub fn has_reply(self) -> bool {
        self.facts().reply != [0; 2]
    }

    /// True if reply and refusal equal those of another trial.
    pub fn has_reply_of(self, other: Self) -> bool {
        self.facts().reply == other.facts().reply
    }

    /// The way in which the model was asked.
    #[must_use]
    pub fn via(self) -> Via {
        self.ending().via
    }

    /// The model's name in the server's reply.
    #[must_use]
    pub fn served_model(self) -> Option<&'t str> {
        self.ending().served_model.as_deref()
    }

    /// The provider that a router passed the request on to.
    #[must_use]
    pub fn provider(self) -> Option<&'t str> {
        self.ending().provider.as_deref()
    }

    /// The tokens that the server charged; `None` if it did not report them.
    #[must_use]
    pub fn usage(self) -> Option<Usage> {
        self.facts().tokens.usage()
    }

    /// The tokens that the server charged, in the form that is kept in memory.
    pub fn tokens(self) -> Tokens {
        self.facts().tokens
    }

    /// The duration of the last try, in milliseconds.
    #[must_use]
    pub fn latency_ms(self) -> Option<u64> {
        self.facts().latency.get()
    }

    /// The number of requests that were sent.
    #[must_use]
    pub fn attempts(self) -> u32 {
        self.ending().attempts
    }

    /// The attempts that were charged and gave no reply, or a truncated reply that was replaced by one with a larger
    /// token limit.
    #[must_use]
    pub fn lost(self) -> LostAttempts {
        self.ending().lost
    }

    /// Token limit of the reply if it exceeds that of the run's first call.
    #[must_use]
    pub fn max_tokens(self) -> Option<u32> {
        self.ending().max_tokens
    }

    /// Chooses between this trial and one with the same key that was stored later: a failure does not replace a reply.
    #[must_use]
    pub fn or_later(self, later: Self) -> KeptTrial {
        if later.failed() && !self.failed() { KeptTrial::First } else { KeptTrial::Later }
    }

    /// Cost of this trial in addition to that of `other`, which has the same key and replaces it. If both have the same
    /// token limit and a reply, it is one reply that was parsed twice: the cost is zero.
    pub(super) fn paid_besides(self, other: Self) -> LostAttempts {
        let is_asked_again = self.max_tokens() != other.max_tokens();
        let mut paid = LostAttempts::default();
        if self.failed() || is_asked_again {
            paid = self.lost();
        }
        if !self.failed() && is_asked_again {
            paid.add(self.usage());
        }
        paid
    }

    /// Name of the frame or walk that was shown.
    #[must_use]
    pub fn source(self) -> &'t str {
        D::source_of(&self.facts().facts, &self.trials.tables).unwrap_or(&self.item().frame.0)
    }

    /// Digest of the images sent; `None` if no image was sent or the digest is unknown.
    #[must_use]
    pub fn sent_digest(self) -> Option<Digest> {
        D::sent_digest_of(&self.facts().facts, &self.trials.tables)
    }
}

impl<'t> TrialRef<'t, ChoiceDetail> {
    /// The frame of the question.
    #[must_use]
    pub fn frame(self) -> &'t FrameId {
        &self.item().frame
    }

    /// The family of the question.
    #[must_use]
    pub fn family(self) -> &'t Family {
        &self.item().family
    }

    /// The index of the true choice; `None` if nobody knows it.
    #[must_use]
    pub fn truth(self) -> Option<usize> {
        self.item().truth
    }

    /// The strict parsing of the reply; `None` if no reply came.
    #[must_use]
    pub fn strict(self) -> Option<ParsedAnswer> {
        self.facts().facts.strict()
    }

    /// The lenient parsing of the reply; `None` if no reply came.
    #[must_use]
    pub fn lenient(self) -> Option<ParsedAnswer> {
        self.facts().facts.lenient()
    }

    /// How the trial ended.
    #[must_use]
    pub fn outcome(self) -> TrialOutcome {
        self.facts().facts.outcome
    }

    /// Whether the reply is the letter of a choice and nothing else.
    pub fn is_letter(self) -> bool {
        self.facts().facts.is_letter
    }

    /// The images that were sent; `None` without images.
    #[must_use]
    pub fn images(self) -> Option<&'t SentImages> {
        self.trials.tables.images(self.facts().facts)
    }

    /// The frame whose image was shown.
    #[must_use]
    pub fn sent_frame(self) -> &'t FrameId {
        self.images().and_then(|images| images.shown_frame.as_ref()).unwrap_or(self.frame())
    }

    /// The observer's view, without the outlines of single objects.
    #[must_use]
    pub fn observed(self) -> Option<&'t Observed> {
        self.trials.tables.observed(self.facts().facts)
    }

    /// The model's probability of each choice.
    #[must_use]
    pub fn options(self) -> Option<&'t OptionProbabilities> {
        self.trials.tables.options(self.facts().facts)
    }
}

impl TrialRef<'_, OpenDetail> {
    /// True if the task was an answer, false if it was a mark.
    pub fn is_answer(self) -> bool {
        self.facts().facts.detail.step == Step::Answer
    }

    /// The record of an open question, with the names that its model and condition have among these trials.
    #[must_use]
    pub fn record(self) -> Record<OpenDetail> {
        Record { model: self.model().to_owned(), condition: self.condition().cloned(), ..(*self.facts().facts).clone() }
    }
}
