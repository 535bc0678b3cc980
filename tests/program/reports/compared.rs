//! Two runs in one report: what it says of each setting in which they differ, and that it compares only what shows the
//! same.

use std::fs;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::onnx;
use crate::support::run::{Bench, called, words};
use crate::support::table::check_rows;
use serde_json::{Value, json};

/// Frames with forty questions of two families, an enhancer, prompts, and an endpoint that answers everything with "A".
pub(crate) struct Scene {
    pub(crate) bench: Bench,
    endpoint: MockEndpoint,
}

impl Scene {
    pub(crate) fn new() -> Self {
        let bench = Bench::new();
        for folder in ["frames", "elsewhere"] {
            let lines = (0..40).map(|i| {
                let family = ["color", "presence"][i % 2];
                let frame = format!("{}.png", i / 4);
                let answer = ["red", "brown"][i % 2];
                let question = json!({
                    "id": format!("q{i}"), "frame": frame, "family": family,
                    "question": format!("What color is it, {i}?"),
                    "choices": ["red", "blue", "brown"], "answer": answer,
                });
                format!("{question}\n")
            });
            let name = format!("{folder}/questions.jsonl");
            bench.file(&name, lines.collect::<String>());
            for frame in 0..10 {
                let shade = 60 + 10 * frame as u8 + u8::from(folder == "elsewhere");
                let picture = image::RgbImage::from_fn(48, 32, |x, y| image::Rgb([shade + x as u8, 90 + y as u8, 40]));
                let name = format!("{folder}/{frame}.png");
                picture.save(bench.path(&name)).unwrap();
            }
        }
        onnx::gain(0.5).write(&bench.path(""), "one.onnx");
        fs::create_dir(bench.path("other")).unwrap();
        onnx::gain(0.75).write(&bench.path("other"), "one.onnx");
        for name in ["choice.txt", "blind.txt"] {
            let built_in = format!("{}/prompts/{name}", env!("CARGO_MANIFEST_DIR"));
            let text = fs::read_to_string(built_in).unwrap();
            bench.file(&format!("own/{name}"), format!("Look closely.\n{text}"));
        }
        Self { bench, endpoint: MockEndpoint::start([Answer::text("A")]) }
    }

    /// A run of the model `m`, with these flags in place of others.
    pub(crate) fn run(&self, otherwise: &str, out: &str) {
        let base = self.endpoint.base_url();
        let otherwise = words(otherwise);
        let flags = [
            ("--data", "frames"),
            ("--model", "m"),
            ("--base-url", &*base),
            ("--levels", "L0,L3"),
            ("--llie", "one.onnx"),
        ];
        let mut line = Vec::new();
        for (flag, value) in flags {
            if !otherwise.contains(&flag) {
                line.extend([flag, value]);
            }
        }
        line.extend(otherwise);
        // The frames are no photographs.
        line.extend(["--llie-anyway", "--out", out]);
        let called = self.bench.call(&line);
        assert!(matches!(called.code, Some(0 | 1)), "{line:?}: {called:?}");
    }

    /// The lines above the report of runs.
    pub(crate) fn alerts(&self, line: &str) -> Vec<String> {
        let text = self.bench.complete(&words(&format!("{line} --full")));
        // Below the head. A long alert goes on in indented lines.
        let mut lines: Vec<String> = Vec::new();
        for line in text.lines().skip(1) {
            match (line.strip_prefix("! "), line.strip_prefix("  "), lines.last_mut()) {
                (Some(alert), ..) => lines.push(alert.to_owned()),
                (None, Some(rest), Some(alert)) => alert.extend([" ", rest]),
                _ => break,
            }
        }
        // The enhancer and the frames are made for tests, the scripted model answers one letter, and nearly all of
        // these runs have the noise of the default reading.
        let of_all = [
            "--allow bad-enhancer",
            "whatever the image",
            "One answer to everything scores well",
            "signal-to-noise ratio is the same",
        ];
        lines.retain(|line| of_all.iter().all(|part| !line.contains(part)));
        lines
    }

    pub(crate) fn csv(&self, path: &str) -> Vec<Vec<String>> {
        let text = fs::read_to_string(self.bench.path(path)).unwrap();
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    }
}

/// A setting of a second run, and what the report on both says of it.
#[rustfmt::skip]
const SETTINGS: [(&str, &str); 32] = [
    ("--seed 1", "The light differs: --seed is 0 in base and 1 in other. noise and noise+one stand apart as @base and @other: 20 of 20 shared images differ."),
    ("--profile physical", "The light differs: --profile is paper in base and physical in other."),
    ("--amplify all", "The light differs: --noise amplify is unset in base and all in other."),
    ("--tone before-ev", "The light differs: --noise tone is unset in base and before-ev in other."),
    ("--draws fresh", "The light differs: --noise draws is unset in base and fresh in other."),
    ("--coupling photon", "The light differs: --noise coupling is unset in base and photon in other."),
    ("--camera nikon-d850", "The light differs: --noise camera is unset in base and nikon-d850 in other."),
    ("--gain 1.5", "The light differs: --noise gain is unset in base and 1.5 in other."),
    ("--ratio 150", "The light differs: --noise ratio is unset in base and 150 in other."),
    ("--fixed", "The light differs: --noise fixed is unset in base and true in other."),
    ("--llie other/one.onnx", "in other. noise+one stands apart as @base and @other: 10 of 10 shared images differ."),
    ("--tile 64", "The light differs: --llie-options tile of one is unset in base and 64 in other."),
    ("--llie-max-side 16", "The light differs: --llie-options max-side of one is unset in base and 16 in other."),
    ("--llie-resize", "The light differs: --llie-options resize of one is unset in base and true in other."),
    ("--max-side 16", "The size or encoding of images differs: --image max-side is unset in base and 16 in other."),
    ("--image jpeg:90", "The size or encoding of images differs: --image is png in base and jpeg:90 in other."),
    ("--image jpeg:50", "The size or encoding of images differs: --image is png in base and jpeg:50 in other."),
    ("--data elsewhere", "The frames of 40 shared questions are other files under the same names."),
    ("--detail low", "The parameters of models differ: --image detail is unset in base and low in other."),
    ("--temperature 0.5", "The parameters of models differ: --temperature is auto in base and 0.5 in other."),
    ("--max-tokens 7", "The parameters of models differ: --max-tokens is 1024 in base and 7 in other."),
    ("--reasoning-effort low", "The parameters of models differ: --reasoning-effort is unset in base and low in other."),
    ("--top-p 0.9", "The parameters of models differ: --top-p is unset in base and 0.9 in other."),
    ("--constrain json", "Replies are constrained differently: --request constrain is none in base and json in other."),
    ("--prompts own", "The prompts differ: --prompts is"),
    ("--shuffle-options", "The orders of choices differ: --choice-order shuffle is unset in base and true in other."),
    ("--circular", "The orders of choices differ: --choice-order circular is unset in base and true in other."),
    ("--repeats 2", "Questions were asked a different number of times: --repeats is 1 in base and 2 in other."),
    ("--families color", "The questions differ: 40 of base and 20 of other share 20 questions."),
    ("--limit 20", "The questions differ: 40 of base and 20 of other share 20 questions."),
    ("--blind-model m", ""),
    ("", "All 160 replies of other are in the other runs, too, and count once."),
];

#[test]
fn every_setting_that_decides_is_named() {
    let scene = Scene::new();
    scene.run("", "base");
    assert_eq!(scene.alerts("report base base"), ["base is named twice and counted once."]);
    check_rows(SETTINGS, |(otherwise, expected)| {
        let _ = fs::remove_dir_all(scene.bench.path("other-run/other"));
        scene.run(otherwise, "other-run/other");
        let alerts = scene.alerts("report base other-run/other");
        match expected {
            "" => assert!(alerts.is_empty(), "{otherwise}: {alerts:?}"),
            _ => assert!(
                alerts.iter().any(|alert| alert.contains(expected)),
                "{otherwise}: {expected:?} is not in {alerts:#?}"
            ),
        }
    });
}

#[test]
fn shared_light_is_compared() {
    let scene = Scene::new();
    scene.run("", "a");
    scene.run("--seed 1", "b");
    scene.run("--model n", "c");
    scene.bench.complete(&words("report a b c --out abc"));
    scene.bench.complete(&words("report c b a --out cba"));
    let files = fs::read_dir(scene.bench.path("abc")).unwrap();
    let tables: Vec<String> = files
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.contains(".csv") || name.contains(".tex"))
        .collect();
    assert!(tables.len() > 6, "{tables:?}");
    for name in tables {
        let [one, other] = ["abc", "cba"].map(|folder| fs::read(scene.bench.path(folder).join(&name)).unwrap());
        assert_eq!(one, other, "{name} depends on the order of the runs");
    }
    let rows = scene.csv("abc/comparisons.csv");
    let of_kind = |kind: &str| -> Vec<[&str; 4]> {
        rows.iter()
            .filter(|row| row[0] == kind && row[5] == "all" && row.last().unwrap() == "strict")
            .map(|row| [&*row[1], &*row[2], &*row[3], &*row[4]])
            .collect()
    };
    // Models are compared in the same light alone; c has the light of a.
    let models = of_kind("model");
    assert!(models.contains(&["m", "L3-noise @a", "n", "L3-noise @a"]), "{models:?}");
    assert!(models.iter().all(|row| row[1] == row[3]), "{models:?}");
    let lights = of_kind("light");
    let expected = [["m", "L3-noise @a", "m", "L3-noise @b"], ["m", "L3-noise+one @a", "m", "L3-noise+one @b"]];
    assert_eq!(lights, expected);
    // L0 and the exposure drop are shown by all runs, and belong to the curve of each.
    let thresholds = scene.csv("abc/thresholds.csv");
    let curves: Vec<String> = thresholds
        .iter()
        .filter(|row| row[3] == "all" && row.last().unwrap() == "strict")
        .map(|row| [&*row[0], &*row[1], &*row[2]].join(" "))
        .collect();
    let expected = [
        "m ev ",
        "m noise @a ",
        "m noise @a one",
        "m noise @b ",
        "m noise @b one",
        "n ev ",
        "n noise @a ",
        "n noise @a one",
    ];
    let mut curves = curves;
    curves.sort();
    assert_eq!(curves, expected);
    let levels = of_kind("level");
    assert!(levels.contains(&["m", "L3-noise @b", "m", "L0"]), "{levels:?}");
    // The summary names the run whose light it is.
    let summary = scene.csv("abc/summary.csv");
    assert_eq!(summary[0].last().unwrap(), "light");
    assert!(summary.iter().any(|row| row.last().unwrap() == "b"));
    let json: Value = serde_json::from_slice(&fs::read(scene.bench.path("abc/summary.json")).unwrap()).unwrap();
    // The scripted models answer one letter, which is said before all else.
    let kinds: Vec<&Value> = json["alerts"].as_array().unwrap().iter().map(|alert| &alert["kind"]).collect();
    let first = kinds.iter().find(|kind| !["image_ignored", "answers"].contains(&kind.as_str().unwrap()));
    assert_eq!(first.unwrap(), &"light", "{kinds:?}");
    let page = fs::read_to_string(scene.bench.path("abc/report.html")).unwrap();
    assert!(page.contains("The light differs: --seed is 0 in a and c and 1 in b."));
}

#[test]
fn equal_names_show_their_difference() {
    let scene = Scene::new();
    scene.run("", "a");
    scene.run("--detail low", "b");
    scene.run("--detail low --temperature 1 --max-tokens 9", "c");
    let pair = scene.bench.complete(&words("report a b --full"));
    check_rows(["m (--image detail unset)", "m (--image detail low)"], |name| {
        assert!(pair.contains(name), "{name}: {pair}");
    });
    let three = scene.bench.complete(&words("report a b c --full"));
    check_rows(["m (a)", "m (b)", "m (c)"], |name| {
        assert!(three.contains(name), "{name}: {three}");
    });
}

#[test]
fn other_questions_compare_shared_ones() {
    let scene = Scene::new();
    scene.run("", "a");
    scene.run("--model n --limit 20", "b");
    let text = scene.bench.complete(&words("report a b --full"));
    let alert = "! Models were asked different questions: n was asked 20 of 40 questions. Compare by the 20 shared";
    assert!(text.contains(alert), "{text}");
    assert!(text.contains("Accuracy in % on the 20 questions that all models with images answered"), "{text}");
    assert!(text.contains("chance: 33.33 over 20 questions"), "{text}");
    assert!(text.contains("too few: fewer than 30 items are shared in 4 rows"), "{text}");
    let common = scene.bench.complete(&words("report a b --common --out common"));
    assert!(!common.contains("asked different questions"), "{common}");
    let rows = scene.csv("common/summary.csv");
    let all = rows.iter().filter(|row| row[5] == "all" && row[6] == "strict");
    assert!(all.clone().count() > 8);
    for row in all {
        assert_eq!(row[7], "20", "{row:?}");
    }
}

#[test]
fn baseline_sides_keep_their_cost() {
    let scene = Scene::new();
    for (run, levels, dollars) in [("old", "L1,L3", 10), ("new", "L1,L3", 30), ("bright", "L1", 20), ("dark", "L3", 40)]
    {
        let prices =
            format!("as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = {{ input = {dollars}, output = {dollars} }}\n");
        scene.bench.file("prices.toml", prices);
        scene.run(&format!("--prices prices.toml --levels {levels}"), run);
    }
    let has_ratio = |line: &str, wanted: fn(&str) -> f64| {
        scene.bench.complete(&words(line));
        let rows = scene.csv("out/baseline.csv");
        let place = |name: &str| rows[0].iter().position(|head| head == name).unwrap();
        let cost = |row: &[String], name: &str| row[place(name)].parse::<f64>().unwrap();
        assert!(rows.len() > 2, "{rows:?}");
        for row in &rows[1..] {
            let (old, new) = (cost(row, "cost_old"), cost(row, "cost_new"));
            let ratio = wanted(&row[place("condition")]);
            assert!(old > 0.0 && (new / old - ratio).abs() < 1e-9, "{row:?}");
        }
    };
    has_ratio("report new --baseline old --out out", |_| 3.0);
    has_ratio(
        "report bright dark --baseline old --out out",
        |condition| {
            if condition.starts_with("L1") { 2.0 } else { 4.0 }
        },
    );
}

#[test]
fn new_run_is_held_against_baseline() {
    let scene = Scene::new();
    let run = |answers: &str, more: &str, out: &str| {
        scene.bench.file("m.jsonl", answers);
        let line = format!("--model script:m.jsonl --data frames --levels L0,L3 --out {out} {more}");
        scene.bench.complete(&words(&line));
    };
    run("{\"default\": \"red\"}", "", "old");
    run("{\"default\": \"blue\"}", "", "worse");
    run("{\"default\": \"blue\"}", "--seed 1", "light");
    let worse = scene.bench.call(&words("report worse --baseline old --out out"));
    assert_eq!(worse.code, Some(0), "{worse:?}");
    let rows = scene.csv("out/baseline.csv");
    let place = |name: &str| rows[0].iter().position(|head| head == name).unwrap();
    let conditions: Vec<&str> = rows[1..].iter().map(|row| &*row[place("condition")]).collect();
    assert_eq!(conditions, ["L0", "L3-ev", "L3-noise"]);
    for row in &rows[1..] {
        let found = ["n", "only_new", "only_old", "difference", "verdict"].map(|name| &*row[place(name)]);
        assert_eq!(found, ["40", "0", "20", "-0.5", "worse"], "{row:?}");
    }
    let json: Value = serde_json::from_slice(&fs::read(scene.bench.path("out/summary.json")).unwrap()).unwrap();
    assert_eq!(json["baseline"].as_array().unwrap().len(), 3);
    let finding = &json["findings"][0];
    assert_eq!(finding["text"], "script:m.jsonl is worse than in old at L0, L3-ev, L3-noise, by up to 50.0 points.");
    assert_eq!(finding["verdict"], "worse");
    insta::assert_snapshot!(worse.lines_with("worse"), @"
    exit code: 0
     script:m.jsonl is worse than in old at L0, L3-ev, L3-noise, by up to 50.0
     Baseline       −  script:m.jsonl is worse than in old at L0, L3-ev, L3-noise,
    run: worse
    ");
    let tex = fs::read_to_string(scene.bench.path("out/tables.tex")).unwrap();
    assert!(tex.contains("New less old"), "{tex}");
    let failing = scene.bench.call(&words("report worse --baseline old --fail-if-worse"));
    assert_eq!(failing.code, Some(1), "{failing:?}");
    let same = scene.bench.call(&words("report old --baseline old --fail-if-worse"));
    assert_eq!(same.code, Some(0), "{same:?}");
    let unshown = "It is not shown that any model is worse or better than in old.";
    let printed: Vec<&str> = same.stdout.split_whitespace().collect();
    assert!(printed.join(" ").contains(unshown), "{same:?}");
    // Only the same images count.
    scene.bench.complete(&words("report light --baseline old --out out"));
    let rows = scene.csv("out/baseline.csv");
    let conditions: Vec<&str> = rows[1..].iter().map(|row| &*row[place("condition")]).collect();
    assert_eq!(conditions, ["L0", "L3-ev"]);
    // What was not compared does not pass.
    let passed_over = scene.bench.call(&words("report old --baseline light --fail-if-worse"));
    assert_eq!(passed_over.code, Some(2), "{passed_over:?}");
    let gap = "script:m.jsonl L3-noise of light is not compared: the new run has no reply about the same images";
    insta::assert_snapshot!(passed_over.messages(), @"
    exit code: 2
    error: --fail-if-worse: script:m.jsonl L3-noise of light is not compared: the new run has no reply about the
        same images; leave the flag out to see the report
    ");
    let shown = scene.bench.call(&words("report old --baseline light"));
    let printed: Vec<&str> = shown.stdout.split_whitespace().collect();
    assert!(printed.join(" ").contains(gap), "{shown:?}");
    let alone = scene.bench.call(&words("report old --fail-if-worse"));
    insta::assert_snapshot!(alone.messages(), @"
    exit code: 2
    error: --fail-if-worse: compares with an old run: name it with --baseline OLD
    ");
}

#[test]
fn marks_of_different_judges_stay_apart() {
    let house = House::new();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    for (judge, mark) in [("one", "2"), ("two", "4")] {
        house.0.file(&format!("{judge}.jsonl"), format!("{{\"default\": \"{mark}\"}}"));
        let line = format!("--model script:a.jsonl --levels L0 --judge script:{judge}.jsonl --out {judge}");
        assert_eq!(house.call(&words(&line)).code, Some(0));
    }
    let refused = house.0.call(&words("report one two"));
    assert_eq!(refused.code, Some(2));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: two: its answers were marked by script:two.jsonl (upstream) and those of one by script:one.jsonl
        (upstream): marks of two judges or protocols cannot be compared; report each run alone, or run openeqa on
        its folder again with the other's --judge and --protocol: only marks are asked
    ");
    let baseline = house.0.call(&words("report one --baseline two"));
    insta::assert_snapshot!(baseline.messages(), @"
    exit code: 2
    error: --baseline: compares runs of questions with choices; marks of open questions have no such test: leave
        it out
    ");
    let lux = house.0.call(&words("report one --lux-at-L0 200"));
    insta::assert_snapshot!(lux.messages(), @"
    exit code: 2
    error: --lux-at-l0: a report on open questions has no threshold: leave it out
    ");
    assert_eq!(house.0.call(&words("report one")).code, Some(0));
}

#[cfg(unix)]
#[test]
fn the_written_workflow_fails_if_a_model_is_worse() {
    let scene = Scene::new();
    let bench = &scene.bench;
    let made = bench.complete(&words("init --ci github"));
    assert!(made.starts_with("./.github/workflows/darkqa.yml\n"), "{made}");
    let again = bench.call(&words("init --ci github"));
    assert!(again.code == Some(2) && again.stderr.contains("exists already"), "{again:?}");
    let workflow = fs::read_to_string(bench.path(".github/workflows/darkqa.yml")).unwrap();
    bench.program("darkqa-eval", &format!("exec '{}' \"$@\"", env!("CARGO_BIN_EXE_darkqa-eval")));
    // A step as the service runs it, with the variables of the workflow set for the data here.
    let step = |name: &str| {
        let (_, after) = workflow.split_once(&format!("- name: {name}\n")).unwrap();
        let line = after.lines().find_map(|line| line.trim().strip_prefix("run: ")).unwrap();
        let variables = [
            ("MODEL", "script:m.jsonl"),
            ("DATA", "frames"),
            ("BASELINE", "baseline"),
            ("MAX_COST", "5"),
            ("GITHUB_STEP_SUMMARY", "summary.md"),
        ];
        for (variable, _) in &variables[..4] {
            assert!(workflow.contains(&format!("\n      {variable}: ")), "{variable}");
        }
        let mut shell = std::process::Command::new("bash");
        shell.args(["-eo", "pipefail", "-c", line]).current_dir(bench.path("")).envs(variables);
        called(shell.env("PATH", bench.search_path()))
    };
    let run = |answers: &str| {
        let _ = fs::remove_dir_all(bench.path("run"));
        bench.file("m.jsonl", answers);
        let asked = step("Ask");
        assert_eq!(asked.code, Some(0), "{asked:?}");
        step("Compare")
    };
    bench.file("m.jsonl", "{\"default\": \"red\"}");
    bench.complete(&words("--model script:m.jsonl --data frames --out baseline"));
    let same = run("{\"default\": \"red\"}");
    assert_eq!(same.code, Some(0), "{same:?}");
    let worse = run("{\"default\": \"blue\"}");
    assert_eq!(worse.code, Some(1), "{worse:?}");
    let summary = fs::read_to_string(bench.path("summary.md")).unwrap();
    assert!(summary.contains("is worse than in baseline"), "{summary}");
}
