//! Pieces for kitchens.

use glam::{Vec3, vec3};

use super::super::mesh::Mesh;
use super::super::paint::Paint;
use super::super::pattern::Pattern;
use super::super::scene::{Piece, Pose, kind};
use super::super::seeded_rng::SeededRng;
use super::super::surface::Surface;
use super::storage::cabinet_in_paint;
use super::{FurnitureSet, parts};

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
