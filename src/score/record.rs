//! Reading of a reply into the record of its trial, for both experiments.

use super::choice::{LENIENT_VERSION, readings};
use super::llm_match::{Protocol, mark};
use super::option_probabilities::option_probabilities;
use crate::error::Result;
use crate::types::detail::{AlikeChoices, ChoiceLine, OpenLine};
use crate::types::{
    Answer, ChoiceDetail, Choices, Detail, Digest, FrameId, OpenDetail, Reply, Step, TrialOutcome,
};

impl Detail for ChoiceDetail {
    type Line = ChoiceLine;

    type Alike = AlikeChoices;

    const SCHEMA: &'static str = "darkqa.run/2";

    const REPLY_READING: Option<&'static str> = Some(LENIENT_VERSION);

    /// Stores both readings of a reply, and the outcome, which follows from the strict reading.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        let choices = Choices::known_by(self.choices.to_vec().into(), self.truth)?;
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
            self.options = option_probabilities(chances, &self.choices).map(Box::new);
        }
        if reply.observed.is_some() {
            self.observed = reply.observed.clone().map(Box::new);
        }
        Ok(())
    }

    fn share(&mut self, alike: &mut AlikeChoices) {
        Self::share(self, alike);
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

    type Alike = ();

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

    fn share(&mut self, (): &mut ()) {}

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
