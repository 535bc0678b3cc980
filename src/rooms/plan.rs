//! The floor plan of a room: four walls, and the places of everything that stands and hangs ([`FloorPlan`]).

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec3, vec3};

use super::dice::Dice;
use super::furniture::{FurnitureSet, at, textiles, walls};
use super::mesh::Mesh;
use super::paint::rgb;
use super::scene::{Piece, Pose, Scene, kind};
use super::surface::{Pattern, Surface};

/// A wall of the room. North is at z = 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wall {
    North,
    East,
    South,
    West,
}

pub(super) const WALLS: [Wall; 4] = [Wall::North, Wall::East, Wall::South, Wall::West];

impl Wall {
    /// The rotation in radians of a piece with its back to the wall.
    pub(super) fn angle(self) -> f32 {
        match self {
            Self::North => 0.0,
            Self::East => -FRAC_PI_2,
            Self::South => PI,
            Self::West => FRAC_PI_2,
        }
    }

    pub(super) fn opposite(self) -> Self {
        match self {
            Self::North => Self::South,
            Self::East => Self::West,
            Self::South => Self::North,
            Self::West => Self::East,
        }
    }
}

/// The kind of floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flooring {
    Wood,
    Tiles,
    Carpet,
}

/// A rectangle of the floor in metres: minimum x and z, maximum x and z.
#[derive(Debug, Clone, Copy)]
struct FloorArea([f32; 4]);

impl FloorArea {
    fn meets(&self, other: &Self, margin: f32) -> bool {
        let [a, b] = [self.0, other.0];
        a[0] < b[2] + margin && b[0] < a[2] + margin && a[1] < b[3] + margin && b[1] < a[3] + margin
    }
}

/// A rectangle of a wall in metres: its bounds along the wall, and its bounds in height.
#[derive(Debug, Clone, Copy)]
struct WallPatch {
    wall: Wall,
    along: [f32; 2],
    up: [f32; 2],
}

impl WallPatch {
    /// The rectangle that reaches equally far to both sides of a position along the wall.
    fn around(wall: Wall, along: f32, reach: f32, up: [f32; 2]) -> Self {
        let along = [along - reach, along + reach];
        Self { wall, along, up }
    }
}

/// A room while it is furnished.
pub(super) struct FloorPlan {
    pub(super) scene: Scene,
    /// Width (x), height (y) and depth (z) in metres.
    pub(super) size: Vec3,
    pub(super) dice: Dice,
    /// The indices of things that the camera should look at.
    pub(super) focus_things: Vec<usize>,
    areas: Vec<FloorArea>,
    patches: Vec<WallPatch>,
}

/// The number of places that are tried for a piece before it is left out (chosen).
const TRIES: usize = 60;

impl FloorPlan {
    /// An empty room of a size.
    pub(super) fn new(size: Vec3, ground: Flooring, tiled: bool, mut dice: Dice) -> Self {
        let tint = dice.pick(&[
            [238, 236, 230],
            [232, 228, 216],
            [222, 230, 232],
            [226, 232, 222],
            [236, 226, 220],
            [228, 226, 236],
        ]);
        let mut plan = Self {
            scene: Scene::default(),
            size,
            focus_things: Vec::new(),
            areas: Vec::new(),
            patches: Vec::new(),
            dice,
        };
        plan.ground(ground);
        let ceiling = Surface::plain([246, 246, 244]);
        let mut mesh = Mesh::default();
        mesh.block(
            vec3(0.0, size.y, 0.0),
            vec3(size.x, size.y + 0.05, size.z),
            &ceiling,
        );
        plan.add(
            Piece::new(kind("ceiling", "ceiling"), mesh, ""),
            at(Vec3::ZERO, 0.0),
        );
        for wall in WALLS {
            let width = plan.width(wall);
            let mut mesh = Mesh::default();
            let paint = Surface::plain(tint);
            let (left, right) = (-width / 2.0 - 0.05, width / 2.0 + 0.05);
            mesh.block(vec3(left, 0.0, -0.05), vec3(right, size.y, 0.0), &paint);
            if tiled {
                let squares =
                    Surface::plain([224, 232, 234]).with(Pattern::Tiles(0.2, Vec3::splat(0.6)));
                mesh.block(vec3(left, 0.0, 0.0), vec3(right, 1.3, 0.008), &squares);
            } else {
                let board = Surface::plain([244, 244, 242]);
                mesh.block(vec3(left, 0.0, 0.0), vec3(right, 0.09, 0.014), &board);
            }
            let pose = plan.wall_pose(wall, width / 2.0, 0.0);
            plan.add(Piece::new(kind("wall", "wall"), mesh, ""), pose);
        }
        plan
    }

    fn ground(&mut self, ground: Flooring) {
        let dice = &mut self.dice;
        let surface = match ground {
            Flooring::Wood => {
                let tints = [
                    [176, 128, 84],
                    [142, 98, 62],
                    [198, 160, 116],
                    [156, 132, 108],
                ];
                Surface::plain(dice.pick(&tints)).with(Pattern::Boards(0.13))
            }
            Flooring::Tiles => {
                let tints = [[206, 202, 194], [174, 176, 178], [196, 184, 168]];
                let joint = rgb([150, 146, 140]);
                Surface::plain(dice.pick(&tints)).with(Pattern::Tiles(0.33, joint))
            }
            Flooring::Carpet => {
                let tints = [[188, 178, 164], [160, 162, 170], [172, 158, 146]];
                Surface::plain(dice.pick(&tints)).with(Pattern::Pile)
            }
        };
        let mut mesh = Mesh::default();
        mesh.block(
            vec3(0.0, -0.05, 0.0),
            vec3(self.size.x, 0.0, self.size.z),
            &surface,
        );
        self.add(
            Piece::new(kind("floor", "floor"), mesh, ""),
            at(Vec3::ZERO, 0.0),
        );
    }

    /// The length of a wall in metres.
    pub(super) fn width(&self, wall: Wall) -> f32 {
        match wall {
            Wall::North | Wall::South => self.size.x,
            Wall::East | Wall::West => self.size.z,
        }
    }

    /// The pose of a piece with its back at a wall, `along` metres from its left end and `up` metres high.
    pub(super) fn wall_pose(&self, wall: Wall, along: f32, up: f32) -> Pose {
        let place = match wall {
            Wall::North => vec3(along, up, 0.0),
            Wall::East => vec3(self.size.x, up, along),
            Wall::South => vec3(self.size.x - along, up, self.size.z),
            Wall::West => vec3(0.0, up, self.size.z - along),
        };
        at(place, wall.angle())
    }

    /// Adds a piece without a check for free space, and returns its index.
    #[expect(clippy::needless_pass_by_value, reason = "a piece is added once")]
    pub(super) fn add(&mut self, piece: Piece, pose: Pose) -> usize {
        self.scene.add(&piece, pose);
        self.scene.things.len() - 1
    }

    /// Adds a piece on or next to another one, at a place in the coordinates of that one. Returns its index.
    pub(super) fn add_relative(
        &mut self,
        base: &Pose,
        piece: Piece,
        place: Vec3,
        angle: f32,
    ) -> usize {
        self.add(piece, at(base.to_room(place), base.angle + angle))
    }

    fn add_set(&mut self, set: FurnitureSet, pose: &Pose) -> usize {
        let first = self.scene.things.len();
        for (piece, relative) in set.pieces {
            self.add_relative(pose, piece, relative.at, relative.angle);
        }
        first
    }

    fn area(pose: &Pose, size: Vec3, from: f32) -> FloorArea {
        let corners = [
            vec3(-size.x / 2.0, 0.0, from),
            vec3(size.x / 2.0, 0.0, from + size.z),
        ]
        .map(|corner| pose.to_room(corner));
        let (low, high) = (corners[0].min(corners[1]), corners[0].max(corners[1]));
        FloorArea([low.x, low.z, high.x, high.z])
    }

    fn is_free(&self, area: &FloorArea) -> bool {
        let FloorArea([left, back, right, front]) = *area;
        left > 0.0
            && back > 0.0
            && right < self.size.x
            && front < self.size.z
            && !self.areas.iter().any(|other| other.meets(area, 0.04))
    }

    fn is_free_on_wall(&self, patch: &WallPatch) -> bool {
        !self.patches.iter().any(|other| {
            other.wall == patch.wall
                && other.along[0] < patch.along[1]
                && patch.along[0] < other.along[1]
                && other.up[0] < patch.up[1]
                && patch.up[0] < other.up[1]
        })
    }

    /// Places a set at a wall, `along` metres from its left end. Returns its pose; `None` if something is in the way.
    pub(super) fn stand_at(&mut self, set: FurnitureSet, wall: Wall, along: f32) -> Option<Pose> {
        let pose = self.wall_pose(wall, along, 0.0);
        let pose = at(pose.to_room(vec3(0.0, 0.0, 0.016)), pose.angle);
        let area = Self::area(&pose, set.size, 0.0);
        let half = set.size.x / 2.0;
        let patch = WallPatch::around(wall, along, half, [0.0, set.size.y + 0.02]);
        if !self.is_free(&area) || !self.is_free_on_wall(&patch) {
            return None;
        }
        self.areas.push(area);
        self.patches.push(patch);
        self.add_set(set, &pose);
        Some(pose)
    }

    /// Places a set at a random place of one of these walls; `None` if there is no space.
    pub(super) fn stand(&mut self, set: &FurnitureSet, choices: &[Wall]) -> Option<Pose> {
        (0..TRIES).find_map(|_| {
            let wall = self.dice.pick(choices);
            let half = set.size.x / 2.0 + 0.03;
            let along = self.dice.between(half, self.width(wall) - half);
            self.stand_at(set.clone(), wall, along)
        })
    }

    /// Places a set at an end of one of these walls, in the corner; `None` if there is no space.
    pub(super) fn corner(&mut self, set: &FurnitureSet, choices: &[Wall]) -> Option<Pose> {
        (0..TRIES).find_map(|_| {
            let wall = self.dice.pick(choices);
            let half = set.size.x / 2.0 + 0.04;
            let along = if self.dice.chance(0.5) {
                half
            } else {
                self.width(wall) - half
            };
            self.stand_at(set.clone(), wall, along)
        })
    }

    /// Places a set away from walls, with its middle at a place. Returns its pose; `None` if something is in the way.
    pub(super) fn stand_free(
        &mut self,
        set: FurnitureSet,
        place: Vec3,
        angle: f32,
    ) -> Option<Pose> {
        let back = at(place, angle).to_room(vec3(0.0, 0.0, -set.size.z / 2.0));
        let pose = at(back, angle);
        let area = Self::area(&pose, set.size, 0.0);
        if !self.is_free(&area) {
            return None;
        }
        self.areas.push(area);
        self.add_set(set, &pose);
        Some(pose)
    }

    /// Reserves a part of the floor in front of a pose, so that later sets stay out of it.
    pub(super) fn keep_free(&mut self, pose: &Pose, size: Vec3, from: f32) {
        let area = Self::area(pose, size, from);
        self.areas.push(area);
    }

    /// Hangs a piece on one of these walls at height `up`; `None` if there is no free place.
    pub(super) fn hang(&mut self, piece: &Piece, choices: &[Wall], up: f32) -> Option<Pose> {
        let [low, high] = piece.mesh.bounds();
        let half = high.x.max(-low.x) + 0.06;
        (0..TRIES).find_map(|_| {
            let wall = self.dice.pick(choices);
            let along = self.dice.between(half, self.width(wall) - half);
            let patch =
                WallPatch::around(wall, along, half, [up + low.y - 0.05, up + high.y + 0.05]);
            self.is_free_on_wall(&patch).then(|| {
                self.patches.push(patch);
                let pose = self.wall_pose(wall, along, up);
                self.add(piece.clone(), pose);
                pose
            })
        })
    }

    /// Hangs a piece above a pose at a wall, without a check for free space. Returns its index.
    pub(super) fn hang_above(&mut self, pose: &Pose, piece: Piece, up: f32) -> usize {
        let [low, high] = piece.mesh.bounds();
        let wall = WALLS
            .into_iter()
            .find(|wall| (wall.angle() - pose.angle).abs() < 1e-3);
        if let Some(wall) = wall {
            let along = match wall {
                Wall::North => pose.at.x,
                Wall::South => self.size.x - pose.at.x,
                Wall::East => pose.at.z,
                Wall::West => self.size.z - pose.at.z,
            };
            self.patches.push(WallPatch {
                wall,
                along: [along + low.x, along + high.x],
                up: [up + low.y, up + high.y],
            });
        }
        self.add_relative(pose, piece, vec3(0.0, up, 0.0), 0.0)
    }

    /// Adds a door to one of these walls, if there is space.
    pub(super) fn door(&mut self, choices: &[Wall]) {
        let door = FurnitureSet::of(walls::door(&mut self.dice));
        let size = door.size + vec3(0.05, 0.0, 0.0);
        let set = FurnitureSet { size, ..door };
        for _ in 0..TRIES {
            let wall = self.dice.pick(choices);
            let half = size.x / 2.0 + 0.1;
            let along = self.dice.between(half, self.width(wall) - half);
            let pose = self.wall_pose(wall, along, 0.0);
            let patch = WallPatch::around(wall, along, half, [0.0, size.y + 0.1]);
            if self.is_free_on_wall(&patch) {
                self.patches.push(patch);
                self.keep_free(&pose, vec3(0.9, 0.0, 0.75), 0.0);
                self.add_set(set, &pose);
                return;
            }
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
        let height = 2.2 - sill;
        for _ in 0..TRIES {
            let wall = self.dice.pick(choices);
            let reach = width / 2.0
                + if dressing == WindowDressing::Curtains {
                    0.62
                } else {
                    0.15
                };
            let span = self.width(wall);
            if span < 2.0 * reach + 0.1 {
                continue;
            }
            let along = self.dice.between(reach + 0.05, span - reach - 0.05);
            let patch = WallPatch::around(wall, along, reach, [sill - 0.12, 2.3]);
            if !self.is_free_on_wall(&patch) {
                continue;
            }
            self.patches.push(patch);
            let pose = self.wall_pose(wall, along, sill);
            let daylight = self.dice.between(10.0, 14.0);
            self.add(walls::window(width, height, daylight), pose);
            match dressing {
                WindowDressing::Bare => {}
                WindowDressing::Blinds => {
                    let share = self.dice.between(0.3, 0.75);
                    let piece = walls::blinds(width, height, share, &mut self.dice);
                    self.add(piece, pose);
                }
                WindowDressing::Curtains => {
                    let drop = if self.dice.chance(0.7) {
                        2.26
                    } else {
                        2.3 - sill + 0.15
                    };
                    let rail = at(vec3(pose.at.x, 2.3, pose.at.z), pose.angle);
                    for piece in textiles::curtains(width, drop, &mut self.dice) {
                        self.add(piece, rail);
                    }
                    if drop > 2.0 {
                        // Long curtains need free space in front of the wall.
                        let size = vec3(2.0 * reach, 0.0, 0.2);
                        self.keep_free(&at(vec3(pose.at.x, 0.0, pose.at.z), pose.angle), size, 0.0);
                    }
                }
            }
            return;
        }
    }

    /// Whether a camera can be at a place of the floor, with `margin` metres to walls and furniture.
    pub(super) fn walkable(&self, place: Vec3, margin: f32) -> bool {
        let point = FloorArea([place.x, place.z, place.x, place.z]);
        let inside = |value: f32, end: f32| (margin..=end - margin).contains(&value);
        inside(place.x, self.size.x)
            && inside(place.z, self.size.z)
            && !self.areas.iter().any(|area| area.meets(&point, margin))
    }
}

/// The curtains or blinds of a window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WindowDressing {
    Bare,
    Blinds,
    Curtains,
}
