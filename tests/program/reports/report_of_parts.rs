//! Reports on the parts of a run that nobody merged: what the merged run reports, and what is missing.

use std::fs;
use std::path::Path;

use crate::support::run::{Bench, called, words};

/// The files of a run that are no products of its report.
const OWN_FILES: [&str; 6] =
    ["manifest.json", "records.jsonl", "records.parquet", "questions.jsonl", "thumbnails.jsonl", "fidelity.jsonl"];

/// The command of an evaluation with images of six rooms, and more flags.
fn evaluation(more: &str) -> Vec<&str> {
    let flags = words("--model observer --blind-model random --levels L0,L3");
    [flags, words(more)].concat()
}

/// Checks that a folder of parts has the report of the merged run, byte for byte, and nothing else new.
#[track_caller]
fn assert_report_of(merged: &Path, parts: &Path) {
    let mut compared = 0;
    for entry in fs::read_dir(merged).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() || OWN_FILES.contains(&name) {
            assert!(!parts.join(name).exists() || path.is_dir(), "{name}");
            continue;
        }
        let (one, other) = (fs::read(&path).unwrap(), fs::read(parts.join(name)).unwrap());
        assert!(one == other, "{name} differs");
        compared += 1;
    }
    assert!(compared > 8, "{compared}");
}

/// Reports on the run `a` in a folder, named as the folder of parts is: a report has the name that its run is called
/// by.
fn report_in(bench: &Bench, folder: &str) -> String {
    let mut command = bench.command(&["report", "a"]);
    let reported = called(command.current_dir(bench.path(folder)));
    assert_eq!(reported.code, Some(0), "{reported:?}");
    reported.stdout
}

#[test]
fn parts_report_what_merged_run_does() {
    let bench = Bench::new();
    for part in ["1/3", "2/3", "3/3"] {
        bench.complete(&evaluation(&format!("--out a --shard {part}")));
    }
    bench.complete(&words("merge a --out whole/a"));
    let merged = report_in(&bench, "whole");
    let reported = bench.call(&words("report a"));
    assert_eq!(reported.code, Some(0), "{reported:?}");
    assert_eq!(reported.stderr, "");
    assert_eq!(reported.stdout, merged);
    assert_report_of(&bench.path("whole/a"), &bench.path("a"));
    // The folder is still one of parts.
    bench.complete(&words("merge a --out again/a"));
    report_in(&bench, "again");
    assert_report_of(&bench.path("again/a"), &bench.path("a"));
    // Beside another run it counts as one.
    bench.complete(&evaluation("--out b --seed 5"));
    let texts = ["report a b --out of-parts", "report whole/a b --out of-merged"];
    let texts = texts.map(|line| bench.complete(&words(line)));
    assert_eq!(texts[0].replace("of-parts", "of-merged"), texts[1].replace("whole/a", "a"));
    let comparisons = ["of-parts", "of-merged"].map(|out| fs::read(bench.path(out).join("comparisons.csv")).unwrap());
    assert_eq!(comparisons[0], comparisons[1]);
    // An item of the page is shown again.
    let question = fs::read_to_string(bench.path("whole/a/questions.jsonl")).unwrap();
    let question = question.split('"').nth(3).unwrap().to_owned();
    let shown = ["a", "whole/a"].map(|run| bench.complete(&["show", run, &question, "--out", "shown"]));
    assert_eq!(shown[0], shown[1]);
    // A folder of figures that is a link is not written through.
    #[cfg(unix)]
    {
        fs::remove_dir_all(bench.path("a/figures")).unwrap();
        fs::create_dir(bench.path("elsewhere")).unwrap();
        std::os::unix::fs::symlink(bench.path("elsewhere"), bench.path("a/figures")).unwrap();
        let said = bench.call(&words("report a"));
        assert!(said.stderr.contains("the report is not written"), "{said:?}");
        assert_eq!(fs::read_dir(bench.path("elsewhere")).unwrap().count(), 0);
    }
    let refused = bench.call(&words("report a --rescore"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: --rescore: a holds the parts of a run, and their readings are stored in each: name the parts, or merge
        them with report merge, which reads all replies again
    ");
}

#[test]
fn missing_shards_name_their_command() {
    let bench = Bench::new();
    bench.complete(&words("plan --model observer --levels L0,L3 --out a"));
    let flags = "--model observer --levels L0,L3";
    for part in ["1/3", "3/3"] {
        bench.complete(&words(&format!("{flags} --out a --shard {part}")));
    }
    let reported = bench.call(&words("report a"));
    insta::assert_snapshot!(reported.messages(), @"
    exit code: 0
     WARN 1 shard is missing: 2/3 (2 of 6 frames, 39 trials); the summary covers only the others; darkqa-eval
        --model observer --levels L0,L3 --out a --shard 2/3 asks what is left
    ");
    let command = reported.stderr.split("only the others; ").nth(1).unwrap();
    let command = command.split(" asks what is left").next().unwrap();
    insta::assert_snapshot!(reported.lines_with("incomplete"), @"
    exit code: 0
    ! a: incomplete: all 75 trials are answered, but shards are missing.
    ");
    let before = fs::read(bench.path("a/summary.csv")).unwrap();
    let partial = bench.call(&words("merge a --out partial/a --partial"));
    assert_eq!(partial.code, Some(1), "{partial:?}");
    report_in(&bench, "partial");
    assert_report_of(&bench.path("partial/a"), &bench.path("a"));
    bench.complete(&words(command.strip_prefix("darkqa-eval ").unwrap()));
    let whole = bench.call(&words("report a"));
    assert_eq!(whole.stderr, "");
    assert_ne!(fs::read(bench.path("a/summary.csv")).unwrap(), before);
    // A part of another run among them.
    bench.complete(&words(&format!("{flags} --seed 9 --out other --shard 2/3")));
    fs::rename(bench.path("other/shard-2-of-3"), bench.path("a/shard-2-of-3-other")).unwrap();
    let refused = bench.call(&words("report a"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: a/shard-2-of-3-other: shard 2/3 is of another run than a/shard-1-of-3: its --seed is 9, that of the
        other run is 0
    ");
}
