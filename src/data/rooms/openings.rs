//! Doors and windows of a room, and the view through an open door.

use glam::vec3;

use super::furniture::{parts, plants, seats, storage, walls};
use super::mesh::{LightSource, Mesh, Piece, Pose, bounds, kind};
use super::pattern::{ALL_COLORS, Paint, Pattern, Surface};
use super::plan::{FloorPlan, Flooring, WALL_THICKNESS, Wall, WallDoorway, WallPatch, floor_surface};
use crate::furniture::beds;

/// Curtains or blinds of a window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WindowDressing {
    Bare,
    Blinds,
    Curtains,
}

/// Number of random positions tried for an opening before it is left out (chosen).
const TRIES: usize = 60;

/// Width and height of a doorway in metres.
const DOORWAY: [f32; 2] = [0.88, 2.04];

impl FloorPlan {
    /// Adds a door to one of these walls, if it has enough free space. An open door leads to another room.
    pub(super) fn add_door(&mut self, choices: &[Wall]) {
        let [width, height] = DOORWAY;
        for _ in 0..TRIES {
            let wall = self.rng.pick(choices);
            let half = width / 2.0 + 0.2;
            let along = self.rng.between(half, self.wall_length(wall) - half);
            let patch = WallPatch::around(wall, along, half, [0.0, height + 0.1]);
            if !self.is_free_on_wall(&patch) {
                continue;
            }
            self.reserve_wall(patch);
            let pose = self.wall_pose(wall, along, 0.0);
            self.reserve_floor(&pose, vec3(0.95, 0.0, 0.75), 0.0);
            let mut angle = 0.0;
            if self.rng.chance(0.6) {
                angle = self.rng.between(1.2, 1.9);
                self.shell.doorways.push(WallDoorway {
                    wall,
                    along: [along - width / 2.0, along + width / 2.0],
                    top: height,
                });
                self.add_next_room(&pose, [along, self.wall_length(wall) - along]);
            }
            let door = walls::door(DOORWAY, angle, &mut self.rng);
            self.add(door, pose);
            return;
        }
    }

    /// Adds the room behind an open door, given the pose of the door and the distances from its middle to the ends of
    /// the wall. The words of all things in it end in `/otherroom`.
    fn add_next_room(&mut self, pose: &Pose, sides: [f32; 2]) {
        let [left, right] = sides.map(|side| side.min(self.rng.between(1.2, 2.4)));
        let (back, high) = (-WALL_THICKNESS - self.rng.between(1.6, 3.6), self.size.y);
        let flooring = self.rng.pick(&[Flooring::Wood, Flooring::Tiles, Flooring::Carpet]);
        let floor = floor_surface(flooring, &mut self.rng);
        let tint = self.rng.pick(&[[196, 186, 170], [164, 172, 170], [186, 160, 136], [140, 150, 164]]);
        let paint = Surface::plain(tint).with_pattern(Pattern::Plaster);
        let white = Surface::plain([210, 208, 202]);
        let [ground, ceiling, wall] = ["floor/otherroom", "ceiling/otherroom", "wall/otherroom"];
        let (west, east, south, thickness) = (-left, right, -WALL_THICKNESS, WALL_THICKNESS);
        let sheets = [
            (ground, &floor, [west, east, -0.05, 0.0, back, south]),
            (ground, &floor, [-0.44, 0.44, -0.05, 0.0, south, 0.0]),
            (ceiling, &white, [west, east, high, high + 0.05, back, south]),
            (wall, &paint, [west, east, 0.0, high, back - thickness, back]),
            (wall, &paint, [west - thickness, west, 0.0, high, back, south]),
            (wall, &paint, [east, east + thickness, 0.0, high, back, south]),
        ];
        for (word, surface, [x, to_x, y, to_y, z, to_z]) in sheets {
            let mut mesh = Mesh::default();
            mesh.block(vec3(x, y, z), vec3(to_x, to_y, to_z), surface);
            let class = word.split_once('/').map_or(word, |(class, _)| class);
            self.add(Piece::new(kind(word, class), mesh, ""), *pose);
        }
        let mut lamp = parts::piece("ceiling lamp", &mut self.rng);
        let strength = self.rng.between(0.15, 0.9);
        if let Some(LightSource::Bulb { radiance, .. }) = &mut lamp.light {
            *radiance *= strength;
        }
        lamp.kind = kind("ceiling lamp/otherroom", "lighting");
        let middle = f32::midpoint(-left, right);
        self.add_relative(pose, lamp, vec3(middle, high, back / 2.0), 0.0);
        self.furnish_next_room(pose, [-left, right], back);
    }

    /// Adds a piece of furniture and a picture at the back wall of the room behind a door.
    fn furnish_next_room(&mut self, pose: &Pose, [left, right]: [f32; 2], back: f32) {
        let rng = &mut self.rng;
        let furniture = match rng.below(5) {
            0 => storage::bookshelf(rng).with_word("bookshelf/otherroom"),
            1 => storage::chest("dresser/otherroom", vec3(1.0, 0.85, 0.42), [3, 2], rng),
            2 => {
                let name = kind("cabinet/otherroom", "cabinet");
                storage::cabinet(name, vec3(0.9, 1.0, 0.4), 2, rng)
            }
            3 => seats::chair(kind("chair/otherroom", "chair"), Paint::random(&ALL_COLORS, rng), rng),
            _ => plants::plant(1.2, rng).with_word("potted plant/otherroom"),
        };
        let half = bounds(&furniture.mesh.faces)[1].x.min((right - left) / 2.0);
        let x = rng.between(left + half, right - half + 0.01);
        let picture = walls::picture(rng).with_word("picture/otherroom");
        let y = rng.between(1.25, 1.5);
        self.add_relative(pose, furniture, vec3(x, 0.0, back + 0.02), 0.0);
        if !(x - 0.5..x + 0.5).contains(&0.1) || y > 1.35 {
            self.add_relative(pose, picture, vec3(0.1, y, back), 0.0);
        }
    }

    /// Adds one to three windows as [`Self::add_window`] does.
    pub(super) fn add_windows(&mut self, choices: &[Wall], width: f32, sill: f32, dressing: WindowDressing) {
        for _ in 0..=self.rng.below(3) {
            self.add_window(choices, width, sill, dressing);
        }
    }

    /// Adds a window with its curtains or blinds to one of these walls, if it has enough free space. `sill` is the
    /// height of the window sill in metres.
    pub(super) fn add_window(&mut self, choices: &[Wall], width: f32, sill: f32, dressing: WindowDressing) {
        let reach = width / 2.0
            + match dressing {
                WindowDressing::Curtains => 0.62,
                WindowDressing::Bare | WindowDressing::Blinds => 0.15,
            };
        for _ in 0..TRIES {
            let wall = self.rng.pick(choices);
            let span = self.wall_length(wall);
            if span < 2.0 * reach + 0.1 {
                continue;
            }
            let along = self.rng.between(reach + 0.05, span - reach - 0.05);
            let patch = WallPatch::around(wall, along, reach, [sill - 0.12, 2.3]);
            if self.is_free_on_wall(&patch) {
                self.reserve_wall(patch);
                let pose = self.wall_pose(wall, along, sill);
                let daylight = self.rng.between(7.0, 13.0);
                self.add(walls::window(width, 2.2 - sill, daylight), pose);
                self.add_dressing(&pose, [width, reach], sill, dressing);
                return;
            }
        }
    }

    /// Adds the curtains or blinds of a window at a pose.
    fn add_dressing(&mut self, pose: &Pose, [width, reach]: [f32; 2], sill: f32, dressing: WindowDressing) {
        match dressing {
            WindowDressing::Bare => {}
            WindowDressing::Blinds => {
                let share = self.rng.between(0.3, 0.75);
                let piece = walls::blinds(width, 2.2 - sill, share, &mut self.rng);
                self.add(piece, *pose);
            }
            WindowDressing::Curtains => {
                let is_long = self.rng.chance(0.7);
                let drop = if is_long { 2.26 } else { 2.45 - sill };
                let rail = Pose::new(vec3(pose.position.x, 2.3, pose.position.z), pose.angle);
                for piece in beds::curtains(width, drop, &mut self.rng) {
                    self.add(piece, rail);
                }
                if is_long {
                    // Furniture would collide with long curtains.
                    let foot = Pose::new(vec3(pose.position.x, 0.0, pose.position.z), pose.angle);
                    self.reserve_floor(&foot, vec3(2.0 * reach, 0.0, 0.2), 0.0);
                }
            }
        }
    }
}
