//! Light in a view, sampled coarsely and smoothed: [`LightGrid`].

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::Ray;
use super::light::{LightSample, Lighting, STRATA, luminance};
use super::surface_point::{Gloss, SurfacePoint, reflect};

/// Quantile of the light in a view that counts as its typical light (chosen).
const TYPICAL_QUANTILE: f32 = 0.4;

/// Light at every second pixel of every second row.
pub(super) struct LightGrid<'a> {
    lighting: &'a Lighting<'a>,
    /// Number of columns and rows of the grid.
    size: [usize; 2],
    points: Vec<Option<SurfacePoint>>,
    /// Direct light, and indirect light, which is smoother.
    incoming: [Vec<Vec3>; 2],
    /// Radiance of each thing that is a light source; empty if light sources are drawn relative to the room.
    radiances: Vec<Option<Vec3>>,
    typical: f32,
}

/// Distances between smoothed neighbours in each pass, for direct and for indirect light (chosen).
const PASSES: [&[usize]; 2] = [&[1, 2, 1], &[1, 2, 4, 8, 2]];

impl<'a> LightGrid<'a> {
    pub(super) fn new(
        lighting: &'a Lighting<'a>,
        points: &[Option<SurfacePoint>],
        image_size: [usize; 2],
        radiances: Vec<Option<Vec3>>,
    ) -> Self {
        let size = image_size.map(|side| side.div_ceil(2));
        let points: Vec<Option<SurfacePoint>> =
            (0..size[0] * size[1]).map(|i| points[(i / size[0]) * 2 * image_size[0] + (i % size[0]) * 2]).collect();
        let incoming: Vec<[Vec3; 2]> = points
            .par_iter()
            .enumerate()
            .map(|(i, point)| {
                let [x, y] = [i % size[0], i / size[0]];
                let sample = LightSample { stratum: (x % STRATA) + (y % STRATA) * STRATA, pixel: [x as i32, y as i32] };
                point
                    .as_ref()
                    .filter(|point| point.glow == Vec3::ZERO)
                    .map_or([Vec3::ZERO; 2], |point| lighting.incoming(point, sample))
            })
            .collect();
        let mut light = Self {
            lighting,
            size,
            points,
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
        let mut lit: Vec<f32> =
            direct.iter().zip(indirect).map(|(a, b)| luminance(*a + *b)).filter(|light| *light > 0.0).collect();
        let rank = (lit.len() as f32 * TYPICAL_QUANTILE) as usize;
        if rank < lit.len() {
            light.typical = *lit.select_nth_unstable_by(rank, f32::total_cmp).1;
        }
        light
    }

    /// Runs one smoothing pass: the mean of neighbours in the same plane, `step` apart (à-trous filter, Dammertz et
    /// al., HPG 2010).
    fn smooth(&self, incoming: &[Vec3], step: i32) -> Vec<Vec3> {
        let [width, height] = self.size;
        (0..width * height)
            .into_par_iter()
            .map(|i| {
                let Some(own) = &self.points[i] else {
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
                        if let Some(other) = &self.points[j] {
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

    /// Light that reaches a surface point, given with its image coordinates.
    fn incoming_at(&self, point: &SurfacePoint, [x, y]: [f32; 2]) -> Vec3 {
        let [width, height] = self.size;
        let (u, v) = ((x * 0.5).max(0.0), (y * 0.5).max(0.0));
        let (left, top) = (u.floor(), v.floor());
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let [i, j] = [(left as usize + dx).min(width - 1), (top as usize + dy).min(height - 1)];
            let index = j * width + i;
            if let Some(other) = &self.points[index] {
                let near =
                    (1.0 - (u - (left + dx as f32)).abs()).max(0.0) * (1.0 - (v - (top + dy as f32)).abs()).max(0.0);
                let weight = (near + 0.01) * similarity(point, other);
                sum += (self.incoming[0][index] + self.incoming[1][index]) * weight;
                weights += weight;
            }
        }
        if weights > 0.02 {
            return sum / weights;
        }
        (0..STRATA * STRATA)
            .map(|stratum| {
                let sample = LightSample { stratum, pixel: [(x * 8.0) as i32, (y * 8.0) as i32] };
                let [direct, indirect] = self.lighting.incoming(point, sample);
                direct + indirect
            })
            .sum::<Vec3>()
            / (STRATA * STRATA) as f32
    }

    /// Light that a surface point sends to a camera; `image_position` is the position of the point in the image, in
    /// pixels.
    pub(super) fn shade(&self, point: &SurfacePoint, camera: Vec3, image_position: [f32; 2]) -> Vec3 {
        if point.glow != Vec3::ZERO {
            return self.glow(point);
        }
        let incoming = self.incoming_at(point, image_position);
        let matte = point.color * incoming;
        if point.gloss == Gloss::Dull {
            return matte;
        }
        let direction = (point.position - camera).normalize_or_zero();
        let slant = (-direction.dot(point.normal)).clamp(0.0, 1.0);
        // Schlick's approximation of the Fresnel equations for a refractive index of 1.5.
        let rest = 1.0 - slant;
        let share = 0.04 + 0.96 * rest * rest * rest * rest * rest;
        let ray = Ray::new(point.position + point.normal * 1e-3, reflect(direction, point.normal));
        let reflected = SurfacePoint::first_hit(self.lighting.scene, self.lighting.tree, &ray)
            .map_or(Vec3::ZERO, |seen| seen.color * self.lighting.ambient * 1.6 + self.glow(&seen));
        matte * (1.0 - 0.5 * share) + reflected * (0.5 * share)
    }

    /// Light of a point that glows. In display codes, the brightness of a lamp is relative to that of the room, so that
    /// it never looks grey. In linear light, it is the radiance that lights the room.
    fn glow(&self, point: &SurfacePoint) -> Vec3 {
        let radiance = self.radiances.get(point.thing).copied().flatten();
        match radiance.filter(|_| point.glow != Vec3::ZERO) {
            Some(radiance) => point.color * radiance,
            None => point.glow * self.typical(),
        }
    }

    /// Typical brightness of the light that reaches the objects in view.
    pub(super) fn typical(&self) -> f32 {
        self.typical
    }
}

/// Similarity of two points: 1 in the same plane, 0 on different things.
fn similarity(a: &SurfacePoint, b: &SurfacePoint) -> f32 {
    if a.seen_thing != b.seen_thing || a.thing != b.thing {
        return 0.0;
    }
    let facing = a.normal.dot(b.normal);
    if facing < 0.8 {
        return 0.0;
    }
    let off = (b.position - a.position).dot(a.normal).abs();
    let reach = 0.01 + 0.01 * a.distance;
    let near = (1.0 - off / (3.0 * reach)).max(0.0);
    near * (facing - 0.75) * 4.0
}
