//! Floor plan of a room: four walls, and the occupied areas of floor and walls ([`FloorPlan`]).
//!
//! Surfaces of floor and walls, and doorways: [`Shell`].

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec3, vec3};

use super::furniture::FurnitureSet;
use super::mesh::{Mesh, Piece, Pose, Scene, bounds, kind};
use super::pattern::{Pattern, Surface, codes_from_hex, linear_rgb};
use super::seeded_rng::SeededRng;

/// Rectangle of the floor in metres: minimum x and z, then maximum x and z.
#[derive(Debug, Clone, Copy)]
pub(super) struct FloorArea(pub(super) [f32; 4]);

impl FloorArea {
    /// True if the rectangles overlap after one of them is enlarged by `margin` metres on every side.
    fn overlaps(&self, other: &Self, margin: f32) -> bool {
        let [a, b] = [self.0, other.0];
        a[0] < b[2] + margin && b[0] < a[2] + margin && a[1] < b[3] + margin && b[1] < a[3] + margin
    }
}

/// Rectangle of a wall in metres: its bounds along the wall and in height.
#[derive(Debug, Clone, Copy)]
pub(super) struct WallPatch {
    wall: Wall,
    along: [f32; 2],
    up: [f32; 2],
}

impl WallPatch {
    /// Rectangle that extends by `reach` metres to both sides of a position along the wall.
    pub(super) fn around(wall: Wall, along: f32, reach: f32, up: [f32; 2]) -> Self {
        let along = [along - reach, along + reach];
        Self { wall, along, up }
    }
}

/// A room being furnished.
pub(super) struct FloorPlan {
    pub(super) scene: Scene,
    /// Width (x), height (y) and depth (z) in metres.
    pub(super) size: Vec3,
    pub(super) rng: SeededRng,
    /// Indices of the things that the camera should look at.
    pub(super) camera_targets: Vec<usize>,
    /// Bounding box of each thing: lowest and highest corner.
    pub(super) boxes: Vec<[Vec3; 2]>,
    pub(super) shell: Shell,
    /// Parts of the floor that are occupied or reserved.
    areas: Vec<FloorArea>,
    /// Parts of the walls that are occupied or reserved.
    patches: Vec<WallPatch>,
}

/// Number of random places tried for a piece before it is left out (chosen).
const TRIES: usize = 60;

impl FloorPlan {
    /// Creates an empty room with floor and ceiling. [`FloorPlan::add_walls`] adds the walls once all doorways are
    /// known.
    pub(super) fn new(size: Vec3, flooring: Flooring, tiled: bool, mut rng: SeededRng) -> Self {
        let shell = Shell::new(tiled, &mut rng);
        let mut plan = Self {
            scene: Scene::default(),
            size,
            camera_targets: Vec::new(),
            boxes: Vec::new(),
            shell,
            areas: Vec::new(),
            patches: Vec::new(),
            rng,
        };
        plan.add_floor_and_ceiling(flooring);
        plan
    }

    fn add_floor_and_ceiling(&mut self, flooring: Flooring) {
        let size = self.size;
        let surface = floor_surface(flooring, &mut self.rng);
        let mut mesh = Mesh::default();
        mesh.block(vec3(0.0, -0.05, 0.0), vec3(size.x, 0.0, size.z), &surface);
        let floor = Piece::new(kind("floor", "floor"), mesh, "");
        self.add(floor, Pose::new(Vec3::ZERO, 0.0));
        let white = Surface::plain([216, 214, 208]).with_pattern(Pattern::Plaster);
        let mut mesh = Mesh::default();
        let top = vec3(size.x, size.y + 0.05, size.z);
        mesh.block(vec3(0.0, size.y, 0.0), top, &white);
        let ceiling = Piece::new(kind("ceiling", "ceiling"), mesh, "");
        self.add(ceiling, Pose::new(Vec3::ZERO, 0.0));
    }

    /// Adds the four walls, cut out at the doorways.
    pub(super) fn add_walls(&mut self) {
        for (i, wall) in WALLS.into_iter().enumerate() {
            let width = self.wall_length(wall);
            let mut doorways: Vec<WallDoorway> =
                self.shell.doorways.iter().filter(|doorway| doorway.wall == wall).copied().collect();
            doorways.sort_by(|a, b| a.along[0].total_cmp(&b.along[0]));
            let [left, right] = [-width / 2.0 - WALL_THICKNESS, width / 2.0 + WALL_THICKNESS];
            let (mut mesh, mut built_to) = (Mesh::default(), left);
            for doorway in doorways {
                let [start, end] = doorway.along.map(|x| x - width / 2.0);
                self.add_panel(&mut mesh, i, [built_to, start], 0.0);
                self.add_panel(&mut mesh, i, [start, end], doorway.top);
                built_to = end;
            }
            self.add_panel(&mut mesh, i, [built_to, right], 0.0);
            let pose = self.wall_pose(wall, width / 2.0, 0.0);
            self.add(Piece::new(kind("wall", "wall"), mesh, ""), pose);
        }
    }

    /// Adds the part of a wall between `left` and `right` to its mesh, from the height `bottom` up to the ceiling, in
    /// metres.
    fn add_panel(&self, mesh: &mut Mesh, wall: usize, [left, right]: [f32; 2], bottom: f32) {
        let shell = &self.shell;
        let corner = vec3(right, self.size.y, 0.0);
        mesh.block(vec3(left, bottom, -WALL_THICKNESS), corner, &shell.walls[wall]);
        let mut layer = |surface: &Surface, top: f32, depth: f32| {
            if top > bottom {
                mesh.block(vec3(left, bottom, 0.0), vec3(right, top, depth), surface);
            }
        };
        match &shell.lower {
            Some((surface, top)) => layer(surface, *top, 0.008),
            None => layer(&shell.skirting, 0.09, 0.014),
        }
        if shell.lower.as_ref().is_some_and(|(_, top)| *top < 1.0) {
            layer(&shell.skirting, 0.12, 0.014);
        }
    }

    /// Length of a wall in metres.
    pub(super) fn wall_length(&self, wall: Wall) -> f32 {
        match wall {
            Wall::North | Wall::South => self.size.x,
            Wall::East | Wall::West => self.size.z,
        }
    }

    /// Pose of a piece with its back at a wall, `along` metres from the left end of the wall and `up` metres above the
    /// floor.
    pub(super) fn wall_pose(&self, wall: Wall, along: f32, up: f32) -> Pose {
        let position = match wall {
            Wall::North => vec3(along, up, 0.0),
            Wall::East => vec3(self.size.x, up, along),
            Wall::South => vec3(self.size.x - along, up, self.size.z),
            Wall::West => vec3(0.0, up, self.size.z - along),
        };
        Pose::new(position, wall.angle())
    }

    /// Adds a piece without checking for free space. Returns its index.
    #[expect(clippy::needless_pass_by_value, reason = "a piece is added once")]
    pub(super) fn add(&mut self, piece: Piece, pose: Pose) -> usize {
        let faces = self.scene.mesh.faces.len();
        self.scene.add(&piece, pose);
        self.boxes.push(bounds(&self.scene.mesh.faces[faces..]));
        self.scene.things.len() - 1
    }

    /// Adds a piece on or next to another one, whose pose is `base`; `position` is in the coordinates of `base`.
    /// Returns its index.
    pub(super) fn add_relative(&mut self, base: &Pose, piece: Piece, position: Vec3, angle: f32) -> usize {
        self.add(piece, Pose::new(base.to_room(position), base.angle + angle))
    }

    /// Adds a set without checking for free space. Returns the index of its first piece.
    pub(super) fn add_set(&mut self, set: FurnitureSet, pose: &Pose) -> usize {
        let first = self.scene.things.len();
        for (piece, relative) in set.pieces {
            self.add_relative(pose, piece, relative.position, relative.angle);
        }
        first
    }

    /// Floor area of a box of this size, whose back is `from` metres in front of the pose. The angle must be a multiple
    /// of 90°.
    fn footprint(pose: &Pose, size: Vec3, from: f32) -> FloorArea {
        let corners =
            [vec3(-size.x / 2.0, 0.0, from), vec3(size.x / 2.0, 0.0, from + size.z)].map(|corner| pose.to_room(corner));
        let (low, high) = (corners[0].min(corners[1]), corners[0].max(corners[1]));
        FloorArea([low.x, low.z, high.x, high.z])
    }

    /// True if an area is inside the room and at least 4 cm from every occupied area.
    pub(super) fn is_free(&self, area: &FloorArea) -> bool {
        let FloorArea([left, back, right, front]) = *area;
        left > 0.0
            && back > 0.0
            && right < self.size.x
            && front < self.size.z
            && !self.areas.iter().any(|other| other.overlaps(area, 0.04))
    }

    /// True if a patch overlaps no occupied patch of its wall.
    pub(super) fn is_free_on_wall(&self, patch: &WallPatch) -> bool {
        !self.patches.iter().any(|other| {
            other.wall == patch.wall
                && other.along[0] < patch.along[1]
                && patch.along[0] < other.along[1]
                && other.up[0] < patch.up[1]
                && patch.up[0] < other.up[1]
        })
    }

    /// Places a set at a wall, with its middle `along` metres from the left end. Returns its pose; `None` if something
    /// is in the way.
    pub(super) fn try_place_at_wall(&mut self, set: FurnitureSet, wall: Wall, along: f32) -> Option<Pose> {
        let pose = self.wall_pose(wall, along, 0.0);
        let pose = Pose::new(pose.to_room(vec3(0.0, 0.0, 0.016)), pose.angle);
        let area = Self::footprint(&pose, set.size, 0.0);
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

    /// Places a set at a random position along one of these walls. Returns its pose; `None` without free space.
    pub(super) fn place_at_wall(&mut self, set: &FurnitureSet, choices: &[Wall]) -> Option<Pose> {
        (0..TRIES).find_map(|_| {
            let wall = self.rng.pick(choices);
            let half = set.size.x / 2.0 + 0.03;
            let along = self.rng.between(half, self.wall_length(wall) - half);
            self.try_place_at_wall(set.clone(), wall, along)
        })
    }

    /// Places a set in a random corner, with its back to one of these walls. Returns its pose; `None` without free
    /// space.
    pub(super) fn place_in_corner(&mut self, set: &FurnitureSet, choices: &[Wall]) -> Option<Pose> {
        (0..TRIES).find_map(|_| {
            let wall = self.rng.pick(choices);
            let half = set.size.x / 2.0 + 0.04;
            let along = if self.rng.chance(0.5) { half } else { self.wall_length(wall) - half };
            self.try_place_at_wall(set.clone(), wall, along)
        })
    }

    /// Places a set away from walls, centred on a position. Returns its pose; `None` if something is in the way.
    pub(super) fn place_away_from_walls(&mut self, set: FurnitureSet, position: Vec3, angle: f32) -> Option<Pose> {
        let back = Pose::new(position, angle).to_room(vec3(0.0, 0.0, -set.size.z / 2.0));
        let pose = Pose::new(back, angle);
        let area = Self::footprint(&pose, set.size, 0.0);
        if !self.is_free(&area) {
            return None;
        }
        self.areas.push(area);
        self.add_set(set, &pose);
        Some(pose)
    }

    /// Reserves a part of a wall, so that nothing is hung or placed there.
    pub(super) fn reserve_wall(&mut self, patch: WallPatch) {
        self.patches.push(patch);
    }

    /// Reserves a part of the floor, starting `from` metres in front of a pose, so that later sets are kept out of it.
    pub(super) fn reserve_floor(&mut self, pose: &Pose, size: Vec3, from: f32) {
        let area = Self::footprint(pose, size, from);
        self.areas.push(area);
    }

    /// Hangs a piece on one of these walls, `up` metres high. Returns its pose; `None` without free space.
    pub(super) fn hang(&mut self, piece: &Piece, choices: &[Wall], up: f32) -> Option<Pose> {
        let [low, high] = bounds(&piece.mesh.faces);
        let half = high.x.max(-low.x) + 0.06;
        (0..TRIES).find_map(|_| {
            let wall = self.rng.pick(choices);
            let along = self.rng.between(half, self.wall_length(wall) - half);
            let patch = WallPatch::around(wall, along, half, [up + low.y - 0.05, up + high.y + 0.05]);
            self.is_free_on_wall(&patch).then(|| {
                self.patches.push(patch);
                let pose = self.wall_pose(wall, along, up);
                self.add(piece.clone(), pose);
                pose
            })
        })
    }

    /// Hangs a piece `up` metres above a pose at a wall without checking for free space. Returns its index.
    pub(super) fn hang_above(&mut self, pose: &Pose, piece: Piece, up: f32) -> usize {
        let [low, high] = bounds(&piece.mesh.faces);
        let wall = WALLS.into_iter().find(|wall| (wall.angle() - pose.angle).abs() < 1e-3);
        if let Some(wall) = wall {
            let along = match wall {
                Wall::North => pose.position.x,
                Wall::South => self.size.x - pose.position.x,
                Wall::East => pose.position.z,
                Wall::West => self.size.z - pose.position.z,
            };
            self.patches.push(WallPatch {
                wall,
                along: [along + low.x, along + high.x],
                up: [up + low.y, up + high.y],
            });
        }
        self.add_relative(pose, piece, vec3(0.0, up, 0.0), 0.0)
    }

    /// True if a position is at least `margin` metres from walls and furniture, so that a camera fits.
    pub(super) fn has_room_for_camera(&self, position: Vec3, margin: f32) -> bool {
        let point = FloorArea([position.x, position.z, position.x, position.z]);
        [(position.x, self.size.x), (position.z, self.size.z)]
            .iter()
            .all(|(value, end)| (margin..=end - margin).contains(value))
            && !self.areas.iter().any(|area| area.overlaps(&point, margin))
    }
}

/// A wall of the room; the north wall is at z = 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wall {
    North,
    East,
    South,
    West,
}

pub(super) const WALLS: [Wall; 4] = [Wall::North, Wall::East, Wall::South, Wall::West];

impl Wall {
    /// Rotation in radians of a piece with its back to the wall.
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

    /// The two adjacent walls.
    pub(super) fn neighbours(self) -> [Self; 2] {
        match self {
            Self::North | Self::South => [Self::East, Self::West],
            Self::East | Self::West => [Self::North, Self::South],
        }
    }
}

/// Kind of floor covering.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flooring {
    Wood,
    Tiles,
    Carpet,
}

/// Thickness of walls in metres.
pub(super) const WALL_THICKNESS: f32 = 0.1;

/// A doorway in a wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct WallDoorway {
    pub(super) wall: Wall,
    /// Left and right edge in metres along the wall.
    pub(super) along: [f32; 2],
    /// Height in metres.
    pub(super) top: f32,
}

/// Surfaces of the walls, and the doorways in them.
#[derive(Debug)]
pub(super) struct Shell {
    pub(super) walls: [Surface; 4],
    /// Covering of the lower part of all walls, with its height in metres; `None` for a uniform wall.
    pub(super) lower: Option<(Surface, f32)>,
    pub(super) skirting: Surface,
    pub(super) doorways: Vec<WallDoorway>,
}

/// sRGB codes of paints for walls.
const WALL_PAINTS: [u32; 14] = [
    0xcec6b8, 0xc2b8a8, 0xb8bcb6, 0xbaa892, 0x96a298, 0x9eaab8, 0xccba9c, 0x88949e, 0xb88e76, 0xd2ccc0, 0x8a9078,
    0xb0a0a4, 0x787e86, 0xc4b080,
];

/// sRGB codes of floors: boards, tiles and carpets.
const BOARDS: [u32; 6] = [0x9e7046, 0x765032, 0xb08a60, 0x84705c, 0x5c3e2a, 0x92623e];
const TILES: [u32; 6] = [0xb0aaa0, 0x808082, 0xa89680, 0x606266, 0x967058, 0xbab0a0];
const CARPETS: [u32; 6] = [0x9c9080, 0x6e707a, 0x8a7a6c, 0x565c68, 0x7e5c54, 0x687060];

impl Shell {
    /// Chooses random surfaces. If `tiled`, the lower 1.3 to 2.1 m of the walls are tiled.
    pub(super) fn new(tiled: bool, rng: &mut SeededRng) -> Self {
        let tint = linear_rgb(codes_from_hex(rng.pick(&WALL_PAINTS)));
        let base = Surface::plain([0; 3]).with_pattern(Pattern::Plaster);
        let plaster = Surface { color: tint, ..base.clone() };
        let other = tint * rng.between(0.66, 0.84);
        let paper = match rng.below(9) {
            0 => Pattern::Stripes(rng.between(0.04, 0.12), other),
            1 | 2 => Pattern::Flowers(rng.between(0.1, 0.26), other),
            3 => Pattern::Checks(rng.between(0.05, 0.12)),
            4 => Pattern::Masonry,
            _ => Pattern::Plaster,
        };
        let mut walls = [(); 4].map(|()| plaster.with_pattern(paper));
        // One wall may differ from the others.
        let accent = rng.pick(&[[140, 92, 74], [150, 138, 120], [104, 84, 66], [76, 88, 96]]);
        let stone = match rng.below(8) {
            0 => Some(Pattern::Tiles([0.24, 0.08], linear_rgb([176, 170, 160]))),
            1 => Some(Pattern::Masonry),
            2 => Some(Pattern::Boards(1, 0.14)),
            3 => Some(Pattern::Plaster),
            _ => None,
        };
        if let Some(stone) = stone {
            walls[rng.below(4)] = Surface::plain(accent).with_pattern(stone);
        }
        let glaze = rng.pick(&[[182, 194, 196], [150, 172, 168], [192, 184, 168], [140, 152, 168]]);
        let side = rng.pick(&[[0.2, 0.2], [0.15, 0.15], [0.3, 0.1], [0.25, 0.4]]);
        let wood = rng.pick(&[[110, 78, 54], [168, 160, 144], [88, 98, 96]]);
        let lower = if tiled {
            let tiles = Pattern::Tiles(side, linear_rgb([208, 204, 196]));
            Some((Surface::plain(glaze).with_pattern(tiles), rng.between(1.3, 2.1)))
        } else {
            let panels = Surface::plain(wood).with_pattern(Pattern::Boards(1, 0.1));
            rng.chance(0.15).then_some((panels, 0.9))
        };
        Self {
            walls,
            lower,
            skirting: Surface::plain(rng.pick(&[[188, 184, 174], [96, 66, 44], [150, 146, 138]])),
            doorways: Vec::new(),
        }
    }
}

/// Chooses a random surface for a floor.
pub(super) fn floor_surface(flooring: Flooring, rng: &mut SeededRng) -> Surface {
    match flooring {
        Flooring::Wood => {
            let width = rng.between(0.07, 0.16);
            let axis = rng.pick(&[0, 2]);
            Surface::plain(codes_from_hex(rng.pick(&BOARDS))).with_pattern(Pattern::Boards(axis, width))
        }
        Flooring::Tiles => {
            let side = rng.between(0.15, 0.4);
            let joint = linear_rgb(rng.pick(&[[110, 106, 100], [198, 194, 186]]));
            Surface::plain(codes_from_hex(rng.pick(&TILES))).with_pattern(Pattern::Tiles([side, side], joint))
        }
        Flooring::Carpet => {
            let surface = Surface::plain(codes_from_hex(rng.pick(&CARPETS)));
            match rng.below(3) {
                0 => {
                    let other = surface.color * rng.between(0.6, 0.8);
                    surface.with_pattern(Pattern::Flowers(rng.between(0.1, 0.3), other))
                }
                _ => surface.with_pattern(Pattern::Pile),
            }
        }
    }
}
