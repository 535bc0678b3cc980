//! [`BankIndex`]: the bank's question behind each question about an image.

use std::collections::{BTreeSet, HashMap};

use darkqa_ground::types::{QuestionId, RunQuestion};

/// The questions of a bank by the questions about single images: two with the same text and the same choices are one.
pub(super) struct BankIndex<'a> {
    by_id: HashMap<&'a QuestionId, usize>,
    /// A question about an image for each question of the bank.
    pub(super) examples: Vec<&'a RunQuestion>,
}

impl<'a> BankIndex<'a> {
    /// The index of the questions of a run.
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

    /// The number of the bank's question that a question about an image asks; `None` if the run does not store it.
    pub(super) fn position(&self, question: &QuestionId) -> Option<usize> {
        self.by_id.get(question).copied()
    }
}
