//! The light that reaches a point: [`Lighting`].
//!
//! Direct light comes from lamps and windows; each is sampled with a shadow ray. Indirect light comes from other surfaces: rays over the
//! half-space (cosine-weighted) return the colour of the surface that they hit, lit by one light each, plus a constant ambient light. So
//! the first bounce is sampled and later bounces are averaged. This gives soft shadows, dark corners and colour bleeding, but no caustics.

use glam::{Vec3, vec3};

use super::bvh::{Bvh, Ray};
use super::mesh::cos_sin;
use super::noise::hash;
use super::scene::{LightSource, Scene};
use super::spot::SurfacePoint;

/// The strata per axis of a sample pattern (chosen). Neighbouring pixels use different strata.
pub(super) const STRATA: usize = 4;
/// The number of rays over the half-space per point (chosen).
const INDIRECT_RAYS: usize = 4;
/// The maximum light of one ray, as a multiple of the ambient light (chosen).
const BOUND: f32 = 5.0;
/// The distance in metres between a surface and the start of a shadow ray (chosen).
const OFFSET: f32 = 2e-3;

/// The light of a scene.
#[derive(Debug)]
pub(super) struct Lighting<'a> {
    pub(super) scene: &'a Scene,
    pub(super) tree: &'a Bvh,
    /// The ambient light: what reaches every point after many bounces, by channel.
    pub(super) ambient: Vec3,
}

/// The stratum of a sample, and the pixel whose coordinates decide its jitter.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightSample {
    pub(super) stratum: usize,
    pub(super) place: [i32; 2],
}

impl LightSample {
    /// Two numbers from 0 to 1 within the stratum, for one purpose.
    fn pair(self, purpose: usize) -> [f32; 2] {
        // Each purpose uses the strata in its own order (5, 11 and 13 have no common factor with 16).
        let count = STRATA * STRATA;
        let turned = (self.stratum * [1, 5, 11, 13][purpose % 4] + purpose * 7) % count;
        let [x, y] = self.place;
        let jitter = |axis: i32| hash(x.wrapping_add(purpose as i32 * 131), y, axis);
        [
            ((turned % STRATA) as f32 + jitter(21)) / STRATA as f32,
            ((turned / STRATA) as f32 + jitter(22)) / STRATA as f32,
        ]
    }
}

impl Lighting<'_> {
    /// The light that reaches a point: direct from lamps and windows, and indirect by way of other things.
    pub(super) fn incoming(&self, spot: &SurfacePoint, sample: LightSample) -> [Vec3; 2] {
        let indirect: Vec3 = (0..INDIRECT_RAYS)
            .map(|i| self.indirect(spot, sample, i))
            .sum();
        [
            self.direct(spot.at, spot.normal, sample),
            indirect / INDIRECT_RAYS as f32,
        ]
    }

    /// The direct light of lamps and windows at a point.
    pub(super) fn direct(&self, at: Vec3, normal: Vec3, sample: LightSample) -> Vec3 {
        self.scene
            .lights
            .iter()
            .enumerate()
            .map(|(i, light)| self.from(light, at, normal, sample.pair(i)))
            .sum()
    }

    /// The light that one ray over the half-space returns.
    fn indirect(&self, spot: &SurfacePoint, sample: LightSample, which: usize) -> Vec3 {
        let [u, v] = sample.pair(12 + which);
        let around = cos_sin(std::f32::consts::TAU * u);
        let (out, up) = (v.sqrt(), (1.0 - v).max(0.0).sqrt());
        let aside = if spot.normal.x.abs() > 0.7 {
            Vec3::Y
        } else {
            Vec3::X
        };
        let across = spot.normal.cross(aside).normalize();
        let over = spot.normal.cross(across);
        let direction = across * (around.x * out) + over * (around.y * out) + spot.normal * up;
        let ray = Ray::new(spot.at + spot.normal * OFFSET, direction);
        let Some(hit) = SurfacePoint::first(self.scene, self.tree, &ray) else {
            return self.ambient;
        };
        if hit.glow != Vec3::ZERO {
            // A thing that glows is already counted as a light.
            return self.ambient * 0.5;
        }
        let count = self.scene.lights.len().max(1);
        let chosen = (sample.stratum + which) % count;
        let direct = self.scene.lights.get(chosen).map_or(Vec3::ZERO, |light| {
            self.from(light, hit.at, hit.normal, sample.pair(24 + which)) * count as f32
        });
        // The light is limited, because a ray that hits a point close to a lamp would cause a bright dot.
        hit.color * (direct + self.ambient).min(self.ambient * BOUND)
    }

    /// The light that one lamp or window sends to a point.
    fn from(&self, light: &LightSource, at: Vec3, normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
        let start = at + normal * OFFSET;
        let (target, strength) = match *light {
            LightSource::Panel {
                corner,
                edges: [a, b],
                normal: facing,
                radiance,
            } => {
                let target = corner + a * u + b * v;
                let offset = target - start;
                let square = offset.length_squared().max(0.01);
                let shines = (-facing.dot(offset)).max(0.0) / square.sqrt();
                let area = a.cross(b).length();
                (
                    target,
                    radiance * (shines * area / (std::f32::consts::PI * square)),
                )
            }
            LightSource::Bulb {
                middle,
                radius,
                radiance,
            } => {
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
        if self
            .tree
            .blocked(&Ray::new(start, direction), distance - 2.0 * OFFSET)
        {
            Vec3::ZERO
        } else {
            strength * slant
        }
    }
}

/// The luminance of linear light (ITU-R BT.709).
pub(super) fn brightness(light: Vec3) -> f32 {
    light.dot(vec3(0.2126, 0.7152, 0.0722))
}
