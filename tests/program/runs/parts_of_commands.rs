//! Commands on files in parts: all parts together write what one call writes, and no two write the same file.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use crate::support::run::{Bench, words};

/// Seven frames with their maps, in the folder `frames`.
fn with_frames() -> Bench {
    let bench = Bench::new();
    bench.complete(&words("rooms --out frames --frames 7 --size 96x64"));
    bench
}

/// The files below a folder, by their paths in it; none if there is no folder.
fn files(folder: &Path) -> Files {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(inner).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap();
                found.insert(name.to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// The content of files by name.
type Files = BTreeMap<String, Vec<u8>>;

/// Calls a command whole into `whole`, and each of three parts into a folder of its own; returns the files of the
/// whole, and those of each part.
fn in_parts(bench: &Bench, command: &str) -> (Files, Vec<Files>) {
    bench.complete(&words(&format!("{command} --out whole")));
    let parts = [1, 2, 3].map(|part| {
        bench.complete(&words(&format!("{command} --out part{part} --shard {part}/3")));
        files(&bench.path(&format!("part{part}")))
    });
    (files(&bench.path("whole")), parts.into())
}

/// Checks that the files of parts are disjoint, about as many in each, and together those of the whole.
#[track_caller]
fn assert_together(whole: &Files, parts: &[Files]) {
    let mut all = BTreeMap::new();
    for part in parts {
        assert!(part.len() * 2 < whole.len(), "{} of {}", part.len(), whole.len());
        for (name, content) in part {
            assert!(all.insert(name.clone(), content.clone()).is_none(), "{name} twice");
        }
    }
    assert!(!whole.is_empty());
    assert!(all == *whole, "{:?} {:?}", all.keys(), whole.keys());
}

#[test]
fn images_are_synthesized_in_parts() {
    let bench = with_frames();
    let (whole, parts) = in_parts(&bench, "synthesize frames --levels L0,L3");
    // An image and its settings for L0, L3 and L3 with noise.
    assert_eq!(whole.len(), 7 * 3 * 2);
    assert_together(&whole, &parts);
    let empty = bench.call(&words("synthesize frames --out x --shard 8/8"));
    insta::assert_snapshot!(empty.messages(), @"
    exit code: 2
    error: --shard: 8/8 is empty: only 7 frames; use at most as many parts
    ");
    let both = bench.call(&words("synthesize --check whole --shard 1/2"));
    assert_eq!(both.code, Some(2), "{both:?}");
}

#[test]
fn images_are_enhanced_in_parts() {
    let bench = with_frames();
    let (whole, parts) = in_parts(&bench, "enhance lift frames");
    assert_eq!(whole.len(), 14); // Each with its JSON file.
    assert_together(&whole, &parts);
}

#[test]
fn sets_are_exported_in_parts() {
    let bench = with_frames();
    for kind in ["imagefolder", "llava", "vlmevalkit"] {
        let (whole, parts) = in_parts(&bench, &format!("export {kind} frames --levels L0,L3"));
        let is_image = |name: &str| Path::new(name).extension() == Some(OsStr::new("png"));
        let images = |files: &Files| {
            files.iter().filter(|(name, _)| is_image(name)).map(|(name, image)| (name.clone(), image.clone())).collect()
        };
        if kind != "vlmevalkit" {
            let parts: Vec<Files> = parts.iter().map(images).collect();
            assert_together(&images(&whole), &parts);
        }
        let mut joined = 0;
        for (name, content) in whole.iter().filter(|(name, _)| !is_image(name)) {
            let (stem, ending) = name.rsplit_once('.').unwrap();
            let mut lines = Vec::new();
            for (index, part) in parts.iter().enumerate() {
                let own = &part[&format!("{stem}-shard-{}-of-3.{ending}", index + 1)];
                let own = std::str::from_utf8(own).unwrap().split_inclusive('\n');
                // Each table has a head.
                let heads = usize::from(index > 0 && ending == "tsv");
                lines.extend(own.skip(heads));
            }
            assert_eq!(lines.concat().as_bytes(), content, "{name}");
            joined += 1;
        }
        assert_eq!(joined, 3, "a set of L0, of L3, and of L3 with noise");
        for folder in ["whole", "part1", "part2", "part3"] {
            fs::remove_dir_all(bench.path(folder)).unwrap();
        }
    }
}

#[test]
fn shard_measurements_make_questions() {
    let bench = with_frames();
    bench.complete(&words("questions frames --out whole/q.jsonl"));
    for part in ["1/3", "2/3", "3/3"] {
        let said = bench.complete(&words(&format!("questions frames --out q/q.jsonl --shard {part}")));
        assert!(said.contains("without --shard"), "{said}");
    }
    let measured = files(&bench.path("q"));
    let names: Vec<&str> = measured.keys().map(String::as_str).collect();
    let part = |part: usize| format!("q.shard-{part}-of-3.statistics.jsonl");
    assert_eq!(names, [part(1), part(2), part(3)]);
    let whole = files(&bench.path("whole"));
    assert_eq!(measured.into_values().collect::<Vec<_>>().concat(), whole["q.statistics.jsonl"]);
    // A line that is changed stays changed: nothing is measured again.
    let path = bench.path(&format!("q/{}", part(2)));
    let text = fs::read_to_string(&path).unwrap();
    bench.complete(&words("questions frames --out q/q.jsonl"));
    let made = files(&bench.path("q"));
    for name in ["q.jsonl", "q.statistics.jsonl"] {
        assert_eq!(made[name], whole[name], "{name}");
    }
    fs::remove_file(bench.path("q/q.statistics.jsonl")).unwrap();
    let changed = text.replacen("[96,64]", "[97,64]", 1);
    assert_ne!(changed, text);
    fs::write(&path, changed).unwrap();
    bench.complete(&words("questions frames --out q/q.jsonl"));
    assert_ne!(files(&bench.path("q"))["q.statistics.jsonl"], whole["q.statistics.jsonl"]);
}
