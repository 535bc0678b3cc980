//! [`RunManifest`]: the content of a run's `manifest.json`.
//!
//! [`RecordedNames`]: model names in a run's records that differ from those of its tables.
//!
//! [`StoredViews`]: the inputs that each model of a stored run was shown, from its manifest.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::enhancer_note::EnhancerNote;
use super::input_note::InputSummary;
use super::model_listing::ListedModel;
use crate::types::View;

/// The progress of a run, and how it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Running, or killed while it ran.
    Started,
    /// Every trial has a reply.
    Complete,
    /// Every trial was tried, but some failed.
    Incomplete,
    /// Interrupted by the user.
    Cancelled,
    /// Stopped because the next question could have exceeded `--max-cost`.
    OverBudget,
    /// Stopped by an error that would fail every further trial.
    Stopped,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OverBudget => f.write_str("over budget"),
            other => other.serialize(f),
        }
    }
}

/// Trial counts of a run: all trials, answered and failed ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// The number of all trials, tried or not.
    pub trials: usize,
    /// The number of trials with a reply.
    pub answered: usize,
    /// The number of trials without a reply after all retries.
    pub failed: usize,
}

impl Counts {
    /// Counts the outcomes of the stored trials. `trials` is the number of planned trials; `failed` has an entry for
    /// each stored trial, true if the trial failed.
    #[must_use]
    pub fn new(trials: usize, failed: impl IntoIterator<Item = bool>) -> Self {
        let (mut stored, mut failures) = (0, 0);
        for has_failed in failed {
            stored += 1;
            failures += usize::from(has_failed);
        }
        Self { trials, answered: stored - failures, failed: failures }
    }
}

/// The fields that differ between two maps of settings, with both values as text; a missing value is `unset`.
pub fn differences<'a>(
    one: &'a BTreeMap<String, Value>,
    other: &'a BTreeMap<String, Value>,
) -> impl Iterator<Item = (&'a str, String, String)> {
    let fields: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    fields.into_iter().filter_map(move |field| {
        let [first, second] =
            [one, other].map(|settings| settings.get(field).map_or("unset".to_owned(), ToString::to_string));
        (first != second).then_some((field.as_str(), first, second))
    })
}

/// The name of the column that defines the judges of open-ended answers.
pub const JUDGES: &str = "judge";

/// The judge's variant of a model flag, such as `--judge-temperature` for `--temperature`.
pub fn judge_flag(flag: &str) -> String {
    flag.replacen("--", "--judge-", 1)
}

/// A difference between the definitions of one column value in two runs, such as two addresses of the same model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnDifference<'a> {
    /// The column, such as `model`.
    pub column: &'a str,
    /// The value, such as `gpt-4o`.
    pub value: &'a str,
    /// The field of the definition that differs; usually a flag, such as `--base-url`.
    pub field: String,
    /// The field's content in the first run, or `unset`.
    pub first: String,
    /// The field's content in the second run, or `unset`.
    pub second: String,
}

impl RunManifest {
    /// Sets the counts and the resulting status: complete if all trials have a reply, else incomplete.
    pub fn set_counts(&mut self, counts: Counts) {
        self.counts = counts;
        self.status = if counts.answered == counts.trials { Status::Complete } else { Status::Incomplete };
    }

    /// False if equal images of both runs have other bytes, because their PNG files have other forms.
    #[must_use]
    pub fn has_same_image_bytes(&self, other: &Self) -> bool {
        let sends_png = |run: &Self| run.identity.get("--image").is_none_or(|format| format == "png");
        self.png == other.png || !sends_png(self) || !sends_png(other)
    }

    /// True if a model is built into this program; false if it runs at an endpoint or is unknown to the run.
    #[must_use]
    pub fn is_built_in(&self, model: &str) -> bool {
        self.columns
            .get("model")
            .and_then(|models| models.get(model))
            .is_some_and(|definition| definition.get("local").is_some())
    }

    /// The differences between the definitions of the column values that both runs have.
    #[must_use]
    pub fn column_differences<'a>(&'a self, other: &'a Self) -> Vec<ColumnDifference<'a>> {
        let mut found = Vec::new();
        for (column, values) in &self.columns {
            for (value, first) in values {
                let second = other.columns.get(column).and_then(|values| values.get(value));
                let Some(second) = second else {
                    continue;
                };
                let [first, second] = [first, second].map(fields);
                found.extend(differences(&first, &second).map(|(field, first, second)| ColumnDifference {
                    column,
                    value,
                    field: field.to_owned(),
                    first,
                    second,
                }));
            }
        }
        found
    }
}

/// The fields of a JSON object, without null values.
fn fields(object: &Value) -> BTreeMap<String, Value> {
    object
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(_, value)| !value.is_null())
        .map(|(field, value)| (field.clone(), value.clone()))
        .collect()
}

/// The range of sources (frames or walks) that a shard evaluates. The sources of the run are numbered in the order of
/// their first questions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartPlace {
    /// Index of the shard's first source, from 0.
    pub first: usize,
    /// Number of sources in the shard.
    pub count: usize,
    /// Number of sources in the whole run.
    pub of: usize,
}

/// The sources of a shard, and their numbers of trials.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunPart {
    /// The range of the shard's sources.
    #[serde(flatten)]
    pub place: PartPlace,
    /// Number of trials for each source of the shard.
    pub trials: Vec<usize>,
}

/// The form of the PNG files that are made for requests. The pixels are the same in all forms, the bytes are not. A run
/// keeps its form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PngForm {
    /// Each row has its own filter, and all images share one Huffman code; in runs of version 0.2.0 and earlier.
    #[default]
    Adaptive,
    /// Each image has one filter and its own Huffman code: half the time, and smaller files of dark and noisy images.
    Noise,
}

impl PngForm {
    /// The form of new runs.
    pub const NEWEST: Self = Self::Noise;

    /// True for the form of runs whose manifest names none.
    #[must_use]
    pub fn is_first(&self) -> bool {
        *self == Self::Adaptive
    }
}

/// The version of the lenient reply parser in runs whose manifest does not record one: they predate that field.
pub const FIRST_REPLY_READING: &str = "lenient/1";

/// The settings that apply to all trials of a run, by flag. Settings that vary within a run are in [`Columns`].
pub type Identity = BTreeMap<String, Value>;

/// The definitions of the values in the result tables, by column (such as `model`) and value (such as `gpt-4o`).
pub type Columns = BTreeMap<String, BTreeMap<String, Value>>;

/// The content of `manifest.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunManifest {
    /// The schema of the run's records: [`StoredDetail::SCHEMA`](crate::types::StoredDetail::SCHEMA).
    pub schema: String,
    /// The progress of the run.
    pub status: Status,
    /// The version of this program.
    pub version: String,
    /// The time when the run was created, in UTC.
    pub created: String,
    /// The time when the manifest was last written, in UTC.
    pub updated: String,
    /// The platform, and the versions of the libraries that process pixels.
    pub platform: BTreeMap<String, String>,
    /// The settings that apply to all trials, by flag. A run can only be resumed with the same identity.
    pub identity: Identity,
    /// The definitions of models, enhancers and noise profiles, by column and value. A resumed run may add values, but
    /// not redefine one.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: Columns,
    /// The models in the order of the models file; empty without a file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<ListedModel>,
    /// The use of each enhancer, by its name; empty in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub enhancers: BTreeMap<String, EnhancerNote>,
    /// The changes made to the images when their files were read; `None` without changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<InputSummary>,
    /// The shard of an evaluation, such as `2/4`; `None` for the whole evaluation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
    /// The sources and trial counts of the shard; `None` for the whole evaluation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<RunPart>,
    /// The settings that do not affect replies, such as concurrency and timeouts.
    pub settings: BTreeMap<String, Value>,
    /// The flags that determine the images, as the user wrote them; empty in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, Value>,
    /// The form of the PNG files that were made for requests.
    #[serde(default, skip_serializing_if = "PngForm::is_first")]
    pub png: PngForm,
    /// The version of the lenient reply parser that produced the records, such as `lenient/5`.
    ///
    /// `None` in runs of open-ended questions, and in runs of earlier versions of this program, which used
    /// [`FIRST_REPLY_READING`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply_reading: Option<String>,
    /// The trial counts.
    pub counts: Counts,
}

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

/// The key in a manifest's settings for the views of models that are asked without images.
const VIEWS: &str = "views of models";

/// Inputs shown to each model, by its name in tables.
pub type Views = BTreeMap<String, BTreeSet<View>>;

/// How the inputs of a stored model compare with those of a model in the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fit {
    /// No view in common: one is shown images alone, the other none.
    Disjoint,
    /// The manifest does not record the views.
    Unknown,
    /// One is asked with and without images, the other in one of these ways.
    Overlapping,
    /// The same views.
    Equal,
}

/// The inputs that the models of a stored run were shown, as far as its manifest records them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredViews {
    known: Views,
    /// True if the views of all models are known: a model that is not in `known` was shown images alone.
    is_complete: bool,
}

/// A model in the settings of an older manifest.
#[derive(Deserialize)]
struct ManifestModel {
    name: String,
    view: BTreeSet<View>,
}

impl StoredViews {
    /// Reads the views that a manifest records.
    pub fn from_manifest(manifest: &RunManifest) -> Self {
        if let Some(known) =
            manifest.settings.get(VIEWS).and_then(|value| serde_json::from_value::<Views>(value.clone()).ok())
        {
            return Self { known, is_complete: true };
        }
        // Older manifests contain only the models in the models file of the last command.
        let known = manifest
            .settings
            .get("models")
            .and_then(|models| serde_json::from_value::<Vec<ManifestModel>>(models.clone()).ok())
            .into_iter()
            .flatten()
            .map(|model| (model.name, model.view))
            .collect();
        Self { known, is_complete: false }
    }

    /// True if the manifest records the views of all models.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Compares the stored views of a model with those of a model in the command.
    pub fn compare(&self, stored: &str, now: &BTreeSet<View>) -> Fit {
        match self.views(stored) {
            None => Fit::Unknown,
            Some(views) if views == *now => Fit::Equal,
            Some(views) if views.is_disjoint(now) => Fit::Disjoint,
            Some(_) => Fit::Overlapping,
        }
    }

    /// Writes the views to a manifest: those of the stored models, each under its new name, and those of the command's
    /// models.
    pub fn write_to<'a>(
        &self,
        manifest: &mut RunManifest,
        stored: impl Iterator<Item = (&'a String, String)>,
        now: &Views,
    ) {
        let mut views = Views::new();
        for (name, new) in stored {
            views.entry(new).or_default().extend(self.views(name).into_iter().flatten());
        }
        for (name, shown) in now {
            views.entry(name.clone()).or_default().extend(shown);
        }
        views.retain(|_, views| views.contains(&View::Blind));
        if views.is_empty() {
            manifest.settings.remove(VIEWS);
        } else {
            manifest.settings.insert(VIEWS.to_owned(), json!(views));
        }
    }

    fn views(&self, name: &str) -> Option<BTreeSet<View>> {
        self.known.get(name).cloned().or_else(|| self.is_complete.then(|| BTreeSet::from([View::Image])))
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
