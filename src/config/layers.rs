//! Where a setting comes from: flag, environment, file.
//!
//! All three are read by the one parser of [`crate::cli`], so that a value is understood alike wherever it stands, and
//! its error names where that is.

use std::path::Path;
use std::{env, fs};

use clap::{Arg, ArgAction, CommandFactory, Parser};
use toml::{Table, Value};

use crate::cli::{
    Cli, DataArgs, EnhancementArgs, EvaluateArgs, LightArgs, ModelArgs, OutputArgs, SendingArgs,
};
use crate::error::{Error, Result};

/// What every variable of the environment begins with.
const PREFIX: &str = "DARKQA_";

/// Fills what the flags leave open from the environment, and what that leaves open from the `--config` file.
pub(super) fn merge(flags: EvaluateArgs) -> Result<EvaluateArgs> {
    let said = or(flags, environment(|name| env::var(name).ok())?);
    match said.output.config.clone() {
        Some(path) => Ok(or(said, file(&path)?)),
        None => Ok(said),
    }
}

/// The flags that the environment sets: `DARKQA_MAX_TOKENS` is `--max-tokens`; a list is separated by commas.
fn environment(variable: impl Fn(&str) -> Option<String>) -> Result<EvaluateArgs> {
    let mut said = EvaluateArgs::default();
    for flag in Cli::command().get_arguments().filter_map(Arg::get_long) {
        let name = format!("{PREFIX}{}", flag.replace('-', "_").to_uppercase());
        if let Some(text) = variable(&name).filter(|text| !text.is_empty()) {
            said = or(said, parse(&name, flag, &split(flag, &text))?);
        }
    }
    Ok(said)
}

/// The flags that a TOML file sets: `max-tokens = 16`, `model = ["a", "b"]`, `blind = true`.
fn file(path: &Path) -> Result<EvaluateArgs> {
    let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
    let table: Table = text
        .parse()
        .map_err(|e: toml::de::Error| Error::data(path.display(), e.to_string().trim_end()))?;
    let mut said = EvaluateArgs::default();
    for (key, value) in &table {
        let origin = format!("{}, {key}", path.display());
        let texts = match value {
            Value::Array(values) => values.iter().map(text_of).collect(),
            single => text_of(single).map(|text| vec![text]),
        };
        let texts = texts.ok_or_else(|| {
            Error::usage(
                &origin,
                "a text, a number, a switch or a list of them expected",
            )
        })?;
        said = or(said, parse(&origin, &key.replace('_', "-"), &texts)?);
    }
    Ok(said)
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

/// Reads one flag as if it had been typed.
fn parse(origin: &str, flag: &str, values: &[String]) -> Result<EvaluateArgs> {
    let argument = argument(flag)
        .ok_or_else(|| Error::usage(origin, format_args!("there is no flag --{flag}")))?;
    let words: Vec<String> = if matches!(argument.get_action(), ArgAction::SetTrue) {
        match values {
            [yes] if matches!(yes.as_str(), "1" | "true" | "yes") => vec![format!("--{flag}")],
            [no] if matches!(no.as_str(), "0" | "false" | "no") => Vec::new(),
            _ => return Err(Error::usage(origin, "true or false expected")),
        }
    } else {
        values
            .iter()
            .map(|value| format!("--{flag}={value}"))
            .collect()
    };
    let said = Cli::try_parse_from(std::iter::once("darkqa-eval".to_owned()).chain(words));
    said.map(|cli| cli.evaluate)
        .map_err(|e| Error::usage(origin, one_line(&e)))
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

/// The fields of one structure, each from the first of two where it is set there.
macro_rules! first_set {
    ($kind:ident { $($single:ident),* ; $($list:ident),* ; $($switch:ident),* }, $first:expr, $second:expr) => {{
        let (first, second) = ($first, $second);
        $kind {
            $($single: first.$single.or(second.$single),)*
            $($list: if first.$list.is_empty() { second.$list } else { first.$list },)*
            $($switch: first.$switch || second.$switch,)*
        }
    }};
}

fn or(first: EvaluateArgs, second: EvaluateArgs) -> EvaluateArgs {
    // A key named in one layer hides every other way to name one in the layers below.
    let mut below = second.model;
    if first.model.api_key_env.is_some() || first.model.api_key_file.is_some() {
        (below.api_key_env, below.api_key_file) = (None, None);
    }
    let mut place = second.output;
    if first.output.out.is_some() || first.output.resume.is_some() {
        (place.out, place.resume) = (None, None);
    }
    EvaluateArgs {
        data: first_set!(DataArgs { data, questions, limit, families; ; }, first.data, second.data),
        light: first_set!(LightArgs { levels, variant, seed, gain, ratio; ; }, first.light, second.light),
        enhancement: first_set!(
            EnhancementArgs { llie_on, threads, ort_lib; llie; offline }, first.enhancement, second.enhancement
        ),
        model: first_set!(
            ModelArgs {
                base_url, api_key_env, api_key_file, temperature, max_tokens, token_field, reasoning_effort, detail, prompts;
                model, blind_model;
                blind, allow_http
            },
            first.model, below
        ),
        sending: first_set!(
            SendingArgs { concurrency, timeout, retries, max_wait, image, max_side, max_failures; ; },
            first.sending, second.sending
        ),
        output: first_set!(OutputArgs { out, resume, config; ; json, quiet }, first.output, place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(words: &[&str]) -> EvaluateArgs {
        Cli::try_parse_from(std::iter::once(&"darkqa-eval").chain(words))
            .unwrap()
            .evaluate
    }

    fn from_file(text: &str) -> Result<EvaluateArgs> {
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
        let said = or(or(typed(&["--seed", "1"]), environment.unwrap()), file);
        assert_eq!(
            (said.light.seed, said.light.gain, said.light.ratio),
            (Some(1), Some(0.5), Some(150.0))
        );
        assert_eq!(
            (said.model.model, said.model.blind, said.output.quiet),
            (vec!["a".into(), "b".into()], true, false)
        );
    }

    #[test]
    fn a_wrong_value_names_where_it_stands() {
        let wrong = environment(|name| (name == "DARKQA_CONCURRENCY").then(|| "many".into()))
            .unwrap_err()
            .to_string();
        assert!(
            wrong.starts_with("DARKQA_CONCURRENCY: invalid value 'many'"),
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
