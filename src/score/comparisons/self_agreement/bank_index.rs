//! Mapping from questions about images to questions of the bank: [`BankIndex`].

use std::collections::{BTreeSet, HashMap};

use darkqa_base::types::{QuestionId, RunQuestion};

/// Questions of a bank. Questions about images with the same text and the same choices are the same question of the
/// bank.
pub(super) struct BankIndex<'a> {
    by_id: HashMap<&'a QuestionId, usize>,
    /// One question about an image for each question of the bank.
    pub(super) examples: Vec<&'a RunQuestion>,
}

impl<'a> BankIndex<'a> {
    /// Indexes the questions of a run.
    pub(super) fn new(questions: &'a [RunQuestion]) -> Self {
        let mut numbers = HashMap::<(&str, BTreeSet<&str>), usize>::new();
        let (mut by_id, mut examples) = (HashMap::new(), Vec::new());
        for question in questions {
            let choices = question.choices.iter().map(String::as_str).collect();
            let number = *numbers.entry((&question.text, choices)).or_insert_with(|| {
                examples.push(question);
                examples.len() - 1
            });
            by_id.insert(&question.id, number);
        }
        Self { by_id, examples }
    }

    /// Index of the question of the bank for a question about an image; `None` if the run does not store it.
    pub(super) fn position(&self, question: &QuestionId) -> Option<usize> {
        self.by_id.get(question).copied()
    }
}
