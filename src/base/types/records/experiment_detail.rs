//! [`StoredDetail`] of the two experiments: questions with choices and open questions.

use std::borrow::Cow;

use super::record::{ChoiceLine, OpenLine};
use super::trials::{AskedParts, ChoiceFacts, ChoiceTables, SentImages};
use crate::types::{ChoiceDetail, Digest, Family, OpenDetail, Record, StoredDetail};

impl StoredDetail for ChoiceDetail {
    type Line = ChoiceLine;

    type Facts = ChoiceFacts;

    type Tables = ChoiceTables;

    const SCHEMA: &'static str = "darkqa.run/2";

    fn asked(&self) -> AskedParts<'_> {
        AskedParts {
            frame: &self.frame.0,
            family: Cow::Borrowed(&self.family),
            choices: &self.choices,
            truth: self.truth,
            wording: self.wording.as_deref(),
            order: self.order,
            repeat: self.repeat,
        }
    }

    fn extract_facts(record: &Record, tables: &mut ChoiceTables) -> ChoiceFacts {
        tables.extract_facts(record)
    }

    fn move_facts(facts: &ChoiceFacts, from: &ChoiceTables, to: &mut ChoiceTables) -> ChoiceFacts {
        to.move_from(*facts, from)
    }

    fn source_of<'t>(facts: &'t ChoiceFacts, tables: &'t ChoiceTables) -> Option<&'t str> {
        tables.shown_frame(*facts).map(|frame| &*frame.0)
    }

    fn sent_digest_of(facts: &ChoiceFacts, tables: &ChoiceTables) -> Option<Digest> {
        tables.images(*facts).map(SentImages::digest)
    }

    fn choices(&self) -> &[String] {
        &self.choices
    }

    fn repeat(&self) -> u32 {
        self.repeat
    }

    fn source(&self) -> &str {
        &self.sent_frame().0
    }

    fn sent_digest(&self) -> Option<Digest> {
        self.file_digest()
    }
}

impl StoredDetail for OpenDetail {
    type Line = OpenLine;

    type Facts = Box<Record<Self>>;

    type Tables = ();

    const SCHEMA: &'static str = "darkqa.openeqa/2";

    fn asked(&self) -> AskedParts<'_> {
        AskedParts {
            frame: &self.episode,
            family: Cow::Owned(Family::from(&*self.category)),
            choices: &[],
            truth: None,
            wording: None,
            order: 0,
            repeat: 0,
        }
    }

    fn extract_facts(record: &Record<Self>, (): &mut ()) -> Self::Facts {
        Box::new(record.clone())
    }

    fn move_facts(record: &Self::Facts, (): &(), (): &mut ()) -> Self::Facts {
        record.clone()
    }

    fn source_of<'t>(_: &'t Self::Facts, (): &'t ()) -> Option<&'t str> {
        None
    }

    fn sent_digest_of(record: &Self::Facts, (): &()) -> Option<Digest> {
        record.detail.sent_digest()
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

    fn sent_digest(&self) -> Option<Digest> {
        self.images.as_ref().map(|images| images.digest)
    }
}
