//! Beds with pillows, and cushions for seats.
//!
//! Curtains, towels and rugs.

use glam::{Vec3, vec2, vec3};

use super::{FurnitureSet, add_legs};
use crate::mesh::{Mesh, Piece, Pose, cos_sin, kind};
use crate::pattern::{COMMON_COLORS, Paint, Pattern, Surface};
use crate::seeded_rng::SeededRng;

/// A bed with a blanket and one or two pillows.
pub(crate) fn bed(rng: &mut SeededRng) -> FurnitureSet {
    let is_double = rng.chance(0.6);
    let width = if is_double { rng.between(1.45, 1.7) } else { rng.between(0.95, 1.1) };
    let half = width / 2.0;
    let length = 2.05;
    let mut mesh = Mesh::default();
    let wood = Surface::wood(Paint::random(&["brown", "brown", "black"], rng), 0);
    let sheet = Surface::cloth(Paint::nameless([238, 236, 230]));
    let cover = Paint::random(&COMMON_COLORS, rng);
    let blanket = Surface::fabric(cover, rng);
    add_legs(&mut mesh, vec3(width, 0.2, length), 0.06, 0.07, &wood);
    mesh.board(half, [0.16, 0.3], [0.02, length], &wood);
    let head_height = rng.between(0.85, 1.1);
    mesh.cushion(half + 0.03, [0.1, head_height], [0.0, 0.07], 0.03, &wood);
    mesh.cushion(half - 0.02, [0.28, 0.5], [0.07, length - 0.02], 0.07, &sheet);
    // The blanket overhangs both sides and the foot of the bed. It is folded back at `fold`, measured from the head.
    let fold = rng.between(0.55, 0.7);
    mesh.cushion(half + 0.035, [0.2, 0.56], [fold, length + 0.035], 0.06, &blanket);
    mesh.cushion(
        half + 0.03,
        [0.44, 0.575],
        [fold - 0.16, fold + 0.06],
        0.05,
        &if rng.chance(0.5) { sheet } else { blanket },
    );
    let mut set = FurnitureSet::from_piece(Piece::new(kind("bed", "bed"), mesh, cover.name));
    set.size = vec3(width + 0.1, head_height, length + 0.04);
    let paint = Paint::random(&["white", "grey", "pink", "yellow", "blue", "green"], rng);
    let count = if is_double { 2 } else { 1 };
    for i in 0..count {
        let x = (i as f32 - (count as f32 - 1.0) / 2.0) * width * 0.48;
        let size = vec3(width / count as f32 * 0.8, 0.42, 0.17);
        let piece = pillow("pillow", size, 0.95, &Surface::cloth(paint), paint.name);
        set = set.with(piece, Pose::new(vec3(x, 0.56, 0.24), 0.0));
    }
    set
}

/// A pillow or cushion with its center at the origin, tilted backwards by `lean` radians.
pub(crate) fn pillow(word: &'static str, size: Vec3, lean: f32, surface: &Surface, color: &'static str) -> Piece {
    let mut mesh = Mesh::default();
    mesh.pillow(Vec3::ZERO, size, -lean, surface);
    Piece::new(kind(word, "cushion"), mesh, color)
}

/// A cushion for a sofa or a chair, with its center at the origin.
pub(crate) fn cushion(rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&COMMON_COLORS, rng);
    let mut surface = Surface::fabric(paint, rng);
    let mut name = paint.name;
    if rng.chance(0.15) {
        let other = Paint::random(&["white", "black"], rng);
        surface = surface.with_pattern(Pattern::Stripes(0.05, other.color));
        // Two colors: the cushion has no single color name.
        name = "";
    }
    let side = rng.between(0.38, 0.45);
    pillow("cushion", vec3(side, side, 0.15), 0.3, &surface, name)
}

/// The two curtains at the sides of a window of a width, from y = 0 downwards. Each is one thing; the rod belongs to
/// the first.
pub(crate) fn curtains(window: f32, drop: f32, rng: &mut SeededRng) -> [Piece; 2] {
    let paint = Paint::random(&COMMON_COLORS, rng);
    let cloth = Surface::fabric(paint, rng);
    let width = rng.between(0.42, 0.6);
    let name = kind("curtain", "curtain");
    let out = window / 2.0 - 0.08;
    [(-out - width, true), (out, false)].map(|(left, rod)| {
        let mut mesh = Mesh::default();
        mesh.drape(vec3(left, 0.0, 0.08), width, drop, 0.13, &cloth);
        if rod {
            let reach = window / 2.0 + width;
            let ends = [-reach, reach].map(|x| vec3(x, 0.02, 0.08));
            mesh.rod(ends[0], ends[1], 0.013, &Surface::steel());
        }
        Piece::new(name, mesh, paint.name)
    })
}

/// A towel over a rail on the wall, with the rail at y = 0.
pub(crate) fn towel(rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&COMMON_COLORS, rng);
    let cloth = Surface::paint(paint).with_pattern(Pattern::Pile);
    let (width, drop) = (rng.between(0.36, 0.5), rng.between(0.55, 0.75));
    let mut mesh = Mesh::default();
    for (z, share) in [(0.09, 1.0), (0.045, 0.8)] {
        let rows: [Vec<Vec3>; 3] = [0.012, -drop * share / 2.0, -drop * share].map(|y| {
            (0..=12)
                .map(|i| {
                    let x = (i as f32 / 12.0 - 0.5) * width;
                    let wave = 0.006 * cos_sin(x * 14.0).y;
                    vec3(x, y, z + wave)
                })
                .collect()
        });
        mesh.grid(&rows, &cloth);
    }
    let (a, b) = (width / 2.0, 0.0);
    mesh.board(a, [b, b + 0.022], [0.045, 0.095], &cloth);
    let steel = Surface::steel();
    let reach = width / 2.0 + 0.06;
    mesh.rod(vec3(-reach, 0.0, 0.068), vec3(reach, 0.0, 0.068), 0.01, &steel);
    for x in [-reach, reach] {
        mesh.rod(vec3(x, 0.0, 0.0), vec3(x, 0.0, 0.07), 0.012, &steel);
    }
    Piece::new(kind("towel", "towel"), mesh, paint.name)
}

/// A rug of a size, with its center at the origin.
pub(crate) fn rug(width: f32, depth: f32, rng: &mut SeededRng) -> Piece {
    let tints = [[136, 74, 62], [78, 92, 116], [166, 150, 124], [96, 104, 82], [72, 66, 74]];
    let borders = [[226, 216, 196], [70, 58, 56], [206, 188, 140]];
    let border = Surface::plain(rng.pick(&borders)).color;
    let surface = Surface::plain(rng.pick(&tints)).with_pattern(Pattern::Rug(vec2(width, depth), border));
    let mut mesh = Mesh::default();
    mesh.board(width / 2.0, [0.0, 0.012], [-depth / 2.0, depth / 2.0], &surface);
    Piece::new(kind("rug", "floor"), mesh, "")
}
