//! Pictures, mirrors, screens, windows, blinds and doors. Lengths are in metres; the wall is at z = 0.

use glam::{Vec3, vec2, vec3};

use super::super::mesh::Mesh;
use super::super::pattern::Pattern;
use super::super::seeded_rng::SeededRng;
use super::parts;
use crate::mesh::{LightSource, Piece, ThingKind, kind};
use crate::pattern::{Paint, Surface, SurfaceFinish};

/// Adds a frame of four bars around a rectangle with its lower edge at y = 0. `bar` is the width of a bar, `thick` its
/// depth.
fn add_frame(mesh: &mut Mesh, width: f32, height: f32, bar: f32, thick: f32, surface: &Surface) {
    let (left, right) = (-width / 2.0, width / 2.0);
    for [low, high] in [
        [vec3(left - bar, -bar, 0.0), vec3(left, height + bar, thick)],
        [vec3(right, -bar, 0.0), vec3(right + bar, height + bar, thick)],
        [vec3(left, -bar, 0.0), vec3(right, 0.0, thick)],
        [vec3(left, height, 0.0), vec3(right, height + bar, thick)],
    ] {
        mesh.block(low, high, surface);
    }
}

/// Adds a vertical rectangle with its lower edge at y = 0.
fn add_sheet(mesh: &mut Mesh, width: f32, height: f32, z: f32, surface: &Surface) {
    let (left, right) = (-width / 2.0, width / 2.0);
    mesh.quad([vec3(left, 0.0, z), vec3(right, 0.0, z), vec3(right, height, z), vec3(left, height, z)], surface);
}

pub(crate) fn picture(rng: &mut SeededRng) -> Piece {
    let width = rng.between(0.25, 0.9);
    let height = (width * rng.between(0.6, 1.35)).min(0.75);
    let wood = Surface::paint(Paint::random(&["black", "brown", "grey"], rng));
    let pattern = Pattern::Painting(vec2(width, height), rng.below(100_000) as u32);
    let canvas = Surface::plain([200, 200, 200]).with_pattern(pattern);
    let mut mesh = Mesh::default();
    add_frame(&mut mesh, width, height, 0.03, 0.03, &wood);
    add_sheet(&mut mesh, width, height, 0.015, &canvas);
    Piece::new(kind("picture", "picture"), mesh, "")
}

/// A framed mirror. `width` and `height` exclude the frame.
pub(crate) fn mirror(width: f32, height: f32, rng: &mut SeededRng) -> Piece {
    let rim = Surface::gloss(Paint::random(&["black", "brown", "grey"], rng));
    let glass = Surface::plain([255, 255, 255]).with_finish(SurfaceFinish::Mirror);
    let mut mesh = Mesh::default();
    add_frame(&mut mesh, width, height, 0.025, 0.03, &rim);
    add_sheet(&mut mesh, width, height, 0.015, &glass);
    Piece::new(kind("mirror", "mirror"), mesh, "")
}

/// A flat television, with or without a foot.
pub(crate) fn television(width: f32, foot: bool) -> Piece {
    flat_screen_piece(kind("tv", "tv_monitor"), width, foot)
}

/// A computer monitor with a foot.
pub(crate) fn monitor(width: f32) -> Piece {
    flat_screen_piece(kind("monitor", "tv_monitor"), width, true)
}

fn flat_screen_piece(name: ThingKind, width: f32, foot: bool) -> Piece {
    let height = width * 0.58;
    let case = Surface::gloss(Paint::nameless([24, 24, 26]));
    let screen = Surface::plain([34, 40, 52])
        .with_pattern(Pattern::Screen(vec2(width, height)))
        .with_finish(SurfaceFinish::Glossy);
    let mut mesh = Mesh::default();
    let lift = if foot { 0.09 } else { 0.0 };
    let z = if foot { 0.1 } else { 0.0 };
    mesh.board(width / 2.0, [lift, lift + height], [z, z + 0.035], &case);
    mesh.board(width / 2.0 - 0.015, [lift + 0.02, lift + height - 0.015], [z + 0.035, z + 0.037], &screen);
    if foot {
        mesh.slab(vec3(0.0, 0.0, 0.12), vec3(width * 0.36, 0.012, 0.2), &case);
        mesh.slab(vec3(0.0, 0.0, 0.1), vec3(0.06, 0.14, 0.02), &case);
    }
    Piece::new(name, mesh, "black")
}

/// A window with the lower edge of the pane at y = 0. `daylight` is the radiance of the incoming light.
pub(crate) fn window(width: f32, height: f32, daylight: f32) -> Piece {
    let half = width / 2.0;
    let white = Surface::plain([240, 240, 238]);
    let view = Surface { color: Vec3::ONE, pattern: Pattern::Outdoors(height), finish: SurfaceFinish::Glow(1.4) };
    let mut mesh = Mesh::default();
    add_sheet(&mut mesh, width, height, 0.012, &view);
    add_frame(&mut mesh, width, height, 0.06, 0.05, &white);
    mesh.board(0.02, [0.0, height], [0.0, 0.04], &white);
    mesh.board(half, [height * 0.55, height * 0.55 + 0.03], [0.0, 0.035], &white);
    mesh.board(half + 0.1, [-0.08, -0.05], [0.0, 0.14], &white);
    let mut piece = Piece::new(kind("window", "window"), mesh, "");
    piece.light = Some(LightSource::Panel {
        corner: vec3(-half, 0.0, 0.06),
        edges: [vec3(width, 0.0, 0.0), vec3(0.0, height, 0.0)],
        normal: Vec3::Z,
        radiance: vec3(0.97, 1.0, 1.04) * daylight,
    });
    piece
}

/// Blinds in front of a window of this width and height, with the lower edge of the pane at y = 0. `share` is the
/// covered part of the height, in 0..1.
pub(crate) fn blinds(width: f32, height: f32, share: f32, rng: &mut SeededRng) -> Piece {
    let half = width / 2.0;
    let paint = Paint::random(&["white", "grey", "brown", "green", "blue", "yellow", "orange", "red"], rng);
    let slat = Surface::paint(paint);
    let mut mesh = Mesh::default();
    mesh.board(half, [height - 0.02, height + 0.04], [0.07, 0.11], &slat);
    let count = (height * share / 0.05) as usize;
    for i in 0..count {
        let y = height - 0.03 - i as f32 * 0.05;
        mesh.quad(
            [
                vec3(-half, y - 0.02, 0.102),
                vec3(half, y - 0.02, 0.102),
                vec3(half, y + 0.02, 0.082),
                vec3(-half, y + 0.02, 0.082),
            ],
            &slat,
        );
    }
    Piece::new(kind("blinds", "blinds"), mesh, paint.name)
}

/// A door with a frame. The leaf is opened by `angle` into the room behind the wall.
pub(crate) fn door([width, height]: [f32; 2], angle: f32, rng: &mut SeededRng) -> Piece {
    let frame_surface = Surface::plain(rng.pick(&[[196, 192, 182], [92, 64, 44], [150, 146, 138]]));
    let half = width / 2.0;
    let mut mesh = Mesh::default();
    let side = vec3(0.08, height, 0.14);
    mesh.mirrored_slabs(vec3(half + 0.03, 0.0, -0.05), side, &frame_surface);
    mesh.board(half + 0.07, [height - 0.02, height + 0.06], [-0.12, 0.02], &frame_surface);
    let leaf = parts::piece("door", rng);
    let hinge = vec3(0.01 - half, 0.0, if angle > 0.0 { -0.07 } else { 0.045 });
    mesh.add(&leaf.mesh, hinge, angle);
    Piece::new(leaf.kind, mesh, "")
}
