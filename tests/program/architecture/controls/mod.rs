//! Small crates that break the rules, to see that each breach is found, and some that keep them.
//!
//! A small crate is one text: `ask/mod.rs: mod a; ++ ask/a.rs: use super::A;` has two files.

mod circles;
mod imports;
mod map;
mod places;

use std::collections::BTreeSet;
use std::fs;

use crate::architecture::files::Files;
use crate::architecture::map::Map;
use crate::architecture::source::Source;
use crate::architecture::{assert_none, rules};

/// The `lib.rs` of the small crates.
const LIB: &str = "
//! # Who may import whom
//!
//! | module | may use |
//! |---|---|
//! | `error` | nothing |
//! | `types` | `error` |
//! | `ask`, `score` | `types`, `error` |
//! | `run` | `ask`, `types` |
//!
//! # More
//! | `x` | nothing |";

fn map() -> Map {
    Map::read(LIB).unwrap()
}

/// The files of a small crate.
fn files(small: &str) -> Files {
    let texts = small.split(" ++ ").map(|file| {
        let (path, text) = file.split_once(": ").unwrap_or((file, ""));
        (path.to_owned(), text.to_owned())
    });
    Files::of(&texts.collect::<Vec<_>>())
}

/// Fails with all small crates in which a rule does not find exactly what is expected.
#[track_caller]
fn check(rule: impl Fn(&Files) -> Vec<String>, expected: &[&str], small: &[&str]) {
    let wrong = small.iter().filter_map(|small| {
        let found = rule(&files(small));
        let message = || format!("in {small}\n  expected {expected:?}\n  found    {found:?}");
        (found != expected).then(message)
    });
    assert_none(&wrong.collect::<Vec<_>>());
}

#[test]
fn folder_is_read_recursively() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("ask/wire")).unwrap();
    let texts = [
        ("ask/mod.rs", "#[cfg(test)] mod tests;"),
        ("ask/tests.rs", "async fn f() { g().await }"),
        ("ask/wire/mod.rs", "use crate::score;"),
        ("error.rs", ""),
        ("lib.rs", LIB),
    ];
    for (path, text) in texts.into_iter().chain([("ask/prices.toml", "no Rust")]) {
        fs::write(folder.path().join(path), text).unwrap();
    }
    let files = Files::read(folder.path());
    let paths: Vec<&str> = files.iter().map(|source| source.path.as_str()).collect();
    assert_eq!(paths, texts.map(|(path, _)| path));
    assert_eq!(files.rooms(), BTreeSet::from(["ask", "error"]));
    assert_none(&rules::awaits([&files], &[]));
    let found = rules::imports(&files, &map(), &[]);
    assert_eq!(found, ["src/ask/wire/mod.rs:1: `ask` may not use `score`"]);
}

#[test]
fn text_other_than_rust_fails() {
    assert!(Source::read("ask/mod.rs", "fn f( {").is_err());
}
