//! Awaits, libraries, macros and debug output where they may not be, and files that are too long.

use super::check;
use crate::architecture::files::Files;
use crate::architecture::{digests, rules};

#[test]
fn missing_code_and_long_files_reported() {
    check(
        rules::unfinished,
        &["src/error.rs:1: `todo!` stands for code that is missing"],
        &["error.rs: fn f() { todo!() }", "error.rs: fn f() { vec![std::todo!(\"x\")] }"],
    );
    check(
        rules::unfinished,
        &["src/error.rs:1: `unimplemented!` stands for code that is missing"],
        &["error.rs: #[cfg(test)] mod tests { fn f() { unimplemented!() } }"],
    );
    check(rules::unfinished, &[], &["error.rs: fn f(todo: bool) { made!(todo != true, \"todo!()\"); } // todo!()"]);
    let most = |files: &Files| rules::long_files(files, 2);
    check(
        most,
        &["src/error.rs:1: 3 lines of code, and a file may have 2"],
        &[
            "error.rs: struct A;\nstruct B;\nstruct C;",
            "error.rs: #![allow(dead_code)]\nconst A: &str = \"\n\";",
            "error.rs: #[cfg(test)] mod tests {\n}\n/// Two\nfn f() {\n\n}\nconst _: () = ();",
        ],
    );
    check(
        most,
        &[],
        &[
            "error.rs: \n\n\n",
            "error.rs: //! Head\n// one\n\nstruct A; /* a\nb */\n/// Doc\nstruct B;",
            "error.rs: struct A;\n#[cfg(all(test, unix))]\nmod tests {\n    struct B;\n}\nstruct C;",
        ],
    );
}

#[test]
fn listings_in_other_places_are_reported() {
    let rule = |files: &Files| rules::listings([files], &["dataset"], &["dataset/root.rs"]);
    let unused = "a list of a folder or an open file may stand in dataset/root.rs, but does not: delete this place";
    check(
        rule,
        &["src/dataset/a.rs:1: a list of a folder or an open file may stand only in dataset/root.rs", unused],
        &[
            "dataset/a.rs: use crate::files::entries;",
            "dataset/a.rs: fn f() { std::fs::read(p) }",
            "dataset/a.rs: fn f() { File::open(p) }",
        ],
    );
    check(rule, &[], &["dataset/root.rs: fn f() { files::entries(p) } ++ engine/a.rs: fn f() { std::fs::read(p) }"]);
    check(rule, &[unused], &["dataset/a.rs: #[cfg(test)] mod tests { fn f() { std::fs::read(p) } }"]);
    check(
        |files: &Files| rules::listings([files], &["dataset"], &["dataset"]),
        &["dataset is a folder: name its files"],
        &["dataset/a.rs: use crate::files::entries;"],
    );
}

#[test]
fn misplaced_awaits_are_reported() {
    let rule = |files: &Files| rules::awaits([files], &["ask"]);
    let unused = "`.await` may stand in ask, but does not: delete this place";
    check(
        rule,
        &["src/error.rs:1: `.await` may stand only in ask", unused],
        &[
            "error.rs: async fn f() { g().await }",
            "error.rs: async fn f() { tokio::select! { x = g().await => x } }",
            "error.rs: async fn f() { made!(g()?.await?.b) }",
            "error.rs: #[cfg(not(test))] mod a { async fn f() { g().await } }",
            "error.rs: fn tests() {} mod tests { async fn f() { g().await } }",
        ],
    );
    check(rule, &[], &["ask/a.rs: async fn f() { g().await }"]);
    check(
        rule,
        &[unused],
        &[
            "error.rs: fn f() { made!(a.await_it, a..await_it) }",
            "error.rs: #[cfg(test)] mod tests { async fn f() { g().await } }",
            "error.rs: #[cfg(all(unix, test))] mod tests { async fn f() { g().await } }",
            "error.rs: #[cfg(test)] mod a; ++ error/a.rs: async fn f() { g().await }",
            "error.rs: #[cfg(test)] mod a; ++ error/a/b.rs: async fn f() { g().await }",
        ],
    );
}

#[test]
fn misplaced_libraries_are_reported() {
    let rule = |files: &Files| rules::library([files], "image", &["enhance"]);
    let outside = "src/types/a.rs:1: `image` may stand only in enhance";
    let unused = "`image` may stand in enhance, but does not: delete this place";
    check(
        rule,
        &[outside, unused],
        &[
            "types/a.rs: use image::Rgb;",
            "types/a.rs: use {std::fs, image::{Rgb}};",
            "types/a.rs: use image as pictures;",
            "types/a.rs: fn f() -> ::image::Rgb {}",
            "types/a.rs: fn f() { assert!(image::open(x)) }",
            "types/a.rs: image::made!();",
        ],
    );
    check(
        rule,
        &[unused],
        &[
            "types/a.rs: use self::image::Rgb; use crate::{image, a::image};",
            "types/a.rs: fn f(image: u8) { image; x.image(); made!(image) }",
            "types/a.rs: #[cfg(test)] mod tests { use image::Rgb; }",
        ],
    );
    check(rule, &[], &["enhance/planes.rs: use image::Rgb;"]);
    check(rule, &[&outside.replace("types/a", "enhances"), unused], &["enhances.rs: use image::Rgb;"]);
}

#[test]
fn digests_of_debug_output_are_found() {
    let rule = |files: &Files| {
        digests::makers(files).into_iter().map(|(file, name, has_debug)| format!("{file} {name} {has_debug}")).collect()
    };
    check(
        rule,
        &["error.rs f true"],
        &[
            "error.rs: fn f() { Digest::from_bytes(format!(\"{:?}\", x).as_bytes()) }",
            "error.rs: impl A { fn f() { types::Digest::canonical(format!(\"{x:#?}\")) } }",
            "error.rs: trait A { fn f() { json!({ \"a\": Digest::from_parts([x]) }); g(\"{x:>5?}\") } }",
            "error.rs: macro_rules! f { () => { blake3::hash(format!(\"{:?}\", 1)) } }",
        ],
    );
    check(
        rule,
        &["error.rs f false"],
        &[
            "error.rs: fn f() { Digest::from_bytes(b\"{:?}\"); g(\"{x} {{?}\") }",
            "error.rs: /// As `{:?}`.\n#[expect(a, reason = \"{:?}\")] fn f() { Digest::from_bytes(x) }",
            "error.rs: fn f() { Digest::from_bytes(x) } fn g() { h(\"{:?}\") }",
        ],
    );
    check(
        rule,
        &[],
        &[
            "error.rs: fn f() { Digest::from_hex(\"{:?}\") }",
            "error.rs: #[cfg(test)] mod tests { fn f() { Digest::from_bytes(\"{:?}\") } }",
        ],
    );
}
