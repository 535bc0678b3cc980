//! Tables and desks.

use glam::{Vec3, vec3};

use super::super::mesh::Mesh;
use super::super::paint::Paint;
use super::super::scene::{Piece, ThingKind};
use super::super::seeded_rng::SeededRng;
use super::super::surface::Surface;
use super::add_legs;

/// Colours of tables. A colour that is listed more often is more likely.
const COLORS: [&str; 11] =
    ["brown", "brown", "brown", "white", "black", "orange", "grey", "purple", "green", "blue", "yellow"];

fn finish(paint: Paint) -> Surface {
    match paint.name {
        "brown" | "white" | "black" => Surface::wood(paint, 0),
        _ => Surface::gloss(paint),
    }
}

/// A table of a size, with four legs.
pub(crate) fn table(name: ThingKind, size: Vec3, rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&COLORS, rng);
    let surface = finish(paint);
    let mut mesh = Mesh::default();
    add_legs(&mut mesh, size - vec3(0.0, 0.03, 0.0), 0.06, 0.06, &surface);
    mesh.board(size.x / 2.0 - 0.05, [size.y - 0.11, size.y - 0.03], [0.05, size.z - 0.05], &surface);
    mesh.cushion(size.x / 2.0, [size.y - 0.035, size.y], [0.0, size.z], 0.012, &surface);
    Piece::new(name, mesh, paint.name)
}

/// A round table on one foot.
pub(crate) fn round(name: ThingKind, radius: f32, height: f32, rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&COLORS, rng);
    let surface = finish(paint);
    let mut mesh = Mesh::default();
    mesh.lathe(
        vec3(0.0, 0.0, radius),
        &[
            (0.0, 0.025),
            (radius * 0.55, 0.02),
            (radius * 0.55, 0.0),
            (0.05, 0.06),
            (0.04, height - 0.05),
            (radius, height - 0.035),
            (radius, height),
            (0.0, height),
        ],
        1.0,
        &surface,
    );
    Piece::new(name, mesh, paint.name)
}
