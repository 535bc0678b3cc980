//! Circles of files.

use super::{check, files};
use crate::architecture::files::Files;
use crate::architecture::{assert_none, circles};

/// The files of the circles, without the paths that they use.
fn circles_of(files: &Files) -> Vec<String> {
    let found = circles::wrong(std::iter::once(files), &[]);
    let first_line = |text: &String| text.lines().next().map(str::to_owned);
    found.iter().filter_map(first_line).collect()
}

#[test]
fn circles_are_found() {
    check(
        circles_of,
        &["a circle of files: ask/a.rs, ask/b.rs"],
        &[
            // By `super`, by `crate`, in the code, in macros.
            "ask/mod.rs ++ ask/a.rs: use super::b::B; ++ ask/b.rs: use crate::ask::a::A;",
            "ask/mod.rs ++ ask/a.rs: fn f() { super::b::f() } ++ ask/b.rs: use super::a::{self as x};",
            "ask/mod.rs ++ ask/a.rs: fn f() { vec![super::b::f()] } ++ ask/b.rs: use super::{a, c};",
            "ask/mod.rs ++ ask/a.rs: macro_rules! m { () => { $crate::ask::b::f() } } ++ ask/b.rs: use super::a::*;",
            // Through a re-export, under another name, in two steps.
            "ask/mod.rs: pub use b::B; ++ ask/a.rs: use super::B; ++ ask/b.rs: use super::a;",
            "ask/mod.rs: pub use b::B as C; ++ ask/a.rs: use super::C; ++ ask/b.rs: use super::a;",
            "ask/mod.rs: pub use b::B; ++ ask/a.rs: use super as up; fn f(_: up::B) {} ++ ask/b.rs: use super::a;",
            "ask/mod.rs ++ ask/a.rs: pub use super::b::B; ++ ask/b.rs: pub use super::a::A;",
        ],
    );
    check(
        circles_of,
        &["a circle of files: ask/a.rs, ask/mod.rs"],
        &[
            "ask/mod.rs: pub use a::A; struct M; fn f() { a::f() } ++ ask/a.rs: use super::M;",
            "ask/mod.rs: pub use a::A; struct M; fn f(_: A) {} ++ ask/a.rs: use super::M;",
            "ask/mod.rs: pub use a::A; struct M; fn f() { made!(A) } ++ ask/a.rs: use super::M;",
            "ask/mod.rs: pub use a::go; struct M; fn f() { go() } ++ ask/a.rs: use super::M;",
            "ask/mod.rs: pub use a::*; struct M; ++ ask/a.rs: use super::*;",
        ],
    );
    check(
        circles_of,
        &["a circle of files: ask/a.rs, ask/b.rs, ask/c.rs"],
        &["ask/a.rs: use super::b; ++ ask/b.rs: use super::c; ++ ask/c.rs: use super::a::A; ++ ask/mod.rs"],
    );
    check(
        circles_of,
        &["a circle of files: error.rs, types/frame.rs"],
        &["error.rs: use crate::types::F; ++ types/frame.rs: use crate::error::E; ++ types/mod.rs: pub use frame::F;"],
    );
}

#[test]
fn files_without_circles_are_not_found() {
    check(
        circles_of,
        &[],
        &[
            "ask/mod.rs: pub use a::A; pub use b::B; ++ ask/a.rs: use super::B; ++ ask/b.rs: use crate::types::A;",
            "ask/mod.rs: pub use a::go; struct M; fn f(go: u8) { g(go) } ++ ask/a.rs: use super::M;",
            "ask/mod.rs ++ ask/a.rs: use super::b::B; ++ ask/b.rs: #[cfg(test)] mod tests { use super::super::a::A; }",
            "ask/mod.rs: #[cfg(test)] mod tests; pub fn f() { tests::g() } ++ ask/tests.rs: use super::f;",
            "ask/mod.rs: struct M; ++ ask/a.rs: use super::{M, b::B}; ++ ask/b.rs: use super::M; pub(in super::super) fn f() {}",
        ],
    );
}

#[test]
fn listed_circles_must_be_there() {
    let small = files("ask/a.rs: use super::b; ++ ask/b.rs: use super::a; ++ ask/mod.rs");
    let found = [
        "a circle of files: ask/a.rs, ask/b.rs",
        "  ask/a.rs uses ask/b.rs: super::b",
        "  ask/b.rs uses ask/a.rs: super::a",
    ];
    let gone = "a listed circle is none: ask/a.rs, ask/c.rs: delete it, or list what is left of it";
    let wrong = |listed: &[&str]| circles::wrong(std::iter::once(&small), &[(listed, "a reason")]);
    assert_none(&wrong(&["ask/a.rs", "ask/b.rs"]));
    assert_eq!(wrong(&["ask/a.rs", "ask/c.rs"]), [&found.join("\n"), gone]);
}
