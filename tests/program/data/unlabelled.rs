//! Photographs without labels: questions that are asked about every image, and agreement with a model's own answers in
//! the light.

use std::collections::BTreeSet;
use std::fs;

use serde_json::{Value, json};

use crate::support::run::{Bench, records, words};
use crate::support::snapshot::{on_one_line, redacted};

/// Number of photographs.
const PHOTOGRAPHS: usize = 12;

/// Twelve photographs in two folders, a bank of three questions, and a script that answers as it sees: it forgets in
/// the dark.
fn photographs() -> Bench {
    let bench = Bench::new();
    let mut replies = Vec::new();
    for index in 0..PHOTOGRAPHS {
        let name = format!("{}/{index:02}.png", ["hall", "kitchen"][index % 2]);
        let grey = 60 + 10 * index as u8;
        let picture = image::RgbImage::from_pixel(24, 16, image::Rgb([grey, 90, 200 - grey]));
        fs::create_dir_all(bench.path("photos").join(&name).parent().unwrap()).unwrap();
        picture.save(bench.path("photos").join(&name)).unwrap();
        for (id, light) in [("lamp", index % 3 == 0), ("window", index % 2 == 0), ("cat", false)] {
            let letter = if light { "A" } else { "B" };
            let id = format!("{id}@{name}");
            // Without an image, and in the dark, it says no to everything; the enhancer of a name is not used here.
            replies.push(json!({"question": id, "reply": "B"}));
            replies.push(json!({"question": id, "condition": "L0", "reply": letter}));
            let at_l1 = if index < 10 { letter } else { "B" };
            replies.push(json!({"question": id, "condition": "L1-noise", "reply": at_l1}));
        }
    }
    let lines = |values: &[Value]| -> String {
        let lines: Vec<String> = values.iter().map(ToString::to_string).collect();
        lines.join("\n")
    };
    bench.file("eyes.jsonl", lines(&replies));
    let question = |id: &str, text: &str, family: &str| json!({"id": id, "question": text, "choices": ["yes", "no"], "family": family});
    bench.file(
        "bank.jsonl",
        lines(&[
            question("lamp", "Is there a lamp in it?", "presence"),
            question("window", "Is there a window in it?", "presence"),
            question("cat", "Is there a cat in it?", "animals"),
        ]),
    );
    bench
}

const ASKED: &str =
    "--data photos --ask bank.jsonl --model script:eyes.jsonl --levels L0,L1,L5 --variant noise --out run";

fn text(bench: &Bench, name: &str) -> String {
    fs::read_to_string(bench.path(name)).unwrap()
}

/// The rows of a CSV file, by column.
fn rows(bench: &Bench, name: &str) -> Vec<Value> {
    let mut reader = csv::Reader::from_path(bench.path(name)).unwrap();
    let rows = reader.deserialize::<std::collections::BTreeMap<String, String>>();
    rows.map(|row| json!(row.unwrap())).collect()
}

fn row<'r>(rows: &'r [Value], wanted: &[(&str, &str)]) -> &'r Value {
    let mut rows = rows.iter();
    let fits = |row: &&Value| wanted.iter().all(|(column, value)| row[*column] == *value);
    rows.find(fits).unwrap_or_else(|| panic!("{wanted:?}"))
}

fn number(row: &Value, column: &str) -> f64 {
    row[column].as_str().unwrap().parse().unwrap()
}

/// The photographs in the dark would be left aside without a word.
#[test]
fn pairs_need_true_answers() {
    let bench = photographs();
    for (folder, name) in [("light", "a.png"), ("dark", "a.png")] {
        fs::create_dir_all(bench.path(folder)).unwrap();
        fs::copy(bench.path("photos/hall/00.png"), bench.path(folder).join(name)).unwrap();
    }
    let called = bench.call(&words("--pairs light,dark --ask home --model random --levels L0 --out run"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
     WARN --data: no effect: --pairs names the data
    error: --pairs: the photographs in the dark would not be asked about with --ask: write questions with answers
        about the files in normal light (--questions), or ask about the dark ones alone with --data DIR --light
        dark
    ");
    assert!(!bench.path("run").exists());
}

#[test]
fn photographs_have_no_true_answers() {
    let bench = photographs();
    let called = bench.call(&words(ASKED));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 0
    photos: 12 images in it and in the folders below, each named by its path from there
    --ask bank.jsonl: 36 questions about 12 images without answers (3 each); each model is compared with its own
        answers at L0, and is asked without images, too
     WARN Folders suggest 2 scenes (hall, kitchen), but the data name none, so the 12 frames count as independent;
        a "scene" in each question (or --map scene=COLUMN) names them
    "#);
    let records = records(&bench.path("run"));
    // Twice at L0, once at L1, at L5 and without an image.
    assert_eq!(records.len(), 36 * 5);
    let outcomes: BTreeSet<&str> = records.iter().filter_map(|record| record["outcome"].as_str()).collect();
    assert_eq!(outcomes, BTreeSet::from(["answered"]));
    assert!(records.iter().all(|record| record["truth"].is_null()));
    let again: BTreeSet<&str> = records
        .iter()
        .filter(|record| record["repeat"] == 1)
        .filter_map(|record| record["condition"].as_str())
        .collect();
    assert_eq!(again, BTreeSet::from(["L0"]));
    let question = text(&bench, "run/questions.jsonl");
    let question: Value = serde_json::from_str(question.lines().next().unwrap()).unwrap();
    assert_eq!((&question["answer"], &question["evidence"]), (&Value::Null, &json!({"bank_id": "lamp"})));
}

#[test]
fn report_measures_agreement_with_l0() {
    let bench = photographs();
    let shown = bench.complete(&words(ASKED));
    let own = rows(&bench, "run/own_answers.csv");
    let of = |level: &str| row(&own, &[("level", level), ("family", "all"), ("mode", "strict"), ("view", "image")]);
    // In the light 4 lamps, 6 windows and no cat: 10 of 36 are yes. At L5 all is no.
    assert!((number(of("L5"), "agreement") - 26.0 / 36.0).abs() < 1e-12);
    assert!((number(of("L0"), "agreement") - 1.0).abs() < 1e-12);
    assert_eq!(of("L0")["role"], "ceiling");
    // The floor is no to everything, too, so that nothing is kept at L5.
    assert!(number(of("L5"), "evidence").abs() < 1e-12 && number(of("L5"), "kappa").abs() < 1e-12);
    // The numbers of answers at L0 are over all families.
    for row in &own {
        let is_whole = row["family"] == "all";
        assert_eq!(row["asked_light"] == "36", is_whole, "{row:?}");
    }
    assert!(number(of("L5"), "entropy").abs() < 1e-12 && number(of("L5"), "entropy_light") > 0.5);
    // Of the last two photographs one has a window.
    assert!((number(of("L1"), "agreement") - 35.0 / 36.0).abs() < 1e-12);
    assert!((number(of("L1"), "evidence") - 0.9).abs() < 1e-12);
    let questions = rows(&bench, "run/own_questions.csv");
    let informative =
        questions.iter().map(|row| (row["question"].as_str().unwrap(), row["informative"].as_str().unwrap()));
    assert_eq!(informative.collect::<Vec<_>>(), [("lamp", "true"), ("window", "true"), ("cat", "false")]);
    for said in
        ["evidence kept", "entropy", "κ", "without images, the floor", "2 of 3 questions of the bank are informative"]
    {
        assert!(on_one_line(&shown).contains(said), "{said}: {shown}");
    }
    let comparisons = rows(&bench, "run/comparisons.csv");
    let dark = row(&comparisons, &[("kind", "level"), ("condition", "L5-noise"), ("family", "all")]);
    assert_eq!(
        (&dark["against_condition"], &dark["only_second"], &dark["measure"]),
        (&json!("L0"), &json!("10"), &json!("agreement"))
    );
}

#[test]
fn word_accuracy_stands_over_no_agreement() {
    let bench = photographs();
    let shown = bench.complete(&words(ASKED)) + &bench.complete(&["report", "run", "--full"]);
    assert!(!shown.contains("ccuracy"), "{shown}");
    let summary = rows(&bench, "run/summary.csv");
    assert!(summary.iter().all(|row| row["measure"] == "agreement" && row["right"] == ""));
    let head = text(&bench, "run/summary.csv");
    assert!(
        head.starts_with(
            "model,view,level,variant,enhancer,family,mode,n,right,unparsed,failed,value,low,high,reading,measure\n"
        ),
        "{head}"
    );
    let json: Value = serde_json::from_str(&text(&bench, "run/summary.json")).unwrap();
    assert_eq!(json["measure"], "agreement");
    assert_eq!(json["own_answers"].as_array().unwrap().len(), json["rows"].as_array().unwrap().len());
    for name in ["figures/agreement.svg", "figures/evidence.svg"] {
        assert!(!text(&bench, &format!("run/{name}")).contains("ccuracy"), "{name}");
    }
    let figure = text(&bench, "run/figures/agreement.svg");
    assert!(figure.contains("agreement in %"), "{figure}");
    let page = text(&bench, "run/report.html");
    // The style and the script are those of every page.
    let page = page.split("<script id=\"data\"").next().unwrap();
    assert!(!page.contains("ccuracy") && page.contains("Agreement with its own answer at L0"));
    assert!(!bench.path("run/thresholds.csv").exists() && bench.path("run/evidence_thresholds.csv").exists());
}

#[test]
fn constant_no_gives_no_verdict() {
    let bench = photographs();
    bench.file("no.jsonl", json!({"default": "B"}).to_string());
    let shown = bench.complete(&words(&ASKED.replace("eyes.jsonl", "no.jsonl")));
    assert!(on_one_line(&shown).contains("The questions do not show what script:no.jsonl sees"), "{shown}");
    assert!(!shown.contains("gives its answer at L0 to"), "{shown}");
    assert!(on_one_line(&shown).contains("the ceiling is 0.0 points above the floor, and 10.0 are needed"), "{shown}");
}

#[test]
fn unreadable_model_is_not_compared() {
    let bench = photographs();
    bench.file("mute.jsonl", json!({"default": "Well."}).to_string());
    let shown = bench.complete(&words(&ASKED.replace("eyes.jsonl", "mute.jsonl")));
    let shown = on_one_line(&shown);
    assert!(shown.contains("Nothing is known about script:mute.jsonl"), "{shown}");
    assert!(
        shown.contains("180 of 180 replies of script:mute.jsonl (100.0 %) could not be read, and do not agree."),
        "{shown}"
    );
    assert!(!shown.contains("The questions do not show"), "{shown}");
}

#[test]
fn cannot_tell_has_its_own_measure() {
    let bench = photographs();
    let bank = text(&bench, "bank.jsonl").replace("\"no\"]", "\"no\",\"Cannot tell\"]");
    bench.file("bank.jsonl", bank);
    let replies = text(&bench, "eyes.jsonl");
    let replies: String = replies
        .lines()
        .map(|line| {
            let mut line: Value = serde_json::from_str(line).unwrap();
            if line.get("condition").is_none() {
                line["reply"] = "C".into();
            }
            format!("{line}\n")
        })
        .collect();
    bench.file("eyes.jsonl", replies);
    let shown = bench.complete(&words(ASKED));
    let shown = on_one_line(&shown);
    assert!(
        shown.contains("script:eyes.jsonl says “cannot tell” to 0.0 % of the questions at L0, and to 100.0 % at L5"),
        "{shown}"
    );
    let own = rows(&bench, "run/own_answers.csv");
    let dark = row(&own, &[("level", "L5"), ("family", "all"), ("mode", "strict")]);
    assert!((number(dark, "cannot_tell") - 1.0).abs() < 1e-12);
}

#[test]
fn runs_continue_grow_and_merge() {
    let bench = photographs();
    let less = ASKED.replace("--levels L0,L1,L5", "--levels L0,L5");
    bench.complete(&words(&less));
    let before = text(&bench, "run/records.jsonl");
    bench.complete(&words(&less));
    assert_eq!(text(&bench, "run/records.jsonl"), before);
    bench.complete(&words(ASKED));
    let after = text(&bench, "run/records.jsonl");
    assert!(after.starts_with(&before));
    assert_eq!(after.lines().count() - before.lines().count(), 36);
    let rescored = bench.complete(&["report", "run", "--rescore"]);
    assert!(rescored.starts_with("0 of 180 records now read differently\n"), "{rescored}");
    for shard in ["1/2", "2/2"] {
        let call = ASKED.replace("--out run", "--out parts");
        bench.complete(&[words(&call), vec!["--shard", shard]].concat());
    }
    bench.complete(&words("merge parts --out whole"));
    assert_eq!(text(&bench, "whole/own_answers.csv"), text(&bench, "run/own_answers.csv"));
    let item = bench.complete(&words("show run lamp@hall/00.png --data photos"));
    assert!(item.contains("answered") && !item.contains("(true)"), "{item}");
}

#[test]
fn fewer_questions_photograph_grow_to_more() {
    let bench = photographs();
    let few = format!("{ASKED} --ask-per-image 1");
    bench.complete(&words(&few));
    assert_eq!(records(&bench.path("run")).len(), 12 * 5);
    bench.complete(&words(ASKED));
    assert_eq!(records(&bench.path("run")).len(), 36 * 5);
}

#[test]
fn two_models_are_compared_by_agreement() {
    let bench = photographs();
    let shown = bench.complete(&words(&format!("{ASKED} --model random")));
    // References are not compared with models.
    assert!(!shown.contains("give the same answer"), "{shown}");
    bench.file("other.jsonl", text(&bench, "eyes.jsonl"));
    let shown = bench.complete(&words(&format!("{ASKED} --model script:other.jsonl")));
    let shown = on_one_line(&shown);
    assert!(
        shown.contains("At L0 script:eyes.jsonl and script:other.jsonl give the same answer to 100.0 %"),
        "{shown}"
    );
    assert_eq!(rows(&bench, "run/models_in_light.csv").len(), 3);
}

#[test]
fn what_needs_a_truth_is_refused() {
    let bench = photographs();
    bench.complete(&words(ASKED));
    bench.file(
        "photos/questions.jsonl",
        json!({"id": "a", "frame": "hall/00.png", "question": "?", "choices": ["yes", "no"], "answer": "no"})
            .to_string(),
    );
    let set =
        json!({"id": "a", "image": "photos/hall/00.png", "question": "?", "choices": ["yes", "no"], "answer": "no"});
    bench.file("set.jsonl", set.to_string());
    bench.complete(&words("--data set.jsonl --model random --levels L0 --out known"));
    let open = json!({"id": "a", "frame": "hall/00.png", "question": "?", "choices": ["yes", "no"], "answer": null});
    bench.file("open.jsonl", open.to_string());
    let asked = "--data photos --ask bank.jsonl --levels L0,L5 --out other";
    for (call, says) in [
        (format!("{asked} --model observer"), "observer cannot be asked with --ask"),
        (format!("{asked} --model random --blind"), "random is shown no image"),
        (format!("{asked} --blind-model random"), "random is shown no image"),
        (format!("{asked} --model random --questions set.jsonl"), "cannot be used with"),
        ("--data photos --ask bank.jsonl --model random --levels L5 --out other".to_owned(), "add L0 to --levels"),
        (
            "--data photos --ask nothing --model random --out other".to_owned(),
            "no such file; home and home:uncertain are built in",
        ),
        (
            "--data photos --ask home --model script:eyes.jsonl --levels L0,L1,L5 --variant noise --out run".to_owned(),
            "--ask",
        ),
        ("--data set.jsonl --model random --levels L0 --out run".to_owned(), "--ask"),
        ("report run known".to_owned(), "accuracy and agreement are different measures"),
        ("report known --baseline run".to_owned(), "accuracy and agreement are different measures"),
        ("report run --baseline run".to_owned(), "--baseline: it compares accuracies"),
        ("report run --common".to_owned(), "--common: each model is compared with its own answers"),
        ("study pack run --out page".to_owned(), "nobody knows the true answers"),
        ("show run lamp@hall/00.png --data photos --sheet story.png".to_owned(), "nobody knows the true answers"),
        (
            "--data photos --questions open.jsonl --model random --out other".to_owned(),
            "--ask FILE asks questions without answers",
        ),
    ] {
        let called = bench.call(&words(&call));
        assert_eq!(called.code, Some(2), "{call}: {called:?}");
        assert!(called.stderr.contains(says), "{call}: {says} expected: {}", called.stderr);
    }
}

#[test]
fn rooms_and_sets_work_without_labels() {
    let bench = photographs();
    let set =
        json!({"id": "a", "image": "photos/hall/00.png", "question": "?", "choices": ["yes", "no"], "answer": "no"});
    bench.file("set.jsonl", set.to_string());
    let call = |data: &str, out: &str| {
        let call = format!(
            "--data {data} --ask home:uncertain --ask-per-image 2 --model random --levels L0,L5 --variant ev --out {out}"
        );
        let called = bench.call(&words(&call));
        assert_eq!(called.code, Some(0), "{called:?}");
        called.stderr
    };
    insta::assert_snapshot!(redacted(&call("set.jsonl", "one")), @"
    set.jsonl: 1 image; questions in it are ignored, and those of --ask are asked
    --ask home:uncertain: 2 questions about 1 image without answers (2 each); each model is compared with its own
        answers at L0, and is asked without images, too
     WARN --ask home:uncertain: with one image, nothing shows that an answer depends on the image; name a folder
        with several
    ");
    assert_eq!(records(&bench.path("one")).len(), 2 * 4);
    call("rooms:frames=6,size=64x48", "two");
    assert_eq!(records(&bench.path("two")).len(), 12 * 4);
}

/// The same questions about twelve photographs of a dark checkerboard each.
fn photographs_in_the_dark() -> Bench {
    let bench = photographs();
    for index in 0..PHOTOGRAPHS {
        let name = format!("photos/{}/{index:02}.png", ["hall", "kitchen"][index % 2]);
        let picture = image::RgbImage::from_fn(48, 32, |x, y| {
            let code = if (x / 8 + y / 8) % 2 == 0 { 0 } else { 12 };
            image::Rgb([code + index as u8, code, code / 2])
        });
        picture.save(bench.path(&name)).unwrap();
    }
    bench
}

/// Notice about photographs taken in the dark.
const NOTICE: &str = "These photographs were taken in the dark (--light dark): L0 is each as photographed, there is no image in the light";

#[test]
fn dark_photographs_are_asked_unchanged() {
    let bench = photographs_in_the_dark();
    let line = "--data photos --ask bank.jsonl --model random --out run";
    let called = bench.call(&words(&format!("{line} --light dark")));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(!called.stderr.contains("dark already"), "{called:?}");
    let all = records(&bench.path("run"));
    // Twice at L0, and once without an image.
    assert_eq!(all.len(), 36 * 3);
    let levels: BTreeSet<String> = all.iter().map(|r| r["level"].to_string()).collect();
    assert_eq!(levels, BTreeSet::from(["null".to_owned(), "\"L0\"".to_owned()]));
    // The ceiling is what the records say.
    let chosen = |question: &Value, repeat: u64| {
        all.iter()
            .find(|record| {
                record["question"] == *question
                    && record["level"] == "L0"
                    && record["repeat"].as_u64().unwrap_or_default() == repeat
            })
            .unwrap()["strict"]["chosen"]
            .clone()
    };
    let questions: BTreeSet<String> = all.iter().map(|r| r["question"].to_string()).collect();
    let same = questions
        .iter()
        .filter(|question| {
            let question: Value = serde_json::from_str(question).unwrap();
            chosen(&question, 0) == chosen(&question, 1)
        })
        .count() as f64
        / 36.0;
    let own = rows(&bench, "run/own_answers.csv");
    let ceiling = row(&own, &[("level", "L0"), ("family", "all"), ("mode", "strict")]);
    assert_eq!(ceiling["role"], "ceiling");
    assert!((number(ceiling, "agreement") - same).abs() < 1e-12 && same > 0.0 && same < 1.0);
    // No word of an answer in the light, which nobody gave.
    let shown = on_one_line(&called.stdout);
    assert!(shown.contains(NOTICE) && shown.contains("random, as photographed"), "{shown}");
    let page = text(&bench, "run/report.html");
    let summary = text(&bench, "run/summary.json");
    let tex = text(&bench, "run/tables.tex");
    for (name, of) in [("text", &shown), ("page", &page), ("summary", &summary)] {
        assert!(of.contains(NOTICE), "{name}");
    }
    let page = page.split("<script id=\"data\"").next().unwrap();
    for (name, of) in [("text", &*shown), ("page", page), ("summary", &summary), ("tex", &tex)] {
        let of = of.replace(NOTICE, "");
        assert!(!of.contains("in the light"), "{name}: {of}");
        // The pictures at the end of the page are named by their files.
        assert!(name == "page" || !of.contains("untouched"), "{name}: {of}");
    }
    // The same images without the flag are taken for images in the light.
    let called = bench.call(&words(&line.replace("--out run", "--out lit --levels L0")));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 0
    photos: 12 images in it and in the folders below, each named by its path from there
    --ask bank.jsonl: 36 questions about 12 images without answers (3 each); each model is compared with its own
        answers at L0, and is asked without images, too
     WARN Folders suggest 2 scenes (hall, kitchen), but the data name none, so the 12 frames count as independent;
        a "scene" in each question (or --map scene=COLUMN) names them
     WARN these images are dark already (median brightness 7 of 255); --levels L0 --llie-on l0 asks about them as
        they are and enhanced, and --light dark does so by default
    "#);
    let shown = on_one_line(&called.stdout);
    assert!(!shown.contains("taken in the dark") && shown.contains("random, untouched"), "{shown}");
}

#[test]
fn enhancing_bright_photographs_is_reported_harmful() {
    let bench = photographs_in_the_dark();
    let replies = text(&bench, "eyes.jsonl");
    let enhanced: String = replies
        .lines()
        .filter_map(|line| {
            let mut line: Value = serde_json::from_str(line).unwrap();
            (line["condition"] == "L0").then(|| {
                // With the enhancer a model sees what it did not see.
                line["condition"] = "L0+lift".into();
                line["reply"] = "A".into();
                format!("{line}\n")
            })
        })
        .collect();
    bench.file("eyes.jsonl", format!("{replies}\n{enhanced}"));
    let line = "--data photos --ask bank.jsonl --model script:eyes.jsonl --llie lift";
    let of = |flags: &str| on_one_line(&bench.complete(&words(&format!("{line} {flags}"))));
    let dark = of("--light dark --out dark");
    assert!(dark.contains("lift changes answers of script:eyes.jsonl to these photographs: whether for the better is not known. lift was trained on this program's synthesis."),"{dark}");
    assert!(!dark.contains("harm"), "{dark}");
    let lit = of("--levels L0 --llie-on l0 --out lit");
    assert!(lit.contains("harm where nothing was dark"), "{lit}");
}
