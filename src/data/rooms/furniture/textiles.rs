//! Curtains, towels and rugs.

use glam::{Vec3, vec2, vec3};

use super::super::mesh::{Mesh, cos_sin};
use super::super::paint::{COMMON_COLORS, Paint};
use super::super::pattern::Pattern;
use super::super::scene::{Piece, kind};
use super::super::seeded_rng::SeededRng;
use super::super::surface::Surface;

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
