//! Lists of files in a folder, and readers for images, maps and numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ndarray::Array2;

use crate::data::maps::{DepthFile, millimetres};
use crate::error::{Error, Result};
use crate::files::reading::{bytes, entries, text};
use crate::pictures::decode_rule::MAX_PIXELS;
use crate::pictures::hdf5::Hdf5Array;
use crate::pictures::npy::Npy;
use crate::pictures::raw_png::{RawPng, SampleForm};
use crate::pictures::{DecodeRule, ImageFile};
use crate::types::Rgb;

/// File name endings of maps.
pub(super) const MAPS: [&str; 4] = [".npy", ".hdf5", ".h5", ".png"];

/// File name endings of images.
pub(super) const IMAGES: [&str; 7] = [".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".exr"];

/// Subfolders of a folder, sorted by name.
pub(super) fn folders(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut folders = entries(folder)?;
    folders.retain(|path| path.is_dir());
    Ok(folders)
}

/// Files in a folder with one of these endings, by name without the ending. Empty if the folder does not exist.
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

/// First of these subfolders that exists.
pub(super) fn first_folder(folder: &Path, names: &[&str]) -> Option<PathBuf> {
    names.iter().map(|name| folder.join(name)).find(|path| path.is_dir())
}

/// Decodes an image of ids, ignoring its EXIF orientation.
pub(super) fn read_id_image(path: &Path) -> Result<Rgb> {
    let file = ImageFile::open(path, DecodeRule::default())?;
    file.ignoring_orientation().decode()
}

/// Last part of a path, as text.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Reads the numbers of a PNG file, which must have one of these sample formats.
pub(super) fn read_png(path: &Path, forms: &[SampleForm]) -> Result<Array2<u16>> {
    let bytes = bytes(path)?;
    decode_png(&bytes, forms).map_err(|problem| Error::data(path.display(), problem))
}

fn decode_png(bytes: &[u8], forms: &[SampleForm]) -> Result<Array2<u16>, String> {
    let png = RawPng::open(bytes, forms, MAX_PIXELS)?;
    let size = png.size;
    Array2::from_shape_vec(size, png.samples(|sample| sample)?).map_err(|e| e.to_string())
}

/// Reads a segment map from a 16-bit grey PNG file, or a `.npy` or HDF5 file of integers. Negative numbers become 0, no
/// segment.
pub(super) fn read_segments(path: &Path) -> Result<Array2<u32>> {
    if is_png(path) {
        return Ok(read_png(path, &[SampleForm::Grey16])?.mapv(u32::from));
    }
    read_integers(path, "segment")
}

/// Reads a class map from a PNG file (8-bit grey, 16-bit grey or palette), or a `.npy` or HDF5 file of integers.
/// Negative numbers become 0.
pub(super) fn read_classes(path: &Path) -> Result<Array2<u16>> {
    if is_png(path) {
        let forms = [SampleForm::Grey8, SampleForm::Grey16, SampleForm::Palette];
        return read_png(path, &forms);
    }
    read_integers(path, "class")
}

fn is_png(path: &Path) -> bool {
    has_extension(path, "png")
}

fn is_hdf5(path: &Path) -> bool {
    has_extension(path, "hdf5") || has_extension(path, "h5")
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// Name of the array in HDF5 files of maps, as in Hypersim.
const ARRAY: &str = "dataset";

/// Reads the integers of a `.npy` or HDF5 file. Negative numbers become 0. `noun` names the numbered things in errors.
fn read_integers<T: TryFrom<i128>>(path: &Path, noun: &str) -> Result<Array2<T>> {
    let bytes = bytes(path)?;
    let ids = if is_hdf5(path) {
        Hdf5Array::parse(&bytes, ARRAY).and_then(|array| convert_ids(array.numbers()?, noun))
    } else {
        Npy::parse(&bytes).and_then(|array| convert_ids(array, noun))
    };
    ids.map_err(|problem| Error::data(path.display(), problem))
}

fn convert_ids<T: TryFrom<i128>>(array: Npy<'_>, noun: &str) -> Result<Array2<T>, String> {
    let size = array.size;
    let ids = array
        .integers()?
        .map(|id| T::try_from(id.max(0)).map_err(|_| format!("{id} is too large for the number of a {noun}")))
        .collect::<Result<Vec<T>, String>>()?;
    Array2::from_shape_vec(size, ids).map_err(|e| e.to_string())
}

/// Reads the depth in millimetres, in the size of the file. `scale` is metres per unit: required for PNG, 1 by default
/// for other files.
pub(super) fn read_depth(path: &Path, scale: Option<f64>) -> Result<Array2<u32>> {
    let wrong = |problem: String| Error::data(path.display(), problem);
    if is_hdf5(path) {
        let bytes = bytes(path)?;
        return Hdf5Array::parse(&bytes, ARRAY).and_then(|array| decode_depth(array.numbers()?, scale)).map_err(wrong);
    }
    if !is_png(path) {
        let bytes = bytes(path)?;
        return Npy::parse(&bytes).and_then(|array| decode_depth(array, scale)).map_err(wrong);
    }
    let file =
        DepthFile::new(path.to_owned(), scale).map_err(|problem| wrong(problem + " (--depth-scale METRES sets it)"))?;
    let bytes = bytes(path)?;
    file.decode_any_size(&bytes).map_err(wrong)
}

/// Converts depth to millimetres. `scale` is metres per unit; without it, the numbers must be floats, in metres.
fn decode_depth(array: Npy<'_>, scale: Option<f64>) -> Result<Array2<u32>, String> {
    let size = array.size;
    let depths: Result<Vec<u32>, String> = match scale {
        Some(scale) => array.numbers().map(|units| millimetres(units, scale * 1_000.0)).collect(),
        None => array
            .floats()
            .map_err(|problem| problem + ", or the metres per unit: --depth-scale METRES")?
            .map(|metres| millimetres(metres, 1_000.0))
            .collect(),
    };
    Array2::from_shape_vec(size, depths?).map_err(|e| e.to_string())
}

/// Reads the depth of a frame in millimetres; `None` without a path. `scale` is as for [`read_depth`].
///
/// # Errors
/// If the file cannot be read or does not have the size of the image.
pub(super) fn read_frame_depth(path: Option<&Path>, scale: Option<f64>, rgb: &Rgb) -> Result<Option<Array2<u32>>> {
    let Some(path) = path else {
        return Ok(None);
    };
    let depth = read_depth(path, scale)?;
    check_same_size(path, &depth, rgb)?;
    Ok(Some(depth))
}

/// Checks that a map has the size of its image.
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

/// Reads the numbers of a text file, separated by white space.
pub(super) fn read_numbers(path: &Path) -> Result<Vec<f64>> {
    text(path)?
        .split_whitespace()
        .map(str::parse::<f64>)
        .collect::<Result<Vec<f64>, _>>()
        .map_err(|e| Error::data(path.display(), format_args!("numbers expected: {e}")))
}

/// Paths of the depth map and the other map of each frame. The depth map may be missing.
pub(super) fn map_paths(maps: &[(Option<PathBuf>, PathBuf)]) -> impl Iterator<Item = &PathBuf> {
    maps.iter().flat_map(|(depth, other)| depth.iter().chain([other]))
}
