//! Reading of a reply into the record of its trial, for both experiments.

use std::borrow::Cow;

use super::choice::{LENIENT_VERSION, readings};
use super::llm_match::{Protocol, mark};
use super::option_probabilities::option_probabilities;
use crate::error::Result;
use crate::types::detail::{ChoiceLine, OpenLine};
use crate::types::trials::{AskedParts, ChoiceFacts, ChoiceTables, SentImages};
use crate::types::{
    Answer, ChoiceDetail, Choices, Detail, Digest, Family, FrameId, OpenDetail, Record, Reply,
    Step, TrialOutcome,
};

impl Detail for ChoiceDetail {
    type Line = ChoiceLine;

    type Facts = ChoiceFacts;

    type Tables = ChoiceTables;

    const SCHEMA: &'static str = "darkqa.run/2";

    const REPLY_READING: Option<&'static str> = Some(LENIENT_VERSION);

    /// Stores both readings of a reply, and the outcome, which follows from the strict reading.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        let choices = Choices::known_by(self.choices.clone().into(), self.truth)?;
        let (strict, lenient) = readings(reply, &choices);
        self.outcome = match strict {
            Answer::Unparsed(_) => TrialOutcome::Unparsed,
            Answer::Chosen(index) => match choices.truth() {
                None => TrialOutcome::Answered,
                Some(truth) if truth == index => TrialOutcome::Right,
                Some(_) => TrialOutcome::Wrong,
            },
        };
        self.strict = Some(strict.into());
        self.lenient = Some(lenient.into());
        // A stored reply that is read again says nothing of what was seen, or of how likely each choice was.
        if let Some(chances) = &reply.chances {
            self.options = option_probabilities(chances, &self.choices);
        }
        if reply.observed.is_some() {
            self.observed.clone_from(&reply.observed);
        }
        Ok(())
    }

    fn asked(&self) -> AskedParts<'_> {
        AskedParts {
            frame: &self.frame.0,
            family: Cow::Borrowed(&self.family),
            choices: &self.choices,
            truth: self.truth,
            repeat: self.repeat,
        }
    }

    fn keep(record: &Record, tables: &mut ChoiceTables) -> ChoiceFacts {
        tables.keep(record)
    }

    fn move_facts(facts: &ChoiceFacts, from: &ChoiceTables, to: &mut ChoiceTables) -> ChoiceFacts {
        to.move_from(*facts, from)
    }

    fn source_of<'t>(facts: &'t ChoiceFacts, tables: &'t ChoiceTables) -> Option<&'t str> {
        tables.shown_frame(*facts).map(|frame| &*frame.0)
    }

    fn sent_of(facts: &ChoiceFacts, tables: &ChoiceTables) -> Option<Digest> {
        tables.images(*facts).map(SentImages::digest)
    }

    fn choices(&self) -> &[String] {
        &self.choices
    }

    fn repeat(&self) -> u32 {
        self.repeat
    }

    fn source(&self) -> &str {
        let frame: &FrameId = self.shown();
        &frame.0
    }

    fn shown(&self) -> Option<Digest> {
        self.sent()
    }
}

impl Detail for OpenDetail {
    type Line = OpenLine;

    type Facts = Box<Record<Self>>;

    type Tables = ();

    const SCHEMA: &'static str = "darkqa.openeqa/2";

    const REPLY_READING: Option<&'static str> = None;

    /// Stores the marks that the two protocols read in a judge's reply.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        if self.step == Step::Mark {
            self.upstream = mark(&reply.text, Protocol::Upstream);
            self.tolerant = mark(&reply.text, Protocol::Tolerant);
        }
        Ok(())
    }

    fn asked(&self) -> AskedParts<'_> {
        AskedParts {
            frame: &self.episode,
            family: Cow::Owned(Family::from(&*self.category)),
            choices: &[],
            truth: None,
            repeat: 0,
        }
    }

    fn keep(record: &Record<Self>, (): &mut ()) -> Self::Facts {
        Box::new(record.clone())
    }

    fn move_facts(record: &Self::Facts, (): &(), (): &mut ()) -> Self::Facts {
        record.clone()
    }

    fn source_of<'t>(_: &'t Self::Facts, (): &'t ()) -> Option<&'t str> {
        None
    }

    fn sent_of(record: &Self::Facts, (): &()) -> Option<Digest> {
        record.detail.shown()
    }

    fn choices(&self) -> &[String] {
        &[]
    }

    fn repeat(&self) -> u32 {
        0
    }

    fn source(&self) -> &str {
        &self.episode
    }

    fn shown(&self) -> Option<Digest> {
        self.images.as_ref().map(|images| images.digest)
    }
}
