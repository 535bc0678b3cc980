//! Tables that are not true, or cannot be read.

use super::LIB;
use crate::architecture::assert_none;
use crate::architecture::map::Map;

#[test]
fn the_map_must_be_true() {
    let no_row = "the map has no row for `new`, which is in src/";
    let no_room = "the map has a row for `run`, which is not in src/";
    let none_used = "the map lets `run` use `cli`, which is not in src/";
    let below = "the map lets `run` use `cli`, whose row is not above: a room may use only rooms above it, so that no rooms use each other";
    let itself = below.replace("cli", "run");
    let twice = "the map has two rows for `ask`";
    let circle = "| `run` | `cli` |\n//! | `cli` | `run` |";
    let rows: [(&str, &str, &[&str]); 7] = [
        ("| `run` | `ask` |", "run", &[]),
        ("| `run` | `ask` |", "run new", &[no_row]),
        ("| `run` | `ask` |", "", &[no_room]),
        ("| `run` | `cli` |", "run", &[none_used]),
        ("| `run` | `run` |", "run", &[&itself]),
        (circle, "run cli", &[below]),
        ("| `run`, `ask` | nothing |", "run", &[twice]),
    ];
    let wrong = rows.iter().filter_map(|(row, rooms, expected)| {
        let map = Map::read(&LIB.replace("| `run` | `ask`, `types` |", row)).unwrap();
        let rooms = rooms.split_whitespace().chain(["error", "types", "ask", "score"]);
        let found = map.untrue(&rooms.collect());
        (found != *expected).then(|| format!("in {row}\n  found {found:?}"))
    });
    assert_none(&wrong.collect::<Vec<_>>());
}

#[test]
fn unreadable_map_is_an_error() {
    let rows = ["| run | nothing |", "| `run` | everything |", "| `run` | `ask` (only here) |", "| `run` |"];
    let wrong = rows.iter().filter_map(|row| {
        let found = Map::read(&LIB.replace("| `run` | `ask`, `types` |", row)).err();
        let expected = format!("src/lib.rs: this row cannot be read: {row}");
        (found != Some(expected)).then(|| format!("in {row}\n  found {found:?}"))
    });
    assert_none(&wrong.collect::<Vec<_>>());
    assert!(Map::read("//! # Other\n//! | `run` | nothing |").is_err());
}
