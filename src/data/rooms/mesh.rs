//! Triangle meshes ([`Mesh`]) and the solids that furniture is made of.
//!
//! Lengths are in metres and angles in radians. x points to the right, y up and z to the front. The bottom of a piece
//! is at y = 0, its back at z = 0 and its middle at x = 0.
//!
//! A furnished room: [`Scene`], made of [`Thing`]s.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3, vec2, vec3};

use super::bvh::Bvh;
use super::pattern::{Surface, SurfaceFinish};
use darkqa_base::types::SegmentName;

/// A corner of a triangle: position and surface normal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
}

/// A triangle: three corners and the index of its surface in the mesh.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    pub(super) corners: [Corner; 3],
    pub(super) surface: usize,
}

impl Face {
    /// Points on the triangle, including its corners, at most `spacing` metres apart along each edge.
    pub(super) fn points(&self, spacing: f32) -> impl Iterator<Item = Vec3> {
        let [a, b, c] = self.corners.map(|corner| corner.position);
        let longest = (b - a).length().max((c - a).length()).max((c - b).length());
        let count = (longest / spacing).ceil().max(1.0) as usize;
        (0..=count).flat_map(move |i| {
            (0..=count - i).map(move |j| a + (b - a) * (i as f32 / count as f32) + (c - a) * (j as f32 / count as f32))
        })
    }
}

/// A mesh of triangles with their surfaces.
#[derive(Debug, Clone, Default)]
pub(super) struct Mesh {
    pub(super) faces: Vec<Face>,
    pub(super) surfaces: Vec<Surface>,
}

/// Number of sides of round shapes (chosen).
const SIDES: usize = 20;

/// Number of rows of shapes that are round in two directions (chosen).
const ROWS: usize = 10;

/// Normal of a point of a grid; `is_closed` if the first column of the grid is also its last.
fn grid_normal(rows: &[Vec<Vec3>], [y, x]: [usize; 2], is_closed: bool) -> Vec3 {
    let (height, width) = (rows.len(), rows[0].len());
    let (left, right) = match (x, is_closed) {
        (0, true) => (width - 2, 1),
        (x, true) if x == width - 1 => (x - 1, 1),
        _ => (x.saturating_sub(1), (x + 1).min(width - 1)),
    };
    let mut along = rows[y][right] - rows[y][left];
    let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
    let mut across = rows[below][x] - rows[above][x];
    if along.length_squared() < 1e-12 {
        // At the pole of a round shape the neighbouring row gives the direction.
        let near = if y == 0 { 1 } else { y - 1 };
        along = rows[near][right] - rows[near][left];
    }
    if across.length_squared() < 1e-12 {
        across = rows[below][x] - rows[y][x];
    }
    along.cross(across).normalize_or_zero()
}

/// −1 for negative numbers, otherwise 1.
pub(super) fn sign(value: f32) -> f32 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// Cosine (x) and sine (y) of an angle in radians, the same on every machine.
pub(super) fn cos_sin(angle: f32) -> Vec2 {
    let (sine, cosine) = libm::sincosf(angle);
    vec2(cosine, sine)
}

impl Mesh {
    /// Returns the index of a surface, after adding it if it is new.
    fn surface_index(&mut self, surface: &Surface) -> usize {
        if let Some(known) = self.surfaces.iter().position(|known| known == surface) {
            return known;
        }
        self.surfaces.push(surface.clone());
        self.surfaces.len() - 1
    }

    /// Adds a triangle unless it is degenerate.
    fn triangle(&mut self, corners: [Corner; 3], surface: usize) {
        let [a, b, c] = corners.map(|corner| corner.position);
        if (b - a).cross(c - a).length_squared() > 1e-14 {
            self.faces.push(Face { corners, surface });
        }
    }

    /// Adds a flat quadrilateral. The order of its corners determines the normal: (b − a) × (d − a).
    pub(super) fn quad(&mut self, corners: [Vec3; 4], surface: &Surface) {
        let surface = self.surface_index(surface);
        let [a, b, _, d] = corners;
        let normal = (b - a).cross(d - a).normalize_or_zero();
        let [a, b, c, d] = corners.map(|position| Corner { position, normal });
        self.triangle([a, b, c], surface);
        self.triangle([a, c, d], surface);
    }

    /// Adds a smooth surface over a grid of points. All rows have the same length.
    pub(super) fn grid(&mut self, rows: &[Vec<Vec3>], surface: &Surface) {
        let surface = self.surface_index(surface);
        let (height, width) = (rows.len(), rows.first().map_or(0, Vec::len));
        let is_closed = rows.iter().all(|row| row[0].distance_squared(row[width - 1]) < 1e-10);
        let corners: Vec<Vec<Corner>> = (0..height)
            .map(|y| {
                (0..width)
                    .map(|x| Corner { position: rows[y][x], normal: grid_normal(rows, [y, x], is_closed) })
                    .collect()
            })
            .collect();
        for pair in corners.windows(2) {
            for x in 0..width - 1 {
                let (a, b, c, d) = (pair[0][x], pair[0][x + 1], pair[1][x + 1], pair[1][x]);
                self.triangle([a, b, c], surface);
                self.triangle([a, c, d], surface);
            }
        }
    }

    /// Adds a box with sharp edges, given by its lowest and its highest corner.
    pub(super) fn block(&mut self, low: Vec3, high: Vec3, surface: &Surface) {
        let ends = [low, high];
        let at = |x: usize, y: usize, z: usize| vec3(ends[x].x, ends[y].y, ends[z].z);
        for side in [
            [at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)],
            [at(1, 0, 0), at(0, 0, 0), at(0, 1, 0), at(1, 1, 0)],
            [at(1, 0, 1), at(1, 0, 0), at(1, 1, 0), at(1, 1, 1)],
            [at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)],
            [at(0, 1, 1), at(1, 1, 1), at(1, 1, 0), at(0, 1, 0)],
            [at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)],
        ] {
            self.quad(side, surface);
        }
    }

    /// Adds a box centered at x = 0, given by half of its width and its bounds in y and z.
    pub(super) fn board(&mut self, half_width: f32, y: [f32; 2], z: [f32; 2], surface: &Surface) {
        self.block(vec3(-half_width, y[0], z[0]), vec3(half_width, y[1], z[1]), surface);
    }

    /// Adds a [board](Self::board) with rounded edges.
    pub(super) fn cushion(&mut self, half_width: f32, y: [f32; 2], z: [f32; 2], radius: f32, surface: &Surface) {
        let (low, high) = (vec3(-half_width, y[0], z[0]), vec3(half_width, y[1], z[1]));
        self.rounded_box(low, high, radius, surface);
    }

    /// Adds a box, given by the center of its bottom face and its size.
    pub(super) fn slab(&mut self, foot: Vec3, size: Vec3, surface: &Surface) {
        let half = vec3(size.x / 2.0, 0.0, size.z / 2.0);
        self.block(foot - half, foot + half + vec3(0.0, size.y, 0.0), surface);
    }

    /// Adds two [slabs](Self::slab), at x and at −x.
    pub(super) fn mirrored_slabs(&mut self, foot: Vec3, size: Vec3, surface: &Surface) {
        for x in [-foot.x, foot.x] {
            self.slab(vec3(x, foot.y, foot.z), size, surface);
        }
    }

    /// Adds a box with rounded edges: the Minkowski sum of a box and a ball.
    pub(super) fn rounded_box(&mut self, low: Vec3, high: Vec3, radius: f32, surface: &Surface) {
        let radius = radius.min((high - low).min_element() / 2.0 * 0.999);
        let (middle, inner) = ((low + high) / 2.0, (high - low) / 2.0 - Vec3::splat(radius));
        // The middle row is doubled, so that the flat sides between the rounded edges stay flat.
        let mut rows = Vec::new();
        for (row, end) in (0..=ROWS).flat_map(|row| {
            let twice = row == ROWS / 2;
            [Some((row, 1.0)), twice.then_some((row, -1.0))].into_iter().flatten()
        }) {
            let height = if row == ROWS / 2 { end } else { sign(ROWS as f32 / 2.0 - row as f32) };
            let mut line: Vec<Vec3> = (0..SIDES)
                .rev()
                .map(|side: usize| {
                    let down = cos_sin(PI * row as f32 / ROWS as f32);
                    let around = cos_sin(TAU * (side as f32 + 0.5) / SIDES as f32);
                    let out = vec3(around.x * down.y, down.x, around.y * down.y);
                    let corner = vec3(sign(out.x), height, sign(out.z)) * inner;
                    middle + corner + out * radius
                })
                .collect();
            line.push(line[0]);
            rows.push(line);
        }
        let (top, bottom) = (rows[0].clone(), rows[rows.len() - 1].clone());
        self.grid(&rows, surface);
        self.cap(&top, Vec3::Y, surface);
        self.cap(&bottom, Vec3::NEG_Y, surface);
    }

    /// Adds a flat cap over a closed ring of points.
    fn cap(&mut self, ring: &[Vec3], normal: Vec3, surface: &Surface) {
        let surface = self.surface_index(surface);
        let middle = ring.iter().sum::<Vec3>() / ring.len() as f32;
        for pair in ring.windows(2) {
            self.triangle([middle, pair[0], pair[1]].map(|position| Corner { position, normal }), surface);
        }
    }

    /// Adds a solid of revolution about y with sharp edges, stretched along z by the factor `depth`. `profile` lists
    /// (radius, height above `foot`) pairs from the bottom to the top.
    pub(super) fn lathe(&mut self, foot: Vec3, profile: &[(f32, f32)], depth: f32, surface: &Surface) {
        // Each section between two radii gets its own normals, so that the edges are sharp.
        for pair in profile.windows(2) {
            let rings = [pair[0], pair[1]].map(|(radius, height)| ring(foot, radius, height, depth));
            self.grid(&rings, surface);
        }
    }

    /// Adds a [solid of revolution](Self::lathe) without sharp edges.
    pub(super) fn smooth_lathe(&mut self, foot: Vec3, profile: &[(f32, f32)], depth: f32, surface: &Surface) {
        let rings: Vec<_> = profile.iter().map(|(radius, height)| ring(foot, *radius, *height, depth)).collect();
        self.grid(&rings, surface);
    }

    /// Adds a cylinder between two points, with closed ends.
    pub(super) fn rod(&mut self, from: Vec3, to: Vec3, radius: f32, surface: &Surface) {
        self.cone(from, to, [radius, radius], surface);
    }

    /// Adds a rod with a radius for each end.
    pub(super) fn cone(&mut self, from: Vec3, to: Vec3, radii: [f32; 2], surface: &Surface) {
        let axis = (to - from).normalize_or_zero();
        let aside = if axis.y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
        let across = axis.cross(aside).normalize_or_zero();
        let over = axis.cross(across);
        let [low, high]: [Vec<Vec3>; 2] = [(from, radii[0]), (to, radii[1])].map(|(middle, radius)| {
            (0..=SIDES)
                .map(|side: usize| {
                    let around = cos_sin(TAU * (side % SIDES) as f32 / SIDES as f32);
                    middle + (across * around.x + over * around.y) * radius
                })
                .collect()
        });
        self.grid(&[low.clone(), high.clone()], surface);
        self.cap(&low, -axis, surface);
        self.cap(&high, axis, surface);
    }

    /// Adds an ellipsoid, given by its center and its three radii.
    pub(super) fn ball(&mut self, middle: Vec3, radii: Vec3, surface: &Surface) {
        let rows: Vec<Vec<Vec3>> = (0..=ROWS)
            .map(|row: usize| -> Vec<Vec3> {
                let down = cos_sin(PI * row as f32 / ROWS as f32);
                (0..=SIDES)
                    .rev()
                    .map(|side: usize| {
                        let around = cos_sin(TAU * (side % SIDES) as f32 / SIDES as f32);
                        middle + vec3(around.x * down.y, down.x, around.y * down.y) * radii
                    })
                    .collect()
            })
            .collect();
        self.grid(&rows, surface);
    }

    /// Adds a pillow, thick in its middle and thin at its seam. `size` is the width, height and thickness of the
    /// upright pillow; `lean` is the angle by which its top is tilted backwards.
    pub(super) fn pillow(&mut self, middle: Vec3, size: Vec3, lean: f32, surface: &Surface) {
        const CELLS: usize = 10;
        let tilt = cos_sin(lean);
        for side in [1.0_f32, -1.0] {
            let point = |row: usize, column: usize| {
                let [across, down] = [column, row].map(|cell| 2.0 * cell as f32 / CELLS as f32 - 1.0);
                let (u, v) = (across * side, -down);
                let (u4, v4) = (u * u * u * u, v * v * v * v);
                let swell = ((1.0 - u4) * (1.0 - v4)).max(0.0).sqrt();
                // The corners reach a little farther out than the middle of the edges.
                let pinch = vec2(1.0 - 0.06 * (1.0 - v * v), 1.0 - 0.06 * (1.0 - u * u));
                let flat = vec3(u * pinch.x, v * pinch.y, side * swell) * size / 2.0;
                let turned = vec3(flat.x, flat.y * tilt.x + flat.z * tilt.y, flat.z * tilt.x - flat.y * tilt.y);
                middle + turned
            };
            let rows: Vec<Vec<Vec3>> =
                (0..=CELLS).map(|row| (0..=CELLS).map(|column| point(row, column)).collect()).collect();
            self.grid(&rows, surface);
        }
    }

    /// Adds cloth that hangs in folds: `width` along x from `left`, `drop` downwards; `fold` is the width of one fold.
    pub(super) fn drape(&mut self, left: Vec3, width: f32, drop: f32, fold: f32, surface: &Surface) {
        let columns = ((width / fold) as usize).max(1) * 8;
        let rows: [Vec<Vec3>; 4] = [0.0, 0.33, 0.67, 1.0].map(|height| {
            (0..=columns)
                .map(|column| {
                    let share = column as f32 / columns as f32;
                    let wave = cos_sin(TAU * share * width / fold).y;
                    let depth = 0.3 * fold * wave * (0.6 + 0.4 * height);
                    left + vec3(share * width, -height * drop, depth)
                })
                .collect()
        });
        self.grid(&rows, surface);
    }

    /// Adds another mesh, rotated about y by `angle` and then moved by `offset`.
    pub(super) fn add(&mut self, other: &Self, offset: Vec3, angle: f32) {
        let rotation = cos_sin(angle);
        let surfaces: Vec<usize> = other.surfaces.iter().map(|s| self.surface_index(s)).collect();
        self.faces.extend(other.faces.iter().map(|face| Face {
            corners: face.corners.map(|corner| {
                let [position, normal] = [corner.position, corner.normal]
                    .map(|v| vec3(v.x * rotation.x + v.z * rotation.y, v.y, v.z * rotation.x - v.x * rotation.y));
                Corner { position: offset + position, normal }
            }),
            surface: surfaces[face.surface],
        }));
    }

    /// Returns the mirror image in the plane x = 0.
    pub(super) fn mirrored(mut self) -> Self {
        let flip = vec3(-1.0, 1.0, 1.0);
        for corner in self.faces.iter_mut().flat_map(|face| &mut face.corners) {
            (corner.position, corner.normal) = (corner.position * flip, corner.normal * flip);
        }
        self
    }

    /// Multiplies all lengths by a factor.
    pub(super) fn scale(&mut self, factor: f32) {
        for corner in self.faces.iter_mut().flat_map(|face| &mut face.corners) {
            corner.position *= factor;
        }
    }
}

/// Lowest and highest corner of the bounding box of triangles.
pub(super) fn bounds(faces: &[Face]) -> [Vec3; 2] {
    faces
        .iter()
        .flat_map(|face| face.corners)
        .fold([Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)], |[low, high], corner| {
            [low.min(corner.position), high.max(corner.position)]
        })
}

/// Closed ring of points about y, given by its radius and its height above `foot`; `depth` stretches it along z.
fn ring(foot: Vec3, radius: f32, height: f32, depth: f32) -> Vec<Vec3> {
    (0..=SIDES)
        .map(|side: usize| {
            let around = cos_sin(TAU * (side % SIDES) as f32 / SIDES as f32);
            foot + vec3(around.x * radius, height, around.y * radius * depth)
        })
        .collect()
}

/// Word and class of a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ThingKind {
    /// Name of the thing, such as `coffee table`.
    pub(super) word: &'static str,
    /// Class of the thing in mpcat40.
    pub(super) class: &'static str,
}

impl ThingKind {
    /// Name of a segment that shows such a thing.
    pub(super) fn segment_name(&self) -> SegmentName {
        SegmentName { name: self.word.to_owned(), canonical: self.class.to_owned(), region: None }
    }
}

/// Creates a [`ThingKind`].
pub(super) const fn kind(word: &'static str, class: &'static str) -> ThingKind {
    ThingKind { word, class }
}

/// A thing that is not yet placed in the room.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub(super) kind: ThingKind,
    pub(super) mesh: Mesh,
    /// Name of the main colour; empty if people would not agree on one.
    pub(super) color: &'static str,
    pub(super) light: Option<LightSource>,
}

impl Piece {
    pub(super) fn new(kind: ThingKind, mesh: Mesh, color: &'static str) -> Self {
        Self { kind, mesh, color, light: None }
    }

    /// Returns the piece with another word.
    pub(super) fn with_word(mut self, word: &'static str) -> Self {
        self.kind.word = word;
        self
    }
}

/// Position of a piece in metres, and its rotation about y in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    pub(super) position: Vec3,
    pub(super) angle: f32,
}

impl Pose {
    pub(super) fn new(position: Vec3, angle: f32) -> Self {
        Self { position, angle }
    }

    /// Transforms a point from room coordinates to those of the piece.
    pub(super) fn to_piece(self, point: Vec3) -> Vec3 {
        self.direction_to_piece(point - self.position)
    }

    /// Rotates a direction from room coordinates to those of the piece.
    pub(super) fn direction_to_piece(&self, v: Vec3) -> Vec3 {
        let rotation = cos_sin(self.angle);
        vec3(v.x * rotation.x - v.z * rotation.y, v.y, v.z * rotation.x + v.x * rotation.y)
    }

    /// Transforms a point from the coordinates of the piece to room coordinates.
    pub(super) fn to_room(self, v: Vec3) -> Vec3 {
        let rotation = cos_sin(self.angle);
        self.position + vec3(v.x * rotation.x + v.z * rotation.y, v.y, v.z * rotation.x - v.x * rotation.y)
    }
}

/// A piece that is placed in the room.
#[derive(Debug, Clone)]
pub(super) struct Thing {
    pub(super) kind: ThingKind,
    pub(super) color: &'static str,
    pub(super) pose: Pose,
}

/// A light source of the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LightSource {
    /// A flat light, such as the daylight in a window: a corner, two edges, the direction it shines in, and radiance by
    /// channel.
    Panel { corner: Vec3, edges: [Vec3; 2], normal: Vec3, radiance: Vec3 },
    /// A glowing sphere, such as a bulb: center and radius in metres, and radiance by channel.
    Bulb { middle: Vec3, radius: f32, radiance: Vec3 },
}

impl LightSource {
    /// Transforms the light of a piece to room coordinates.
    fn to_room(self, pose: &Pose) -> Self {
        match self {
            Self::Panel { corner, edges, normal, radiance } => Self::Panel {
                corner: pose.to_room(corner),
                edges: edges.map(|edge| pose.to_room(edge) - pose.position),
                normal: pose.to_room(normal) - pose.position,
                radiance,
            },
            Self::Bulb { middle, radius, radiance } => Self::Bulb { middle: pose.to_room(middle), radius, radiance },
        }
    }
}

/// A furnished room.
#[derive(Debug, Default)]
pub(super) struct Scene {
    /// All things, in order of their segment numbers, which start at 1.
    pub(super) things: Vec<Thing>,
    pub(super) lights: Vec<LightSource>,
    /// Triangles of all things.
    pub(super) mesh: Mesh,
    /// Index of the thing that each face belongs to.
    pub(super) face_owners: Vec<usize>,
    /// Index of the thing that each light belongs to.
    light_owners: Vec<usize>,
}

impl Scene {
    /// Adds a piece at a pose.
    pub(super) fn add(&mut self, piece: &Piece, pose: Pose) {
        self.mesh.add(&piece.mesh, pose.position, pose.angle);
        self.face_owners.resize(self.mesh.faces.len(), self.things.len());
        if let Some(light) = piece.light {
            self.lights.push(light.to_room(&pose));
            self.light_owners.push(self.things.len());
        }
        self.things.push(Thing { kind: piece.kind, color: piece.color, pose });
    }

    /// Radiance of each thing: of the daylight for a window, of the shade for a lamp, `None` for other things. The flux
    /// of a bulb, 4π²r² times its radiance, leaves through the shade, which is modelled as a Lambertian surface: π
    /// times its area times its radiance.
    pub(super) fn radiances(&self) -> Vec<Option<Vec3>> {
        let mut areas = vec![0.0_f32; self.things.len()];
        for (index, (face, owner)) in self.mesh.faces.iter().zip(&self.face_owners).enumerate() {
            if matches!(self.surface(index).finish, SurfaceFinish::Glow(_)) {
                let [a, b, c] = face.corners.map(|corner| corner.position);
                areas[*owner] += (b - a).cross(c - a).length() / 2.0;
            }
        }
        let mut radiances = vec![None; self.things.len()];
        for (light, owner) in self.lights.iter().zip(&self.light_owners) {
            radiances[*owner] = match *light {
                LightSource::Panel { radiance, .. } => Some(radiance),
                LightSource::Bulb { radius, radiance, .. } => {
                    let share = 4.0 * std::f32::consts::PI * radius * radius;
                    let area = areas[*owner];
                    (area > 0.0).then(|| radiance * (share / area))
                }
            };
        }
        radiances
    }

    /// Surface of a face, given by its index.
    pub(super) fn surface(&self, face: usize) -> &Surface {
        &self.mesh.surfaces[self.mesh.faces[face].surface]
    }

    /// Builds the tree over all faces, for tracing rays.
    pub(super) fn tree(&self) -> Bvh {
        Bvh::new(self.mesh.faces.iter().map(|face| {
            let passes_light = matches!(self.mesh.surfaces[face.surface].finish, SurfaceFinish::Glow(_));
            (face.corners.map(|corner| corner.position), passes_light)
        }))
    }
}
