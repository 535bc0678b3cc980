//! Pieces for bathrooms.

use glam::{Vec3, vec3};

use super::super::mesh::{Mesh, cos_sin, sign};
use super::super::paint::Paint;
use super::super::scene::{Piece, Pose, kind};
use super::super::seeded_rng::SeededRng;
use super::super::surface::Surface;
use super::storage::cabinet_in_paint;
use super::{FurnitureSet, parts};

fn ceramic(rng: &mut SeededRng) -> (Surface, &'static str) {
    let names = ["white", "white", "white", "pink", "green", "blue", "black"];
    let paint = Paint::random(&names, rng);
    (Surface::gloss(paint), paint.name)
}

/// A sink on a cabinet, with its tap.
pub(crate) fn vanity(rng: &mut SeededRng) -> FurnitureSet {
    let names = ["brown", "brown", "grey", "blue", "green", "black"];
    let paint = Paint::random(&names, rng);
    let base = cabinet_in_paint(kind("bathroom cabinet", "cabinet"), vec3(0.8, 0.74, 0.48), 2, paint);
    FurnitureSet::from_piece(base).with(parts::piece("sink:3", rng), Pose::new(vec3(0.0, 0.74, 0.0), 0.0))
}

/// A bathtub along the wall, open above.
pub(crate) fn bathtub(rng: &mut SeededRng) -> Piece {
    let (white, name) = ceramic(rng);
    let steel = Surface::steel();
    let (length, height, depth) = (rng.between(1.55, 1.75), 0.56, 0.74);
    let mut mesh = Mesh::default();
    let outside = [(0.0, -0.03), (height - 0.04, -0.005)];
    let rim = [(height - 0.04, 0.0), (height - 0.01, 0.012), (height, 0.0), (height, -0.06)];
    let inside = [(height, -0.06), (height * 0.5, -0.1), (0.16, -0.18), (0.13, -0.3)];
    for profile in [&outside[..], &rim, &inside] {
        let rings: Vec<Vec<Vec3>> = profile
            .iter()
            .map(|(y, grow)| {
                let middle = vec3(0.0, *y, depth / 2.0);
                ring(middle, length / 2.0 + grow, depth / 2.0 + grow)
            })
            .collect();
        mesh.grid(&rings, &white);
    }
    mesh.quad(
        [
            vec3(-length / 2.0 + 0.2, 0.135, 0.2),
            vec3(-length / 2.0 + 0.2, 0.135, depth - 0.2),
            vec3(length / 2.0 - 0.2, 0.135, depth - 0.2),
            vec3(length / 2.0 - 0.2, 0.135, 0.2),
        ],
        &white,
    );
    let tap = vec3(length / 2.0 - 0.08, height, depth / 2.0);
    mesh.rod(tap, tap + vec3(0.0, 0.16, 0.0), 0.018, &steel);
    mesh.rod(tap + vec3(0.0, 0.15, 0.0), tap + vec3(-0.16, 0.12, 0.0), 0.014, &steel);
    Piece::new(kind("bathtub", "bathtub"), mesh, name)
}

/// The points of a closed horizontal rectangle with round corners.
fn ring(middle: Vec3, half_width: f32, half_depth: f32) -> Vec<Vec3> {
    let radius = 0.16_f32.min(half_depth * 0.8);
    let mut points: Vec<Vec3> = (0..24)
        .map(|i| {
            let around = cos_sin(std::f32::consts::TAU * (i as f32 + 0.5) / 24.0);
            middle
                + vec3(
                    sign(around.x) * (half_width - radius) + around.x * radius,
                    0.0,
                    sign(around.y) * (half_depth - radius) + around.y * radius,
                )
        })
        .collect();
    points.push(points[0]);
    points
}
