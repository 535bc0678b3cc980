//! Beds with pillows, and cushions for seats.

use glam::{Vec3, vec3};

use super::super::mesh::Mesh;
use super::super::paint::{COMMON_COLORS, Paint};
use super::super::pattern::Pattern;
use super::super::scene::{Piece, Pose, kind};
use super::super::seeded_rng::SeededRng;
use super::super::surface::Surface;
use super::{FurnitureSet, add_legs};

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
