//! The stored run that a command continues, and the settings of models that may change in it: [`Continuation`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::Value;

use crate::ask::{ChangedSetting, Parameters};
use crate::runs::changed_settings::{CHANGED_FOR, REFUSED_FOR, changes, key, strings};
use crate::store;
use crate::types::manifests::{Columns, JUDGES};

/// Flags whose values may change after replies if a server refused them: they decide how a reply is drawn, not what is
/// asked.
const SAMPLING: [&str; 5] = ["--temperature", "--top-p", "--sampling-seed", "--max-tokens", "--wire"];

/// The run in the folder of a command; empty without one, or if its manifest cannot be read, which opening the folder
/// reports.
#[derive(Debug, Default)]
pub(crate) struct Continuation {
    /// Columns of its manifest.
    pub(crate) columns: Columns,
    /// Settings of its manifest.
    pub(crate) settings: BTreeMap<String, Value>,
    /// Its folder; `None` without one.
    pub(crate) folder: Option<PathBuf>,
}

impl Continuation {
    /// Settings of a model (or judge) that continue the run's under its trial keys; `None` if they are equal, or belong
    /// to another run.
    ///
    /// They may differ in a larger token limit, in sampling settings that the server refused, and in everything if the
    /// run has no reply of the model (`free_without_replies`).
    pub(crate) fn accept(
        &self,
        column: &str,
        name: &str,
        own: &Parameters,
        free_without_replies: bool,
    ) -> Option<Parameters> {
        let stored = self.columns.get(column)?.get(name)?;
        if let Some(grown) = own.raised_from_column(stored) {
            return Some(grown);
        }
        let changed = own.changes_from_column(stored);
        if changed.is_empty() {
            return None;
        }
        let is_judge = column == JUDGES;
        let noted = changes(self.settings.get(&key(CHANGED_FOR, name, is_judge)));
        let refused = strings(self.settings.get(&key(REFUSED_FOR, name, is_judge)));
        let is_permitted = |change: &ChangedSetting| {
            let is_forced = SAMPLING.contains(&&*change.flag) && refused.contains(&change.flag);
            is_forced || is_grown_limit(change) || noted.iter().any(|known| known.sets_the_same(change))
        };
        let after = self.replies(name);
        let is_free = free_without_replies && after == Some(0);
        if !is_free && !changed.iter().all(is_permitted) {
            return None;
        }
        let mut all = noted;
        for change in changed {
            let last = all.iter().rfind(|known| known.flag == change.flag);
            if !last.is_some_and(|last| last.sets_the_same(&change)) {
                all.push(ChangedSetting { after: after.unwrap_or_default(), ..change });
            }
        }
        Some(own.continuing(stored, all))
    }

    /// Number of replies of a model in the run; `None` if a batch may bring more or they cannot be read.
    fn replies(&self, name: &str) -> Option<usize> {
        let folder = self.folder.as_ref()?;
        if store::has_batches(folder) {
            return None;
        }
        store::reply_count(folder, name).ok()
    }
}

/// True for a larger token limit, which asks truncated replies again.
fn is_grown_limit(change: &ChangedSetting) -> bool {
    let (first, now) = (change.first.as_u64(), change.now.as_u64());
    change.flag == "--max-tokens" && first.is_some() && now > first
}
