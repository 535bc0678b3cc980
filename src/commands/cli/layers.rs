//! The sources of a setting: flag, file of models, environment, file of flags.
//!
//! Values from the environment and files are turned into words, for flags that were not typed. They are appended to the
//! typed words, and all words are parsed together, once. Thus a value is read in the same way wherever it comes from.
//! ripgrep reads its configuration file like this (`crates/core/flags/parse.rs`).
//!
//! The error about a file of flags that is not TOML: [`invalid_toml`].
//!
//! The flags of the run that the `[defaults]` of a file of models set: [`values`].
//!
//! Flags that once turned a command into another one: [`in_current_form`].

mod expansion;
mod sent_secrets;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use toml::{Table, Value};

use self::expansion::Expansion;
use super::command::SHORT_HELP;
use super::keyed::{name_of, spell_as_keys};
use darkqa_ask::OPENAI_KEY;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::shell_word;
use darkqa_base::types::text::{TomlFault, did_you_mean, nearest, suggestion};
use darkqa_engine::models::{RunDefault, run_defaults};
use expansion::{LayeredValue, text_of};

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

/// The matches of all words, and the flags that were typed.
pub(super) struct Parsed {
    pub(super) matches: ArgMatches,
    /// Long names of the flags that were typed, without those that variables and files set.
    pub(super) typed: BTreeSet<String>,
}

/// The matches of the typed words, with values from the file of models, the environment and the `--config` file for
/// flags that were not typed.
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
    let in_call: BTreeSet<String> = set.iter().filter_map(|arg| arg.get_long()).map(str::to_owned).collect();
    let expansion = Expansion(command);
    let environment = expansion.layer(environment_values(&all, command, &variable)?)?;
    let file = match own.get_one::<PathBuf>(CONFIG) {
        Some(path) => Some(path.clone()),
        None => variable("DARKQA_CONFIG").filter(|path| !path.is_empty()).map(PathBuf::from),
    };
    let file_layer = match &file {
        Some(file) => expansion.layer(file_values(file, &all, command, &path)?)?,
        None => BTreeMap::new(),
    };
    let models = models_values(own, command, [&environment, &file_layer])?;
    let (mut words, mut origins) = (Vec::new(), BTreeMap::new());
    for layer in [&models, &environment, &file_layer] {
        let mut newly_set = Vec::new();
        for arg in settable_flags(command) {
            let Some(value) = layer.get(&name_of(arg)) else {
                continue;
            };
            if !set.iter().any(|other| hides(command, other, arg)) {
                let flag = arg.get_long().unwrap_or_default();
                words.extend(as_words(arg, flag, value)?);
                origins.insert(flag.to_owned(), value.origin.clone());
                newly_set.push(arg);
            }
        }
        set.extend(newly_set);
    }
    if let Some(file) = &file {
        let in_effect = file_layer
            .iter()
            .filter(|(flag, value)| origins.get(*flag) == Some(&value.origin))
            .map(|(flag, value)| (flag.clone(), value));
        let flags_set: BTreeSet<String> = set.iter().map(|arg| name_of(arg)).collect();
        let has_key = variable(OPENAI_KEY).is_some_and(|text| !text.is_empty());
        sent_secrets::check(file, &in_effect.collect(), &flags_set, has_key)?;
    }
    let mut typed = typed;
    let end = typed.iter().position(|word| word == "--");
    let end = end.unwrap_or(typed.len());
    typed.splice(end..end, words);
    Ok(Parsed { matches: parse_words(all, typed, &origins)?, typed: in_call })
}

/// The typed words in their current form: modes as subcommands, and the settings of keyed flags as the hidden flags for
/// them.
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

/// Returns true if a word is this flag in its long or its short form, without a value.
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
    path.iter().fold(all, |command, name| command.find_subcommand(name).unwrap_or(command))
}

/// The flags of a command that the environment and a file can set.
fn settable_flags(command: &Command) -> impl Iterator<Item = &Arg> {
    command
        .get_arguments()
        .filter(|arg| arg.get_long().is_some_and(|long| !["help", "version", CONFIG].contains(&long)))
}

/// Returns true if a flag that is set hides another flag in lower layers. It hides itself, and each flag that conflicts
/// with it.
fn hides(command: &Command, set: &Arg, other: &Arg) -> bool {
    set.get_id() == other.get_id() || lists_conflict(command, set, other) || lists_conflict(command, other, set)
}

/// Returns true if the definition of a flag lists `other` among its conflicts.
fn lists_conflict(command: &Command, arg: &Arg, other: &Arg) -> bool {
    command.get_arg_conflicts_with(arg).into_iter().any(|conflicting| conflicting.get_id() == other.get_id())
}

/// The flags that the environment sets: `DARKQA_MAX_TOKENS` is `--max-tokens`; a list is separated by commas.
///
/// A variable for a flag of another command is skipped. A variable for no flag at all is an error.
fn environment_values(
    all: &Command,
    command: &Command,
    variable: &impl Fn(&str) -> Option<OsString>,
) -> Result<BTreeMap<String, LayeredValue>> {
    let ours =
        std::env::vars_os().filter_map(|(name, _)| name.into_string().ok()).filter(|name| name.starts_with(PREFIX));
    let mut known: Vec<String> = every_flag(all).iter().map(|flag| variable_name(flag)).collect();
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

/// Repeatable flags whose values may contain commas.
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
/// of a command applies only to this command, and overrides the flags at the top of the file.
fn file_values(
    path: &Path,
    all: &Command,
    command: &Command,
    called: &[String],
) -> Result<BTreeMap<String, LayeredValue>> {
    let text = files::settings(path)?;
    let table: Table = text.parse().map_err(|e| invalid_toml(path, &text, &e))?;
    let mut values = BTreeMap::new();
    let flags: Vec<String> = settable_flags(command).map(name_of).collect();
    read_table(&mut values, path, &table, all, &flags, called, &[])?;
    Ok(values)
}

/// Adds the entries of a table, and of those nested tables that lead to the command that is called. `flags` are the
/// flags that the table may set, `called` is the rest of the path to the called command, and `within` has the names of
/// the tables around this one. The tables of other commands are only checked: each of their keys must be a flag of its
/// command.
fn read_table(
    flag_values: &mut BTreeMap<String, LayeredValue>,
    path: &Path,
    table: &Table,
    at: &Command,
    flags: &[String],
    called: &[String],
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
    let tables = table.iter().filter_map(|(key, value)| Some((key, value.as_table()?)));
    for (name, inner) in tables {
        let Some(next) = at.find_subcommand(name) else {
            let names: Vec<String> = at.get_subcommands().map(|c| c.get_name().to_owned()).collect();
            let origin = format!("{}, [{name}]", path.display());
            let problem = format_args!("there is no command {name}{}", suggestion(name, &names));
            return Err(Error::usage(origin, problem));
        };
        let within = [within, &[name]].concat();
        match called.split_first() {
            Some((first, rest)) if first == name => {
                read_table(flag_values, path, inner, next, flags, rest, &within)?;
            }
            _ => {
                let unused = &mut BTreeMap::new();
                read_table(unused, path, inner, next, &every_flag(next), &[], &within)?;
            }
        }
    }
    Ok(())
}

/// The flags that the file of models sets. The call or a lower layer names this file.
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
    let layered = layers.into_iter().find_map(|layer| layer.get(MODELS));
    let layered = layered.and_then(|value| value.values.first());
    let Some(path) = typed.or_else(|| layered.map(PathBuf::from)) else {
        return Ok(BTreeMap::new());
    };
    let values = values(&path, &flags)?.into_iter().map(|(flag, origin, value)| {
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
    let repeats = matches!(arg.get_action(), ArgAction::Append);
    let values = if repeats || value.values.len() == 1 {
        value.values.clone()
    } else {
        // The flag takes one text with commas, so a list is joined to such a text.
        vec![value.values.join(OsStr::new(","))]
    };
    Ok(values.iter().map(|value| as_word(flag, value)).collect())
}

/// A flag and its value as one word.
fn as_word(flag: &str, value: &OsStr) -> OsString {
    let mut word = OsString::from(format!("--{flag}="));
    word.push(value);
    word
}

/// The matches of all words. An error about a flag that was not typed names the source of its value.
fn parse_words(
    mut command: Command,
    words: Vec<OsString>,
    origins: &BTreeMap<String, String>,
) -> Result<ArgMatches, Problem> {
    let matches = command.try_get_matches_from_mut(words).map_err(|e| match e.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            Problem::Help(e)
        }
        _ => Problem::Error(with_origin(&e, origins)),
    })?;
    check_flags_before_command(&command, &matches)?;
    Ok(matches)
}

/// Refuses a flag of the evaluation in front of a command, as in `--levels L0 report RUN`. Global flags may stand
/// there. This check replaces clap's `args_conflicts_with_subcommands`, which would refuse global flags too.
fn check_flags_before_command(command: &Command, matches: &ArgMatches) -> Result<()> {
    let Some(name) = matches.subcommand_name() else {
        return Ok(());
    };
    let misplaced = command.get_arguments().find(|arg| {
        let source = matches.value_source(arg.get_id().as_str());
        source == Some(ValueSource::CommandLine) && !arg.is_global_set()
    });
    match misplaced.and_then(Arg::get_long) {
        Some(flag) => {
            Err(Error::CommandLine(format!("--{flag} stands before the command {name}; put its flags after it")))
        }
        None => Ok(()),
    }
}

/// Words that people type as the command of an evaluation, which has none.
const NO_COMMAND: [&str; 3] = ["run", "evaluate", "eval"];

/// Names that other tools have for a command, with the command here.
const OTHER_NAMES: [(&[&str], &str); 4] = [
    (&["compare", "diff"], "to compare runs: darkqa-eval report RUN RUN"),
    (&["summary", "view"], "to read a run: darkqa-eval report RUN"),
    (&["share", "pack"], "to share a run: darkqa-eval bundle RUN --out NAME.zip"),
    (&["degrade"], "to make dark images: darkqa-eval synthesize IMAGES --out DIR"),
];

/// Command to type in place of a word that is not a command; `None` if it is not known.
fn guessed_word(word: &str) -> Option<String> {
    if NO_COMMAND.contains(&word) {
        return Some("an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]".to_owned());
    }
    if let Some((_, advice)) = OTHER_NAMES.iter().find(|(names, _)| names.contains(&word)) {
        return Some((*advice).to_owned());
    }
    let path = Path::new(word);
    let place = shell_word(word);
    if path.join("manifest.json").is_file() {
        Some(format!("it is a run; to read it: darkqa-eval report {place}"))
    } else if path.exists() {
        if let Some(advice) = import_advice(word) {
            return Some(advice);
        }
        Some(format!("it is a file or folder; to ask about it: darkqa-eval --model NAME --data {place}"))
    } else {
        None
    }
}

/// Command that takes frames of a recording or a video, by the ending of its name; `None` for other files.
fn import_advice(word: &str) -> Option<String> {
    let ending = Path::new(word).extension()?.to_str()?.to_lowercase();
    let form = match &*ending {
        "mcap" => "mcap",
        "bag" | "db3" => "rosbag",
        "mp4" | "mov" | "mkv" | "avi" | "webm" => "video",
        _ => return None,
    };
    Some(format!("to take frames of it: darkqa-eval import {form} {}", shell_word(word)))
}

fn with_origin(error: &clap::Error, origins: &BTreeMap<String, String>) -> Error {
    if let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand)
        && let Some(advice) = guessed_word(word)
    {
        return Error::CommandLine(format!("no command {word}: {advice}"));
    }
    if let Some(ContextValue::String(arg)) = error.get(ContextKind::InvalidArg)
        && let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidValue)
        && arg == "<KIND>"
        && let Some(advice) = import_advice(word)
    {
        return Error::CommandLine(format!("no kind of data set {word}: {advice}"));
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
    let wanted = wanted.filter(|line| !line.is_empty() && !line.starts_with("For more information"));
    let line = wanted.collect::<Vec<_>>().join(" ").replace(" tip: ", "; tip: ");
    let line = line.trim_start_matches("error: ");
    // An unknown flag keeps the spelling that was typed.
    match line.split_once("; tip: ") {
        Some((problem, tip)) if error.kind() == ErrorKind::UnknownArgument => {
            format!("{problem}; tip: {}", spell_as_keys(tip))
        }
        None if error.kind() == ErrorKind::UnknownArgument => line.to_owned(),
        _ => spell_as_keys(line),
    }
}

/// The error about invalid TOML, on one line and with its line number.
fn invalid_toml(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let TomlFault { line, problem } = TomlFault::new(text, error);
    Error::line(path, line, format_args!("not valid TOML: {problem}"))
}

/// The flags of the run that a file of models sets, each with its place in the file and its text. `flags` are those of
/// the command.
///
/// # Errors
/// If the command has no such flag, or the value has a form that no flag has.
fn values(path: &Path, flags: &[String]) -> Result<Vec<(String, String, OsString)>> {
    // An unusable file is reported later, where its models are read.
    let defaults = run_defaults(path).unwrap_or_default();
    defaults
        .into_iter()
        .map(|default| {
            let RunDefault { flag, value, place } = default;
            if !flags.contains(&flag) {
                let problem = format_args!("{flag}: this command has no --{flag}");
                return Err(Error::usage(place, problem));
            }
            let Some(text) = text_of(&value) else {
                let problem = format_args!("{flag}: a text, a number or a switch expected");
                return Err(Error::usage(place, problem));
            };
            Ok((flag, place, text))
        })
        .collect()
}

/// A flag whose command is now a subcommand.
struct Mode {
    command: &'static str,
    /// The flag. It is also the name of the subcommand.
    flag: &'static str,
    /// True if the flag had a value. This value is now the first word after the subcommand.
    has_value: bool,
}

const MODES: [Mode; 5] = [
    Mode::new("synthesize", "check", true),
    Mode::new("synthesize", "from", true),
    Mode::new("enhance", "describe", false),
    Mode::new("enhance", "doctor", false),
    Mode::new("import", "script", false),
];

impl Mode {
    const fn new(command: &'static str, flag: &'static str, has_value: bool) -> Self {
        Self { command, flag, has_value }
    }

    /// The place of the flag in the words, and its value if it is joined to the flag.
    fn find(&self, words: &[OsString]) -> Option<(usize, Option<OsString>)> {
        words.iter().take_while(|word| *word != "--").enumerate().find_map(|(place, word)| {
            let rest = word.to_str()?.strip_prefix("--")?.strip_prefix(self.flag)?;
            match rest.strip_prefix('=') {
                Some(value) if self.has_value => Some((place, Some(value.into()))),
                None if rest.is_empty() => Some((place, None)),
                _ => None,
            }
        })
    }
}

/// The words of a call, with the flag of a mode replaced by its subcommand: `enhance m --describe` becomes `enhance
/// describe m`. `at` is the place of the command's name.
fn in_current_form(mut words: Vec<OsString>, at: usize) -> Vec<OsString> {
    let found = MODES
        .iter()
        .filter(|mode| words.get(at).is_some_and(|word| word == mode.command))
        .filter_map(|mode| Some((mode, mode.find(&words)?)));
    let Some((mode, (place, value))) = found.min_by_key(|(_, (place, _))| *place) else {
        return words;
    };
    words.remove(place);
    let value = match value {
        None if mode.has_value && place < words.len() => Some(words.remove(place)),
        value => value,
    };
    let subcommand = std::iter::once(OsString::from(mode.flag));
    let rest = words.split_off(at + 1);
    words.extend(subcommand.chain(value).chain(rest));
    words
}
