//! Table of the content of a store ([`listing`]), and removal of its images ([`clear`]).

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;
use std::time::{Duration, SystemTime};

use super::entry::{Shown, facts_at_end};
use super::folder::{FileKind, StoreFolder, StoredFile};
use crate::error::{Error, Result};
use crate::files::folder_access::FolderAccess;
use crate::files::reading;
use crate::types::text::counted;

/// Number of bytes read from the end of a file for its facts; chosen (facts take less than 4 kB).
const TAIL: u64 = 16 << 10;
/// Limits of the age classes in the table, in days.
const AGES: [u64; 3] = [1, 7, 14];

/// Number of images, their size, and the time that they took to compute.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    images: usize,
    bytes: u64,
    milliseconds: u64,
}

impl Sum {
    fn add(&mut self, bytes: u64, milliseconds: u64) {
        self.images += 1;
        self.bytes += bytes;
        self.milliseconds += milliseconds;
    }

    fn line(&self, what: &str) -> String {
        let (megabytes, seconds) = (self.bytes as f64 / 1e6, self.milliseconds as f64 / 1e3);
        let images = self.images;
        format!("{images:>9} {megabytes:>11.1} {seconds:>13.1}  {what}\n")
    }
}

/// Table of the images of a store, by description and by time since the last use.
///
/// # Errors
/// If the folder is not a store, or cannot be read.
pub(crate) fn listing(folder: &Path) -> Result<String> {
    let (files, now) = (files(folder)?, SystemTime::now());
    let (mut all, mut by_shown) = (Sum::default(), BTreeMap::<Option<Shown>, Sum>::new());
    let mut by_age = [Sum::default(); AGES.len() + 1];
    let mut unfinished = 0;
    for file in &files {
        if file.kind == FileKind::Unfinished {
            unfinished += 1;
            continue;
        }
        let facts = facts(file);
        let (shown, milliseconds) = match facts {
            Some(facts) => (Some(facts.shown), facts.milliseconds),
            None => (None, 0),
        };
        all.add(file.bytes, milliseconds);
        let sum = by_shown.entry(shown).or_default();
        sum.add(file.bytes, milliseconds);
        let age = now.duration_since(file.used).unwrap_or_default();
        let age_class = AGES.iter().position(|days| age < Duration::from_hours(24 * days)).unwrap_or(AGES.len());
        by_age[age_class].add(file.bytes, milliseconds);
    }
    let mut text = String::from("    files          MB  s to make it\n");
    for (shown, sum) in &by_shown {
        text += &sum.line(
            &shown
                .as_ref()
                .map_or_else(|| "damaged, or of another version of the program".to_owned(), ToString::to_string),
        );
    }
    for (age_class, sum) in by_age.iter().enumerate().filter(|(_, sum)| sum.images > 0) {
        text += &sum.line(&match AGES.get(age_class) {
            Some(age) => format!("used less than {} ago", counted(*age as usize, "day")),
            None => format!("not used for {} days", AGES[AGES.len() - 1]),
        });
    }
    text += &all.line(&format!("in all, in {}", folder.display()));
    if unfinished > 0 {
        let _ = writeln!(
            text,
            "{unfinished} unfinished: being written, or left by a killed process and removed after a day"
        );
    }
    Ok(text)
}

/// Removes all images of a store, and returns a message with their number. Foreign files stay.
///
/// # Errors
/// If the folder is not a store, or a file cannot be removed.
pub(crate) fn clear(folder: &Path) -> Result<String> {
    let mut sum = Sum::default();
    for file in files(folder)? {
        match fs::remove_file(&file.path) {
            Ok(()) => sum.add(file.bytes, 0),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(Error::file(&file.path, "remove", e)),
        }
    }
    Ok(format!("{}: {} removed ({:.1} MB)\n", folder.display(), counted(sum.images, "file"), sum.bytes as f64 / 1e6))
}

/// Files of the store in a folder.
fn files(folder: &Path) -> Result<Vec<StoredFile>> {
    let store = StoreFolder::new(folder, FolderAccess::Private);
    if !store.root().is_dir() {
        let problem = "no image store: the folder that --images-cache named is expected";
        return Err(Error::data(folder.display(), problem));
    }
    store.files().map_err(|e| Error::file(store.root(), "read", e))
}

/// Facts of an entry, read without its image; `None` if the entry is damaged.
fn facts(file: &StoredFile) -> Option<super::EntryFacts> {
    let mut content = reading::open(&file.path).ok()?;
    let start = file.bytes.saturating_sub(TAIL);
    content.seek(SeekFrom::Start(start)).ok()?;
    let mut tail = Vec::new();
    content.read_to_end(&mut tail).ok()?;
    facts_at_end(&tail, file.bytes).map(|(facts, _)| facts)
}
