//! Reports on runs, comparisons of several, images shown again, and people in the place of a model.

use std::fs;
use std::path::Path;

use crate::support::run::{Bench, called, records, words};
use crate::support::snapshot::lines_with;
use crate::support::table::check_rows;
use serde_json::{Value, json};

/// A run of the random model over both variants of two levels, in this folder.
fn run(bench: &Bench, out: &str, more: &str) {
    let line = format!("--model random --data set.jsonl --levels L0,L5 --out {out} {more}");
    bench.complete(&words(&line));
}

fn csv(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn several_runs_become_one_comparison() {
    let bench = Bench::with_questions(12);
    run(&bench, "one", "");
    run(&bench, "two", "--seed 1");
    bench.file("said.jsonl", "{\"default\": \"C\"}\n");
    bench.file("other.jsonl", "{\"default\": \"A\"}\n");
    bench.complete(&words(
        "--model script:said.jsonl --model script:other.jsonl --data set.jsonl --levels L0,L5 --out three",
    ));
    let called = bench.call(&["report", "one", "two", "three", "--out", "all", "--full"]);
    assert_eq!(called.code, Some(0), "{called:?}");
    // The seed of the light is that of the guesses, too: the model stands twice. Its noise is that of another light.
    let rows = [
        "random (one)",
        "random (two)",
        "script:said.jsonl",
        "with noise @one",
        "with noise @two",
        "! The light differs: --seed is 0 in one and three and 1 in two. noise stands apart as @one and @two: 2 of 2 shared images differ.",
    ];
    check_rows(rows, |label| {
        assert!(called.stdout.contains(label), "{label}: {called:?}");
    });
    insta::assert_snapshot!(called.lines_with("report:"), @"
    exit code: 0
    report: all/report.html
    ");
    // A model that guesses is compared with no other.
    let compared = csv(&bench.path("all/comparisons.csv"));
    let compared: Vec<_> = compared.iter().filter(|row| row[0] == "model").collect();
    assert!(!compared.is_empty());
    for row in compared {
        assert!(!row[1].starts_with("random") && !row[3].starts_with("random"), "{row:?}");
    }
    let page = fs::read_to_string(bench.path("all/report.html")).unwrap();
    assert!(page.contains(" in the dark: 3 runs compared"));
    let rows =
        ["summary.csv", "comparisons.csv", "thresholds.csv", "agreement.csv", "tables.tex", "figures/accuracy.svg"];
    check_rows(rows, |name| {
        assert!(bench.path("all").join(name).is_file(), "{name}");
    });
    let described = include_str!("../../../src/docs/files.md");
    let files = fs::read_dir(bench.path("all")).unwrap();
    let files = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    let missing: Vec<String> = files
        .filter(|file| {
            Path::new(file).extension().is_some_and(|ending| ending == "csv")
                && !described.contains(&format!("`{file}`"))
        })
        .collect();
    assert!(missing.is_empty(), "not in src/docs/files.md: {missing:?}");
    let rows = csv(&bench.path("all/comparisons.csv"));
    let place = |name: &str| rows[0].iter().position(|head| head == name).unwrap();
    let scripted = rows
        .iter()
        .filter(|row| row[0] == "model" && row[place("family")] == "all")
        .filter(|row| row[place("against_model")] == "script:said.jsonl");
    // The scripted model is always right: whoever is held against it gains nothing.
    for row in scripted {
        assert_eq!(row[place("only_first")], "0", "{row:?}");
        assert_eq!(row[place("second")], "1");
    }
    // Nothing is written where nothing is wanted.
    let called = bench.call(&["report", "one", "three"]);
    insta::assert_snapshot!(called.lines_with("report:"), @"
    exit code: 0
    report: not written; --out DIR writes one
    ");
    let json = bench.call(&["report", "one", "three", "--json"]);
    let json: Value = serde_json::from_str(&json.stdout).unwrap();
    assert_eq!(json["runs"].as_array().unwrap().len(), 2);
}

#[test]
fn incomparable_runs_are_named() {
    let bench = Bench::with_questions(3);
    run(&bench, "one", "");
    let text = fs::read_to_string(bench.path("set.jsonl")).unwrap();
    bench.file("set.jsonl", text.replace("\"id\":\"q", "\"id\":\"other"));
    run(&bench, "strange", "");
    bench.file("set.jsonl", text.replace("\"red\"", "\"pink\""));
    run(&bench, "foreign", "");
    let refused = |runs: [&str; 2]| bench.call(&["report", runs[0], runs[1]]);
    let strange = refused(["one", "strange"]);
    insta::assert_snapshot!(strange.messages(), @"
    exit code: 2
    error: strange: the run shares no question with one; report each run alone
    ");
    let foreign = refused(["one", "foreign"]);
    insta::assert_snapshot!(foreign.messages(), @"
    exit code: 2
    error: foreign: the question q0 has other choices or another true choice in one; report each run alone
    ");
    let none = refused(["one", "nowhere"]);
    insta::assert_snapshot!(none.messages(), @"
    exit code: 2
    error: nowhere: no run in this folder: it has no manifest.json
    ");
    let above = bench.call(&["report", "."]);
    insta::assert_snapshot!(above.messages(), @"
    exit code: 2
    error: .: no run in this folder: it has no manifest.json; there are runs in it: ./foreign ./one ./strange
    ");
}

#[test]
fn broken_records_are_named_or_skipped() {
    let bench = Bench::with_questions(3);
    run(&bench, "run", "");
    let path = bench.path("run/records.jsonl");
    let whole = fs::read_to_string(&path).unwrap();
    let report = || bench.call(&["report", "run"]);
    // Cut while it was written: the last line is passed over.
    fs::write(&path, &whole[..whole.len() - 40]).unwrap();
    let cut = report();
    assert_eq!(cut.code, Some(0), "{cut:?}");
    assert_eq!(records(&bench.path("run")).len(), whole.lines().count() - 1);
    // Something else among the lines.
    fs::write(&path, format!("{{\"a\": 1}}\n{whole}")).unwrap();
    let mixed = report();
    insta::assert_snapshot!(mixed.messages(), @"
    exit code: 2
    error: run/records.jsonl, line 1: not a record: missing field `key` at line 1 column 8; the command that made
        the run, called again, sets single such lines aside and asks their trials again; or restore the file
    ");
    fs::write(&path, "").unwrap();
    let empty = report();
    insta::assert_snapshot!(empty.messages(), @"
    exit code: 2
    error: run: the run has no records yet: nothing to report
    ");
    // A run of another schema.
    fs::write(&path, &whole).unwrap();
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    bench.file("run/manifest.json", manifest.replace("darkqa.run/2", "darkqa.run/9"));
    let newer = report();
    insta::assert_snapshot!(newer.messages(), @r#"
    exit code: 2
    error: run/manifest.json: the schema "darkqa.run/9" is not known to this version of darkqa-eval; the run was
        made by version [VERSION]: read it with that
    "#);
}

#[test]
fn active_run_is_counted_by_records() {
    let bench = Bench::with_questions(3);
    run(&bench, "run", "");
    let path = bench.path("run/records.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    let some: String = text.split_inclusive('\n').take(2).collect();
    fs::write(&path, some).unwrap();
    let file = bench.path("run/manifest.json");
    let mut manifest: serde_json::Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    manifest["status"] = "started".into();
    manifest["counts"]["answered"] = 0.into();
    fs::write(&file, manifest.to_string()).unwrap();
    let report = bench.complete(&words("report run"));
    // The first records of the file differ from run to run, and with them the table.
    insta::assert_snapshot!(
        lines_with(&report, "started:"),
        @"! run: started: 2 of 9 trials answered, 0 failed. The same command asks the"
    );
}

#[test]
fn runs_of_earlier_versions_are_read() {
    let bench = Bench::with_questions(3);
    run(&bench, "run", "");
    // What the first version wrote: no questions, no small copies, no recipe, records of the first fields alone.
    for later in ["questions.jsonl", "thumbnails.jsonl", "fidelity.jsonl", "report.html"] {
        fs::remove_file(bench.path("run").join(later)).unwrap();
    }
    let path = bench.path("run/manifest.json");
    let mut manifest: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    manifest.as_object_mut().unwrap().remove("images");
    fs::write(&path, manifest.to_string()).unwrap();
    let lines = records(&bench.path("run")).into_iter().map(|mut record| {
        let fields = record.as_object_mut().unwrap();
        for later in ["refusal", "finish", "served_model", "repeat", "via"] {
            fields.remove(later);
        }
        format!("{record}\n")
    });
    fs::write(bench.path("run/records.jsonl"), lines.collect::<String>()).unwrap();
    let called = bench.call(&["report", "run", "--full"]);
    insta::assert_snapshot!(called.lines_with("chance"), @"
    exit code: 0
    chance: 33.33 over 3 questions
    ");
    assert!(bench.path("run/report.html").is_file());
    let called = bench.call(&["show", "run", "q0"]);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: run: the manifest of the run has no image flags, so its images cannot be made again
    ");
}

#[test]
fn what_was_sent_is_made_again() {
    let bench = Bench::new();
    bench.complete(&words("--model random --levels L0,L4 --limit 4 --seed 3 --out run"));
    let first = records(&bench.path("run")).remove(0);
    let id = first["question"].as_str().unwrap();
    let called = bench.call(&["show", "run", id]);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(called.stdout.matches("the same bytes as were sent").count(), 3, "{called:?}");
    for record in records(&bench.path("run")).iter().filter(|record| record["question"] == id) {
        let condition = record["condition"].as_str().unwrap();
        let frame = record["frame"].as_str().unwrap();
        let file = fs::read(bench.path(&format!("run/shown/{frame}_{condition}.png"))).unwrap();
        assert_eq!(json!(darkqa_base::types::Digest::from_bytes(&file)), record["image"]["digest"]);
    }
    // Other rooms: what is made is something else, and that is said.
    let other = bench.call(&["show", "run", id, "--data", "rooms:frames=6,size=120x90,seed=8", "--out", "other"]);
    assert_eq!(other.code, Some(1), "{other:?}");
    assert_eq!(other.stdout.matches("NOT the bytes that were sent").count(), 3);
    let missing = bench.call(&["show", "run", id, "--condition", "L1-ev"]);
    insta::assert_snapshot!(missing.messages(), @"
    exit code: 2
    error: --condition: the item was not asked at L1-ev; it was at L0, L4-ev, L4-noise
    ");
    let nobody = bench.call(&["show", "run", "nothing"]);
    insta::assert_snapshot!(nobody.messages(), @r#"
    exit code: 2
    error: run: no question "nothing" in this run; report.html and questions.jsonl have their ids
    "#);
}

#[test]
fn item_is_drawn_as_one_picture() {
    let bench = Bench::new();
    let rooms = "rooms:frames=3,size=96x64";
    bench.complete(&words(&format!(
        "--model random --levels L0,L4 --limit 3 --llie gray-gain --llie lift --data {rooms} --out run"
    )));
    let item = records(&bench.path("run")).remove(0);
    let id = item["question"].as_str().unwrap();
    let draw = |more: &[&str]| {
        let mut words = vec!["show", "run", id, "--sheet", "item.png"];
        words.extend(more);
        let _ = fs::remove_file(bench.path("item.png"));
        bench.call(&words)
    };
    let drawn = draw(&[]);
    insta::assert_snapshot!(drawn, @"
    exit code: 0
    stdout:
    item.png: the item over the levels
    not drawn: L4-ev
    ");
    let picture = image::open(bench.path("item.png")).unwrap();
    assert!(picture.width() > 500 && picture.height() > 400);
    // Other rooms are other images.
    let other = draw(&["--data", "rooms:frames=3,size=96x64,seed=8"]);
    assert_eq!(other.code, Some(1), "{other:?}");
    insta::assert_snapshot!(other, @"
    exit code: 1
    stdout:
    item.png: the item over the levels
    not drawn: L4-ev
    NOT the bytes that were sent: L0, L4-noise, L4-noise+gray-gain, L4-noise+lift; the data, an enhancer or this
        program has changed since the run
    ");
    bench.complete(&words(&format!("--model random --levels L0 --limit 3 --data {rooms} --out light")));
    check_rows(
        [
            ("run", "nothing", "did not ask \"nothing\" with images"),
            ("light", id, "no model was shown a degraded image"),
        ],
        |(run, id, problem)| {
            let refused = bench.call(&["show", run, id, "--sheet", "item.png"]);
            assert_eq!(refused.code, Some(2), "{refused:?}");
            assert!(refused.stderr.contains(problem), "{refused:?}");
        },
    );
    let refused = bench.call(&["show", "run", id, "--sheet", "item.gif"]);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: --sheet: item.gif: a name that ends in .png or .jpg expected
    ");
}

#[test]
#[allow(clippy::too_many_lines, reason = "one study, from its pack to its report")]
fn people_enter_as_a_model() {
    let bench = Bench::with_questions(6);
    bench.file("said.jsonl", "{\"default\": \"A\"}\n");
    let line = "--model script:said.jsonl --data set.jsonl --levels L0,L5 --out run";
    bench.complete(&words(line));
    let packed = bench.call(&["study", "pack", "run", "--out", "pack"]);
    insta::assert_snapshot!(packed, @"
    exit code: 0
    stdout:
    pack/study.html: 6 questions, 3 images, 3 conditions; with 3 people each image is seen by one of them
    ");
    let page = fs::read_to_string(bench.path("pack/study.html")).unwrap();
    assert!(!page.contains("truth"));
    assert_eq!(fs::read_dir(bench.path("pack/images")).unwrap().count(), 3);
    // Two people; the second cannot tell in the dark, and one line is of another study.
    let line = |question: &str, condition: &str, person: u32, answer: Value| {
        let line = json!({"question": question, "condition": condition, "person": person, "answer": answer});
        format!("{line}\n")
    };
    let mut text = line("nobody", "L0", 1, json!("A"));
    for i in 0..6 {
        let question = format!("q{i}");
        text += &line(&question, "L0", 1, json!("C"));
        text += &line(&question, "L0", 2, json!("brown"));
        text += &line(&question, "L5-noise", 2, Value::Null);
    }
    bench.file("answers.jsonl", &text);
    let args = words("study read run answers.jsonl --out people --name people");
    let read = bench.call(&args);
    assert_eq!(read.code, Some(0), "{read:?}");
    assert_eq!(read.stderr, "");
    assert!(
        read.stdout.contains("answers imported: 18\nitems in the files that the run did not ask: 1, as nobody at L0"),
        "{read:?}"
    );
    let imported = records(&bench.path("people"));
    assert_eq!(imported.len(), 18);
    assert_eq!(imported.iter().filter(|record| record["outcome"] == "right").count(), 12);
    assert_eq!(imported.iter().filter(|record| record["strict"]["why"] == "cannot_tell").count(), 6);
    // The same again changes nothing.
    bench.call(&args);
    assert!(records(&bench.path("people")) == imported);
    let both = bench.call(&["report", "run", "people", "--out", "both"]);
    assert_eq!(both.code, Some(0), "{both:?}");
    let page = fs::read_to_string(bench.path("both/report.html")).unwrap();
    assert!(page.contains("The summary and the chart are about models, not about people."));
    // Who cannot tell says so: that is no reply that cannot be read, and stays so if replies are read again.
    assert!(!both.stdout.contains("could not be read"), "{}", both.stdout);
    let health = csv(&bench.path("both/health.csv"));
    let column = health[0].iter().position(|name| name == "cannot_tell").unwrap();
    let cannot_tell: usize = health[1..].iter().map(|row| row[column].parse::<usize>().unwrap()).sum();
    assert_eq!(cannot_tell, 6);
    let again = bench.call(&["report", "people", "--rescore"]);
    insta::assert_snapshot!(again.lines_with("read differently"), @"
    exit code: 0
    0 of 18 records now read differently
    ");
    // People are in no mean over models, and take no question from it.
    let pooled = csv(&bench.path("both/pooled.csv"));
    let names = pooled[0].iter().position(|name| name == "names").unwrap();
    assert!(pooled[1..].iter().all(|row| row[names] == "script:said.jsonl"), "{pooled:?}");
    insta::assert_snapshot!(both.lines_with("people"), @"
    exit code: 0
    script:said.jsonl, people (people) · 6 questions · 1 frame · 36 replies, 0
     people            100.0    0.0   −39.8 +39.0
     6 answers of people are “I cannot tell”, which counts as wrong and not as
    run: people
    ");
    let rows = csv(&bench.path("both/comparisons.csv"));
    let held = rows.iter().find(|row| row[0] == "model" && row[2] == "L0").unwrap();
    assert_eq!((&*held[1], &*held[3], &*held[6]), ("people", "script:said.jsonl", "6"));
    // What is no choice is named with its place, and counted in the report.
    let odd =
        line("q0", "L0", 3, json!("castle")) + &line("q1", "L0", 3, json!("F")) + &line("q2", "L0", 3, json!(null));
    bench.file("odd.jsonl", &odd);
    let read = bench.call(&words("study read run odd.jsonl --out odd"));
    assert_eq!(read.code, Some(0), "{read:?}");
    let rows = [
        "2 answers are not choices of their questions and count as wrong",
        "odd.jsonl, line 1: \"castle\" is not a choice of q0: red, blue, brown",
        "odd.jsonl, line 2: \"F\" is not a choice of q1: red, blue, brown",
    ];
    check_rows(rows, |text| {
        assert!(read.stderr.contains(text), "{text}: {read:?}");
    });
    let counted = "! 2 of 3 answers of people are not choices of their questions, and count as\n  wrong.";
    assert!(read.stdout.contains(counted), "{read:?}");
    bench.file("answers.jsonl", "{\"question\": 1}\n");
    let broken = bench.call(&args);
    insta::assert_snapshot!(broken.messages(), @"
    exit code: 2
    error: answers.jsonl, line 1: missing field `condition`
    ");
}

#[test]
fn tables_fit_the_terminal() {
    let bench = Bench::with_questions(12);
    // Names of thirty letters.
    let models = ["a", "b"].map(|end| format!("a-model-of-thirty-letters-72-{end}.jsonl"));
    for model in &models {
        bench.file(model, "{\"default\": \"C\"}\n");
    }
    let [one, other] = &models;
    bench.complete(&words(&format!(
        "--data set.jsonl --model script:{one} --model script:{other} --blind-model random --model random --out run"
    )));
    for columns in [60, 80, 100, 140] {
        let mut command = bench.command(&["report", "run", "--full"]);
        let called = called(command.env("COLUMNS", columns.to_string()));
        assert_eq!(called.code, Some(0), "{called:?}");
        for line in called.stdout.lines() {
            assert!(line.chars().count() <= columns, "{columns}: {line}");
        }
        // Both models can be told apart in every table.
        assert!(called.stdout.contains("-a.jsonl") && called.stdout.contains("-b.jsonl"));
        assert!(called.stdout.contains("100.0"), "{}", called.stdout);
    }
}

#[test]
fn symbols_are_coloured_on_demand() {
    let bench = Bench::with_questions(12);
    run(&bench, "one", "");
    run(&bench, "two", "--seed 1");
    let said = |more: &[&str], variables: &[(&str, &str)]| {
        let mut command = bench.command(&[&["report", "one", "two"], more].concat());
        command.envs(variables.iter().copied());
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        String::from_utf8(output.stdout).unwrap()
    };
    let plain = said(&[], &[]);
    assert!(plain.contains("! ") && !plain.contains('\x1b'), "{plain}");
    let wanted = [("CLICOLOR_FORCE", "1")];
    let coloured = said(&[], &wanted);
    assert!(coloured.contains("\x1b[1m\x1b[33m!\x1b[0m "), "{coloured:?}");
    assert_eq!(said(&["--color", "always"], &[]), coloured);
    let codes = regex::Regex::new("\x1b\\[[0-9;]*m").unwrap();
    assert_eq!(codes.replace_all(&coloured, ""), plain);
    assert_eq!(said(&["--color", "never"], &wanted), plain);
    let refused = [wanted[0], ("NO_COLOR", "1")];
    assert_eq!(said(&[], &refused), plain);
    assert_eq!(said(&["--color", "always"], &refused), coloured);
    // What other programs read has none.
    let summary = said(&["--json", "--color", "always"], &[]);
    assert!(!summary.contains('\x1b') && !summary.contains("\\u001b"));
}
