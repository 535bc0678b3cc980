//! Removal of unusable images and their questions by `--skip bad`: [`Dataset::without_unusable`].

use std::collections::{BTreeMap, BTreeSet};

use super::ready_made::LEFT_OUT;
use super::{Dataset, SkipBad};
use crate::error::{Error, Result};
use crate::types::FrameId;

impl Dataset {
    /// Images that the questions show, without duplicates; all images if there are no questions.
    pub(crate) fn shown_images(&self) -> Vec<&FrameId> {
        if self.questions.is_empty() {
            return self.sources.keys().collect();
        }
        self.questions
            .iter()
            .flat_map(|question| self.shown_frames(&question.frame))
            .collect::<BTreeSet<&FrameId>>()
            .into_iter()
            .collect()
    }

    /// Checks that an image, and the photographs of its scene in the dark, can be decoded.
    ///
    /// # Errors
    /// If one of them cannot be decoded; the error names its file.
    pub(crate) fn decode_all(&self, frame: &FrameId) -> Result<()> {
        self.picture(frame)?.decode()?;
        for photograph in self.photographs(frame) {
            self.photograph(frame, &photograph.name)?.decode()?;
        }
        Ok(())
    }

    /// Removes unusable images and the questions that show them. `unusable` has the problem of each image.
    ///
    /// # Errors
    /// If more is left out than `skip` allows, including broken rows.
    pub(crate) fn without_unusable(mut self, unusable: &BTreeMap<FrameId, String>, skip: SkipBad) -> Result<Self> {
        let Some(first) = unusable.values().next() else {
            return Ok(self);
        };
        self.sources.retain(|frame, _| !unusable.contains_key(frame));
        if self.questions.is_empty() {
            let (bad, all) = (unusable.len(), unusable.len() + self.sources.len());
            return self.record_omission(bad, all, "images", first, skip);
        }
        let problem = format!("{first} (of {} images)", unusable.len());
        let first = if unusable.len() == 1 { first } else { &problem };
        self.without_unmatched_questions(first, skip)
    }

    /// Removes the questions about images that the data set does not have. `first` is the problem of the first one.
    ///
    /// # Errors
    /// As [`Self::without_unusable`].
    pub(super) fn without_unmatched_questions(mut self, first: &str, skip: SkipBad) -> Result<Self> {
        let questions = self.take_questions();
        let all = questions.len();
        self.questions = questions.into_iter().filter(|question| self.has_frames(&question.frame)).collect();
        let bad = all - self.questions.len();
        let rows = self.rows.all.max(all);
        self.record_omission(bad, rows, "questions", first, skip)
    }

    /// Checks that `bad` of `all` may be left out, and adds a line to the summary.
    fn record_omission(mut self, bad: usize, all: usize, noun: &str, first: &str, skip: SkipBad) -> Result<Self> {
        self.rows.bad += bad;
        skip.check(self.rows.bad, all, noun, first).map_err(|problem| Error::data(&self.name, problem))?;
        self.summary.push(format!("{LEFT_OUT}{bad} of {all} {noun} (unusable images); the first: {first}"));
        Ok(self)
    }
}
