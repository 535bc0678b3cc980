//! The names of image files in a folder: [`ImageNames`].

use std::path::{Path, PathBuf};

use crate::picture::image_file::format::READ;
use crate::types::images::is_image_ending;

/// Endings of the names of images in formats that are not read.
const UNREAD: [&str; 28] = [
    "heic", "heif", "hif", "avif", "gif", "jxl", "jp2", "j2k", "jpf", "psd", "tga", "ico", "ppm",
    "pgm", "pnm", "pfm", "hdr", "dng", "cr2", "cr3", "nef", "arw", "orf", "raf", "rw2", "pef",
    "srw", "svg",
];

/// The image files among some paths, and those that look like images in formats that are not read.
pub(crate) struct ImageNames {
    pub(super) images: Vec<PathBuf>,
    unread: Vec<PathBuf>,
}

impl ImageNames {
    /// Sorts paths by the endings of their names. Folders and other files are left out.
    pub(crate) fn from_paths(paths: impl IntoIterator<Item = PathBuf>) -> Self {
        let (mut images, mut unread) = (Vec::new(), Vec::new());
        for path in paths {
            if is_image(&path) {
                images.push(path);
            } else if has(&path, |ending| {
                UNREAD.contains(&&*ending.to_ascii_lowercase())
            }) {
                unread.push(path);
            }
        }
        Self { images, unread }
    }

    /// How many files look like images and are not read, with the name of the first; `None` if there are none.
    pub(super) fn unread(&self) -> Option<String> {
        let first = self.unread.first()?;
        let count = match self.unread.len() {
            1 => "1 file looks like an image and is not read".to_owned(),
            n => format!("{n} files look like images and are not read"),
        };
        let name = first.file_name().unwrap_or_default().to_string_lossy();
        Some(format!(
            "{count}, as {name}; {READ} expected, so convert them first"
        ))
    }

    /// Prints how many files of a folder look like images and are not read.
    pub(crate) fn warn_of_unread(&self, folder: &Path) {
        if let Some(unread) = self.unread() {
            tracing::warn!("{}: {unread}", folder.display());
        }
    }
}

/// Whether a path is a file with the ending of an image that is read.
pub(crate) fn is_image(path: &Path) -> bool {
    has(path, is_image_ending)
}

fn has(path: &Path, is_one: impl Fn(&str) -> bool) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(is_one) && path.is_file()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn files_are_sorted_by_their_endings() {
        let folder = tempfile::tempdir().unwrap();
        let names = [
            "a.PNG", "b.webp", "c.tiff", "d.HEIC", "e.avif", "f.txt", "g",
        ];
        let paths = names.map(|name| folder.path().join(name));
        for path in &paths {
            fs::write(path, "").unwrap();
        }
        let inner = folder.path().join("inner.png");
        fs::create_dir(&inner).unwrap();
        let names = ImageNames::from_paths(paths.into_iter().chain([inner]));
        let images: Vec<_> = names
            .images
            .iter()
            .map(|path| path.file_name().unwrap())
            .collect();
        assert_eq!(images, ["a.PNG", "b.webp", "c.tiff"]);
        assert_eq!(
            names.unread().unwrap(),
            "2 files look like images and are not read, as d.HEIC; PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected, so convert them first"
        );
        assert_eq!(
            ImageNames::from_paths([folder.path().join("f.txt")]).unread(),
            None
        );
    }
}
