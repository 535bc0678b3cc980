//! The rendered image and maps of a frame in a compact form: [`RenderedFrame`].

use std::collections::BTreeMap;
use std::sync::Arc;

use ndarray::Array2;

use super::camera::Camera;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{DepthKind, Frame, FrameId, Light, Rgb, SegmentName, Segmentation};

/// The rendered image and maps of a frame, compact enough that the cache holds all frames of the default data set.
#[derive(Debug)]
pub(super) struct RenderedFrame {
    pub(super) id: FrameId,
    pub(super) scene: String,
    pub(super) room: &'static str,
    pub(super) camera: Camera,
    pub(super) rgb: Arc<Rgb>,
    /// Linear light; `None` if only 8-bit display codes are rendered.
    pub(super) light: Option<Arc<Light>>,
    /// Depth of each pixel in millimetres along the optical axis; 0 without a thing.
    pub(super) depth: Vec<u16>,
    /// Number of the thing at each pixel, from 1; 0 without a thing.
    pub(super) things: Vec<u16>,
    /// Class number of each thing, by the number of the thing.
    pub(super) classes: Vec<u16>,
    /// Name of each thing, by the number of the thing.
    pub(super) names: Arc<BTreeMap<u32, SegmentName>>,
}

impl RenderedFrame {
    /// Bytes per pixel: three for colour, two for depth and two for the thing.
    pub(super) const BYTES_PER_PIXEL: usize = 7;
    /// Additional bytes per pixel if linear light is kept.
    pub(super) const LIGHT_BYTES_PER_PIXEL: usize = 12;

    /// Returns the frame with its maps and the given image.
    ///
    /// # Errors
    /// If the image and the maps differ in size.
    pub(super) fn frame(&self, rgb: Rgb) -> Result<Frame> {
        let shape = (rgb.height(), rgb.width());
        Ok(Frame {
            id: self.id.clone(),
            scene: self.scene.clone(),
            depth: Some(self.map(shape, self.depth.iter().copied().map(u32::from))?),
            depth_kind: DepthKind::Planar,
            intrinsics: Some(self.camera.intrinsics()),
            semantic: Some(self.map(shape, self.things.iter().map(|thing| self.classes[usize::from(*thing)]))?),
            segments: Some(self.map(shape, self.things.iter().copied().map(u32::from))?),
            segmentation: Segmentation::Instances,
            names: Arc::clone(&self.names),
            room: Some(self.room.to_owned()),
            rgb,
        })
    }

    fn map<T>(&self, shape: (usize, usize), values: impl Iterator<Item = T>) -> Result<Array2<T>> {
        Array2::from_shape_vec(shape, values.collect()).map_err(|e| Error::data(format_args!("frame {}", self.id), e))
    }
}
