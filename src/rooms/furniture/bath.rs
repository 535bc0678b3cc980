//! Pieces for bathrooms.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::mesh::Mesh;
use super::super::paint::Paint;
use super::super::scene::{Piece, kind};
use super::super::surface::{Pattern, Surface};
use super::storage::cabinet_of;
use super::{FurnitureSet, at};

fn ceramic(dice: &mut Dice) -> (Surface, &'static str) {
    let names = [
        "white", "white", "white", "white", "white", "white", "pink", "green", "blue", "black",
    ];
    let paint = Paint::of(&names, dice);
    (Surface::gloss(paint), paint.name)
}

/// A toilet with its tank.
pub(in super::super) fn toilet(dice: &mut Dice) -> Piece {
    let (white, name) = ceramic(dice);
    let mut mesh = Mesh::default();
    // The oval bowl on its foot.
    mesh.vessel(
        vec3(0.0, 0.0, 0.44),
        &[
            (0.001, 0.0),
            (0.13, 0.0),
            (0.115, 0.06),
            (0.1, 0.14),
            (0.13, 0.24),
            (0.18, 0.34),
            (0.19, 0.39),
            (0.18, 0.4),
        ],
        1.28,
        &white,
    );
    // The seat; the raised lid leans on the tank.
    mesh.oval(
        vec3(0.0, 0.395, 0.44),
        &[
            (0.13, 0.0),
            (0.19, 0.0),
            (0.195, 0.02),
            (0.13, 0.025),
            (0.12, 0.0),
        ],
        1.28,
        &white,
    );
    let water = Surface::plain([150, 168, 176]);
    mesh.oval(
        vec3(0.0, 0.33, 0.44),
        &[(0.0, 0.0), (0.15, 0.0)],
        1.28,
        &water,
    );
    let points: Vec<Vec<Vec3>> = lid();
    mesh.grid(&points, &white);
    mesh.cushion(0.2, [0.36, 0.76], [0.0, 0.17], 0.03, &white);
    mesh.cushion(0.21, [0.75, 0.79], [-0.005, 0.18], 0.015, &white);
    mesh.cushion(0.12, [0.0, 0.38], [0.1, 0.4], 0.05, &white);
    let steel = Surface::steel();
    mesh.ball(vec3(0.0, 0.795, 0.085), vec3(0.03, 0.01, 0.03), &steel);
    Piece::new(kind("toilet", "toilet"), mesh, name)
}

/// The points of the raised lid of a toilet: half an oval that leans on the tank.
fn lid() -> Vec<Vec<Vec3>> {
    (0..=8)
        .map(|row| {
            let up = row as f32 / 8.0;
            let half = 0.185 * (1.0 - up * up * up * up).max(0.0).sqrt();
            (0..=6)
                .map(|column| {
                    let x = (column as f32 / 3.0 - 1.0) * half;
                    vec3(x, 0.42 + 0.4 * up, 0.215 - 0.03 * up)
                })
                .collect()
        })
        .collect()
}

/// A sink on a cabinet, with its tap.
pub(in super::super) fn vanity(dice: &mut Dice) -> FurnitureSet {
    let width = dice.between(0.65, 0.95);
    let names = ["white", "brown", "grey", "blue", "green", "black"];
    let paint = Paint::of(&names, dice);
    let base = cabinet_of(
        kind("bathroom cabinet", "cabinet"),
        vec3(width, 0.74, 0.48),
        2,
        paint,
    );
    FurnitureSet::of(base).and(basin(width, dice), at(vec3(0.0, 0.74, 0.0), 0.0))
}

/// A basin of a width, to be placed on a cabinet.
fn basin(width: f32, dice: &mut Dice) -> Piece {
    let (white, name) = ceramic(dice);
    let steel = Surface::steel();
    let mut mesh = Mesh::default();
    let (left, right, back, front) = (-width / 2.0 - 0.01, width / 2.0 + 0.01, 0.0, 0.52);
    // A rim around a hollow.
    let bowl = vec3(width * 0.36, 0.0, 0.17);
    let middle = vec3(0.0, 0.1, 0.28);
    for [low, high] in [
        [vec3(left, 0.0, back), vec3(right, 0.1, middle.z - bowl.z)],
        [vec3(left, 0.0, middle.z + bowl.z), vec3(right, 0.1, front)],
        [vec3(left, 0.0, back), vec3(-bowl.x, 0.1, front)],
        [vec3(bowl.x, 0.0, back), vec3(right, 0.1, front)],
    ] {
        mesh.block(low, high, &white);
    }
    mesh.vessel(
        middle - vec3(0.0, 0.09, 0.0),
        &[
            (0.001, 0.0),
            (0.6 * bowl.x, 0.01),
            (bowl.x * 0.95, 0.06),
            (bowl.x * 1.4, 0.09),
        ],
        bowl.z / bowl.x,
        &white,
    );
    mesh.rod(vec3(0.0, 0.1, 0.07), vec3(0.0, 0.26, 0.07), 0.016, &steel);
    mesh.rod(vec3(0.0, 0.25, 0.07), vec3(0.0, 0.22, 0.2), 0.013, &steel);
    for x in [-0.09, 0.09] {
        mesh.rod(vec3(x, 0.1, 0.07), vec3(x, 0.15, 0.07), 0.02, &steel);
    }
    Piece::new(kind("sink", "sink"), mesh, name)
}

/// A sink on a foot.
pub(in super::super) fn pedestal_sink(dice: &mut Dice) -> Piece {
    let (white, name) = ceramic(dice);
    let steel = Surface::steel();
    let mut mesh = Mesh::default();
    mesh.vessel(
        vec3(0.0, 0.0, 0.2),
        &[
            (0.001, 0.0),
            (0.12, 0.0),
            (0.08, 0.1),
            (0.07, 0.4),
            (0.1, 0.66),
        ],
        1.0,
        &white,
    );
    mesh.vessel(
        vec3(0.0, 0.66, 0.25),
        &[
            (0.1, 0.0),
            (0.22, 0.06),
            (0.29, 0.16),
            (0.29, 0.19),
            (0.25, 0.19),
            (0.2, 0.1),
            (0.001, 0.06),
        ],
        0.82,
        &white,
    );
    mesh.cushion(0.29, [0.74, 0.86], [0.0, 0.13], 0.03, &white);
    mesh.rod(vec3(0.0, 0.85, 0.08), vec3(0.0, 0.98, 0.08), 0.016, &steel);
    mesh.rod(vec3(0.0, 0.97, 0.08), vec3(0.0, 0.94, 0.2), 0.013, &steel);
    Piece::new(kind("sink", "sink"), mesh, name)
}

/// A bathtub along the wall, open above.
pub(in super::super) fn bathtub(dice: &mut Dice) -> Piece {
    let (white, name) = ceramic(dice);
    let steel = Surface::steel();
    let (length, height, depth) = (dice.between(1.55, 1.75), 0.56, 0.74);
    let mut mesh = Mesh::default();
    let outer = |y: f32, grow: f32| {
        ring(
            vec3(0.0, y, depth / 2.0),
            length / 2.0 + grow,
            depth / 2.0 + grow,
        )
    };
    let inner = |y: f32, inset: f32| {
        ring(
            vec3(0.0, y, depth / 2.0),
            length / 2.0 - inset,
            depth / 2.0 - inset,
        )
    };
    mesh.grid(&[outer(0.0, -0.03), outer(height - 0.04, -0.005)], &white);
    mesh.grid(
        &[
            outer(height - 0.04, 0.0),
            outer(height - 0.01, 0.012),
            outer(height, 0.0),
            inner(height, 0.06),
        ],
        &white,
    );
    mesh.grid(
        &[
            inner(height, 0.06),
            inner(height * 0.5, 0.1),
            inner(0.16, 0.18),
            inner(0.13, 0.3),
        ],
        &white,
    );
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
    mesh.rod(
        tap + vec3(0.0, 0.15, 0.0),
        tap + vec3(-0.16, 0.12, 0.0),
        0.014,
        &steel,
    );
    Piece::new(kind("bathtub", "bathtub"), mesh, name)
}

/// The points of a closed horizontal rectangle with round corners.
fn ring(middle: Vec3, half_width: f32, half_depth: f32) -> Vec<Vec3> {
    let radius = 0.16_f32.min(half_depth * 0.8);
    let mut points: Vec<Vec3> = (0..24)
        .map(|i| {
            let around =
                super::super::mesh::cos_sin(std::f32::consts::TAU * (i as f32 + 0.5) / 24.0);
            let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
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

/// A shower: a tray, tiles, a glass panel at one side, and a rail with the shower head.
pub(in super::super) fn shower(dice: &mut Dice) -> Piece {
    let white = Surface::gloss(Paint::nameless([236, 238, 238]));
    let tint = dice.pick(&[[168, 196, 206], [186, 206, 196], [214, 208, 196]]);
    let tiles = Surface::plain(tint).with(Pattern::Tiles(0.1, Vec3::splat(0.75)));
    let frosted = Surface::gloss(Paint::nameless([206, 222, 226]));
    let steel = Surface::steel();
    let (width, depth, height) = (0.95, 0.9, 2.05);
    let half = width / 2.0;
    let mut mesh = Mesh::default();
    mesh.cushion(half, [0.0, 0.12], [0.0, depth], 0.03, &white);
    mesh.board(half, [0.1, height], [0.0, 0.015], &tiles);
    let side = if dice.chance(0.5) { -1.0 } else { 1.0 };
    let x = side * (half - 0.01);
    mesh.block(
        vec3(x - 0.008, 0.12, 0.0),
        vec3(x + 0.008, height - 0.1, depth - 0.02),
        &frosted,
    );
    for (z, thick) in [(0.01, 0.02), (depth - 0.02, 0.018)] {
        mesh.slab(vec3(x, 0.1, z), vec3(thick, height - 0.18, thick), &steel);
    }
    mesh.rod(vec3(0.0, 0.9, 0.05), vec3(0.0, 1.98, 0.05), 0.013, &steel);
    mesh.rod(vec3(0.0, 1.97, 0.05), vec3(0.0, 1.97, 0.34), 0.012, &steel);
    mesh.lathe(
        vec3(0.0, 1.9, 0.34),
        &[(0.0, 0.0), (0.13, 0.0), (0.13, 0.025), (0.02, 0.06)],
        &steel,
    );
    mesh.rod(vec3(-0.1, 1.05, 0.05), vec3(0.1, 1.05, 0.05), 0.03, &steel);
    mesh.rod(vec3(0.0, 1.05, 0.06), vec3(0.06, 1.45, 0.1), 0.008, &steel);
    Piece::new(kind("shower", "shower"), mesh, "")
}

/// A roll of paper on its holder, with its back at the wall.
pub(in super::super) fn toilet_paper() -> Piece {
    let mut mesh = Mesh::default();
    let paper = Surface::plain([244, 243, 240]);
    mesh.rod(
        vec3(-0.055, 0.0, 0.07),
        vec3(0.055, 0.0, 0.07),
        0.055,
        &paper,
    );
    mesh.rod(
        vec3(-0.075, 0.0, 0.07),
        vec3(0.075, 0.0, 0.07),
        0.012,
        &Surface::steel(),
    );
    mesh.board(0.052, [-0.13, 0.0], [0.118, 0.122], &paper);
    Piece::new(kind("toilet paper", "objects"), mesh, "white")
}
