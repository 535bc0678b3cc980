//! Parametric furniture: each function makes one piece, or a [`FurnitureSet`] of pieces that belong together.

pub(super) mod beds;
pub(super) mod fixtures;
pub(super) mod parts;
pub(super) mod plants;
pub(super) mod seats;
pub(super) mod storage;
pub(super) mod walls;

use glam::{Vec3, vec3};

use super::mesh::{Mesh, Piece, Pose, bounds};
use super::pattern::Surface;

/// Pieces that belong together, each with its pose within the set. A set is placed like one piece.
#[derive(Debug, Clone, Default)]
pub(super) struct FurnitureSet {
    pub(super) pieces: Vec<(Piece, Pose)>,
    /// Width, height and depth in metres.
    pub(super) size: Vec3,
}

impl FurnitureSet {
    /// Creates a set of one piece. Its size is a box from y = 0 and z = 0, symmetric about x = 0, that contains the
    /// piece.
    pub(super) fn from_piece(piece: Piece) -> Self {
        let [low, high] = bounds(&piece.mesh.faces);
        let width = 2.0 * high.x.max(-low.x);
        let size = vec3(width, high.y, high.z);
        Self { pieces: vec![(piece, Pose::new(Vec3::ZERO, 0.0))], size }
    }

    /// Returns the set with one more piece; `size` stays the same.
    pub(super) fn with(mut self, piece: Piece, pose: Pose) -> Self {
        self.pieces.push((piece, pose));
        self
    }
}

/// Adds four square legs under a plate. `size` is the width of the plate, the height of the legs, and the depth of the
/// plate.
fn add_legs(mesh: &mut Mesh, size: Vec3, inset: f32, thick: f32, surface: &Surface) {
    for (x, z) in [(-1.0, 0.0), (1.0, 0.0), (-1.0, 1.0), (1.0, 1.0)] {
        let foot = vec3(x * (size.x / 2.0 - inset), 0.0, inset + z * (size.z - 2.0 * inset));
        mesh.slab(foot, vec3(thick, size.y, thick), surface);
    }
}
