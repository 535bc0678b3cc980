//! Where a setting comes from: flag, environment, file.
//!
//! What the environment and a file say of flags that nobody typed is turned into words, and these stand behind those typed when all of
//! them are parsed, once. So a value is read alike wherever it stands. ripgrep does so with its configuration file
//! (`crates/core/flags/parse.rs`).

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use toml::{Table, Value};

use crate::error::{Error, Result};
use crate::files::reading;

/// What every variable of the environment begins with.
const PREFIX: &str = "DARKQA_";

/// The flag of the file, and its variable.
const CONFIG: &str = "config";

/// Why there is nothing to carry out.
pub(super) enum Problem {
    /// Something is wrong.
    Error(Error),
    /// Help or the version is asked for.
    Help(clap::Error),
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

/// What is said of one flag outside of the command line.
struct LayeredValue {
    /// Where: a variable, or a file and its key.
    origin: String,
    values: Vec<OsString>,
}

/// Parses the words typed, with what the environment and the `--config` file say of the flags that nobody typed.
///
/// # Errors
/// With the flag, the variable or the entry of the file that cannot be used.
pub(super) fn parse(
    mut all: Command,
    typed: Vec<OsString>,
    variable: impl Fn(&str) -> Option<OsString>,
) -> Result<ArgMatches, Problem> {
    // Copied before it is built: this setting reaches the commands within a command only then.
    let lenient = all.clone().ignore_errors(true);
    all.build();
    let Ok(matches) = lenient.try_get_matches_from(&typed) else {
        return read(all, typed, &BTreeMap::new());
    };
    let (path, own) = called(&matches);
    let command = descend(&all, &path);
    let mut taken: Vec<&Arg> = of_flags(command)
        .filter(|arg| own.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine))
        .collect();
    let environment = environment(&all, command, &variable)?;
    let file = match own.get_one::<PathBuf>(CONFIG) {
        Some(path) => Some(path.clone()),
        None => variable("DARKQA_CONFIG")
            .filter(|path| !path.is_empty())
            .map(PathBuf::from),
    };
    let file = match file {
        Some(file) => of_file(&file, &all, command, &path)?,
        None => BTreeMap::new(),
    };
    let (mut words, mut origins) = (Vec::new(), BTreeMap::new());
    for layer in [environment, file] {
        let mut claimed = Vec::new();
        for arg in of_flags(command) {
            let hidden = || taken.iter().any(|other| hides(command, other, arg));
            if let Some(said) = layer.get(&key(arg)).filter(|_| !hidden()) {
                let flag = arg.get_long().unwrap_or_default();
                words.extend(as_words(arg, flag, said)?);
                origins.insert(flag.to_owned(), said.origin.clone());
                claimed.push(arg);
            }
        }
        taken.extend(claimed);
    }
    let mut typed = typed;
    let end = typed.iter().position(|word| word == "--");
    let end = end.unwrap_or(typed.len());
    typed.splice(end..end, words);
    read(all, typed, &origins)
}

/// The matches of the command that is called.
pub(super) fn own(matches: &ArgMatches) -> &ArgMatches {
    called(matches).1
}

/// The names of the command that is called, and its matches.
fn called(matches: &ArgMatches) -> (Vec<String>, &ArgMatches) {
    let (mut path, mut own) = (Vec::new(), matches);
    while let Some((name, matches)) = own.subcommand() {
        path.push(name.to_owned());
        own = matches;
    }
    (path, own)
}

fn descend<'a>(all: &'a Command, path: &[String]) -> &'a Command {
    path.iter().fold(all, |command, name| {
        command.find_subcommand(name).unwrap_or(command)
    })
}

/// The flags of a command that layers can set.
fn of_flags(command: &Command) -> impl Iterator<Item = &Arg> {
    let settable = |arg: &&Arg| {
        let long = arg.get_long();
        long.is_some() && !matches!(long, Some("help" | "version" | CONFIG))
    };
    command.get_arguments().filter(settable)
}

/// The name of a flag in files, and with other letters in variables: that of its field, which is its own but for flags that mean
/// something else than an evaluation's of the same name.
fn key(arg: &Arg) -> String {
    arg.get_id().as_str().replace('_', "-")
}

/// Whether a flag that is said hides another in the layers below: the same one, or one that it conflicts with.
fn hides(command: &Command, said: &Arg, other: &Arg) -> bool {
    let conflicts = |one: &Arg, with: &Arg| {
        let mut all = command.get_arg_conflicts_with(one).into_iter();
        all.any(|arg| arg.get_id() == with.get_id())
    };
    said.get_id() == other.get_id() || conflicts(said, other) || conflicts(other, said)
}

/// The flags that the environment sets: `DARKQA_MAX_TOKENS` is `--max-tokens`; a list is separated by commas.
///
/// A variable that only another command knows is passed over; one that no command knows is refused.
fn environment(
    all: &Command,
    command: &Command,
    variable: &impl Fn(&str) -> Option<OsString>,
) -> Result<BTreeMap<String, LayeredValue>> {
    let names = std::env::vars_os().filter_map(|(name, _)| name.into_string().ok());
    let ours = names.filter(|name| name.starts_with(PREFIX));
    let mut known: Vec<String> = every_flag(all).iter().map(|flag| name_of(flag)).collect();
    known.push(name_of(CONFIG));
    for name in ours {
        if !known.contains(&name) {
            let problem = format_args!("no flag of this name{}", near(&name, &known, ""));
            return Err(Error::usage(name.clone(), problem));
        }
    }
    let said = of_flags(command).filter_map(|arg| {
        let flag = key(arg);
        let origin = name_of(&flag);
        let text = variable(&origin).filter(|text| !text.is_empty())?;
        let list = matches!(arg.get_action(), ArgAction::Append);
        let values = match text.to_str() {
            Some(text) if list => text.split(',').map(OsString::from).collect(),
            _ => vec![text],
        };
        Some((flag, LayeredValue { origin, values }))
    });
    Ok(said.collect())
}

/// The variable of a flag.
fn name_of(flag: &str) -> String {
    format!("{PREFIX}{}", flag.replace('-', "_").to_uppercase())
}

/// The flags of all commands.
fn every_flag(command: &Command) -> Vec<String> {
    let mut all: Vec<String> = of_flags(command).map(key).collect();
    all.extend(command.get_subcommands().flat_map(every_flag));
    all
}

/// The nearest of several names, as a question; empty if none is near.
fn near(name: &str, known: &[String], before: &str) -> String {
    let alike = |other: &&String| strsim::jaro_winkler(name, other);
    let nearest = known.iter().max_by(|a, b| alike(a).total_cmp(&alike(b)));
    let nearest = nearest.filter(|other| alike(other) > 0.8);
    nearest.map_or_else(String::new, |other| {
        format!("; did you mean {before}{other}?")
    })
}

/// The flags that a TOML file sets: `max-tokens = 16`, `model = ["a", "b"]`, `blind = true`; those of one command alone in a table of
/// its name, which go before those at the top.
fn of_file(
    path: &Path,
    all: &Command,
    command: &Command,
    called: &[String],
) -> Result<BTreeMap<String, LayeredValue>> {
    let text = reading::text(path)?;
    let table: Table = text.parse().map_err(|e| broken(path, &text, &e))?;
    let mut said = BTreeMap::new();
    take(&mut said, path, &table, all, (command, called), &[])?;
    Ok(said)
}

/// Takes the entries of a table, and of the tables in it those on the way to the command that is called.
fn take(
    said: &mut BTreeMap<String, LayeredValue>,
    path: &Path,
    table: &Table,
    at: &Command,
    (command, called): (&Command, &[String]),
    within: &[&str],
) -> Result<()> {
    let flags: Vec<String> = of_flags(command).map(key).collect();
    for (key, value) in table.iter().filter(|(_, value)| !value.is_table()) {
        let flag = key.replace('_', "-");
        let place = [within, &[key]].concat().join(".");
        let origin = format!("{}, {place}", path.display());
        if flag == CONFIG {
            let problem = "a file of flags cannot name another; --config takes one file";
            return Err(Error::usage(origin, problem));
        }
        if !flags.contains(&flag) {
            let problem = format_args!(
                "there is no flag --{flag} here{}",
                near(&flag, &flags, "--")
            );
            return Err(Error::usage(origin, problem));
        }
        let values = match value {
            Value::Array(values) => values.iter().map(text_of).collect(),
            single => text_of(single).map(|text| vec![text]),
        };
        let values: Vec<OsString> = values.ok_or_else(|| {
            let problem = "a text, a number, a switch or a list of them expected";
            Error::usage(&origin, problem)
        })?;
        said.insert(flag, LayeredValue { origin, values });
    }
    let tables = table
        .iter()
        .filter_map(|(key, value)| Some((key, value.as_table()?)));
    for (name, inner) in tables {
        let Some(next) = at.find_subcommand(name) else {
            let names: Vec<String> = at
                .get_subcommands()
                .map(|c| c.get_name().to_owned())
                .collect();
            let origin = format!("{}, [{name}]", path.display());
            let problem = format_args!("there is no command {name}{}", near(name, &names, ""));
            return Err(Error::usage(origin, problem));
        };
        if called.first().is_some_and(|called| called == name) {
            let within = [within, &[name]].concat();
            take(said, path, inner, next, (command, &called[1..]), &within)?;
        }
    }
    Ok(())
}

/// What is wrong with a TOML file, in one line that names its own.
fn broken(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let before = error.span().and_then(|span| text.get(..span.start));
    let line = before.unwrap_or_default().matches('\n').count() + 1;
    let problem: Vec<&str> = error.message().lines().map(str::trim).collect();
    Error::line(path, line, format_args!("no TOML: {}", problem.join(", ")))
}

fn text_of(value: &Value) -> Option<OsString> {
    match value {
        Value::String(text) => Some(text.into()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Some(value.to_string().into()),
        _ => None,
    }
}

/// The words that say a flag as if it were typed; a switch that is turned off has none.
fn as_words(arg: &Arg, flag: &str, said: &LayeredValue) -> Result<Vec<OsString>> {
    if !arg.get_action().takes_values() {
        let word = match &said.values[..] {
            [value] => value.to_str(),
            _ => None,
        };
        return match word {
            Some("1" | "true" | "yes") => Ok(vec![format!("--{flag}").into()]),
            Some("0" | "false" | "no") => Ok(Vec::new()),
            _ => Err(Error::usage(&said.origin, "true or false expected")),
        };
    }
    let word = |value: &OsString| {
        let mut word = OsString::from(format!("--{flag}="));
        word.push(value);
        word
    };
    // A list of a flag that takes one text with commas is that text.
    let list = matches!(arg.get_action(), ArgAction::Append);
    if list || said.values.len() == 1 {
        return Ok(said.values.iter().map(word).collect());
    }
    let together = said.values.join(OsStr::new(","));
    Ok(vec![word(&together)])
}

/// Parses all words; an error about a flag that was not typed names where it is said.
fn read(
    mut command: Command,
    words: Vec<OsString>,
    origins: &BTreeMap<String, String>,
) -> Result<ArgMatches, Problem> {
    command
        .try_get_matches_from_mut(words)
        .map_err(|e| match e.kind() {
            ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => Problem::Help(e),
            _ => Problem::Error(said_where(&e, origins)),
        })
}

fn said_where(error: &clap::Error, origins: &BTreeMap<String, String>) -> Error {
    let flag = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(flag)) => flag.trim_start_matches("--"),
        _ => "",
    };
    let flag = flag.split([' ', '=']).next().unwrap_or_default();
    let text = one_line(error);
    match origins.get(flag) {
        Some(origin) => Error::usage(origin, text),
        None => Error::CommandLine(text),
    }
}

/// What clap says, in one line: what is wrong, and what may be meant.
pub(super) fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines = text.lines().map(str::trim);
    let wanted = lines.take_while(|line| !line.starts_with("Usage:"));
    let wanted =
        wanted.filter(|line| !line.is_empty() && !line.starts_with("For more information"));
    let line = wanted
        .collect::<Vec<_>>()
        .join(" ")
        .replace(" tip: ", "; tip: ");
    line.trim_start_matches("error: ").to_owned()
}

#[cfg(test)]
mod tests;
