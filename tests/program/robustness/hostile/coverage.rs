//! The cases themselves: no subcommand is without one, and each call is sound before a file is damaged.

use crate::robustness::hostile::cases::CASES;
use crate::robustness::hostile::seeds::Seeds;
use crate::robustness::hostile::trial::Trial;
use crate::support::run::{Bench, words};

/// The subcommands below a command, by their words; `help` is one of the program alone.
fn subcommands(bench: &Bench, above: &str) -> Vec<String> {
    let help = bench.complete(&[words(above), vec!["--help"]].concat());
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let names = lines
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .filter(|name| !name.is_empty() && (above.is_empty() || *name != "help"));
    let mut all = Vec::new();
    for name in names {
        let command = format!("{above} {name}").trim().to_owned();
        let inner = if name == "help" { Vec::new() } else { subcommands(bench, &command) };
        if inner.is_empty() {
            all.push(command);
        }
        all.extend(inner);
    }
    all
}

/// The subcommands that open no file: ffmpeg decodes videos, and bags of ROS 1 are only named.
const READ_NOTHING: [&str; 3] = ["enhance presets", "import rosbag", "import video"];

#[test]
fn every_subcommand_has_a_case() {
    let all = subcommands(&Bench::new(), "");
    assert!(all.len() > 25, "{all:?}");
    let is_covered = |command: &&String| {
        let begin = format!("{command} ");
        READ_NOTHING.contains(&command.as_str()) || CASES.iter().any(|case| case.line.starts_with(&begin))
    };
    let missing: Vec<&String> = all.iter().filter(|command| !is_covered(command)).collect();
    assert!(missing.is_empty(), "without a case: {missing:?}");
    assert!(CASES.iter().any(|case| case.line.starts_with("--")));
}

#[test]
fn undamaged_calls_are_sound() {
    let seeds = Seeds::make();
    let folder = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for case in CASES {
        let verdict = Trial::sound(case).run(&seeds, &folder.path().join("case"));
        // An endpoint that turns every request away ends a run.
        let is_refused = case.reads.contains(&"reply/refusal.http");
        let expected: &[i32] = if is_refused { &[2] } else { &[0, 1] };
        let is_sound = verdict.code.is_some_and(|code| expected.contains(&code));
        if !is_sound || !verdict.faults.is_empty() {
            let faults = verdict.faults;
            wrong.push(format!("{}\n{:?} {faults:?}\n{}", case.line, verdict.code, verdict.stderr));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
