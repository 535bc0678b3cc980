//! Settings in which the manifests of several runs differ: [`Setting`].

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::types::degradations::Kind;
use crate::types::flags::spelled_setting;
use crate::types::manifests::{JUDGES, RunManifest};

/// Settings by flag, as text.
pub(super) type Settings = BTreeMap<String, String>;

/// The field of the manifest of people's answers that holds the identity of the run whose images they saw.
const ASKED_ABOUT: &str = "people asked about";

/// Fields of an identity that decide the size and encoding of every image.
pub(super) const ENCODING: [&str; 3] = ["--max-side", "--image-size", "--image"];

/// Further fields of an identity that decide the pixels of images.
const PIXELS: [&str; 6] = [
    "--num-frames",
    "--degrade",
    "--sensor",
    "--seed",
    "synthesis",
    "enhancement",
];

/// Flags of the noise model, which are compared as the user wrote them.
const NOISE: [&str; 9] = [
    "profile", "amplify", "tone", "draws", "coupling", "camera", "gain", "ratio", "fixed",
];

/// The column of the kinds that the paper does not have.
const VARIANT: &str = "variant";

/// Stands between the flag of a setting and the value of a column for which it is set, as in `--llie of ruas`.
const OF: &str = " of ";

/// The value of a setting that a run does not have.
const UNSET: &str = "unset";

/// The longest value in a message, in letters; digests are shortened to their first eight.
const LONGEST: usize = 60;

/// A setting that differs between runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Setting {
    /// The flag, or the field of the manifest that has no flag.
    pub(super) flag: String,
    /// The value of each run that takes part, with the number of the run.
    pub(super) values: Vec<(usize, String)>,
}

impl Setting {
    /// The setting in words: `--seed is 0 in a and 1 in b`; `names` are those of the runs.
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
            .map(|(value, runs)| format!("{} in {}", short(value), listed(&runs)))
            .collect();
        format!("{} is {}", spelled_setting(&self.flag), listed(&values))
    }
}

/// Texts as a list in a sentence: `a`, `a and b`, `a, b and c`.
pub(super) fn listed<T: AsRef<str>>(texts: &[T]) -> String {
    let texts: Vec<&str> = texts.iter().map(AsRef::as_ref).collect();
    match &*texts {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// The settings that differ. A run without settings does not take part, nor does a run in the settings of a value that none of its
/// columns has.
pub(super) fn differing(runs: &[Option<Settings>]) -> Vec<Setting> {
    let flags: BTreeSet<&String> = runs.iter().flatten().flat_map(BTreeMap::keys).collect();
    flags
        .into_iter()
        .map(|flag| Setting {
            flag: flag.clone(),
            values: runs
                .iter()
                .enumerate()
                .filter_map(|(run, settings)| {
                    let settings = settings.as_ref()?;
                    let value = settings.get(flag).map(String::as_str);
                    let unset = takes_part(settings, flag).then_some(UNSET);
                    Some((run, value.or(unset)?.to_owned()))
                })
                .collect(),
        })
        .filter(|setting| {
            setting
                .values
                .iter()
                .any(|(_, v)| *v != setting.values[0].1)
        })
        .collect()
}

/// Whether a run that does not have a setting could have it: if the setting is of a value of a column, the run has the value.
fn takes_part(settings: &Settings, flag: &str) -> bool {
    flag.split_once(OF).is_none_or(|(_, value)| {
        let mut own = settings.keys().filter_map(|flag| flag.split_once(OF));
        own.any(|(_, own)| own == value)
    })
}

/// The identity of a run; that of people is the identity of the run whose images they saw.
pub(super) fn identity(run: &RunManifest) -> Settings {
    match run.identity.get(ASKED_ABOUT) {
        Some(Value::Object(asked)) => asked.iter().map(field).collect(),
        _ => run.identity.iter().map(field).collect(),
    }
}

/// Whether the records of a run are answers of people about the images of another run.
pub(crate) fn is_of_people(run: &RunManifest) -> bool {
    run.identity.contains_key(ASKED_ABOUT)
}

/// Some fields of an identity.
pub(super) fn some(run: &RunManifest, fields: &[&str]) -> Settings {
    let mut settings = identity(run);
    settings.retain(|flag, _| fields.contains(&flag.as_str()));
    settings
}

/// Everything in a manifest that decides images besides their size and encoding, for a comparison of these runs.
pub(super) fn light(run: &RunManifest, runs: &[&RunManifest]) -> Settings {
    let variants = column_settings(run, VARIANT);
    let parts = [pixels(run), noise(run, runs), variants, enhancers(run)];
    parts.into_iter().flatten().collect()
}

/// The settings of all degraded images.
pub(super) fn pixels(run: &RunManifest) -> Settings {
    some(run, &PIXELS)
}

/// The noise model, if the noise profiles of the runs differ: the flags as the user wrote them, and the content of the readings
/// that all runs have.
pub(super) fn noise(run: &RunManifest, runs: &[&RunManifest]) -> Settings {
    let readings = |run: &RunManifest| run.columns.get("reading").cloned();
    let own = readings(run);
    let mut others = runs.iter().filter_map(|other| readings(other));
    if own.is_none() || others.all(|other| Some(&other) == own.as_ref()) {
        return Settings::new();
    }
    let written = NOISE.iter().filter_map(|flag| {
        let value = run.images.get(*flag)?;
        Some((format!("--{flag}"), text(value)))
    });
    let mut settings: Settings = written.collect();
    // A default that is written out is another word for the same noise.
    settings.extend(column_settings(run, "reading"));
    settings
}

/// The content of the noise profiles, and of the kinds that the paper does not have.
pub(super) fn readings_and_variants(run: &RunManifest) -> Settings {
    let mut settings = column_settings(run, "reading");
    settings.extend(column_settings(run, VARIANT));
    settings
}

/// The content of the enhancers.
pub(super) fn enhancers(run: &RunManifest) -> Settings {
    column_settings(run, "enhancer")
}

/// The settings of a kind that the paper does not have; empty for the others.
pub(super) fn variant(run: &RunManifest, kind: Kind) -> Settings {
    let mut settings = column_settings(run, VARIANT);
    settings.retain(|flag, _| flag.ends_with(&format!("{OF}{kind}")));
    settings
}

/// The settings behind the values of a column of a run.
fn column_settings(run: &RunManifest, column: &str) -> Settings {
    let mut settings = Settings::new();
    for (name, content) in run.columns.get(column).into_iter().flatten() {
        settings.extend(leaves(content).map(|(flag, value)| (format!("{flag}{OF}{name}"), value)));
    }
    settings
}

/// The settings of the noise that the words of the user already explain are left out.
pub(super) fn without_repeated(mut settings: Vec<Setting>) -> Vec<Setting> {
    let is_written =
        |setting: &Setting| NOISE.iter().any(|flag| setting.flag == format!("--{flag}"));
    if settings.iter().any(is_written) {
        let is_noise = |setting: &Setting| {
            let flag = setting.flag.split(OF).next().unwrap_or_default();
            NOISE
                .iter()
                .any(|written| flag.contains(&format!("--{written}")))
        };
        settings.retain(|setting| !setting.flag.contains(OF) || !is_noise(setting));
    }
    settings
}

/// Settings that determine a model's replies besides question and images; `None` if the run does not have the model, or does not state them.
pub(super) fn parameters(run: &RunManifest, model: &str) -> Option<Settings> {
    let content = run.columns.get("model")?.get(model)?;
    // A model of this program answers by rules, and reads no prompt.
    let asked_by = if run.is_built_in(model) {
        "--rules"
    } else {
        "--prompts"
    };
    let shared = some(run, &[asked_by]);
    Some(decisive(content).into_iter().chain(shared).collect())
}

/// The settings of a model without its address and name.
pub(super) fn decisive(content: &Value) -> Settings {
    let settings = leaves(content);
    settings
        .filter(|(flag, _)| !["--base-url", "--model"].contains(&flag.as_str()))
        .collect()
}

/// The parameters of all models of a run that have flags: a flag with several values has all of them. `None` if no model has.
pub(super) fn parameter_flags(run: &RunManifest) -> Option<Settings> {
    let models = run.columns.get("model")?;
    let mut values = BTreeMap::<String, BTreeSet<String>>::new();
    let mut remote = 0;
    // A judge stands among the models, too, and has flags of its own.
    let judges = run.columns.get(JUDGES);
    let is_judge = |name: &String, content: &Value| {
        judges.and_then(|judges| judges.get(name)) == Some(content)
    };
    let asked = models
        .iter()
        .filter(|(name, content)| !is_judge(name, content));
    for content in asked
        .map(|(_, content)| content)
        .filter(|content| content.get("--base-url").is_some())
    {
        remote += 1;
        for (flag, value) in decisive(content) {
            values.entry(flag).or_default().insert(value);
        }
    }
    let joined = |values: BTreeSet<String>| values.into_iter().collect::<Vec<_>>().join(" or ");
    let values = values
        .into_iter()
        .map(|(flag, values)| (flag, joined(values)));
    (remote > 0).then(|| values.collect())
}

/// The address at which a run asks a model, without user, password and query.
pub(super) fn address(run: &RunManifest, model: &str) -> Option<String> {
    let content = run.columns.get("model")?.get(model)?;
    content.get("--base-url").map(text)
}

fn field((name, value): (&String, &Value)) -> (String, String) {
    (name.clone(), text(value))
}

/// The values in an object, each with its flag; objects in it are opened, and nulls are left out.
fn leaves(content: &Value) -> impl Iterator<Item = (String, String)> {
    let mut found = Vec::new();
    add_leaves("", content, &mut found);
    found.into_iter()
}

fn add_leaves(flag: &str, value: &Value, found: &mut Vec<(String, String)>) {
    match value {
        Value::Null => {}
        Value::Object(fields) => {
            for (name, value) in fields {
                let is_flag = flag.is_empty() || name.starts_with("--");
                let name = if is_flag {
                    name.clone()
                } else {
                    format!("{flag} ({name})")
                };
                add_leaves(&name, value, found);
            }
        }
        value => found.push((flag.to_owned(), text(value))),
    }
}

/// A value as text.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(text).collect::<Vec<_>>().join(","),
        other => other.to_string(),
    }
}

/// A value for a message: a digest by its first eight digits, a long text by its start.
pub(super) fn short(value: &str) -> String {
    if is_digest(value) {
        return format!("{}…", &value[..8]);
    }
    match value.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &value[..end]),
        None => value.to_owned(),
    }
}

/// Whether a text is a digest of 32 bytes.
pub(super) fn is_digest(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_says_each_value_once() {
        let settings = |value: Option<&str>| {
            let pair = value.map(|value| ("--seed".to_owned(), value.to_owned()));
            Some(pair.into_iter().collect::<Settings>())
        };
        let runs = [
            settings(Some("0")),
            settings(Some("1")),
            settings(Some("0")),
            None,
            settings(None),
        ];
        let names = ["a", "b", "c", "d", "e"].map(str::to_owned);
        let [setting] = &*differing(&runs) else {
            panic!("one setting differs");
        };
        assert_eq!(
            setting.words(&names),
            "--seed is 0 in a and c, 1 in b and unset in e"
        );
        assert!(differing(&[runs[0].clone(), runs[2].clone(), None]).is_empty());
    }

    #[test]
    fn digests_are_shortened_and_objects_are_opened() {
        let content = serde_json::json!({"--llie": "ab".repeat(32), "--camera": {"name": "a7", "gain": null}});
        let found: Vec<_> = leaves(&content)
            .map(|(flag, value)| (flag, short(&value)))
            .collect();
        let expected = [("--camera (name)", "a7"), ("--llie", "abababab…")];
        assert_eq!(
            found,
            expected.map(|(flag, value)| (flag.to_owned(), value.to_owned()))
        );
    }
}
