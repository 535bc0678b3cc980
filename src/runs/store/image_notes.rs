//! Notes about images that other run folders have and this run lacks: [`missing_thumbnails`], [`missing_fidelity`].

use std::collections::HashSet;
use std::hash::Hash;
use std::path::Path;

use super::folder::{read_fidelity, read_thumbnails};
use darkqa_base::types::{FrameId, ImageFidelity, Thumbnail};

/// Thumbnails of wanted frames in these folders that are not `present`, without duplicates.
pub fn missing_thumbnails(
    present: &[Thumbnail],
    folders: &[&Path],
    is_wanted: impl Fn(&FrameId) -> bool,
) -> Vec<Thumbnail> {
    missing_notes(
        present,
        folders,
        read_thumbnails,
        |thumbnail| (thumbnail.frame.clone(), thumbnail.condition.clone()),
        |thumbnail| is_wanted(&thumbnail.frame),
    )
}

/// Image similarities of wanted frames in these folders that are not `present`, without duplicates.
pub fn missing_fidelity(
    present: &[ImageFidelity],
    folders: &[&Path],
    is_wanted: impl Fn(&FrameId) -> bool,
) -> Vec<ImageFidelity> {
    missing_notes(
        present,
        folders,
        read_fidelity,
        |fidelity| (fidelity.frame.clone(), fidelity.condition.clone()),
        |fidelity| is_wanted(&fidelity.frame),
    )
}

/// Wanted notes in these folders that `present` lacks, the first one for each key.
fn missing_notes<T, K: Eq + Hash>(
    present: &[T],
    folders: &[&Path],
    read: impl Fn(&Path) -> Vec<T>,
    key: impl Fn(&T) -> K,
    is_wanted: impl Fn(&T) -> bool,
) -> Vec<T> {
    let mut known: HashSet<_> = present.iter().map(&key).collect();
    folders.iter().flat_map(|folder| read(folder)).filter(|note| is_wanted(note) && known.insert(key(note))).collect()
}
