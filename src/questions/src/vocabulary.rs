//! [`Vocabulary`]: the words that a data set can name.

use std::collections::{BTreeMap, BTreeSet};

use super::rules::RuleBook;
use super::statistics::{FrameStatistics, WordSource, plain_word};
use darkqa_ground::types::Labels;

/// The words of a data set: those of its labels, or of its segments if they have names.
///
/// Only such words are denied, and only activities that they could enable are asked about. Else "no" would be the answer to
/// every question with a word that no annotator of the data set used, whatever the image shows.
#[derive(Debug, Default)]
pub struct Vocabulary {
    /// Words of questions by class.
    words: BTreeMap<String, BTreeSet<String>>,
    /// Tokens of the words.
    tokens: BTreeSet<String>,
}

impl Vocabulary {
    /// The words of these frames and labels.
    pub fn new(frames: &[FrameStatistics], labels: &Labels, book: &RuleBook) -> Self {
        let mut vocabulary = Self::default();
        let segments = || frames.iter().flat_map(|frame| &frame.segments);
        for segment in segments().filter(|segment| segment.source != WordSource::Coarse) {
            vocabulary.add(&segment.class, &segment.word, book);
        }
        // Where segments have names, labels are those of coarse classes, which no segment is called by.
        if !segments().any(|segment| segment.source == WordSource::Name) {
            for label in labels.labels.values() {
                let (word, _) = plain_word(&label.name);
                if book.coarse.says(&labels.space, &word) {
                    vocabulary.add(&label.canonical, &word, book);
                }
            }
        }
        vocabulary
    }

    fn add(&mut self, class: &str, word: &str, book: &RuleBook) {
        self.tokens.insert(book.token(word, class).to_owned());
        if let Some(word) = book.called(class, word) {
            let words = self.words.entry(class.to_owned()).or_default();
            words.insert(word.to_owned());
        }
    }

    /// The words by which things of a class are called.
    pub fn class_words(&self, class: &str) -> impl Iterator<Item = &str> {
        self.words
            .get(class)
            .into_iter()
            .flatten()
            .map(String::as_str)
    }

    /// Whether a thing with a token can be named in this data set.
    pub fn has_token(&self, token: &str) -> bool {
        self.tokens.contains(token) || self.words.contains_key(token)
    }
}
