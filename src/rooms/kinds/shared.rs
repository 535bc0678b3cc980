//! Furniture that several kinds of rooms share, and helpers to place it.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, at, clutter, lamps, seats, storage, textiles, walls};
use super::super::plan::{FloorPlan, WALLS, Wall};
use super::super::scene::{Piece, Pose};

impl FloorPlan {
    /// Marks the next thing that is added as one that the camera should look at.
    pub(super) fn focus_on_next(&mut self) {
        self.focus_things.push(self.scene.things.len());
    }

    /// Places a piece at a wall, with this probability; `None` if it is not placed.
    pub(super) fn maybe_stand(
        &mut self,
        probability: f32,
        make: impl FnOnce(&mut Dice) -> Piece,
    ) -> Option<Pose> {
        if !self.dice.chance(probability) {
            return None;
        }
        let piece = make(&mut self.dice);
        self.stand(&FurnitureSet::of(piece), &WALLS)
    }

    /// Hangs a piece on a wall at height `up`, with this probability.
    pub(super) fn maybe_hang(
        &mut self,
        probability: f32,
        up: f32,
        make: impl FnOnce(&mut Dice) -> Piece,
    ) {
        if self.dice.chance(probability) {
            let piece = make(&mut self.dice);
            self.hang(&piece, &WALLS, up);
        }
    }

    /// Adds random small pieces on top of another piece, at the x positions `places`, in metres from its middle.
    pub(super) fn place_on_top(
        &mut self,
        base: &Pose,
        height: f32,
        places: &[f32],
        makers: &[fn(&mut Dice) -> Piece],
    ) {
        for x in places {
            let make = self.dice.pick(makers);
            let piece = make(&mut self.dice);
            let angle = self.dice.between(-0.3, 0.3);
            self.add_relative(base, piece, vec3(*x, height, 0.08), angle);
        }
    }

    /// Adds a lamp below the middle of the ceiling.
    pub(super) fn ceiling_lamp(&mut self) {
        let place = vec3(self.size.x / 2.0, self.size.y, self.size.z / 2.0);
        self.add(lamps::ceiling_lamp(), at(place, 0.0));
    }

    /// Hangs up to `count` pictures.
    pub(super) fn pictures(&mut self, count: usize) {
        for _ in 0..=self.dice.below(count) {
            let up = self.dice.between(1.3, 1.5);
            self.maybe_hang(0.8, up, walls::picture);
        }
    }

    /// Places a plant at a wall, with this probability.
    pub(super) fn plant(&mut self, probability: f32) {
        self.maybe_stand(probability, |dice| {
            let height = dice.between(0.7, 1.3);
            clutter::plant(height, dice)
        });
    }

    /// Adds a rug at a place, with this probability.
    pub(super) fn rug(&mut self, probability: f32, place: Vec3, size: [f32; 2], angle: f32) {
        if self.dice.chance(probability) {
            let piece = textiles::rug(size[0], size[1], &mut self.dice);
            self.add(piece, at(place, angle));
        }
    }
}

/// Small things for the tops of furniture.
pub(super) const SMALL: [fn(&mut Dice) -> Piece; 3] = [clutter::books, clutter::vase, clutter::mug];

pub(super) fn nightstand(dice: &mut Dice) -> Piece {
    let size = vec3(dice.between(0.42, 0.5), dice.between(0.45, 0.55), 0.4);
    storage::chest("nightstand", size, [2, 1], dice)
}

pub(super) fn dresser(dice: &mut Dice) -> Piece {
    let size = vec3(dice.between(1.0, 1.3), dice.between(0.8, 0.95), 0.46);
    storage::chest("dresser", size, [3, 2], dice)
}

pub(super) fn low_stool(dice: &mut Dice) -> Piece {
    seats::stool(0.45, dice)
}

/// The two walls next to a wall.
pub(super) fn sides(wall: Wall) -> [Wall; 2] {
    match wall {
        Wall::North | Wall::South => [Wall::East, Wall::West],
        Wall::East | Wall::West => [Wall::North, Wall::South],
    }
}
