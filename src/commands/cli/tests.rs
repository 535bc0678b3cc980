use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use clap::{Arg, Command as Clap, CommandFactory as _};

use super::command;
use super::*;
use crate::commands::cli::keyed::{name_of, with_keyed_flags, with_value};
use clap::FromArgMatches as _;
use darkqa_base::types::Decides;
use darkqa_base::types::flags::{KEYED_FLAGS, keyed_form};
use std::ffi::OsString;

#[test]
fn the_command_line_is_valid() {
    command::command().help_expected(true).debug_assert();
}

/// Does not count `--help` and `--version`, and the hidden flags that keyed flags stand for.
#[test]
fn an_evaluation_has_at_most_eighty_flags() {
    let mut command = command::command();
    command.build();
    let flags: Vec<&str> = command
        .get_arguments()
        .filter(|arg| !is_key(arg))
        .filter_map(Arg::get_long)
        .filter(|flag| !matches!(*flag, "help" | "version"))
        .collect();
    assert!(flags.len() <= 80, "{}: {flags:?}", flags.len());
}

#[test]
fn only_keys_are_hidden_and_every_key_belongs_to_a_flag() {
    let mut root = command::command();
    root.build();
    for command in commands(&root) {
        let wrong: Vec<&Arg> = command.get_arguments().filter(|arg| arg.is_hide_set() != is_key(arg)).collect();
        assert!(wrong.is_empty(), "{}: {wrong:?}", command.get_name());
    }
    for command in commands(&root) {
        for arg in command.get_arguments().filter(|arg| is_key(arg)) {
            let (keyed, _) = keyed_form(&name_of(arg)).unwrap();
            let mut visible = command.get_arguments().filter(|arg| !arg.is_hide_set());
            assert!(
                visible.any(|arg| arg.get_long() == Some(keyed.name)),
                "{}: no --{} for {arg}",
                command.get_name(),
                keyed.name
            );
        }
    }
    for (_, flag) in KEYED_FLAGS.iter().flat_map(|keyed| keyed.keys) {
        let has = root.get_arguments().any(|arg| name_of(arg) == *flag);
        assert!(has, "an evaluation has no flag {flag}");
    }
}

#[test]
fn completions_offer_no_hidden_flag() {
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish, Shell::Elvish, Shell::PowerShell] {
        let script = completions(shell).output;
        assert!(script.contains("noise") && !script.contains("amplify "), "{shell}");
        assert!(!script.contains("llie-max-side") && script.contains("openeqa"), "{shell}");
    }
}

/// The text of a help, as for a terminal of 80 columns.
fn help(line: &str) -> String {
    let words = line.split(' ').map(OsString::from).collect();
    match layers::parse(command::command().term_width(80), words, |_| None) {
        Err(layers::Problem::Help(help)) => help.to_string(),
        _ => panic!("{line}: no help"),
    }
}

#[test]
fn short_help_fits_a_screen() {
    let help = help("darkqa-eval -h");
    assert!(help.lines().count() <= 60, "{}", help.lines().count());
    for line in help.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
}

#[test]
fn short_help_of_openeqa_fits_two_screens() {
    let help = help("darkqa-eval openeqa -h");
    assert!(help.lines().count() <= 90, "{}", help.lines().count());
}

#[test]
fn rare_flags_of_openeqa_exist() {
    let root = command::command();
    let openeqa = root.find_subcommand("openeqa").unwrap();
    for long in command::RARE_OPENEQA_FLAGS {
        assert!(openeqa.get_arguments().any(|arg| arg.get_long() == Some(long)), "--{long}");
    }
}

#[test]
fn short_help_names_flags_that_exist() {
    let root = command::command();
    let help = help("darkqa-eval -h");
    let flags: BTreeSet<&str> =
        help.split(|c: char| c != '-' && !c.is_ascii_alphanumeric()).filter(|word| word.starts_with('-')).collect();
    assert!(flags.len() > 20, "{flags:?}");
    for flag in flags {
        let exists = root.get_arguments().any(|arg| {
            let short = arg.get_short().map(|short| format!("-{short}"));
            let long = arg.get_long().map(|long| format!("--{long}"));
            [short, long].contains(&Some(flag.to_owned()))
        });
        let is_help = matches!(flag, "-h" | "--help");
        assert!(is_help || exists, "there is no flag {flag}");
    }
    // A short and a long form on one line must belong to the same flag.
    for line in help.lines().filter_map(|line| line.strip_prefix("  -")) {
        let Some((short, rest)) = line.split_once(", --") else {
            continue;
        };
        let long = rest.split(' ').next();
        let mut args = root.get_arguments();
        let arg = args.find(|arg| arg.get_long() == long).unwrap();
        assert_eq!(arg.get_short().map(String::from).as_deref(), Some(short));
    }
}

#[test]
fn short_help_names_every_command() {
    let help = help("darkqa-eval -h");
    let words: BTreeSet<&str> = help.split(|c: char| c != '-' && !c.is_ascii_alphanumeric()).collect();
    let root = command::command();
    for command in root.get_subcommands().filter(|inner| !inner.is_hide_set()) {
        assert!(words.contains(command.get_name()), "{command}");
    }
}

#[test]
fn long_help_lists_the_model_first() {
    let help = help("darkqa-eval --help");
    let (_, groups) = help.split_once("\nModel:\n").unwrap();
    let first: String = groups.split_whitespace().take(3).collect();
    assert_eq!(first, "-m,--model<NAME>");
    assert!(groups.contains("(required") && groups.contains("\nData:\n"));
}

#[test]
fn commands_on_evaluations_do_not_repeat_its_flags() {
    for (command, own) in [
        ("check", "--deep"),
        ("plan", "--help"),
        ("batch run", "--window"),
        ("batch export", "--help"),
        ("openeqa", "--questions"),
    ] {
        let short = help(&format!("darkqa-eval {command} -h"));
        let long = help(&format!("darkqa-eval {command} --help"));
        assert!(short.contains("takes the flags of an evaluation"), "{short}");
        assert!(!short.contains("--top-p") && long.contains("--top-p"));
        assert!(short.contains(own), "{own}: {short}");
    }
    let other = help("darkqa-eval batch status -h");
    assert!(!other.contains("takes the flags of an evaluation"), "{other}");
}

/// The command line as a structure, in text form, and the flags that were typed.
fn parsed(line: &str) -> (String, BTreeSet<String>) {
    let words = line.split(' ').map(OsString::from).collect();
    let Ok(parsed) = layers::parse(command::command(), words, |_| None) else {
        panic!("{line} is refused");
    };
    let cli = Cli::from_arg_matches(&parsed.matches);
    (format!("{cli:?}"), parsed.typed)
}

#[test]
fn a_short_form_sets_the_same_as_its_long_flag() {
    assert_eq!(
        parsed("d -m random -d set.tsv -e lift -n -q -o out"),
        parsed("d --model random --data set.tsv --llie lift --dry-run --quiet --out out")
    );
    assert_eq!(parsed("d -q enhance m.onnx --describe"), parsed("d --quiet enhance describe m.onnx"));
}

/// All flags of all commands as Markdown.
fn reference() -> String {
    let mut command = command::with_other_forms(with_keyed_flags(Cli::command()));
    command.build();
    let mut text = "# All flags\n\nEvery flag of every command, with its default and what it decides. A flag that means the same in several commands is \
                    described at the first of them. A variable is `DARKQA_` and the name of the flag in capitals; a key of a `--config` file is the name of \
                    the flag; both have another name where one is given. A flag decides which *trials* there are, what a model is sent besides the image \
                    (*reply*), the content of images (*pixels*), or *nothing* of these: then a run is the same run with any value of it.\n\n\
                    `UPDATE=1 cargo test --lib cli::` writes this page from `--help`.\n"
        .to_owned();
    section(&mut text, &mut BTreeMap::new(), &command, "darkqa-eval");
    text
}

/// Appends a command and those in it. `described` maps each row of the tables so far to the command above it.
fn section(text: &mut String, described: &mut BTreeMap<String, String>, command: &Clap, name: &str) {
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    let _ = write!(text, "\n## {name}\n\n{about}\n");
    let mut args: Vec<&Arg> = command.get_arguments().filter(|arg| !is_added_by_clap(arg)).collect();
    args.sort_by_key(|arg| order(command, arg));
    if !is_only_a_group(command) {
        let mut rows = String::new();
        let mut elsewhere: Vec<(String, Vec<String>)> = Vec::new();
        for arg in args {
            let row = row(arg);
            let Some(first) = described.get(&row) else {
                rows.push_str(&row);
                described.insert(row, name.to_owned());
                continue;
            };
            let flag = format!("`{}`", typed_name(arg));
            match elsewhere.iter_mut().find(|(name, _)| name == first) {
                Some((_, flags)) => flags.push(flag),
                None => elsewhere.push((first.clone(), vec![flag])),
            }
        }
        if !rows.is_empty() {
            let _ = write!(text, "\n| flag | default | decides | |\n|---|---|---|---|\n{rows}");
        }
        for (first, flags) in elsewhere {
            let anchor = first.replace(' ', "-");
            let _ = write!(text, "\nAs in [{first}](#{anchor}): {}\n", flags.join(", "));
        }
    }
    for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help" && !inner.is_hide_set()) {
        section(text, described, inner, &format!("{name} {}", inner.get_name()));
    }
}

/// Returns true if a flag is hidden because a keyed flag sets the same.
fn is_key(arg: &Arg) -> bool {
    keyed_form(&name_of(arg)).is_some()
}

/// Returns true if a command only contains other commands.
fn is_only_a_group(command: &Clap) -> bool {
    let has_own_flags = command.get_arguments().any(|arg| !arg.is_global_set() && !is_added_by_clap(arg));
    command.has_subcommands() && !has_own_flags
}

/// The place of a flag in the list: keys stand below their keyed flag.
fn order(command: &Clap, arg: &Arg) -> (usize, bool) {
    let keyed = KEYED_FLAGS.iter().find(|keyed| {
        let name = name_of(arg);
        keyed.keys.iter().any(|(_, flag)| *flag == name)
    });
    let keyed = keyed.and_then(|keyed| {
        let mut args = command.get_arguments();
        args.find(|arg| arg.get_long() == Some(keyed.name))
    });
    let place = keyed.unwrap_or(arg).get_display_order();
    (place, is_key(arg))
}

/// A key as it is typed, such as `--noise gain=K`; `None` for other flags.
fn typed_key(arg: &Arg) -> Option<String> {
    let (keyed, key) = keyed_form(&name_of(arg))?;
    Some(format!("--{} {}", keyed.name, with_value(key, arg)))
}

/// The name of a flag, a key or an argument, as it is typed and without a value.
fn typed_name(arg: &Arg) -> String {
    match (keyed_form(&name_of(arg)), arg.get_long()) {
        (Some((keyed, key)), _) => format!("--{} {key}", keyed.name),
        (None, Some(long)) => format!("--{long}"),
        (None, None) => arg.get_value_names().unwrap_or_default().join(" "),
    }
}

/// The row of a flag in the table of its command.
fn row(arg: &Arg) -> String {
    let id = arg.get_id().as_str().replace('_', "-");
    let values = arg.get_value_names().unwrap_or_default();
    let values = if arg.get_action().takes_values() { values.join(" ") } else { String::new() };
    let key_flag = typed_key(arg);
    let flag = match arg.get_long() {
        _ if key_flag.is_some() => key_flag.clone().unwrap_or_default(),
        Some(long) => {
            let short = arg.get_short().map(|short| format!("-{short}, "));
            let second = arg.get_visible_aliases().into_iter().flatten();
            let second: String = second.map(|name| format!(", --{name}")).collect();
            let flag = format!("{}--{long}{second} {values}", short.unwrap_or_default());
            flag.trim_end().to_owned()
        }
        None => values,
    };
    let key = match arg.get_long() {
        Some(long) if is_key(arg) => format!(" (`--{long}` until 0.2)"),
        Some(long) if long != id => format!(" (`{id}` in variables and files)"),
        _ => String::new(),
    };
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let (what, stated) = match help.rsplit_once("; default: ") {
        Some((what, default)) => (what.to_owned(), default.to_owned()),
        None => (help, String::new()),
    };
    let defaults: Vec<String> = arg.get_default_values().iter().map(|value| value.to_string_lossy().into()).collect();
    let default = match &defaults[..] {
        _ if !arg.get_action().takes_values() => "off".to_owned(),
        [] if arg.is_required_set() || what.contains("(required") => "required".to_owned(),
        [] => stated,
        values => format!("`{}`", values.join(",")),
    };
    let possible = match key_flag {
        Some(_) => Vec::new(),
        None => arg.get_possible_values(),
    };
    let words: Vec<String> = possible.iter().map(|value| format!("`{}`", value.get_name())).collect();
    let words = if words.is_empty() || !arg.get_action().takes_values() {
        String::new()
    } else {
        format!(": {}", words.join(", "))
    };
    format!(
        "| `{}`{key} | {} | {} | {}{words} |\n",
        in_cell(&flag),
        in_cell(&default),
        Decides::from_arg(arg).map_or("", Decides::word),
        in_cell(&what)
    )
}

/// A text as a cell of a Markdown table.
fn in_cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

#[test]
fn the_flag_reference_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/docs/flags.md");
    let reference = reference();
    if std::env::var_os("UPDATE").is_some() {
        fs::write(&path, &reference).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(written == reference, "src/docs/flags.md is out of date: UPDATE=1 cargo test --lib cli:: writes it");
}

/// All commands, the program itself first.
fn commands(command: &Clap) -> Vec<&Clap> {
    let inner = command.get_subcommands().filter(|inner| inner.get_name() != "help");
    std::iter::once(command).chain(inner.flat_map(commands)).collect()
}

/// Returns true for the flags that clap adds to commands.
fn is_added_by_clap(arg: &Arg) -> bool {
    matches!(arg.get_id().as_str(), "help" | "version")
}

#[test]
fn every_flag_has_help_a_class_and_a_stated_default() {
    let mut root = Cli::command();
    root.build();
    let mut wrong = Vec::new();
    for command in commands(&root) {
        for arg in command.get_arguments().filter(|arg| !is_added_by_clap(arg)) {
            let name = format!("{} {}", command.get_name(), arg.get_id());
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            if help.is_empty() {
                wrong.push(format!("{name}: no help"));
            }
            if Decides::from_arg(arg).is_none() {
                wrong.push(format!("{name}: no class, as `add = Decides::Nothing`"));
            }
            let has_default = !arg.get_action().takes_values()
                || arg.is_required_set()
                || arg.is_positional()
                || help.contains("(required")
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
fn the_manual_has_the_text_of_the_help() {
    let mut root = command::command_for_manual();
    root.build();
    let mut wrong = Vec::new();
    for command in commands(&root) {
        let mut page = Vec::new();
        clap_mangen::Man::new(command.clone()).render(&mut page).unwrap();
        let page = words_of(&String::from_utf8(page).unwrap());
        let shown = words_of(&command.clone().term_width(0).render_long_help().to_string());
        for arg in command.get_arguments() {
            if is_added_by_clap(arg) || arg.is_hide_set() {
                continue;
            }
            let help = arg.get_long_help().or(arg.get_help());
            let help = words_of(&help.map(ToString::to_string).unwrap_or_default());
            // Pages of commands that take the flags of an evaluation refer to the first page, as `-h` does.
            let is_in_page = !arg.is_hide_short_help_set();
            for (text, place, expected) in [(&page, "manual", is_in_page), (&shown, "help", true)] {
                if expected && !text.contains(&help) {
                    wrong.push(format!("{} {}: not in the {place}", command.get_name(), arg.get_id()));
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

fn lines(words: &str) -> Vec<String> {
    let words: Vec<OsString> = std::iter::once("darkqa-eval").chain(words.split(' ')).map(OsString::from).collect();
    let parsed = layers::parse(command::command(), words, |_| None);
    let matches = parsed.map_err(|_| "not parsed").unwrap().matches;
    without_effect(&Cli::from_arg_matches(&matches).unwrap(), &matches)
}

/// Command lines, each with the beginning of the one warning about it.
const WITH_WARNING: &[(&str, &str)] = &[
    ("--model m --blind --llie f.onnx --levels L3", "--levels, --llie: no effect: no model is shown an image"),
    (
        "--blind-model m --max-side 9 --image jpeg:9 --detail low",
        "--image, --image max-side, --image detail: no effect: no model is shown",
    ),
    (
        "--blind-model m --colour ignore --transfer linear --exposure 1",
        "--decode colour, --decode transfer, --decode exposure: no effect: no model is shown",
    ),
    (
        "--model m --levels L0 --variant ev --ratio 9 --fixed",
        "--noise ratio, --noise fixed, --variant: no effect: the only level is L0",
    ),
    ("--model m --variant ev --profile eld", "--profile: no effect: no variant has noise"),
    ("--model m --tile whole --offline", "--llie-options tile, --llie-options offline: no effect: no --llie is named"),
    (
        "--model m --levels L0 --llie-on l0 --ort-lib x --llie-max-side 9",
        "--llie-on, --llie-options max-side, --llie-options ort-lib: no effect: no --llie is named",
    ),
    (
        "--model random --temperature 0 --rpm 9 --max-cost 1 --grace 9",
        "--temperature, --rpm, --max-cost, --stop grace: no effect: all models are built in",
    ),
    ("--model random --constrain json", "--request constrain: no effect: all models are built in"),
    ("--model random --observer-controls", "--observer-controls: no effect: the observer is not asked"),
    ("--model m --ask-per-image 3", "--ask per-image: no effect: no --ask is named"),
    ("--model m --trust-models", "--allow models-file: no effect: no file of models is named"),
    ("--model m --dry-run --timings --grace 9", "--stop grace, --timings: no effect: --dry-run sends nothing"),
    ("batch run --model m --grace 9", "--stop grace: no effect: a batch has no request in flight"),
    ("--model m --dry-run --no-parquet", "--no-parquet: no effect: --dry-run sends nothing"),
    (
        "questions data --out q.jsonl --shard 1/2 --balance none --json",
        "--balance, --json: no effect: a part measures its frames, and the same command without --shard makes the questions",
    ),
    ("report a b --no-parquet", "--no-parquet: no effect: the report is not written"),
    ("report a --out b --no-parquet", "--no-parquet: no effect: the report is not written"),
    ("--model m --images-cache-size 9", "--images-cache size: no effect: no --images-cache is named"),
    (
        "openeqa --questions q --frames f --model m --judge-temperature 1",
        "--judge-temperature: no effect: no judge is named",
    ),
    ("openeqa --questions q --frames f --model m --url /v1", "--url: no effect: only --batch"),
    ("openeqa --questions q --frames f --study s --rpm 9", "--rpm: no effect: --study asks no model"),
    (
        "openeqa --questions q --frames f --model m --levels L0 --gain 1",
        "--noise gain: no effect: the only level is L0",
    ),
    ("synthesize a --out b --sheet noise --variant ev", "--variant: no effect: this sheet"),
    ("--model m --motion speed=3", "--motion: no effect: no variant has motion blur"),
    ("--model m --auto gain=3", "--auto: no effect: no variant has automatic exposure"),
    ("--model m --variant motion --profile eld --gain 1", "--profile, --noise gain: no effect: no variant has noise"),
    (
        "--model m --variant auto --profile eld --gain 1 --camera nikon-d850",
        "--profile, --noise gain: no effect: automatic exposure has",
    ),
    ("export llava a --out b --levels L0 --auto gain=3", "--auto: no effect: the only level is L0"),
    ("synthesize a --out b --levels L0 --tone none", "--noise tone: no effect: the only level is L0"),
    ("export llava a --out b --llie-on ev", "--llie-on: no effect: no --llie"),
    ("realism a --kl-bins kousha --kl-empty drop", "--kl-empty: no effect: the bins of kousha"),
    (
        "plan --model m --out r --shard 1/2 --workers 2",
        "--shard, --shard workers: no effect: a plan is of the whole run",
    ),
    ("plan --model m --out r --dry-run", "--dry-run: no effect: plan asks nothing"),
];

#[test]
fn flags_without_effect_are_named() {
    for (words, idle) in WITH_WARNING {
        let lines = lines(words);
        assert_eq!(lines.len(), 1, "{words}: {lines:?}");
        assert!(lines[0].starts_with(idle), "{words}: {lines:?}");
    }
    for words in [
        "--model m",
        "--model m --dry-run --images-cache d",
        "openeqa --questions q --frames f --study s --images-cache d",
        "--model m --llie f.onnx --tile whole --profile eld --image jpeg:90 --rpm 9",
        "--model m --ask home --ask-per-image 3",
        "report a --no-parquet",
        "merge a --out b --no-parquet",
        "--model m --blind --seed 3 --temperature 1",
        "--model random --seed 3 --shuffle-options",
        "--model observer --observer-controls",
        "--model room-net --offline",
        "openeqa --questions q --frames f --model script:a --judge j --judge-temperature 1 --rpm 9",
        "synthesize a --out b --sheet levels --profile eld",
        "synthesize a --out b --sheet levels --variant ev",
        "--model m --variant ev,motion --motion speed=3",
        "--model m --variant auto --auto gain=3 --motion speed=3 --camera nikon-d850 --fixed",
        "export llava a --out b --llie f.onnx --llie-on both",
        "--model m --levels L0 --llie f.onnx --llie-on l0 --tile whole",
        "realism a --kl-empty drop",
        "enhance m a --out b --tile whole",
    ] {
        assert_eq!(lines(words), [""; 0], "{words}");
    }
}
