//! Point where a ray hits a thing of the scene: [`SurfacePoint`].

use glam::Vec3;

use super::bvh::{Bvh, Hit, Ray};
use super::scene::Scene;
use super::surface::SurfaceFinish;

/// Point where a ray hits a thing of the scene, with the properties of the surface there.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfacePoint {
    /// Position in the scene, in metres.
    pub(super) position: Vec3,
    /// Surface normal, on the side that the ray came from.
    pub(super) normal: Vec3,
    /// Share of light that the surface reflects, by channel.
    pub(super) color: Vec3,
    /// Light that the surface emits, by channel.
    pub(super) glow: Vec3,
    /// Index of the first thing that the ray hits; a mirror counts.
    pub(super) thing: usize,
    /// Index of the thing whose surface is visible: the reflected thing if `thing` is a mirror, otherwise `thing`.
    pub(super) seen_thing: usize,
    /// Distance along the ray to `thing`, in metres.
    pub(super) distance: f32,
    pub(super) gloss: Gloss,
}

/// Whether a surface has a highlight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gloss {
    Dull,
    Shiny,
}

/// Longest distance that a ray travels, in metres; larger than any room.
pub(super) const FAR: f32 = 100.0;

/// Share of light that a mirror reflects.
const MIRROR_REFLECTANCE: f32 = 0.92;

impl SurfacePoint {
    /// Returns the first point that a ray hits, treating mirrors as ordinary surfaces; `None` if the ray hits nothing.
    pub(super) fn first_hit(scene: &Scene, tree: &Bvh, ray: &Ray) -> Option<Self> {
        let hit = tree.closest_hit(ray, FAR)?;
        Some(Self::new(scene, ray, hit))
    }

    /// Returns the first point that a ray hits, or the point reflected there if that is a mirror, with the `thing` and
    /// `distance` of the mirror. A second mirror is an ordinary surface. `None` if the ray or its reflection hits
    /// nothing.
    pub(super) fn through_mirror(scene: &Scene, tree: &Bvh, ray: &Ray) -> Option<Self> {
        let hit = tree.closest_hit(ray, FAR)?;
        let point = Self::new(scene, ray, hit);
        if scene.surface(hit.face).finish != SurfaceFinish::Mirror {
            return Some(point);
        }
        let direction = reflect(ray.direction, point.normal);
        // The reflected ray starts 1 mm above the mirror, so that it does not hit the mirror again.
        let reflection = Ray::new(point.position + point.normal * 1e-3, direction).with_spread(ray.spread);
        let mirrored = Self::first_hit(scene, tree, &reflection)?;
        Some(Self {
            color: mirrored.color * MIRROR_REFLECTANCE,
            thing: point.thing,
            distance: point.distance,
            gloss: Gloss::Dull,
            ..mirrored
        })
    }

    /// Interpolates the normal at a hit and evaluates the surface there.
    fn new(scene: &Scene, ray: &Ray, hit: Hit) -> Self {
        let face = &scene.mesh.faces[hit.face];
        let thing = scene.face_owners[hit.face];
        let surface = scene.surface(hit.face);
        let [u, v] = hit.weights;
        let [a, b, c] = face.corners.map(|corner| corner.normal);
        let mut normal = (a * (1.0 - u - v) + b * u + c * v).normalize_or_zero();
        if normal.dot(ray.direction) > 0.0 {
            normal = -normal;
        }
        let position = ray.origin + ray.direction * hit.distance;
        let pose = &scene.things[thing].pose;
        let slant = normal.dot(ray.direction).abs().max(0.1);
        // Geometric mean width of the ray on the surface, in metres: a slanted surface widens it in one direction.
        let footprint = hit.distance * ray.spread / slant.sqrt();
        let local_normal = pose.direction_to_piece(normal);
        let color = surface.color_at(pose.to_piece(position), local_normal, footprint);
        let glow = match surface.finish {
            SurfaceFinish::Glow(strength) => color * strength,
            SurfaceFinish::Matte | SurfaceFinish::Glossy | SurfaceFinish::Mirror => Vec3::ZERO,
        };
        Self {
            position,
            normal,
            color,
            glow,
            thing,
            seen_thing: thing,
            distance: hit.distance,
            gloss: if surface.finish == SurfaceFinish::Glossy { Gloss::Shiny } else { Gloss::Dull },
        }
    }
}

/// Reflects a direction at a surface with a unit normal.
pub(super) fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    direction - normal * (2.0 * direction.dot(normal))
}
