//! Imports between rooms, and between commands.

use super::{check, map};
use crate::architecture::files::Files;
use crate::architecture::rules;

#[test]
fn imports_are_found_in_all_forms() {
    check(
        |files| rules::imports(files, &map(), &[]),
        &["src/ask/mod.rs:2: `ask` may not use `score`"],
        &[
            "ask/mod.rs: use crate::types::Rgb;\nuse crate::score::read;",
            "ask/mod.rs: use crate::{types::{Rgb, Frame}, error::Error,\n score};",
            "ask/mod.rs: use {std::fs, crate::{types,\n score::{self}}};",
            "ask/mod.rs: \nuse crate::score as other;",
            "ask/mod.rs: \nuse crate::score::*;",
            "ask/mod.rs: \nuse crate::r#score;",
            "ask/mod.rs: \npub(crate) use crate::score::read as r;",
            "ask/mod.rs: \nuse ::darkqa_score;",
            "ask/mod.rs: \nuse darkqa_score::read;",
            "ask/mod.rs: \nuse super::score::read;",
            "ask/mod.rs: \nuse self::super::score;",
            "ask/mod.rs: \nfn f() { use crate::score; }",
            "ask/mod.rs: \nmod inner { use super::super::score; }",
            "ask/mod.rs: #[cfg(test)]\nmod tests { use super::super::score; }",
            "ask/mod.rs: \nfn f() { crate::score::go(); }",
            "ask/mod.rs: \nfn f(_: &[Option<crate::score::Mark>]) {}",
            "ask/mod.rs: \nimpl Tool for crate::score::Mark {}",
            "ask/mod.rs: \nfn f<T>() where T: Into<crate::score::Mark> {}",
            "ask/mod.rs: \nfn f() { <u8 as crate::score::Tool>::go() }",
            "ask/mod.rs: \nfn f() { if let crate::score::Mark { .. } = m() {} }",
            "ask/mod.rs: \nfn f() { format!(\"{}\", 1 + crate::score::go()); }",
            "ask/mod.rs: \nfn f() { matches!(m(), Some(crate::score::Mark { .. })); }",
            "ask/mod.rs: \nfn f() { vec![{ use crate::{types, score::{a as b}}; b }] }",
            "ask/mod.rs: \nfn f() { made! { use crate::score::*; } }",
            "ask/mod.rs: \ncrate::score::made!();",
            "ask/mod.rs: \nmacro_rules! made { () => { $crate::score::go() } }",
            "ask/mod.rs: \nmacro_rules! made { ($x:ty) => { use super::score; } }",
            "ask/mod.rs: \n#[serde(with = \"crate::score::text\")] struct A;",
            "ask/mod.rs: \n#[derive(Debug, crate::score::Tool)] struct A;",
            "ask/mod.rs: \nstruct A { #[arg(parser = crate::score::read)] b: u8 }",
        ],
    );
    check(
        |files| rules::imports(files, &map(), &[]),
        &["src/ask/wire/mod.rs:1: `ask` may not use `score`"],
        &[
            "ask/wire/mod.rs: use super::super::score;",
            "ask/mod.rs: #[cfg(test)] mod wire; ++ ask/wire/mod.rs: use crate::score;",
        ],
    );
}

#[test]
fn imports_of_no_room_are_found() {
    let rule = |files: &Files| rules::imports(files, &map(), &[]);
    check(
        rule,
        &["src/ask/mod.rs:1: `ask` uses the whole crate: name the room"],
        &[
            "ask/mod.rs: use crate::*;",
            "ask/mod.rs: use super::*;",
            "ask/mod.rs: use crate as all;",
            "ask/mod.rs: fn f() { made! { use crate::*; } }",
        ],
    );
    check(
        rule,
        &["src/ask/mod.rs:1: `ask` uses `crate::Frame`, which is no room of the map"],
        &["ask/mod.rs: use crate::Frame;"],
    );
    check(rule, &["src/main.rs:1: `main` may not use `ask`"], &["main.rs: use darkqa_eval::{ask};"]);
}

#[test]
fn allowed_imports_are_not_reported() {
    check(
        |files| rules::imports(files, &map(), &[]),
        &[],
        &[
            "ask/mod.rs: use crate::{types::Rgb, error::E, ask::remote}; use super::types;",
            "ask/remote.rs: use super::score; use super::super::types;",
            "ask/remote.rs: pub(in super::super) fn f() {}",
            "ask/remote.rs: mod tests { use super::super::score; use super::*; }",
            "ask/mod.rs: // crate::score\n/* crate::score */\n/// [f](crate::score)\nfn f() {}",
            "ask/mod.rs: const A: &str = \"crate::score\"; const B: &[&str] = &[\"crate\"];",
            "ask/mod.rs: fn f<'a>(score: &'a S) { score.score::<u8>(); made!(score: u8, x); }",
            "lib.rs: pub mod ask; pub mod score;",
        ],
    );
}

#[test]
fn commands_that_use_another_are_found() {
    check(
        rules::commands,
        &["src/commands/show.rs:1: a command uses `commands::export::read`, which is not its own"],
        &[
            "commands/show.rs: use crate::commands::export::read;",
            "commands/show.rs: use super::export::read;",
            "commands/show.rs: #[cfg(test)] mod tests { use crate::commands::export::read; }",
        ],
    );
    check(
        rules::commands,
        &["src/commands/show.rs:1: a command uses `commands`, which is not its own"],
        &["commands/show.rs: use crate::commands;", "commands/show.rs: use super as all;"],
    );
    check(
        rules::commands,
        &["src/commands/show.rs:1: a command uses `commands::*`, which is not its own"],
        &["commands/show.rs: use super::*;"],
    );
    check(
        rules::commands,
        &["src/commands/mod.rs:1: a command uses `commands::show::go`, which is not its own"],
        &["commands/mod.rs: fn f() { show::go() } ++ commands/show.rs"],
    );
    check(
        rules::commands,
        &["src/commands/export/set.rs:1: a command uses `commands::show::go`, which is not its own"],
        &["commands/export/set.rs: fn f() { super::super::show::go() }"],
    );
    check(
        rules::commands,
        &[],
        &[
            "commands/export/set.rs: use super::folder; use crate::commands::export::go; use crate::engine;",
            "commands/cli/mod.rs: use crate::commands::{export, show};",
        ],
    );
}
