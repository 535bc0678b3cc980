//! JSON files: one object a line, an array of objects, or objects inside another one (`--read rows`).

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value};

use super::super::cells::{Cell, JsonUnit, RowPlace, Table};
use super::json_scan::{Found, JsonScan, Kind, LONGEST_ROW};
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::shell_word;

type Scan = JsonScan<BufReader<File>>;

fn open(path: &Path) -> Result<BufReader<File>> {
    let file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// The maximum number of values in a row. Each takes tens of bytes, however short it is written.
const MOST_VALUES: usize = 1 << 20;

/// Refuses a row of more values than a question can have.
fn check_values(bytes: &[u8]) -> Result<(), String> {
    let signs = |bytes: &[u8]| {
        bytes
            .iter()
            .filter(|byte| matches!(byte, b',' | b'['))
            .count()
    };
    if signs(bytes) <= MOST_VALUES {
        return Ok(());
    }
    // Commas in texts are no values.
    let (mut count, mut in_text, mut is_escaped) = (0, false, false);
    for byte in bytes {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = true,
            b'"' => in_text = !in_text,
            b',' | b'[' if !in_text => count += 1,
            _ => {}
        }
    }
    if count <= MOST_VALUES {
        return Ok(());
    }
    Err(format!("more than {MOST_VALUES} values in a row"))
}

/// Adds the objects of a file of one object a line. Empty lines and a byte order mark are skipped.
pub(super) fn read_lines(path: &Path, table: &mut Table) -> Result<()> {
    let mut reader = open(path)?;
    let mut offset = 0;
    for number in 1.. {
        let mut line = Vec::new();
        let taken = (&mut reader)
            .take(LONGEST_ROW as u64 + 2)
            .read_until(b'\n', &mut line)
            .map_err(|e| Error::file(path, "read", e))?;
        if taken == 0 {
            break;
        }
        if taken > LONGEST_ROW {
            let problem = format_args!("a line of more than {} MB", LONGEST_ROW >> 20);
            return Err(Error::line(path, number, problem));
        }
        let bytes = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&line);
        if !bytes.trim_ascii().is_empty() {
            check_values(bytes).map_err(|problem| Error::line(path, number, problem))?;
            let value = serde_json::from_slice(bytes);
            let value = value.map_err(|e| Error::json_line(path, number, &e))?;
            let Value::Object(fields) = value else {
                return Err(Error::line(
                    path,
                    number,
                    "not an object; {\"question\": …} expected",
                ));
            };
            let place = RowPlace::Json {
                offset: offset + (taken - bytes.len()) as u64,
                length: bytes.len(),
                number: number as u64,
                unit: JsonUnit::Line,
                inner: None,
            };
            let pushed = push(table, place, fields, None);
            pushed.map_err(|problem| Error::line(path, number, problem))?;
        }
        offset += taken as u64;
    }
    Ok(())
}

/// Adds the rows of a JSON file. `rows` is the way to the list that holds them, as `items` or `images.*.qa`.
pub(super) fn read(path: &Path, rows: Option<&str>, table: &mut Table) -> Result<()> {
    let mut scan = JsonScan::new(open(path)?);
    let steps: Vec<&str> = rows.iter().flat_map(|rows| rows.split('.')).collect();
    let before = table.rows.len();
    let mut walk = || {
        match (scan.kind()?, &*steps) {
            (Kind::Other, _) => Err("neither a list nor an object".to_owned()),
            (Kind::Object, []) => return rows_by_id(path, table),
            _ => walk_to(&mut scan, &steps, table),
        }?;
        scan.end()
    };
    walk().map_err(|problem| Error::data(path.display(), problem))?;
    if table.rows.len() == before && !steps.is_empty() {
        let problem = format_args!("{}: no list of objects there", steps.join("."));
        return Err(Error::usage("--read rows", problem).at("--read rows"));
    }
    Ok(())
}

/// Walks to the list of rows, and adds them.
fn walk_to(scan: &mut Scan, steps: &[&str], table: &mut Table) -> Result<(), String> {
    match (steps, scan.kind()?) {
        ([] | ["*", _], Kind::List) => {
            let inner = steps.get(1).copied();
            let mut number = 0;
            scan.list(|scan| {
                number += 1;
                let found = scan.value(LONGEST_ROW)?;
                add(&found, number, inner, table)
            })
        }
        ([name, rest @ ..], Kind::Object) => scan.object(|scan, field| {
            if field == *name {
                walk_to(scan, rest, table)
            } else {
                scan.skip_value()
            }
        }),
        _ => scan.skip_value(),
    }
}

/// Adds a value as a row, or the list in it as rows that see the fields around it.
fn add(found: &Found, number: u64, inner: Option<&str>, table: &mut Table) -> Result<(), String> {
    let fields = object(found, number)?;
    let place = |inner| RowPlace::Json {
        offset: found.offset,
        length: found.bytes.len(),
        number,
        unit: JsonUnit::Object,
        inner,
    };
    let Some(list) = inner else {
        return push(table, place(None), fields, None);
    };
    let name: Arc<str> = list.into();
    let mut outer = fields;
    let Some(Value::Array(rows)) = outer.remove(list) else {
        return Err(format!("object {number} has no list {list:?}"));
    };
    for (at, row) in rows.into_iter().enumerate() {
        let Value::Object(row) = row else {
            return Err(format!(
                "object {number}: {list:?} is not a list of objects"
            ));
        };
        push(
            table,
            place(Some(Box::new((at, Arc::clone(&name))))),
            row,
            Some(&outer),
        )?;
    }
    Ok(())
}

fn object(found: &Found, number: u64) -> Result<Map<String, Value>, String> {
    check_values(&found.bytes).map_err(|problem| format!("object {number}: {problem}"))?;
    match serde_json::from_slice(&found.bytes) {
        Ok(Value::Object(fields)) => Ok(fields),
        Ok(_) => Err(format!("value {number} of the list is not an object")),
        Err(e) => Err(format!(
            "object {number}, at byte {}: {e}",
            found.offset + 1
        )),
    }
}

/// Adds the rows of an object of objects, by id. An object of lists is refused with the names of these.
fn rows_by_id(path: &Path, table: &mut Table) -> Result<(), String> {
    let mut scan = JsonScan::new(open(path).map_err(|e| e.to_string())?);
    let (mut lists, mut number, mut others) = (Vec::new(), 0, 0);
    let (before, mut keys) = (table.rows.len(), Vec::new());
    scan.object(|scan, name| {
        match scan.kind()? {
            Kind::Object => {
                number += 1;
                let found = scan.value(LONGEST_ROW)?;
                add(&found, number, None, table)?;
                keys.push(name);
                return Ok(());
            }
            Kind::List => {
                let mut columns = None;
                scan.list(|scan| {
                    if columns.is_some() || scan.kind()? != Kind::Object {
                        return scan.skip_value();
                    }
                    let names = object(&scan.value(LONGEST_ROW)?, 1)?;
                    columns = Some(names.keys().cloned().collect::<Vec<String>>());
                    Ok(())
                })?;
                lists.extend(columns.map(|columns| (name, columns)));
                return Ok(());
            }
            Kind::Other => others += 1,
        }
        scan.skip_value()
    })?;
    scan.end()?;
    let Some((name, columns)) = lists.first() else {
        return match (number, others) {
            (1.., 0) => table.add_ids(before, keys),
            _ => Err("neither a list of objects, nor objects by their ids".to_owned()),
        };
    };
    let names: Vec<&str> = lists.iter().map(|(name, _)| name.as_str()).collect();
    Err(format!(
        "an object with the lists {}; {name:?} has the columns {}; say where the rows are: --read rows={}, and which column is which if these are no common names: --map question=…,image=…,options=…,answer=…",
        names.join(", "),
        columns.join(", "),
        shell_word(name)
    ))
}

/// Adds a row. Fields of the object around it are seen where it has none of the name.
fn push(
    table: &mut Table,
    place: RowPlace,
    fields: Map<String, Value>,
    around: Option<&Map<String, Value>>,
) -> Result<(), String> {
    let mut cells = Vec::new();
    for (name, value) in around.into_iter().flatten() {
        if !fields.contains_key(name) {
            cells.push((table.add_column(name)?, Cell::from(value.clone())));
        }
    }
    for (name, value) in fields {
        cells.push((table.add_column(&name)?, Cell::from(value)));
    }
    table.push(place, cells)
}

/// The cell of a row in a column, whole.
pub(super) fn cell(
    path: &Path,
    (offset, length): (u64, usize),
    inner: Option<(usize, &str)>,
    column: &str,
) -> Result<Cell> {
    let unreadable = |e| Error::file(path, "read", e);
    let mut file = reading::open(path).map_err(unreadable)?;
    file.seek(SeekFrom::Start(offset)).map_err(unreadable)?;
    let mut bytes = vec![0; length];
    file.read_exact(&mut bytes).map_err(unreadable)?;
    let value: Value = serde_json::from_slice(&bytes).map_err(|e| {
        Error::data(
            path.display(),
            format_args!("changed while it was read: {e}"),
        )
    })?;
    let own = inner.and_then(|(at, list)| value.get(list)?.get(at)?.get(column));
    let found = own.or_else(|| value.get(column));
    Ok(found.cloned().map_or(Cell::Absent, Cell::from))
}
