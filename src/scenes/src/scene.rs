//! A room with everything in it: [`Scene`], made of [`Thing`]s.

use glam::{Vec3, vec3};

use super::bvh::Bvh;
use super::mesh::{Mesh, cos_sin};
use super::surface::{Surface, SurfaceFinish};

/// The word and the class of a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ThingKind {
    /// The name of the thing, as `coffee table`.
    pub(super) word: &'static str,
    /// The class of the thing in mpcat40.
    pub(super) class: &'static str,
}

pub(super) const fn kind(word: &'static str, class: &'static str) -> ThingKind {
    ThingKind { word, class }
}

/// A thing before it has a place in the room.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub(super) kind: ThingKind,
    pub(super) mesh: Mesh,
    /// The name of its main colour; empty if there is none.
    pub(super) color: &'static str,
    pub(super) light: Option<LightSource>,
}

impl Piece {
    pub(super) fn new(kind: ThingKind, mesh: Mesh, color: &'static str) -> Self {
        Self {
            kind,
            mesh,
            color,
            light: None,
        }
    }

    /// The piece with another word for it.
    pub(super) fn named(mut self, word: &'static str) -> Self {
        self.kind.word = word;
        self
    }
}

/// The position of a piece in metres, and its rotation about y in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    pub(super) at: Vec3,
    pub(super) angle: f32,
}

impl Pose {
    /// A point of the room in the coordinates of the piece.
    pub(super) fn to_piece(self, place: Vec3) -> Vec3 {
        self.direction_to_piece(place - self.at)
    }

    /// A direction of the room in the coordinates of the piece.
    pub(super) fn direction_to_piece(&self, v: Vec3) -> Vec3 {
        let rotation = cos_sin(self.angle);
        vec3(
            v.x * rotation.x - v.z * rotation.y,
            v.y,
            v.z * rotation.x + v.x * rotation.y,
        )
    }

    /// A point of the piece in the coordinates of the room.
    pub(super) fn to_room(self, v: Vec3) -> Vec3 {
        let rotation = cos_sin(self.angle);
        self.at
            + vec3(
                v.x * rotation.x + v.z * rotation.y,
                v.y,
                v.z * rotation.x - v.x * rotation.y,
            )
    }
}

/// A piece at its place in the room.
#[derive(Debug, Clone)]
pub(super) struct Thing {
    pub(super) kind: ThingKind,
    pub(super) color: &'static str,
    pub(super) pose: Pose,
}

/// A light of the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LightSource {
    /// A flat light, as the daylight in a window: a corner, two edges, the direction it shines in, and radiance by channel.
    Panel {
        corner: Vec3,
        edges: [Vec3; 2],
        normal: Vec3,
        radiance: Vec3,
    },
    /// A sphere of light, as a bulb: center and radius in metres, and radiance by channel.
    Bulb {
        middle: Vec3,
        radius: f32,
        radiance: Vec3,
    },
}

impl LightSource {
    /// The light of a piece in the coordinates of the room.
    fn placed(self, pose: &Pose) -> Self {
        match self {
            Self::Panel {
                corner,
                edges,
                normal,
                radiance,
            } => {
                let turned = |v: Vec3| pose.to_room(v) - pose.at;
                Self::Panel {
                    corner: pose.to_room(corner),
                    edges: edges.map(turned),
                    normal: turned(normal),
                    radiance,
                }
            }
            Self::Bulb {
                middle,
                radius,
                radiance,
            } => Self::Bulb {
                middle: pose.to_room(middle),
                radius,
                radiance,
            },
        }
    }
}

/// A room with everything in it.
#[derive(Debug, Default)]
pub(super) struct Scene {
    /// The things in the order of their segment numbers, which start at 1.
    pub(super) things: Vec<Thing>,
    pub(super) lights: Vec<LightSource>,
    /// The triangles of all things.
    pub(super) mesh: Mesh,
    /// The index of the thing that each face belongs to.
    pub(super) owners: Vec<usize>,
    /// The index of the thing that each light belongs to.
    lamps: Vec<usize>,
}

impl Scene {
    /// Adds a piece with a pose.
    pub(super) fn add(&mut self, piece: &Piece, pose: Pose) {
        self.mesh.add(&piece.mesh, pose.at, pose.angle);
        self.owners.resize(self.mesh.faces.len(), self.things.len());
        if let Some(light) = piece.light {
            self.lights.push(light.placed(&pose));
            self.lamps.push(self.things.len());
        }
        self.things.push(Thing {
            kind: piece.kind,
            color: piece.color,
            pose,
        });
    }

    /// Radiance of each light source: of a window that of the daylight, and of a lamp that of its shade. The flux of a bulb, 4π²r² times
    /// its radiance, leaves through the shade, which is modelled as a Lambertian surface: π times its area times its radiance.
    pub(super) fn radiances(&self) -> Vec<Option<Vec3>> {
        let mut areas = vec![0.0_f32; self.things.len()];
        for (place, (face, owner)) in self.mesh.faces.iter().zip(&self.owners).enumerate() {
            if matches!(self.surface(place).finish, SurfaceFinish::Glow(_)) {
                let [a, b, c] = face.corners.map(|corner| corner.at);
                areas[*owner] += (b - a).cross(c - a).length() / 2.0;
            }
        }
        let mut radiances = vec![None; self.things.len()];
        for (light, owner) in self.lights.iter().zip(&self.lamps) {
            radiances[*owner] = match *light {
                LightSource::Panel { radiance, .. } => Some(radiance),
                LightSource::Bulb {
                    radius, radiance, ..
                } => {
                    let share = 4.0 * std::f32::consts::PI * radius * radius;
                    let area = areas[*owner];
                    (area > 0.0).then(|| radiance * (share / area))
                }
            };
        }
        radiances
    }

    /// The surface of a face.
    pub(super) fn surface(&self, face: usize) -> &Surface {
        &self.mesh.surfaces[self.mesh.faces[face].surface]
    }

    /// The tree over all faces, for tracing rays.
    pub(super) fn tree(&self) -> Bvh {
        Bvh::new(self.mesh.faces.iter().map(|face| {
            let clear = matches!(
                self.mesh.surfaces[face.surface].finish,
                SurfaceFinish::Glow(_)
            );
            (face.corners.map(|corner| corner.at), clear)
        }))
    }
}
