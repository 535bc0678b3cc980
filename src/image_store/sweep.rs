//! Removes old entries from a store, and checks its free space: [`sweep`].

use std::fs::{self, TryLockError};
use std::io;
use std::time::{Duration, SystemTime};

use super::folder::{FileKind, StoreFolder, StoredFile};

/// Time after which an image that nobody used may leave, if there is no room; chosen. Images that were used later stay even if a new
/// one then finds no room: models go through all frames in one order, and a store that dropped the oldest of a larger set would never
/// have the next one.
const UNUSED: Duration = Duration::from_hours(14 * 24);
/// Time after which an unfinished file is one that a killed process left; chosen.
const ABANDONED: Duration = Duration::from_hours(24);

/// The result of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Swept {
    /// Bytes in the store afterwards.
    pub(super) bytes: u64,
    /// Images that were removed.
    pub(super) evicted: usize,
}

/// Removes abandoned files, and the images unused for longest while the store has more than `most` bytes. Only one process removes files
/// at a time: if another does, only the bytes are counted.
///
/// # Errors
/// If the folder cannot be read.
pub(super) fn sweep(folder: &StoreFolder, most: u64, now: SystemTime) -> io::Result<Swept> {
    let mut files = folder.files()?;
    let bytes = files.iter().map(|file| file.bytes).sum();
    let mut swept = Swept { bytes, evicted: 0 };
    let lock = folder.lock_file()?;
    match lock.try_lock() {
        Err(TryLockError::WouldBlock) => return Ok(swept),
        // Some shares have no locks. Two processes that remove the same files do no harm.
        Ok(()) | Err(TryLockError::Error(_)) => {}
    }
    files.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
    for file in &files {
        let age = now.duration_since(file.used).unwrap_or_default();
        let leaves = match file.kind {
            FileKind::Unfinished => age > ABANDONED,
            FileKind::Entry => swept.bytes > most && age > UNUSED,
        };
        if leaves && remove(file) {
            swept.bytes -= file.bytes;
            swept.evicted += usize::from(file.kind == FileKind::Entry);
        }
    }
    Ok(swept)
}

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

    /// A store with files of 100 bytes that were last used so many days ago, and their number after a sweep.
    fn left(days: &[u64], most: u64) -> Vec<u64> {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        let now = SystemTime::now();
        let key = |day: &u64| Digest::from_bytes(&day.to_le_bytes());
        for day in days {
            folder.write(&key(day), &[0; 100]).unwrap();
            let file = fs::File::options()
                .write(true)
                .open(folder.place(&key(day)))
                .unwrap();
            let used = now - Duration::from_hours(24 * day);
            file.set_modified(used).unwrap();
        }
        let swept = sweep(&folder, most, now).unwrap();
        let left: Vec<u64> = days
            .iter()
            .copied()
            .filter(|day| folder.place(&key(day)).exists())
            .collect();
        assert_eq!(swept.bytes, 100 * left.len() as u64);
        assert_eq!(swept.evicted, days.len() - left.len());
        left
    }

    #[test]
    fn only_what_was_long_unused_leaves_the_oldest_first_and_no_more_than_needed() {
        assert_eq!(left(&[0, 1, 13], 100), [0, 1, 13]);
        assert_eq!(left(&[40, 20, 3], 300), [40, 20, 3]);
        assert_eq!(left(&[20, 40, 3, 30], 200), [20, 3]);
        assert_eq!(left(&[20, 40, 3], 0), [3]);
    }

    #[test]
    fn abandoned_files_leave_and_foreign_ones_stay() {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        folder.write(&Digest::from_bytes(b"a"), &[0; 9]).unwrap();
        let inside = folder.place(&Digest::from_bytes(b"a"));
        let inside = inside.parent().unwrap();
        for name in [".tmp-other-1-0", ".tmp-other-2-0", "notes.txt"] {
            fs::write(inside.join(name), b"123").unwrap();
        }
        let later = SystemTime::now() + Duration::from_hours(25);
        let fresh = fs::File::options()
            .write(true)
            .open(inside.join(".tmp-other-2-0"))
            .unwrap();
        fresh.set_modified(later).unwrap();
        assert_eq!(sweep(&folder, 1000, later).unwrap().bytes, 9 + 3);
        assert!(!inside.join(".tmp-other-1-0").exists());
        assert!(inside.join(".tmp-other-2-0").exists());
        assert!(inside.join("notes.txt").exists());
    }

    #[test]
    fn while_another_process_removes_files_none_is_removed() {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        folder.write(&Digest::from_bytes(b"a"), &[0; 9]).unwrap();
        let later = SystemTime::now() + UNUSED + ABANDONED;
        let lock = folder.lock_file().unwrap();
        lock.lock().unwrap();
        assert_eq!(sweep(&folder, 0, later).unwrap().bytes, 9);
        drop(lock);
        assert_eq!(
            sweep(&folder, 0, later).unwrap(),
            Swept {
                bytes: 0,
                evicted: 1
            }
        );
    }
}
