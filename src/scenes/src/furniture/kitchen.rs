//! Pieces for kitchens.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::mesh::Mesh;
use super::super::paint::Paint;
use super::super::pattern::Pattern;
use super::super::scene::{Piece, kind};
use super::super::surface::Surface;
use super::storage::cabinet_of;
use super::{FurnitureSet, at, parts};

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
            "white", "brown", "brown", "blue", "green", "grey", "red", "yellow",
        ];
        let counters = ["white", "black", "grey", "brown", "green", "blue"];
        Self {
            cabinets: Paint::random(&cabinets, dice),
            counter: Paint::random(&counters, dice),
            appliances: Paint::random(&["white", "black", "grey", "red", "blue"], dice),
        }
    }

    /// An appliance of the table of parts in the paint of the kitchen.
    pub(in super::super) fn appliance(&self, name: &str, dice: &mut Dice) -> Piece {
        parts::painted(name, self.appliances, dice)
    }
}

/// Cabinets below a counter, with a sink if `sink` is set.
pub(in super::super) fn base_cabinets(
    width: f32,
    sink: bool,
    style: &Style,
    dice: &mut Dice,
) -> FurnitureSet {
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
    let set = FurnitureSet::from_piece(base).and(counter, at(Vec3::ZERO, 0.0));
    let set = if sink {
        set.and(parts::piece("sink:2", dice), at(Vec3::ZERO, 0.0))
    } else {
        set
    };
    FurnitureSet {
        size: vec3(width, COUNTER, DEPTH),
        ..set
    }
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
