//! The light in a view, sampled coarsely and smoothed: [`LightGrid`].

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::Ray;
use super::light::{LightSample, Lighting, STRATA, brightness};
use super::spot::{Gloss, SurfacePoint, reflected};

/// The share of the view that gets less than its typical light (chosen).
const DARKER: f32 = 0.4;

/// The light at every second pixel of every second row.
pub(super) struct LightGrid<'a> {
    lighting: &'a Lighting<'a>,
    grid: [usize; 2],
    places: Vec<Option<SurfacePoint>>,
    /// The direct light, and the indirect light, which is smoother.
    incoming: [Vec<Vec3>; 2],
    /// The radiance of each thing that is a source of light; empty if sources are shown relative to the room.
    radiances: Vec<Option<Vec3>>,
    typical: f32,
}

/// The distances between smoothed neighbours in each pass, for direct and for indirect light (chosen).
const PASSES: [&[usize]; 2] = [&[1, 2, 1], &[1, 2, 4, 8, 2]];

impl<'a> LightGrid<'a> {
    pub(super) fn new(
        lighting: &'a Lighting<'a>,
        spots: &[Option<SurfacePoint>],
        size: [usize; 2],
        radiances: Vec<Option<Vec3>>,
    ) -> Self {
        let grid = size.map(|side| side.div_ceil(2));
        let places: Vec<Option<SurfacePoint>> = (0..grid[0] * grid[1])
            .map(|i| spots[(i / grid[0]) * 2 * size[0] + (i % grid[0]) * 2])
            .collect();
        let incoming: Vec<[Vec3; 2]> = places
            .par_iter()
            .enumerate()
            .map(|(i, spot)| {
                let [x, y] = [i % grid[0], i / grid[0]];
                let sample = LightSample {
                    stratum: (x % STRATA) + (y % STRATA) * STRATA,
                    place: [x as i32, y as i32],
                };
                spot.as_ref()
                    .filter(|spot| spot.glow == Vec3::ZERO)
                    .map_or([Vec3::ZERO; 2], |spot| lighting.incoming(spot, sample))
            })
            .collect();
        let mut light = Self {
            lighting,
            grid,
            places,
            incoming: [0, 1].map(|part| incoming.iter().map(|light| light[part]).collect()),
            radiances,
            typical: 0.0,
        };
        for (part, passes) in PASSES.iter().enumerate() {
            for step in *passes {
                light.incoming[part] = light.smooth(&light.incoming[part], *step as i32);
            }
        }
        let [direct, indirect] = &light.incoming;
        let mut lit: Vec<f32> = direct
            .iter()
            .zip(indirect)
            .map(|(a, b)| brightness(*a + *b))
            .filter(|light| *light > 0.0)
            .collect();
        let place = (lit.len() as f32 * DARKER) as usize;
        if place < lit.len() {
            light.typical = *lit.select_nth_unstable_by(place, f32::total_cmp).1;
        }
        light
    }

    /// One smoothing pass: the mean of neighbours in the same plane, `step` apart (à-trous filter, Dammertz et al., HPG 2010).
    fn smooth(&self, incoming: &[Vec3], step: i32) -> Vec<Vec3> {
        let [width, height] = self.grid;
        (0..width * height)
            .into_par_iter()
            .map(|i| {
                let Some(own) = &self.places[i] else {
                    return Vec3::ZERO;
                };
                let [x, y] = [(i % width) as i32, (i / width) as i32];
                let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
                for dy in -2..=2_i32 {
                    for dx in -2..=2_i32 {
                        let [u, v] = [x + dx * step, y + dy * step];
                        if !(0..width as i32).contains(&u) || !(0..height as i32).contains(&v) {
                            continue;
                        }
                        let j = v as usize * width + u as usize;
                        if let Some(other) = &self.places[j] {
                            let weight = similarity(own, other);
                            sum += incoming[j] * weight;
                            weights += weight;
                        }
                    }
                }
                sum / weights.max(1e-6)
            })
            .collect()
    }

    /// The light that reaches a point of the image.
    fn at(&self, spot: &SurfacePoint, [x, y]: [f32; 2]) -> Vec3 {
        let [width, height] = self.grid;
        let (u, v) = ((x * 0.5).max(0.0), (y * 0.5).max(0.0));
        let (left, top) = (u.floor(), v.floor());
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let [i, j] = [
                (left as usize + dx).min(width - 1),
                (top as usize + dy).min(height - 1),
            ];
            let place = j * width + i;
            if let Some(other) = &self.places[place] {
                let near = (1.0 - (u - (left + dx as f32)).abs()).max(0.0)
                    * (1.0 - (v - (top + dy as f32)).abs()).max(0.0);
                let weight = (near + 0.01) * similarity(spot, other);
                sum += (self.incoming[0][place] + self.incoming[1][place]) * weight;
                weights += weight;
            }
        }
        if weights > 0.02 {
            return sum / weights;
        }
        (0..STRATA * STRATA)
            .map(|stratum| {
                let sample = LightSample {
                    stratum,
                    place: [(x * 8.0) as i32, (y * 8.0) as i32],
                };
                let [direct, indirect] = self.lighting.incoming(spot, sample);
                direct + indirect
            })
            .sum::<Vec3>()
            / (STRATA * STRATA) as f32
    }

    /// The light that a point of the image sends to the camera.
    pub(super) fn shade(&self, spot: &SurfacePoint, from: Vec3, at: [f32; 2]) -> Vec3 {
        if spot.glow != Vec3::ZERO {
            return self.glow(spot);
        }
        let incoming = self.at(spot, at);
        let matte = spot.color * incoming;
        if spot.glossy == Gloss::Dull {
            return matte;
        }
        let direction = (spot.at - from).normalize_or_zero();
        let slant = (-direction.dot(spot.normal)).clamp(0.0, 1.0);
        // Schlick's approximation of Fresnel's equations for an index of 1.5.
        let rest = 1.0 - slant;
        let share = 0.04 + 0.96 * rest * rest * rest * rest * rest;
        let ray = Ray::new(
            spot.at + spot.normal * 1e-3,
            reflected(direction, spot.normal),
        );
        let back = SurfacePoint::first(self.lighting.scene, self.lighting.tree, &ray);
        let back = back.map_or(Vec3::ZERO, |back| {
            back.color * self.lighting.ambient * 1.6 + self.glow(&back)
        });
        matte * (1.0 - 0.5 * share) + back * (0.5 * share)
    }

    /// The light of a point that glows. On a display the brightness of a lamp is relative to that of the room, so that it never looks
    /// grey. As linear light, it is the radiance that lights the room.
    fn glow(&self, spot: &SurfacePoint) -> Vec3 {
        let radiance = self.radiances.get(spot.thing).copied().flatten();
        match radiance.filter(|_| spot.glow != Vec3::ZERO) {
            Some(radiance) => spot.color * radiance,
            None => spot.glow * self.typical(),
        }
    }

    /// Typical brightness of the light that reaches the objects in view.
    pub(super) fn typical(&self) -> f32 {
        self.typical
    }
}

/// The similarity of two points: 1 in the same plane, 0 on different things.
fn similarity(a: &SurfacePoint, b: &SurfacePoint) -> f32 {
    if a.seen_thing != b.seen_thing || a.thing != b.thing {
        return 0.0;
    }
    let facing = a.normal.dot(b.normal);
    if facing < 0.8 {
        return 0.0;
    }
    let off = (b.at - a.at).dot(a.normal).abs();
    let reach = 0.01 + 0.01 * a.distance;
    let near = (1.0 - off / (3.0 * reach)).max(0.0);
    near * (facing - 0.75) * 4.0
}
