//! Remedies that messages print lead on: each is followed as printed, in the state in which it was printed.

use std::fs;

use crate::support::run::{Bench, words};
use crate::support::snapshot::on_one_line;

/// A message of a command, with the remedy that it prints.
struct Remedy {
    name: &'static str,
    /// Makes the state in which the message is printed.
    state: fn(&Bench),
    command: &'static str,
    /// Part of the message, which is printed by `command` alone.
    message: &'static str,
    /// The command or flag of the remedy, as printed.
    printed: &'static str,
    /// What the remedy makes of the state, where it is a command of another program.
    effect: fn(&Bench),
    /// The command with the remedy.
    followed: &'static str,
}

fn photograph(bench: &Bench, name: &str, shade: u8) {
    let path = bench.path(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let image =
        image::RgbImage::from_fn(96, 64, |x, y| image::Rgb([x as u8 + shade, y as u8, shade]));
    image.save(path).unwrap();
}

fn pairs(bench: &Bench) {
    for name in ["1.png", "2.png"] {
        photograph(bench, &format!("set/target/{name}"), 100);
        photograph(bench, &format!("set/input/{name}"), 0);
    }
    bench.file(
        "q.jsonl",
        r#"{"question": "Is it red?", "choices": ["yes", "no"], "answer": 0, "image": "1.png"}"#,
    );
}

/// A Parquet file, whose rows are those of a run.
fn parquet(bench: &Bench, path: &str) {
    bench.complete(&words(
        "--model random --data rooms:frames=1,size=96x64 --levels L0 --out for-parquet",
    ));
    bench.complete(&words("report for-parquet --out tables"));
    let made =
        ["tables/records.parquet", "for-parquet/records.parquet"].map(|name| bench.path(name));
    let made = made.iter().find(|path| path.exists()).unwrap();
    fs::copy(made, bench.path(path)).unwrap();
}

fn saved_to_disk(bench: &Bench) {
    for name in ["state.json", "dataset_info.json"] {
        let path = bench.path(&format!("saved/{name}"));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "{}").unwrap();
    }
    fs::write(bench.path("saved/data-00000-of-00001.arrow"), "").unwrap();
}

fn saved_splits(bench: &Bench) {
    fs::create_dir_all(bench.path("saved/train")).unwrap();
    fs::write(
        bench.path("saved/dataset_dict.json"),
        r#"{"splits": ["train"]}"#,
    )
    .unwrap();
    fs::write(bench.path("saved/train/data-00000-of-00001.arrow"), "").unwrap();
}

fn nothing(_: &Bench) {}

const REMEDIES: [Remedy; 4] = [
    Remedy {
        name: "pairs of a data set",
        state: pairs,
        command: "check --model random --questions q.jsonl --pairs set",
        message: "no pairs in it",
        printed: "--pairs NORMAL,LOW names any two folders",
        effect: nothing,
        followed: "check --model random --questions q.jsonl --pairs set/target,set/input",
    },
    Remedy {
        name: "pairs of realism",
        state: pairs,
        command: "realism set",
        message: "no pairs in it",
        printed: "--normal DIR and --low DIR name any two folders, instead of PAIRS",
        effect: nothing,
        followed: "realism --normal set/target --low set/input",
    },
    Remedy {
        name: "a folder of save_to_disk",
        state: saved_to_disk,
        command: "check --model random --levels L0 --data saved",
        message: "Arrow files",
        printed: "to_parquet('set.parquet')",
        effect: |bench| parquet(bench, "saved/set.parquet"),
        followed: "check --model random --levels L0 --data saved",
    },
    Remedy {
        name: "splits of save_to_disk",
        state: saved_splits,
        command: "check --model random --levels L0 --data saved",
        message: "Arrow files by split",
        printed: "--read split=NAME",
        effect: |bench| parquet(bench, "saved/train.parquet"),
        followed: "check --model random --levels L0 --data saved --read split=train",
    },
];

/// The words of a command, without the breaks of lines.
fn said(bench: &Bench, command: &str) -> String {
    let called = bench.call(&words(command));
    let all = called.stdout + " " + &called.stderr;
    on_one_line(&all)
}

#[test]
fn remedies_as_printed_lead_on() {
    for row in REMEDIES {
        let bench = Bench::new();
        (row.state)(&bench);
        let first = said(&bench, row.command);
        for part in [row.message, row.printed] {
            assert!(first.contains(part), "{}: {part} in: {first}", row.name);
        }
        (row.effect)(&bench);
        let second = said(&bench, row.followed);
        assert!(!second.contains(row.message), "{}: {second}", row.name);
        assert!(
            !second.contains("unexpected argument"),
            "{}: {second}",
            row.name
        );
    }
}

#[test]
fn an_arrow_file_names_its_command() {
    let bench = Bench::new();
    bench.file("data 1.arrow", "");
    let command = ["check", "--model", "random", "--data", "data 1.arrow"];
    let called = bench.call(&command);
    let all = called.stdout + &called.stderr;
    assert!(all.contains("Dataset.from_file(sys.argv[1])"), "{all}");
    assert!(all.contains("'data 1.arrow'"), "{all}");
}
