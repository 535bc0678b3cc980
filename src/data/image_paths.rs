//! Image files among the paths of a folder: [`ImagePaths`].

use std::path::{Path, PathBuf};

use crate::pictures::image_file::format::SUPPORTED_FORMATS;
use crate::types::images::is_image_ending;

/// Extensions of image formats that are not supported.
const UNSUPPORTED: [&str; 28] = [
    "heic", "heif", "hif", "avif", "gif", "jxl", "jp2", "j2k", "jpf", "psd", "tga", "ico", "ppm", "pgm", "pnm", "pfm",
    "hdr", "dng", "cr2", "cr3", "nef", "arw", "orf", "raf", "rw2", "pef", "srw", "svg",
];

/// Image files in supported and in unsupported formats.
pub(crate) struct ImagePaths {
    pub(super) images: Vec<PathBuf>,
    unsupported: Vec<PathBuf>,
}

impl ImagePaths {
    /// Sorts paths by their extensions. Folders and other files are left out.
    pub(crate) fn from_paths(paths: impl IntoIterator<Item = PathBuf>) -> Self {
        let (mut images, mut unsupported) = (Vec::new(), Vec::new());
        for path in paths {
            if is_image(&path) {
                images.push(path);
            } else if is_file_with_extension(&path, |extension| UNSUPPORTED.contains(&&*extension.to_ascii_lowercase()))
            {
                unsupported.push(path);
            }
        }
        Self { images, unsupported }
    }

    /// Message with the number of unsupported images and the name of the first; `None` if all are supported.
    pub(super) fn unsupported_note(&self) -> Option<String> {
        let first = self.unsupported.first()?;
        let count = match self.unsupported.len() {
            1 => "1 file looks like an image and is not read".to_owned(),
            n => format!("{n} files look like images and are not read"),
        };
        let name = first.file_name().unwrap_or_default().to_string_lossy();
        Some(format!("{count}, as {name}; {SUPPORTED_FORMATS} expected, so convert them first"))
    }

    /// Warns if the folder has images in unsupported formats.
    pub(crate) fn warn_of_unsupported(&self, folder: &Path) {
        if let Some(note) = self.unsupported_note() {
            tracing::warn!("{}: {note}", folder.display());
        }
    }
}

/// True if the path is a file with the extension of a supported image format.
pub(crate) fn is_image(path: &Path) -> bool {
    is_file_with_extension(path, is_image_ending)
}

fn is_file_with_extension(path: &Path, is_wanted: impl Fn(&str) -> bool) -> bool {
    path.extension().and_then(|extension| extension.to_str()).is_some_and(is_wanted) && path.is_file()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn files_are_sorted_by_extension() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["a.PNG", "b.webp", "c.tiff", "d.HEIC", "e.avif", "f.txt", "g"];
        let paths = names.map(|name| folder.path().join(name));
        for path in &paths {
            fs::write(path, "").unwrap();
        }
        let inner = folder.path().join("inner.png");
        fs::create_dir(&inner).unwrap();
        let found = ImagePaths::from_paths(paths.into_iter().chain([inner]));
        let images: Vec<_> = found.images.iter().map(|path| path.file_name().unwrap()).collect();
        assert_eq!(images, ["a.PNG", "b.webp", "c.tiff"]);
        assert_eq!(
            found.unsupported_note().unwrap(),
            "2 files look like images and are not read, as d.HEIC; PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected, so convert them first"
        );
        assert_eq!(ImagePaths::from_paths([folder.path().join("f.txt")]).unsupported_note(), None);
    }
}
