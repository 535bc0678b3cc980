//! Damage to values of JSON.

use serde_json::{Map, Value, json};

use super::words::{self, TEXTS};
use crate::robustness::hostile::random::Random;

/// Damages one value in a file of JSON or of lines of JSON; false if no value can be read where it looks.
pub(super) fn mutate(file: &mut Vec<u8>, random: &mut Random) -> bool {
    let whole = serde_json::from_slice::<Value>(file).is_ok();
    let range = if whole {
        0..file.len()
    } else {
        let Some(range) = line(file, random) else {
            return false;
        };
        range
    };
    let Ok(mut value) = serde_json::from_slice::<Value>(&file[range.clone()]) else {
        return false;
    };
    if random.below(12) == 0 {
        let Some(text) = with_key_twice(&value, random) else {
            return false;
        };
        file.splice(range, text.into_bytes());
        return true;
    }
    let places = count(&value);
    let mut left = random.below(places);
    change_at(&mut value, &mut left, random);
    let text = value.to_string();
    // No value of JSON is written so, but files hold it.
    let text = text.replacen("\"RAW NUMBER\"", words::number(random), 1);
    let depth = *random.pick(&[1, 3, 100, 5000]);
    let deep = "[".repeat(depth) + &"]".repeat(depth);
    let text = text.replacen("\"RAW DEPTH\"", &deep, 1);
    file.splice(range, text.into_bytes());
    true
}

/// The place of one of the lines that are not empty.
fn line(file: &[u8], random: &mut Random) -> Option<std::ops::Range<usize>> {
    let mut lines = Vec::new();
    let mut start = 0;
    for line in file.split(|byte| *byte == b'\n') {
        if !line.is_empty() {
            lines.push(start..start + line.len());
        }
        start += line.len() + 1;
    }
    (!lines.is_empty()).then(|| random.pick(&lines).clone())
}

/// The number of values in a value, itself with them.
fn count(value: &Value) -> usize {
    let inner: usize = match value {
        Value::Array(all) => all.iter().map(count).sum(),
        Value::Object(all) => all.values().map(count).sum(),
        _ => 0,
    };
    inner + 1
}

/// Damages the value that `left` values stand before.
fn change_at(value: &mut Value, left: &mut usize, random: &mut Random) -> bool {
    if *left == 0 {
        change(value, random);
        return true;
    }
    *left -= 1;
    match value {
        Value::Array(all) => all.iter_mut().any(|one| change_at(one, left, random)),
        Value::Object(all) => all.values_mut().any(|one| change_at(one, left, random)),
        _ => false,
    }
}

fn change(value: &mut Value, random: &mut Random) {
    match random.below(9) {
        0 => *value = other_type(random),
        1 | 2 => *value = json!("RAW NUMBER"),
        3 | 4 => *value = json!(random.pick(&TEXTS)),
        5 => change_members(value, random),
        6 => *value = json!("RAW DEPTH"),
        7 => {
            let times = *random.pick(&[0, 2, 27, 3000]);
            let size = value.to_string().len() + 1;
            *value = Value::Array(vec![value.clone(); times.min(300_000 / size)]);
        }
        _ => {
            *value = json!(random.pick(&["a", "\u{0}", "é", "1", "\u{1b}", "[["]).repeat(20_000));
        }
    }
}

fn other_type(random: &mut Random) -> Value {
    let all = [Value::Null, json!(true), json!(1.5), json!(""), json!([]), json!({}), json!({"": {"": null}})];
    random.pick(&all).clone()
}

/// Takes a member away, adds one, or exchanges two.
fn change_members(value: &mut Value, random: &mut Random) {
    match value {
        Value::Array(all) if !all.is_empty() => {
            let (one, other) = (random.below(all.len()), random.below(all.len()));
            match random.below(3) {
                0 => drop(all.remove(one)),
                1 => all.swap(one, other),
                _ => all.insert(one, all[other].clone()),
            }
        }
        Value::Object(all) if !all.is_empty() => change_fields(all, random),
        other => *other = json!({"key": std::mem::take(other)}),
    }
}

fn change_fields(all: &mut Map<String, Value>, random: &mut Random) {
    let keys: Vec<String> = all.keys().cloned().collect();
    let (one, other) = (random.pick(&keys), random.pick(&keys));
    let taken = all.remove(one).unwrap_or_default();
    match random.below(3) {
        0 => {}
        1 => {
            let key = (*random.pick(&TEXTS)).to_owned();
            all.insert(key, taken);
        }
        _ => {
            let old = all.insert(other.clone(), taken).unwrap_or_default();
            all.insert(one.clone(), old);
        }
    }
}

/// An object in which the first of its keys stands once more, with another value.
fn with_key_twice(value: &Value, random: &mut Random) -> Option<String> {
    let keys: Vec<&String> = value.as_object()?.keys().collect();
    if keys.is_empty() {
        return None;
    }
    let (key, again) = (json!(random.pick(&keys)), other_type(random));
    let text = value.to_string();
    Some(format!("{{{key}:{again},{}", &text[1..]))
}
