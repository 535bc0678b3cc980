//! Common trait of all kinds of data sets: [`Adapter`].

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use clap::Args;
use ndarray::Array2;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::labels;
use crate::types::flags::positive;
use crate::types::{Decides, DepthKind, Intrinsics, Labels, Rgb, SegmentName, Segmentation};

/// Flags that describe the maps and the camera of a data set.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Maps")]
pub(crate) struct MapArgs {
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
pub(crate) struct ListedFrame {
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
pub(crate) struct FrameMaps {
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
pub(crate) struct Listing {
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
pub(crate) trait Adapter: fmt::Debug + Sync {
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
