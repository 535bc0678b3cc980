use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use clap::{Arg, Command as Clap, CommandFactory as _};

use super::*;
use crate::types::Decides;

#[test]
fn the_command_line_is_valid() {
    Cli::command().help_expected(true).debug_assert();
}

/// All flags of all commands as Markdown.
fn reference() -> String {
    let mut command = Cli::command();
    command.build();
    let mut text = "# All flags\n\nAt the end of this page you know each flag, its default and what it decides. `UPDATE=1 cargo test --lib cli::` writes the page from \
                    what `--help` shows. A variable is `DARKQA_` and the name of the \
                    flag in capitals; a key of a `--config` file is the name of the flag; both have another name where one is given. What a flag \
                    decides: which *trials* there are, what a model is sent besides the image (*reply*), the content of images (*pixels*), or *nothing* of these: \
                    then a run is the same run with any value of it.\n"
        .to_owned();
    section(&mut text, &command, "darkqa-eval");
    text
}

fn section(text: &mut String, command: &Clap, name: &str) {
    let about = command
        .get_about()
        .map(ToString::to_string)
        .unwrap_or_default();
    let _ = write!(text, "\n## {name}\n\n{about}\n");
    let shown = |arg: &&Arg| !matches!(arg.get_id().as_str(), "help" | "version");
    let args: Vec<&Arg> = command.get_arguments().filter(shown).collect();
    let is_only_a_group =
        command.is_subcommand_required_set() || name.ends_with("batch") || name.ends_with("study");
    if !is_only_a_group {
        text.push_str("\n| flag | default | decides | |\n|---|---|---|---|\n");
        for arg in args {
            row(text, arg);
        }
    }
    for inner in command
        .get_subcommands()
        .filter(|inner| inner.get_name() != "help")
    {
        section(text, inner, &format!("{name} {}", inner.get_name()));
    }
}

fn row(text: &mut String, arg: &Arg) {
    let id = arg.get_id().as_str().replace('_', "-");
    let values = arg.get_value_names().unwrap_or_default();
    let values = if arg.get_action().takes_values() {
        values.join(" ")
    } else {
        String::new()
    };
    let flag = match arg.get_long() {
        Some(long) if values.is_empty() => format!("--{long}"),
        Some(long) => format!("--{long} {values}"),
        None => values,
    };
    let key = match arg.get_long() {
        Some(long) if long != id => format!(" (`{id}` in variables and files)"),
        _ => String::new(),
    };
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let (what, stated) = match help.rsplit_once("; default: ") {
        Some((what, default)) => (what.to_owned(), default.to_owned()),
        None => (help, String::new()),
    };
    let defaults: Vec<String> = arg
        .get_default_values()
        .iter()
        .map(|value| value.to_string_lossy().into())
        .collect();
    let default = match &defaults[..] {
        _ if !arg.get_action().takes_values() => "off".to_owned(),
        [] if arg.is_required_set() => "required".to_owned(),
        [] => stated,
        values => format!("`{}`", values.join(",")),
    };
    let possible = arg.get_possible_values();
    let words: Vec<String> = possible
        .iter()
        .map(|value| format!("`{}`", value.get_name()))
        .collect();
    let words = if words.is_empty() || !arg.get_action().takes_values() {
        String::new()
    } else {
        format!(": {}", words.join(", "))
    };
    let escaped = |text: &str| text.replace('|', "\\|").replace('\n', " ");
    let _ = writeln!(
        text,
        "| `{}`{key} | {} | {} | {}{words} |",
        escaped(&flag),
        escaped(&default),
        Decides::of(arg).map_or("", Decides::word),
        escaped(&what)
    );
}

#[test]
fn the_flag_reference_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/docs/flags.md");
    let reference = reference();
    if std::env::var_os("UPDATE").is_some() {
        fs::write(&path, &reference).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == reference,
        "src/docs/flags.md is out of date: UPDATE=1 cargo test --lib cli:: writes it"
    );
}

/// All commands, the program itself first.
fn commands(command: &Clap) -> Vec<&Clap> {
    let inner = command
        .get_subcommands()
        .filter(|inner| inner.get_name() != "help");
    std::iter::once(command)
        .chain(inner.flat_map(commands))
        .collect()
}

fn is_of_clap(arg: &Arg) -> bool {
    matches!(arg.get_id().as_str(), "help" | "version")
}

#[test]
fn every_flag_says_what_it_is_what_it_decides_and_its_default() {
    let mut root = Cli::command();
    root.build();
    let mut wrong = Vec::new();
    for command in commands(&root) {
        for arg in command.get_arguments().filter(|arg| !is_of_clap(arg)) {
            let name = format!("{} {}", command.get_name(), arg.get_id());
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            if help.is_empty() {
                wrong.push(format!("{name}: no help"));
            }
            if Decides::of(arg).is_none() {
                wrong.push(format!("{name}: no class, as `add = Decides::Nothing`"));
            }
            let has_default = !arg.get_action().takes_values()
                || arg.is_required_set()
                || arg.is_positional()
                || !arg.get_default_values().is_empty()
                || help.contains("; default: ");
            if !has_default {
                wrong.push(format!("{name}: no default, as `; default: none`"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The words of a text, without line breaks, indentation and the escapes of roff.
fn words_of(text: &str) -> String {
    let plain = text.replace("\\-", "-").replace("\\\\", "\\");
    plain
        .split_whitespace()
        .filter(|word| *word != ".br")
        .collect::<Vec<_>>()
        .join(" ")
        .replace("\\&", "")
        .replace("\\*(Aq", "'")
}

#[test]
fn the_manual_says_what_the_help_says() {
    let mut root = command::command();
    root.build();
    let mut wrong = Vec::new();
    for command in commands(&root) {
        let mut page = Vec::new();
        clap_mangen::Man::new(command.clone())
            .render(&mut page)
            .unwrap();
        let page = words_of(&String::from_utf8(page).unwrap());
        let shown = words_of(&command.clone().term_width(0).render_long_help().to_string());
        for arg in command.get_arguments().filter(|arg| !is_of_clap(arg)) {
            let help = arg.get_long_help().or(arg.get_help());
            let help = words_of(&help.map(ToString::to_string).unwrap_or_default());
            for (text, place) in [(&page, "manual"), (&shown, "help")] {
                if !text.contains(&help) {
                    wrong.push(format!(
                        "{} {}: not in the {place}",
                        command.get_name(),
                        arg.get_id()
                    ));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn warnings_of_every_crate_are_shown() {
    let log = tempfile::NamedTempFile::new().unwrap();
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::new(LOGGED))
        .with_writer(std::sync::Mutex::new(log.reopen().unwrap()))
        .finish();
    tracing::subscriber::with_default(subscriber, || {
        tracing::warn!(target: "darkqa_eval::engine", "of the program");
        tracing::warn!(target: "darkqa_enhance::probe", "of a library");
        tracing::info!(target: "darkqa_enhance::probe", "a detail");
        tracing::warn!(target: "ort", "of a dependency");
    });
    let shown = fs::read_to_string(log.path()).unwrap();
    assert!(shown.contains("of the program") && shown.contains("of a library"));
    assert!(!shown.contains("a detail") && !shown.contains("of a dependency"));
}
