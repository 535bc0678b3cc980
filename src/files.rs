//! Files that a command leaves: whole, or not at all.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

use crate::error::{Error, Result};
use crate::types::Rgb;

/// An image as a PNG file, lossless at the lowest effort: 26 times faster than the usual one for 2 % more bytes.
pub(crate) fn png(image: &Rgb) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    let [width, height] = [image.width(), image.height()].map(|side| side as u32);
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(image.samples(), width, height, ExtendedColorType::Rgb8)
        .map_err(|e| Error::data("image", e))?;
    Ok(file)
}

/// Writes a file whole or not at all.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(|e| Error::file(folder, "make", e))?;
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let part = PathBuf::from(beside);
    let written = fs::File::create(&part).and_then(|mut file| file.write_all(bytes));
    written.map_err(|e| Error::file(&part, "write", e))?;
    fs::rename(&part, path).map_err(|e| Error::file(path, "write", e))
}
