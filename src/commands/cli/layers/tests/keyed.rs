//! Keyed flags, and earlier forms of commands.

use clap::CommandFactory as _;

use super::*;
use crate::commands::cli::Cli;
use darkqa_base::types::flags::KEYED_FLAGS;

/// Sets each key of an evaluation by its hidden flag and by its keyed flag, and compares the two.
#[test]
fn a_keyed_flag_sets_what_the_hidden_flags_set() {
    let mut all = Cli::command();
    all.build();
    for keyed in &KEYED_FLAGS {
        for (key, flag) in keyed.keys.iter().filter(|(key, _)| !key.is_empty()) {
            let arg = all.get_arguments().find(|arg| name_of(arg) == *flag).unwrap();
            let sample = sample(arg);
            let (hidden, setting) = if arg.get_action().takes_values() {
                (format!("--{flag}={sample}"), format!("{key}={sample}"))
            } else {
                (format!("--{flag}"), (*key).to_owned())
            };
            let id = arg.get_id().as_str();
            let expected = values(&parsed(&[&hidden], &[], "").unwrap(), id);
            let variable = variable_name(keyed.name);
            let line = format!("{} = {setting:?}", keyed.name);
            for (way, matches) in [
                ("words", parsed(&[&format!("--{}", keyed.name), &setting], &[], "")),
                ("word", parsed(&[&format!("--{}={setting}", keyed.name)], &[], "")),
                ("variable", parsed(&[], &[(&variable, &setting)], "")),
                ("file", parsed(&[], &[], &line)),
            ] {
                let found = matches.map(|matches| values(&matches, id));
                assert_eq!(found.as_ref(), Ok(&expected), "{setting} by {way}");
            }
        }
    }
}

#[test]
fn keys_of_several_layers_are_joined() {
    let variables = [("DARKQA_NOISE", "gain=0.5,fixed"), ("DARKQA_RATIO", "120")];
    let file = "noise = [\"gain=1\", \"ratio=150\", \"tone=none\"]\n";
    let matches = parsed(&["--noise", "camera=c.toml"], &variables, file).unwrap();
    for (id, expected) in [("camera", "c.toml"), ("gain", "0.5"), ("ratio", "120"), ("tone", "none")] {
        assert_eq!(values(&matches, id), [expected], "{id}");
    }
    assert!(matches.get_flag("fixed"));
}

#[test]
fn a_value_without_a_key_may_have_keys_after_it() {
    let words = ["--image", "jpeg:90,max-side=512,first", "--images-cache=a,b"];
    let matches = parsed(&words, &[], "").unwrap();
    assert_eq!(values(&matches, "image"), ["jpeg:90"]);
    assert_eq!(values(&matches, "max_side"), ["512"]);
    assert!(matches.get_flag("image_first"));
    assert_eq!(values(&matches, "images_cache"), ["a,b"]);
}

#[test]
fn a_joined_value_takes_no_further_word() {
    let matches = parsed(&["--noise=gain=3", "--seed", "4", "--shard=1/2"], &[], "").unwrap();
    assert_eq!(values(&matches, "gain"), ["3"]);
    assert_eq!(values(&matches, "seed"), ["4"]);
    assert_eq!(values(&matches, "shard"), ["1/2"]);
}

#[test]
fn a_key_of_one_value_needs_none() {
    let matches = parsed(&["--skip", "open,bad", "--skip=several"], &[], "").unwrap();
    for id in ["open", "bad", "several"] {
        assert_eq!(values(&matches, id), ["skip"], "{id}");
    }
    assert!(values(&matches, "no_image").is_empty());
}

#[test]
fn errors_of_keys_name_the_keyed_flag() {
    for (words, file, part) in [
        (&["--noise", "gian=3"][..], "", "--noise: unknown key \"gian\"; did you mean gain?"),
        (&["--noise", "gain"], "", "--noise: gain has no value; write gain=K"),
        (&["--noise", "fixed=3"], "", "--noise: fixed takes true or false, not \"3\""),
        (&["--noise", "gain=x"], "", "invalid value 'x' for '--noise gain=<K>'"),
        (&["--gain", "x"], "", "invalid value 'x' for '--noise gain=<K>'"),
        (&["--noise", "tone=nne"], "", "a similar value exists: 'none'"),
        (&["--noise", "gain=1", "--gain", "2"], "", "'--noise gain=<K>' cannot be used multiple"),
        (&["--gian", "2"], "", "'--gian' found"),
        (&[], "noise = \"gain=x\"", "c.toml, noise: invalid value 'x' for '--noise gain=<K>'"),
        (&[], "noise = \"gian=x\"", "c.toml, noise: unknown key \"gian\""),
        (&[], "gain = 1\nnoise = \"gain=2\"", "--noise gain is set twice, by"),
    ] {
        let error = parsed(words, &[], file).unwrap_err();
        assert!(error.contains(part), "{part}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}

#[test]
fn earlier_forms_call_the_subcommands() {
    for (earlier, now) in [
        ("synthesize --check d", "synthesize check d"),
        ("synthesize a --from f --out b", "synthesize from f a --out b"),
        ("enhance m --describe --tile 64", "enhance describe m --llie-options tile=64"),
        ("enhance --doctor m a --out b --write", "enhance doctor m a --out b --write"),
        ("import habitat --script", "import script habitat"),
    ] {
        let [earlier, now] = [earlier, now].map(|line| {
            let words: Vec<&str> = line.split(' ').collect();
            let matches = parsed(&words, &[], "").unwrap();
            let (path, own) = called_command(&matches);
            let set = ["model", "inputs", "input", "file", "folder", "kind", "out", "tile"].map(|id| {
                own.try_get_raw(id).ok().flatten().into_iter().flatten().map(OsString::from).collect::<Vec<_>>()
            });
            (path, set)
        });
        assert_eq!(earlier, now);
    }
}

#[test]
fn a_subcommand_ignores_the_flags_of_the_command_around_it() {
    let file = "[synthesize]\nlevels = \"L3\"\n";
    assert!(parsed(&["synthesize", "check", "d"], &[], file).is_ok());
    let problem = parsed(&["synthesize", "check", "d"], &[], "[synthesize]\nlevles = 1\n");
    assert!(problem.unwrap_err().contains("--levles"));
}
