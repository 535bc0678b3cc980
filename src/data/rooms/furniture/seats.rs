//! Chairs, stools, armchairs and sofas.
//!
//! Tables and desks.

use glam::{Vec3, vec3};

use super::beds::cushion;
use super::{FurnitureSet, add_legs};
use crate::mesh::{Mesh, Piece, Pose, ThingKind, kind};
use crate::pattern::{COMMON_COLORS, Paint, Surface};
use crate::seeded_rng::SeededRng;

/// A chair with four legs and a back.
pub(crate) fn chair(name: ThingKind, paint: Paint, rng: &mut SeededRng) -> Piece {
    let surface = if rng.chance(0.5) { Surface::wood(paint, 1) } else { Surface::gloss(paint) };
    let back = if rng.chance(0.5) { ChairBack::Closed } else { ChairBack::Slats };
    chair_with_back(name, paint, &surface, back)
}

/// Kind of back of a chair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ChairBack {
    Slats,
    Closed,
}

/// A chair with a given kind of back.
pub(crate) fn chair_with_back(name: ThingKind, paint: Paint, surface: &Surface, back: ChairBack) -> Piece {
    let mut mesh = Mesh::default();
    let (width, depth, seat) = (0.44, 0.44, 0.45);
    let half = width / 2.0;
    add_legs(&mut mesh, vec3(width, seat, depth), 0.03, 0.04, surface);
    mesh.cushion(half, [seat - 0.03, seat + 0.025], [0.0, depth], 0.02, surface);
    let top = 0.94;
    let post = vec3(0.04, top - seat, 0.04);
    mesh.mirrored_slabs(vec3(half - 0.03, seat, 0.03), post, surface);
    if back == ChairBack::Slats {
        mesh.cushion(half, [top - 0.12, top], [0.01, 0.05], 0.015, surface);
        for i in -2..=2 {
            let x = i as f32 * 0.075;
            mesh.slab(vec3(x, seat, 0.03), vec3(0.026, top - seat - 0.06, 0.018), surface);
        }
    } else {
        mesh.cushion(half, [seat + 0.1, top], [0.01, 0.055], 0.02, surface);
    }
    Piece::new(name, mesh, paint.name)
}

/// A sofa for a number of people, with cushions.
pub(crate) fn sofa(seats: usize, rng: &mut SeededRng) -> FurnitureSet {
    let paint = Paint::random(&COMMON_COLORS, rng);
    let mut set = FurnitureSet::from_piece(upholstered(kind("sofa", "sofa"), seats, paint, rng));
    let width = set.size.x;
    for x in [-1.0, 1.0] {
        if rng.chance(0.55) {
            let mut piece = cushion(rng);
            if piece.color == paint.name {
                piece = cushion(rng);
            }
            set = set.with(piece, Pose::new(vec3(x * (width / 2.0 - 0.42), 0.64, 0.36), x * -0.2));
        }
    }
    set
}

pub(crate) fn armchair(rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&COMMON_COLORS, rng);
    upholstered(kind("armchair", "chair"), 1, paint, rng)
}

/// An armchair or sofa with this number of seats.
fn upholstered(name: ThingKind, seats: usize, paint: Paint, rng: &mut SeededRng) -> Piece {
    let cloth = Surface::fabric(paint, rng);
    let foot = Surface::plain([64, 44, 30]);
    let seat = rng.between(0.6, 0.68);
    let arm = rng.between(0.14, 0.2);
    let width = seats as f32 * seat + 2.0 * arm;
    let half = width / 2.0;
    let (depth, back) = (0.9, rng.between(0.8, 0.9));
    let mut mesh = Mesh::default();
    add_legs(&mut mesh, vec3(width, 0.12, depth), 0.07, 0.05, &foot);
    mesh.cushion(half, [0.1, 0.34], [0.02, depth], 0.04, &cloth);
    mesh.cushion(half, [0.12, back], [0.0, 0.2], 0.06, &cloth);
    for x in [-1.0, 1.0_f32] {
        let (a, b) = (x * half, x * (half - arm));
        mesh.rounded_box(vec3(a.min(b), 0.1, 0.0), vec3(a.max(b), 0.62, depth + 0.01), 0.06, &cloth);
    }
    for i in 0..seats {
        let left = -half + arm + i as f32 * seat;
        mesh.rounded_box(vec3(left + 0.004, 0.32, 0.16), vec3(left + seat - 0.004, 0.46, depth + 0.03), 0.05, &cloth);
        mesh.rounded_box(vec3(left + 0.006, 0.44, 0.13), vec3(left + seat - 0.006, back + 0.03, 0.3), 0.07, &cloth);
    }
    Piece::new(name, mesh, paint.name)
}

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
