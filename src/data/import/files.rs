//! Lists of files in a folder, and readers for images, maps and numbers.
//!
//! Common trait of all kinds of data sets: [`Adapter`].
//!
//! Map files of a frame: [`MapFiles`].

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use clap::Args;
use ndarray::Array2;
use serde_json::Value;

use crate::maps::{DepthFile, millimetres};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{bytes, entries, text};
use darkqa_base::labels;
use darkqa_base::types::flags::positive;
use darkqa_base::types::{Decides, DepthKind, Intrinsics, Labels, Rgb, SegmentName, Segmentation};
use darkqa_pictures::decode_rule::MAX_PIXELS;
use darkqa_pictures::hdf5::Hdf5Array;
use darkqa_pictures::npy::Npy;
use darkqa_pictures::raw_png::{RawPng, SampleForm};
use darkqa_pictures::{DecodeRule, ImageFile};

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
fn read_classes(path: &Path) -> Result<Array2<u16>> {
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

/// Flags that describe the maps and the camera of a data set.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Maps")]
pub struct MapArgs {
    /// The label space of the class maps: nyu40, nyu40-1 (from 0, 255 for void; kind nyu), nyu13, mpcat40, ade150, or a
    /// classes.json; default: that of the kind of data set
    #[arg(long, value_name = "NAME|FILE", add = Decides::Pixels)]
    pub labels: Option<String>,
    /// The metres in one unit of depth: 0.001 for millimetres, 0.0002 for 1/5000 m, 10 if habitat-lab scaled 10 m to
    /// 0..1; default: that of the kind of data set, 1 for floats in .npy and HDF5
    #[arg(long, value_name = "METRES", value_parser = positive, add = Decides::Pixels)]
    pub depth_scale: Option<f64>,
    /// What depth is measured along; default: planar
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub depth_kind: Option<DepthKind>,
    /// The horizontal field of view in degrees, if the data set does not state it; default: not known
    #[arg(long, value_name = "DEGREES", value_parser = degrees, add = Decides::Pixels)]
    pub hfov: Option<f64>,
}

/// Parses a field of view in degrees.
fn degrees(text: &str) -> Result<f64, String> {
    positive(text)
        .ok()
        .filter(|degrees| *degrees < 180.0)
        .ok_or_else(|| "a number above 0 and below 180 expected".to_owned())
}

/// A frame of a data set; its maps are not read yet.
#[derive(Debug, Clone, PartialEq)]
pub struct ListedFrame {
    pub scene: String,
    /// Name of the frame in its scene.
    pub frame: String,
    /// Time in seconds; the origin is arbitrary.
    pub time: Option<f64>,
    /// Pose of the camera: the matrix from camera to world, row by row.
    pub pose: Option<Vec<f64>>,
    /// Intrinsics of the camera, in pixels of the image.
    pub intrinsics: Option<Intrinsics>,
    /// Room type, if the data set states one.
    pub room: Option<String>,
    /// Path of the image.
    pub rgb: PathBuf,
    /// Index of the frame's other files in the list of the adapter.
    pub(super) index: usize,
}

impl ListedFrame {
    /// A frame without time, camera and room type.
    pub(super) fn new(scene: &str, frame: String, rgb: PathBuf, index: usize) -> Self {
        Self { scene: scene.to_owned(), frame, time: None, pose: None, intrinsics: None, room: None, rgb, index }
    }
}

/// Maps of a frame, in the size of its image.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FrameMaps {
    /// Depth in millimetres; 0 for no depth.
    pub depth: Option<Array2<u32>>,
    /// Class numbers of the label space.
    pub semantic: Option<Array2<u16>>,
    /// Segment numbers; 0 for no segment.
    pub segments: Option<Array2<u32>>,
    /// Room type, if it follows from the maps.
    pub room: Option<String>,
}

/// Contents of a data set without its maps.
#[derive(Debug, Default)]
pub struct Listing {
    /// The frames, sorted by scene and name.
    pub frames: Vec<ListedFrame>,
    /// Meaning of the numbers in semantic maps.
    pub labels: Labels,
    /// Names of segments, by scene and segment number.
    pub names: BTreeMap<String, BTreeMap<u32, SegmentName>>,
    /// Direction along which depth is measured.
    pub depth_kind: DepthKind,
    /// Kind of segments: instances or parts.
    pub segmentation: Segmentation,
    /// Object names without a known class, with the number of their objects.
    pub unlisted: BTreeMap<String, usize>,
    /// Horizontal field of view in degrees, for frames without intrinsics.
    pub hfov: Option<f64>,
    /// Record of how the data set was rendered, from `scenes.json`.
    pub renders: Option<Value>,
    /// Default camera, for images of its size.
    pub(super) sensor: Option<SizedCamera>,
}

/// Intrinsics of a camera, with the width and height of its images.
#[derive(Debug)]
pub(super) struct SizedCamera {
    pub(super) size: (usize, usize),
    pub(super) camera: Intrinsics,
}

impl Listing {
    /// An empty listing with the labels of mpcat40, for adapters that map names to these classes.
    pub(super) fn with_mpcat40(args: &MapArgs) -> Self {
        Self { labels: labels::space("mpcat40").unwrap_or_default(), hfov: args.hfov, ..Self::default() }
    }
}

/// An open data set of any kind.
pub trait Adapter: fmt::Debug + Sync {
    /// Contents of the data set without its maps.
    fn listing(&self) -> &Listing;

    /// Intrinsics of a frame's camera, in pixels of its image: from the frame, else from `--hfov`, else of the default
    /// camera.
    fn camera(&self, frame: &ListedFrame, rgb: &Rgb) -> Option<Intrinsics> {
        let (width, height) = (rgb.width(), rgb.height());
        let Listing { hfov, sensor, .. } = self.listing();
        let from_flag = hfov.map(|hfov| pinhole(width, height, hfov));
        let default = sensor.as_ref().filter(|sensor| sensor.size == (width, height)).map(|sensor| sensor.camera);
        frame.intrinsics.or(from_flag).or(default)
    }

    /// Name of the folder with the depth map of a frame, for data sets with several depth maps per frame; `None` for
    /// others.
    fn depth_folder(&self, _frame: &ListedFrame) -> Option<&'static str> {
        None
    }

    /// True if depth is taken as metres, because nothing states its unit: neither a publisher's page nor
    /// `--depth-scale`.
    fn assumes_metres(&self) -> bool {
        false
    }

    /// Files that are read besides the images: maps, and files about scenes or the data set.
    fn other_files(&self) -> Vec<PathBuf>;

    /// Reads the maps of a frame; `rgb` is its image.
    ///
    /// # Errors
    /// If a file cannot be read or has an unexpected format or size; the error names it.
    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps>;
}

/// Label space given with `--labels`, a built-in one or a file; `None` without the flag.
pub(super) fn labels(args: &MapArgs) -> Result<Option<Labels>> {
    let Some(name) = &args.labels else {
        return Ok(None);
    };
    if let Some(labels) = labels::space(name) {
        return Ok(Some(labels));
    }
    let path = Path::new(name);
    if path.is_file() {
        return labels::read(path).map(Some);
    }
    let known = labels::names().join(", ");
    let problem = format_args!("{name:?} is neither a file nor one of the built-in label spaces: {known}");
    Err(Error::usage("--labels", problem))
}

/// Number of each canonical class.
pub(super) fn class_numbers(labels: &Labels) -> BTreeMap<String, u16> {
    labels.labels.iter().map(|(id, label)| (label.canonical.clone(), *id)).collect()
}

/// Pinhole camera with a horizontal field of view in degrees, square pixels and the principal point in the middle of
/// the image.
fn pinhole(width: usize, height: usize, hfov: f64) -> Intrinsics {
    let focal = width as f64 / 2.0 / libm::tan(hfov.to_radians() / 2.0);
    Intrinsics { fx: focal, fy: focal, cx: (width as f64 - 1.0) / 2.0, cy: (height as f64 - 1.0) / 2.0 }
}

/// Paths of the maps that a frame has, one file per map.
#[derive(Debug)]
pub(super) struct MapFiles {
    pub(super) depth: Option<PathBuf>,
    pub(super) classes: Option<PathBuf>,
    pub(super) segments: Option<PathBuf>,
}

impl MapFiles {
    /// Paths of all maps of several frames.
    pub(super) fn paths(all: &[Self]) -> impl Iterator<Item = &PathBuf> {
        all.iter().flat_map(|maps| [&maps.depth, &maps.classes, &maps.segments]).flatten()
    }

    /// Reads the maps. `depth_scale` is metres per unit of depth, as for [`read_frame_depth`].
    ///
    /// # Errors
    /// If a file cannot be read or does not have the size of the image.
    pub(super) fn read(&self, depth_scale: Option<f64>, rgb: &Rgb) -> Result<FrameMaps> {
        let mut maps =
            FrameMaps { depth: read_frame_depth(self.depth.as_deref(), depth_scale, rgb)?, ..FrameMaps::default() };
        if let Some(path) = &self.classes {
            let classes = read_classes(path)?;
            check_same_size(path, &classes, rgb)?;
            maps.semantic = Some(classes);
        }
        if let Some(path) = &self.segments {
            let segments = read_segments(path)?;
            check_same_size(path, &segments, rgb)?;
            maps.segments = Some(segments);
        }
        Ok(maps)
    }
}
