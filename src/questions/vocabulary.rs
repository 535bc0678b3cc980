//! Words that a data set uses for objects: [`Vocabulary`].

use std::collections::{BTreeMap, BTreeSet};

use super::rules::RuleBook;
use super::statistics::{FrameStatistics, WordSource, plain_word};
use darkqa_base::types::Labels;

/// Words that a data set uses for objects: the names of its segments if they have any, otherwise its labels.
///
/// A question whose answer is "no" uses only these words, and an activity is asked about only if these words could
/// enable it. Otherwise, "no" would always be the answer to questions with a word that no annotator of the data set
/// used.
#[derive(Debug, Default)]
pub struct Vocabulary {
    /// Words used in questions, by class.
    words: BTreeMap<String, BTreeSet<String>>,
    /// Tokens of the words, by [`RuleBook::token()`].
    tokens: BTreeSet<String>,
}

impl Vocabulary {
    /// Collects the words of these frames and labels.
    pub fn new(frames: &[FrameStatistics], labels: &Labels, book: &RuleBook) -> Self {
        let mut vocabulary = Self::default();
        let mut has_names = false;
        for segment in frames.iter().flat_map(|frame| &frame.segments) {
            if segment.source != WordSource::Coarse {
                vocabulary.add(&segment.class, &segment.word, book);
            }
            has_names |= segment.source == WordSource::Name;
        }
        // If segments have names, the labels are coarse classes and do not name objects.
        if !has_names {
            for label in labels.labels.values() {
                let (word, _) = plain_word(&label.name);
                if book.coarse.identifies_object(&labels.space, &word) {
                    vocabulary.add(&label.canonical, &word, book);
                }
            }
        }
        vocabulary
    }

    fn add(&mut self, class: &str, word: &str, book: &RuleBook) {
        self.tokens.insert(book.token(word, class).to_owned());
        if let Some(question_word) = book.question_word(class, word) {
            let words = self.words.entry(class.to_owned()).or_default();
            words.insert(question_word.to_owned());
        }
    }

    /// Words that questions use for objects of a class.
    pub fn class_words(&self, class: &str) -> impl Iterator<Item = &str> {
        self.words.get(class).into_iter().flatten().map(String::as_str)
    }

    /// True if the data set has a word for objects with this token. A class is also a token.
    pub fn has_token(&self, token: &str) -> bool {
        self.tokens.contains(token) || self.words.contains_key(token)
    }
}
