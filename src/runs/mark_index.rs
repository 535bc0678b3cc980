//! The marks of a judge by question and answer: [`MarkIndex`].

use std::collections::HashMap;

use darkqa_base::types::{Digest, QuestionId, RunQuestion};

/// Setting in the manifest with the name of the judge.
pub const JUDGE: &str = "--judge";
/// Setting in the manifest with the protocol of judging.
pub const PROTOCOL: &str = "--protocol";

/// The marks of a judge, by the text of the question and the answer. Questions with the same text share their marks.
#[derive(Debug)]
pub struct MarkIndex<M> {
    /// Digest of the question's part of the judge's prompt, by question.
    question_digests: HashMap<QuestionId, Digest>,
    /// Marks by the digest of question and answer.
    by_answer: HashMap<Digest, M>,
}

impl<M> MarkIndex<M> {
    /// An index without marks.
    pub fn new<'a>(questions: impl IntoIterator<Item = &'a RunQuestion>) -> Self {
        Self {
            question_digests: questions
                .into_iter()
                .map(|question| (question.id.clone(), question.judge_digest()))
                .collect(),
            by_answer: HashMap::new(),
        }
    }

    /// Adds the mark of an answer, replacing an earlier one. Ignores answers to unknown questions.
    pub fn add(&mut self, question: &QuestionId, answer: &str, mark: M) {
        if let Some(digest) = self.prompt_digest(question, answer) {
            self.by_answer.insert(digest, mark);
        }
    }

    /// The mark of an answer to a question.
    pub fn get(&self, question: &QuestionId, answer: &str) -> Option<&M> {
        self.by_answer.get(&self.prompt_digest(question, answer)?)
    }

    /// Digest of question and answer; `None` for an unknown question.
    fn prompt_digest(&self, question: &QuestionId, answer: &str) -> Option<Digest> {
        let question_digest = self.question_digests.get(question)?;
        let parts = [question_digest.to_string(), answer.to_owned()];
        Some(Digest::from_parts(parts.iter().map(String::as_bytes)))
    }
}
