//! Built-in rooms in folders, drawn once for all tests and for all calls of the program in them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::UNIX_EPOCH;

use super::run::{Bench, PROGRAM, files};

/// The folder with the first rooms of the default seed. It is kept beside the program, for as long as this is the same
/// file.
pub fn rooms(frames: usize, size: &str) -> PathBuf {
    static DRAWING: Mutex<()> = Mutex::new(());
    let _one_at_a_time = DRAWING.lock();
    let built = fs::metadata(PROGRAM).unwrap().modified().unwrap();
    let built = built.duration_since(UNIX_EPOCH).unwrap().as_nanos();
    let all = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rooms");
    let own = all.join(built.to_string());
    if !own.exists() {
        remove_older(&all, built);
        fs::create_dir_all(&own).unwrap();
    }
    let folder = own.join(format!("{frames}-{size}"));
    if !folder.exists() {
        let made = tempfile::tempdir_in(&own).unwrap();
        let frames = frames.to_string();
        let args = ["rooms", "--out", "rooms", "--frames", &frames, "--size", size];
        let drawn = Command::new(PROGRAM).args(args).current_dir(&made).output().unwrap();
        assert!(drawn.status.success(), "{drawn:?}");
        // Another test process may have been faster.
        let moved = fs::rename(made.path().join("rooms"), &folder);
        assert!(folder.exists(), "{moved:?}");
    }
    folder
}

/// Removes the rooms of programs that were built before.
fn remove_older(all: &Path, built: u128) {
    for entry in fs::read_dir(all).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let is_older = |other: &str| other.parse().is_ok_and(|other: u128| other < built);
        if name.to_str().is_some_and(is_older) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

impl Bench {
    /// Puts the first built-in rooms into a folder here.
    pub fn rooms(&self, name: &str, frames: usize, size: &str) {
        let drawn = rooms(frames, size);
        for path in files(&drawn) {
            let own = self.path(name).join(path.strip_prefix(&drawn).unwrap());
            fs::create_dir_all(own.parent().unwrap()).unwrap();
            fs::copy(path, own).unwrap();
        }
    }
}
