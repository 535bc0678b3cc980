//! The camera of a frame: [`Pinhole`].
//!
//! The rendered image and maps of a frame in a compact form: [`RenderedFrame`].

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3, vec3};
use ndarray::Array2;

use super::bvh::Ray;
use super::mesh::cos_sin;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{DepthKind, Frame, FrameId, Intrinsics, Light, Rgb, SegmentName, Segmentation};

/// A pinhole camera, rotated about y and tilted downwards, without roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pinhole {
    pub(super) position: Vec3,
    /// Cosine and sine of the rotation about y; at an angle of 0 the camera looks along −z.
    yaw: Vec2,
    /// Cosine and sine of the upward tilt.
    pitch: Vec2,
    /// Width and height of the image in pixels.
    pub(super) size: [usize; 2],
    /// Focal length in pixels.
    focal: f32,
}

/// Half of the width of the view at a distance of 1 (chosen): a horizontal field of view of about 84°.
const HALF_WIDTH: f32 = 0.9;

/// Focal length for an image size, both in pixels.
pub(super) fn focal(size: [usize; 2]) -> f32 {
    let longer = size[0].max(size[1] * 4 / 3);
    longer as f32 / 2.0 / HALF_WIDTH
}

impl Pinhole {
    /// Creates a camera that is rotated about y by `angle` and tilted downwards by `tilt`, both in radians; `size` is
    /// in pixels.
    pub(super) fn new(position: Vec3, angle: f32, tilt: f32, size: [usize; 2]) -> Self {
        Self { position, yaw: cos_sin(angle), pitch: cos_sin(-tilt), size, focal: focal(size) }
    }

    /// Returns the camera with another image size.
    pub(super) fn with_size(&self, size: [usize; 2]) -> Self {
        Self { size, focal: focal(size), ..*self }
    }

    fn principal_point(&self) -> [f32; 2] {
        self.size.map(|side| (side as f32 - 1.0) / 2.0)
    }

    pub(super) fn intrinsics(&self) -> Intrinsics {
        let [cx, cy] = self.principal_point().map(f64::from);
        let focal = f64::from(self.focal);
        Intrinsics { fx: focal, fy: focal, cx, cy }
    }

    /// The optical axis: the direction in which the camera looks.
    pub(super) fn axis(&self) -> Vec3 {
        self.to_room(Vec3::NEG_Z)
    }

    /// Rotates a direction from camera to room coordinates.
    fn to_room(self, v: Vec3) -> Vec3 {
        let (pitch, yaw) = (self.pitch, self.yaw);
        let v = vec3(v.x, v.y * pitch.x - v.z * pitch.y, v.y * pitch.y + v.z * pitch.x);
        vec3(v.x * yaw.x + v.z * yaw.y, v.y, v.z * yaw.x - v.x * yaw.y)
    }

    /// Ray through a point of the image; integer coordinates are pixel centers.
    pub(super) fn ray(&self, x: f32, y: f32) -> Ray {
        let [cx, cy] = self.principal_point();
        let direction = vec3((x - cx) / self.focal, (cy - y) / self.focal, -1.0);
        Ray::new(self.position, self.to_room(direction).normalize()).with_spread(1.0 / self.focal)
    }

    /// True if a point is in the field of view, hidden or not.
    pub(super) fn is_in_view(&self, point: Vec3) -> bool {
        let offset = point - self.position;
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::NEG_Z].map(|axis| offset.dot(self.to_room(axis)));
        let [half_width, half_height] = self.size.map(|side| side as f32 / 2.0 / self.focal);
        z > 0.0 && x.abs() <= half_width * z && y.abs() <= half_height * z
    }

    /// Row-major matrix from camera coordinates (x right, y up, z backwards) to room coordinates.
    pub(super) fn pose(&self) -> [f32; 16] {
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|v| self.to_room(v));
        let at = self.position;
        [x.x, y.x, z.x, at.x, x.y, y.y, z.y, at.y, x.z, y.z, z.z, at.z, 0.0, 0.0, 0.0, 1.0]
    }
}

/// The rendered image and maps of a frame, compact enough that the cache holds all frames of the default data set.
#[derive(Debug)]
pub(super) struct RenderedFrame {
    pub(super) id: FrameId,
    pub(super) scene: String,
    pub(super) room: &'static str,
    pub(super) camera: Pinhole,
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
