//! A view of a room: its image and its maps, [`render`].
//!
//! Every pixel is traced once, those at edges four times more. Light is slow to change: it is sampled at every other pixel of
//! every other row, by neighbours in turn, smoothed between places of one plane, and spread from there; a place that has no
//! neighbour of its kind is lit by samples of its own.

use std::sync::LazyLock;

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::{Bvh, Ray};
use super::camera::Camera;
use super::light::{LightSample, Lighting, STRATA, brightness};
use super::scene::Scene;
use super::spot::{Gloss, Spot, reflected};
use crate::types::Rgb;

/// What is seen of a room.
#[derive(Debug)]
pub(super) struct RenderedView {
    pub(super) rgb: Rgb,
    /// Millimetres along the optical axis.
    pub(super) depth: Vec<u32>,
    /// The number of the thing at each pixel, from 1.
    pub(super) things: Vec<u32>,
}

/// How the corners of a pixel at an edge are laid out (the rotated grid of four).
const WITHIN: [[f32; 2]; 4] = [
    [-0.125, -0.375],
    [0.375, -0.125],
    [0.125, 0.375],
    [-0.375, 0.125],
];

/// Neighbouring pixels whose colours differ by more are an edge.
const EDGE: f32 = 0.06;

/// Renders a view.
pub(super) fn render(scene: &Scene, camera: &Camera) -> RenderedView {
    let tree = scene.tree();
    let [width, height] = camera.size;
    let spots: Vec<Option<Spot>> = (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(|i| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            Spot::seen(scene, &tree, &ray)
        })
        .collect();
    let lighting = lighting(scene, &tree, &spots);
    let light = LightGrid::new(&lighting, &spots, camera.size);
    let plain: Vec<Vec3> = spots
        .par_iter()
        .enumerate()
        .map(|(i, spot)| match spot {
            Some(spot) => {
                let [x, y] = [i % width, i / width].map(|n| n as f32);
                light.shade(spot, camera.at, [x, y])
            }
            None => Vec3::ZERO,
        })
        .collect();
    let exposure = 1.2 / light.typical().max(1e-6);
    let samples: Vec<[u8; 3]> = plain
        .par_iter()
        .enumerate()
        .map(|(i, color)| {
            let at = [i % width, i / width];
            let seen = if edge(&spots, &plain, camera.size, at, exposure) {
                let rays = WITHIN.map(|[dx, dy]| [at[0] as f32 + dx, at[1] as f32 + dy]);
                let colors = rays.map(|[x, y]| {
                    let spot = Spot::seen(scene, &tree, &camera.ray(x, y));
                    let color = spot.map_or(*color, |spot| light.shade(&spot, camera.at, [x, y]));
                    developed(color * exposure)
                });
                colors.iter().sum::<Vec3>() / 4.0
            } else {
                developed(*color * exposure)
            };
            seen.to_array().map(encoded)
        })
        .collect();
    let axis = camera.axis();
    let depth = spots.iter().enumerate().map(|(i, spot)| {
        let ray = camera.ray((i % width) as f32, (i / width) as f32);
        spot.map_or(0, |spot| {
            (spot.far * ray.along.dot(axis) * 1000.0 + 0.5) as u32
        })
    });
    RenderedView {
        depth: depth.collect(),
        things: spots
            .iter()
            .map(|spot| spot.map_or(0, |spot| spot.thing as u32 + 1))
            .collect(),
        rgb: Rgb::new(height, width, samples.concat())
            .unwrap_or_else(|_| Rgb::black(height, width)),
    }
}

/// The numbers of the things that a small view shows, from 1.
pub(super) fn glimpse(scene: &Scene, tree: &Bvh, camera: &Camera) -> Vec<u32> {
    let [width, height] = camera.size;
    (0..width * height)
        .map(|i| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            let hit = tree.first(&ray, super::spot::FAR);
            hit.map_or(0, |hit| scene.owners[hit.face] as u32 + 1)
        })
        .collect()
}

/// The light of a scene: what is left after many bounces is as much as its walls would give back of what reaches them.
fn lighting<'a>(scene: &'a Scene, tree: &'a Bvh, spots: &[Option<Spot>]) -> Lighting<'a> {
    let mut lighting = Lighting {
        scene,
        tree,
        ambient: Vec3::ZERO,
    };
    let step = (spots.len() / 1024).max(1);
    let (mut direct, mut given, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for (i, spot) in spots.iter().step_by(step).flatten().enumerate() {
        if spot.glow == Vec3::ZERO {
            let sample = LightSample {
                stratum: i % (STRATA * STRATA),
                place: [i as i32, -1],
            };
            direct += lighting.direct(spot.at, spot.normal, sample);
            given += spot.color;
            count += 1.0;
        }
    }
    if count > 0.0 {
        let (direct, given) = (direct / count, given / count);
        // A room sends light back again and again: g / (1 - g) of it, of which a part is sampled.
        let many = given / (Vec3::ONE - given.min(Vec3::splat(0.75)));
        let left = direct * (many * 0.9 + 0.16);
        // The colours of what is in view are not those of the whole room: most of them average out.
        lighting.ambient = left.lerp(Vec3::splat(brightness(left)), 0.65);
    }
    lighting
}

/// The light at every other pixel of every other row.
struct LightGrid<'a> {
    lighting: &'a Lighting<'a>,
    grid: [usize; 2],
    places: Vec<Option<Spot>>,
    /// Straight from lamps and windows, and by way of other things, which is smoother.
    reaching: [Vec<Vec3>; 2],
}

/// How far apart the neighbours are that are smoothed over, one pass after the other.
const PASSES: [&[usize]; 2] = [&[1, 2, 1], &[1, 2, 4, 8, 2]];

impl<'a> LightGrid<'a> {
    fn new(lighting: &'a Lighting<'a>, spots: &[Option<Spot>], size: [usize; 2]) -> Self {
        let grid = size.map(|side| side.div_ceil(2));
        let places: Vec<Option<Spot>> = (0..grid[0] * grid[1])
            .map(|i| spots[(i / grid[0]) * 2 * size[0] + (i % grid[0]) * 2])
            .collect();
        let reaching: Vec<[Vec3; 2]> = places
            .par_iter()
            .enumerate()
            .map(|(i, spot)| {
                let [x, y] = [i % grid[0], i / grid[0]];
                let sample = LightSample {
                    stratum: (x % STRATA) + (y % STRATA) * STRATA,
                    place: [x as i32, y as i32],
                };
                let lit = spot.as_ref().filter(|spot| spot.glow == Vec3::ZERO);
                lit.map_or([Vec3::ZERO; 2], |spot| lighting.reaching(spot, sample))
            })
            .collect();
        let mut light = Self {
            lighting,
            grid,
            places,
            reaching: [0, 1].map(|part| reaching.iter().map(|light| light[part]).collect()),
        };
        for (part, passes) in PASSES.iter().enumerate() {
            for step in *passes {
                light.reaching[part] = light.smooth(&light.reaching[part], *step as i32);
            }
        }
        light
    }

    /// Takes the mean of neighbours of one plane, so many places apart (the à-trous filter of Dammertz et al., HPG 2010).
    fn smooth(&self, reaching: &[Vec3], step: i32) -> Vec<Vec3> {
        let [width, height] = self.grid;
        let smoothed = (0..width * height).into_par_iter().map(|i| {
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
                        let weight = alike(own, other);
                        sum += reaching[j] * weight;
                        weights += weight;
                    }
                }
            }
            sum / weights.max(1e-6)
        });
        smoothed.collect()
    }

    /// The light at a place of the image.
    fn at(&self, spot: &Spot, [x, y]: [f32; 2]) -> Vec3 {
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
                let weight = (near + 0.01) * alike(spot, other);
                sum += (self.reaching[0][place] + self.reaching[1][place]) * weight;
                weights += weight;
            }
        }
        if weights > 0.02 {
            return sum / weights;
        }
        let samples = (0..STRATA * STRATA).map(|stratum| {
            let sample = LightSample {
                stratum,
                place: [(x * 8.0) as i32, (y * 8.0) as i32],
            };
            let [direct, gathered] = self.lighting.reaching(spot, sample);
            direct + gathered
        });
        samples.sum::<Vec3>() / (STRATA * STRATA) as f32
    }

    /// The light that a place of the image sends to the camera.
    fn shade(&self, spot: &Spot, from: Vec3, at: [f32; 2]) -> Vec3 {
        if spot.glow != Vec3::ZERO {
            // A lamp is as bright as its glow beside what is usual in the room, so that it never goes grey.
            return spot.glow * self.typical();
        }
        let reaching = self.at(spot, at);
        let matte = spot.color * reaching;
        if spot.glossy == Gloss::Dull {
            return matte;
        }
        let along = (spot.at - from).normalize_or_zero();
        let slant = (-along.dot(spot.normal)).clamp(0.0, 1.0);
        // Schlick's approximation of Fresnel's equations for an index of 1.5.
        let rest = 1.0 - slant;
        let share = 0.04 + 0.96 * rest * rest * rest * rest * rest;
        let ray = Ray::new(spot.at + spot.normal * 1e-3, reflected(along, spot.normal));
        let back = Spot::first(self.lighting.scene, self.lighting.tree, &ray);
        let back = back.map_or(Vec3::ZERO, |back| {
            back.color * self.lighting.ambient * 1.6 + back.glow * self.typical()
        });
        matte * (1.0 - 0.5 * share) + back * (0.5 * share)
    }

    /// How bright the light is that usually reaches a place in the view.
    fn typical(&self) -> f32 {
        brightness(self.lighting.ambient) * 2.2
    }
}

/// How much two places have to do with each other: 1 on one plane, 0 on different things.
fn alike(a: &Spot, b: &Spot) -> f32 {
    if a.shown != b.shown || a.thing != b.thing {
        return 0.0;
    }
    let facing = a.normal.dot(b.normal);
    if facing < 0.8 {
        return 0.0;
    }
    let off = (b.at - a.at).dot(a.normal).abs();
    let reach = 0.01 + 0.01 * a.far;
    let near = (1.0 - off / (3.0 * reach)).max(0.0);
    near * (facing - 0.75) * 4.0
}

/// Whether a pixel is at an edge, of things or of colours.
fn edge(
    spots: &[Option<Spot>],
    colors: &[Vec3],
    [width, height]: [usize; 2],
    [x, y]: [usize; 2],
    exposure: f32,
) -> bool {
    let own = y * width + x;
    let neighbours = [
        (x > 0).then(|| own - 1),
        (x + 1 < width).then_some(own + 1),
        (y > 0).then(|| own - width),
        (y + 1 < height).then_some(own + width),
    ];
    neighbours.into_iter().flatten().any(|other| {
        let differ = match (&spots[own], &spots[other]) {
            (Some(a), Some(b)) => a.thing != b.thing || a.shown != b.shown,
            _ => true,
        };
        let (a, b) = (
            developed(colors[own] * exposure),
            developed(colors[other] * exposure),
        );
        differ || (a - b).abs().max_element() > EDGE
    })
}

/// What a camera makes of light: bright light is pressed together, so that windows keep their clouds.
fn developed(light: Vec3) -> Vec3 {
    const KNEE: f32 = 0.6;
    let press = |value: f32| {
        if value <= KNEE {
            value
        } else {
            let over = (value - KNEE) / (1.0 - KNEE);
            KNEE + (1.0 - KNEE) * over / (1.0 + over * 0.8).min(1.0 + over)
        }
    };
    Vec3::new(press(light.x), press(light.y), press(light.z)).min(Vec3::ONE)
}

/// The sRGB code of linear light (IEC 61966-2-1), to the nearest.
fn encoded(value: f32) -> u8 {
    /// The least light of each code above 0: half-way, in codes, from the one below.
    static STEPS: LazyLock<Vec<f32>> = LazyLock::new(|| {
        let step = |code: u16| {
            let value = (f32::from(code) - 0.5) / 255.0;
            if value <= 0.04045 {
                value / 12.92
            } else {
                libm::powf((value + 0.055) / 1.055, 2.4)
            }
        };
        (1..=255).map(step).collect()
    });
    STEPS.partition_point(|step| *step <= value) as u8
}
