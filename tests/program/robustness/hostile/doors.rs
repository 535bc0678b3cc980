//! Damaged data sets and rules, opened within this process: many more than there is time for processes.

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;
use std::time::{Duration, Instant};

use darkqa_eval::internals::dataset::{DataSource, SetArgs};
use darkqa_questions::rules::Rules;

use crate::robustness::hostile::mutators::{Form, step};
use crate::robustness::hostile::random::Random;
use crate::robustness::hostile::seeds::Seeds;

/// A call that opens files, and the files to damage.
const DOORS: [(&str, &[&str]); 9] = [
    ("asked", &["asked"]),
    ("frames", &["frames"]),
    ("labelled", &["labelled"]),
    ("set.jsonl", &["set.jsonl", "a.png", "b.png"]),
    ("set.json", &["set.json", "a.png"]),
    ("set.csv", &["set.csv", "a.png"]),
    ("set.tsv", &["set.tsv"]),
    ("set.parquet", &["set.parquet"]),
    ("rules.toml", &["rules.toml"]),
];

/// The number of openings: about two seconds.
const ROUNDS: usize = 1000;

/// Whether what stands at a path can be opened, and its images and maps be read.
fn open(path: &Path) -> bool {
    if path.ends_with("rules.toml") {
        let text = fs::read(path).unwrap();
        return Rules::parse(&String::from_utf8_lossy(&text)).is_ok();
    }
    let place = DataSource::Path(path.to_owned());
    let set = if path.is_dir() && !path.join("questions.jsonl").exists() {
        place.open_without_questions(&[])
    } else {
        place.open(None, &SetArgs::default())
    };
    let Ok(set) = set else {
        return false;
    };
    let frames: Vec<_> = set.frames().take(4).collect();
    frames.into_iter().all(|frame| set.frame(frame).is_ok())
}

#[test]
fn damaged_data_are_opened_or_refused() {
    let seeds = Seeds::make();
    let folder = tempfile::tempdir().unwrap();
    let (mut opened, mut panics) = (0, Vec::new());
    for number in 0..ROUNDS {
        let (door, reads) = DOORS[number % DOORS.len()];
        let mut random = Random::of_run(21, number);
        let work = folder.path().join("work");
        let files = seeds.files(reads);
        let damaged = random.pick(&files);
        for file in &files {
            let mut bytes = fs::read(seeds.path(file)).unwrap();
            if file == damaged {
                for _ in 0..=random.below(3) {
                    step(Form::of(file), &mut bytes, random.next());
                }
            }
            let path = work.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        let start = Instant::now();
        let path = work.join(door);
        match catch_unwind(|| open(&path)) {
            Ok(is_open) => opened += usize::from(is_open),
            Err(_) => panics.push((number, damaged.clone())),
        }
        assert!(start.elapsed() < Duration::from_secs(20), "{number}: {damaged:?}");
        fs::remove_dir_all(work).unwrap();
    }
    assert!(panics.is_empty(), "{panics:?}");
    assert!(opened > ROUNDS / 20 && opened < ROUNDS * 9 / 10, "{opened}");
}
