//! [`RecordedNames`]: model names in a run's records that differ from those of its tables.

use std::collections::BTreeMap;

use serde_json::json;

use super::manifest::RunManifest;

/// The key of the names in a manifest's settings.
const RENAMED: &str = "renamed models";

/// A map from model names in records to names in tables, for the names that differ.
///
/// Records are never changed. A name in records always refers to one model with one set of settings that decide its
/// replies. If a model is renamed, or another model takes its name, it keeps its records.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RecordedNames(BTreeMap<String, String>);

impl RecordedNames {
    /// Reads the names from a manifest.
    pub fn from_manifest(manifest: &RunManifest) -> Self {
        let names = manifest.settings.get(RENAMED).and_then(|names| serde_json::from_value(names.clone()).ok());
        Self(names.unwrap_or_default())
    }

    /// Writes the names to a manifest.
    pub fn write_to(&self, manifest: &mut RunManifest) {
        if self.0.is_empty() {
            manifest.settings.remove(RENAMED);
        } else {
            manifest.settings.insert(RENAMED.to_owned(), json!(self.0));
        }
    }

    /// The name in tables of a name in records.
    pub fn table_name<'n>(&'n self, recorded: &'n str) -> &'n str {
        self.0.get(recorded).map_or(recorded, String::as_str)
    }

    /// The name in records of a name in tables: the same, unless records use it for another model.
    pub fn record_name<'n>(&'n self, name: &'n str) -> &'n str {
        if self.table_name(name) == name {
            return name;
        }
        self.other_record_name(name).unwrap_or(name)
    }

    /// Renames models in tables, from old name to new name, all at once.
    pub fn rename(&mut self, moves: &BTreeMap<String, String>) {
        for name in moves.keys() {
            self.0.entry(name.clone()).or_insert_with(|| name.clone());
        }
        for name in self.0.values_mut() {
            if let Some(new) = moves.get(name) {
                name.clone_from(new);
            }
        }
        self.0.retain(|recorded, name| recorded != name);
    }

    /// Makes sure that a name in tables has a name in records: `spare` if records use the same name for another model.
    pub fn ensure(&mut self, name: &str, spare: impl FnOnce() -> String) {
        if self.table_name(name) != name && self.other_record_name(name).is_none() {
            self.0.insert(spare(), name.to_owned());
        }
    }

    /// A different name in records that is shown under this name in tables.
    fn other_record_name(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(_, shown)| *shown == name).map(|(recorded, _)| recorded.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(names: &mut RecordedNames, moves: &[(&str, &str)]) {
        let moves = moves.iter().map(|(old, new)| ((*old).to_owned(), (*new).to_owned()));
        names.rename(&moves.collect());
    }

    #[test]
    fn record_names_keep_their_model_after_renaming() {
        let mut names = RecordedNames::default();
        moved(&mut names, &[("m", "m (before)")]);
        names.ensure("m", || "m [1]".to_owned());
        assert_eq!((names.table_name("m"), names.record_name("m")), ("m (before)", "m [1]"));
        assert_eq!(names.table_name("m [1]"), "m");
        // Rename back and forth again.
        moved(&mut names, &[("m (before)", "m"), ("m", "m (before)")]);
        assert_eq!((names.table_name("m"), names.record_name("m")), ("m", "m"));
        assert_eq!(names.table_name("m [1]"), "m (before)");
        assert_eq!(names.record_name("m (before)"), "m [1]");
        moved(&mut names, &[("m (before)", "m"), ("m", "m (before)")]);
        names.ensure("m", || unreachable!());
        assert_eq!((names.table_name("m"), names.record_name("m")), ("m (before)", "m [1]"));
    }

    #[test]
    fn renaming_applies_to_earlier_records() {
        let mut names = RecordedNames::default();
        moved(&mut names, &[("a", "b")]);
        moved(&mut names, &[("b", "c")]);
        assert_eq!((names.table_name("a"), names.table_name("b"), names.table_name("c")), ("c", "c", "c"));
        assert_eq!(names.record_name("c"), "c");
        moved(&mut names, &[("c", "a")]);
        assert_eq!((names.table_name("a"), names.table_name("b")), ("a", "a"));
    }
}
