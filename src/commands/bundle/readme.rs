//! The README of a bundle: [`readme`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use serde_json::{Value, json};

use darkqa_base::types::flags::keyed_form;
use darkqa_base::types::manifests::{RunManifest, judge_flag};
use darkqa_base::types::text::escape_hidden;
use darkqa_base::types::{AxisLevel, Trials, shell_word};
use darkqa_runs::stored::{AnyRun, text_setting};
use darkqa_score::answers::record::Detail;

/// Inputs of a README.
pub(super) struct ReadmeInputs<'a> {
    /// Name of the run and of its folder in the archive.
    pub(super) name: &'a str,
    /// Shell command that repeats the run, from [`command`].
    pub(super) command: &'a str,
    /// Findings and table by level, in Markdown.
    pub(super) findings: &'a str,
    /// Differences between the bundle and the run, such as omitted files; one line each.
    pub(super) changes: &'a [String],
    /// Name and size of each file; the size in bytes.
    pub(super) files: &'a [(String, usize)],
}

/// The text of the README in Markdown, with hidden characters escaped.
pub(super) fn readme(inputs: &ReadmeInputs<'_>) -> String {
    let mut text = inputs.findings.to_owned();
    let name = shell_word(inputs.name);
    text += "\n## Read it again\n\nBeside the unpacked folder, or with the ZIP file in its place:\n\n";
    text += &fenced(&format!("darkqa-eval report {name}"));
    text += "\nIn the folder, to check that nothing changed on the way:\n\n";
    text += &fenced("sha256sum --check SHA256SUMS");
    text += "\n## Ask again\n\n";
    text +=
        "The command that asks the same, as far as the manifest states it; replace `DIR/` by a folder of yours:\n\n";
    text += &fenced(inputs.command);
    text += "\n## Changed, or left out\n\n";
    if inputs.changes.is_empty() {
        text += "Nothing.\n";
    }
    for change in inputs.changes {
        let _ = writeln!(text, "- {change}");
    }
    text += "\n## Files\n\n| file | bytes |\n| --- | ---: |\n";
    for (name, size) in inputs.files {
        let _ = writeln!(text, "| `{name}` | {size} |");
    }
    escape_hidden(&text).into_owned()
}

/// Markdown code block of shell lines. Its fence is longer than any run of backticks in the lines.
fn fenced(lines: &str) -> String {
    let mut fence = "```".to_owned();
    while lines.contains(&fence) {
        fence.push('`');
    }
    format!("{fence}sh\n{lines}\n{fence}\n")
}

/// Levels and models in the trials of a run.
#[derive(Default)]
struct BundledRuns {
    levels: BTreeSet<AxisLevel>,
    /// Models asked with images.
    seeing: BTreeSet<String>,
    /// Models asked without images.
    blind: BTreeSet<String>,
}

impl BundledRuns {
    fn from_trials<D: Detail>(trials: &Trials<D>) -> Self {
        let mut asked = Self::default();
        for (model, condition) in trials.asked().into_iter().flatten() {
            match condition {
                None => asked.blind.insert(model.to_owned()),
                Some(condition) => {
                    asked.levels.insert(condition.level());
                    asked.seeing.insert(model.to_owned())
                }
            };
        }
        asked
    }
}

/// Shell command that repeats a run. Settings that the manifest does not record are missing from it.
pub(super) fn command(manifest: &RunManifest, run: &AnyRun) -> String {
    let mut words = vec!["darkqa-eval".to_owned()];
    let asked = match run {
        AnyRun::Choice(run) => BundledRuns::from_trials(&run.trials),
        AnyRun::Open(run) => {
            // The manifest has the digest of the questions, not their path.
            let questions = ["openeqa", "--questions", "DIR/questions.json"];
            words.extend(questions.map(str::to_owned));
            BundledRuns::from_trials(&run.trials)
        }
    };
    let judge = text_setting(manifest, "--judge");
    let remote = remote_models(manifest);
    let file = models_file(&remote, &asked, judge);
    let is_in_file = |model: &String| file.is_some() && remote.contains_key(model);
    if file.is_some() {
        words.extend(["--models", "models.toml"].map(str::to_owned));
    }
    for model in asked.seeing.iter().filter(|model| !is_control(model) && !is_in_file(model)) {
        words.extend(["--model".to_owned(), word(model)]);
    }
    for model in asked.blind.iter().filter(|model| !is_in_file(model)) {
        // A judge has trials without images, too, but is given with `--judge`.
        if Some(&**model) != judge {
            words.extend(["--blind-model".to_owned(), word(model)]);
        }
    }
    for flag in ["--judge", "--protocol"] {
        if let Some(value) = text_setting(manifest, flag) {
            words.extend([flag.to_owned(), word(value)]);
        }
    }
    let tested: Vec<&Value> = remote
        .iter()
        .filter(|(name, _)| Some(name.as_str()) != judge || asked.seeing.contains(**name))
        .map(|(_, content)| *content)
        .collect();
    if file.is_none() {
        words.extend(common_flags(&tested));
    }
    // Without a models file, the judge uses the address of the models by default.
    if let Some(content) = judge.and_then(|judge| remote.get(&judge.to_owned()))
        && (file.is_some()
            || tested.iter().any(|tested| tested["--base-url"] != content["--base-url"])
            || tested.is_empty())
    {
        words.extend(flag_words(&judge_flag("--base-url"), &content["--base-url"]));
    }
    for (flag, value) in &manifest.images {
        words.extend(flag_words(&format!("--{flag}"), value));
    }
    let levels: Vec<String> = asked.levels.iter().map(ToString::to_string).collect();
    if !levels.is_empty() {
        words.extend(["--levels".to_owned(), word(&levels.join(","))]);
    }
    let other_settings: Vec<String> = manifest
        .identity
        .iter()
        .filter(|(flag, value)| {
            // A string of 64 or more characters is a file's SHA-256 digest; the image flags have the file's path.
            let is_digest = value.as_str().is_some_and(|text| text.len() >= 64);
            let is_image_flag = manifest.images.contains_key(flag.trim_start_matches("--"));
            let is_written = words.contains(flag);
            flag.starts_with("--") && !is_image_flag && !is_written && !is_digest && *flag != "--data"
        })
        .flat_map(|(flag, value)| flag_words(flag, value))
        .collect();
    words.extend(other_settings);
    let command = words.join(" ");
    file.map_or(command.clone(), |file| format!("cat > models.toml <<'END'\n{file}END\n{command}"))
}

/// Settings of the models at endpoints, by model name.
fn remote_models(manifest: &RunManifest) -> BTreeMap<&String, &Value> {
    manifest
        .columns
        .get("model")
        .into_iter()
        .flatten()
        .filter(|(_, content)| content.get("--base-url").is_some())
        .collect()
}

/// Content of a models file (TOML) for a run; `None` if flags suffice.
///
/// Flags do not suffice if models differ in their settings, or if a model has another name in the run than at its
/// endpoint.
fn models_file(remote: &BTreeMap<&String, &Value>, asked: &BundledRuns, judge: Option<&str>) -> Option<String> {
    // Flags define a model that is only a judge.
    let models: Vec<(&String, &Value)> = remote
        .iter()
        .map(|(name, content)| (*name, *content))
        .filter(|(name, _)| Some(name.as_str()) != judge || asked.seeing.contains(*name))
        .collect();
    let first = without_id(models.first()?.1);
    if models.iter().all(|(name, content)| without_id(content) == first && content["--model"] == **name) {
        return None;
    }
    let mut text = String::new();
    for (name, content) in models {
        let view = match (asked.seeing.contains(name), asked.blind.contains(name)) {
            (true, true) => "both",
            (false, true) => "blind",
            _ => "image",
        };
        let _ = writeln!(text, "[[model]]\nname = {}\nview = \"{view}\"", json!(name));
        for (flag, value) in content.as_object().into_iter().flatten() {
            let value = match (flag.as_str(), value) {
                ("--base-url", Value::String(_)) => json!([value]),
                (_, Value::Null | Value::Object(_)) => continue,
                _ => value.clone(),
            };
            let key = match flag.as_str() {
                "--model" => "id",
                "--base-url" => "endpoints",
                "--sampling-seed" => "seed",
                "--omit-field" => "omit",
                flag => flag.trim_start_matches("--"),
            };
            let _ = writeln!(text, "{key} = {value}");
        }
    }
    Some(text)
}

/// Settings of a model, without its name at the endpoint (`--model`).
fn without_id(content: &Value) -> serde_json::Map<String, Value> {
    let mut content = content.as_object().cloned().unwrap_or_default();
    content.remove("--model");
    content
}

/// True if a model is a control of the built-in observer. `--model observer` includes its controls.
fn is_control(model: &str) -> bool {
    model.starts_with("observer:")
}

/// Shell words for the flags that have the same value for all models.
fn common_flags(models: &[&Value]) -> Vec<String> {
    let Some(first) = models.first().and_then(|first| first.as_object()) else {
        return Vec::new();
    };
    let shared: BTreeMap<&String, &Value> = first
        .iter()
        .filter(|(flag, value)| {
            flag.starts_with("--")
                && *flag != "--model"
                && models.iter().all(|other| other.get(flag.as_str()) == Some(value))
        })
        .collect();
    shared.into_iter().flat_map(|(flag, value)| flag_words(flag, value)).collect()
}

/// Shell words for a flag with its value. A list repeats the flag; null, false and objects give no words.
///
/// A flag with a keyed form is written as a key: `--noise gain=0.5` for `--gain`.
fn flag_words(flag: &str, value: &Value) -> Vec<String> {
    let text = match value {
        Value::Null | Value::Bool(false) | Value::Object(_) => return Vec::new(),
        Value::Array(values) => {
            return values.iter().flat_map(|value| flag_words(flag, value)).collect();
        }
        Value::Bool(true) => None,
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
    };
    let keyed = flag.strip_prefix("--").and_then(keyed_form);
    match (keyed, text) {
        (Some((parent, key)), None) => vec![format!("--{}", parent.name), key.to_owned()],
        // Commas separate keys, so the value of a key cannot contain one.
        (Some((parent, key)), Some(text)) if !text.contains(',') => {
            vec![format!("--{}", parent.name), word(&format!("{key}={text}"))]
        }
        (_, None) => vec![flag.to_owned()],
        (_, Some(text)) => vec![flag.to_owned(), word(&text)],
    }
}

fn word(text: &str) -> String {
    shell_word(text).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fence_outgrows_backticks_in_lines() {
        assert_eq!(fenced("a"), "```sh\na\n```\n");
        assert_eq!(fenced("a ``` b"), "````sh\na ``` b\n````\n");
    }

    #[test]
    fn flag_words_quote_and_repeat_values() {
        assert_eq!(flag_words("--x", &serde_json::json!("a b")), ["--x", "'a b'"]);
        assert_eq!(flag_words("--x", &serde_json::json!(["a", 2])), ["--x", "a", "--x", "2"]);
        assert_eq!(flag_words("--x", &serde_json::json!(true)), ["--x"]);
        assert!(flag_words("--x", &Value::Null).is_empty());
    }

    #[test]
    fn flag_words_use_keyed_forms() {
        let gain = flag_words("--gain", &serde_json::json!(0.5));
        assert_eq!(gain, ["--noise", "gain=0.5"]);
        let fixed = flag_words("--fixed", &serde_json::json!(true));
        assert_eq!(fixed, ["--noise", "fixed"]);
        let camera = flag_words("--camera", &serde_json::json!("a,b.toml"));
        assert_eq!(camera, ["--camera", "a,b.toml"]);
    }
}
