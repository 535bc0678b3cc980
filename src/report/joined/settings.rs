//! Comparison of the settings in the manifests of several runs: [`differing_settings`] returns each [`Setting`] that
//! differs.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use darkqa_base::types::degradations::Kind;
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::manifests::{JUDGES, RunManifest};

/// Values of settings as text, by flag.
pub(super) type FlagValues = BTreeMap<String, String>;

/// Manifest field of human answers, with the identity of the run whose images people saw.
const ASKED_ABOUT: &str = "people asked about";

/// Fields of a run's identity that determine the size and encoding of every image.
pub(super) const ENCODING: [&str; 3] = ["--max-side", "--image-size", "--image"];

/// Other fields of a run's identity that determine the pixels of images.
const PIXEL_FIELDS: [&str; 6] = ["--num-frames", "--degrade", "--sensor", "--seed", "synthesis", "enhancement"];

/// Flags of the noise model, without `--`; compared as the user wrote them.
const NOISE_FLAGS: [&str; 9] = ["profile", "amplify", "tone", "draws", "coupling", "camera", "gain", "ratio", "fixed"];

/// Manifest column of the degradation kinds that are not in the paper.
const VARIANT: &str = "variant";

/// Separator between a flag and the column value that it is set for, as in `--llie of ruas`.
const OF: &str = " of ";

/// Value of a setting that a run does not have.
const UNSET: &str = "unset";

/// Maximum length of a value in a message, in characters.
const MAX_VALUE_CHARS: usize = 60;

/// Setting that differs between runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Setting {
    /// Flag, or name of a manifest field if the setting has no flag.
    pub(super) flag: String,
    /// Index and value of each run that the setting applies to.
    pub(super) values: Vec<(usize, String)>,
}

impl Setting {
    /// Describes the difference: `--seed is 0 in a and 1 in b`. `names` are the names of all runs, by index.
    pub(super) fn words(&self, names: &[String]) -> String {
        let mut by_value: Vec<(&str, Vec<&str>)> = Vec::new();
        for (run, value) in &self.values {
            let name = &*names[*run];
            match by_value.iter_mut().find(|(known, _)| known == value) {
                Some((_, runs)) => runs.push(name),
                None => by_value.push((value, vec![name])),
            }
        }
        let values: Vec<String> = by_value
            .into_iter()
            .map(|(value, runs)| format!("{} in {}", shorten(value), joined_with_and(&runs)))
            .collect();
        format!("{} is {}", setting_spelling(&self.flag), joined_with_and(&values))
    }
}

/// Joins texts for a sentence: `a`, `a and b`, `a, b and c`.
pub(super) fn joined_with_and<T: AsRef<str>>(texts: &[T]) -> String {
    let texts: Vec<&str> = texts.iter().map(AsRef::as_ref).collect();
    match &*texts {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Settings whose values differ between runs. Runs that are `None` are skipped. A setting of a column value is compared
/// only between runs that have the value.
pub(super) fn differing_settings(runs: &[Option<FlagValues>]) -> Vec<Setting> {
    let flags: BTreeSet<&String> = runs.iter().flatten().flat_map(BTreeMap::keys).collect();
    flags
        .into_iter()
        .map(|flag| Setting {
            flag: flag.clone(),
            values: runs
                .iter()
                .enumerate()
                .filter_map(|(run, settings)| Some((run, value_or_unset(settings.as_ref()?, flag)?)))
                .collect(),
        })
        .filter(|setting| setting.values.iter().any(|(_, v)| *v != setting.values[0].1))
        .collect()
}

/// Value of a setting; [`UNSET`] if the run does not have it. `None` if the setting belongs to a column value that the
/// run does not have.
fn value_or_unset(settings: &FlagValues, flag: &str) -> Option<String> {
    if let Some(value) = settings.get(flag) {
        return Some(value.clone());
    }
    let applies = flag
        .split_once(OF)
        .is_none_or(|(_, value)| settings.keys().filter_map(|flag| flag.split_once(OF)).any(|(_, own)| own == value));
    applies.then(|| UNSET.to_owned())
}

/// Identity of a run; for human answers, the identity of the run whose images people saw.
pub(super) fn identity_settings(run: &RunManifest) -> FlagValues {
    match run.identity.get(ASKED_ABOUT) {
        Some(Value::Object(asked)) => asked.iter().map(|(name, value)| field(name, value)).collect(),
        _ => run.identity.iter().map(|(name, value)| field(name, value)).collect(),
    }
}

/// True if the records of a run are human answers about the images of another run.
pub(super) fn has_human_answers(run: &RunManifest) -> bool {
    run.identity.contains_key(ASKED_ABOUT)
}

/// Selected fields of a run's identity.
pub(super) fn identity_fields(run: &RunManifest, fields: &[&str]) -> FlagValues {
    let mut settings = identity_settings(run);
    settings.retain(|flag, _| fields.contains(&flag.as_str()));
    settings
}

/// Settings of a run that determine its images, except size and encoding. Noise settings are included only if the noise
/// profiles of `runs` differ.
pub(super) fn light_settings(run: &RunManifest, runs: &[&RunManifest]) -> FlagValues {
    let variants = column_settings(run, VARIANT);
    let parts = [pixel_settings(run), noise_settings(run, runs), variants, enhancer_settings(run)];
    parts.into_iter().flatten().collect()
}

/// Settings that determine the pixels of all degraded images.
pub(super) fn pixel_settings(run: &RunManifest) -> FlagValues {
    identity_fields(run, &PIXEL_FIELDS)
}

/// Noise settings of a run: the flags as the user wrote them, and the content of its noise profiles. Empty if the noise
/// profiles of `runs` are equal, or if this run has none.
pub(super) fn noise_settings(run: &RunManifest, runs: &[&RunManifest]) -> FlagValues {
    let own = noise_profiles(run);
    // Equal profiles are the same noise, even if only one run writes out a default.
    let are_equal = runs.iter().filter_map(|other| noise_profiles(other)).all(|other| Some(&other) == own.as_ref());
    if own.is_none() || are_equal {
        return FlagValues::new();
    }
    let mut settings: FlagValues = NOISE_FLAGS
        .iter()
        .filter_map(|flag| {
            let value = run.images.get(*flag)?;
            Some((format!("--{flag}"), text(value)))
        })
        .collect();
    settings.extend(column_settings(run, "reading"));
    settings
}

fn noise_profiles(run: &RunManifest) -> Option<BTreeMap<String, Value>> {
    run.columns.get("reading").cloned()
}

/// Settings of the noise profiles and of the degradation kinds that are not in the paper.
pub(super) fn profile_and_variant_settings(run: &RunManifest) -> FlagValues {
    let mut settings = column_settings(run, "reading");
    settings.extend(column_settings(run, VARIANT));
    settings
}

/// Settings of the enhancers.
pub(super) fn enhancer_settings(run: &RunManifest) -> FlagValues {
    column_settings(run, "enhancer")
}

/// Settings of a degradation kind that is not in the paper; empty for other kinds.
pub(super) fn variant_settings(run: &RunManifest, kind: Kind) -> FlagValues {
    let mut settings = column_settings(run, VARIANT);
    settings.retain(|flag, _| flag.ends_with(&format!("{OF}{kind}")));
    settings
}

/// Settings of all values in a manifest column, each as `FLAG of VALUE`.
fn column_settings(run: &RunManifest, column: &str) -> FlagValues {
    let mut settings = FlagValues::new();
    for (name, content) in run.columns.get(column).into_iter().flatten() {
        settings.extend(leaves(content).map(|(flag, value)| (format!("{flag}{OF}{name}"), value)));
    }
    settings
}

/// Removes the noise settings of column values if a noise flag differs, because the flag already explains them.
pub(super) fn without_explained(mut settings: Vec<Setting>) -> Vec<Setting> {
    let noise_flags = NOISE_FLAGS.map(|flag| format!("--{flag}"));
    if settings.iter().any(|setting| noise_flags.contains(&setting.flag)) {
        settings.retain(|setting| match setting.flag.split_once(OF) {
            Some((flag, _)) => !noise_flags.iter().any(|noise| flag.contains(noise)),
            None => true,
        });
    }
    settings
}

/// Settings that determine a model's replies, except question and images. `None` if the manifest does not have the
/// model.
pub(super) fn model_settings(run: &RunManifest, model: &str) -> Option<FlagValues> {
    let content = run.columns.get("model")?.get(model)?;
    // A built-in model answers by rules and reads no prompt.
    let asked_by = if run.is_built_in(model) { "--rules" } else { "--prompts" };
    let shared = identity_fields(run, &[asked_by]);
    Some(reply_settings(content).into_iter().chain(shared).collect())
}

/// Settings of a model, without its base URL and name.
pub(super) fn reply_settings(content: &Value) -> FlagValues {
    leaves(content).filter(|(flag, _)| !["--base-url", "--model"].contains(&flag.as_str())).collect()
}

/// Settings of all models of a run that have a base URL, without judges; different values of a flag are joined with
/// "or". `None` if the run has no such model.
pub(super) fn remote_model_settings(run: &RunManifest) -> Option<FlagValues> {
    let models = run.columns.get("model")?;
    let mut values = BTreeMap::<String, BTreeSet<String>>::new();
    let mut has_remote = false;
    // Judges are listed among the models, but have flags of their own.
    let judges = run.columns.get(JUDGES);
    for (name, content) in models {
        let is_judge = judges.and_then(|judges| judges.get(name)) == Some(content);
        if is_judge || content.get("--base-url").is_none() {
            continue;
        }
        has_remote = true;
        for (flag, value) in reply_settings(content) {
            values.entry(flag).or_default().insert(value);
        }
    }
    has_remote.then(|| {
        values
            .into_iter()
            .map(|(flag, values)| {
                let values: Vec<String> = values.into_iter().collect();
                (flag, values.join(" or "))
            })
            .collect()
    })
}

/// Base URL at which a run asks a model, without user, password and query.
pub(super) fn base_url(run: &RunManifest, model: &str) -> Option<String> {
    let content = run.columns.get("model")?.get(model)?;
    content.get("--base-url").map(text)
}

fn field(name: &str, value: &Value) -> (String, String) {
    (name.to_owned(), text(value))
}

/// Values in an object with their flags, including the values of nested objects; nulls are omitted.
fn leaves(content: &Value) -> impl Iterator<Item = (String, String)> {
    let mut found = Vec::new();
    add_leaves("", content, &mut found);
    found.into_iter()
}

/// Adds the values in `value` to `found`, under `flag` and the names of nested fields.
fn add_leaves(flag: &str, value: &Value, found: &mut Vec<(String, String)>) {
    match value {
        Value::Null => {}
        Value::Object(fields) => {
            for (name, value) in fields {
                let is_flag = flag.is_empty() || name.starts_with("--");
                let name = if is_flag { name.clone() } else { format!("{flag} ({name})") };
                add_leaves(&name, value, found);
            }
        }
        value => found.push((flag.to_owned(), text(value))),
    }
}

/// Converts a value to text, an array to a comma-separated list.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(text).collect::<Vec<_>>().join(","),
        other => other.to_string(),
    }
}

/// Shortens a value for a message: a digest to its first eight digits, a long text to its start.
pub(super) fn shorten(value: &str) -> String {
    if is_digest(value) {
        return format!("{}…", &value[..8]);
    }
    match value.char_indices().nth(MAX_VALUE_CHARS) {
        Some((end, _)) => format!("{}…", &value[..end]),
        None => value.to_owned(),
    }
}

/// True if a text is a digest of 32 bytes in hexadecimal.
pub(super) fn is_digest(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seed_settings(value: &str) -> FlagValues {
        FlagValues::from([("--seed".to_owned(), value.to_owned())])
    }

    #[test]
    fn setting_lists_each_value_once() {
        let runs = [
            Some(seed_settings("0")),
            Some(seed_settings("1")),
            Some(seed_settings("0")),
            None,
            Some(FlagValues::new()),
        ];
        let names = ["a", "b", "c", "d", "e"].map(str::to_owned);
        let [setting] = &*differing_settings(&runs) else {
            panic!("one setting differs");
        };
        assert_eq!(setting.words(&names), "--seed is 0 in a and c, 1 in b and unset in e");
        assert!(differing_settings(&[runs[0].clone(), runs[2].clone(), None]).is_empty());
    }

    #[test]
    fn digests_are_shortened_and_objects_flattened() {
        let content = serde_json::json!({"--llie": "ab".repeat(32), "--camera": {"name": "a7", "gain": null}});
        let found: Vec<_> = leaves(&content).map(|(flag, value)| (flag, shorten(&value))).collect();
        let expected = [("--camera (name)", "a7"), ("--llie", "abababab…")];
        assert_eq!(found, expected.map(|(flag, value)| (flag.to_owned(), value.to_owned())));
    }
}
