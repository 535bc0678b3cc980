//! Pieces and their places that several kinds of rooms share.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, at, clutter, lamps, seats, storage, textiles, walls};
use super::super::plan::{FloorPlan, WALLS, Wall};
use super::super::scene::{Piece, Pose};

impl FloorPlan {
    /// Remembers the next thing that is put as one worth looking at.
    pub(super) fn sight(&mut self) {
        self.sights.push(self.scene.things.len());
    }

    /// Perhaps stands a piece somewhere at a wall.
    pub(super) fn maybe(
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

    /// Perhaps hangs a piece on a wall, so high.
    pub(super) fn perhaps(
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

    /// Puts a few of these on top of something, side by side: where they stand, from its left.
    pub(super) fn top(
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
            self.beside(base, piece, vec3(*x, height, 0.08), angle);
        }
    }

    /// A lamp below the middle of the ceiling.
    pub(super) fn ceiling_lamp(&mut self) {
        let place = vec3(self.size.x / 2.0, self.size.y, self.size.z / 2.0);
        self.put(lamps::ceiling_lamp(), at(place, 0.0));
    }

    /// Pictures, up to so many.
    pub(super) fn pictures(&mut self, most: usize) {
        for _ in 0..=self.dice.below(most) {
            let up = self.dice.between(1.3, 1.5);
            self.perhaps(0.8, up, walls::picture);
        }
    }

    /// Perhaps a plant at a wall.
    pub(super) fn plant(&mut self, probability: f32) {
        self.maybe(probability, |dice| {
            let height = dice.between(0.7, 1.3);
            clutter::plant(height, dice)
        });
    }

    /// Perhaps a rug at a place.
    pub(super) fn rug(&mut self, probability: f32, place: Vec3, size: [f32; 2], angle: f32) {
        if self.dice.chance(probability) {
            let piece = textiles::rug(size[0], size[1], &mut self.dice);
            self.put(piece, at(place, angle));
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

/// The walls beside one.
pub(super) fn sides(wall: Wall) -> [Wall; 2] {
    match wall {
        Wall::North | Wall::South => [Wall::East, Wall::West],
        Wall::East | Wall::West => [Wall::North, Wall::South],
    }
}
