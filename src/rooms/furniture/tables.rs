//! Tables and desks.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::mesh::Mesh;
use super::super::paint::Paint;
use super::super::scene::{Piece, ThingKind, kind};
use super::super::surface::Surface;
use super::legs;

/// The colours of tables. A colour that is listed more often is more likely.
const COLORS: [&str; 11] = [
    "brown", "brown", "brown", "white", "white", "black", "grey", "red", "green", "blue", "yellow",
];

fn finish(paint: Paint) -> Surface {
    match paint.name {
        "brown" | "white" | "black" => Surface::wood(paint, 0),
        _ => Surface::gloss(paint),
    }
}

/// A table of a size, with four legs.
pub(in super::super) fn table(name: ThingKind, size: Vec3, dice: &mut Dice) -> Piece {
    let paint = Paint::of(&COLORS, dice);
    let surface = finish(paint);
    let mut mesh = Mesh::default();
    legs(&mut mesh, size - vec3(0.0, 0.03, 0.0), 0.06, 0.06, &surface);
    mesh.board(
        size.x / 2.0 - 0.05,
        [size.y - 0.11, size.y - 0.03],
        [0.05, size.z - 0.05],
        &surface,
    );
    mesh.cushion(
        size.x / 2.0,
        [size.y - 0.035, size.y],
        [0.0, size.z],
        0.012,
        &surface,
    );
    Piece::new(name, mesh, paint.name)
}

/// A round table on one foot.
pub(in super::super) fn round(name: ThingKind, radius: f32, height: f32, dice: &mut Dice) -> Piece {
    let paint = Paint::of(&COLORS, dice);
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
        &surface,
    );
    Piece::new(name, mesh, paint.name)
}

/// A desk with drawers on one side.
pub(in super::super) fn desk(dice: &mut Dice) -> Piece {
    let paint = Paint::of(&COLORS, dice);
    let surface = finish(paint);
    let knob = Surface::steel();
    let (width, height, depth) = (dice.between(1.25, 1.55), 0.75, 0.68);
    let half = width / 2.0;
    let mut mesh = Mesh::default();
    mesh.cushion(half, [height - 0.04, height], [0.0, depth], 0.01, &surface);
    mesh.block(
        vec3(-half + 0.02, 0.0, 0.02),
        vec3(-half + 0.05, height - 0.03, depth - 0.03),
        &surface,
    );
    let (left, right) = (half - 0.44, half - 0.02);
    mesh.block(
        vec3(left, 0.04, 0.02),
        vec3(right, height - 0.03, depth - 0.04),
        &surface,
    );
    for i in 0..3 {
        let low = 0.06 + i as f32 * 0.215;
        mesh.block(
            vec3(left + 0.01, low, depth - 0.04),
            vec3(right - 0.01, low + 0.2, depth - 0.02),
            &surface,
        );
        let middle = vec3(f32::midpoint(left, right), low + 0.12, depth - 0.01);
        mesh.rod(
            middle - vec3(0.06, 0.0, 0.0),
            middle + vec3(0.06, 0.0, 0.0),
            0.008,
            &knob,
        );
    }
    mesh.block(
        vec3(-half + 0.05, 0.35, 0.03),
        vec3(left, height - 0.04, 0.05),
        &surface,
    );
    Piece::new(kind("desk", "table"), mesh, paint.name)
}
