//! The marks of a judge, found by what the judge was told: [`MarkIndex`].

use std::collections::HashMap;

use crate::types::{Digest, QuestionId, RunQuestion};

/// Setting in the manifest with the name of the judge.
pub(crate) const JUDGE: &str = "--judge";
/// Setting in the manifest with the protocol of judging.
pub(crate) const PROTOCOL: &str = "--protocol";

/// The marks of a judge, by the words of the question and the answer: a mark is that of all questions with the same words.
#[derive(Debug)]
pub(crate) struct MarkIndex<M> {
    /// The digest of the judge's prompt, by question.
    words: HashMap<QuestionId, Digest>,
    /// By the digest of these words and the answer.
    by_answer: HashMap<Digest, M>,
}

impl<M> MarkIndex<M> {
    /// The index for these questions, without marks.
    pub(crate) fn new<'a>(questions: impl IntoIterator<Item = &'a RunQuestion>) -> Self {
        let words = questions
            .into_iter()
            .map(|question| (question.id.clone(), question.judged_words()));
        Self {
            words: words.collect(),
            by_answer: HashMap::new(),
        }
    }

    /// Adds the mark of an answer; a later one replaces it. That of an unknown question is left out.
    pub(crate) fn add(&mut self, question: &QuestionId, answer: &str, mark: M) {
        if let Some(judged) = self.judged(question, answer) {
            self.by_answer.insert(judged, mark);
        }
    }

    /// The mark of an answer to a question.
    pub(crate) fn get(&self, question: &QuestionId, answer: &str) -> Option<&M> {
        self.by_answer.get(&self.judged(question, answer)?)
    }

    /// The digest of the judge's prompt for an answer.
    fn judged(&self, question: &QuestionId, answer: &str) -> Option<Digest> {
        let words = self.words.get(question)?;
        let parts = [words.to_string(), answer.to_owned()];
        Some(Digest::from_parts(parts.iter().map(String::as_bytes)))
    }
}
