//! A drawn frame of a room in little memory: [`DrawnRoom`].

use std::collections::BTreeMap;
use std::sync::Arc;

use ndarray::Array2;

use super::camera::Camera;
use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::{DepthKind, Frame, FrameId, Light, Rgb, SegmentName, Segmentation};

/// A drawn frame. The frames of the default data set fit into the cache, so that each is drawn once for its questions and its images.
#[derive(Debug)]
pub(super) struct DrawnRoom {
    pub(super) id: FrameId,
    pub(super) scene: String,
    pub(super) room: &'static str,
    pub(super) camera: Camera,
    pub(super) rgb: Arc<Rgb>,
    /// Linear light; `None` if only codes of a display are drawn.
    pub(super) light: Option<Arc<Light>>,
    /// Depth of each pixel in millimetres along the optical axis; 0 if there is none.
    pub(super) depth: Vec<u16>,
    /// Number of the thing at each pixel, from 1; 0 if there is none.
    pub(super) things: Vec<u16>,
    /// Class number by number of the thing.
    pub(super) classes: Vec<u16>,
    /// Names by number of the thing.
    pub(super) names: Arc<BTreeMap<u32, SegmentName>>,
}

impl DrawnRoom {
    /// Bytes per pixel: three for colour, two for depth, two for the thing.
    pub(super) const BYTES_PER_PIXEL: usize = 7;
    /// Further bytes per pixel of linear light.
    pub(super) const BYTES_OF_LIGHT: usize = 12;

    /// The frame with its maps, and an image of its size.
    ///
    /// # Errors
    /// If a map has another size than the image.
    pub(super) fn frame(&self, rgb: Rgb) -> Result<Frame> {
        let shape = (rgb.height(), rgb.width());
        let class = |thing: &u16| self.classes[usize::from(*thing)];
        Ok(Frame {
            id: self.id.clone(),
            scene: self.scene.clone(),
            depth: Some(self.map(shape, self.depth.iter().copied().map(u32::from))?),
            depth_kind: DepthKind::Planar,
            intrinsics: Some(self.camera.intrinsics()),
            semantic: Some(self.map(shape, self.things.iter().map(class))?),
            segments: Some(self.map(shape, self.things.iter().copied().map(u32::from))?),
            segmentation: Segmentation::Instances,
            names: Arc::clone(&self.names),
            room: Some(self.room.to_owned()),
            rgb,
        })
    }

    fn map<T>(&self, shape: (usize, usize), values: impl Iterator<Item = T>) -> Result<Array2<T>> {
        Array2::from_shape_vec(shape, values.collect())
            .map_err(|e| Error::data(format_args!("frame {}", self.id), e))
    }
}
