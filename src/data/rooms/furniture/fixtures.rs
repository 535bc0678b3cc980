//! Pieces for bathrooms and kitchens.

use glam::{Vec3, vec3};

use super::storage::cabinet_in_paint;
use super::{FurnitureSet, parts};
use crate::mesh::{Mesh, Piece, Pose, cos_sin, kind, sign};
use crate::pattern::{Paint, Pattern, Surface};
use crate::seeded_rng::SeededRng;

fn ceramic(rng: &mut SeededRng) -> (Surface, &'static str) {
    let names = ["white", "white", "white", "pink", "green", "blue", "black"];
    let paint = Paint::random(&names, rng);
    (Surface::gloss(paint), paint.name)
}

/// A sink on a cabinet, with its tap.
pub(crate) fn vanity(rng: &mut SeededRng) -> FurnitureSet {
    let names = ["brown", "brown", "grey", "blue", "green", "black"];
    let paint = Paint::random(&names, rng);
    let base = cabinet_in_paint(kind("bathroom cabinet", "cabinet"), vec3(0.8, 0.74, 0.48), 2, paint);
    FurnitureSet::from_piece(base).with(parts::piece("sink:3", rng), Pose::new(vec3(0.0, 0.74, 0.0), 0.0))
}

/// A bathtub along the wall, open above.
pub(crate) fn bathtub(rng: &mut SeededRng) -> Piece {
    let (white, name) = ceramic(rng);
    let steel = Surface::steel();
    let (length, height, depth) = (rng.between(1.55, 1.75), 0.56, 0.74);
    let mut mesh = Mesh::default();
    let outside = [(0.0, -0.03), (height - 0.04, -0.005)];
    let rim = [(height - 0.04, 0.0), (height - 0.01, 0.012), (height, 0.0), (height, -0.06)];
    let inside = [(height, -0.06), (height * 0.5, -0.1), (0.16, -0.18), (0.13, -0.3)];
    for profile in [&outside[..], &rim, &inside] {
        let rings: Vec<Vec<Vec3>> = profile
            .iter()
            .map(|(y, grow)| {
                let middle = vec3(0.0, *y, depth / 2.0);
                ring(middle, length / 2.0 + grow, depth / 2.0 + grow)
            })
            .collect();
        mesh.grid(&rings, &white);
    }
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
    mesh.rod(tap + vec3(0.0, 0.15, 0.0), tap + vec3(-0.16, 0.12, 0.0), 0.014, &steel);
    Piece::new(kind("bathtub", "bathtub"), mesh, name)
}

/// The points of a closed horizontal rectangle with round corners.
fn ring(middle: Vec3, half_width: f32, half_depth: f32) -> Vec<Vec3> {
    let radius = 0.16_f32.min(half_depth * 0.8);
    let mut points: Vec<Vec3> = (0..24)
        .map(|i| {
            let around = cos_sin(std::f32::consts::TAU * (i as f32 + 0.5) / 24.0);
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

/// The height of counters in metres.
pub(crate) const COUNTER: f32 = 0.9;
const DEPTH: f32 = 0.62;

/// The paints of the cabinets, the counter and the appliances of one kitchen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Style {
    cabinets: Paint,
    counter: Paint,
    appliances: Paint,
}

impl Style {
    pub(crate) fn new(rng: &mut SeededRng) -> Self {
        let cabinets = ["white", "brown", "brown", "blue", "green", "grey", "red", "yellow"];
        let counters = ["white", "black", "grey", "brown", "green", "blue"];
        Self {
            cabinets: Paint::random(&cabinets, rng),
            counter: Paint::random(&counters, rng),
            appliances: Paint::random(&["white", "black", "grey", "red", "blue"], rng),
        }
    }

    /// An appliance of the table of parts in the paint of the kitchen.
    pub(crate) fn appliance(&self, name: &str, rng: &mut SeededRng) -> Piece {
        parts::piece_in_paint(name, self.appliances, rng)
    }
}

/// Cabinets below a counter, with a sink if `sink` is set.
pub(crate) fn base_cabinets(width: f32, sink: bool, style: &Style, rng: &mut SeededRng) -> FurnitureSet {
    let doors = ((width / 0.5) as usize).max(1);
    let base = cabinet_in_paint(
        kind("kitchen cabinet", "cabinet"),
        vec3(width, COUNTER - 0.04, DEPTH - 0.02),
        doors,
        style.cabinets,
    );
    let top = Surface::gloss(style.counter).with_pattern(Pattern::Stone);
    let mut mesh = Mesh::default();
    let (low, high) = (COUNTER - 0.04, COUNTER);
    let hole = [0.27, 0.13, 0.5];
    if sink {
        let [half, back, front] = hole;
        for [from, to] in [
            [vec3(-width / 2.0, low, 0.0), vec3(width / 2.0, high, back)],
            [vec3(-width / 2.0, low, front), vec3(width / 2.0, high, DEPTH)],
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
    let set = FurnitureSet::from_piece(base).with(counter, Pose::new(Vec3::ZERO, 0.0));
    let set = if sink { set.with(parts::piece("sink:2", rng), Pose::new(Vec3::ZERO, 0.0)) } else { set };
    FurnitureSet { size: vec3(width, COUNTER, DEPTH), ..set }
}

/// Wall cabinets, with their lower edge at y = 0.
pub(crate) fn wall_cabinets(width: f32, style: &Style) -> Piece {
    let doors = ((width / 0.45) as usize).max(1);
    cabinet_in_paint(kind("kitchen cabinet", "cabinet"), vec3(width, 0.68, 0.35), doors, style.cabinets)
}
