//! A furnished room: [`Scene`], made of [`Thing`]s.

use glam::{Vec3, vec3};

use super::bvh::Bvh;
use super::mesh::{Mesh, cos_sin};
use super::surface::{Surface, SurfaceFinish};
use darkqa_base::types::SegmentName;

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
