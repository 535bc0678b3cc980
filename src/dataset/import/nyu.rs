//! NYU Depth v2 as PNG files: folders of images, depth and labels that share their names, as [`super::folder`] reads them.
//!
//! The labels are those of 40 classes (`--labels nyu40`, the default; 0 is void), of 13 (`nyu13`), or of 40 counted from 0 with
//! 255 for void, as several tools write them (`nyu40-1`). Depth files exist in millimetres, in 1/5000 m and scaled to the
//! range of 16 bits, so that `--depth-scale` must say which.

use std::collections::BTreeMap;
use std::path::Path;

use super::adapter::{Adapter, Incoming, Read, Stated, labels};
use super::folder::{Folder, Offset};
use crate::error::Result;
use crate::types::{DepthKind, Intrinsics, Labels, Rgb, SegmentName};

/// The size of the Kinect's images.
const SIZE: (usize, usize) = (640, 480);
/// Its colour camera (NYU Depth v2 toolbox, `camera_params.m`).
const CAMERA: Intrinsics = Intrinsics {
    fx: 518.857_901,
    fy: 519.469_612,
    cx: 325.582_449,
    cy: 253.736_166,
};

/// The frames of a folder.
#[derive(Debug)]
pub(super) struct Nyu(Folder);

impl Nyu {
    pub(super) fn open(folder: &Path, stated: &Stated) -> Result<Self> {
        let (name, offset) = match stated.labels.as_deref() {
            None => ("nyu40", Offset::None),
            Some("nyu40-1") => ("nyu40", Offset::One),
            Some(name) => (name, Offset::None),
        };
        let said = Stated {
            labels: Some(name.to_owned()),
            ..stated.clone()
        };
        let labels = labels(&said)?.unwrap_or_default();
        Folder::of(folder, stated, labels, offset).map(Self)
    }
}

impl Adapter for Nyu {
    fn frames(&self) -> &[Incoming] {
        self.0.frames()
    }

    fn labels(&self) -> &Labels {
        self.0.labels()
    }

    fn names(&self, scene: &str) -> BTreeMap<u32, SegmentName> {
        self.0.names(scene)
    }

    fn depth_kind(&self) -> DepthKind {
        self.0.depth_kind()
    }

    fn has_segments(&self) -> bool {
        self.0.has_segments()
    }

    fn unlisted(&self) -> &BTreeMap<String, usize> {
        self.0.unlisted()
    }

    fn camera(&self, frame: &Incoming, rgb: &Rgb) -> Option<Intrinsics> {
        let whole = (rgb.width(), rgb.height()) == SIZE;
        self.0.camera(frame, rgb).or(whole.then_some(CAMERA))
    }

    fn read(&self, frame: &Incoming, rgb: &Rgb) -> Result<Read> {
        self.0.read(frame, rgb)
    }
}
