//! A run folder of a stranger: links in it lead nothing that is written out of it, and no file is cut before it is
//! known.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;

use crate::support::run::{Bench, called, words};
use crate::support::table::check_rows;

const COMMAND: &str = "--model random --data set.jsonl --levels L0,L3 --out run";
/// A file of the user whose last line has no end.
const PRIVATE: &str = "first line\nlast line of the user";

/// A finished run with a file `private` and an empty folder `elsewhere` beside it.
fn bench() -> Bench {
    let bench = Bench::with_questions(6);
    bench.complete(&words(COMMAND));
    bench.file("private", PRIVATE);
    fs::create_dir(bench.path("elsewhere")).unwrap();
    bench
}

#[test]
fn nothing_is_written_through_a_link() {
    let rows = [
        ("records.jsonl", "../private"),
        ("thumbnails.jsonl", "../private"),
        ("figures", "../elsewhere"),
        ("batch", "../elsewhere"),
        ("batch/state.jsonl", "../../private"),
    ];
    check_rows(rows, |(name, target)| {
        let bench = bench();
        let place = bench.path("run").join(name);
        let _ = fs::remove_file(&place);
        let _ = fs::remove_dir_all(&place);
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        symlink(target, &place).unwrap();
        for line in [COMMAND, "report run", "report run --rescore"] {
            let called = bench.call(&words(line));
            let is_named = called.stderr.contains(&format!("run/{name}"));
            assert!(is_named, "{line}: {called:?}");
            assert!(called.code == Some(2) || line == "report run", "{line}: {called:?}");
        }
        assert_eq!(fs::read_to_string(bench.path("private")).unwrap(), PRIVATE);
        let inside = fs::read_dir(bench.path("elsewhere")).unwrap().count();
        assert_eq!(inside, 0);
    });
}

#[test]
fn hard_linked_records_are_not_written() {
    let bench = bench();
    fs::hard_link(bench.path("run/records.jsonl"), bench.path("second")).unwrap();
    let before = fs::read(bench.path("second")).unwrap();
    let called = bench.call(&words(COMMAND));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: run/records.jsonl: this is a file with a second name (a hard link), and what is written into the run
        would go there; put a file or folder of its own in its place, or use a copy of the run
    ");
    assert_eq!(fs::read(bench.path("second")).unwrap(), before);
}

#[test]
fn linked_products_are_replaced() {
    let bench = bench();
    let page = fs::read(bench.path("run/report.html")).unwrap();
    for name in ["report.html", ".report.html.part", ".summary.csv.part"] {
        let place = bench.path("run").join(name);
        let _ = fs::remove_file(&place);
        symlink("../private", &place).unwrap();
    }
    fs::remove_file(bench.path("run/summary.csv")).unwrap();
    bench.complete(&words("report run"));
    assert_eq!(fs::read_to_string(bench.path("private")).unwrap(), PRIVATE);
    assert_eq!(fs::read(bench.path("run/report.html")).unwrap(), page);
    assert!(bench.path("run/summary.csv").is_file());
}

#[test]
fn unfinished_files_avoid_links() {
    let bench = bench();
    for name in ["records.parquet", "report.html", "summary.csv"] {
        fs::remove_file(bench.path("run").join(name)).unwrap();
        let unfinished = bench.path("run").join(format!(".{name}.part"));
        symlink("../private", unfinished).unwrap();
    }
    bench.complete(&words(COMMAND));
    assert_eq!(fs::read_to_string(bench.path("private")).unwrap(), PRIVATE);
    assert!(bench.path("run/records.parquet").is_file());
}

#[test]
fn images_are_not_shown_through_link() {
    let bench = bench();
    symlink("../elsewhere", bench.path("run/shown")).unwrap();
    let called = bench.call(&words("show run q0"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: run/shown: a link; the images would be written to where it leads. Delete the link, or name another
        --out
    ");
    assert_eq!(fs::read_dir(bench.path("elsewhere")).unwrap().count(), 0);
    bench.complete(&words("show run q0 --out images"));
    fs::remove_file(bench.path("run/shown")).unwrap();
    bench.complete(&words("show run q0"));
    assert!(fs::read_dir(bench.path("run/shown")).unwrap().count() > 0);
    // A folder inside, which the name of a frame leads to.
    let picture = fs::read(bench.path("a.png")).unwrap();
    bench.file("inner/a.png", picture);
    let set = fs::read_to_string(bench.path("set.jsonl")).unwrap();
    bench.file("nested.jsonl", set.replace("a.png", "inner/a.png"));
    bench.complete(&words(&COMMAND.replace("set.jsonl", "nested.jsonl").replace("run", "nested")));
    fs::create_dir(bench.path("nested/shown")).unwrap();
    symlink("../../elsewhere", bench.path("nested/shown/inner")).unwrap();
    let called = bench.call(&words("show nested q0"));
    assert_eq!(called.code, Some(2), "{called:?}");
    assert_eq!(fs::read_dir(bench.path("elsewhere")).unwrap().count(), 0);
}

#[test]
fn store_is_not_written_through_links() {
    let bench = bench();
    let line = |run: &str| format!("{COMMAND}{run} --images-cache store");
    bench.complete(&words(&line("1")));
    let before = fs::read_dir(bench.path("store/v1")).unwrap();
    let folders: Vec<_> = before.map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()).collect();
    assert!(!folders.is_empty());
    for folder in folders {
        fs::remove_dir_all(&folder).unwrap();
        symlink("../../elsewhere", &folder).unwrap();
    }
    let called = bench.call(&words(&line("2")));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN --images-cache: cannot write to store: store/v1/62 is a link; delete it; no more images are stored there
    ");
    assert_eq!(fs::read_dir(bench.path("elsewhere")).unwrap().count(), 0);
}

#[test]
fn only_record_files_are_truncated() {
    let bench = bench();
    let path = bench.path("run/records.jsonl");
    let records = fs::read_to_string(&path).unwrap();
    let rows = [
        (PRIVATE.to_owned(), false),
        ("no line at all".to_owned(), false),
        ("{\"key\":\"0123".to_owned(), true),
        (format!("{records}{{\"key\":\"0123"), true),
    ];
    check_rows(rows, |(text, is_cut)| {
        fs::write(&path, &text).unwrap();
        let called = bench.call(&words(COMMAND));
        let now = fs::read_to_string(&path).unwrap();
        if is_cut {
            assert_eq!(called.code, Some(0), "{text}: {called:?}");
            assert_eq!(now.lines().count(), records.lines().count(), "{text}");
        } else {
            assert_eq!((called.code, &now), (Some(2), &text), "{called:?}");
        }
    });
}

#[test]
fn run_can_be_reached_by_link() {
    let bench = bench();
    symlink("run", bench.path("alias")).unwrap();
    bench.complete(&words("report alias"));
}

#[test]
fn images_are_found_from_any_folder() {
    let bench = Bench::with_questions(2);
    fs::create_dir_all(bench.path("far/away")).unwrap();
    bench.complete(&words("--model random --data set.jsonl --levels L0,L3 --out runs/one"));
    let show = |folder: &str, run: &str| {
        let mut command = bench.command(&words(&format!("show {run} q0 --out {}", bench.path("images").display())));
        called(command.current_dir(bench.path(folder)))
    };
    let there = show("far/away", "../../runs/one");
    assert_eq!(there.code, Some(0), "{there:?}");
    assert!(there.stdout.contains("the same bytes as were sent"), "{there:?}");
    assert!(there.stderr.contains("set.jsonl: read from ") && there.stderr.contains("above the folder of the run"));
    // From the folder of the run itself nothing is sought.
    let here = show("", "runs/one");
    assert!(here.code == Some(0) && !here.stderr.contains("read from"), "{here:?}");
    fs::rename(bench.path("runs/one"), bench.path("far/one")).unwrap();
    fs::rename(bench.path("set.jsonl"), bench.path("moved.jsonl")).unwrap();
    let lost = show("far", "one");
    assert!(lost.code == Some(2) && lost.stderr.contains("set.jsonl"), "{lost:?}");
}
