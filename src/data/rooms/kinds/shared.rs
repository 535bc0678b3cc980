//! Furniture used in several kinds of rooms, and helpers to place it.

use glam::{Vec3, vec3};

use super::super::furniture::{FurnitureSet, parts, plants, storage, walls};
use super::super::plan::FloorPlan;
use super::super::seeded_rng::SeededRng;
use crate::furniture::beds;
use crate::mesh::{Piece, Pose};
use crate::plan::WALLS;

impl FloorPlan {
    /// Makes the next added thing a camera target.
    pub(super) fn focus_on_next(&mut self) {
        self.camera_targets.push(self.scene.things.len());
    }

    /// Places a piece at a random wall, with this probability. Returns its pose; `None` if it is not placed.
    pub(super) fn maybe_place_at_wall(
        &mut self,
        probability: f32,
        make: impl FnOnce(&mut SeededRng) -> Piece,
    ) -> Option<Pose> {
        if !self.rng.chance(probability) {
            return None;
        }
        let piece = make(&mut self.rng);
        self.place_at_wall(&FurnitureSet::from_piece(piece), &WALLS)
    }

    /// Hangs a piece on a random wall, `up` metres high, with this probability.
    pub(super) fn maybe_hang(&mut self, probability: f32, up: f32, make: impl FnOnce(&mut SeededRng) -> Piece) {
        if self.rng.chance(probability) {
            let piece = make(&mut self.rng);
            self.hang(&piece, &WALLS, up);
        }
    }

    /// Adds a piece of the parts table on another piece, whose pose is `base`; `position` is in the coordinates of
    /// `base`.
    pub(super) fn add_part(&mut self, base: &Pose, name: &str, position: Vec3) -> usize {
        let piece = parts::piece(name, &mut self.rng);
        self.add_relative(base, piece, position, 0.0)
    }

    /// Adds a lamp below the middle of the ceiling.
    pub(super) fn add_ceiling_lamp(&mut self) {
        let position = vec3(self.size.x / 2.0, self.size.y, self.size.z / 2.0);
        self.add_part(&Pose::new(position, 0.0), "ceiling lamp", Vec3::ZERO);
    }

    /// Tries to hang between `count` + 1 and `count` + 3 pictures, each with a probability of 0.8.
    pub(super) fn hang_pictures(&mut self, count: usize) {
        for _ in 0..=count + self.rng.below(3) {
            let up = self.rng.between(1.15, 1.5);
            self.maybe_hang(0.8, up, walls::picture);
        }
    }

    /// Places a plant at a random wall, with this probability.
    pub(super) fn maybe_place_plant(&mut self, probability: f32) {
        self.maybe_place_at_wall(probability, |rng| {
            let height = rng.between(0.7, 1.3);
            plants::plant(height, rng)
        });
    }

    /// Adds a rug of this width and depth, with this probability.
    pub(super) fn maybe_add_rug(&mut self, probability: f32, position: Vec3, [width, depth]: [f32; 2], angle: f32) {
        if self.rng.chance(probability) {
            let piece = beds::rug(width, depth, &mut self.rng);
            self.add(piece, Pose::new(position, angle));
        }
    }
}

pub(super) fn nightstand(rng: &mut SeededRng) -> Piece {
    let size = vec3(rng.between(0.42, 0.5), rng.between(0.45, 0.55), 0.4);
    storage::chest("nightstand", size, [2, 1], rng)
}

pub(super) fn dresser(rng: &mut SeededRng) -> Piece {
    let size = vec3(rng.between(1.0, 1.3), rng.between(0.8, 0.95), 0.46);
    storage::chest("dresser", size, [3, 2], rng)
}

pub(super) fn low_stool(rng: &mut SeededRng) -> Piece {
    parts::piece(["stool", "stool:2"][rng.below(2)], rng)
}
