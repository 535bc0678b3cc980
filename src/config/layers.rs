//! Where a setting comes from: flag, environment, file.
//!
//! All three are read by the one parser of [`crate::cli`], so that a value is understood alike wherever it stands, and
//! its error names where that is.

use std::collections::{BTreeMap, BTreeSet};
use std::num::{NonZeroU64, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::{env, fs};

use clap::{Arg, ArgAction, CommandFactory, Parser};
use toml::{Table, Value};

use crate::cli::{
    Cli, DataArgs, EnhancementArgs, EvaluateArgs, LightArgs, ModelArgs, OutputArgs, ScaleArgs,
    SendingArgs, SensorArgs,
};
use crate::error::{Error, Result};

/// What every variable of the environment begins with.
const PREFIX: &str = "DARKQA_";

/// The flags whose one text is a list with commas: a file may write it as a list.
const WITH_COMMAS: [&str; 2] = ["levels", "families"];

/// What one place says.
#[derive(Debug, Default)]
struct Layer {
    said: EvaluateArgs,
    /// The switches that it turns off, by their fields; those that it turns on stand in `said`.
    off: BTreeSet<String>,
}

/// Fills what the flags leave open from the environment, and what that leaves open from the `--config` file.
///
/// # Errors
/// [`Error::Usage`] with the variable or the entry of the file that cannot be used.
pub fn merge(flags: EvaluateArgs) -> Result<EvaluateArgs> {
    let flags = Layer {
        said: flags,
        off: BTreeSet::new(),
    };
    let layer = or(flags, environment(|name| env::var(name).ok())?);
    let layer = match layer.said.output.config.clone() {
        Some(path) => or(layer, file(&path)?),
        None => layer,
    };
    Ok(layer.said)
}

/// The flags that other commands share with an evaluation, filled in like its own; the rest of them stays empty.
#[derive(Debug, Default)]
pub(super) struct Shared {
    pub(super) light: LightArgs,
    pub(super) sensor: SensorArgs,
    pub(super) threads: Option<NonZeroUsize>,
    pub(super) max_pixels: Option<NonZeroU64>,
    pub(super) config: Option<PathBuf>,
}

impl Shared {
    pub(super) fn merge(self) -> Result<Self> {
        let said = merge(EvaluateArgs {
            data: DataArgs {
                max_pixels: self.max_pixels,
                ..DataArgs::default()
            },
            light: self.light,
            sensor: self.sensor,
            enhancement: EnhancementArgs {
                threads: self.threads,
                ..EnhancementArgs::default()
            },
            output: OutputArgs {
                config: self.config,
                ..OutputArgs::default()
            },
            ..EvaluateArgs::default()
        })?;
        Ok(Self {
            light: said.light,
            sensor: said.sensor,
            threads: said.enhancement.threads,
            max_pixels: said.data.max_pixels,
            config: said.output.config,
        })
    }
}

/// Warns of variables that look like settings and are none.
pub(super) fn warn_of_strangers() {
    let names = env::vars_os().map(|(name, _)| name.to_string_lossy().into_owned());
    for name in strangers(names) {
        let flag = name[PREFIX.len()..].replace('_', "-").to_lowercase();
        tracing::warn!("{name}: there is no flag --{flag}, so this variable sets nothing");
    }
}

/// The variables that begin as settings do and name no flag.
fn strangers(names: impl Iterator<Item = String>) -> Vec<String> {
    let known: Vec<String> = flags().iter().map(|flag| variable(flag)).collect();
    let ours = names.filter(|name| name.starts_with(PREFIX));
    ours.filter(|name| !known.contains(name)).collect()
}

fn flags() -> Vec<String> {
    let command = Cli::command();
    let flags = command.get_arguments().filter_map(Arg::get_long);
    flags.map(str::to_owned).collect()
}

/// The variable of a flag.
fn variable(flag: &str) -> String {
    format!("{PREFIX}{}", flag.replace('-', "_").to_uppercase())
}

/// The flags that the environment sets: `DARKQA_MAX_TOKENS` is `--max-tokens`; a list is separated by commas.
fn environment(value: impl Fn(&str) -> Option<String>) -> Result<Layer> {
    let mut layer = Layer::default();
    for flag in flags() {
        let name = variable(&flag);
        if let Some(text) = value(&name).filter(|text| !text.is_empty()) {
            layer = or(layer, parse(&name, &flag, &split(&flag, &text))?);
        }
    }
    Ok(layer)
}

/// The flags that a TOML file sets: `max-tokens = 16`, `model = ["a", "b"]`, `blind = true`.
fn file(path: &Path) -> Result<Layer> {
    let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
    let table: Table = text.parse().map_err(|e| broken(path, &text, &e))?;
    let mut layer = Layer::default();
    for (key, value) in &table {
        let origin = format!("{}, {key}", path.display());
        let flag = key.replace('_', "-");
        if flag == "config" {
            return Err(Error::usage(
                origin,
                "a file of flags cannot name another; --config takes one file",
            ));
        }
        let texts = match value {
            Value::Array(values) => values.iter().map(text_of).collect(),
            single => text_of(single).map(|text| vec![text]),
        };
        let mut texts: Vec<String> = texts.ok_or_else(|| {
            Error::usage(
                &origin,
                "a text, a number, a switch or a list of them expected",
            )
        })?;
        if WITH_COMMAS.contains(&flag.as_str()) {
            texts = vec![texts.join(",")];
        }
        layer = or(layer, parse(&origin, &flag, &texts)?);
    }
    Ok(layer)
}

/// The flags that a table of them sets, as [`file`] reads them.
pub(super) fn read(
    origin: &str,
    table: &BTreeMap<String, serde_json::Value>,
) -> Result<EvaluateArgs> {
    let mut layer = Layer::default();
    for (flag, value) in table {
        let text = |value: &serde_json::Value| match value {
            serde_json::Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let texts: Vec<String> = match value {
            serde_json::Value::Array(values) => values.iter().map(text).collect(),
            single => vec![text(single)],
        };
        layer = or(layer, parse(&format!("{origin}, {flag}"), flag, &texts)?);
    }
    Ok(layer.said)
}

/// The first where it says something, else the second.
pub(super) fn above(first: EvaluateArgs, second: EvaluateArgs) -> EvaluateArgs {
    let layer = |said| Layer {
        said,
        off: BTreeSet::new(),
    };
    or(layer(first), layer(second)).said
}

/// What is wrong with a TOML file, in one line that names its own.
fn broken(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let before = error.span().and_then(|span| text.get(..span.start));
    let line = before.unwrap_or_default().matches('\n').count() + 1;
    let problem: Vec<&str> = error.message().lines().map(str::trim).collect();
    Error::line(path, line, format_args!("no TOML: {}", problem.join(", ")))
}

fn text_of(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Some(value.to_string()),
        _ => None,
    }
}

fn split(flag: &str, text: &str) -> Vec<String> {
    let list =
        argument(flag).is_some_and(|argument| matches!(argument.get_action(), ArgAction::Append));
    if list {
        text.split(',').map(str::to_owned).collect()
    } else {
        vec![text.to_owned()]
    }
}

fn argument(flag: &str) -> Option<Arg> {
    Cli::command()
        .get_arguments()
        .find(|argument| argument.get_long() == Some(flag))
        .cloned()
}

/// Reads one flag as if it had been typed; a switch can be turned off, too.
fn parse(origin: &str, flag: &str, values: &[String]) -> Result<Layer> {
    let argument = argument(flag)
        .ok_or_else(|| Error::usage(origin, format_args!("there is no flag --{flag}")))?;
    let mut off = BTreeSet::new();
    let words: Vec<String> = if matches!(argument.get_action(), ArgAction::SetTrue) {
        match values {
            [yes] if matches!(yes.as_str(), "1" | "true" | "yes") => vec![format!("--{flag}")],
            [no] if matches!(no.as_str(), "0" | "false" | "no") => {
                off.insert(flag.replace('-', "_"));
                Vec::new()
            }
            _ => return Err(Error::usage(origin, "true or false expected")),
        }
    } else {
        values
            .iter()
            .map(|value| format!("--{flag}={value}"))
            .collect()
    };
    let said = Cli::try_parse_from(std::iter::once("darkqa-eval".to_owned()).chain(words))
        .map_err(|e| Error::usage(origin, one_line(&e)))?
        .evaluate;
    Ok(Layer { said, off })
}

/// What clap says, in one line without its advice.
#[must_use]
pub fn one_line(error: &clap::Error) -> String {
    let text = error.to_string();
    let lines = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.is_empty());
    let line = lines.collect::<Vec<_>>().join(" ");
    line.trim_start_matches("error: ").to_owned()
}

/// The fields of one structure, each from the first of two where it is set there; a switch that is `$off` there is set.
macro_rules! first_set {
    ($kind:ident { $($single:ident),* ; $($list:ident),* ; $($switch:ident),* }, $first:expr, $second:expr, $off:expr) => {{
        let (first, second) = ($first, $second);
        $kind {
            $($single: first.$single.or(second.$single),)*
            $($list: if first.$list.is_empty() { second.$list } else { first.$list },)*
            $($switch: first.$switch || second.$switch && !$off.contains(stringify!($switch)),)*
        }
    }};
}

fn or(first: Layer, second: Layer) -> Layer {
    let (off, mut below) = (first.off, second.off);
    let (first, second) = (first.said, second.said);
    // A key named in one layer hides every other way to name one in the layers below.
    let mut model = second.model;
    if first.model.api_key_env.is_some() || first.model.api_key_file.is_some() {
        (model.api_key_env, model.api_key_file) = (None, None);
    }
    let mut output = second.output;
    if first.output.out.is_some() || first.output.resume.is_some() {
        (output.out, output.resume) = (None, None);
    }
    let said = EvaluateArgs {
        data: first_set!(
            DataArgs { data, questions, limit, families, repeats, max_pixels; ; shuffle_options, circular },
            first.data, second.data, off
        ),
        light: first_set!(LightArgs { levels, variant; ; }, first.light, second.light, off),
        sensor: first_set!(
            SensorArgs { seed, profile, amplify, tone, draws, coupling, camera, gain, ratio; ; fixed },
            first.sensor, second.sensor, off
        ),
        enhancement: first_set!(
            EnhancementArgs { llie_on, tile, llie_max_side, threads, ort_lib; llie; offline }, first.enhancement, second.enhancement, off
        ),
        model: first_set!(
            ModelArgs {
                base_url, api_key_env, api_key_file, key_header, ca_file, temperature, max_tokens, token_field, reasoning_effort, detail,
                constrain, prompts;
                model, blind_model;
                blind, allow_http
            },
            first.model, model, off
        ),
        sending: first_set!(
            SendingArgs {
                concurrency, rpm, tpm, timeout, retries, max_wait, image, max_side, max_image, max_failures, max_cost, prices;
                ;
                dry_run
            },
            first.sending, second.sending, off
        ),
        scale: first_set!(ScaleArgs { shard; ; timings }, first.scale, second.scale, off),
        output: first_set!(OutputArgs { out, resume, config; ; json, quiet }, first.output, output, off),
    };
    below.extend(off);
    Layer { said, off: below }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(words: &[&str]) -> Layer {
        let cli = Cli::try_parse_from(std::iter::once(&"darkqa-eval").chain(words)).unwrap();
        Layer {
            said: cli.evaluate,
            off: BTreeSet::new(),
        }
    }

    fn from_file(text: &str) -> Result<Layer> {
        let path = tempfile::NamedTempFile::new().unwrap();
        fs::write(path.path(), text).unwrap();
        file(path.path())
    }

    #[test]
    fn flags_go_before_the_environment_before_the_file() {
        let environment = environment(|name| match name {
            "DARKQA_SEED" => Some("2".into()),
            "DARKQA_GAIN" => Some("0.5".into()),
            "DARKQA_MODEL" => Some("a,b".into()),
            "DARKQA_BLIND" => Some("true".into()),
            _ => None,
        });
        let file =
            from_file("seed = 3\ngain = 1\nratio = 150\nmodel = [\"c\"]\nquiet = false\n").unwrap();
        let said = or(or(typed(&["--seed", "1"]), environment.unwrap()), file).said;
        assert_eq!(
            (said.sensor.seed, said.sensor.gain, said.sensor.ratio),
            (Some(1), Some(0.5), Some(150.0))
        );
        assert_eq!(
            (said.model.model, said.model.blind, said.output.quiet),
            (vec!["a".into(), "b".into()], true, false)
        );
    }

    #[test]
    fn the_first_to_speak_of_a_switch_decides() {
        let layer = |text: &str| match text {
            "" => Layer::default(),
            value => from_file(&format!("allow-http = {value}")).unwrap(),
        };
        for (layers, expected) in [
            (["false", "true", ""], false),
            (["", "false", "true"], false),
            (["true", "false", "false"], true),
            (["", "true", "false"], true),
            (["", "", ""], false),
        ] {
            let [first, second, third] = layers.map(layer);
            let said = or(or(first, second), third).said;
            assert_eq!(said.model.allow_http, expected, "{layers:?}");
        }
    }

    #[test]
    fn only_flags_are_variables() {
        let names = [
            "DARKQA_MAX_TOKENS",
            "DARKQA_MAX_TOKEN",
            "OPENAI_X",
            "DARKQA_",
            "DARKQA_seed",
        ];
        assert_eq!(
            strangers(names.into_iter().map(str::to_owned)),
            ["DARKQA_MAX_TOKEN", "DARKQA_", "DARKQA_seed"]
        );
    }

    #[test]
    fn a_wrong_value_names_where_it_stands() {
        let wrong = environment(|name| (name == "DARKQA_RETRIES").then(|| "many".into()))
            .unwrap_err()
            .to_string();
        assert!(
            wrong.starts_with("DARKQA_RETRIES: invalid value 'many'"),
            "{wrong}"
        );
        for (text, says) in [
            ("sed = 1", "sed: there is no flag --sed"),
            ("blind = 3", "true or false"),
            ("[seed]\na = 1", "a text, a number"),
        ] {
            let wrong = from_file(text).unwrap_err().to_string();
            assert!(wrong.contains(says), "{wrong}");
        }
    }
}
