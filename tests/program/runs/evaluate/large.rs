//! Runs of more than 16 MB of records: they have an index and a stamp, and read the same without them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::run::{Bench, words};

const COMMAND: &str = "--model random --data rooms:frames=3,size=96x72 --levels L0,L3 --no-parquet --out run";

/// A complete run of which each line of the records ends in many spaces, with its index and its stamp.
fn large_run() -> Bench {
    let bench = Bench::new();
    bench.complete(&words(COMMAND));
    let path = bench.path("run/records.jsonl");
    let records = fs::read_to_string(&path).unwrap();
    let blanks = " ".repeat((17 << 20) / records.lines().count());
    let padded: String = records.lines().map(|line| format!("{line}{blanks}\n")).collect();
    fs::write(&path, padded).unwrap();
    bench.complete(&words(COMMAND));
    bench
}

/// The files of a report, without what is derived for speed.
fn report_files(run: &Path) -> BTreeMap<String, Vec<u8>> {
    let figures = fs::read_dir(run.join("figures")).unwrap();
    fs::read_dir(run)
        .unwrap()
        .chain(figures)
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read(&path).unwrap()))
        .filter(|(name, _)| !["records.index", "report.stamp"].contains(&&**name))
        .collect()
}

/// Replaces the text in the stamp of a run, to see whether the next command prints it.
fn mark_stamp(bench: &Bench) {
    let path = bench.path("run/report.stamp");
    let mut stamp: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    stamp["text"] = "the text of the stamp\n".into();
    fs::write(&path, stamp.to_string()).unwrap();
}

/// True if the command of the run prints the text of a marked stamp instead of making the report.
fn takes_stamp(bench: &Bench, more: &str) -> bool {
    bench.complete(&words(&format!("{COMMAND} {more}"))) == "the text of the stamp\n"
}

#[test]
fn a_report_is_made_again_only_if_something_changed() {
    let bench = large_run();
    let before = report_files(&bench.path("run"));
    mark_stamp(&bench);
    assert!(takes_stamp(&bench, ""));
    assert!(report_files(&bench.path("run")) == before);

    assert!(!takes_stamp(&bench, "--full"), "another text is asked for");
    fs::remove_file(bench.path("run/report.html")).unwrap();
    bench.complete(&words(COMMAND));
    assert!(report_files(&bench.path("run")) == before, "the page is made again");
    for file in ["summary.csv", "figures/accuracy.svg", "thumbnails.jsonl"] {
        mark_stamp(&bench);
        assert!(takes_stamp(&bench, ""), "before {file}");
        let path = bench.path("run").join(file);
        let content = fs::read(&path).unwrap_or_else(|e| panic!("{file}: {e}"));
        fs::write(&path, [&content[..], b"\n"].concat()).unwrap();
        assert!(!takes_stamp(&bench, ""), "{file} was changed");
        fs::write(&path, content).unwrap();
        bench.complete(&words(COMMAND));
    }
}

#[test]
fn a_record_that_was_edited_or_removed_is_not_missed() {
    let bench = large_run();
    let run = bench.path("run");
    let before = report_files(&run);
    let log = fs::read_to_string(run.join("records.jsonl")).unwrap();
    mark_stamp(&bench);
    // A reply in the middle becomes another one, in a line of the same length.
    let places: Vec<usize> = log.match_indices("\"reply\":\"").map(|(place, found)| place + found.len()).collect();
    let place = places[places.len() / 2];
    let other = if log[place..].starts_with('A') { "B" } else { "A" };
    let mut edited = log.clone();
    edited.replace_range(place..=place, other);
    fs::write(run.join("records.jsonl"), &edited).unwrap();
    assert!(!takes_stamp(&bench, ""));
    let with_index = report_files(&run);
    for name in ["records.index", "report.stamp"] {
        let _ = fs::remove_file(run.join(name));
    }
    bench.complete(&words(COMMAND));
    assert!(report_files(&run) == with_index);

    fs::write(run.join("records.jsonl"), &log).unwrap();
    bench.complete(&words(COMMAND));
    let shorter = log.split_inclusive('\n').skip(1).collect::<String>();
    fs::write(run.join("records.jsonl"), shorter).unwrap();
    bench.complete(&words(COMMAND));
    let lines = fs::read_to_string(run.join("records.jsonl")).unwrap().lines().count();
    assert_eq!(lines, log.lines().count(), "its trial is asked again");
    for name in ["summary.csv", "comparisons.csv", "flips.csv"] {
        assert!(report_files(&run)[name] == before[name], "{name}");
    }
}

#[test]
fn damaged_indices_and_stamps_change_no_report() {
    let bench = large_run();
    let run = bench.path("run");
    let before = report_files(&run);
    let printed = bench.complete(&words(COMMAND));
    for name in ["records.index", "report.stamp"] {
        let whole = fs::read(run.join(name)).unwrap();
        let half = whole.len() / 2;
        for (damage, content) in [
            ("cut", whole[..half].to_vec()),
            ("a changed byte", [&whole[..half], &[whole[half] ^ 4], &whole[half + 1..]].concat()),
            ("other bytes", b"{}\n".repeat(half / 3)),
            ("empty", Vec::new()),
        ] {
            for command in [COMMAND, "report run --no-parquet"] {
                fs::write(run.join(name), &content).unwrap();
                assert_eq!(bench.complete(&words(command)), printed, "{name}: {damage}, {command}");
                assert!(report_files(&run) == before, "{name}: {damage}, {command}");
            }
        }
        fs::remove_file(run.join(name)).unwrap();
        assert_eq!(bench.complete(&words(COMMAND)), printed);
        assert!(report_files(&run) == before && run.join(name).exists(), "{name} is written again");
    }
}
