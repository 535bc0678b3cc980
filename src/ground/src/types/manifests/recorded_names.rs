//! [`RecordedNames`]: model names in a run's records that differ from those of its tables.

use std::collections::BTreeMap;

use serde_json::json;

use super::manifest::RunManifest;

/// The entry of a manifest's settings that holds the names.
const RENAMED: &str = "renamed models";

/// The name in tables of each name in records. A name that is not among them is the same in both.
///
/// Records are never changed. A name in records always stands for one model with one set of settings that decide its replies; a
/// model that gets another name, or whose name another one gets, keeps its records.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RecordedNames(BTreeMap<String, String>);

impl RecordedNames {
    /// The names that a manifest holds.
    pub fn from_manifest(manifest: &RunManifest) -> Self {
        let names = manifest.settings.get(RENAMED).cloned();
        Self(
            names
                .and_then(|names| serde_json::from_value(names).ok())
                .unwrap_or_default(),
        )
    }

    /// Puts the names into a manifest.
    pub fn note(&self, manifest: &mut RunManifest) {
        if self.0.is_empty() {
            manifest.settings.remove(RENAMED);
        } else {
            manifest.settings.insert(RENAMED.to_owned(), json!(self.0));
        }
    }

    /// The name in tables of a name in records.
    pub fn shown<'n>(&'n self, recorded: &'n str) -> &'n str {
        self.0.get(recorded).map_or(recorded, String::as_str)
    }

    /// The name in records of a name in tables: the same, unless it stands for another model there.
    pub fn recorded<'n>(&'n self, shown: &'n str) -> &'n str {
        if self.shown(shown) == shown {
            return shown;
        }
        self.other(shown).unwrap_or(shown)
    }

    /// Gives models other names in tables, all at once.
    pub fn rename(&mut self, moves: &BTreeMap<String, String>) {
        let same: Vec<&String> = moves
            .keys()
            .filter(|name| !self.0.contains_key(*name))
            .collect();
        let same: Vec<(String, String)> = same
            .into_iter()
            .map(|name| (name.clone(), name.clone()))
            .collect();
        self.0.extend(same);
        for shown in self.0.values_mut() {
            if let Some(new) = moves.get(shown) {
                shown.clone_from(new);
            }
        }
        self.0.retain(|recorded, shown| recorded != shown);
    }

    /// Makes sure that a name in tables has one in records: `spare` if its own stands for another model.
    pub fn ensure(&mut self, shown: &str, spare: impl FnOnce() -> String) {
        if self.shown(shown) != shown && self.other(shown).is_none() {
            self.0.insert(spare(), shown.to_owned());
        }
    }

    fn other(&self, shown: &str) -> Option<&str> {
        self.0
            .iter()
            .find(|(_, name)| *name == shown)
            .map(|(name, _)| name.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(names: &mut RecordedNames, moves: &[(&str, &str)]) {
        let moves = moves
            .iter()
            .map(|(old, new)| ((*old).to_owned(), (*new).to_owned()));
        names.rename(&moves.collect());
    }

    #[test]
    fn a_name_in_records_stands_for_one_model_whatever_it_is_called() {
        let mut names = RecordedNames::default();
        moved(&mut names, &[("m", "m (before)")]);
        names.ensure("m", || "m [1]".to_owned());
        assert_eq!(
            (names.shown("m"), names.recorded("m")),
            ("m (before)", "m [1]")
        );
        assert_eq!(names.shown("m [1]"), "m");
        // Rename back and forth again.
        moved(&mut names, &[("m (before)", "m"), ("m", "m (before)")]);
        assert_eq!((names.shown("m"), names.recorded("m")), ("m", "m"));
        assert_eq!(names.shown("m [1]"), "m (before)");
        assert_eq!(names.recorded("m (before)"), "m [1]");
        moved(&mut names, &[("m (before)", "m"), ("m", "m (before)")]);
        names.ensure("m", || unreachable!());
        assert_eq!(
            (names.shown("m"), names.recorded("m")),
            ("m (before)", "m [1]")
        );
    }

    #[test]
    fn a_new_name_is_that_of_old_records_too() {
        let mut names = RecordedNames::default();
        moved(&mut names, &[("a", "b")]);
        moved(&mut names, &[("b", "c")]);
        assert_eq!(
            (names.shown("a"), names.shown("b"), names.shown("c")),
            ("c", "c", "c")
        );
        assert_eq!(names.recorded("c"), "c");
        moved(&mut names, &[("c", "a")]);
        assert_eq!((names.shown("a"), names.shown("b")), ("a", "a"));
    }
}
