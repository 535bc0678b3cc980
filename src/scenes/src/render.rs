//! The image and the maps of a room from one camera: [`render`].
//!
//! Every pixel is traced once, and pixels at edges four times more. Light changes slowly, so it is sampled at every second
//! pixel of every second row, smoothed between points of the same plane, and interpolated. A point without a similar
//! neighbour gets its own samples.

use std::sync::{Arc, LazyLock};

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::Bvh;
use super::camera::Camera;
use super::light::{LightSample, Lighting, STRATA, brightness};
use super::light_grid::LightGrid;
use super::room_light::RoomLight;
use super::scene::Scene;
use super::spot::SurfacePoint;
use darkqa_ground::types::{Light, Pixels, Rgb};

/// The image and the maps of a view.
#[derive(Debug)]
pub(super) struct RenderedView {
    pub(super) pixels: Pixels,
    /// Depth of each pixel in millimetres along the optical axis, at most 65,535; 0 if there is none.
    pub(super) depth: Vec<u16>,
    /// The number of the thing at each pixel, from 1; 0 if there is none.
    pub(super) things: Vec<u16>,
}

/// The offsets of the four rays of a pixel at an edge, in pixels (rotated grid).
const SUBPIXELS: [[f32; 2]; 4] = [
    [-0.125, -0.375],
    [0.375, -0.125],
    [0.125, 0.375],
    [-0.375, 0.125],
];

/// The linear light of white in the typical light of the view (chosen, so that the mean light of the rooms is that of photographs
/// of rooms).
const EXPOSURE: f32 = 0.98;

/// The minimum difference of linear colours between neighbouring pixels that makes an edge (chosen).
const EDGE: f32 = 0.06;

/// The image and the maps of a scene, as a camera sees it. The image has the codes of a display, or linear light.
pub(super) fn render(scene: &Scene, tree: &Bvh, camera: &Camera, shown: RoomLight) -> RenderedView {
    let [width, height] = camera.size;
    let spots = spots(scene, tree, camera);
    let lighting = lighting(scene, tree, &spots);
    let radiances = match shown {
        RoomLight::Display => Vec::new(),
        RoomLight::Linear => scene.radiances(),
    };
    let light = LightGrid::new(&lighting, &spots, camera.size, radiances);
    let colors: Vec<Vec3> = spots
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
    let exposure = EXPOSURE / light.typical().max(1e-6);
    // The light of a pixel, each of its rays after a curve.
    let pixel = |i: usize, curve: fn(Vec3) -> Vec3| {
        let (at, color) = ([i % width, i / width], colors[i]);
        if is_edge(&spots, &colors, camera.size, at, exposure) {
            SUBPIXELS
                .map(|[dx, dy]| [at[0] as f32 + dx, at[1] as f32 + dy])
                .map(|[x, y]| {
                    let spot = SurfacePoint::through_mirror(scene, tree, &camera.ray(x, y));
                    let color = spot.map_or(color, |spot| light.shade(&spot, camera.at, [x, y]));
                    curve(color * exposure)
                })
                .iter()
                .sum::<Vec3>()
                / 4.0
        } else {
            curve(color * exposure)
        }
    };
    let places = (0..width * height).into_par_iter();
    let pixels = match shown {
        RoomLight::Display => {
            let codes: Vec<[u8; 3]> = places
                .map(|i| pixel(i, tone_mapped).to_array().map(srgb_code))
                .collect();
            let codes = Rgb::new(height, width, codes.concat());
            let codes = codes.unwrap_or_else(|_| Rgb::black(height, width));
            Pixels::Codes8(Arc::new(codes))
        }
        RoomLight::Linear => {
            let light: Vec<[f32; 3]> = places
                .map(|i| pixel(i, |light| light.max(Vec3::ZERO)).to_array())
                .collect();
            let light = Light::new(height, width, light.concat());
            let light = light.unwrap_or_else(|_| Light::black(height, width));
            Pixels::Light(Arc::new(light))
        }
    };
    RenderedView {
        depth: depth(&spots, camera),
        things: spots
            .iter()
            .map(|spot| spot.map_or(0, |spot| spot.thing as u16 + 1))
            .collect(),
        pixels,
    }
}

/// The first surface point on the ray through the middle of each pixel.
fn spots(scene: &Scene, tree: &Bvh, camera: &Camera) -> Vec<Option<SurfacePoint>> {
    let [width, height] = camera.size;
    let places = (0..width * height).into_par_iter().with_min_len(width);
    places
        .map(|i| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            SurfacePoint::through_mirror(scene, tree, &ray)
        })
        .collect()
}

/// Depth of each pixel in millimetres along the optical axis, at most 65,535; 0 if there is none.
fn depth(spots: &[Option<SurfacePoint>], camera: &Camera) -> Vec<u16> {
    let (width, axis) = (camera.size[0], camera.axis());
    spots
        .iter()
        .enumerate()
        .map(|(i, spot)| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            spot.map_or(0, |spot| {
                (spot.distance * ray.direction.dot(axis) * 1000.0 + 0.5) as u16
            })
        })
        .collect()
}

/// The number of the thing at each pixel of a small view, from 1; 0 if there is none.
pub(super) fn preview(scene: &Scene, tree: &Bvh, camera: &Camera) -> Vec<u32> {
    let [width, height] = camera.size;
    (0..width * height)
        .map(|i| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            let hit = tree.first(&ray, super::spot::FAR);
            hit.map_or(0, |hit| scene.owners[hit.face] as u32 + 1)
        })
        .collect()
}

/// The lighting of a scene. The ambient light is estimated from the direct light and the colours of visible points.
fn lighting<'a>(scene: &'a Scene, tree: &'a Bvh, spots: &[Option<SurfacePoint>]) -> Lighting<'a> {
    let mut lighting = Lighting {
        scene,
        tree,
        ambient: Vec3::ZERO,
    };
    let step = (spots.len() / 1024).max(1);
    let (mut direct, mut albedo, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for (i, spot) in spots.iter().step_by(step).flatten().enumerate() {
        if spot.glow == Vec3::ZERO {
            let sample = LightSample {
                stratum: i % (STRATA * STRATA),
                place: [i as i32, -1],
            };
            direct += lighting.direct(spot.at, spot.normal, sample);
            albedo += spot.color;
            count += 1.0;
        }
    }
    if count > 0.0 {
        let (direct, albedo) = (direct / count, albedo / count);
        // Light is reflected many times: a / (1 - a) of it for an albedo a. A part of that is sampled.
        let bounced = albedo / (Vec3::ONE - albedo.min(Vec3::splat(0.75)));
        let ambient = direct * (bounced * 0.9 + 0.36);
        // The visible colours are not those of the whole room, so the ambient colour is moved towards grey.
        lighting.ambient = ambient.lerp(Vec3::splat(brightness(ambient)), 0.65);
    }
    lighting
}

/// Whether a pixel is at an edge between things or colours.
fn is_edge(
    spots: &[Option<SurfacePoint>],
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
            (Some(a), Some(b)) => a.thing != b.thing || a.seen_thing != b.seen_thing,
            _ => true,
        };
        let (a, b) = (
            tone_mapped(colors[own] * exposure),
            tone_mapped(colors[other] * exposure),
        );
        differ || (a - b).abs().max_element() > EDGE
    })
}

/// Linear light after tone mapping: bright light is compressed, so that windows keep details. All channels are divided by the same
/// number, so that a bright colour keeps its name.
fn tone_mapped(light: Vec3) -> Vec3 {
    const KNEE: f32 = 0.6;
    let most = light.max_element();
    if most <= KNEE {
        return light.max(Vec3::ZERO);
    }
    let over = (most - KNEE) / (1.0 - KNEE);
    let compressed = KNEE + (1.0 - KNEE) * over / (1.0 + over * 0.8).min(1.0 + over);
    (light * (compressed.min(1.0) / most)).max(Vec3::ZERO)
}

/// The nearest sRGB code of linear light (IEC 61966-2-1).
fn srgb_code(value: f32) -> u8 {
    /// The minimum light of each code above 0: halfway, in codes, from the code below.
    static STEPS: LazyLock<Vec<f32>> = LazyLock::new(|| {
        (1..=255)
            .map(|code: u16| {
                let value = (f32::from(code) - 0.5) / 255.0;
                if value <= 0.04045 {
                    value / 12.92
                } else {
                    libm::powf((value + 0.055) / 1.055, 2.4)
                }
            })
            .collect()
    });
    STEPS.partition_point(|step| *step <= value) as u8
}
