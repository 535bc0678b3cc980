//! A machine that several people use: other users cannot read the folder of a run unless its owner wants it.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;

use crate::support::run::{Bench, words};

const COMMAND: &str = "--model random --levels L0,L3 --data frames --images-cache-what all";

fn mode(bench: &Bench, name: &str) -> u32 {
    let data = fs::metadata(bench.path(name)).unwrap();
    data.permissions().mode() & 0o777
}

#[test]
fn new_run_folder_is_private() {
    let bench = Bench::new();
    bench.complete(&words("rooms --out frames --frames 2 --size 96x64"));
    // What the system gives a new folder here.
    let given = mode(&bench, "frames");
    for (flags, expected) in [("", 0o700), ("--shared", given)] {
        let at = |name: &str| format!("{name}{}", flags.len());
        let [runs, parts, images, merged, planned] = ["runs", "parts", "images", "merged", "planned"].map(at);
        bench.complete(&words(&format!("{COMMAND} {flags} --out {runs}/one --images-cache {images}")));
        bench.complete(&words(&format!("plan {COMMAND} {flags} --out {planned}")));
        for part in ["1/2", "2/2"] {
            let line = format!("{COMMAND} {flags} --out {parts} --shard {part}");
            bench.complete(&words(&line));
        }
        bench.complete(&words(&format!("merge {parts} {flags} --out {merged}")));
        for folder in [&format!("{runs}/one"), &parts, &merged, &planned] {
            assert_eq!(mode(&bench, folder), expected, "{folder}");
        }
        assert_eq!(mode(&bench, &format!("{images}/v1")), expected);
        assert_eq!(mode(&bench, &runs), given);
    }
}

#[test]
fn existing_folder_keeps_its_mode() {
    let bench = Bench::with_questions(2);
    let folder = bench.path("run");
    fs::create_dir(&folder).unwrap();
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o750)).unwrap();
    bench.complete(&words("--model random --data set.jsonl --levels L0 --out run"));
    assert_eq!(mode(&bench, "run"), 0o750);
}
