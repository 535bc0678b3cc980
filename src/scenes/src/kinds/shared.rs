//! Furniture that several kinds of rooms share, and helpers to place it.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, at, parts, plants, storage, textiles, walls};
use super::super::plan::FloorPlan;
use super::super::scene::{Piece, Pose};
use super::super::shell::{WALLS, Wall};

impl FloorPlan {
    /// Marks the next thing that is added as one that the camera should look at.
    pub(super) fn focus_on_next(&mut self) {
        self.camera_targets.push(self.scene.things.len());
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
        self.stand(&FurnitureSet::from_piece(piece), &WALLS)
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

    /// Adds a piece of the table of parts on another piece, at a place in its coordinates.
    pub(super) fn add_part(&mut self, base: &Pose, name: &str, place: Vec3) -> usize {
        let piece = parts::piece(name, &mut self.dice);
        self.add_relative(base, piece, place, 0.0)
    }

    /// Adds a lamp below the middle of the ceiling.
    pub(super) fn ceiling_lamp(&mut self) {
        let place = vec3(self.size.x / 2.0, self.size.y, self.size.z / 2.0);
        self.add_part(&at(place, 0.0), "ceiling lamp", Vec3::ZERO);
    }

    /// Hangs about `count` pictures or a few more.
    pub(super) fn pictures(&mut self, count: usize) {
        for _ in 0..=count + self.dice.below(3) {
            let up = self.dice.between(1.15, 1.5);
            self.maybe_hang(0.8, up, walls::picture);
        }
    }

    /// Places a plant at a wall, with this probability.
    pub(super) fn plant(&mut self, probability: f32) {
        self.maybe_stand(probability, |dice| {
            let height = dice.between(0.7, 1.3);
            plants::plant(height, dice)
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

pub(super) fn nightstand(dice: &mut Dice) -> Piece {
    let size = vec3(dice.between(0.42, 0.5), dice.between(0.45, 0.55), 0.4);
    storage::chest("nightstand", size, [2, 1], dice)
}

pub(super) fn dresser(dice: &mut Dice) -> Piece {
    let size = vec3(dice.between(1.0, 1.3), dice.between(0.8, 0.95), 0.46);
    storage::chest("dresser", size, [3, 2], dice)
}

pub(super) fn low_stool(dice: &mut Dice) -> Piece {
    parts::piece(["stool", "stool:2"][dice.below(2)], dice)
}

/// The two walls next to a wall.
pub(super) fn sides(wall: Wall) -> [Wall; 2] {
    match wall {
        Wall::North | Wall::South => [Wall::East, Wall::West],
        Wall::East | Wall::West => [Wall::North, Wall::South],
    }
}
