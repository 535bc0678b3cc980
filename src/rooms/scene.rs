//! A room with all that stands in it: [`Scene`], made of [`Thing`]s.

use glam::{Vec3, vec3};

use super::bvh::Bvh;
use super::mesh::{Mesh, turn};
use super::surface::{Surface, SurfaceFinish};

/// What a thing is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ThingKind {
    /// Its own word, as `coffee table`.
    pub(super) word: &'static str,
    /// Its class in mpcat40.
    pub(super) class: &'static str,
}

/// A kind by its word and class.
pub(super) const fn kind(word: &'static str, class: &'static str) -> ThingKind {
    ThingKind { word, class }
}

/// A piece before it has a place: its kind, its shape, and the name of the colour that most of it has; empty where there is none.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub(super) kind: ThingKind,
    pub(super) mesh: Mesh,
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
}

/// Where a piece stands, and how far it is turned about y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    pub(super) at: Vec3,
    pub(super) angle: f32,
}

impl Pose {
    /// A place of the room in the piece's own lengths.
    pub(super) fn inward(&self, place: Vec3) -> Vec3 {
        self.unturned(place - self.at)
    }

    /// A direction of the room in the piece's own.
    pub(super) fn unturned(&self, v: Vec3) -> Vec3 {
        let facing = turn(self.angle);
        vec3(
            v.x * facing.x - v.z * facing.y,
            v.y,
            v.z * facing.x + v.x * facing.y,
        )
    }

    /// A place of the piece in the room.
    pub(super) fn outward(&self, v: Vec3) -> Vec3 {
        let facing = turn(self.angle);
        self.at
            + vec3(
                v.x * facing.x + v.z * facing.y,
                v.y,
                v.z * facing.x - v.x * facing.y,
            )
    }
}

/// A piece in its place.
#[derive(Debug, Clone)]
pub(super) struct Thing {
    pub(super) kind: ThingKind,
    pub(super) color: &'static str,
    pub(super) pose: Pose,
}

/// What lights the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LightSource {
    /// A flat light, as the daylight in a window: a corner, its two edges, where it shines, and how bright it is by channel.
    Panel {
        corner: Vec3,
        edges: [Vec3; 2],
        normal: Vec3,
        radiance: Vec3,
    },
    /// A round light, as a bulb.
    Bulb {
        middle: Vec3,
        radius: f32,
        radiance: Vec3,
    },
}

impl LightSource {
    /// The light of a piece, in its place.
    fn placed(self, pose: &Pose) -> Self {
        match self {
            Self::Panel {
                corner,
                edges,
                normal,
                radiance,
            } => {
                let turned = |v: Vec3| pose.outward(v) - pose.at;
                Self::Panel {
                    corner: pose.outward(corner),
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
                middle: pose.outward(middle),
                radius,
                radiance,
            },
        }
    }
}

/// A room with all that stands in it.
#[derive(Debug, Default)]
pub(super) struct Scene {
    /// The things; the number of the segment of each is its place, from 1.
    pub(super) things: Vec<Thing>,
    pub(super) lights: Vec<LightSource>,
    /// The shape of all of them.
    pub(super) mesh: Mesh,
    /// The thing that each face belongs to.
    pub(super) owners: Vec<usize>,
}

impl Scene {
    /// Puts a piece into its place.
    pub(super) fn put(&mut self, piece: &Piece, pose: Pose) {
        self.mesh.add(&piece.mesh, pose.at, pose.angle);
        self.owners.resize(self.mesh.faces.len(), self.things.len());
        self.lights
            .extend(piece.light.map(|light| light.placed(&pose)));
        self.things.push(Thing {
            kind: piece.kind,
            color: piece.color,
            pose,
        });
    }

    /// The surface of a face.
    pub(super) fn surface(&self, face: usize) -> &Surface {
        &self.mesh.surfaces[self.mesh.faces[face].surface]
    }

    /// The tree of its faces.
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
