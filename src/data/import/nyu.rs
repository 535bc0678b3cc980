//! NYU Depth v2 as PNG files: folders of images, depth and labels with the same file names, read by [`super::folder`].
//!
//! The labels have 40 classes (`--labels nyu40`, the default; 0 is void), 13 (`nyu13`), or 40 counted from 0 with 255
//! for void, as several tools write them (`nyu40-1`). Depth files exist in millimetres, in 1/5000 m and scaled to the
//! range of 16 bits, so `--depth-scale` is required.

use std::path::Path;

use super::adapter::{MapArgs, SizedCamera, labels};
use super::folder::{Folder, NumberOffset};
use crate::error::Result;
use crate::types::Intrinsics;

/// Colour camera of the Kinect (NYU Depth v2 toolbox, `camera_params.m`).
const KINECT: SizedCamera = SizedCamera {
    size: (640, 480),
    camera: Intrinsics { fx: 518.857_901, fy: 519.469_612, cx: 325.582_449, cy: 253.736_166 },
};

/// Opens a folder of PNG files.
pub(super) fn open(folder: &Path, args: &MapArgs) -> Result<Folder> {
    let (name, offset) = match args.labels.as_deref() {
        None => ("nyu40", NumberOffset::None),
        Some("nyu40-1") => ("nyu40", NumberOffset::One),
        Some(name) => (name, NumberOffset::None),
    };
    let args = &MapArgs { labels: Some(name.to_owned()), ..args.clone() };
    let labels = labels(args)?.unwrap_or_default();
    let mut set = Folder::with_labels(folder, args, labels, offset)?;
    set.listing.sensor = Some(KINECT);
    Ok(set)
}
