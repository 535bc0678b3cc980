//! Eviction of old entries from a store: [`sweep`].

use std::fs::{self, TryLockError};
use std::io;
use std::time::{Duration, SystemTime};

use super::folder::{FileKind, StoreFolder, StoredFile};

/// Time since the last use after which an image may be evicted from a full store; chosen. Images used more recently
/// stay even if new ones then find no room: every model goes through all frames in the same order, so a store that
/// evicted the oldest image of a larger set would never contain the next one.
const UNUSED: Duration = Duration::from_hours(14 * 24);
/// Age from which on an incomplete file counts as left behind by a killed process; chosen.
const ABANDONED: Duration = Duration::from_hours(24);

/// Result of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct SweepResult {
    /// Bytes in the store afterwards.
    pub(super) bytes: u64,
    /// Images that were removed.
    pub(super) evicted: usize,
}

/// Removes abandoned files, and the least recently used of the unused images while the store has more than `max_bytes`.
/// While another process is sweeping, the bytes are only counted.
///
/// # Errors
/// If the folder cannot be read.
pub(super) fn sweep(folder: &StoreFolder, max_bytes: u64, now: SystemTime) -> io::Result<SweepResult> {
    let mut files = folder.files()?;
    let bytes = files.iter().map(|file| file.bytes).sum();
    let mut result = SweepResult { bytes, evicted: 0 };
    let lock = folder.lock_file()?;
    match lock.try_lock() {
        Err(TryLockError::WouldBlock) => return Ok(result),
        // Some network shares have no locks, and two processes may remove the same files without harm.
        Ok(()) | Err(TryLockError::Error(_)) => {}
    }
    files.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
    for file in &files {
        let age = now.duration_since(file.used).unwrap_or_default();
        let is_removable = match file.kind {
            FileKind::Unfinished => age > ABANDONED,
            FileKind::Entry => result.bytes > max_bytes && age > UNUSED,
        };
        if is_removable && remove(file) {
            result.bytes -= file.bytes;
            result.evicted += usize::from(file.kind == FileKind::Entry);
        }
    }
    Ok(result)
}

/// Removes a file; true if it no longer exists.
fn remove(file: &StoredFile) -> bool {
    match fs::remove_file(&file.path) {
        Ok(()) => true,
        Err(e) => e.kind() == io::ErrorKind::NotFound,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::folder_access::FolderAccess;
    use crate::types::Digest;

    fn key(day: u64) -> Digest {
        Digest::from_bytes(&day.to_le_bytes())
    }

    /// Sweeps a store with files of 100 bytes that were last used this number of days ago; returns the days of the
    /// remaining files.
    fn days_after_sweep(days: &[u64], max_bytes: u64) -> Vec<u64> {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        let now = SystemTime::now();
        for day in days {
            folder.write(&key(*day), &[0; 100]).unwrap();
            let file = fs::File::options().write(true).open(folder.path(&key(*day))).unwrap();
            let used = now - Duration::from_hours(24 * day);
            file.set_modified(used).unwrap();
        }
        let result = sweep(&folder, max_bytes, now).unwrap();
        let left: Vec<u64> = days.iter().copied().filter(|day| folder.path(&key(*day)).exists()).collect();
        assert_eq!(result.bytes, 100 * left.len() as u64);
        assert_eq!(result.evicted, days.len() - left.len());
        left
    }

    #[test]
    fn oldest_unused_images_are_evicted_as_needed() {
        assert_eq!(days_after_sweep(&[0, 1, 13], 100), [0, 1, 13]);
        assert_eq!(days_after_sweep(&[40, 20, 3], 300), [40, 20, 3]);
        assert_eq!(days_after_sweep(&[20, 40, 3, 30], 200), [20, 3]);
        assert_eq!(days_after_sweep(&[20, 40, 3], 0), [3]);
    }

    #[test]
    fn abandoned_files_are_removed_and_foreign_ones_stay() {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        folder.write(&Digest::from_bytes(b"a"), &[0; 9]).unwrap();
        let path = folder.path(&Digest::from_bytes(b"a"));
        let inside = path.parent().unwrap();
        for name in [".tmp-other-1-0", ".tmp-other-2-0", "notes.txt"] {
            fs::write(inside.join(name), b"123").unwrap();
        }
        let later = SystemTime::now() + Duration::from_hours(25);
        let fresh = fs::File::options().write(true).open(inside.join(".tmp-other-2-0")).unwrap();
        fresh.set_modified(later).unwrap();
        assert_eq!(sweep(&folder, 1000, later).unwrap().bytes, 9 + 3);
        assert!(!inside.join(".tmp-other-1-0").exists());
        assert!(inside.join(".tmp-other-2-0").exists());
        assert!(inside.join("notes.txt").exists());
    }

    #[test]
    fn no_files_are_removed_while_another_process_sweeps() {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        folder.write(&Digest::from_bytes(b"a"), &[0; 9]).unwrap();
        let later = SystemTime::now() + UNUSED + ABANDONED;
        let lock = folder.lock_file().unwrap();
        lock.lock().unwrap();
        assert_eq!(sweep(&folder, 0, later).unwrap().bytes, 9);
        drop(lock);
        assert_eq!(sweep(&folder, 0, later).unwrap(), SweepResult { bytes: 0, evicted: 1 });
    }
}
