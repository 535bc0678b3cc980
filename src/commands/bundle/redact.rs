//! Removal of secrets and of paths that identify the machine from a run: [`Redactor`].
//!
//! A run without private information, for a bundle: [`RedactedRun`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::ValueEnum;
use regex::{Captures, Regex};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{Record, Thumbnail};
use darkqa_report::page::fitting_thumbnails;
use darkqa_runs::stored::{AnyRun, ExperimentKind, RunFiles, StoredRun, read_run_manifest};
use darkqa_score::answers::record::Detail;

/// Minimum length of a key in an environment variable, in bytes (chosen): shorter values may be ordinary words.
const MIN_KEY_BYTES: usize = 8;

/// Replacement for a key.
const SECRET: &str = "[secret]";

/// Prefix of an image as a data URL. Such texts are not redacted: their base64 contains no path and no key.
const IMAGE_PREFIX: &str = "data:image/";

/// Suffixes of environment variables whose value is a key.
const KEY_VARIABLE_SUFFIXES: [&str; 6] = ["KEY", "TOKEN", "SECRET", "PASSWORD", "_PAT", "_PASS"];

/// The kind of a redacted part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Redaction {
    /// A path on a machine; its last component is kept.
    Path,
    /// A user name, password, query or fragment in a URL.
    Address,
    /// A key.
    Key,
}

impl Redaction {
    /// A sentence for the list of changes, with the number of times.
    pub(super) fn words(self, times: usize) -> String {
        let times = match times {
            1 => "once".to_owned(),
            times => format!("{times} times"),
        };
        match self {
            Self::Path => {
                format!("paths on the machine of the run are named by their last part, behind DIR/ ({times})")
            }
            Self::Address => {
                format!("users, passwords and queries are left out of addresses ({times})")
            }
            Self::Key => format!("what looks like a key is written {SECRET} ({times})"),
        }
    }
}

/// Removes private paths, private parts of URLs, and keys from texts.
pub(super) struct Redactor {
    /// Paths on this machine or on the machine of the run, longest first.
    private_paths: Vec<String>,
    /// Keys in environment variables.
    keys: Vec<String>,
    /// How often each change was made.
    pub(super) changes: BTreeMap<Redaction, usize>,
}

/// The paths to redact in a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Paths {
    /// Every absolute path, in texts that this program wrote.
    Any,
    /// Only known private paths, in texts of data sets and models, where a slash may mean something else.
    Known,
}

/// An absolute path (group 2) after the start of the text or a delimiter (group 1).
static PATH: LazyLock<Regex> = LazyLock::new(|| {
    compile(r#"(^|[\s"'=:,;(\[]|\bfile://)((?:/[^\s"',;:()\[\]/]+){2,}/?|[A-Za-z]:\\[^\s"',;]+|\\\\[^\s"',;]+)"#)
});

/// The user name and password before a host; group 1 is the URL scheme.
static USER: LazyLock<Regex> = LazyLock::new(|| compile(r#"([A-Za-z][A-Za-z0-9+.-]*://)[^/\s"'?#]+@"#));

/// A URL with a query or fragment; group 1 is the URL without them.
static QUERY: LazyLock<Regex> = LazyLock::new(|| compile(r#"(https?://[^\s"'?#]+)[?#][^\s"']*"#));

/// Key formats of known vendors.
static KEY: LazyLock<Regex> = LazyLock::new(|| {
    compile(
        r"\b(?:sk-[A-Za-z0-9_-]{16,}|AIza[A-Za-z0-9_-]{30,}|(?:hf|gsk|ghp)_[A-Za-z0-9]{20,}|xai-[A-Za-z0-9]{20,}|Bearer\s+[A-Za-z0-9._~+/-]{12,}=*)",
    )
});

fn compile(text: &str) -> Regex {
    Regex::new(text).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
}

impl Redactor {
    /// A redactor for a run's folder. It knows the home, working and run folders, and the keys in the environment.
    pub(super) fn new(folder: &Path) -> Self {
        let mut paths: BTreeSet<PathBuf> =
            ["HOME", "USERPROFILE"].into_iter().filter_map(std::env::var_os).map(PathBuf::from).collect();
        paths.extend(std::env::current_dir());
        paths.extend(std::path::absolute(folder));
        let real_paths: Vec<PathBuf> = paths.iter().filter_map(|path| path.canonicalize().ok()).collect();
        paths.extend(real_paths);
        let keys = std::env::vars_os().filter_map(|(name, value)| {
            let name = name.to_string_lossy().to_uppercase();
            let is_key = KEY_VARIABLE_SUFFIXES.iter().any(|suffix| name.ends_with(suffix));
            let value = value.into_string().ok()?;
            (is_key && value.trim().len() >= MIN_KEY_BYTES).then(|| value.trim().to_owned())
        });
        let mut keys: Vec<String> = keys.collect();
        // A key may begin with another one.
        keys.sort_by_key(|key| std::cmp::Reverse(key.len()));
        let mut redactor = Self { private_paths: Vec::new(), keys, changes: BTreeMap::new() };
        for path in paths {
            redactor.add_private_path(&path.to_string_lossy());
        }
        redactor
    }

    /// Adds a path to redact in all later texts. Roots such as `/` and `C:\` are ignored.
    fn add_private_path(&mut self, path: &str) {
        let path = path.trim_end_matches(['/', '\\']);
        let is_root = path.chars().filter(|c| !"/\\:".contains(*c)).count() < 2;
        if is_root || self.private_paths.iter().any(|known| known == path) {
            return;
        }
        self.private_paths.push(path.to_owned());
        self.private_paths.sort_by_key(|path| std::cmp::Reverse(path.len()));
    }

    /// Description of a known key or private path that a redacted text still contains; `None` if it contains neither.
    pub(super) fn find_leak(&self, text: &str) -> Option<&'static str> {
        if self.keys.iter().any(|key| text.contains(key)) {
            return Some("a key of the environment");
        }
        let has_path = self.private_paths.iter().any(|path| whole_matches(text, path).next().is_some());
        has_path.then_some("a path of this machine")
    }

    /// The JSON value with its strings and field names redacted by [`text`](Self::text).
    ///
    /// # Errors
    /// If two fields of an object have the same name after redaction.
    pub(super) fn value(&mut self, value: Value, paths: Paths) -> Result<Value> {
        Ok(match value {
            Value::String(text) => Value::String(self.text(&text, paths)),
            Value::Array(values) => {
                let values = values.into_iter().map(|value| self.value(value, paths));
                Value::Array(values.collect::<Result<_>>()?)
            }
            Value::Object(fields) => {
                let mut redacted = Map::new();
                for (name, value) in fields {
                    let shown = self.text(&name, paths);
                    let value = self.value(value, paths)?;
                    if redacted.insert(shown.clone(), value).is_some() {
                        let problem = format_args!(
                            "two things in it differ by their folders alone, and would both be {shown:?} without: give one another name (a model in a file of models) and report the run"
                        );
                        return Err(Error::data("manifest.json", problem));
                    }
                }
                Value::Object(redacted)
            }
            other => other,
        })
    }

    /// The text without private paths, keys, and user names and passwords in URLs. [`Paths::Any`] also removes queries
    /// and fragments.
    pub(super) fn text(&mut self, text: &str, paths: Paths) -> String {
        if text.starts_with(IMAGE_PREFIX) {
            return text.to_owned();
        }
        let mut text = text.to_owned();
        if paths == Paths::Any {
            // PATH ends at the first space, but a path that is the whole text may contain spaces.
            if is_absolute(&text) && !text.contains('\n') {
                self.add_private_path(&text);
            }
            for found in PATH.captures_iter(&text) {
                self.add_private_path(&found[2]);
            }
            text = self.replace_matches(&QUERY, &text, Redaction::Address, |found| found[1].to_owned());
        }
        text = self.replace_matches(&USER, &text, Redaction::Address, |found| found[1].to_owned());
        for key in &self.keys {
            if text.contains(key) {
                *self.changes.entry(Redaction::Key).or_default() += text.matches(key).count();
                text = text.replace(key, SECRET);
            }
        }
        text = self.replace_matches(&KEY, &text, Redaction::Key, |_| SECRET.to_owned());
        for path in &self.private_paths {
            let starts: Vec<usize> = whole_matches(&text, path).collect();
            let name = path.rsplit(['/', '\\']).next().unwrap_or_default();
            for start in starts.into_iter().rev() {
                *self.changes.entry(Redaction::Path).or_default() += 1;
                text.replace_range(start..start + path.len(), &format!("DIR/{name}"));
            }
        }
        text
    }

    /// Replaces every match of a pattern and counts the changes.
    fn replace_matches(
        &mut self,
        pattern: &Regex,
        text: &str,
        change: Redaction,
        with: impl Fn(&Captures<'_>) -> String,
    ) -> String {
        let times = pattern.find_iter(text).count();
        if times == 0 {
            return text.to_owned();
        }
        *self.changes.entry(change).or_default() += times;
        pattern.replace_all(text, |found: &Captures<'_>| with(found)).into_owned()
    }
}

/// True for an absolute path of any system: Unix, Windows drive, or UNC.
fn is_absolute(text: &str) -> bool {
    let starts_with_letter = text.chars().next().is_some_and(|letter| letter.is_ascii_alphabetic());
    let is_drive = starts_with_letter && (text[1..].starts_with(":\\") || text[1..].starts_with(":/"));
    text.len() > 1 && text.starts_with('/') && !text.starts_with("//") || text.starts_with("\\\\") || is_drive
}

/// Start positions of a path in a text, in bytes, without matches inside a longer name or path.
fn whole_matches<'t>(text: &'t str, path: &'t str) -> impl Iterator<Item = usize> + 't {
    text.match_indices(path).filter_map(move |(start, _)| {
        let before = text[..start].chars().next_back();
        let after = text[start + path.len()..].chars().next();
        let is_below = before == Some('/') && !text[..start].ends_with("file://");
        let is_part = is_below || before.is_some_and(is_name) || after.is_some_and(is_name);
        (!is_part).then_some(start)
    })
}

fn is_name(c: char) -> bool {
    c.is_alphanumeric() || "_-".contains(c)
}

/// The thumbnails that a bundle includes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThumbnailChoice {
    /// No image
    None,
    /// Those shown on the page
    Shown,
    /// All that the run has
    All,
}

/// Name and content of a file.
type NamedFile = (String, Vec<u8>);

/// A run without private information.
pub(super) struct RedactedRun {
    pub(super) manifest: RunManifest,
    /// The files of the run folder.
    pub(super) files: Vec<NamedFile>,
    /// The run as read from these files, in a folder with the name of the run.
    pub(super) run: AnyRun,
    /// Number of thumbnails, and number of thumbnails left out.
    pub(super) thumbnails: [usize; 2],
}

impl RedactedRun {
    /// Reads and redacts the run in a folder.
    ///
    /// # Errors
    /// If the folder has no run, a line of a file is broken, or two models would have the same name without their
    /// folders.
    pub(super) fn read(
        folder: &Path,
        name: &str,
        thumbnails: ThumbnailChoice,
        redactor: &mut Redactor,
    ) -> Result<Self> {
        let stored = read_run_manifest(folder)?;
        let value = serde_json::to_value(&stored).map_err(|e| broken("manifest.json", &e))?;
        let value = redactor.value(value, Paths::Any)?;
        let manifest: RunManifest = serde_json::from_value(value).map_err(|e| broken("manifest.json", &e))?;
        let place = Path::new(name);
        match ExperimentKind::read(folder)? {
            ExperimentKind::Choice => {
                let files = RunFiles::read(folder)?;
                let frames: Vec<_> = files.questions.iter().map(|q| q.frame.clone()).collect();
                let shown = |all: &[Thumbnail]| fitting_thumbnails(all, &frames);
                let records = darkqa_store::read_records(folder)?;
                let data = RedactedData::new(records, files, thumbnails, shown, redactor)?;
                let run = StoredRun::from_records(place, manifest.clone(), data.records, data.lines)?;
                Self::new(manifest, data.files, AnyRun::Choice(run), data.thumbnails)
            }
            ExperimentKind::Open => {
                let records = darkqa_store::read_records(folder)?;
                let files = RunFiles::read(folder)?;
                let shown = <[Thumbnail]>::to_vec;
                let data = RedactedData::new(records, files, thumbnails, shown, redactor)?;
                let run = StoredRun::from_records(place, manifest.clone(), data.records, data.lines)?;
                Self::new(manifest, data.files, AnyRun::Open(run), data.thumbnails)
            }
        }
    }

    fn new(manifest: RunManifest, mut files: Vec<NamedFile>, run: AnyRun, thumbnails: [usize; 2]) -> Result<Self> {
        let mut text = serde_json::to_vec_pretty(&manifest).map_err(|e| broken("manifest.json", &e))?;
        text.push(b'\n');
        files.push(("manifest.json".to_owned(), text));
        Ok(Self { manifest, files, run, thumbnails })
    }
}

/// Redacted records and other lines of a run, with the files that contain them.
struct RedactedData<D> {
    records: Vec<Record<D>>,
    lines: RunFiles,
    files: Vec<NamedFile>,
    thumbnails: [usize; 2],
}

impl<D: Detail> RedactedData<D> {
    fn new(
        records: Vec<Record<D>>,
        lines: RunFiles,
        thumbnails: ThumbnailChoice,
        shown: impl Fn(&[Thumbnail]) -> Vec<Thumbnail>,
        redactor: &mut Redactor,
    ) -> Result<Self> {
        let all = lines.thumbnails.len();
        let included = match thumbnails {
            ThumbnailChoice::None => Vec::new(),
            ThumbnailChoice::Shown => shown(&lines.thumbnails),
            ThumbnailChoice::All => lines.thumbnails,
        };
        let (records, records_file) = redact_lines("records.jsonl", records, redactor)?;
        let (questions, questions_file) = redact_lines("questions.jsonl", lines.questions, redactor)?;
        let (thumbnails, thumbnails_file) = redact_lines("thumbnails.jsonl", included, redactor)?;
        let (fidelity, fidelity_file) = redact_lines("fidelity.jsonl", lines.fidelity, redactor)?;
        Ok(Self {
            thumbnails: [thumbnails.len(), all - thumbnails.len()],
            records,
            lines: RunFiles { questions, thumbnails, fidelity },
            // A run without such lines has no such file.
            files: [records_file, questions_file, thumbnails_file, fidelity_file]
                .into_iter()
                .filter(|(_, content)| !content.is_empty())
                .collect(),
        })
    }
}

/// Redacts the lines of a file; also returns the file.
fn redact_lines<T: Serialize + DeserializeOwned>(
    name: &str,
    lines: Vec<T>,
    redactor: &mut Redactor,
) -> Result<(Vec<T>, NamedFile)> {
    let (mut redacted, mut file) = (Vec::new(), Vec::new());
    for line in lines {
        let value = serde_json::to_value(&line).map_err(|e| broken(name, &e))?;
        let value = redact_line(value, redactor)?;
        let line: T = serde_json::from_value(value).map_err(|e| broken(name, &e))?;
        serde_json::to_writer(&mut file, &line).map_err(|e| broken(name, &e))?;
        file.push(b'\n');
        redacted.push(line);
    }
    Ok((redacted, (name.to_owned(), file)))
}

/// Redacts a line. Every path in the message of a failure is redacted, because the message comes from this program or a
/// server.
fn redact_line(mut value: Value, redactor: &mut Redactor) -> Result<Value> {
    if let Some(Value::String(message)) = value.pointer_mut("/failure/message") {
        *message = redactor.text(message, Paths::Any);
    }
    redactor.value(value, Paths::Known)
}

fn broken(name: &str, error: &serde_json::Error) -> Error {
    Error::data(name, error)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn redactor() -> Redactor {
        Redactor {
            private_paths: vec!["/home/ann".to_owned()],
            keys: vec!["a-key-of-mine".to_owned()],
            changes: BTreeMap::new(),
        }
    }

    #[test]
    fn paths_addresses_and_keys_are_removed() {
        let mut redactor = redactor();
        for (text, expected) in [
            ("/data/sets/home set", "DIR/home set"),
            ("/data", "DIR/data"),
            ("/data/sets/home set/a.png", "DIR/a.png"),
            ("cannot open \"/mnt/x/y.png\": no", "cannot open \"DIR/y.png\": no"),
            ("script:/mnt/x/z.jsonl", "script:DIR/z.jsonl"),
            ("C:\\Users\\ann\\set", "DIR/set"),
            ("http://ann:word@host:8000/v1?key=1", "http://host:8000/v1"),
            ("http://ann:p@ss@host/v1", "http://host/v1"),
            ("see file:///mnt/x/y.png", "see file://DIR/y.png"),
            ("key a-key-of-mine!", "key [secret]!"),
            ("sk-abcdefghijklmnopqrst", "[secret]"),
        ] {
            assert_eq!(redactor.text(text, Paths::Any), expected);
        }
        // Other texts are unchanged.
        for plain in ["1/2", "and/or", "rooms:frames=2,size=64x48", "http://host:8000/v1", "L3-noise", "/", "me@host"] {
            assert_eq!(redactor.text(plain, Paths::Any), plain);
        }
    }

    #[test]
    fn replies_lose_only_known_paths() {
        let mut redactor = redactor();
        assert_eq!(redactor.text("/left /or/right", Paths::Known), "/left /or/right");
        assert_eq!(redactor.text("see /home/ann/x and /home/anna", Paths::Known), "see DIR/ann/x and /home/anna");
        assert_eq!(redactor.text("x/home/ann", Paths::Known), "x/home/ann");
        assert!(redactor.find_leak("in /home/ann/x").is_some());
        assert!(redactor.find_leak("in /home/anna, http://a-key-of-yours").is_none());
    }

    #[test]
    fn colliding_field_names_are_refused() {
        let mut redactor = redactor();
        let models = json!({"model": {"/a/b/m": 1, "/c/d/m": 2}});
        let error = redactor.value(models, Paths::Any).unwrap_err().to_string();
        assert!(error.contains("DIR/m"), "{error}");
        let fine = json!({"model": {"/a/b/m": 1, "/c/d/n": 2}});
        let fine = redactor.value(fine, Paths::Any).unwrap();
        assert_eq!(fine, json!({"model": {"DIR/m": 1, "DIR/n": 2}}));
        assert_eq!(redactor.changes.get(&Redaction::Path), Some(&4));
    }
}
