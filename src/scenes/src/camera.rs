//! The camera of a frame: [`Camera`].

use glam::{Vec2, Vec3, vec3};

use super::bvh::Ray;
use super::mesh::cos_sin;
use darkqa_ground::types::Intrinsics;

/// A pinhole camera, rotated about y and tilted downwards, without roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Camera {
    pub(super) at: Vec3,
    /// Cosine and sine of the rotation about y; at an angle of 0 the camera looks along −z.
    turn: Vec2,
    /// Cosine and sine of the upward tilt.
    tilt: Vec2,
    /// Width and height of the image in pixels.
    pub(super) size: [usize; 2],
    /// The focal length in pixels.
    focal: f32,
}

/// Half of the width of the view at a distance of 1 (chosen): an angle of about 84° across.
const HALF_WIDTH: f32 = 0.9;

/// The focal length for images of a size, in pixels.
pub(super) fn focal(size: [usize; 2]) -> f32 {
    let longer = size[0].max(size[1] * 4 / 3);
    longer as f32 / 2.0 / HALF_WIDTH
}

impl Camera {
    /// A camera at a place, rotated about y and tilted downwards by angles in radians, for images of a size in pixels.
    pub(super) fn new(at: Vec3, angle: f32, tilt: f32, size: [usize; 2]) -> Self {
        Self {
            at,
            turn: cos_sin(angle),
            tilt: cos_sin(-tilt),
            size,
            focal: focal(size),
        }
    }

    /// The same view with another image size.
    pub(super) fn sized(&self, size: [usize; 2]) -> Self {
        Self {
            size,
            focal: focal(size),
            ..*self
        }
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

    /// The optical axis: the direction in which the camera looks.
    pub(super) fn axis(&self) -> Vec3 {
        self.to_room(Vec3::NEG_Z)
    }

    fn to_room(self, v: Vec3) -> Vec3 {
        let (tilt, turn) = (self.tilt, self.turn);
        let v = vec3(
            v.x,
            v.y * tilt.x - v.z * tilt.y,
            v.y * tilt.y + v.z * tilt.x,
        );
        vec3(
            v.x * turn.x + v.z * turn.y,
            v.y,
            v.z * turn.x - v.x * turn.y,
        )
    }

    /// The ray through a point of the image; whole numbers are the centers of pixels.
    pub(super) fn ray(&self, x: f32, y: f32) -> Ray {
        let [cx, cy] = self.middle();
        let direction = vec3((x - cx) / self.focal, (cy - y) / self.focal, -1.0);
        Ray::new(self.at, self.to_room(direction).normalize()).wide(1.0 / self.focal)
    }

    /// Whether a point is within the view, hidden or not.
    pub(super) fn sees(&self, place: Vec3) -> bool {
        let offset = place - self.at;
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::NEG_Z].map(|axis| offset.dot(self.to_room(axis)));
        let [half_width, half_height] = self.size.map(|side| side as f32 / 2.0 / self.focal);
        z > 0.0 && x.abs() <= half_width * z && y.abs() <= half_height * z
    }

    /// The pose as a matrix from the camera (x right, y up, z backwards) to the room, row by row.
    pub(super) fn pose(&self) -> [f32; 16] {
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|v| self.to_room(v));
        let at = self.at;
        [
            x.x, y.x, z.x, at.x, x.y, y.y, z.y, at.y, x.z, y.z, z.z, at.z, 0.0, 0.0, 0.0, 1.0,
        ]
    }
}
