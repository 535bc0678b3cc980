//! The observer in runs: its control, its records, its rules, and what the report shows of it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use crate::support::run::{Bench, assert_same_products, records, words};
use crate::support::snapshot::{lines_with, redacted};
use serde_json::Value;

const RUN: &str = "--model observer --data frames --levels L0,L3";

fn text<'a>(record: &'a Value, field: &str) -> &'a str {
    record[field].as_str().unwrap()
}

/// The records by key, without the time they took.
fn by_key(run: &Path) -> BTreeMap<String, Value> {
    records(run)
        .into_iter()
        .map(|mut record| {
            record["latency_ms"] = Value::Null;
            (text(&record, "key").to_owned(), record)
        })
        .collect()
}

#[test]
fn control_sees_another_scene() {
    let bench = Bench::new();
    bench.rooms("frames", 6, "160x120");
    let table = bench.complete(&words(&format!("{RUN} --out run --full")));
    insta::assert_snapshot!(lines_with(&table, "(given"), @"
    Known-signal observer (given the untouched frame; not a model): expected score in % with its 95 % interval, a
        guess among k choices counts 1/k
    ");
    let all = records(&bench.path("run"));
    let of = |model: &str| -> Vec<&Value> { all.iter().filter(|record| record["model"] == model).collect() };
    let (own, other) = (of("observer"), of("observer:other-room"));
    assert_eq!((own.len(), own.len() + other.len()), (other.len(), all.len()));
    let scene = |frame: &str| frame.split('/').next().unwrap().to_owned();
    let image = |record: &Value| record["image"]["digest"].to_string();
    for record in &other {
        let [frame, shown] = ["frame", "shown_frame"].map(|field| text(record, field));
        assert_ne!(scene(frame), scene(shown), "{record}");
        // It is the very image that the questions about that frame are asked with, in the same condition.
        let theirs =
            own.iter().find(|own| own["frame"] == record["shown_frame"] && own["condition"] == record["condition"]);
        assert_eq!(image(record), image(theirs.unwrap()), "{record}");
        assert_eq!(record["observed"]["from"], "guess", "{record}");
    }
    for record in own {
        let observed = &record["observed"];
        assert!(record.get("shown_frame").is_none(), "{record}");
        let outlines = observed["outlines"].as_object().unwrap();
        let seen = outlines.values().filter(|share| share.as_u64().unwrap() >= 50);
        assert_eq!(observed["seen"], seen.count(), "{record}");
        assert_eq!(observed["things"], outlines.len(), "{record}");
    }
    // The control is a row of nothing but its own table.
    for file in ["summary.csv", "comparisons.csv", "flips.csv", "figures/accuracy.svg"] {
        let text = fs::read_to_string(bench.path("run").join(file)).unwrap();
        assert!(!text.contains("other-room"), "{file}");
    }
    let observer = fs::read_to_string(bench.path("run/observer.csv")).unwrap();
    assert!(observer.contains("\nobserver:other-room,L3-noise,"), "{observer}");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("control in % [95 %]"));
    // `show` makes the image of the other frame again, too.
    let shown = bench.complete(&["show", "run", text(other[0], "question")]);
    let frame = text(other[0], "shown_frame");
    assert!(shown.contains(&format!("with the image of {frame}:")), "{shown}");
    assert!(!shown.contains("NOT the bytes"), "{shown}");
}

#[test]
fn parts_and_interruptions_change_nothing() {
    let bench = Bench::new();
    bench.rooms("frames", 6, "160x120");
    bench.complete(&words(&format!("{RUN} --observer-controls --out whole")));
    for part in ["1/3", "2/3", "3/3"] {
        let line = format!("{RUN} --observer-controls --out parts --shard {part} --threads 1");
        bench.complete(&words(&line));
    }
    bench.complete(&["merge", "parts", "--out", "merged"]);
    let (whole, merged) = (bench.path("whole"), bench.path("merged"));
    assert_eq!(by_key(&whole), by_key(&merged));
    assert!(assert_same_products(&whole, &merged) > 8);
    let models: BTreeSet<String> = by_key(&whole).values().map(|record| text(record, "model").to_owned()).collect();
    assert_eq!(models.len(), 17, "{models:?}");
    // Half of the records are lost; the same command asks the others again.
    let path = whole.join("records.jsonl");
    let lines = fs::read_to_string(&path).unwrap();
    let half: Vec<&str> = lines.lines().step_by(2).collect();
    fs::write(&path, half.join("\n") + "\n").unwrap();
    bench.complete(&words(&format!("{RUN} --observer-controls --out whole")));
    assert_eq!(by_key(&whole), by_key(&merged));
}

#[test]
fn single_scene_control_shuffles_tiles() {
    let bench = Bench::new();
    let line = "--model observer --data rooms:frames=2,size=160x120 --levels L0 --out run";
    let called = bench.call(&words(line));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN all frames are of one scene, so observer:other-room is not possible; observer:tiles is asked instead:
        the observer with the tiles of the right image in another order; its score must be that of chance
    ");
    let stdout = called.stdout.split_whitespace().collect::<Vec<_>>();
    insta::assert_snapshot!(redacted(&stdout.join(" ")), @"
    observer · 8 questions · 2 frames · 8 replies, 0 failed · intervals by frame ! Only 2 frames (8 are needed):
        wide intervals, few possible verdicts. ! All 2 frames are of one scene and count as independent: the
        results are about this scene alone. Take more scenes. accuracy in % observer L0 95 % untouched 100.0 −97.0
        0.0 95 %: how far the widest interval of the row reaches down and up chance 33.4 observer: known-signal
        observer, given the untouched frame; not a model. Control: the same observer, shown the tiles of the right
        images in another order, scores 33.4 [0.8, 96.9]; chance is 33.4 run: run report: run/report.html
    ");
    // Without the control, the observer is not shown.
    let path = bench.path("run/records.jsonl");
    let records = fs::read_to_string(&path).unwrap();
    let own = records.lines().filter(|line| !line.contains("observer:tiles"));
    fs::write(&path, own.collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let hidden = bench.call(&words("report run --full"));
    insta::assert_snapshot!(hidden, @"
    exit code: 0
    stdout:
     · 0 questions · 0 frames · 0 replies, 0 failed · intervals by frame
    ! Only 2 frames (8 are needed): wide intervals, few possible verdicts.
    ! All 2 frames are of one scene and count as independent: the results are about this scene alone. Take more
        scenes.
    ! the observer is not shown: none of its controls has a reply, so that it guesses without the right image is
        not shown (observer.csv has all numbers)

    Accuracy in %: strict (lenient where it differs); n replies at each level; 95 %: how far the widest interval
        reaches down and up
    chance: 33.43 over 8 questions
    Known-signal observer (given the untouched frame; not a model): expected score in % with its 95 % interval, a
        guess among k choices counts 1/k
    run: run
    report: run/report.html
    ");
    let named = bench.call(&words(&line.replace("observer", "observer:other-room")));
    insta::assert_snapshot!(named.messages(), @"
    exit code: 2
    error: --model: observer:other-room needs frames of at least two scenes
    ");
    let unknown = bench.call(&words(&line.replace("observer", "observer:nothing")));
    insta::assert_snapshot!(unknown.messages(), @"
    exit code: 2
    error: invalid value 'observer:nothing' for '--model <NAME>': observer:nothing is not a control; there are:
        other-room, mosaic-12, mosaic-40, mirrored, upside-down, tiles, black, flat, white-noise, pink-noise,
        negative, blur, shift-32, shift-4, random-masks, outlines
    ");
}

#[test]
fn rules_make_questions_and_answers_alike() {
    let bench = Bench::new();
    bench.rooms("frames", 6, "160x120");
    let rules = include_str!("../../../../src/questions/rules.toml");
    let own = rules.replace("Is there {article} {object} in the image?", "Can {article} {object} be seen?");
    assert_ne!(rules, own);
    bench.file("own.toml", own);
    let evidence = |run: &str| -> usize {
        records(&bench.path(run)).into_iter().filter(|record| record["observed"]["from"] == "evidence").count()
    };
    bench.complete(&words(&format!("{RUN} --out built-in")));
    bench.complete(&words(&format!("{RUN} --rules own.toml --out own")));
    let questions = fs::read_to_string(bench.path("own/questions.jsonl")).unwrap();
    assert!(questions.contains(" be seen?") && !questions.contains("Is there a"));
    assert_eq!(evidence("own"), evidence("built-in"));
    bench.complete(&words("questions frames --rules own.toml --out own.jsonl"));
    let line = "--model observer --data frames --questions own.jsonl --levels L0 --out again";
    let called = bench.call(&words(line));
    assert!(called.code == Some(2) && called.stderr.contains("name that with --rules"), "{called:?}");
    bench.complete(&words(&format!("{line} --rules own.toml")));
}

#[test]
fn biased_control_hides_observer() {
    let bench = Bench::new();
    bench.rooms("frames", 6, "160x120");
    bench.complete(&words(&format!("{RUN} --model random --out run")));
    let path = bench.path("run/records.jsonl");
    let lines = fs::read_to_string(&path).unwrap();
    // The control as an observer that answers from the labels would leave it.
    let spoiled: String = lines
        .lines()
        .map(|line| {
            let mut record: Value = serde_json::from_str(line).unwrap();
            if record["model"] == "observer:other-room" {
                record["observed"]["from"] = "evidence".into();
                record["outcome"] = "right".into();
                let truth = record["truth"].as_u64().unwrap() as u8;
                record["reply"] = char::from(b'A' + truth).to_string().into();
            }
            record.to_string() + "\n"
        })
        .collect();
    fs::write(&path, spoiled).unwrap();
    let called = bench.call(&["report", "run", "--out", "report"]);
    assert_eq!(called.code, Some(0), "{called:?}");
    let reason = "the observer is not shown: its control observer:other-room over all";
    assert_eq!(called.stdout.matches(reason).count(), 1, "{called:?}");
    let rows = called.stdout.lines().filter(|line| line.starts_with(" observer"));
    assert_eq!(rows.count(), 0, "{called:?}");
    insta::assert_snapshot!(called.lines_with("random"), @"
    exit code: 0
    random · 22 questions · 6 frames · 66 replies, 0 failed · intervals by scene
     random           L0     L3   95 %
    ");
    for file in ["tables.tex", "figures/accuracy.svg"] {
        let text = fs::read_to_string(bench.path("report").join(file)).unwrap();
        assert!(!text.contains("observer") && text.contains("random"), "{file}: {text}");
    }
    let page = fs::read_to_string(bench.path("report/report.html")).unwrap();
    assert!(page.contains(reason) && !page.contains("<td class=\"text\">observer</td>"));
    for file in ["summary.csv", "observer.csv"] {
        let text = fs::read_to_string(bench.path("report").join(file)).unwrap();
        assert!(text.contains("\nobserver,"), "{file}");
    }
    let summary = fs::read(bench.path("report/summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    let models: BTreeSet<&str> =
        summary["rows"].as_array().unwrap().iter().map(|row| row["model"].as_str().unwrap()).collect();
    assert_eq!(Vec::from_iter(models), ["chance", "random"]);
    // Against an old run, too.
    let called = bench.call(&["report", "run", "--baseline", "run", "--full"]);
    let rows = called.stdout.lines().filter(|line| line.starts_with(" observer"));
    assert_eq!(rows.count(), 0, "{called:?}");
}
