//! Reading and writing images of a store: [`ImageStore`].

use std::fs;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use super::counts::StoreCounts;
use super::entry::{Content, Damaged, Entry, FOOTER, fits};
use super::folder::{StoreFolder, found};
use super::key::Key;
use super::kinds::StoredKinds;
use super::sweep::sweep;
use crate::error::{Error, Result};
use crate::files::folder_access::FolderAccess;
use crate::files::reading;

/// Bytes after which the store is counted and swept again, at most; chosen.
const SWEEP_AFTER: u64 = 1_000_000_000;
/// The same as a share of the room, for small stores; chosen.
const SWEEP_SHARE: u64 = 8;
/// The most bytes of a file that is read; chosen: an image of 100 megapixels has a third.
const MOST_BYTES: u64 = 1 << 30;
/// Time from which on the use of an image is noted again: once a day, so that reading writes little.
const NOTED: Duration = Duration::from_hours(24);

/// A folder of images that other runs and processes share. Threads may share it, too.
#[derive(Debug)]
pub(crate) struct ImageStore {
    /// The folder as the user named it.
    named: PathBuf,
    folder: StoreFolder,
    kinds: StoredKinds,
    /// Room for all files, in bytes.
    most: u64,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    counts: StoreCounts,
    /// Bytes in the store, as far as this process knows.
    bytes: u64,
    /// Bytes that were to be written since the last sweep.
    offered: u64,
    health: Health,
}

/// The remaining uses of the store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
enum Health {
    #[default]
    Whole,
    /// It cannot be written to any more, and the user knows it.
    ReadOnly,
    /// It cannot be read any more, and the user knows it.
    Gone,
}

impl ImageStore {
    /// A store in a folder, which is made with such access if it is not there. It holds such images, `most` bytes of them.
    ///
    /// # Errors
    /// If the folder cannot be made or read.
    pub(crate) fn open(
        folder: &Path,
        access: FolderAccess,
        kinds: StoredKinds,
        most: u64,
    ) -> Result<Self> {
        let store = Self {
            named: folder.to_owned(),
            folder: StoreFolder::new(folder, access),
            kinds,
            most,
            state: Mutex::default(),
        };
        let unusable = |e: io::Error| {
            let folder = folder.display();
            let problem = format_args!(
                "cannot use the folder {folder}: {e}; name a folder that can be written to, or leave the flag out"
            );
            Error::usage("--images-cache", problem)
        };
        store.folder.make().map_err(unusable)?;
        let swept = sweep(&store.folder, most, SystemTime::now()).map_err(unusable)?;
        store.with(|state| {
            state.bytes = swept.bytes;
            state.counts.evicted = swept.evicted;
        });
        Ok(store)
    }

    /// Which images it keeps.
    pub(crate) fn kinds(&self) -> StoredKinds {
        self.kinds
    }

    /// Images read and written so far, as a line for `--timings`.
    pub(crate) fn summary(&self) -> String {
        let (counts, bytes) = self.with(|state| (state.counts, state.bytes));
        let (folder, gigabytes) = (self.named.display(), |bytes: u64| bytes as f64 / 1e9);
        let (held, most) = (gigabytes(bytes), gigabytes(self.most));
        format!("image store {folder}: {counts}; it holds {held:.2} of {most} GB")
    }

    #[cfg(test)]
    pub(super) fn counts(&self) -> StoreCounts {
        self.with(|state| state.counts)
    }

    /// Whether the store has a file of this key. It may be damaged.
    pub(crate) fn contains(&self, key: &Key) -> bool {
        self.with(|state| state.health) != Health::Gone && self.folder.place(key.digest()).is_file()
    }

    /// The entry of a key; `None` if the store has none. A damaged one is removed. `is_enough` states whether an entry has all that is
    /// needed, else it counts as missing. Only images are counted as read or missing.
    pub(crate) fn get(
        &self,
        key: &Key,
        content: Content,
        is_enough: impl FnOnce(&Entry) -> bool,
    ) -> Option<Entry> {
        if self.with(|state| state.health) == Health::Gone {
            return None;
        }
        let place = self.folder.place(key.digest());
        let entry = match found(read(&place)) {
            Ok(None) => None,
            Ok(Some(file)) => {
                let entry = file.and_then(|file| Entry::read(key, file));
                if entry.is_err() {
                    self.remove_damaged(&place);
                }
                entry.ok().filter(is_enough)
            }
            Err(e) => {
                self.fails(Health::Gone, "read", &e);
                None
            }
        };
        self.with(|state| match (content, &entry) {
            (Content::Measures | Content::Probe | Content::Thumbnail, found) => {
                let found = found.as_ref();
                state.counts.facts += usize::from(found.is_some());
                state.counts.saved_ms += found.map_or(0, |entry| entry.facts.milliseconds);
            }
            (Content::Image, Some(entry)) => {
                state.counts.hits += 1;
                state.counts.hit_bytes += entry.image.len() as u64;
                state.counts.saved_ms += entry.facts.milliseconds;
            }
            (Content::Image, None) => state.counts.misses += 1,
        });
        entry
    }

    /// Removes a damaged file; the first one is named in a warning.
    fn remove_damaged(&self, place: &Path) {
        let bytes = place.symlink_metadata().map_or(0, |file| file.len());
        // If it cannot be removed, the image that is made now replaces it.
        let _ = fs::remove_file(place);
        let count = self.with(|state| {
            state.bytes = state.bytes.saturating_sub(bytes);
            state.counts.damaged += 1;
            state.counts.damaged
        });
        if count == 1 {
            let file = place.display();
            tracing::warn!(
                "--images-cache: {file} is damaged, and made again; so is each further one"
            );
        }
    }

    /// Adds the entry of a key, if there is room.
    pub(crate) fn put(&self, key: &Key, entry: &Entry) {
        if self.with(|state| state.health) != Health::Whole {
            return;
        }
        let file = entry.file(key);
        let bytes = file.len() as u64;
        if !self.has_room(bytes) {
            let count = self.with(|state| {
                state.counts.left_out += 1;
                state.counts.left_out
            });
            if count == 1 {
                let (folder, most) = (self.named.display(), self.most as f64 / 1e9);
                tracing::warn!(
                    "--images-cache: {folder} is full, and no image in it is unused for 14 days; further ones are not stored; a larger \
                     --images-cache size than {most} makes room"
                );
            }
            return;
        }
        match self.folder.write(key.digest(), &file) {
            Ok(()) => self.with(|state| {
                state.bytes += bytes;
                if entry.facts.shown.content == Content::Image {
                    state.counts.written += 1;
                    state.counts.written_bytes += bytes;
                }
            }),
            Err(e) => self.fails(Health::ReadOnly, "write to", &e),
        }
    }

    /// Whether there is room for a file. After some bytes the store is swept again.
    fn has_room(&self, bytes: u64) -> bool {
        let period = SWEEP_AFTER.min(self.most / SWEEP_SHARE);
        let is_due = self.with(|state| {
            state.offered += bytes;
            let is_due = state.offered >= period;
            if is_due {
                state.offered = 0;
            }
            is_due
        });
        if is_due {
            // Room for the next period, too.
            let most = self.most.saturating_sub(period.max(bytes));
            match sweep(&self.folder, most, SystemTime::now()) {
                Ok(swept) => self.with(|state| {
                    state.bytes = swept.bytes;
                    state.counts.evicted += swept.evicted;
                }),
                Err(e) => self.fails(Health::ReadOnly, "sweep", &e),
            }
        }
        self.with(|state| state.health == Health::Whole && state.bytes + bytes <= self.most)
    }

    /// Warns once that the store cannot be used, and goes on without.
    fn fails(&self, health: Health, action: &str, problem: &io::Error) {
        let was = self.with(|state| {
            let worse = state.health.max(health);
            std::mem::replace(&mut state.health, worse)
        });
        if was < health {
            let folder = self.named.display();
            let goes_on = match health {
                Health::Gone => "all images are made here",
                Health::ReadOnly | Health::Whole => "no more images are stored there",
            };
            tracing::warn!("--images-cache: cannot {action} {folder}: {problem}; {goes_on}");
        }
    }

    fn with<T>(&self, action: impl FnOnce(&mut State) -> T) -> T {
        action(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The content of a file, whose use is noted. A file that is too large, or does not end as an entry does, is damaged and not read.
fn read(path: &Path) -> io::Result<Result<Vec<u8>, Damaged>> {
    let mut file = reading::open(path)?;
    let data = file.metadata()?;
    let mut footer = Vec::new();
    let before = data.len().saturating_sub(FOOTER as u64);
    file.seek(SeekFrom::Start(before))?;
    (&mut file).take(FOOTER as u64).read_to_end(&mut footer)?;
    if data.len() > MOST_BYTES || !fits(&footer, data.len()) {
        return Ok(Err(Damaged));
    }
    file.rewind()?;
    let mut content = Vec::with_capacity(data.len() as usize);
    (&mut file).take(data.len()).read_to_end(&mut content)?;
    let now = SystemTime::now();
    let used = data.modified().unwrap_or(now);
    if now.duration_since(used).unwrap_or_default() > NOTED {
        // A folder that can only be read keeps its times.
        let _ = file.set_modified(now);
    }
    Ok(Ok(content))
}

#[cfg(test)]
mod tests;
