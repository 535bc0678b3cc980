//! Clutter: small things on furniture, on the floor and on walls.

use glam::{Vec3, vec2, vec3};

use super::furniture::parts;
use super::mesh::{Face, Piece, Pose, bounds};
use super::plan::{FloorArea, FloorPlan, WALLS};

/// Furniture that carries clutter: its word, the place name of its clutter in the parts table, the height of the
/// surface in metres (0 for the top of the furniture), and the share of the depth, from the back, that remains empty.
const SURFACES: [(&str, &str, f32, f32); 15] = [
    ("desk", "desk", 0.0, 0.0),
    ("coffee table", "living", 0.0, 0.0),
    ("side table", "living", 0.0, 0.0),
    ("dining table", "dining", 0.0, 0.0),
    ("table", "kitchen", 0.0, 0.0),
    ("dresser", "living", 0.0, 0.0),
    ("nightstand", "bed", 0.0, 0.0),
    ("cabinet", "living", 0.0, 0.0),
    ("kitchen counter", "kitchen", 0.9, 0.05),
    ("shelf", "shelf", 0.0, 0.0),
    ("bookshelf", "shelf", 0.0, 0.0),
    ("fireplace", "living", 0.0, 0.0),
    ("toilet", "bath", 0.0, 0.0),
    ("bed", "bed", 0.56, 0.35),
    ("sofa", "sofa", 0.46, 0.3),
];

/// Number of things per square metre of a surface (chosen), before scaling by the mess of the room. Three placements
/// are tried for each.
const DENSITY: f32 = 9.0;

/// Minimum gap between adjacent things, in metres.
const GAP: f32 = 0.006;

/// True if two bounding boxes overlap or are closer than [`GAP`].
fn boxes_overlap([low, high]: &[Vec3; 2], [other_low, other_high]: &[Vec3; 2]) -> bool {
    low.cmplt(*other_high + GAP).all() && other_low.cmplt(*high + GAP).all()
}

impl FloorPlan {
    /// Adds small things to a furnished room; `floor` is the place name of the floor things in the parts table.
    pub(super) fn add_clutter(&mut self, floor: &str) {
        let mess = self.rng.between(0.4, 1.6);
        for thing in 0..self.scene.things.len() {
            let word = self.scene.things[thing].kind.word;
            let top = SURFACES.iter().find(|(known, ..)| *known == word);
            if let Some((_, place, height, from)) = top {
                self.add_on_top(thing, place, [*height, *from], mess);
            }
        }
        for _ in 0..(3.5 * mess) as usize {
            self.add_on_floor(floor);
        }
        let on_walls = parts::names_found_at("wall");
        for _ in 0..2 + self.rng.below(4) {
            let name = self.rng.pick(&on_walls);
            let piece = parts::piece(name, &mut self.rng);
            self.hang(&piece, &WALLS, 0.0);
        }
    }

    /// Adds clutter to the surface of a thing. `place` is a place name in the parts table, `height` the height of the
    /// surface in metres (0 for the top), `from` the empty share of its depth.
    fn add_on_top(&mut self, thing: usize, place: &str, [height, from]: [f32; 2], mess: f32) {
        let pose = self.scene.things[thing].pose;
        let (mut low, high) = self
            .faces(thing)
            .flat_map(|face| face.corners)
            .map(|corner| pose.to_piece(corner.position))
            .fold((Vec3::MAX, Vec3::MIN), |(low, high), corner| (low.min(corner), high.max(corner)));
        // Things on high furniture are invisible from below.
        let top = if height > 0.0 { height } else { high.y };
        if top > 1.7 {
            return;
        }
        low.z += (high.z - low.z) * from;
        let area = (high.x - low.x) * (high.z - low.z);
        // Seats and beds are mostly empty.
        let count = if from > 0.0 && height < 0.8 {
            usize::from(self.rng.chance(0.3))
        } else {
            (area * DENSITY * mess).clamp(1.0, 7.0) as usize
        };
        let names = parts::names_found_at(place);
        for _ in 0..count * 3 {
            let name = self.rng.pick(&names);
            let piece = parts::piece(name, &mut self.rng);
            let [x, z] = [0, 2].map(|axis| self.rng.between(low[axis], high[axis]));
            let angle = pose.angle + self.rng.between(-0.5, 0.5);
            let foot = Pose::new(pose.to_room(vec3(x, top + 0.001, z)), angle);
            let corners = lower_corners(&piece).map(|corner| foot.to_room(corner));
            if corners.iter().all(|corner| self.is_on_surface(thing, *corner)) {
                self.add_if_free(piece, foot, Some(thing));
            }
        }
    }

    /// True if a point is over or under a horizontal triangle of a thing, within 12 mm in height.
    fn is_on_surface(&self, thing: usize, point: Vec3) -> bool {
        self.faces(thing).any(|face| {
            let corners = face.corners.map(|corner| corner.position);
            if !corners.into_iter().all(|corner| (point.y - corner.y).abs() < 0.012) {
                return false;
            }
            let [a, b, c] = corners.map(|corner| vec2(corner.x - point.x, corner.z - point.z));
            let turns = [a.perp_dot(b), b.perp_dot(c), c.perp_dot(a)];
            turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0)
        })
    }

    /// Faces of a thing.
    fn faces(&self, thing: usize) -> impl Iterator<Item = &Face> {
        self.scene
            .mesh
            .faces
            .iter()
            .zip(&self.scene.face_owners)
            .filter(move |(_, owner)| **owner == thing)
            .map(|(face, _)| face)
    }

    /// Adds a piece and returns true, unless it would leave the room or overlap a thing other than `below`. Things
    /// lower than 2 cm, such as rugs, do not block it.
    fn add_if_free(&mut self, piece: Piece, pose: Pose, below: Option<usize>) -> bool {
        let bounding_box = piece
            .mesh
            .faces
            .iter()
            .flat_map(|face| face.corners)
            .map(|corner| pose.to_room(corner.position))
            .fold([Vec3::MAX, Vec3::MIN], |[low, high], corner| [low.min(corner), high.max(corner)]);
        let is_blocked = self.boxes.iter().enumerate().any(|(thing, other)| {
            let is_flat = other[1].y - other[0].y < 0.02;
            Some(thing) != below && !is_flat && boxes_overlap(&bounding_box, other)
        });
        let is_inside = bounding_box[0].x > 0.0
            && bounding_box[0].z > 0.0
            && bounding_box[1].x <= self.size.x
            && bounding_box[1].z <= self.size.z;
        if is_blocked || !is_inside {
            return false;
        }
        self.add(piece, pose);
        true
    }

    /// Adds a thing on the floor, mostly near a wall.
    fn add_on_floor(&mut self, place: &str) {
        let names = parts::names_found_at(place);
        let name = self.rng.pick(&names);
        let piece = parts::piece(name, &mut self.rng);
        for _ in 0..12 {
            let wall = self.rng.pick(&WALLS);
            let along = self.rng.between(0.3, self.wall_length(wall) - 0.3);
            let out = if self.rng.chance(0.6) { 0.1 } else { 1.4 };
            let pose = self.wall_pose(wall, along, 0.0);
            let foot = pose.to_room(vec3(0.0, 0.013, self.rng.between(0.03, out)));
            let angle = pose.angle + self.rng.between(-0.6, 0.6);
            let [low, high] = [foot - 0.16, foot + 0.16];
            let floor_area = FloorArea([low.x.max(0.01), low.z.max(0.01), high.x, high.z]);
            if self.is_free(&floor_area) && self.add_if_free(piece.clone(), Pose::new(foot, angle), None) {
                self.reserve_floor(&Pose::new(foot, 0.0), vec3(0.36, 0.0, 0.36), -0.18);
                return;
            }
        }
    }
}

/// Lower corners of the bounding box of a piece, projected to height 0.
fn lower_corners(piece: &Piece) -> [Vec3; 4] {
    let [low, high] = bounds(&piece.mesh.faces);
    [(low.x, low.z), (high.x, low.z), (high.x, high.z), (low.x, high.z)].map(|(x, z)| vec3(x, 0.0, z))
}
