use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use clap::{Arg, Command as Clap, Parser as _};

use super::*;

#[test]
fn the_command_line_is_sound() {
    Cli::command().help_expected(true).debug_assert();
}

/// All flags of all commands as Markdown.
fn reference() -> String {
    let mut command = Cli::command();
    command.build();
    let mut text = "# All flags\n\nWritten by `UPDATE=1 cargo test --lib cli::`, from what `--help` shows. A variable is `DARKQA_` and the name of the \
                    flag in capitals; a key of a `--config` file is the name of the flag; both have another name where one is given.\n"
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
        text.push_str("\n| flag | default | |\n|---|---|---|\n");
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
    let (what, said) = match help.rsplit_once("; default: ") {
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
        [] => said,
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
        "| `{}`{key} | {} | {}{words} |",
        escaped(&flag),
        escaped(&default),
        escaped(&what)
    );
}

#[test]
fn the_reference_is_that_of_the_program() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/cli/README.md");
    let reference = reference();
    if std::env::var_os("UPDATE").is_some() {
        fs::write(&path, &reference).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == reference,
        "src/cli/README.md is another: UPDATE=1 cargo test --lib cli:: writes it"
    );
}

#[test]
fn the_job_of_kubernetes_says_flags_that_there_are() {
    let text = include_str!("../run/cluster/job.yaml");
    let flags = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("- --"));
    let flags: Vec<String> = flags.map(|flag| format!("--{flag}")).collect();
    assert!(flags.len() > 4);
    let words = std::iter::once("darkqa-eval".to_owned()).chain(flags);
    let args = Cli::try_parse_from(words).unwrap().evaluate;
    let shard = args.job.scale.shard.unwrap();
    let parts = shard.strip_prefix("auto/").unwrap();
    for field in ["completions", "parallelism"] {
        assert!(text.contains(&format!("\n  {field}: {parts}\n")), "{field}");
    }
}
