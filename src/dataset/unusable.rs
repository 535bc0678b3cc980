//! Questions about images that cannot be used, which `--skip bad` leaves out: [`Dataset::without`].

use std::collections::{BTreeMap, BTreeSet};

use super::ready_made::LEFT_OUT;
use super::{Dataset, SkipBad};
use crate::error::{Error, Result};
use crate::types::FrameId;

impl Dataset {
    /// The images that the questions show, each once; all images of data without questions.
    pub(crate) fn shown_images(&self) -> Vec<&FrameId> {
        if self.questions.is_empty() {
            return self.sources.keys().collect();
        }
        self.questions
            .iter()
            .flat_map(|question| self.shown(&question.frame))
            .collect::<BTreeSet<&FrameId>>()
            .into_iter()
            .collect()
    }

    /// Decodes an image, and the photographs of its scene in the dark.
    ///
    /// # Errors
    /// If one of them cannot be read; the error names its file.
    pub(crate) fn decode_all(&self, frame: &FrameId) -> Result<()> {
        self.picture(frame)?.decode()?;
        for photograph in self.photographs(frame) {
            self.photograph(frame, &photograph.name)?.decode()?;
        }
        Ok(())
    }

    /// The same data set without images that cannot be used, and without the questions that show one. The problem of each image is
    /// given by its frame.
    ///
    /// # Errors
    /// If more is broken than `skip` allows; broken rows count, too.
    pub(crate) fn without(
        mut self,
        unusable: &BTreeMap<FrameId, String>,
        skip: SkipBad,
    ) -> Result<Self> {
        let Some(first) = unusable.values().next() else {
            return Ok(self);
        };
        self.sources
            .retain(|frame, _| !unusable.contains_key(frame));
        if self.questions.is_empty() {
            let (bad, all) = (unusable.len(), unusable.len() + self.sources.len());
            return self.left_out(bad, all, "images", first, skip);
        }
        let problem = format!("{first} (of {} images)", unusable.len());
        let first = if unusable.len() == 1 { first } else { &problem };
        self.without_strangers(first, skip)
    }

    /// The same data set without the questions about images that it does not have. `first` is the problem of the first of them.
    ///
    /// # Errors
    /// As of [`Self::without`].
    pub(super) fn without_strangers(mut self, first: &str, skip: SkipBad) -> Result<Self> {
        let questions = self.take_questions();
        let all = questions.len();
        self.questions = questions
            .into_iter()
            .filter(|question| self.has(&question.frame))
            .collect();
        let bad = all - self.questions.len();
        let rows = self.rows.all.max(all);
        self.left_out(bad, rows, "questions", first, skip)
    }

    /// Checks that this much may be left out, and notes it.
    fn left_out(
        mut self,
        bad: usize,
        all: usize,
        noun: &str,
        first: &str,
        skip: SkipBad,
    ) -> Result<Self> {
        self.rows.bad += bad;
        skip.check(self.rows.bad, all, noun, first)
            .map_err(|problem| Error::data(&self.name, problem))?;
        self.reading.push(format!(
            "{LEFT_OUT}{bad} of {all} {noun} (unusable images); the first: {first}"
        ));
        Ok(self)
    }
}
