//! The point where a ray hits a thing: [`Spot`].

use glam::Vec3;

use super::bvh::{Bvh, Hit, Ray};
use super::scene::Scene;
use super::surface::SurfaceFinish;

/// The point where a ray hits a thing, with the properties of the surface there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub(super) at: Vec3,
    /// The surface normal, on the side that the ray came from.
    pub(super) normal: Vec3,
    /// The share of light that the surface reflects, by channel.
    pub(super) color: Vec3,
    /// The light that the surface emits, by channel.
    pub(super) glow: Vec3,
    /// The index of the first thing that the ray hits.
    pub(super) thing: usize,
    /// The index of the thing whose colour is seen; another one if the first is a mirror.
    pub(super) seen_thing: usize,
    /// The distance to the first thing along the ray, in metres.
    pub(super) distance: f32,
    /// Whether the surface has a highlight.
    pub(super) glossy: Gloss,
}

/// Whether a face has a highlight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gloss {
    Dull,
    Shiny,
}

/// A distance in metres beyond the length of any room.
pub(super) const FAR: f32 = 100.0;

impl Spot {
    /// The first point that a ray hits; a mirror counts as a thing.
    pub(super) fn first(scene: &Scene, tree: &Bvh, ray: &Ray) -> Option<Self> {
        let hit = tree.first(ray, FAR)?;
        Some(Self::new(scene, ray, hit))
    }

    /// The first point that a ray hits; a mirror takes the colour of its reflection.
    pub(super) fn through_mirror(scene: &Scene, tree: &Bvh, ray: &Ray) -> Option<Self> {
        let hit = tree.first(ray, FAR)?;
        let spot = Self::new(scene, ray, hit);
        if scene.surface(hit.face).finish != SurfaceFinish::Mirror {
            return Some(spot);
        }
        let direction = reflected(ray.direction, spot.normal);
        let back = Ray::new(spot.at + spot.normal * 1e-3, direction).wide(ray.spread);
        let mirrored = Self::first(scene, tree, &back)?;
        Some(Self {
            color: mirrored.color * 0.92,
            thing: spot.thing,
            distance: spot.distance,
            glossy: Gloss::Dull,
            ..mirrored
        })
    }

    fn new(scene: &Scene, ray: &Ray, hit: Hit) -> Self {
        let face = &scene.mesh.faces[hit.face];
        let thing = scene.owners[hit.face];
        let surface = scene.surface(hit.face);
        let [u, v] = hit.weights;
        let [a, b, c] = face.corners.map(|corner| corner.normal);
        let mut normal = (a * (1.0 - u - v) + b * u + c * v).normalize_or_zero();
        if normal.dot(ray.direction) > 0.0 {
            normal = -normal;
        }
        let at = ray.from + ray.direction * hit.distance;
        let pose = &scene.things[thing].pose;
        let slant = normal.dot(ray.direction).abs().max(0.1);
        let pixel = hit.distance * ray.spread / slant.sqrt();
        let turned = pose.direction_to_piece(normal);
        let color = surface.color_at(pose.to_piece(at), turned, pixel);
        let (color, glow) = match surface.finish {
            SurfaceFinish::Glow(strength) => (color, color * strength),
            SurfaceFinish::Matte | SurfaceFinish::Glossy | SurfaceFinish::Mirror => {
                (color, Vec3::ZERO)
            }
        };
        Self {
            at,
            normal,
            color,
            glow,
            thing,
            seen_thing: thing,
            distance: hit.distance,
            glossy: if surface.finish == SurfaceFinish::Glossy {
                Gloss::Shiny
            } else {
                Gloss::Dull
            },
        }
    }
}

/// A direction after reflection by a surface.
pub(super) fn reflected(direction: Vec3, normal: Vec3) -> Vec3 {
    direction - normal * (2.0 * direction.dot(normal))
}
