//! Reads and writes of an image store: [`ImageStore`].
//!
//! Counts of the reads and writes of this process: [`StoreCounts`].
//!
//! Flags of the image store: [`StoreArgs`].

#[cfg(test)]
mod tests;

use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};
use std::{fmt, fs};

use clap::Args;

use super::entry::{Damaged, Entry, EntryType, FOOTER, ImageSet, Key, StoredKinds, is_footer_valid};
use super::folder::{StoreFolder, if_exists, sweep};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, FolderAccess};
use darkqa_base::types::Decides;
use darkqa_base::types::flags::positive;

/// Maximum number of written bytes between two sweeps; chosen.
const SWEEP_AFTER: u64 = 1_000_000_000;

/// Divisor of the store's capacity that gives the bytes between two sweeps of a small store; chosen.
const SWEEP_SHARE: u64 = 8;

/// Maximum size, in bytes, of a file that is read; chosen (an image of 100 megapixels has a third).
const MAX_BYTES: u64 = 1 << 30;

/// Age of a file's time from which on a read updates it: a day, so that reads cause few writes.
const TOUCH_AFTER: Duration = Duration::from_hours(24);

/// A folder of images that is shared with other runs, processes and threads.
#[derive(Debug)]
pub struct ImageStore {
    /// The folder as the user wrote it.
    argument: PathBuf,
    folder: StoreFolder,
    kinds: StoredKinds,
    /// Maximum size of all files together, in bytes.
    capacity: u64,
    state: Mutex<StoreState>,
}

#[derive(Debug, Default)]
struct StoreState {
    counts: StoreCounts,
    /// Bytes in the store, as far as this process knows.
    bytes: u64,
    /// Bytes offered for writing since the last sweep.
    offered: u64,
    health: Health,
}

/// Usability of the store, from best to worst. The user is warned when it gets worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
enum Health {
    #[default]
    Usable,
    /// Writing has failed.
    ReadOnly,
    /// Reading has failed.
    Unusable,
}

impl ImageStore {
    /// Opens a store of at most `capacity` bytes, and sweeps it. A missing folder is created with this access.
    ///
    /// # Errors
    /// If the folder cannot be created or read.
    pub fn open(folder: &Path, access: FolderAccess, kinds: StoredKinds, capacity: u64) -> Result<Self> {
        let store = Self {
            argument: folder.to_owned(),
            folder: StoreFolder::new(folder, access),
            kinds,
            capacity,
            state: Mutex::default(),
        };
        let swept =
            store.folder.create().and_then(|()| sweep(&store.folder, capacity, SystemTime::now())).map_err(|e| {
                let folder = folder.display();
                let problem = format_args!(
                    "cannot use the folder {folder}: {e}; name a folder that can be written to, or leave the flag out"
                );
                Error::usage("--images-cache", problem)
            })?;
        store.with_state(|state| {
            state.bytes = swept.bytes;
            state.counts.evicted = swept.evicted;
        });
        Ok(store)
    }

    /// Kinds of images that the store keeps.
    pub fn kinds(&self) -> StoredKinds {
        self.kinds
    }

    /// Images read and written so far, as a line for `--timings`.
    pub fn summary(&self) -> String {
        let (counts, bytes) = self.with_state(|state| (state.counts, state.bytes));
        let folder = self.argument.display();
        let [held, most] = [bytes, self.capacity].map(|bytes| bytes as f64 / 1e9);
        format!("image store {folder}: {counts}; it holds {held:.2} of {most} GB")
    }

    #[cfg(test)]
    pub(super) fn counts(&self) -> StoreCounts {
        self.with_state(|state| state.counts)
    }

    /// True if the store has a file for this key, which may be damaged.
    pub fn contains(&self, key: &Key) -> bool {
        self.with_state(|state| state.health) != Health::Unusable && self.folder.path(key.digest()).is_file()
    }

    /// Reads the entry of a key; `None` if it is missing. A damaged entry is removed and counts as missing, like an
    /// entry for which `is_sufficient` is false. Hits and misses are counted for images only.
    pub fn get(&self, key: &Key, content: EntryType, is_sufficient: impl FnOnce(&Entry) -> bool) -> Option<Entry> {
        if self.with_state(|state| state.health) == Health::Unusable {
            return None;
        }
        let place = self.folder.path(key.digest());
        let entry = match if_exists(read(&place)) {
            Ok(None) => None,
            Ok(Some(file)) => {
                let entry = file.and_then(|file| Entry::decode(key, file));
                if entry.is_err() {
                    self.remove_damaged(&place);
                }
                entry.ok().filter(is_sufficient)
            }
            Err(e) => {
                self.degrade(Health::Unusable, "read", &e);
                None
            }
        };
        self.with_state(|state| match (content, &entry) {
            (EntryType::Measures | EntryType::Probe | EntryType::Thumbnail, Some(entry)) => {
                state.counts.facts += 1;
                state.counts.saved_ms += entry.facts.milliseconds;
            }
            (EntryType::Measures | EntryType::Probe | EntryType::Thumbnail, None) => {}
            (EntryType::Image, Some(entry)) => {
                state.counts.hits += 1;
                state.counts.hit_bytes += entry.image.len() as u64;
                state.counts.saved_ms += entry.facts.milliseconds;
            }
            (EntryType::Image, None) => state.counts.misses += 1,
        });
        entry
    }

    /// Removes a damaged file, with a warning about the first one.
    fn remove_damaged(&self, place: &Path) {
        let bytes = place.symlink_metadata().map_or(0, |file| file.len());
        // If removal fails, the image that is computed now replaces the file.
        let _ = fs::remove_file(place);
        let count = self.with_state(|state| {
            state.bytes = state.bytes.saturating_sub(bytes);
            state.counts.damaged += 1;
            state.counts.damaged
        });
        if count == 1 {
            let file = place.display();
            tracing::warn!("--images-cache: {file} is damaged, and made again; so is each further one");
        }
    }

    /// Writes the entry of a key, if the store has room.
    pub fn put(&self, key: &Key, entry: &Entry) {
        if self.with_state(|state| state.health) != Health::Usable {
            return;
        }
        let file = entry.encode(key);
        let bytes = file.len() as u64;
        if !self.make_room(bytes) {
            let count = self.with_state(|state| {
                state.counts.left_out += 1;
                state.counts.left_out
            });
            if count == 1 {
                let (folder, most) = (self.argument.display(), self.capacity as f64 / 1e9);
                tracing::warn!(
                    "--images-cache: {folder} is full, and no image in it is unused for 14 days; further ones are not stored; a larger \
                     --images-cache size than {most} makes room"
                );
            }
            return;
        }
        match self.folder.write(key.digest(), &file) {
            Ok(()) => self.with_state(|state| {
                state.bytes += bytes;
                if entry.facts.shown.content == EntryType::Image {
                    state.counts.written += 1;
                    state.counts.written_bytes += bytes;
                }
            }),
            Err(e) => self.degrade(Health::ReadOnly, "write to", &e),
        }
    }

    /// Makes room for a file of this size, sweeping the store at intervals; returns false if it is full.
    fn make_room(&self, bytes: u64) -> bool {
        let period = SWEEP_AFTER.min(self.capacity / SWEEP_SHARE);
        let is_due = self.with_state(|state| {
            state.offered += bytes;
            let is_due = state.offered >= period;
            if is_due {
                state.offered = 0;
            }
            is_due
        });
        if is_due {
            // Leave room for the files until the next sweep.
            let max_bytes = self.capacity.saturating_sub(period.max(bytes));
            match sweep(&self.folder, max_bytes, SystemTime::now()) {
                Ok(swept) => self.with_state(|state| {
                    state.bytes = swept.bytes;
                    state.counts.evicted += swept.evicted;
                }),
                Err(e) => self.degrade(Health::ReadOnly, "sweep", &e),
            }
        }
        self.with_state(|state| state.health == Health::Usable && state.bytes + bytes <= self.capacity)
    }

    /// Lowers the health of the store after a failed `action`, with one warning for each level.
    fn degrade(&self, health: Health, action: &str, problem: &io::Error) {
        let previous = self.with_state(|state| {
            let worse = state.health.max(health);
            std::mem::replace(&mut state.health, worse)
        });
        if previous < health {
            let folder = self.argument.display();
            let goes_on = match health {
                Health::Unusable => "all images are made here",
                Health::ReadOnly | Health::Usable => "no more images are stored there",
            };
            tracing::warn!("--images-cache: cannot {action} {folder}: {problem}; {goes_on}");
        }
    }

    fn with_state<T>(&self, action: impl FnOnce(&mut StoreState) -> T) -> T {
        action(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Reads a file, and updates its time as a sign of use. A file that is too large, or has no valid footer, counts as
/// damaged.
fn read(path: &Path) -> io::Result<Result<Vec<u8>, Damaged>> {
    let mut file = files::open(path)?;
    let data = file.metadata()?;
    let mut footer = Vec::new();
    let before = data.len().saturating_sub(FOOTER as u64);
    file.seek(SeekFrom::Start(before))?;
    (&mut file).take(FOOTER as u64).read_to_end(&mut footer)?;
    if data.len() > MAX_BYTES || !is_footer_valid(&footer, data.len()) {
        return Ok(Err(Damaged));
    }
    file.rewind()?;
    let mut content = Vec::with_capacity(data.len() as usize);
    (&mut file).take(data.len()).read_to_end(&mut content)?;
    let now = SystemTime::now();
    let used = data.modified().unwrap_or(now);
    if now.duration_since(used).unwrap_or_default() > TOUCH_AFTER {
        // Fails in a read-only folder, where times cannot be updated.
        let _ = file.set_modified(now);
    }
    Ok(Ok(content))
}

/// Numbers of images read, written and left out, with their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct StoreCounts {
    /// Images that were read from the store.
    pub hits: usize,
    /// Bytes of these images.
    pub hit_bytes: u64,
    /// Measures, thumbnails and probe results that were read.
    pub facts: usize,
    /// Time saved by reading: the time that the entries took to compute, in milliseconds.
    pub saved_ms: u64,
    /// Images that the store did not have.
    pub misses: usize,
    /// Images that were written to the store.
    pub written: usize,
    /// Bytes of their files.
    pub written_bytes: u64,
    /// Images that the store had no room for.
    pub left_out: usize,
    /// Images whose files were damaged or exchanged, and therefore removed.
    pub damaged: usize,
    /// Images that were removed because they had been unused for long.
    pub evicted: usize,
}

impl fmt::Display for StoreCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} images read ({:.1} MB), {} measures and small copies; these took {:.1} s to make; {} written ({:.1} MB)",
            self.hits,
            self.hits + self.misses,
            self.hit_bytes as f64 / 1e6,
            self.facts,
            self.saved_ms as f64 / 1e3,
            self.written,
            self.written_bytes as f64 / 1e6,
        )?;
        for (count, what) in [
            (self.left_out, "not stored because the store is full (--images-cache size)"),
            (self.damaged, "damaged and made again"),
            (self.evicted, "removed that nobody had used for 14 days"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
    }
}

/// Flags of the folder in which images are kept for other runs.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Scale")]
pub struct StoreArgs {
    /// Folder of stored images, shared by runs, models, shards and processes; it may be deleted at any time;
    /// `darkqa-eval cache DIR` lists it; default: no image is stored
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub images_cache: Option<PathBuf>,
    /// Images to store
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = StoredKinds::Enhanced, add = Decides::Nothing)]
    pub images_cache_what: StoredKinds,
    /// Maximum size in GB (10⁹ bytes); when it is reached, images unused for 14 days are removed; if there are none, no
    /// image is added
    #[arg(long, value_name = "GB", value_parser = positive, default_value = "20", add = Decides::Nothing)]
    pub images_cache_size: f64,
}

impl StoreArgs {
    /// An empty estimate of the images that the store would keep; `None` without a store.
    pub fn image_set(&self) -> Option<ImageSet> {
        let set = ImageSet::new(self.images_cache_what, self.images_cache_size * 1e9);
        self.images_cache.is_some().then_some(set)
    }

    /// Opens the store; `None` if the flags name no folder.
    ///
    /// # Errors
    /// If the folder cannot be created or read.
    pub fn open(&self, access: FolderAccess) -> Result<Option<ImageStore>> {
        let bytes = (self.images_cache_size * 1e9) as u64;
        self.images_cache
            .as_deref()
            .map(|folder| ImageStore::open(folder, access, self.images_cache_what, bytes))
            .transpose()
    }
}
