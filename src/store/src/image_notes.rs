//! Notes about images from several run folders, without duplicates: [`more_thumbnails`], [`more_fidelity`].

use std::collections::HashSet;
use std::hash::Hash;
use std::path::Path;

use super::folder::{read_fidelity, read_thumbnails};
use darkqa_ground::types::{FrameId, ImageFidelity, Thumbnail};

/// The small copies of images in these folders that are not `present`, each once, of the frames that are wanted.
pub fn more_thumbnails(
    present: &[Thumbnail],
    folders: &[&Path],
    is_wanted: impl Fn(&FrameId) -> bool,
) -> Vec<Thumbnail> {
    let place = |thumbnail: &Thumbnail| (thumbnail.frame.clone(), thumbnail.condition.clone());
    let is_wanted = |thumbnail: &Thumbnail| is_wanted(&thumbnail.frame);
    more(present, folders, read_thumbnails, place, is_wanted)
}

/// The similarities of images in these folders that are not `present`, each once, of the frames that are wanted.
pub fn more_fidelity(
    present: &[ImageFidelity],
    folders: &[&Path],
    is_wanted: impl Fn(&FrameId) -> bool,
) -> Vec<ImageFidelity> {
    let place = |image: &ImageFidelity| (image.frame.clone(), image.condition.clone());
    let is_wanted = |image: &ImageFidelity| is_wanted(&image.frame);
    more(present, folders, read_fidelity, place, is_wanted)
}

/// Notes in these folders that `present` lacks, one for each place, of the wanted frames.
fn more<T, P: Eq + Hash>(
    present: &[T],
    folders: &[&Path],
    read: impl Fn(&Path) -> Vec<T>,
    place: impl Fn(&T) -> P,
    is_wanted: impl Fn(&T) -> bool,
) -> Vec<T> {
    let mut known: HashSet<_> = present.iter().map(&place).collect();
    folders
        .iter()
        .flat_map(|folder| read(folder))
        .filter(|one| is_wanted(one) && known.insert(place(one)))
        .collect()
}
