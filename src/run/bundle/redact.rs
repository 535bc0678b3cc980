//! Removes secrets, and places that identify the machine, from a run: [`Redactor`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use regex::{Captures, Regex};
use serde_json::{Map, Value};

use crate::error::{Error, Result};

/// Least length of a key in a variable, in bytes (chosen): shorter values are words.
const LEAST_KEY: usize = 8;

/// The replacement of a key.
const SECRET: &str = "[secret]";

/// Begins an image within a text: its letters reveal nothing.
const IMAGE: &str = "data:image/";

/// Endings of the names of variables that hold keys.
const KEY_NAMES: [&str; 4] = ["_KEY", "_TOKEN", "_SECRET", "_PASSWORD"];

/// A part that was removed or replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Change {
    /// A path on this machine, of which the last name stays.
    Path,
    /// A user, password or query in an address.
    Address,
    /// A key.
    Key,
}

impl Change {
    /// The change in words.
    pub(super) fn words(self, times: usize) -> String {
        let times = match times {
            1 => "once".to_owned(),
            times => format!("{times} times"),
        };
        match self {
            Self::Path => format!(
                "paths on the machine of the run are named by their last part, behind DIR/ ({times})"
            ),
            Self::Address => {
                format!("users, passwords and queries are left out of addresses ({times})")
            }
            Self::Key => format!("what looks like a key is written {SECRET} ({times})"),
        }
    }
}

/// Removes paths, addresses and secrets from texts.
pub(super) struct Redactor {
    /// Places on this machine or that of the run, the longest first.
    places: Vec<String>,
    /// Values of variables that hold keys.
    keys: Vec<String>,
    /// How often each change was made.
    pub(super) changes: BTreeMap<Change, usize>,
}

/// How a text is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Paths {
    /// Any absolute path is one of a machine: texts of this program.
    Any,
    /// Only places that are known: texts of data and models, where a slash may mean something else.
    Known,
}

/// An absolute path within a text, behind what may stand before it.
static PATH: LazyLock<Regex> = LazyLock::new(|| {
    pattern(
        r#"(^|[\s"'=:,;(\[])((?:/[^\s"',;:()\[\]/]+){2,}/?|[A-Za-z]:\\[^\s"',;]+|\\\\[^\s"',;]+)"#,
    )
});
/// A user and password before a host.
static USER: LazyLock<Regex> =
    LazyLock::new(|| pattern(r#"([A-Za-z][A-Za-z0-9+.-]*://)[^/\s"'@?#]+@"#));
/// The query or fragment of an address.
static QUERY: LazyLock<Regex> = LazyLock::new(|| pattern(r#"(https?://[^\s"'?#]+)[?#][^\s"']*"#));
/// Forms of keys of known vendors.
static KEY: LazyLock<Regex> = LazyLock::new(|| {
    pattern(
        r"\b(?:sk-[A-Za-z0-9_-]{16,}|AIza[A-Za-z0-9_-]{30,}|(?:hf|gsk|ghp)_[A-Za-z0-9]{20,}|xai-[A-Za-z0-9]{20,}|Bearer\s+[A-Za-z0-9._~+/-]{12,}=*)",
    )
});

fn pattern(text: &str) -> Regex {
    Regex::new(text).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
}

impl Redactor {
    /// For the run in a folder: the places of this process, and the keys in its environment.
    pub(super) fn new(folder: &Path) -> Self {
        let home = ["HOME", "USERPROFILE"].map(|name| std::env::var_os(name).map(PathBuf::from));
        let mut places: BTreeSet<PathBuf> = home.into_iter().flatten().collect();
        places.extend(std::env::current_dir());
        places.extend(std::path::absolute(folder));
        let real = places.iter().filter_map(|place| place.canonicalize().ok());
        places.extend(real.collect::<Vec<_>>());
        let variables = std::env::vars_os().filter_map(|(name, value)| {
            let name = name.to_string_lossy().to_uppercase();
            let is_key = KEY_NAMES.iter().any(|ending| name.ends_with(ending));
            let value = value.into_string().ok()?;
            (is_key && value.trim().len() >= LEAST_KEY).then(|| value.trim().to_owned())
        });
        let mut redactor = Self {
            places: Vec::new(),
            keys: variables.collect(),
            changes: BTreeMap::new(),
        };
        for place in places {
            redactor.learn(&place.to_string_lossy());
        }
        redactor
    }

    /// A place that is private from now on, wherever it stands. The root is none.
    fn learn(&mut self, place: &str) {
        let place = place.trim_end_matches(['/', '\\']);
        let is_root = place.chars().filter(|c| !"/\\:".contains(*c)).count() < 2;
        if is_root || self.places.iter().any(|known| known == place) {
            return;
        }
        self.places.push(place.to_owned());
        self.places
            .sort_by_key(|place| std::cmp::Reverse(place.len()));
    }

    /// The first private thing in a text that was to hold none, in words.
    pub(super) fn leak(&self, text: &str) -> Option<&'static str> {
        if self.keys.iter().any(|key| text.contains(key)) {
            return Some("a key of the environment");
        }
        let is_leaked = self
            .places
            .iter()
            .any(|place| found(text, place).next().is_some());
        is_leaked.then_some("a path of this machine")
    }

    /// A value with the texts and names in it as [`text`](Self::text) gives them.
    ///
    /// # Errors
    /// If two fields of an object would get one name.
    pub(super) fn value(&mut self, value: Value, paths: Paths) -> Result<Value> {
        Ok(match value {
            Value::String(text) => Value::String(self.text(&text, paths)),
            Value::Array(values) => {
                let values = values.into_iter().map(|value| self.value(value, paths));
                Value::Array(values.collect::<Result<_>>()?)
            }
            Value::Object(fields) => {
                let mut named = Map::new();
                for (name, value) in fields {
                    let shown = self.text(&name, paths);
                    let value = self.value(value, paths)?;
                    if named.insert(shown.clone(), value).is_some() {
                        let problem = format_args!(
                            "two things in it differ by their folders alone, and would both be {shown:?} without: give one another name (a model in a file of models) and report the run"
                        );
                        return Err(Error::data("manifest.json", problem));
                    }
                }
                Value::Object(named)
            }
            other => other,
        })
    }

    /// A text without places, users in addresses, and keys.
    pub(super) fn text(&mut self, text: &str, paths: Paths) -> String {
        if text.starts_with(IMAGE) {
            return text.to_owned();
        }
        let mut text = text.to_owned();
        if paths == Paths::Any {
            // A path may hold spaces where it is the whole text.
            if is_absolute(&text) && !text.contains('\n') {
                self.learn(&text);
            }
            for found in PATH.captures_iter(&text) {
                self.learn(&found[2]);
            }
            text = self.replaced(&QUERY, &text, Change::Address, |found| found[1].to_owned());
        }
        text = self.replaced(&USER, &text, Change::Address, |found| found[1].to_owned());
        for key in &self.keys {
            if text.contains(key) {
                *self.changes.entry(Change::Key).or_default() += 1;
                text = text.replace(key, SECRET);
            }
        }
        text = self.replaced(&KEY, &text, Change::Key, |_| SECRET.to_owned());
        for place in &self.places {
            let starts: Vec<usize> = found(&text, place).collect();
            let name = place.rsplit(['/', '\\']).next().unwrap_or_default();
            for start in starts.into_iter().rev() {
                *self.changes.entry(Change::Path).or_default() += 1;
                text.replace_range(start..start + place.len(), &format!("DIR/{name}"));
            }
        }
        text
    }

    fn replaced(
        &mut self,
        pattern: &Regex,
        text: &str,
        change: Change,
        with: impl Fn(&Captures<'_>) -> String,
    ) -> String {
        let times = pattern.find_iter(text).count();
        if times == 0 {
            return text.to_owned();
        }
        *self.changes.entry(change).or_default() += times;
        pattern
            .replace_all(text, |found: &Captures<'_>| with(found))
            .into_owned()
    }
}

/// Whether a text is an absolute path, of this or another system.
fn is_absolute(text: &str) -> bool {
    let drive = text
        .chars()
        .next()
        .is_some_and(|letter| letter.is_ascii_alphabetic());
    let is_drive = drive && (text[1..].starts_with(":\\") || text[1..].starts_with(":/"));
    text.len() > 1 && text.starts_with('/') && !text.starts_with("//")
        || text.starts_with("\\\\")
        || is_drive
}

/// Where a place stands in a text as a whole, not as a part of other names.
fn found<'t>(text: &'t str, place: &'t str) -> impl Iterator<Item = usize> + 't {
    let is_name = |c: char| c.is_alphanumeric() || "_-".contains(c);
    text.match_indices(place).filter_map(move |(start, _)| {
        let before = text[..start].chars().next_back();
        let after = text[start + place.len()..].chars().next();
        let is_part = before.is_some_and(|c| is_name(c) || c == '/') || after.is_some_and(is_name);
        (!is_part).then_some(start)
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn redactor() -> Redactor {
        Redactor {
            places: vec!["/home/ann".to_owned()],
            keys: vec!["a-key-of-mine".to_owned()],
            changes: BTreeMap::new(),
        }
    }

    #[test]
    fn places_addresses_and_keys_are_taken_out() {
        let mut redactor = redactor();
        let mut any = |text: &str| redactor.text(text, Paths::Any);
        for (text, expected) in [
            ("/data/sets/home set", "DIR/home set"),
            ("/data", "DIR/data"),
            ("/data/sets/home set/a.png", "DIR/a.png"),
            (
                "cannot open \"/mnt/x/y.png\": no",
                "cannot open \"DIR/y.png\": no",
            ),
            ("script:/mnt/x/z.jsonl", "script:DIR/z.jsonl"),
            ("C:\\Users\\ann\\set", "DIR/set"),
            ("http://ann:word@host:8000/v1?key=1", "http://host:8000/v1"),
            ("key a-key-of-mine!", "key [secret]!"),
            ("sk-abcdefghijklmnopqrst", "[secret]"),
        ] {
            assert_eq!(any(text), expected);
        }
        // What is none of these stays.
        for plain in [
            "1/2",
            "and/or",
            "rooms:frames=2,size=64x48",
            "http://host:8000/v1",
            "L3-noise",
            "/",
            "me@host",
        ] {
            assert_eq!(any(plain), plain);
        }
    }

    #[test]
    fn only_known_places_are_taken_out_of_replies() {
        let mut redactor = redactor();
        let mut known = |text: &str| redactor.text(text, Paths::Known);
        assert_eq!(known("/left /or/right"), "/left /or/right");
        assert_eq!(
            known("see /home/ann/x and /home/anna"),
            "see DIR/ann/x and /home/anna"
        );
        assert_eq!(known("x/home/ann"), "x/home/ann");
        assert!(redactor.leak("in /home/ann/x").is_some());
        assert!(
            redactor
                .leak("in /home/anna, http://a-key-of-yours")
                .is_none()
        );
    }

    #[test]
    fn names_that_would_become_one_are_refused() {
        let mut redactor = redactor();
        let models = json!({"model": {"/a/b/m": 1, "/c/d/m": 2}});
        let error = redactor.value(models, Paths::Any).unwrap_err().to_string();
        assert!(error.contains("DIR/m"), "{error}");
        let fine = json!({"model": {"/a/b/m": 1, "/c/d/n": 2}});
        let fine = redactor.value(fine, Paths::Any).unwrap();
        assert_eq!(fine, json!({"model": {"DIR/m": 1, "DIR/n": 2}}));
        assert_eq!(redactor.changes.get(&Change::Path), Some(&4));
    }
}
