//! The sources of a setting: flag, file of models, environment, file of flags.
//!
//! Values from the environment and files, for flags that were not typed, are turned into words and appended to the typed words. All of
//! them are parsed together, once. So a value is read in the same way wherever it comes from. ripgrep does so with its configuration
//! file (`crates/core/flags/parse.rs`).

mod earlier_form;
mod expansion;
mod invalid_toml;
mod layered_value;
mod models_file;
mod sent_secrets;
mod value_text;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use toml::{Table, Value};

use self::earlier_form::in_current_form;
use self::expansion::Expansion;
use self::invalid_toml::invalid_toml;
use self::layered_value::LayeredValue;
use self::value_text::text_of;
use super::command::SHORT_HELP;
use super::keyed::{name_of, respelled};
use crate::ask::OPENAI_KEY;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::text::near_name::{did_you_mean, nearest, suggestion};

/// Prefix of this program's environment variables.
const PREFIX: &str = "DARKQA_";

/// Name of the flag for the file of models.
const MODELS: &str = "models";

/// Name of the flag for the configuration file.
const CONFIG: &str = "config";

/// The reason why no command is carried out.
pub(super) enum Problem {
    Error(Error),
    /// The text of `--help` or `--version`, which clap returns as an error.
    Help(clap::Error),
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

/// The matches of all words, and the flags that the call itself names.
pub(super) struct Parsed {
    pub(super) matches: ArgMatches,
    /// Flags by long name, without those of variables and files.
    pub(super) typed: BTreeSet<String>,
}

/// The matches of the typed words, with values from the file of models, the environment and the `--config` file for flags that were
/// not typed.
///
/// # Errors
/// Names the flag, the variable or the entry of the file that cannot be used.
pub(super) fn parse(
    mut all: Command,
    typed: Vec<OsString>,
    variable: impl Fn(&str) -> Option<OsString>,
) -> Result<Parsed, Problem> {
    // Cloned before `build`: only then does this setting reach the nested commands.
    let lenient = all.clone().ignore_errors(true);
    all.build();
    let typed = current_words(&all, typed)?;
    if !typed.iter().any(|word| word == "--help") {
        all = all.override_help(SHORT_HELP);
    }
    let Ok(matches) = lenient.try_get_matches_from(&typed) else {
        let matches = parse_words(all, typed, &BTreeMap::new())?;
        let typed = BTreeSet::new();
        return Ok(Parsed { matches, typed });
    };
    let (path, own) = called_command(&matches);
    let command = descend(&all, &path);
    let mut set: Vec<&Arg> = settable_flags(command)
        .filter(|arg| own.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine))
        .collect();
    let in_call: BTreeSet<String> = set
        .iter()
        .filter_map(|arg| arg.get_long())
        .map(str::to_owned)
        .collect();
    let expansion = Expansion(command);
    let environment = expansion.layer(environment_values(&all, command, &variable)?)?;
    let file = match own.get_one::<PathBuf>(CONFIG) {
        Some(path) => Some(path.clone()),
        None => variable("DARKQA_CONFIG")
            .filter(|path| !path.is_empty())
            .map(PathBuf::from),
    };
    let of_file = match &file {
        Some(file) => expansion.layer(file_values(file, &all, command, &path)?)?,
        None => BTreeMap::new(),
    };
    let models = models_values(own, command, [&environment, &of_file])?;
    let (mut words, mut origins) = (Vec::new(), BTreeMap::new());
    for layer in [&models, &environment, &of_file] {
        let mut newly_set = Vec::new();
        for arg in settable_flags(command) {
            let hidden = || set.iter().any(|other| hides(command, other, arg));
            if let Some(value) = layer.get(&name_of(arg)).filter(|_| !hidden()) {
                let flag = arg.get_long().unwrap_or_default();
                words.extend(as_words(arg, flag, value)?);
                origins.insert(flag.to_owned(), value.origin.clone());
                newly_set.push(arg);
            }
        }
        set.extend(newly_set);
    }
    if let Some(file) = &file {
        let in_effect = of_file.iter().filter_map(|(flag, value)| {
            let is_in_effect = origins.get(flag) == Some(&value.origin);
            is_in_effect.then(|| (flag.clone(), value))
        });
        let is_set = |flag: &str| set.iter().any(|arg| name_of(arg) == flag);
        let has_key = variable(OPENAI_KEY).is_some_and(|text| !text.is_empty());
        sent_secrets::check(file, &in_effect.collect(), is_set, has_key)?;
    }
    let mut typed = typed;
    let end = typed.iter().position(|word| word == "--");
    let end = end.unwrap_or(typed.len());
    typed.splice(end..end, words);
    Ok(Parsed {
        matches: parse_words(all, typed, &origins)?,
        typed: in_call,
    })
}

/// The typed words in their current form: modes as subcommands, and the settings of keyed flags as the hidden flags for them.
fn current_words(all: &Command, typed: Vec<OsString>) -> Result<Vec<OsString>> {
    let (_, place) = typed_command(all, &typed);
    let typed = in_current_form(typed, place);
    let (command, _) = typed_command(all, &typed);
    Expansion(command).words(typed)
}

/// The command that the words call, and the place of its name. Flags may stand before it.
fn typed_command<'a>(all: &'a Command, words: &[OsString]) -> (&'a Command, usize) {
    let (mut command, mut place, mut at) = (all, 0, 1);
    while let Some(word) = words.get(at).and_then(|word| word.to_str()) {
        if word == "--" {
            break;
        }
        if word.starts_with('-') {
            let mut args = command.get_arguments();
            let arg = args.find(|arg| has_form(arg, word));
            let has_value = arg.is_some_and(|arg| arg.get_action().takes_values());
            at += if has_value { 2 } else { 1 };
            continue;
        }
        let Some(inner) = command.find_subcommand(word) else {
            break;
        };
        (command, place) = (inner, at);
        at += 1;
    }
    (command, place)
}

/// Whether a word is a flag in its long or its short form, without a value.
fn has_form(arg: &Arg, word: &str) -> bool {
    match word.strip_prefix("--") {
        Some(long) => {
            let mut second = arg.get_visible_aliases().into_iter().flatten();
            arg.get_long() == Some(long) || second.any(|name| name == long)
        }
        None => arg.get_short().map(|short| format!("-{short}")).as_deref() == Some(word),
    }
}

/// The matches of the command that is called.
pub(super) fn command_matches(matches: &ArgMatches) -> &ArgMatches {
    called_command(matches).1
}

/// The names on the way to the command that is called, and its matches.
fn called_command(matches: &ArgMatches) -> (Vec<String>, &ArgMatches) {
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

/// The flags of a command that the environment and a file can set.
fn settable_flags(command: &Command) -> impl Iterator<Item = &Arg> {
    let settable = |arg: &&Arg| {
        let long = arg.get_long();
        long.is_some() && !matches!(long, Some("help" | "version" | CONFIG))
    };
    command.get_arguments().filter(settable)
}

/// Whether a flag that is set hides another in lower layers: the same flag, or one that conflicts with it.
fn hides(command: &Command, set: &Arg, other: &Arg) -> bool {
    let conflicts = |arg: &Arg, with: &Arg| {
        command
            .get_arg_conflicts_with(arg)
            .into_iter()
            .any(|arg| arg.get_id() == with.get_id())
    };
    set.get_id() == other.get_id() || conflicts(set, other) || conflicts(other, set)
}

/// The flags that the environment sets: `DARKQA_MAX_TOKENS` is `--max-tokens`; a list is separated by commas.
///
/// A variable that only another command knows is skipped. One that no command knows is refused.
fn environment_values(
    all: &Command,
    command: &Command,
    variable: &impl Fn(&str) -> Option<OsString>,
) -> Result<BTreeMap<String, LayeredValue>> {
    let ours = std::env::vars_os()
        .filter_map(|(name, _)| name.into_string().ok())
        .filter(|name| name.starts_with(PREFIX));
    let mut known: Vec<String> = every_flag(all)
        .iter()
        .map(|flag| variable_name(flag))
        .collect();
    known.push(variable_name(CONFIG));
    for name in ours {
        if !known.contains(&name) {
            let problem = format_args!("no flag of this name{}", suggestion(&name, &known));
            return Err(Error::usage(name.clone(), problem));
        }
    }
    let values = settable_flags(command).filter_map(|arg| {
        let flag = name_of(arg);
        let origin = variable_name(&flag);
        let text = variable(&origin).filter(|text| !text.is_empty())?;
        let list = matches!(arg.get_action(), ArgAction::Append) && !WITH_COMMAS.contains(&&*flag);
        let values = match text.to_str() {
            Some(text) if list => text.split(',').map(OsString::from).collect(),
            _ => vec![text],
        };
        Some((flag, LayeredValue { origin, values }))
    });
    Ok(values.collect())
}

/// Repeatable flags of which one value may hold commas.
const WITH_COMMAS: [&str; 2] = ["data", "map"];

/// The variable of a flag.
fn variable_name(flag: &str) -> String {
    format!("{PREFIX}{}", flag.replace('-', "_").to_uppercase())
}

/// The flags of all commands.
fn every_flag(command: &Command) -> Vec<String> {
    let mut all: Vec<String> = settable_flags(command).map(name_of).collect();
    all.extend(command.get_subcommands().flat_map(every_flag));
    all
}

/// The flags that a TOML file sets: `max-tokens = 16`, `model = ["a", "b"]`, `blind = true`. A table with the name
/// of a command is for this command alone, and overrides the flags at the top of the file.
fn file_values(
    path: &Path,
    all: &Command,
    command: &Command,
    called: &[String],
) -> Result<BTreeMap<String, LayeredValue>> {
    let text = reading::settings(path)?;
    let table: Table = text.parse().map_err(|e| invalid_toml(path, &text, &e))?;
    let mut values = BTreeMap::new();
    let flags: Vec<String> = settable_flags(command).map(name_of).collect();
    read_table(&mut values, path, &table, all, (&flags, called), &[])?;
    Ok(values)
}

/// Adds the entries of a table, and of those nested tables that lead to the command that is called. The tables of other commands
/// are checked: each of their keys is a flag of the command that it is for.
fn read_table(
    flag_values: &mut BTreeMap<String, LayeredValue>,
    path: &Path,
    table: &Table,
    at: &Command,
    (flags, called): (&[String], &[String]),
    within: &[&str],
) -> Result<()> {
    for (key, value) in table.iter().filter(|(_, value)| !value.is_table()) {
        let flag = key.replace('_', "-");
        let place = [within, &[key]].concat().join(".");
        let origin = format!("{}, {place}", path.display());
        if flag == CONFIG {
            let problem = "a file of flags cannot name another; --config takes one file";
            return Err(Error::usage(origin, problem));
        }
        if !flags.contains(&flag) {
            // A flag of the command around the one that is called, as of `synthesize` for `synthesize check`.
            if !within.is_empty() && settable_flags(at).any(|arg| name_of(arg) == flag) {
                continue;
            }
            let near = nearest(&flag, flags).map(|near| format!("--{near}"));
            let hint = did_you_mean(near.as_deref());
            let problem = format_args!("there is no flag --{flag} here{hint}");
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
        flag_values.insert(flag, LayeredValue { origin, values });
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
            let problem = format_args!("there is no command {name}{}", suggestion(name, &names));
            return Err(Error::usage(origin, problem));
        };
        let within = [within, &[name]].concat();
        match called.split_first() {
            Some((first, rest)) if first == name => {
                read_table(flag_values, path, inner, next, (flags, rest), &within)?;
            }
            _ => {
                let unused = &mut BTreeMap::new();
                read_table(unused, path, inner, next, (&every_flag(next), &[]), &within)?;
            }
        }
    }
    Ok(())
}

/// The flags that the file of models sets, which the call or a lower layer names.
fn models_values(
    own: &ArgMatches,
    command: &Command,
    layers: [&BTreeMap<String, LayeredValue>; 2],
) -> Result<BTreeMap<String, LayeredValue>> {
    let flags: Vec<String> = settable_flags(command).map(name_of).collect();
    if !flags.iter().any(|flag| flag == MODELS) {
        return Ok(BTreeMap::new());
    }
    let typed = own.get_one::<PathBuf>(MODELS).cloned();
    let mut layered = layers.into_iter().filter_map(|layer| layer.get(MODELS));
    let layered = || layered.next()?.values.first().map(PathBuf::from);
    let Some(path) = typed.or_else(layered) else {
        return Ok(BTreeMap::new());
    };
    let values = models_file::values(&path, &flags)?
        .into_iter()
        .map(|(flag, origin, value)| {
            let values = vec![value];
            (flag, LayeredValue { origin, values })
        });
    Ok(values.collect())
}

/// The words that set a flag on the command line; none for a switch that is turned off.
fn as_words(arg: &Arg, flag: &str, value: &LayeredValue) -> Result<Vec<OsString>> {
    if !arg.get_action().takes_values() {
        let word = match &value.values[..] {
            [value] => value.to_str(),
            _ => None,
        };
        return match word {
            Some("1" | "true" | "yes") => Ok(vec![format!("--{flag}").into()]),
            Some("0" | "false" | "no") => Ok(Vec::new()),
            _ => Err(Error::usage(&value.origin, "true or false expected")),
        };
    }
    let word = |value: &OsString| {
        let mut word = OsString::from(format!("--{flag}="));
        word.push(value);
        word
    };
    // If a flag takes one text with commas, a list is joined to that text.
    let list = matches!(arg.get_action(), ArgAction::Append);
    if list || value.values.len() == 1 {
        return Ok(value.values.iter().map(word).collect());
    }
    let joined = value.values.join(OsStr::new(","));
    Ok(vec![word(&joined)])
}

/// The matches of all words. An error about a flag that was not typed names the source of its value.
fn parse_words(
    mut command: Command,
    words: Vec<OsString>,
    origins: &BTreeMap<String, String>,
) -> Result<ArgMatches, Problem> {
    let matches = command
        .try_get_matches_from_mut(words)
        .map_err(|e| match e.kind() {
            ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => Problem::Help(e),
            _ => Problem::Error(with_origin(&e, origins)),
        })?;
    check_flags_before_command(&command, &matches)?;
    Ok(matches)
}

/// Refuses a flag of the evaluation in front of a command: `--levels L0 report RUN`. Global flags may stand there. clap's
/// `args_conflicts_with_subcommands` would refuse them too.
fn check_flags_before_command(command: &Command, matches: &ArgMatches) -> Result<()> {
    let Some(name) = matches.subcommand_name() else {
        return Ok(());
    };
    let misplaced = command.get_arguments().find(|arg| {
        let source = matches.value_source(arg.get_id().as_str());
        source == Some(ValueSource::CommandLine) && !arg.is_global_set()
    });
    match misplaced.and_then(Arg::get_long) {
        Some(flag) => Err(Error::CommandLine(format!(
            "--{flag} stands before the command {name}; put its flags after it"
        ))),
        None => Ok(()),
    }
}

/// Words that people type as the command of an evaluation, which has none.
const NO_COMMAND: [&str; 3] = ["run", "evaluate", "eval"];

fn with_origin(error: &clap::Error, origins: &BTreeMap<String, String>) -> Error {
    if let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand)
        && NO_COMMAND.contains(&&**word)
    {
        return Error::CommandLine(format!(
            "no command {word}: an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]"
        ));
    }
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

/// The text of an error of clap on one line: the problem and the suggestion.
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
    let line = line.trim_start_matches("error: ");
    // An unknown flag is named as it was typed.
    match line.split_once("; tip: ") {
        Some((problem, tip)) if error.kind() == ErrorKind::UnknownArgument => {
            format!("{problem}; tip: {}", respelled(tip))
        }
        None if error.kind() == ErrorKind::UnknownArgument => line.to_owned(),
        _ => respelled(line),
    }
}

#[cfg(test)]
mod tests;
