//! Chests of drawers, cabinets and shelves.

use glam::{Vec3, vec3};

use super::super::mesh::Mesh;
use super::super::pattern::Pattern;
use super::super::seeded_rng::SeededRng;
use crate::mesh::{Piece, ThingKind, kind};
use crate::pattern::{ALL_COLORS, Paint, Surface, SurfaceFinish, linear_rgb};

/// Colours of storage furniture. A colour that is listed twice is twice as likely.
const COLORS: [&str; 10] = ["brown", "brown", "brown", "white", "grey", "grey", "black", "blue", "green", "yellow"];

fn finish(paint: Paint) -> Surface {
    if paint.name == "brown" { Surface::wood(paint, 0) } else { Surface::paint(paint) }
}

/// A chest with a number of rows and columns of drawers.
pub(crate) fn chest(word: &'static str, size: Vec3, [rows, columns]: [usize; 2], rng: &mut SeededRng) -> Piece {
    let half = size.x / 2.0;
    let paint = Paint::random(&COLORS, rng);
    let surface = finish(paint);
    let knob = Surface::steel();
    let mut mesh = Mesh::default();
    mesh.board(half, [0.06, size.y - 0.03], [0.0, size.z - 0.02], &surface);
    mesh.board(half + 0.01, [size.y - 0.03, size.y], [0.0, size.z], &surface);
    for x in [-1.0, 1.0] {
        for z in [0.04, size.z - 0.07] {
            mesh.slab(vec3(x * (half - 0.04), 0.0, z), vec3(0.05, 0.07, 0.05), &surface);
        }
    }
    let (width, height) = (size.x / columns as f32, (size.y - 0.11) / rows as f32);
    for row in 0..rows {
        for column in 0..columns {
            let low = vec3(-half + column as f32 * width + 0.012, 0.07 + row as f32 * height + 0.008, size.z - 0.02);
            let high = low + vec3(width - 0.024, height - 0.016, 0.018);
            mesh.block(low, high, &surface);
            let middle = (low + high) / 2.0;
            if width > 0.5 {
                let grip = vec3(0.06, 0.0, 0.0);
                let out = vec3(0.0, 0.0, 0.025);
                mesh.rod(middle + out - grip, middle + out + grip, 0.007, &knob);
            } else {
                mesh.ball(middle + vec3(0.0, 0.0, 0.02), Vec3::splat(0.016), &knob);
            }
        }
    }
    Piece::new(kind(word, "chest_of_drawers"), mesh, paint.name)
}

/// A cabinet in a random colour, with a number of doors side by side.
pub(crate) fn cabinet(name: ThingKind, size: Vec3, doors: usize, rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&COLORS, rng);
    cabinet_in_paint(name, size, doors, paint)
}

/// A cabinet in a paint, with a number of doors side by side.
pub(crate) fn cabinet_in_paint(name: ThingKind, size: Vec3, doors: usize, paint: Paint) -> Piece {
    let half = size.x / 2.0;
    let surface = if paint.name == "brown" { Surface::wood(paint, 1) } else { Surface::paint(paint) };
    let knob = Surface::steel();
    let shade = Surface { color: surface.color * 0.35, ..surface.clone() };
    let mut mesh = Mesh::default();
    mesh.board(half - 0.02, [0.0, 0.08], [0.0, size.z - 0.06], &shade);
    mesh.board(half, [0.07, size.y], [0.0, size.z - 0.02], &surface);
    let width = size.x / doors as f32;
    for door in 0..doors {
        let left = -half + door as f32 * width + 0.006;
        let (right, low, high) = (left + width - 0.012, 0.085, size.y - 0.01);
        mesh.block(vec3(left, low, size.z - 0.02), vec3(right, high, size.z), &surface);
        // A frame around the panel of each door.
        let rail = 0.05_f32.min(width * 0.2);
        for [from, to] in [
            [vec3(left, low, size.z), vec3(left + rail, high, size.z + 0.008)],
            [vec3(right - rail, low, size.z), vec3(right, high, size.z + 0.008)],
            [vec3(left, low, size.z), vec3(right, low + rail, size.z + 0.008)],
            [vec3(left, high - rail, size.z), vec3(right, high, size.z + 0.008)],
        ] {
            mesh.block(from, to, &surface);
        }
        let x = if door % 2 == 0 { right - 0.025 } else { left + 0.025 };
        let y = if size.y > 1.2 { 1.0 } else { high - 0.16 };
        mesh.rod(vec3(x, y - 0.06, size.z + 0.025), vec3(x, y + 0.06, size.z + 0.025), 0.008, &knob);
    }
    Piece::new(name, mesh, paint.name)
}

/// Shelves with books and boxes on them.
pub(crate) fn bookshelf(rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&["brown", "grey", "black"], rng);
    let surface = Surface::wood(paint, 1);
    let (width, height, depth) = (rng.between(0.8, 1.2), rng.between(1.6, 2.0), 0.3);
    let half = width / 2.0;
    let shelves = 5;
    let mut mesh = Mesh::default();
    let side = vec3(0.03, height, depth);
    mesh.mirrored_slabs(vec3(half - 0.015, 0.0, depth / 2.0), side, &surface);
    mesh.board(half, [0.0, height], [0.0, 0.015], &surface);
    let rise = (height - 0.06) / shelves as f32;
    for shelf in 0..=shelves {
        let y = 0.04 + shelf as f32 * rise;
        mesh.board(half, [y - 0.02, y + 0.005], [0.0, depth], &surface);
        if shelf < shelves {
            add_books(&mut mesh, [-half + 0.03, half - 0.03], y + 0.005, rise, rng);
        }
    }
    Piece::new(kind("bookshelf", "shelving"), mesh, paint.name)
}

/// Adds a row of books and boxes to a shelf at height `y` that is `rise` high.
fn add_books(mesh: &mut Mesh, [from, to]: [f32; 2], y: f32, rise: f32, rng: &mut SeededRng) {
    let mut x = from;
    let end = to - rng.between(0.0, 0.3) * (to - from);
    while x < end - 0.05 {
        if rng.chance(0.06) {
            let side = 0.16_f32.min(end - x);
            mesh.slab(vec3(x + side / 2.0, y, 0.14), vec3(side, rise * 0.55, 0.2), &Surface::plain([206, 188, 150]));
            x += side + 0.02;
            continue;
        }
        let (thick, tall) = (rng.between(0.022, 0.05), rng.between(0.55, 0.82) * rise);
        let paint = Paint::random(&ALL_COLORS, rng);
        let dull = Surface {
            color: paint.color * 0.7 + linear_rgb([120, 110, 100]) * 0.2,
            pattern: Pattern::Plain,
            finish: SurfaceFinish::Matte,
        };
        mesh.block(vec3(x, y, 0.04), vec3(x + thick, y + tall, rng.between(0.2, 0.26)), &dull);
        x += thick + 0.003;
    }
}

/// A wall shelf with a few books. Its back is at the wall, and its board at y = 0.
pub(crate) fn wall_shelf(rng: &mut SeededRng) -> Piece {
    let paint = Paint::random(&["white", "brown", "black", "blue", "green", "yellow", "red"], rng);
    let surface = finish(paint);
    let width = rng.between(0.9, 1.3);
    let half = width / 2.0;
    let mut mesh = Mesh::default();
    for y in [0.0, 0.34] {
        mesh.board(half, [y - 0.03, y], [0.0, 0.24], &surface);
    }
    let side = vec3(0.024, 0.37, 0.24);
    mesh.mirrored_slabs(vec3(half - 0.012, -0.03, 0.12), side, &surface);
    mesh.board(half, [-0.03, 0.34], [0.0, 0.012], &surface);
    add_books(&mut mesh, [-half + 0.04, -half + 0.04 + width * 0.3], 0.0, 0.3, rng);
    Piece::new(kind("shelf", "shelving"), mesh, paint.name)
}
