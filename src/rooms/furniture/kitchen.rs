//! Pieces for kitchens.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::mesh::{Mesh, cos_sin};
use super::super::paint::Paint;
use super::super::scene::{Piece, kind};
use super::super::surface::{Pattern, Surface};
use super::storage::cabinet_of;
use super::{FurnitureSet, at};

/// The height of counters in metres.
pub(in super::super) const COUNTER: f32 = 0.9;
const DEPTH: f32 = 0.62;

/// The paints of the cabinets, the counter and the appliances of one kitchen.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Style {
    cabinets: Paint,
    counter: Paint,
    appliances: Paint,
}

impl Style {
    pub(in super::super) fn new(dice: &mut Dice) -> Self {
        let cabinets = [
            "white", "brown", "blue", "green", "grey", "red", "yellow", "black",
        ];
        let counters = ["white", "black", "grey", "brown"];
        Self {
            cabinets: Paint::of(&cabinets, dice),
            counter: Paint::of(&counters, dice),
            appliances: Paint::of(&["white", "black", "grey", "red", "white"], dice),
        }
    }
}

/// Cabinets below a counter, with a sink if `sink` is set.
pub(in super::super) fn base_cabinets(width: f32, sink: bool, style: &Style) -> FurnitureSet {
    let doors = ((width / 0.5) as usize).max(1);
    let base = cabinet_of(
        kind("kitchen cabinet", "cabinet"),
        vec3(width, COUNTER - 0.04, DEPTH - 0.02),
        doors,
        style.cabinets,
    );
    let top = Surface::gloss(style.counter).with(Pattern::Stone);
    let mut mesh = Mesh::default();
    let (low, high) = (COUNTER - 0.04, COUNTER);
    let hole = [0.27, 0.13, 0.5];
    if sink {
        let [half, back, front] = hole;
        for [from, to] in [
            [vec3(-width / 2.0, low, 0.0), vec3(width / 2.0, high, back)],
            [
                vec3(-width / 2.0, low, front),
                vec3(width / 2.0, high, DEPTH),
            ],
            [vec3(-width / 2.0, low, 0.0), vec3(-half, high, DEPTH)],
            [vec3(half, low, 0.0), vec3(width / 2.0, high, DEPTH)],
        ] {
            mesh.block(from, to, &top);
        }
    } else {
        mesh.board(width / 2.0, [low, high], [0.0, DEPTH], &top);
    }
    mesh.board(width / 2.0, [high, high + 0.06], [0.0, 0.02], &top);
    let counter = Piece::new(kind("kitchen counter", "counter"), mesh, style.counter.name);
    let set = FurnitureSet::of(base).and(counter, at(Vec3::ZERO, 0.0));
    let set = if sink {
        set.and(kitchen_sink(hole), at(Vec3::ZERO, 0.0))
    } else {
        set
    };
    FurnitureSet {
        size: vec3(width, COUNTER, DEPTH),
        ..set
    }
}

fn kitchen_sink([half, back, front]: [f32; 3]) -> Piece {
    let steel = Surface::steel();
    let mut mesh = Mesh::default();
    let (deep, high) = (COUNTER - 0.19, COUNTER + 0.004);
    mesh.board(half, [deep - 0.01, deep], [back, front], &steel);
    for [low, top] in [
        [
            vec3(-half - 0.012, deep, back),
            vec3(-half + 0.006, high, front),
        ],
        [
            vec3(half - 0.006, deep, back),
            vec3(half + 0.012, high, front),
        ],
        [
            vec3(-half - 0.012, deep, back - 0.012),
            vec3(half + 0.012, high, back + 0.006),
        ],
        [
            vec3(-half - 0.012, deep, front - 0.006),
            vec3(half + 0.012, high, front + 0.012),
        ],
    ] {
        mesh.block(low, top, &steel);
    }
    let foot = vec3(0.0, COUNTER, back - 0.05);
    mesh.rod(foot, foot + vec3(0.0, 0.26, 0.0), 0.016, &steel);
    let mut last = foot + vec3(0.0, 0.26, 0.0);
    for i in 1..=6 {
        let out = cos_sin(std::f32::consts::PI * (1.0 - i as f32 / 6.0));
        let next = foot + vec3(0.0, 0.26 + 0.09 * out.y, 0.09 + 0.09 * out.x);
        mesh.rod(last, next, 0.013, &steel);
        last = next;
    }
    Piece::new(kind("sink", "sink"), mesh, "grey")
}

/// A stove with an oven below.
pub(in super::super) fn stove(style: &Style) -> Piece {
    let body = Surface::gloss(style.appliances);
    let glass = Surface::gloss(Paint::nameless([26, 26, 28]));
    let (steel, iron) = (Surface::steel(), Surface::plain([38, 38, 40]));
    let (width, depth) = (0.62, DEPTH);
    let half = width / 2.0;
    let mut mesh = Mesh::default();
    mesh.board(half, [0.06, COUNTER], [0.0, depth - 0.02], &body);
    mesh.board(half, [COUNTER, COUNTER + 0.14], [0.0, 0.04], &body);
    mesh.board(
        half - 0.015,
        [0.12, 0.72],
        [depth - 0.02, depth + 0.005],
        &body,
    );
    mesh.board(0.2, [0.28, 0.58], [depth + 0.005, depth + 0.008], &glass);
    mesh.rod(
        vec3(-0.24, 0.67, depth + 0.04),
        vec3(0.24, 0.67, depth + 0.04),
        0.012,
        &steel,
    );
    for x in [-0.24, 0.24] {
        mesh.rod(
            vec3(x, 0.67, depth),
            vec3(x, 0.67, depth + 0.04),
            0.009,
            &steel,
        );
    }
    for i in 0..5 {
        let x = (i as f32 - 2.0) * 0.11;
        mesh.rod(
            vec3(x, 0.81, depth - 0.02),
            vec3(x, 0.81, depth + 0.02),
            0.022,
            &iron,
        );
    }
    mesh.board(
        half - 0.02,
        [COUNTER, COUNTER + 0.006],
        [0.05, depth - 0.04],
        &glass,
    );
    for (x, z) in [(-0.15, 0.18), (0.15, 0.18), (-0.15, 0.43), (0.15, 0.43)] {
        let radius = if z > 0.3 { 0.1 } else { 0.08 };
        let ring = [
            (radius * 0.5, 0.0),
            (radius * 0.5, 0.012),
            (radius, 0.014),
            (radius, 0.0),
        ];
        mesh.lathe(vec3(x, COUNTER + 0.006, z), &ring, &iron);
    }
    Piece::new(kind("stove", "appliances"), mesh, style.appliances.name)
}

/// A refrigerator with its freezer above.
pub(in super::super) fn refrigerator(style: &Style, dice: &mut Dice) -> Piece {
    let body = Surface::gloss(style.appliances);
    let steel = Surface::steel();
    let (width, height, depth) = (0.72, dice.between(1.7, 1.85), 0.68);
    let half = width / 2.0;
    let split = height * dice.between(0.62, 0.7);
    let mut mesh = Mesh::default();
    mesh.board(half, [0.03, height], [0.0, depth - 0.05], &body);
    for [low, high] in [[0.05, split - 0.006], [split + 0.006, height - 0.005]] {
        mesh.cushion(half, [low, high], [depth - 0.06, depth], 0.015, &body);
        let (from, to) = if low < 0.1 {
            (split - 0.45, split - 0.06)
        } else {
            (split + 0.06, split + 0.3)
        };
        let x = -half + 0.07;
        mesh.rod(
            vec3(x, from, depth + 0.04),
            vec3(x, to, depth + 0.04),
            0.013,
            &steel,
        );
        for y in [from, to] {
            mesh.rod(
                vec3(x, y, depth - 0.01),
                vec3(x, y, depth + 0.04),
                0.011,
                &steel,
            );
        }
    }
    Piece::new(
        kind("refrigerator", "appliances"),
        mesh,
        style.appliances.name,
    )
}

/// Wall cabinets, with their lower edge at y = 0.
pub(in super::super) fn wall_cabinets(width: f32, style: &Style) -> Piece {
    let doors = ((width / 0.45) as usize).max(1);
    cabinet_of(
        kind("kitchen cabinet", "cabinet"),
        vec3(width, 0.68, 0.35),
        doors,
        style.cabinets,
    )
}

pub(in super::super) fn microwave(style: &Style) -> Piece {
    let body = Surface::gloss(style.appliances);
    let glass = Surface::gloss(Paint::nameless([28, 28, 30]));
    let mut mesh = Mesh::default();
    mesh.cushion(0.25, [0.0, 0.28], [0.04, 0.4], 0.015, &body);
    mesh.block(vec3(-0.22, 0.05, 0.4), vec3(0.1, 0.23, 0.405), &glass);
    for i in 0..3 {
        let y = 0.08 + i as f32 * 0.055;
        mesh.block(vec3(0.15, y, 0.4), vec3(0.21, y + 0.03, 0.406), &glass);
    }
    Piece::new(kind("microwave", "appliances"), mesh, style.appliances.name)
}

/// A hood for above a stove, with its lower edge at y = 0.
pub(in super::super) fn hood() -> Piece {
    let steel = Surface::steel();
    let mut mesh = Mesh::default();
    mesh.board(0.31, [0.0, 0.06], [0.0, 0.46], &steel);
    let (a, b) = (vec3(0.31, 0.06, 0.46), vec3(0.12, 0.3, 0.26));
    let flip = |v: Vec3| vec3(-v.x, v.y, v.z);
    let wall = |v: Vec3| vec3(v.x, v.y, 0.0);
    mesh.quad([flip(a), a, b, flip(b)], &steel);
    mesh.quad([a, wall(a), wall(b), b], &steel);
    mesh.quad([wall(flip(a)), flip(a), flip(b), wall(flip(b))], &steel);
    mesh.board(0.12, [0.3, 1.0], [0.0, 0.26], &steel);
    Piece::new(kind("range hood", "objects"), mesh, "grey")
}
