mod keyed;

use std::fs;
use std::sync::LazyLock;

use clap::CommandFactory as _;

use super::*;
use crate::commands::cli::{Cli, command};
use darkqa_base::types::flags::flag_spelling;

/// The command line, made once for all calls.
static COMMAND: LazyLock<Command> = LazyLock::new(command::command);

/// The matches of these words, these variables and a file `c.toml` with this text.
fn parsed(words: &[&str], variables: &[(&str, &str)], file: &str) -> Result<ArgMatches, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.toml");
    fs::write(&path, file).unwrap();
    let mut words: Vec<OsString> = words.iter().map(OsString::from).collect();
    words.insert(0, "darkqa-eval".into());
    if !file.is_empty() {
        words.extend(["--config".into(), path.into()]);
    }
    let variables: BTreeMap<&str, &str> = variables.iter().copied().collect();
    parse(COMMAND.clone(), words, |name| Some(variables.get(name)?.into())).map(|parsed| parsed.matches).map_err(
        |problem| match problem {
            Problem::Error(error) => error.to_string(),
            Problem::Help(help) => help.to_string(),
        },
    )
}

/// The values of a flag of the command that is called.
fn values(matches: &ArgMatches, id: &str) -> Vec<String> {
    command_matches(matches).get_raw(id).into_iter().flatten().map(|value| value.to_string_lossy().into()).collect()
}

/// All commands with the words that call them, nested ones included.
fn commands(command: &Command, path: &[String]) -> Vec<(Vec<String>, Command)> {
    let mut all = vec![(path.to_vec(), command.clone())];
    for inner in command.get_subcommands() {
        if inner.get_name() != "help" {
            let path = [path, &[inner.get_name().to_owned()]].concat();
            all.extend(commands(inner, &path));
        }
    }
    all
}

/// A valid value of a flag that is not its default.
fn sample(arg: &Arg) -> String {
    let possible = arg.get_possible_values();
    if let Some(last) = possible.last() {
        return last.get_name().to_owned();
    }
    let text = match arg.get_id().as_str() {
        "levels" => "L3",
        "variant" | "llie_on" => "ev",
        "auto" => "gain=3",
        "motion" => "speed=3",
        "temperature" | "judge_temperature" => "0.7",
        "concurrency" => "4",
        "image" => "jpeg:90",
        "tile" => "whole",
        "size" => "64x48",
        "answers" => "people=answers.json",
        "condition" => "L3-noise",
        "map" => "question=abc",
        "enhanced" | "moved_enhanced" => "mine=abc",
        "bad" => "9%",
        "url" => "/v1/responses",
        "families" => "color",
        "crop" => "0,0,256,256",
        "width" => "neurips",
        "columns" => "2",
        "at" => "3",
        "label" => "abc=name",
        "font_size" | "images_cache_size" | "llie_max_memory" => "9",
        "top_p" => "0.9",
        "data" | "model" | "judge" => "abc",
        _ => match arg.get_value_names() {
            Some([name])
                if [
                    "N", "SECONDS", "PIXELS", "MB", "DOLLARS", "EV", "K", "R", "METRES", "DEGREES", "CODE", "CODES",
                    "HOURS", "LUX", "TIME",
                ]
                .contains(&name.as_str()) =>
            {
                "3"
            }
            Some([name]) if name == "PIXELS|native" || name == "N|none" => "3",
            _ => "abc",
        },
    };
    text.to_owned()
}

/// The words that a command requires, without one flag.
fn required(command: &Command, without: &Arg) -> Vec<String> {
    let mut words = Vec::new();
    for arg in command.get_arguments() {
        let conflicts = hides(command, without, arg);
        // Needed unless another flag is set.
        let id = arg.get_id().as_str();
        let unless =
            ["inputs", "pairs", "out", "src"].contains(&id) || ["folder", "model"].contains(&id) && arg.is_positional();
        if conflicts || !arg.is_required_set() && !unless {
            continue;
        }
        if let Some(flag) = arg.get_long() {
            words.push(format!("--{flag}={}", sample(arg)));
        } else {
            words.push(sample(arg));
        }
    }
    words
}

#[test]
fn every_flag_can_be_set_by_word_variable_and_file() {
    let mut all = Cli::command();
    all.build();
    let (mut wrong, mut count) = (Vec::new(), 0);
    for (path, command) in commands(&all, &[]) {
        let has_own_flags = command.get_arguments().any(|arg| !arg.is_global_set() && arg.get_id() != "help");
        if !path.is_empty() && !has_own_flags {
            continue;
        }
        for arg in settable_flags(&command) {
            count += 1;
            let id = arg.get_id().as_str();
            let flag = arg.get_long().unwrap();
            let switch = !arg.get_action().takes_values();
            let value = if switch { "true".to_owned() } else { sample(arg) };
            // Other words that the flag requires.
            let mut words = [&path[..], &required(&command, arg)].concat();
            match id {
                "normal" => words.push("--low=abc".to_owned()),
                "low" => {
                    words.retain(|word| word != "abc");
                    words.push("--normal=abc".to_owned());
                }
                "fail_if_worse" => words.push("--baseline=abc".to_owned()),
                _ => {}
            }
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let word = if switch { format!("--{flag}") } else { format!("--{flag}={value}") };
            let (variable, key) = (variable_name(&name_of(arg)), name_of(arg));
            let table = match &path[..] {
                [] => String::new(),
                path => format!("[{}]\n", path.join(".")),
            };
            let typed = parsed(&[&words[..], &[&word]].concat(), &[], "");
            let set = parsed(&words, &[(&variable, &value)], "");
            let top = parsed(&words, &[], &format!("{key} = {value:?}"));
            let filed = parsed(&words, &[], &format!("{table}{key} = {value:?}"));
            for (how, matches) in [("word", typed), ("variable", set), ("file", top), ("table", filed)] {
                let found = matches.map(|matches| values(&matches, id));
                let expected = vec![value.clone()];
                if found.as_ref() != Ok(&expected) {
                    wrong.push(format!("{path:?} {flag} by {how}: {found:?} for {expected:?}"));
                }
            }
        }
    }
    assert!(count > 150, "{count}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_flag_states_its_default() {
    let mut all = Cli::command();
    all.build();
    for (path, command) in commands(&all, &[]) {
        for arg in command.get_arguments() {
            let help = arg.get_long_help().or(arg.get_help());
            let help = help.map(ToString::to_string).unwrap_or_default();
            let stated = !arg.get_action().takes_values()
                || arg.get_long().is_none()
                || arg.is_required_set()
                || !arg.get_default_values().is_empty()
                || help.contains("default: ")
                || help.contains("(required");
            assert!(stated, "{path:?} {}: no default is stated", arg.get_id());
        }
    }
}

#[test]
fn a_group_without_words_has_its_default_values() {
    fn defaults<A: clap::Args + std::fmt::Debug>() -> String {
        let command = A::augment_args(Command::new("group"));
        let matches = command.try_get_matches_from(["group"]).unwrap();
        format!("{:?}", A::from_arg_matches(&matches).unwrap())
    }
    let sending = format!("{:?}", darkqa_ask::Sending::default());
    assert_eq!(defaults::<darkqa_ask::Sending>(), sending);
    let rooms = format!("{:?}", darkqa_rooms::Rooms::default());
    assert_eq!(defaults::<darkqa_rooms::Rooms>(), rooms);
    let parameters = darkqa_ask::Parameters::new(String::new());
    assert_eq!(defaults::<darkqa_ask::Parameters>(), format!("{parameters:?}"));
}

#[test]
fn words_override_variables_and_variables_override_the_file() {
    let variables = [("DARKQA_SEED", "2"), ("DARKQA_GAIN", "0.5"), ("DARKQA_MODEL", "a,b"), ("DARKQA_BLIND", "true")];
    let file = "seed = 3\ngain = 1\nratio = 150\nmodel = [\"c\"]\nquiet = false\nfamilies = [\"x\", \"y\"]\n";
    let matches = parsed(&["--seed", "1"], &variables, file).unwrap();
    for (id, expected) in [
        ("seed", &["1"][..]),
        ("gain", &["0.5"]),
        ("ratio", &["150"]),
        ("model", &["a", "b"]),
        ("families", &["x", "y"]),
    ] {
        assert_eq!(values(&matches, id), expected, "{id}");
    }
    assert!(matches.get_flag("blind") && !matches.get_flag("quiet"));
}

#[test]
fn a_table_of_a_command_overrides_the_top_and_affects_no_other_command() {
    let file = "seed = 3\n[synthesize]\nseed = 4\nsheet = \"noise\"\n[batch.export]\nseed = 5\n";
    let words = ["synthesize", "in", "--out", "out"];
    let matches = parsed(&words, &[], file).unwrap();
    assert_eq!(values(&matches, "seed"), ["4"]);
    assert_eq!(values(&matches, "sheet"), ["noise"]);
    assert_eq!(values(&parsed(&[], &[], file).unwrap(), "seed"), ["3"]);
    let matches = parsed(&["batch", "export"], &[], file).unwrap();
    assert_eq!(values(&matches, "seed"), ["5"]);
}

#[test]
fn a_mistyped_key_in_the_table_of_another_command_is_refused() {
    for (file, part) in [
        ("[synthesize]\nsheeet = \"noise\"", "did you mean --sheet?"),
        ("[batch.export]\nsede = 5", "did you mean --seed?"),
        ("[batch]\nsede = 5", "did you mean --seed?"),
    ] {
        let error = parsed(&[], &[], file).unwrap_err();
        assert!(error.contains(part), "{file}: {error}");
    }
    parsed(&[], &[], "[batch]\nseed = 5").unwrap();
}

#[test]
fn the_first_layer_that_sets_a_switch_decides() {
    for (variable, file, expected) in [
        ("false", "allow-http = true", false),
        ("", "allow-http = false", false),
        ("true", "allow-http = false", true),
        ("", "allow-http = true", true),
        ("", "", false),
    ] {
        let matches = parsed(&[], &[("DARKQA_ALLOW_HTTP", variable)], file).unwrap();
        assert_eq!(matches.get_flag("allow_http"), expected, "{variable} {file}");
    }
}

#[test]
fn a_flag_hides_conflicting_flags_of_lower_layers() {
    let file = "resume = \"old\"\napi-key-env = \"KEY\"";
    let words = ["--out", "new"];
    let matches = parsed(&words, &[("DARKQA_API_KEY_FILE", "key")], file).unwrap();
    assert_eq!(values(&matches, "out"), ["new"]);
    assert_eq!(values(&matches, "api_key_file"), ["key"]);
    assert!(values(&matches, "resume").is_empty());
    assert!(values(&matches, "api_key_env").is_empty());
}

#[test]
fn errors_name_the_source_of_a_value_and_suggest_a_correction() {
    let error = parsed(&[], &[("DARKQA_RETRIES", "many")], "").unwrap_err();
    assert!(error.starts_with("DARKQA_RETRIES: invalid value 'many'"), "{error}");
    for (words, file, part) in [
        (&[][..], "sed = 1", "c.toml, sed: there is no flag --sed here; did you mean --seed?"),
        (&[], "retries = \"many\"", "c.toml, retries: invalid value 'many'"),
        (&[], "blind = 3", "c.toml, blind: true or false"),
        (&[], "[synthesise]\nseed = 1", "there is no command synthesise; did you mean synthesize?"),
        (&["synthesize", "a", "--out=b"], "model = \"m\"", "model: there is no flag --model here"),
        (
            &["synthesize", "a", "--out=b"],
            "[synthesize]\nsheet = \"nose\"",
            "c.toml, synthesize.sheet: invalid value 'nose'",
        ),
        (&["--modle", "m"], "", "found; tip: a similar argument exists: '--model'"),
        (&["synthesise"], "", "tip: a similar subcommand exists: 'synthesize'"),
        (&["--profile", "papre"], "", "a similar value exists: 'paper'"),
    ] {
        let error = parsed(words, &[], file).unwrap_err();
        assert!(error.contains(part), "{part}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(!error.contains("COMMAND"), "{error}");
    }
}

#[test]
fn words_after_two_dashes_stay_where_they_are() {
    let words = ["synthesize", "--out=o", "--", "--odd-name.png"];
    let matches = parsed(&words, &[("DARKQA_SEED", "9")], "").unwrap();
    assert_eq!(values(&matches, "inputs"), ["--odd-name.png"]);
    assert_eq!(values(&matches, "seed"), ["9"]);
}

#[test]
fn a_place_of_data_with_commas_is_one_value_and_several_are_several() {
    let rooms = "rooms:frames=4,seed=7";
    let matches = parsed(&["check"], &[("DARKQA_DATA", rooms)], "").unwrap();
    assert_eq!(values(&matches, "data"), [rooms]);
    let matches = parsed(&["check"], &[], "data = [\"a.csv\", \"b.csv\"]").unwrap();
    assert_eq!(values(&matches, "data"), ["a.csv", "b.csv"]);
    // Typed values replace those of a variable; they are not added to them.
    let typed = ["check", "--data", "a.csv", "--data=b.csv"];
    let matches = parsed(&typed, &[("DARKQA_DATA", rooms)], "").unwrap();
    assert_eq!(values(&matches, "data"), ["a.csv", "b.csv"]);
    let map = "question=q,options=A,B";
    let matches = parsed(&["check"], &[("DARKQA_MAP", map)], "").unwrap();
    assert_eq!(values(&matches, "map"), [map]);
}

#[test]
fn a_file_sends_nothing_of_the_user_to_an_address_of_its_own() {
    let own = "base-url = \"https://evil.example/v1\"\n";
    for (words, line) in [
        ("", "api-key-file = \"Cargo.toml\""),
        ("", "api-key-env = \"OPENAI_API_KEY\""),
        ("", "header-env = [\"X-A=AWS_SECRET_ACCESS_KEY\"]"),
        ("", "system-file = \"Cargo.toml\""),
        ("", "extra-body = \"@Cargo.toml\""),
        ("", "prompts = \"prompts\""),
        ("", "key-anyway = true"),
        // A row of such a table names the variable whose value goes to the host.
        ("", "vendor = \"vendors.toml\""),
    ] {
        let words: Vec<&str> = words.split_whitespace().collect();
        let flag = line.split(' ').next().unwrap();
        let problem = parsed(&words, &[], &format!("{own}{line}\n")).unwrap_err();
        let named = format!("name it on the command line with {}", flag_spelling(flag));
        assert!(problem.contains(&named) && problem.contains("--base-url"), "{line}: {problem}");
    }
    for (words, file) in [
        // The user typed where it goes.
        ("--base-url https://mine.example/v1", format!("{own}api-key-file = \"Cargo.toml\"\n")),
        // The user typed what goes there.
        ("--api-key-env MINE", format!("{own}api-key-env = \"OPENAI_API_KEY\"\n")),
        ("", "api-key-file = \"Cargo.toml\"\n".to_owned()),
        ("", format!("{own}api-key-env = \"none\"\n")),
        ("", "base-url = \"https://api.openai.com/v1\"\napi-key-env = \"OPENAI_API_KEY\"\n".to_owned()),
        ("", format!("{own}extra-body = '{{\"a\": 1}}'\n")),
    ] {
        let words: Vec<&str> = words.split_whitespace().collect();
        let found = parsed(&words, &[], &file);
        assert!(found.is_ok(), "{words:?} {file}: {:?}", found.err());
    }
}

#[test]
fn the_default_key_goes_to_no_address_that_only_a_file_names() {
    let set = [("OPENAI_API_KEY", "sk-1")];
    let own = "base-url = \"https://evil.example/v1\"\n";
    for (words, file, flag) in [
        ("", own, "--api-key-env OPENAI_API_KEY"),
        (
            "openeqa --questions q.json --frames f",
            "judge-base-url = \"https://evil.example/v1\"\n",
            "--judge-api-key-env OPENAI_API_KEY",
        ),
    ] {
        let words: Vec<&str> = words.split_whitespace().collect();
        let problem = parsed(&words, &set, file).unwrap_err();
        assert!(problem.contains(flag), "{problem}");
        assert!(problem.contains("c.toml, "), "{problem}");
        assert_eq!(parsed(&words, &[], file).err(), None, "{file}");
    }
    for (words, file) in [
        ("--api-key-env OPENAI_API_KEY", own),
        ("--base-url https://mine.example/v1", own),
        ("", "base-url = \"http://127.0.0.1:8000/v1\"\n"),
        ("", "base-url = \"https://api.openai.com/v1\"\n"),
    ] {
        let words: Vec<&str> = words.split_whitespace().collect();
        assert_eq!(parsed(&words, &set, file).err(), None, "{words:?} {file}");
    }
}

fn current(line: &str) -> String {
    let words = line.split(' ').map(OsString::from).collect();
    let words: Vec<String> = in_current_form(words, 1).iter().map(|word| word.to_string_lossy().into()).collect();
    words.join(" ")
}

#[test]
fn modes_become_subcommands() {
    for (earlier, now) in [
        ("d synthesize --check dir", "d synthesize check dir"),
        ("d synthesize a --out b --from=c", "d synthesize from c a --out b"),
        ("d synthesize a --from c --out b", "d synthesize from c a --out b"),
        ("d enhance m --describe", "d enhance describe m"),
        ("d enhance m a --doctor --write --out b", "d enhance doctor m a --write --out b"),
        ("d import habitat --script", "d import script habitat"),
    ] {
        assert_eq!(current(earlier), now);
    }
}

#[test]
fn other_words_stay() {
    for line in
        ["d synthesize a --out b", "d enhance m -- --describe", "d enhance m a --out b --describe=1", "d check --check"]
    {
        assert_eq!(current(line), line);
    }
}
