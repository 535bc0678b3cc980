//! What a kind of data set gives: [`Adapter`].

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use clap::Args;
use ndarray::Array2;

use crate::error::{Error, Result};
use crate::labels;
use crate::types::Decides;
use crate::types::flag::positive;
use crate::types::{DepthKind, Intrinsics, Labels, Rgb, SegmentName, Segmentation};

/// What the user says of a data set's maps and its camera.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Maps")]
pub(crate) struct StatedArgs {
    /// The label space of the class maps: nyu40, nyu40-1 (from 0, 255 for void; kind nyu), nyu13, mpcat40, ade150, or a
    /// classes.json; default: what the kind has
    #[arg(long, value_name = "NAME|FILE", add = Decides::Pixels)]
    pub labels: Option<String>,
    /// The metres in one unit of depth PNG files: 0.001 for millimetres, 0.0002 for 1/5000 m; .npy files are in metres; default:
    /// what the kind has
    #[arg(long, value_name = "METRES", value_parser = positive, add = Decides::Pixels)]
    pub depth_scale: Option<f64>,
    /// What depth is measured along; default: planar
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub depth_kind: Option<DepthKind>,
    /// The horizontal field of view in degrees, where the data set does not say how its camera projects; default: not known
    #[arg(long, value_name = "DEGREES", value_parser = degrees, add = Decides::Pixels)]
    pub hfov: Option<f64>,
}

/// Reads a field of view.
fn degrees(text: &str) -> Result<f64, String> {
    let degrees = positive(text).ok().filter(|degrees| *degrees < 180.0);
    degrees.ok_or_else(|| "a number above 0 and below 180 expected".to_owned())
}

/// A frame that can be read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ListedFrame {
    /// Its scene.
    pub scene: String,
    /// Its name in the scene.
    pub frame: String,
    /// Its time in seconds.
    pub time: Option<f64>,
    /// Where its camera stands: the matrix from camera to world, row by row.
    pub pose: Option<Vec<f64>>,
    /// How its camera projects, in pixels of its image.
    pub intrinsics: Option<Intrinsics>,
    /// The type of its room, where the data set says it.
    pub room: Option<String>,
    /// Its image.
    pub rgb: PathBuf,
    /// The place of its other files in the adapter's own list.
    pub(super) index: usize,
}

/// The maps of a frame, of its image's size.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct FrameMaps {
    /// Depth in millimetres, 0 where there is none.
    pub depth: Option<Array2<u32>>,
    /// Numbers of the label space.
    pub semantic: Option<Array2<u16>>,
    /// Segments, 0 where there is none.
    pub segments: Option<Array2<u32>>,
    /// The type of the room, where the maps say it.
    pub room: Option<String>,
}

/// What is known of a data set without reading its maps.
#[derive(Debug, Default)]
pub(crate) struct Listing {
    /// Its frames, by scene and name.
    pub frames: Vec<ListedFrame>,
    /// What its numbers stand for.
    pub labels: Labels,
    /// What is known of each scene's segments by name.
    pub names: BTreeMap<String, BTreeMap<u32, SegmentName>>,
    /// What depth is measured along.
    pub depth_kind: DepthKind,
    /// What the segments are.
    pub segmentation: Segmentation,
    /// Words that no table has, with how many things have them.
    pub unlisted: BTreeMap<String, usize>,
    /// The horizontal field of view in degrees, of frames whose camera is not known.
    pub hfov: Option<f64>,
    /// The camera of images of its own size, where nobody says another.
    pub(super) sensor: Option<SizedCamera>,
}

/// A camera, and the width and height of its images.
#[derive(Debug)]
pub(super) struct SizedCamera {
    pub(super) size: (usize, usize),
    pub(super) camera: Intrinsics,
}

impl Listing {
    /// A data set whose labels are those of mpcat40, as adapters by name write them.
    pub(super) fn by_name(stated: &StatedArgs) -> Self {
        Self {
            labels: labels::space("mpcat40").unwrap_or_default(),
            hfov: stated.hfov,
            ..Self::default()
        }
    }
}

/// A kind of data set, opened.
pub(crate) trait Adapter: fmt::Debug + Sync {
    /// What is known of it without reading its maps.
    fn listing(&self) -> &Listing;

    /// How the camera of a frame projects, in pixels of its image.
    fn camera(&self, frame: &ListedFrame, rgb: &Rgb) -> Option<Intrinsics> {
        let (width, height) = (rgb.width(), rgb.height());
        let Listing { hfov, sensor, .. } = self.listing();
        let stated = hfov.map(|hfov| pinhole(width, height, hfov));
        let own = sensor
            .as_ref()
            .filter(|sensor| sensor.size == (width, height));
        let own = own.map(|sensor| sensor.camera);
        frame.intrinsics.or(stated).or(own)
    }

    /// Reads the maps of a frame; `rgb` is its image.
    ///
    /// # Errors
    /// With the file: one that cannot be read, or is of another form or size than it should be.
    fn read(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps>;
}

/// The label space that the user names: a built-in one, or a file.
pub(super) fn labels(stated: &StatedArgs) -> Result<Option<Labels>> {
    let Some(name) = &stated.labels else {
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
    let problem = format_args!("{name:?} is neither a file none of the built-in spaces: {known}");
    Err(Error::usage("--labels", problem))
}

/// The numbers of mpcat40 by class.
pub(super) fn numbers(labels: &Labels) -> BTreeMap<String, u16> {
    labels
        .labels
        .iter()
        .map(|(id, label)| (label.canonical.clone(), *id))
        .collect()
}

/// The camera of an image of such a size with such a horizontal field of view and square pixels, whose axis goes through the
/// middle.
fn pinhole(width: usize, height: usize, hfov: f64) -> Intrinsics {
    let focal = width as f64 / 2.0 / libm::tan(hfov.to_radians() / 2.0);
    Intrinsics {
        fx: focal,
        fy: focal,
        cx: (width as f64 - 1.0) / 2.0,
        cy: (height as f64 - 1.0) / 2.0,
    }
}
