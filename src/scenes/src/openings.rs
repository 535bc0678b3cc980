//! Doors and windows of a room, and the view through an open door.

use glam::vec3;

use super::furniture::{at, parts, plants, seats, storage, textiles, walls};
use super::mesh::{Mesh, bounds};
use super::paint::{ALL, Paint};
use super::pattern::Pattern;
use super::plan::{FloorPlan, WallPatch};
use super::scene::{LightSource, Piece, Pose, kind};
use super::shell::{Flooring, THICK, Wall, flooring};
use super::surface::Surface;

/// The curtains or blinds of a window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WindowDressing {
    Bare,
    Blinds,
    Curtains,
}

/// The number of places that are tried for an opening before it is left out (chosen).
const TRIES: usize = 60;
/// The size of a doorway in metres.
const DOORWAY: [f32; 2] = [0.88, 2.04];

impl FloorPlan {
    /// Adds a door to one of these walls, if there is space. An open one leads to another room.
    pub(super) fn door(&mut self, choices: &[Wall]) {
        let [width, height] = DOORWAY;
        for _ in 0..TRIES {
            let wall = self.dice.pick(choices);
            let half = width / 2.0 + 0.2;
            let along = self.dice.between(half, self.width(wall) - half);
            let patch = WallPatch::around(wall, along, half, [0.0, height + 0.1]);
            if !self.is_free_on_wall(&patch) {
                continue;
            }
            self.reserve_wall(patch);
            let pose = self.wall_pose(wall, along, 0.0);
            self.reserve_floor(&pose, vec3(0.95, 0.0, 0.75), 0.0);
            let mut turned = 0.0;
            if self.dice.chance(0.6) {
                turned = self.dice.between(1.2, 1.9);
                let sides = [along - width / 2.0, along + width / 2.0];
                self.shell.doorways.push((wall, sides, height));
                self.next_room(&pose, [along, self.width(wall) - along]);
            }
            let door = walls::door(DOORWAY, turned, &mut self.dice);
            self.add(door, pose);
            return;
        }
    }

    /// Adds the room behind an open door at a pose: `sides` are the distances from the middle of the door to the ends of the
    /// wall. Everything in it is named as in another room.
    fn next_room(&mut self, pose: &Pose, sides: [f32; 2]) {
        let [left, right] = sides.map(|side| side.min(self.dice.between(1.2, 2.4)));
        let (back, high) = (-THICK - self.dice.between(1.6, 3.6), self.size.y);
        let ground = self
            .dice
            .pick(&[Flooring::Wood, Flooring::Tiles, Flooring::Carpet]);
        let floor = flooring(ground, &mut self.dice);
        let tint = self.dice.pick(&[
            [196, 186, 170],
            [164, 172, 170],
            [186, 160, 136],
            [140, 150, 164],
        ]);
        let paint = Surface::plain(tint).with(Pattern::Plaster);
        let white = Surface::plain([210, 208, 202]);
        let words = ["floor/otherroom", "ceiling/otherroom", "wall/otherroom"];
        let [ground, above, wall] = words;
        let (west, east, south, thick) = (-left, right, -THICK, THICK);
        let sheets = [
            (ground, &floor, [west, east, -0.05, 0.0, back, south]),
            (ground, &floor, [-0.44, 0.44, -0.05, 0.0, south, 0.0]),
            (above, &white, [west, east, high, high + 0.05, back, south]),
            (wall, &paint, [west, east, 0.0, high, back - thick, back]),
            (wall, &paint, [west - thick, west, 0.0, high, back, south]),
            (wall, &paint, [east, east + thick, 0.0, high, back, south]),
        ];
        for (word, surface, [x, to_x, y, to_y, z, to_z]) in sheets {
            let mut mesh = Mesh::default();
            mesh.block(vec3(x, y, z), vec3(to_x, to_y, to_z), surface);
            let class = word.split_once('/').map_or(word, |(class, _)| class);
            self.add(Piece::new(kind(word, class), mesh, ""), *pose);
        }
        let mut lamp = parts::piece("ceiling lamp", &mut self.dice);
        let strength = self.dice.between(0.15, 0.9);
        if let Some(LightSource::Bulb { radiance, .. }) = &mut lamp.light {
            *radiance *= strength;
        }
        lamp.kind = kind("ceiling lamp/otherroom", "lighting");
        let middle = f32::midpoint(-left, right);
        self.add_relative(pose, lamp, vec3(middle, high, back / 2.0), 0.0);
        self.furnish_next_room(pose, [-left, right], back);
    }

    /// Adds what stands and hangs at the back wall of the room behind a door.
    fn furnish_next_room(&mut self, pose: &Pose, [left, right]: [f32; 2], back: f32) {
        let dice = &mut self.dice;
        let standing = match dice.below(5) {
            0 => storage::bookshelf(dice).named("bookshelf/otherroom"),
            1 => storage::chest("dresser/otherroom", vec3(1.0, 0.85, 0.42), [3, 2], dice),
            2 => {
                let name = kind("cabinet/otherroom", "cabinet");
                storage::cabinet(name, vec3(0.9, 1.0, 0.4), 2, dice)
            }
            3 => seats::chair(
                kind("chair/otherroom", "chair"),
                Paint::random(&ALL, dice),
                dice,
            ),
            _ => plants::plant(1.2, dice).named("potted plant/otherroom"),
        };
        let half = bounds(&standing.mesh.faces)[1].x.min((right - left) / 2.0);
        let x = dice.between(left + half, right - half + 0.01);
        let picture = walls::picture(dice).named("picture/otherroom");
        let y = dice.between(1.25, 1.5);
        self.add_relative(pose, standing, vec3(x, 0.0, back + 0.02), 0.0);
        if !(x - 0.5..x + 0.5).contains(&0.1) || y > 1.35 {
            self.add_relative(pose, picture, vec3(0.1, y, back), 0.0);
        }
    }

    /// Adds one to three windows as [`Self::window`] does.
    pub(super) fn windows(
        &mut self,
        choices: &[Wall],
        width: f32,
        sill: f32,
        dressing: WindowDressing,
    ) {
        for _ in 0..=self.dice.below(3) {
            self.window(choices, width, sill, dressing);
        }
    }

    /// Adds a window with its curtains or blinds to one of these walls, if there is space. `sill` is its height in metres.
    pub(super) fn window(
        &mut self,
        choices: &[Wall],
        width: f32,
        sill: f32,
        dressing: WindowDressing,
    ) {
        let reach = width / 2.0
            + match dressing {
                WindowDressing::Curtains => 0.62,
                WindowDressing::Bare | WindowDressing::Blinds => 0.15,
            };
        for _ in 0..TRIES {
            let wall = self.dice.pick(choices);
            let span = self.width(wall);
            if span < 2.0 * reach + 0.1 {
                continue;
            }
            let along = self.dice.between(reach + 0.05, span - reach - 0.05);
            let patch = WallPatch::around(wall, along, reach, [sill - 0.12, 2.3]);
            if self.is_free_on_wall(&patch) {
                self.reserve_wall(patch);
                let pose = self.wall_pose(wall, along, sill);
                let daylight = self.dice.between(7.0, 13.0);
                self.add(walls::window(width, 2.2 - sill, daylight), pose);
                self.dress(&pose, [width, reach], sill, dressing);
                return;
            }
        }
    }

    /// Adds the curtains or blinds of a window at a pose.
    fn dress(
        &mut self,
        pose: &Pose,
        [width, reach]: [f32; 2],
        sill: f32,
        dressing: WindowDressing,
    ) {
        match dressing {
            WindowDressing::Bare => {}
            WindowDressing::Blinds => {
                let share = self.dice.between(0.3, 0.75);
                let piece = walls::blinds(width, 2.2 - sill, share, &mut self.dice);
                self.add(piece, *pose);
            }
            WindowDressing::Curtains => {
                let is_long = self.dice.chance(0.7);
                let drop = if is_long { 2.26 } else { 2.45 - sill };
                let rail = at(vec3(pose.at.x, 2.3, pose.at.z), pose.angle);
                for piece in textiles::curtains(width, drop, &mut self.dice) {
                    self.add(piece, rail);
                }
                if is_long {
                    // Long curtains need free space in front of the wall.
                    let foot = at(vec3(pose.at.x, 0.0, pose.at.z), pose.angle);
                    self.reserve_floor(&foot, vec3(2.0 * reach, 0.0, 0.2), 0.0);
                }
            }
        }
    }
}
