//! The table "Who may import whom" in the documentation of `src/lib.rs`.

use std::collections::BTreeSet;

/// The line above the table.
const HEADING: &str = "# Who may import whom";

/// The rows of the table, in its order.
pub(crate) struct Map(Vec<Row>);

/// One room, and the rooms that it may use.
struct Row {
    room: String,
    uses: Vec<String>,
}

impl Map {
    /// The table of a `lib.rs`, or what cannot be read.
    pub(crate) fn read(lib: &str) -> Result<Self, String> {
        let table = lib
            .lines()
            .filter_map(|line| line.strip_prefix("//!"))
            .map(str::trim)
            .skip_while(|line| *line != HEADING)
            .skip(1)
            .take_while(|line| !line.starts_with('#'))
            .filter(|line| line.starts_with('|'));
        let mut rows = Vec::new();
        for line in table.skip(2) {
            let unreadable = || format!("src/lib.rs: this row cannot be read: {line}");
            let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
            let [rooms, uses] = cells[..] else {
                return Err(unreadable());
            };
            let uses = if uses == "nothing" { Vec::new() } else { names(uses).ok_or_else(unreadable)? };
            for room in names(rooms).ok_or_else(unreadable)? {
                let uses = uses.clone();
                rows.push(Row { room, uses });
            }
        }
        if rows.is_empty() {
            return Err(format!("src/lib.rs: there is no table below {HEADING:?}"));
        }
        Ok(Self(rows))
    }

    /// Whether a room has a row.
    pub(crate) fn has(&self, room: &str) -> bool {
        self.0.iter().any(|row| row.room == room)
    }

    /// Whether a room may use another.
    pub(crate) fn allows(&self, room: &str, other: &str) -> bool {
        let mut rows = self.0.iter();
        room == other || rows.any(|row| row.room == room && row.uses.iter().any(|one| one == other))
    }

    /// Where the table and the rooms of `src/` differ, and which rows let rooms use each other in a circle.
    pub(crate) fn untrue(&self, rooms: &BTreeSet<&str>) -> Vec<String> {
        let mut wrong = Vec::new();
        let mut above = BTreeSet::<&str>::new();
        for Row { room, uses } in &self.0 {
            if !rooms.contains(room.as_str()) {
                wrong.push(format!("the map has a row for `{room}`, which is not in src/"));
            }
            for used in uses {
                if !rooms.contains(used.as_str()) {
                    wrong.push(format!("the map lets `{room}` use `{used}`, which is not in src/"));
                } else if !above.contains(used.as_str()) {
                    wrong.push(format!(
                        "the map lets `{room}` use `{used}`, whose row is not above: a room may use only rooms above it, so that no rooms use each other"
                    ));
                }
            }
            if !above.insert(room.as_str()) {
                wrong.push(format!("the map has two rows for `{room}`"));
            }
        }
        let unlisted = rooms.iter().filter(|room| !self.has(room));
        wrong.extend(unlisted.map(|room| format!("the map has no row for `{room}`, which is in src/")));
        wrong
    }
}

/// The names of a cell: each between backticks, with commas between them.
fn names(cell: &str) -> Option<Vec<String>> {
    let name = |piece: &str| {
        let name = piece.trim().strip_prefix('`')?.strip_suffix('`')?;
        Some(name.to_owned())
    };
    cell.split(',').map(name).collect()
}
