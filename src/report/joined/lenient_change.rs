//! Effect of parsing stored replies again by the rules of this version: [`LenientChange`].

use crate::error::Result;
use crate::types::manifests::{FIRST_REPLY_READING, RunManifest};
use crate::types::{ChoiceDetail, Record};
use darkqa_score::answers::record::reread;
use darkqa_score::choice::LENIENT_VERSION;

/// Difference between the stored lenient parsing of replies and the one of this version.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct LenientChange {
    /// Version of the rules by which the replies were parsed.
    from: String,
    /// Number of replies.
    replies: usize,
    /// Number of replies whose parsed choice changes.
    changed: usize,
    /// Number of replies to questions whose true choice is known.
    scored: usize,
    /// Number of replies parsed as the true choice, before and now.
    right: [usize; 2],
}

impl LenientChange {
    /// A comparison without replies, for the run of this manifest.
    pub(super) fn new(manifest: &RunManifest) -> Self {
        let from = manifest.reply_reading.as_deref();
        Self { from: from.unwrap_or(FIRST_REPLY_READING).to_owned(), ..Self::default() }
    }

    /// True if the replies were parsed by the rules of this version.
    pub(super) fn is_current(&self) -> bool {
        self.from == LENIENT_VERSION
    }

    /// Parses the replies of stored records again, and counts the changes.
    ///
    /// # Errors
    /// If a record cannot be read, or its choices are not valid.
    pub(super) fn with_records(mut self, records: impl IntoIterator<Item = Result<Record>>) -> Result<Self> {
        for record in records {
            let record = record?;
            self.add(&record.detail, &reread(record.clone())?.detail);
        }
        Ok(self)
    }

    /// Counts one reply, given its trial as parsed before and now. Ignores a trial without a reply.
    pub(super) fn add(&mut self, before: &ChoiceDetail, now: &ChoiceDetail) {
        let (Some(old), Some(new)) = (before.lenient, now.lenient) else {
            return;
        };
        self.replies += 1;
        self.changed += usize::from(old.chosen != new.chosen);
        if now.truth.is_some() {
            self.scored += 1;
            for (right, reading) in self.right.iter_mut().zip([old, new]) {
                *right += usize::from(reading.chosen == now.truth);
            }
        }
    }

    /// True if the parsed choice of any reply changes.
    pub(super) fn has_changed(&self) -> bool {
        self.changed > 0
    }

    /// The change in words: `lenient/3 reads 3 of 60 replies differently than lenient/2: the lenient accuracy is 45.0
    /// %, and was 50.0 %`.
    pub(super) fn words(&self) -> String {
        let change = format!(
            "{LENIENT_VERSION} reads {} of {} replies differently than {}",
            self.changed, self.replies, self.from
        );
        if self.scored == 0 && self.replies > 0 {
            return change;
        }
        let [before, now] = self.right.map(|right| 100.0 * right as f64 / self.scored.max(1) as f64);
        format!("{change}: the lenient accuracy is {now:.1} %, and was {before:.1} %")
    }
}
