//! Lists of files in a folder, and readers for images, maps and numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ndarray::Array2;

use crate::dataset::maps::{DepthFile, millimetres};
use crate::error::{Error, Result};
use crate::files::reading::{bytes, entries, text};
use crate::picture::hdf5::Hdf5Array;
use crate::picture::npy::Npy;
use crate::picture::raw_png::{RawPng, SampleForm};
use crate::picture::reading_rule::MOST_PIXELS;
use crate::picture::{ImageFile, ReadingRule};
use crate::types::Rgb;

/// The endings of the names of maps.
pub(super) const MAPS: [&str; 4] = [".npy", ".hdf5", ".h5", ".png"];

/// The endings of the names of images.
pub(super) const IMAGES: [&str; 7] = [".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".exr"];

/// The folders in a folder, sorted by name.
pub(super) fn folders(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut folders = entries(folder)?;
    folders.retain(|path| path.is_dir());
    Ok(folders)
}

/// The files in a folder with one of these endings, by name without the ending. Empty if the folder does not exist.
pub(super) fn files(folder: &Path, endings: &[&str]) -> Result<BTreeMap<String, PathBuf>> {
    if !folder.is_dir() {
        return Ok(BTreeMap::new());
    }
    let mut files = BTreeMap::new();
    for path in entries(folder)?.into_iter().filter(|path| path.is_file()) {
        let name = file_name(&path);
        let lower = name.to_lowercase();
        if let Some(ending) = endings.iter().find(|ending| lower.ends_with(**ending)) {
            files.insert(name[..name.len() - ending.len()].to_owned(), path);
        }
    }
    Ok(files)
}

/// The first of these folders that exists.
pub(super) fn first_folder(folder: &Path, names: &[&str]) -> Option<PathBuf> {
    names
        .iter()
        .map(|name| folder.join(name))
        .find(|path| path.is_dir())
}

/// Reads and decodes an image of ids as it is stored.
pub(super) fn image(path: &Path) -> Result<Rgb> {
    let file = ImageFile::open(path, ReadingRule::default())?;
    file.never_turned().decode()
}

/// The last part of a path, as text.
pub(super) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The numbers in a PNG file, which must have one of these sample forms.
pub(super) fn png(path: &Path, forms: &[SampleForm]) -> Result<Array2<u16>> {
    let bytes = bytes(path)?;
    let read = || {
        let png = RawPng::open(&bytes, forms, MOST_PIXELS)?;
        let size = png.size;
        Array2::from_shape_vec(size, png.samples(|sample| sample)?).map_err(|e| e.to_string())
    };
    read().map_err(|problem| Error::data(path.display(), problem))
}

/// The numbers of segments in a 16-bit grey PNG file or a `.npy` or HDF5 file of integers; numbers below 0 become 0, no segment.
pub(super) fn segments(path: &Path) -> Result<Array2<u32>> {
    if is_png(path) {
        return Ok(png(path, &[SampleForm::Grey16])?.mapv(u32::from));
    }
    integers(path, "segment")
}

/// The numbers of classes in a PNG file of 8 or 16 bits, grey or with a palette, or a `.npy` or HDF5 file of integers; numbers below 0 become 0.
pub(super) fn classes(path: &Path) -> Result<Array2<u16>> {
    if is_png(path) {
        let forms = [SampleForm::Grey8, SampleForm::Grey16, SampleForm::Palette];
        return png(path, &forms);
    }
    integers(path, "class")
}

fn is_png(path: &Path) -> bool {
    let ending = path.extension();
    ending.is_some_and(|ending| ending.eq_ignore_ascii_case("png"))
}

fn is_hdf5(path: &Path) -> bool {
    let ending = path.extension();
    ending.is_some_and(|ending| {
        ["hdf5", "h5"]
            .iter()
            .any(|known| ending.eq_ignore_ascii_case(known))
    })
}

/// The name of the array in HDF5 files of maps, as Hypersim has it.
const ARRAY: &str = "dataset";

/// The integers in a `.npy` or HDF5 file; those below 0 become 0. `noun` is what they number.
fn integers<T: TryFrom<i128>>(path: &Path, noun: &str) -> Result<Array2<T>> {
    let bytes = bytes(path)?;
    let id = |id: i128| {
        T::try_from(id.max(0)).map_err(|_| format!("{id} is too large for the number of a {noun}"))
    };
    let read = |array: Npy<'_>| {
        let size = array.size;
        let ids = array
            .integers()?
            .map(id)
            .collect::<Result<Vec<T>, String>>()?;
        Array2::from_shape_vec(size, ids).map_err(|e| e.to_string())
    };
    let ids = if is_hdf5(path) {
        Hdf5Array::parse(&bytes, ARRAY).and_then(|array| read(array.numbers()?))
    } else {
        Npy::parse(&bytes).and_then(read)
    };
    ids.map_err(|problem| Error::data(path.display(), problem))
}

/// Depth in millimetres, in the size of the file.
pub(super) fn depth(path: &Path, scale: Option<f64>) -> Result<Array2<u32>> {
    let wrong = |problem: String| Error::data(path.display(), problem);
    if is_hdf5(path) {
        return hdf5_depth(&bytes(path)?).map_err(wrong);
    }
    let file = DepthFile::new(path.to_owned(), scale)
        .map_err(|problem| wrong(problem + " (--depth-scale METRES sets it)"))?;
    let bytes = bytes(path)?;
    file.decode_any_size(&bytes).map_err(wrong)
}

/// Depth in millimetres from metres in an HDF5 file.
fn hdf5_depth(file: &[u8]) -> Result<Array2<u32>, String> {
    let array = Hdf5Array::parse(file, ARRAY)?;
    let metres = array.numbers()?;
    let size = metres.size;
    let depths = metres
        .floats()?
        .map(|metres| millimetres(metres, 1_000.0))
        .collect::<Result<Vec<u32>, String>>()?;
    Array2::from_shape_vec(size, depths).map_err(|e| e.to_string())
}

/// Depth in millimetres, which must have the size of the image. `scale` applies to PNG files.
pub(super) fn depth_of(
    path: Option<&Path>,
    scale: Option<f64>,
    rgb: &Rgb,
) -> Result<Option<Array2<u32>>> {
    let Some(path) = path else {
        return Ok(None);
    };
    let scale = scale.filter(|_| is_png(path));
    let depth = depth(path, scale)?;
    check_same_size(path, &depth, rgb)?;
    Ok(Some(depth))
}

/// Refuses a map whose size differs from that of its image.
pub(super) fn check_same_size<T>(path: &Path, map: &Array2<T>, rgb: &Rgb) -> Result<()> {
    let (height, width) = map.dim();
    if (height, width) == (rgb.height(), rgb.width()) {
        return Ok(());
    }
    let problem = format_args!(
        "{height} × {width} pixels (height × width), but its image has {} × {}; maps of labels are never scaled",
        rgb.height(),
        rgb.width()
    );
    Err(Error::data(path.display(), problem))
}

/// The numbers in a text file, separated by white space.
pub(super) fn numbers(path: &Path) -> Result<Vec<f64>> {
    let words = text(path)?;
    let numbers = words
        .split_whitespace()
        .map(str::parse::<f64>)
        .collect::<Result<Vec<f64>, _>>();
    numbers.map_err(|e| Error::data(path.display(), format_args!("numbers expected: {e}")))
}
/// The paths of maps: of each frame a depth, which may be missing, and another map.
pub(super) fn map_paths(maps: &[(Option<PathBuf>, PathBuf)]) -> impl Iterator<Item = &PathBuf> {
    maps.iter()
        .flat_map(|(depth, other)| depth.iter().chain([other]))
}
