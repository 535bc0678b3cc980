//! Keyed flags in the definition of the command line: [`with_keyed_flags`].

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction, Command, Id};

use darkqa_base::types::Decides;
use darkqa_base::types::flags::{KEYED_FLAGS, KeyedFlag, flag_spelling};

/// The name of a flag in files, which is the name of the field.
pub(super) fn name_of(arg: &Arg) -> String {
    arg.get_id().as_str().replace('_', "-")
}

/// The command and those in it, with their keyed flags. The flags for single keys are hidden.
pub(super) fn with_keyed_flags(mut command: Command) -> Command {
    for keyed in &KEYED_FLAGS {
        command = with_keyed_flag(command, keyed);
    }
    command.mut_subcommands(with_keyed_flags)
}

/// The command with one keyed flag, if it has flags for its keys.
fn with_keyed_flag(command: Command, keyed: &KeyedFlag) -> Command {
    let keys = keyed.keys.iter().filter(|(key, _)| !key.is_empty());
    let members: Vec<(&str, Arg)> = keys
        .filter_map(|(key, flag)| {
            let mut args = command.get_arguments();
            let arg = args.find(|arg| name_of(arg) == *flag)?;
            Some((*key, arg.clone()))
        })
        .collect();
    let Some((_, first)) = members.first() else {
        return command;
    };
    let lines: Vec<String> = members.iter().map(|(key, arg)| line(key, arg)).collect();
    let lines = lines.join("\n");
    let names: Vec<&str> = members.iter().map(|(key, _)| *key).collect();
    let names = names.join(", ");
    let member_ids: Vec<&Id> = members.iter().map(|(_, arg)| arg.get_id()).collect();
    if keyed.has_plain_value() {
        return command.mut_args(|arg| {
            if name_of(&arg) == keyed.name {
                with_keys_in_help(arg, &names, &lines)
            } else if member_ids.contains(&arg.get_id()) {
                arg.hide(true)
            } else {
                arg
            }
        });
    }
    let (about, default) = keyed.about.split_once("; default: ").unwrap_or((keyed.about, ""));
    let help = format!("{about}: {names}; default: {default}");
    let has_values = keyed.alone.is_none() && members.iter().any(|(_, arg)| arg.get_action().takes_values());
    let arg = Arg::new(keyed.name)
        .long(keyed.name)
        .value_name(if has_values { "KEY=VALUE,…" } else { "KEY,…" })
        .action(ArgAction::Append)
        .help_heading(keyed.heading)
        .display_order(first.get_display_order())
        .help(help)
        .long_help(format!("{about}; keys:\n{lines}"));
    let arg = match Decides::from_arg(first) {
        Some(decides) => arg.add(decides),
        None => arg,
    };
    command
        .mut_args(|arg| {
            let is_member = member_ids.contains(&arg.get_id());
            if is_member { arg.hide(true) } else { arg }
        })
        .arg(arg)
}

/// A flag whose value may have keys after it, with these keys in its help: their names, and one line for each.
fn with_keys_in_help(arg: Arg, names: &str, lines: &str) -> Arg {
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let long = arg.get_long_help().map(ToString::to_string);
    let long = long.unwrap_or_else(|| help.clone());
    let (about, default) = help.split_at(help.find("; default: ").unwrap_or(help.len()));
    arg.help(format!("{about}; keys after a comma: {names}{default}"))
        .long_help(format!("{long}; keys after a comma:\n{lines}"))
}

/// The help of a key: its values, what it decides, and its default.
fn line(key: &str, arg: &Arg) -> String {
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let defaults: Vec<_> = arg.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
    let default = match &defaults[..] {
        _ if !arg.get_action().takes_values() => String::new(),
        [] => String::new(),
        values => format!("; default: {}", values.join(",")),
    };
    let class = Decides::from_arg(arg).filter(|class| *class != Decides::Nothing);
    let class = class.map_or_else(String::new, |class| format!(" [{}]", class.word()));
    format!("  {}: {help}{default}{class}", with_value(key, arg))
}

/// A key with the name of its value or its possible values, as `gain=K`.
pub(super) fn with_value(key: &str, arg: &Arg) -> String {
    if !arg.get_action().takes_values() {
        return key.to_owned();
    }
    let possible = arg.get_possible_values();
    match &possible[..] {
        // A key with one possible value is written without it.
        [_] => key.to_owned(),
        [] => format!("{key}={}", arg.get_value_names().unwrap_or_default().join(" ")),
        several => {
            let names: Vec<&str> = several.iter().map(PossibleValue::get_name).collect();
            format!("{key}={}", names.join("|"))
        }
    }
}

/// The text of an error of the parser, with hidden flags spelled as keys.
pub(super) fn spell_as_keys(text: &str) -> String {
    let mut text = text.to_owned();
    for (key, flag) in KEYED_FLAGS.iter().flat_map(|keyed| keyed.keys) {
        if !key.is_empty() {
            let spelling = flag_spelling(flag);
            text = text
                .replace(&format!("'--{flag} <"), &format!("'{spelling}=<"))
                .replace(&format!("'--{flag}'"), &format!("'{spelling}'"));
        }
    }
    text
}

/// The command without hidden flags and commands, for the completions of shells.
pub(super) fn without_hidden(command: &Command) -> Command {
    let args = command.get_arguments().filter(|arg| !arg.is_hide_set());
    let commands = command.get_subcommands().filter(|inner| !inner.is_hide_set());
    let about = command.get_about().cloned().unwrap_or_default();
    Command::new(leaked(command.get_name()))
        .about(about)
        .args(args.map(to_completion))
        .subcommands(commands.map(without_hidden))
}

/// The completion of a flag or a positional argument.
fn to_completion(arg: &Arg) -> Arg {
    let help = arg.get_help().cloned().unwrap_or_default();
    let completion = Arg::new(arg.get_id().clone())
        .help(help)
        .action(arg.get_action().clone())
        .value_hint(arg.get_value_hint())
        .global(arg.is_global_set());
    let completion = match arg.get_long() {
        Some(long) => completion.long(leaked(long)),
        None => completion,
    };
    let completion = completion.short(arg.get_short());
    if !arg.get_action().takes_values() {
        return completion;
    }
    let names = arg.get_value_names().unwrap_or_default().iter().cloned();
    completion.value_names(names).value_parser(arg.get_value_parser().clone())
}

/// A name that lives as long as the process, which the parser requires. The command with this name is made once, so the
/// leak is small.
fn leaked(name: &str) -> &'static str {
    name.to_owned().leak()
}
