//! How much light reaches a place: [`Lighting`].
//!
//! Light comes from the lamps and windows, each sampled with a shadow ray, and from what they light: rays over the half-space
//! (as likely as their cosine) bring back what they meet, lit by one light in turn, plus what is left after many bounces, a
//! constant. It is one bounce by sampling and the rest by a mean: soft shadows, dark corners and colours that bleed are there,
//! caustics are not.

use glam::{Vec3, vec3};

use super::bvh::{Bvh, Ray};
use super::mesh::turn;
use super::scene::{LightSource, Scene};
use super::spot::Spot;
use super::surface::hash;

/// Samples are laid out on so many by so many strata; neighbours take turns.
pub(super) const STRATA: usize = 4;
/// Rays over the half-space at each place.
const GATHERED: usize = 4;
/// What one ray brings back is at most so many times the light of many bounces.
const BOUND: f32 = 5.0;
/// How far a shadow ray starts off a face.
const OFF: f32 = 2e-3;

/// The light of a scene.
#[derive(Debug)]
pub(super) struct Lighting<'a> {
    pub(super) scene: &'a Scene,
    pub(super) tree: &'a Bvh,
    /// What reaches any place after many bounces.
    pub(super) ambient: Vec3,
}

/// Which stratum a sample is in, and what jitters it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightSample {
    pub(super) stratum: usize,
    pub(super) place: [i32; 2],
}

impl LightSample {
    /// Two numbers from 0 to 1 in the stratum, for one use.
    fn pair(self, purpose: usize) -> [f32; 2] {
        // Each use meets the strata in an order of its own (5 and 11 have no common factor with 16).
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
    /// The light that reaches a place: straight from lamps and windows, and by way of other things.
    pub(super) fn reaching(&self, spot: &Spot, sample: LightSample) -> [Vec3; 2] {
        let gathered: Vec3 = (0..GATHERED).map(|i| self.gathered(spot, sample, i)).sum();
        [
            self.direct(spot.at, spot.normal, sample),
            gathered / GATHERED as f32,
        ]
    }

    /// The light that lamps and windows alone bring to a place.
    pub(super) fn direct(&self, at: Vec3, normal: Vec3, sample: LightSample) -> Vec3 {
        let lights = self.scene.lights.iter().enumerate();
        lights
            .map(|(i, light)| self.from(light, at, normal, sample.pair(i)))
            .sum()
    }

    /// What one ray over the half-space brings back.
    fn gathered(&self, spot: &Spot, sample: LightSample, which: usize) -> Vec3 {
        let [u, v] = sample.pair(12 + which);
        let around = turn(std::f32::consts::TAU * u);
        let (out, up) = (v.sqrt(), (1.0 - v).max(0.0).sqrt());
        let aside = if spot.normal.x.abs() > 0.7 {
            Vec3::Y
        } else {
            Vec3::X
        };
        let across = spot.normal.cross(aside).normalize();
        let over = spot.normal.cross(across);
        let along = across * (around.x * out) + over * (around.y * out) + spot.normal * up;
        let ray = Ray::new(spot.at + spot.normal * OFF, along);
        let Some(met) = Spot::first(self.scene, self.tree, &ray) else {
            return self.ambient;
        };
        if met.glow != Vec3::ZERO {
            // What shines by itself is counted as a light already.
            return self.ambient * 0.5;
        }
        let count = self.scene.lights.len().max(1);
        let chosen = (sample.stratum + which) % count;
        let direct = self.scene.lights.get(chosen).map_or(Vec3::ZERO, |light| {
            self.from(light, met.at, met.normal, sample.pair(24 + which)) * count as f32
        });
        // A ray that meets the place just below a lamp would leave a spot of its own: what it brings is bounded.
        met.color * (direct + self.ambient).min(self.ambient * BOUND)
    }

    /// The light that one light brings to a place.
    fn from(&self, light: &LightSource, at: Vec3, normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
        let start = at + normal * OFF;
        let (target, strength) = match *light {
            LightSource::Panel {
                corner,
                edges: [a, b],
                normal: facing,
                radiance,
            } => {
                let target = corner + a * u + b * v;
                let way = target - start;
                let square = way.length_squared().max(0.01);
                let shines = (-facing.dot(way)).max(0.0) / square.sqrt();
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
                let around = turn(std::f32::consts::TAU * u);
                let disc = across * around.x + to.cross(across) * around.y;
                let target = middle + disc * (radius * v.sqrt());
                let square = (middle - start).length_squared().max(0.02);
                (target, radiance * (radius * radius / square))
            }
        };
        let way = target - start;
        let far = way.length();
        let along = way / far;
        let slant = normal.dot(along);
        if slant <= 0.0 || strength == Vec3::ZERO {
            return Vec3::ZERO;
        }
        if self.tree.blocked(&Ray::new(start, along), far - 2.0 * OFF) {
            Vec3::ZERO
        } else {
            strength * slant
        }
    }
}

/// The share of each channel in how bright light is (ITU-R BT.709).
pub(super) fn brightness(light: Vec3) -> f32 {
    light.dot(vec3(0.2126, 0.7152, 0.0722))
}
