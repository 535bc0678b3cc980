//! Damaged files of a run beside its intact records: the command that made the run makes them again, and asks nothing
//! again.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, assert_same_products, model_args, records};
use crate::support::table::check_rows;

const RUN: &str = "--data set.jsonl --levels L0,L3 --variant ev --no-parquet --out run";

/// Replies of the run: 6 questions at 2 levels.
const TRIALS: usize = 12;

/// The ways in which a file is damaged.
const DAMAGES: [Damage; 6] =
    [Damage::FirstLine, Damage::Truncated, Damage::Binary, Damage::Empty, Damage::Missing, Damage::Folder];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Damage {
    /// Other bytes in its first line.
    FirstLine,
    /// The second half is missing.
    Truncated,
    /// Bytes that are no text.
    Binary,
    Empty,
    Missing,
    /// A folder in its place.
    Folder,
}

impl Damage {
    fn apply(self, path: &Path) {
        let mut bytes = fs::read(path).unwrap();
        match self {
            Self::FirstLine => bytes[1..6].fill(b'#'),
            Self::Truncated => bytes.truncate(bytes.len() / 2),
            Self::Binary => bytes = vec![0xFF; bytes.len()],
            Self::Empty => bytes.clear(),
            Self::Missing | Self::Folder => {
                fs::remove_file(path).unwrap();
                if self == Self::Folder {
                    fs::create_dir(path).unwrap();
                }
                return;
            }
        }
        fs::write(path, bytes).unwrap();
    }
}

/// A complete run.
struct Scene {
    bench: Bench,
    endpoint: MockEndpoint,
}

impl Scene {
    fn new() -> Self {
        let scene = Self { bench: Bench::with_questions(6), endpoint: MockEndpoint::start([Answer::text("C")]) };
        let first = scene.call(RUN);
        assert_eq!(first.code, Some(0), "{first:?}");
        assert_eq!(scene.endpoint.requests().len(), TRIALS);
        scene
    }

    fn call(&self, line: &str) -> Called {
        self.bench.call(&model_args(&self.endpoint.base_url(), line))
    }

    fn lines(&self, name: &str) -> BTreeSet<String> {
        let text = fs::read_to_string(self.bench.path("run").join(name)).unwrap();
        text.lines().map(str::to_owned).collect()
    }

    /// Damages a file, and calls the command of the run again.
    fn call_after(&self, damage: Damage, name: &str) -> Called {
        damage.apply(&self.bench.path("run").join(name));
        self.call(RUN)
    }

    /// Asserts that nothing was asked again, and that the records are intact.
    fn assert_nothing_asked(&self) {
        assert_eq!(self.endpoint.requests().len(), TRIALS);
        assert_eq!(records(&self.bench.path("run")).len(), TRIALS);
    }
}

#[test]
fn damaged_lists_are_made_again() {
    let files = ["thumbnails.jsonl", "fidelity.jsonl", "questions.jsonl"];
    let rows = files.iter().flat_map(|name| DAMAGES.map(|damage| (name, damage)));
    check_rows(rows, |(name, damage)| {
        let scene = Scene::new();
        let before = scene.lines(name);
        let again = scene.call_after(damage, name);
        assert_eq!(again.code, Some(0), "{damage:?} {again:?}");
        assert_eq!(scene.lines(name), before, "{name} {damage:?}: {again:?}");
        scene.assert_nothing_asked();
        // Lists without a broken line are no visible damage.
        let notices = again.stderr.matches(name).count();
        let is_visible = !matches!(damage, Damage::Empty | Damage::Missing | Damage::Truncated);
        assert!(notices > 0 || !is_visible, "{damage:?} {}", again.stderr);
        assert!(again.stderr.lines().count() <= 1, "{}", again.stderr);
        let quiet = scene.call(RUN);
        assert_eq!((quiet.code, &*quiet.stderr), (Some(0), ""));
    });
}

#[test]
fn a_damaged_manifest_is_made_again() {
    check_rows(DAMAGES, |damage| {
        let scene = Scene::new();
        let whole = scene.call("--data set.jsonl --levels L0,L3 --variant ev --no-parquet --out whole");
        assert_eq!(whole.code, Some(0));
        damage.apply(&scene.bench.path("run/manifest.json"));
        for words in [RUN, "--data set.jsonl --levels L0,L3 --variant ev --no-parquet --resume run"] {
            let again = scene.call(words);
            assert_eq!(again.code, Some(0), "{damage:?} {again:?}");
        }
        assert_eq!(scene.endpoint.requests().len(), 2 * TRIALS);
        assert!(assert_same_products(&scene.bench.path("whole"), &scene.bench.path("run")) > 5);
    });
}

#[test]
fn manifest_needs_the_same_command() {
    let scene = Scene::new();
    Damage::Binary.apply(&scene.bench.path("run/manifest.json"));
    for other in
        [RUN.replace("L0,L3", "L0"), RUN.replace("--data", "--image-first --data"), format!("{RUN} --temperature 0.5")]
    {
        let refused = scene.call(&other);
        assert_eq!(refused.code, Some(2), "{other}: {refused:?}");
        assert!(refused.stderr.contains("are not of this command"), "{refused:?}");
        assert!(!refused.stderr.contains("another --out"), "{refused:?}");
    }
    scene.assert_nothing_asked();
    assert_eq!(scene.call(RUN).code, Some(0));
}

#[test]
fn lost_questions_need_same_data() {
    for damage in [Damage::Binary, Damage::Empty] {
        let scene = Scene::new();
        let set = scene.bench.path("set.jsonl");
        let text = fs::read_to_string(&set).unwrap();
        fs::write(&set, text.replace("What color is it, 3?", "Which color is it, 3?")).unwrap();
        let refused = scene.call_after(damage, "questions.jsonl");
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains("1 of 6 lost questions"), "{refused:?}");
        assert!(!refused.stderr.contains("another --out"), "{refused:?}");
        scene.assert_nothing_asked();
    }
}

#[test]
fn reports_need_no_damaged_images() {
    check_rows(["thumbnails.jsonl", "fidelity.jsonl"], |name| {
        let scene = Scene::new();
        Damage::FirstLine.apply(&scene.bench.path("run").join(name));
        let report = scene.bench.call(&["report", "run"]);
        assert_eq!(report.code, Some(0), "{report:?}");
        assert!(report.stderr.contains(name), "{report:?}");
    });
    for name in ["questions.jsonl", "manifest.json"] {
        let scene = Scene::new();
        Damage::FirstLine.apply(&scene.bench.path("run").join(name));
        let report = scene.bench.call(&["report", "run"]);
        assert_eq!(report.code, Some(2), "{report:?}");
        let remedy = "the command that made the run, called again, makes";
        assert!(report.stderr.contains(remedy), "{report:?}");
    }
}
