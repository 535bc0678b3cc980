//! Light that reaches a point: [`Lighting`].
//!
//! Direct light comes from lamps and windows; each is sampled with a shadow ray. Indirect light comes from other
//! surfaces: rays over the half-space (cosine-weighted) return the colour of the surface that they hit, lit by one
//! light each, plus a constant ambient light. So the first bounce is sampled and later bounces are averaged. This gives
//! soft shadows, dark corners and colour bleeding, but no caustics.

use glam::{Vec3, vec3};

use super::bvh::{Bvh, Ray};
use super::mesh::cos_sin;
use super::noise::hash;
use super::scene::{LightSource, Scene};
use super::surface_point::SurfacePoint;

/// Number of strata along each axis of a sample pattern (chosen). Neighbouring pixels use different strata.
pub(super) const STRATA: usize = 4;
/// Number of indirect rays per point, over the half-space above the surface (chosen).
const INDIRECT_RAYS: usize = 4;
/// Maximum light of one indirect ray, as a multiple of the ambient light (chosen).
const MAX_INDIRECT: f32 = 5.0;
/// Distance in metres between a surface and the start of a shadow ray (chosen).
const OFFSET: f32 = 2e-3;

/// Light sources, geometry and ambient light of a scene.
#[derive(Debug)]
pub(super) struct Lighting<'a> {
    pub(super) scene: &'a Scene,
    pub(super) tree: &'a Bvh,
    /// Light that reaches every point after many bounces, by channel.
    pub(super) ambient: Vec3,
}

/// Stratum of a sample, and the pixel whose coordinates determine its jitter.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightSample {
    pub(super) stratum: usize,
    pub(super) pixel: [i32; 2],
}

impl LightSample {
    /// Returns two numbers from 0 to 1 within the stratum, for one purpose.
    fn uniform_pair(self, purpose: usize) -> [f32; 2] {
        // Each purpose uses the strata in its own order (5, 11 and 13 have no common factor with 16).
        let count = STRATA * STRATA;
        let stratum = (self.stratum * [1, 5, 11, 13][purpose % 4] + purpose * 7) % count;
        let [x, y] = self.pixel;
        [(stratum % STRATA, 21), (stratum / STRATA, 22)].map(|(cell, axis)| {
            let jitter = hash(x.wrapping_add(purpose as i32 * 131), y, axis);
            (cell as f32 + jitter) / STRATA as f32
        })
    }
}

impl Lighting<'_> {
    /// Direct and indirect light at a point: from lamps and windows, and by reflection from other things.
    pub(super) fn incoming(&self, point: &SurfacePoint, sample: LightSample) -> [Vec3; 2] {
        let indirect: Vec3 = (0..INDIRECT_RAYS).map(|i| self.indirect(point, sample, i)).sum();
        [self.direct(point.position, point.normal, sample), indirect / INDIRECT_RAYS as f32]
    }

    /// Direct light of lamps and windows at a position.
    pub(super) fn direct(&self, position: Vec3, normal: Vec3, sample: LightSample) -> Vec3 {
        self.scene
            .lights
            .iter()
            .enumerate()
            .map(|(i, light)| self.light_from(light, position, normal, sample.uniform_pair(i)))
            .sum()
    }

    /// Light that one indirect ray returns, given by its index.
    fn indirect(&self, point: &SurfacePoint, sample: LightSample, ray_index: usize) -> Vec3 {
        let [u, v] = sample.uniform_pair(12 + ray_index);
        let around = cos_sin(std::f32::consts::TAU * u);
        let (out, up) = (v.sqrt(), (1.0 - v).max(0.0).sqrt());
        let aside = if point.normal.x.abs() > 0.7 { Vec3::Y } else { Vec3::X };
        let across = point.normal.cross(aside).normalize();
        let over = point.normal.cross(across);
        let direction = across * (around.x * out) + over * (around.y * out) + point.normal * up;
        let ray = Ray::new(point.position + point.normal * OFFSET, direction);
        let Some(hit) = SurfacePoint::first_hit(self.scene, self.tree, &ray) else {
            return self.ambient;
        };
        if hit.glow != Vec3::ZERO {
            // A thing that glows is already counted as a light.
            return self.ambient * 0.5;
        }
        let count = self.scene.lights.len().max(1);
        let chosen = (sample.stratum + ray_index) % count;
        let direct = self.scene.lights.get(chosen).map_or(Vec3::ZERO, |light| {
            self.light_from(light, hit.position, hit.normal, sample.uniform_pair(24 + ray_index)) * count as f32
        });
        // Without a limit, a ray that hits a point close to a lamp would cause a bright dot.
        hit.color * (direct + self.ambient).min(self.ambient * MAX_INDIRECT)
    }

    /// Light that one lamp or window sends to a position.
    fn light_from(&self, light: &LightSource, position: Vec3, normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
        let start = position + normal * OFFSET;
        let (target, strength) = match *light {
            LightSource::Panel { corner, edges: [a, b], normal: facing, radiance } => {
                let target = corner + a * u + b * v;
                let offset = target - start;
                let square = offset.length_squared().max(0.01);
                let shines = (-facing.dot(offset)).max(0.0) / square.sqrt();
                let area = a.cross(b).length();
                (target, radiance * (shines * area / (std::f32::consts::PI * square)))
            }
            LightSource::Bulb { middle, radius, radiance } => {
                let to = (middle - start).normalize_or_zero();
                let aside = if to.x.abs() > 0.7 { Vec3::Y } else { Vec3::X };
                let across = to.cross(aside).normalize_or_zero();
                let around = cos_sin(std::f32::consts::TAU * u);
                let disc = across * around.x + to.cross(across) * around.y;
                let target = middle + disc * (radius * v.sqrt());
                let square = (middle - start).length_squared().max(0.02);
                (target, radiance * (radius * radius / square))
            }
        };
        let offset = target - start;
        let distance = offset.length();
        let direction = offset / distance;
        let slant = normal.dot(direction);
        if slant <= 0.0 || strength == Vec3::ZERO {
            return Vec3::ZERO;
        }
        if self.tree.is_occluded(&Ray::new(start, direction), distance - 2.0 * OFFSET) {
            Vec3::ZERO
        } else {
            strength * slant
        }
    }
}

/// Luminance of linear light (ITU-R BT.709).
pub(super) fn luminance(light: Vec3) -> f32 {
    light.dot(vec3(0.2126, 0.7152, 0.0722))
}
