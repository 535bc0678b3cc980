//! What a run is known by: which command is refused on its folder and by which field, which may add to it, and what
//! enters the keys of its trials.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::onnx;
use crate::support::run::{Bench, Called, words};
use serde_json::{Value, json};

/// Two frames with three questions, two walks with three, models that mend, and an endpoint that answers everything.
struct Scene {
    house: House,
    endpoint: MockEndpoint,
    folders: Cell<usize>,
}

/// The flags of a run, each said once.
struct Flags {
    command: &'static str,
    said: &'static [(&'static str, &'static str)],
}

const EVALUATION: Flags = Flags { command: "", said: &[("--data", "frames"), ("--model", "m"), ("--levels", "L0,L3")] };

const OPEN: Flags = Flags {
    command: "openeqa",
    said: &[
        ("--questions", "questions.json"),
        ("--frames", "walks"),
        ("--num-frames", "3"),
        ("--image-size", "48"),
        ("--model", "m"),
        ("--levels", "L0,L3"),
    ],
};

/// A picture of its own in every pixel.
fn picture(shade: u8) -> image::RgbImage {
    image::RgbImage::from_fn(24, 16, |x, y| image::Rgb([shade.wrapping_add((x * 9) as u8), (y * 15) as u8, shade]))
}

/// Frames in a folder, with questions about them.
fn frames(bench: &Bench, folder: &str, shade: u8) {
    let lines = [
        json!({"id": "a1", "frame": "a.png", "family": "presence", "question": "Is there a lamp?", "choices": ["yes", "no"], "answer": "no"}),
        json!({"id": "b1", "frame": "b.png", "family": "presence", "question": "Is there a bed?", "choices": ["yes", "no"], "answer": "yes"}),
        json!({"id": "a2", "frame": "a.png", "family": "color", "question": "What color?", "choices": ["red", "blue", "green"], "answer": "blue"}),
    ];
    let lines: Vec<String> = lines.iter().map(ToString::to_string).collect();
    bench.file(&format!("{folder}/questions.jsonl"), lines.join("\n"));
    for (name, shade) in [("a.png", shade), ("b.png", 150)] {
        picture(shade).save(bench.path(&format!("{folder}/{name}"))).unwrap();
    }
}

impl Scene {
    fn new() -> Self {
        let house = House::new();
        let bench = &house.0;
        frames(bench, "frames", 20);
        frames(bench, "elsewhere/frames", 70);
        let asked = |path: &str| fs::read_to_string(bench.path(path)).unwrap();
        bench.file("other.jsonl", asked("frames/questions.jsonl").replace("a lamp", "a torch"));
        bench.file("other.json", asked("questions.json").replace("What colour", "Which colour"));
        for name in ["choice.txt", "blind.txt"] {
            let built_in = format!("{}/prompts/{name}", env!("CARGO_MANIFEST_DIR"));
            let text = fs::read_to_string(built_in).unwrap();
            bench.file(&format!("own/{name}"), format!("Look closely.\n{text}"));
        }
        let bank = [
            json!({"id": "lamp", "question": "Is there a lamp?", "choices": ["yes", "no"]}),
            json!({"id": "color", "question": "What color?", "choices": ["red", "blue"]}),
        ];
        bench.file("bank.jsonl", bank.map(|line| line.to_string()).join("\n"));
        let rules = include_str!("../../../src/questions/rules.toml");
        bench.file("rules.toml", rules.replace("gap_mm = 300", "gap_mm = 301"));
        onnx::gain(0.5).write(&bench.path(""), "one.onnx");
        onnx::gamma(0.5).write(&bench.path(""), "two.onnx");
        Self { house, endpoint: MockEndpoint::start([Answer::text("A")]), folders: Cell::new(0) }
    }

    /// The name of a folder that is not there.
    fn fresh(&self) -> String {
        self.folders.set(self.folders.get() + 1);
        format!("run-{}", self.folders.get())
    }

    /// A call with these flags, some of them said otherwise.
    fn call(&self, flags: &Flags, otherwise: &str, out: &str) -> Called {
        let otherwise = words(otherwise);
        let base = self.endpoint.base_url();
        let mut said = words(flags.command);
        for &(flag, value) in flags.said.iter().chain(&[("--base-url", &*base)]) {
            if !otherwise.contains(&flag) {
                said.extend([flag, value]);
            }
        }
        said.extend(otherwise);
        said.extend(["--out", out]);
        self.house.0.call(&said)
    }

    /// A run that must end well.
    fn complete(&self, flags: &Flags, otherwise: &str, out: &str) {
        let called = self.call(flags, otherwise, out);
        assert_eq!(called.code, Some(0), "{otherwise}: {called:?}");
    }

    fn kept(&self, out: &str) -> String {
        let path = format!("{out}/records.jsonl");
        fs::read_to_string(self.house.0.path(&path)).unwrap()
    }

    /// The keys of a run in a folder, by question and condition.
    fn keys_in(&self, out: &str) -> Keys {
        let mut keys = Keys::new();
        for line in self.kept(out).lines() {
            let record: Value = serde_json::from_str(line).unwrap();
            let text = |field: &str| record[field].as_str().unwrap_or("blind").to_owned();
            let before = keys.insert((text("condition"), text("question")), text("key"));
            assert!(before.is_none(), "{record}");
        }
        keys
    }

    /// The keys of a run in a folder of its own.
    fn keys(&self, flags: &Flags, otherwise: &str) -> Keys {
        let out = self.fresh();
        self.complete(flags, otherwise, &out);
        self.keys_in(&out)
    }

    /// A command on the folder of a run is refused by this field; nothing is asked, and nothing changes.
    fn refuses(&self, flags: &Flags, otherwise: &str, out: &str, field: &str) {
        let (asked, kept) = (self.endpoint.requests().len(), self.kept(out));
        let called = self.call(flags, otherwise, out);
        assert_eq!(called.code, Some(2), "{otherwise}: {called:?}");
        assert!(called.stderr.contains(field), "{otherwise}: {field} expected: {}", called.stderr);
        assert_eq!(self.endpoint.requests().len(), asked, "{otherwise}");
        assert_eq!(self.kept(out), kept, "{otherwise}");
    }

    /// Asserts that a command on a run's folder asks `new` new trials and no existing one.
    fn adds(&self, flags: &Flags, otherwise: &str, out: &str, new: usize) {
        let (asked, kept) = (self.endpoint.requests().len(), self.kept(out));
        self.complete(flags, otherwise, out);
        let asked = self.endpoint.requests().len() - asked;
        assert_eq!(asked, new, "{otherwise}");
        let now = self.kept(out);
        assert!(now.starts_with(&kept), "{otherwise}");
        assert_eq!(now.lines().count() - kept.lines().count(), new, "{otherwise}");
        let key = |line: &str| serde_json::from_str::<Value>(line).unwrap()["key"].to_string();
        let keys: BTreeSet<String> = now.lines().map(key).collect();
        assert_eq!(keys.len(), now.lines().count(), "{otherwise}");
    }
}

/// Keys by condition and question.
type Keys = BTreeMap<(String, String), String>;

/// The conditions in which keys of two runs differ, and those in which they are the same.
fn compared(one: &Keys, other: &Keys) -> (BTreeSet<String>, BTreeSet<String>) {
    let (mut differ, mut same) = (BTreeSet::new(), BTreeSet::new());
    for (place, key) in one {
        let side = match other.get(place) {
            Some(other) if other == key => &mut same,
            Some(_) => &mut differ,
            None => continue,
        };
        side.insert(place.0.clone());
    }
    (differ, same)
}

fn set(conditions: &str) -> BTreeSet<String> {
    conditions.split_whitespace().map(str::to_owned).collect()
}

/// What refuses an evaluation on the folder of another: the field that the message names, and the flag.
const REFUSED: [(&str, &str); 35] = [
    ("--data", "--data elsewhere/frames"),
    ("--ask", "--ask bank.jsonl"),
    ("--questions", "--questions other.jsonl"),
    ("--rules", "--rules rules.toml"),
    ("--choice-order shuffle", "--shuffle-options"),
    ("--choice-order circular", "--circular"),
    ("--seed", "--seed 7"),
    ("--noise camera", "--camera nikon-d850"),
    ("--noise camera, gain, ratio or fixed", "--gain 1.5"),
    ("--noise camera, gain, ratio or fixed", "--ratio 150"),
    ("--noise camera, gain, ratio or fixed", "--fixed"),
    ("--llie-options tile", "--tile 64"),
    ("--llie-options tile", "--tile whole"),
    ("--llie-options max-side", "--llie-max-side 8"),
    ("--llie-options resize", "--llie-resize"),
    ("--image", "--image jpeg:90"),
    ("--image max-side", "--max-side 16"),
    ("--base-url", "--base-url http://127.0.0.1:9/v1"),
    ("--prompts", "--prompts own"),
    ("--temperature", "--temperature 0.5"),
    ("--max-tokens", "--max-tokens 7"),
    ("--max-tokens", "--token-field none"),
    ("--reasoning-effort", "--reasoning-effort low"),
    ("--top-p", "--top-p 0.9"),
    ("--image detail", "--detail low"),
    ("--thinking", "--thinking off"),
    ("--request wire", "--wire responses"),
    ("--request probabilities", "--probabilities"),
    ("--image first", "--image-first"),
    ("--request constrain", "--constrain json"),
    ("--request constrain", "--constrain choice"),
    ("--extra-body", "--extra-body {\"top_k\":1}"),
    ("--request omit-field", "--omit-field temperature"),
    ("--system", "--system Look!"),
    ("--system", "--system-file own/choice.txt"),
];

/// The same for open questions.
const OPEN_REFUSED: [(&str, &str); 29] = [
    ("--questions", "--questions other.json"),
    ("--num-frames", "--num-frames 2"),
    ("--image-size", "--image-size 32"),
    ("--image-size", "--image-size native"),
    ("--degrade", "--degrade resized"),
    ("--sensor", "--sensor frame"),
    ("--seed", "--seed 7"),
    ("--noise camera", "--camera nikon-d850"),
    ("--noise camera, gain, ratio or fixed", "--gain 1.5"),
    ("--noise camera, gain, ratio or fixed", "--ratio 150"),
    ("--noise camera, gain, ratio or fixed", "--fixed"),
    ("--llie-options tile", "--tile 64"),
    ("--llie-options max-side", "--llie-max-side 8"),
    ("--llie-options resize", "--llie-resize"),
    ("--image", "--image jpeg:90"),
    ("--base-url", "--base-url http://127.0.0.1:9/v1"),
    ("--temperature", "--temperature 0.5"),
    ("--max-tokens", "--max-tokens 7"),
    ("--max-tokens", "--token-field none"),
    ("--sampling-seed", "--sampling-seed 5"),
    ("--reasoning-effort", "--reasoning-effort low"),
    ("--top-p", "--top-p 0.9"),
    ("--image detail", "--detail low"),
    ("--extra-body", "--extra-body {\"top_k\":1}"),
    ("--request omit-field", "--omit-field temperature"),
    ("--system", "--system Look!"),
    ("--system", "--system-file own/choice.txt"),
    ("--thinking", "--thinking off"),
    ("--request wire", "--wire responses"),
];

#[test]
fn evaluation_fields_refuse_other_values() {
    let scene = Scene::new();
    let enhanced = |otherwise: &str| format!("--limit 1 --llie one.onnx --llie-anyway {otherwise}");
    scene.complete(&EVALUATION, &enhanced(""), "run");
    for (field, otherwise) in REFUSED {
        scene.refuses(&EVALUATION, &enhanced(otherwise), "run", field);
    }
}

#[test]
fn open_fields_refuse_other_values() {
    let scene = Scene::new();
    let enhanced = |otherwise: &str| format!("--limit 1 --llie one.onnx --llie-anyway {otherwise}");
    scene.complete(&OPEN, &enhanced(""), "run");
    for (field, otherwise) in OPEN_REFUSED {
        scene.refuses(&OPEN, &enhanced(otherwise), "run", field);
    }
}

/// A value more in a run: what was said before and what is said then, and how many trials are new.
type Addition = (&'static str, &'static str, usize);

/// What may be added to an evaluation. A part of the noise model that is said makes another noise profile.
const ADDITIONS: [Addition; 24] = [
    ("", "--blind", 3),
    ("", "--model m --model n", 9),
    ("", "--model n", 9),
    ("", "--blind-model m", 3),
    ("--levels L0,L3", "--levels L0,L3,L5", 6),
    ("--levels L0", "--levels L3", 6),
    ("--variant ev", "--variant both", 3),
    ("", "--variant both,auto", 3),
    ("", "--variant all --levels L0,L3,T33.33", 6),
    ("--variant all --levels L0,L3,T9", "--variant all --levels L0,L3,T9,T33.33", 3),
    ("--llie one.onnx --llie-anyway", "--llie one.onnx --llie two.onnx --llie-anyway", 3),
    ("--llie one.onnx --llie-anyway", "--llie one.onnx --llie-on both --llie-anyway", 3),
    ("--llie one.onnx --llie-anyway", "--llie one.onnx --llie-on l0,noise --llie-anyway", 3),
    ("", "--profile physical", 3),
    ("", "--amplify all", 3),
    ("", "--tone before-ev", 3),
    ("", "--draws fresh", 3),
    ("", "--coupling photon", 3),
    ("--limit 2", "--limit 3", 3),
    ("--families presence", "--families presence,color", 3),
    ("", "--repeats 2", 9),
    ("", "--noise-seeds 2", 3),
    // Of two images: without an image, at L0 twice, and at L3 twice.
    ("--ask bank.jsonl --ask-per-image 1", "--ask-per-image 2 --ask bank.jsonl", 10),
    // They come with the observer alone.
    ("", "--observer-controls", 0),
];

/// Additions that a run of open questions accepts.
const OPEN_ADDITIONS: [Addition; 10] = [
    ("", "--model m --model n", 6),
    ("", "--model n", 6),
    ("", "--blind-model m", 3),
    ("--levels L0,L3", "--levels L0,L3,L5", 3),
    ("--variant noise", "--variant both", 3),
    ("", "--variant noise,auto,motion --levels L0,L3,T33.33", 6),
    ("--llie one.onnx --llie-anyway", "--llie one.onnx --llie two.onnx --llie-anyway", 3),
    ("--variant both --llie one.onnx --llie-anyway", "--variant both --llie one.onnx --llie-on both --llie-anyway", 3),
    ("", "--profile physical", 3),
    ("--limit 2", "--limit 3", 2),
];

/// Settings that change no answer: on a run's folder they ask nothing.
const NOTHING: [&str; 44] = [
    "--max-pixels 1000000",
    "--threads 1",
    "--offline",
    "--llie-timeout 60",
    "--llie-max-memory 9",
    "--api-key-env none",
    "--api-key-file key.txt",
    "--vendor vendors.toml",
    "--trust-models",
    "--key-anyway",
    "--key-header api-key",
    "--header X-Team:vision",
    "--header-env X-Auth=PATH",
    "--allow-http",
    "--concurrency 2",
    "--rpm 6000",
    "--tpm 900000",
    "--timeout 60",
    "--retries 1",
    "--paid-retries 2",
    "--max-wait 9",
    "--patience 60",
    "--max-image 3",
    "--max-failures 4",
    "--fail-fast",
    "--max-cost 5",
    "--prices prices.toml",
    "--dry-run",
    "--workers 2",
    "--grace 9",
    "--timings",
    "--images-cache images",
    "--images-cache-what all --images-cache images",
    "--images-cache-size 1 --images-cache images",
    "--shared",
    "--full",
    "--findings",
    "--json",
    "--no-parquet",
    "--lux-at-l0 200",
    "--llie-budget 50ms",
    "--quiet",
    "--color never",
    "--config other.toml",
];

#[test]
fn what_decides_nothing_asks_nothing() {
    let scene = Scene::new();
    let bench = &scene.house.0;
    bench.file("key.txt", "k\n");
    let vendor =
        "[[vendor]]\nname = \"Mine\"\nhosts = [\"127.0.0.1\"]\nkey = []\ntoken-field = \"max_completion_tokens\"\n";
    bench.file("vendors.toml", vendor);
    bench.file("other.toml", "retries = 3\n");
    let prices = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1, output = 1 }\n";
    bench.file("prices.toml", prices);
    let enhanced = |otherwise: &str| format!("--limit 1 --llie one.onnx --llie-anyway {otherwise}");
    scene.complete(&EVALUATION, &enhanced(""), "run");
    for otherwise in NOTHING {
        scene.adds(&EVALUATION, &enhanced(otherwise), "run", 0);
    }
}

/// Where keyed flags are held: each key has a row of its own, by its earlier flag.
const KEYS: &str = "by key";

/// Flags that the tables here leave out, and where they are held.
const ELSEWHERE: [(&str, &str); 61] = [
    ("--noise", KEYS),
    ("--read", KEYS),
    ("--skip", KEYS),
    ("--decode", KEYS),
    ("--choice-order", KEYS),
    ("--llie-options", KEYS),
    ("--request", KEYS),
    ("--allow", KEYS),
    ("--stop", KEYS),
    ("--design", "tests/program/scores/draws.rs"),
    ("--map", "tests/program/data/ready_made.rs"),
    ("--config-name", "src/data/ready_made/tests/shapes.rs"),
    ("--split", "src/data/ready_made/tests/shapes.rs"),
    ("--rows", "src/data/ready_made/tests/shapes.rs"),
    ("--multi-image", "src/data/ready_made/tests/shapes.rs"),
    ("--no-image", "src/data/ready_made/tests/shapes.rs"),
    ("--open", "tests/program/data/ready_made.rs"),
    ("--several", "src/data/ready_made/tests/refusals.rs"),
    ("--bad", "src/data/ready_made/tests/refusals.rs"),
    ("--data-root", "tests/program/data/ready_made.rs"),
    ("--keep-instructions", "src/data/ready_made/tests/shapes.rs"),
    ("--light", "tests/program/data/photographs.rs"),
    ("--pairs", "tests/program/data/photographs.rs"),
    ("--label-folders", "tests/program/data/photographs.rs"),
    ("--choices", "tests/program/data/photographs.rs"),
    ("--transfer", "it changes images of 16 bits: tests/program/data/inputs/depth.rs"),
    ("--exposure", "it changes linear light: tests/program/data/inputs/light.rs"),
    ("--colour", "it changes images of other colours than sRGB: tests/program/data/inputs/colour.rs"),
    ("--auto", "camera_settings_follow_variants"),
    ("--motion", "camera_settings_follow_variants"),
    ("--llie-anyway", "tests/program/images/enhance/probe.rs"),
    ("--enhanced", "tests/program/images/enhance/elsewhere.rs"),
    ("--models", "tests/program/models/models_file.rs"),
    ("--only", "tests/program/models/models_file.rs"),
    ("--set", "tests/program/models/models_file.rs"),
    ("--splits", "tests/program/runs/openeqa/"),
    ("--categories", "tests/program/runs/openeqa/"),
    ("--file-size", "tests/program/batches/batch.rs"),
    ("--file-requests", "tests/program/batches/batch.rs"),
    ("--url", "tests/program/batches/batch.rs"),
    ("--out", "names the folder"),
    ("--resume", "names the folder"),
    ("--shard", "tests/program/runs/shards.rs"),
    ("--ort-lib", "a library of one machine: tests/program/images/enhance/"),
    ("--ca-file", "takes a server with TLS: tests/program/endpoints/ask.rs"),
    ("--frames", "tests/program/runs/openeqa/"),
    ("--answers", "tests/program/runs/openeqa/"),
    ("--judge", "marks are trials of their own: tests/program/runs/openeqa/"),
    ("--protocol", "tests/program/runs/openeqa/"),
    ("--subset", "tests/program/runs/openeqa/"),
    ("--study", "tests/program/runs/openeqa/"),
    ("--batch", "tests/program/batches/batch.rs"),
    ("--batch-run", "tests/program/batches/batch_run/"),
    ("--poll", "tests/program/batches/batch_run/"),
    ("--keep-files", "tests/program/batches/batch_run/"),
    ("--detach", "tests/program/batches/batch_run/"),
    ("--no-scout", "tests/program/batches/batch_run/"),
    ("--enqueued-tokens", "tests/program/batches/batch_run/"),
    ("--window", "tests/program/batches/batch_run/"),
    ("--give-up", "tests/program/batches/batch_run/"),
    ("--purpose", "tests/program/batches/batch_run/"),
];

/// The flags of a command with what each decides, from the list that is written from the program.
fn classes(command: &str) -> Vec<(&'static str, &'static str)> {
    let all = include_str!("../../../src/docs/flags.md");
    let section = |name: &str| {
        let title = format!("## darkqa-eval{name}\n");
        let (_, section) = all.split_once(&title).unwrap();
        section.split("\n## ").next().unwrap()
    };
    let mut classes: Vec<_> = section(command).lines().filter_map(class_of_row).collect();
    // Flags that an earlier command describes: `As in [darkqa-eval](#darkqa-eval): `--data`, `--map``.
    for line in section(command).lines() {
        let Some((name, flags)) = line.strip_prefix("As in [darkqa-eval").and_then(|rest| rest.split_once("): "))
        else {
            continue;
        };
        let name = name.split(']').next().unwrap();
        let rows = section(name).lines().filter(|row| {
            let typed = long_form(row).map(typed_flag);
            typed.is_some_and(|typed| flags.split(", ").any(|flag| flag == typed))
        });
        classes.extend(rows.filter_map(class_of_row));
    }
    classes
}

/// The row of a flag from its long form on: `--data DIR` | …` of `| `-d, --data DIR` | …`; `None` for other lines.
fn long_form(row: &str) -> Option<&str> {
    let flag = row.strip_prefix("| `")?;
    let flag = flag.split_once(", ").filter(|(short, _)| short.len() == 2).map_or(flag, |(_, long)| long);
    flag.starts_with("--").then_some(flag)
}

/// A flag without its value, in backticks: `--noise gain` of `--noise gain=K`, and `--data` of `--data DIR`.
fn typed_flag(row: &str) -> String {
    let cell = row.split(['=', '[', '`']).next().unwrap();
    let mut words = cell.split(' ');
    let flag = words.next().unwrap();
    let key = words.next().filter(|word| !word.contains(char::is_uppercase));
    match key {
        Some(key) => format!("`{flag} {key}`"),
        None => format!("`{flag}`"),
    }
}

/// The flag of a row, a key by its earlier flag, and what it decides.
fn class_of_row(row: &'static str) -> Option<(&'static str, &'static str)> {
    let row = long_form(row)?;
    let cells: Vec<&str> = row.split(" | ").collect();
    let earlier = cells[0].strip_suffix("` until 0.2)");
    let earlier = earlier.and_then(|flag| flag.split(" (`").last());
    let flag = earlier.unwrap_or(cells[0]);
    Some((flag.split([' ', ',', '`']).next().unwrap(), cells[2]))
}

#[test]
fn every_flag_has_its_effect() {
    let first = |args: &&'static str| args.split(' ').next().unwrap();
    let refused = REFUSED.iter().chain(&OPEN_REFUSED).map(|(_, args)| first(args));
    let added = ADDITIONS.iter().chain(&OPEN_ADDITIONS).map(|(_, args, _)| first(args));
    // Of `--llie one.onnx --llie-on both` the last flag is the one that is tried.
    let on = std::iter::once("--llie-on");
    let decide: BTreeSet<&str> = refused.chain(added).chain(on).collect();
    let nothing: BTreeSet<&str> = NOTHING.iter().map(first).collect();
    let elsewhere: BTreeSet<&str> = ELSEWHERE.iter().map(|(flag, _)| *flag).collect();
    let mut wrong = Vec::new();
    for command in ["", " openeqa"] {
        let classes = classes(command);
        assert!(classes.len() > 40, "{classes:?}");
        for (flag, class) in classes {
            let held = match class {
                "nothing" => nothing.contains(flag) && !decide.contains(flag),
                "trials" | "reply" | "pixels" => decide.contains(flag) && !nothing.contains(flag),
                _ => false,
            };
            // The keys and addresses of a judge are those of a model, in the same structure.
            if !held && !elsewhere.contains(flag) && !flag.starts_with("--judge-") {
                wrong.push(format!("{command} {flag}: {class}, and no row of that kind"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn other_column_value_is_asked() {
    let scene = Scene::new();
    for (flags, additions) in [(&EVALUATION, &ADDITIONS[..]), (&OPEN, &OPEN_ADDITIONS)] {
        for (before, then, new) in additions {
            let out = scene.fresh();
            scene.complete(flags, before, &out);
            scene.adds(flags, then, &out, *new);
        }
    }
}

#[test]
fn grown_run_is_incomplete_until_asked() {
    let scene = Scene::new();
    scene.complete(&EVALUATION, "", "run");
    let manifest = || -> Value {
        let path = scene.house.0.path("run/manifest.json");
        serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
    };
    assert_eq!(manifest()["status"], "complete");
    let gone = "--model gone --base-url http://127.0.0.1:9/v1 --retries 0";
    let called = scene.call(&EVALUATION, gone, "run");
    assert_eq!(called.code, Some(2), "{called:?}");
    let now = manifest();
    assert_eq!(now["status"], "stopped");
    assert_eq!(now["counts"]["answered"], 9);
    assert_eq!(now["counts"]["trials"], 18);
    // Blind models look at no image; what is known of it stays known.
    let questions = || fs::read_to_string(scene.house.0.path("run/questions.jsonl")).unwrap();
    let before = questions();
    scene.complete(&EVALUATION, "--model n --blind", "run");
    assert_eq!(questions(), before);
    assert!(before.contains("\"image\""), "{before}");
}

#[test]
fn trial_key_covers_the_image() {
    let scene = Scene::new();
    let keys = |otherwise: &str| scene.keys(&EVALUATION, otherwise);
    let enhanced = |otherwise: &str| keys(&format!("--llie one.onnx --llie-anyway {otherwise}"));
    let (raw, first) = (keys(""), enhanced(""));
    assert_eq!((raw.len(), first.len()), (9, 12));
    assert_eq!(first, enhanced(""), "the same command again");
    let all = set("L0 L3-ev L3-noise L3-noise+one");
    let of_raw = set("L0 L3-ev L3-noise");
    let noisy = set("L3-noise L3-noise+one");
    assert_eq!(compared(&raw, &first), (set(""), of_raw.clone()));
    let other = enhanced("--seed 7");
    assert_eq!(compared(&first, &other), (noisy.clone(), set("L0 L3-ev")));
    let other = enhanced("--camera nikon-d850");
    assert_eq!(compared(&first, &other), (noisy, set("L0 L3-ev")));
    for sent in ["--max-side 16", "--image jpeg:90"] {
        assert_eq!(compared(&first, &enhanced(sent)), (all.clone(), set("")));
    }
    onnx::gain(0.75).write(&scene.house.0.path(""), "one.onnx");
    let other = enhanced("");
    assert_eq!(compared(&first, &other), (set("L3-noise+one"), of_raw));
}

/// The camera's settings are in the keys, and in the manifest, of the variants that they decide, and of no other.
#[test]
fn camera_settings_follow_variants() {
    const ALL: &str = "--variant all --levels L0,L3,T33.33";
    let scene = Scene::new();
    let keys = |otherwise: &str| scene.keys(&EVALUATION, &format!("{ALL} {otherwise}"));
    let (plain, first) = (scene.keys(&EVALUATION, ""), keys(""));
    let others = set("L0 L3-ev L3-noise");
    assert_eq!(compared(&plain, &first), (set(""), others));
    let differ = |one: &str, other: &str| compared(&keys(one), &keys(other)).0;
    for (otherwise, expected) in [
        ("--motion speed=30,hfov=79,angle=0", ""),
        ("--motion speed=31", "L3-auto T33.33-motion"),
        ("--motion hfov=60", "L3-auto T33.33-motion"),
        ("--motion angle=1", "L3-auto T33.33-motion"),
        ("--auto shutter=1,gain=4", "L3-auto"),
        ("--auto base-gain=0.3", "L3-auto"),
        ("--auto base-time=1/100", "L3-auto"),
        // The gain and the ratio of the noise variant are not those of automatic exposure.
        ("--gain 2 --ratio 150", "L3-noise"),
        ("--fixed", "L3-auto L3-noise"),
        ("--seed 7", "L3-auto L3-noise"),
    ] {
        assert_eq!(differ("", otherwise), set(expected), "{otherwise}");
    }
    let random = "--motion angle=random";
    let moved = set("L3-auto L3-noise T33.33-motion");
    assert_eq!(differ(random, &format!("{random} --seed 7")), moved);
    // A run of the paper's variants holds nothing of the camera, and goes on whatever is said of it.
    scene.complete(&EVALUATION, "", "run");
    let manifest = |out: &str| -> Value {
        let path = scene.house.0.path(&format!("{out}/manifest.json"));
        serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
    };
    let before = manifest("run");
    assert_eq!(before["identity"]["synthesis"], json!([1, 2]));
    assert!(before["columns"].get("variant").is_none());
    scene.adds(&EVALUATION, "--motion speed=31", "run", 0);
    scene.adds(&EVALUATION, &format!("{ALL} --motion speed=31"), "run", 6);
    let after = manifest("run");
    assert_eq!(after["identity"], before["identity"]);
    let variants = &after["columns"]["variant"];
    assert_eq!(variants["motion"]["--motion"], "speed=31,hfov=79,angle=0");
    assert!(variants["auto"]["--auto"].is_string() && variants["ev"].is_null());
    for (otherwise, field) in [
        ("", "the variant auto has another --motion in this run"),
        ("--motion speed=31 --auto gain=3", "the variant auto has another --auto"),
        ("--motion speed=31 --fixed", "or fixed in this run"),
    ] {
        let otherwise = format!("{ALL} {otherwise}");
        scene.refuses(&EVALUATION, &otherwise, "run", field);
    }
}

#[test]
fn answer_key_covers_its_images() {
    let scene = Scene::new();
    let keys = |otherwise: &str| scene.keys(&OPEN, otherwise);
    let enhanced = |otherwise: &str| keys(&format!("--llie one.onnx --llie-anyway {otherwise}"));
    let (raw, first) = (keys(""), enhanced(""));
    assert_eq!((raw.len(), first.len()), (6, 9));
    assert_eq!(first, enhanced(""), "the same command again");
    let of_raw = set("L0 L3-noise");
    assert_eq!(compared(&raw, &first), (set(""), of_raw.clone()));
    let dark = set("L3-noise L3-noise+one");
    let differ = |otherwise: &str| compared(&first, &enhanced(otherwise)).0;
    for sent in ["--image-size 32", "--image-size native", "--num-frames 2", "--image jpeg:90"] {
        let all = set("L0 L3-noise L3-noise+one");
        assert_eq!(differ(sent), all, "{sent}");
    }
    for light in ["--degrade resized", "--sensor frame", "--camera nikon-d850"] {
        assert!(differ(light).is_superset(&dark), "{light}");
    }
    assert_eq!(differ("--seed 7"), dark);
    onnx::gain(0.75).write(&scene.house.0.path(""), "one.onnx");
    let other = enhanced("");
    assert_eq!(compared(&first, &other), (set("L3-noise+one"), of_raw));
}

/// Models with what stands in their sidecars, and what else may stand there for other pixels.
#[rustfmt::skip]
const SIDECARS: [(&str, &str, &[&str]); 4] = [
    ("one.onnx", "", &[
        "color = \"bgr\"",
        "range_in = \"-1..1\"",
        "range_out = \"-1..1\"",
        "mean = [-0.1, 0, 0]",
        "std = [2, 1, 1]",
        "multiple = 16",
        "multiple = 16\npad = \"zero\"",
        "multiple = 16\npad = \"replicate\"",
        "rounding = \"truncate\"",
        "color_out = \"bgr\"",
        "input = \"image ^ 0.8\"",
        "image = \"output ^ 0.8\"",
    ]),
    ("outputs.onnx", "output = 0", &["output = 1"]),
    ("inputs.onnx", "[extra]\nexposure = 0.5", &["[extra]\nexposure = 0.75"]),
    ("noise.onnx", "[extra]\nz = { noise = \"normal\", std = 0.01 }", &[
        "[extra]\nz = { noise = \"normal\", std = 0.02 }",
        "[extra]\nz = { noise = \"normal\", std = 0.01, seed = 1 }",
        "[extra]\nz = { map = 0.1 }",
        "[extra]\nz = { from = \"0.1 * image\" }",
    ]),
];

#[test]
fn sidecar_decoding_makes_another_enhancer() {
    let scene = Scene::new();
    let bench = &scene.house.0;
    onnx::two_outputs().write(&bench.path(""), "outputs.onnx");
    onnx::two_inputs().write(&bench.path(""), "inputs.onnx");
    onnx::plus_noise().write(&bench.path(""), "noise.onnx");
    let mut seen = BTreeSet::new();
    for (model, before, others) in SIDECARS {
        let sidecar = format!("{model}.toml");
        let said = format!("--levels L3 --variant noise --limit 1 --llie-anyway --llie {model}");
        bench.file(&sidecar, before);
        let first = scene.fresh();
        scene.complete(&EVALUATION, &said, &first);
        let first_keys = scene.keys_in(&first);
        seen.extend(first_keys.values().cloned());
        for other in others {
            bench.file(&sidecar, other);
            scene.refuses(&EVALUATION, &said, &first, "--llie");
            let keys = scene.keys(&EVALUATION, &said);
            let (differ, same) = compared(&first_keys, &keys);
            assert_eq!((differ.len(), same), (1, set("L3-noise")), "{other}");
            for key in keys.into_iter().filter(|(at, _)| at.0 != "L3-noise") {
                assert!(seen.insert(key.1), "{other}");
            }
        }
    }
}

#[test]
fn preset_decoding_makes_another_enhancer() {
    let scene = Scene::new();
    let said = |model: &str| format!("--levels L3 --variant noise --limit 1 --llie-anyway --llie {model}");
    scene.complete(&EVALUATION, &said("one.onnx"), "run");
    let plain = scene.keys_in("run");
    let preset = said("ruas-upe:one.onnx");
    scene.refuses(&EVALUATION, &preset, "run", "--llie");
    let (differ, same) = compared(&plain, &scene.keys(&EVALUATION, &preset));
    assert_eq!((differ, same), (set("L3-noise+one"), set("L3-noise")));
}

/// What a model is taken to be where nothing is said, and what is no statement at all.
const DEFAULTS: [&str; 11] = [
    "color = \"rgb\"",
    "color_out = \"rgb\"",
    "channels = \"rgb\"",
    "input = \"image\"",
    "pad = \"reflect\"",
    "rounding = \"round\"",
    "multiple = 1",
    "mean = [0, 0, 0]",
    "std = [1, 1, 1]",
    "[extra]",
    "# By its authors.\n\n",
];

#[test]
fn explicit_default_changes_nothing() {
    let scene = Scene::new();
    let said = "--levels L3 --limit 1 --llie-anyway --llie one.onnx";
    scene.complete(&EVALUATION, said, "run");
    for default in DEFAULTS {
        scene.house.0.file("one.onnx.toml", default);
        scene.adds(&EVALUATION, said, "run", 0);
    }
    // What a preset says may stand beside the model, too.
    let preset = "--levels L3 --limit 1 --llie-anyway --llie darkir:two.onnx";
    scene.complete(&EVALUATION, preset, "preset");
    let states = "multiple = 8\npad = \"zero\"\nrounding = \"truncate\"\n";
    scene.house.0.file("two.onnx.toml", states);
    scene.adds(&EVALUATION, preset, "preset", 0);
    let alone = "--levels L3 --limit 1 --llie-anyway --llie two.onnx";
    let states = format!("{states}tile = \"none\"\n");
    scene.house.0.file("two.onnx.toml", states);
    scene.adds(&EVALUATION, alone, "preset", 0);
}
