//! Where a room is looked at from: [`Camera`].

use glam::{Vec3, vec3};

use super::bvh::Ray;
use super::mesh::turn;
use crate::types::Intrinsics;

/// A pinhole camera that is upright but for a tilt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Camera {
    pub(super) at: Vec3,
    /// Turned about y; at 0 it looks along −z.
    pub(super) angle: f32,
    /// Turned downwards.
    pub(super) tilt: f32,
    /// Width and height of the image in pixels.
    pub(super) size: [usize; 2],
    /// The focal length in pixels.
    focal: f32,
}

/// Half of the tangent-plane's width that a camera sees at a distance of 1: about 84° across.
const HALF_WIDTH: f32 = 0.9;

impl Camera {
    /// A camera for images of a size.
    pub(super) fn new(at: Vec3, angle: f32, tilt: f32, size: [usize; 2]) -> Self {
        let longer = size[0].max(size[1] * 4 / 3);
        Self {
            at,
            angle,
            tilt,
            size,
            focal: longer as f32 / 2.0 / HALF_WIDTH,
        }
    }

    /// The same view in another size.
    pub(super) fn sized(&self, size: [usize; 2]) -> Self {
        Self::new(self.at, self.angle, self.tilt, size)
    }

    fn middle(&self) -> [f32; 2] {
        self.size.map(|side| (side as f32 - 1.0) / 2.0)
    }

    pub(super) fn intrinsics(&self) -> Intrinsics {
        let [cx, cy] = self.middle().map(f64::from);
        let focal = f64::from(self.focal);
        Intrinsics {
            fx: focal,
            fy: focal,
            cx,
            cy,
        }
    }

    /// The axis along which it looks.
    pub(super) fn axis(&self) -> Vec3 {
        self.turned(Vec3::NEG_Z)
    }

    fn turned(&self, v: Vec3) -> Vec3 {
        let (tilt, angle) = (turn(-self.tilt), turn(self.angle));
        let v = vec3(
            v.x,
            v.y * tilt.x - v.z * tilt.y,
            v.y * tilt.y + v.z * tilt.x,
        );
        vec3(
            v.x * angle.x + v.z * angle.y,
            v.y,
            v.z * angle.x - v.x * angle.y,
        )
    }

    /// The ray through a place of the image; whole numbers are the middles of pixels.
    pub(super) fn ray(&self, x: f32, y: f32) -> Ray {
        let [cx, cy] = self.middle();
        let along = vec3((x - cx) / self.focal, (cy - y) / self.focal, -1.0);
        Ray::new(self.at, self.turned(along).normalize())
    }

    /// Whether a place is within the view, hidden or not.
    pub(super) fn sees(&self, place: Vec3) -> bool {
        let way = place - self.at;
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::NEG_Z].map(|axis| way.dot(self.turned(axis)));
        let [half_width, half_height] = self.size.map(|side| side as f32 / 2.0 / self.focal);
        z > 0.0 && x.abs() <= half_width * z && y.abs() <= half_height * z
    }

    /// The pose as a matrix from the camera to the room, row by row: x to the right, y up, z backwards.
    pub(super) fn pose(&self) -> [f32; 16] {
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|v| self.turned(v));
        let at = self.at;
        [
            x.x, y.x, z.x, at.x, x.y, y.y, z.y, at.y, x.z, y.z, z.z, at.z, 0.0, 0.0, 0.0, 1.0,
        ]
    }
}
