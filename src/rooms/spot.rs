//! What a ray meets: [`Spot`].

use glam::Vec3;

use super::bvh::{Bvh, Hit, Ray};
use super::scene::Scene;
use super::surface::SurfaceFinish;

/// What is known of the place where a ray meets a thing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub(super) at: Vec3,
    /// Looks to where the ray came from.
    pub(super) normal: Vec3,
    /// The share of light that it gives back.
    pub(super) color: Vec3,
    /// The light that it sends out by itself.
    pub(super) glow: Vec3,
    /// The thing that is met first.
    pub(super) thing: usize,
    /// The thing whose colour is seen: another one where the first is a mirror.
    pub(super) shown: usize,
    /// How far the first thing is, along the ray.
    pub(super) far: f32,
    /// Whether the thing has a highlight.
    pub(super) glossy: Gloss,
}

/// Whether a face has a highlight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gloss {
    Dull,
    Shiny,
}

/// Farther than any room is long.
pub(super) const FAR: f32 = 100.0;

impl Spot {
    /// What a ray meets first, mirrors taken as things of their own.
    pub(super) fn first(scene: &Scene, tree: &Bvh, ray: &Ray) -> Option<Self> {
        let hit = tree.first(ray, FAR)?;
        Some(Self::of(scene, ray, hit))
    }

    /// What a ray meets first, and where that is a mirror, what is seen in it.
    pub(super) fn seen(scene: &Scene, tree: &Bvh, ray: &Ray) -> Option<Self> {
        let hit = tree.first(ray, FAR)?;
        let spot = Self::of(scene, ray, hit);
        if scene.surface(hit.face).finish != SurfaceFinish::Mirror {
            return Some(spot);
        }
        let along = reflected(ray.along, spot.normal);
        let back = Ray::new(spot.at + spot.normal * 1e-3, along);
        let behind = Self::first(scene, tree, &back)?;
        Some(Self {
            color: behind.color * 0.92,
            thing: spot.thing,
            far: spot.far,
            glossy: Gloss::Dull,
            ..behind
        })
    }

    fn of(scene: &Scene, ray: &Ray, hit: Hit) -> Self {
        let face = &scene.mesh.faces[hit.face];
        let thing = scene.owners[hit.face];
        let surface = scene.surface(hit.face);
        let [u, v] = hit.weights;
        let [a, b, c] = face.corners.map(|corner| corner.normal);
        let mut normal = (a * (1.0 - u - v) + b * u + c * v).normalize_or_zero();
        if normal.dot(ray.along) > 0.0 {
            normal = -normal;
        }
        let at = ray.from + ray.along * hit.far;
        let pose = &scene.things[thing].pose;
        let color = surface.color_at(pose.inward(at), pose.unturned(normal));
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
            shown: thing,
            far: hit.far,
            glossy: if surface.finish == SurfaceFinish::Glossy {
                Gloss::Shiny
            } else {
                Gloss::Dull
            },
        }
    }
}

/// A direction thrown back by a face.
pub(super) fn reflected(along: Vec3, normal: Vec3) -> Vec3 {
    along - normal * (2.0 * along.dot(normal))
}
