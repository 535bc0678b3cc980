//! Image and maps of a room from one camera: [`render`].
//!
//! Every pixel is traced once, and pixels at edges four more times. Light changes slowly, so it is sampled at every
//! second pixel of every second row, smoothed between points of the same plane, and interpolated. A point without a
//! similar neighbour gets its own samples.

use std::sync::{Arc, LazyLock};

use glam::Vec3;
use rayon::prelude::*;

use super::bvh::Bvh;
use super::camera::Pinhole;
use super::light::{LightGrid, LightSample, Lighting, RoomLight, STRATA, SurfacePoint, luminance};
use super::mesh::Scene;
use darkqa_base::types::{Light, Pixels, Rgb};

/// Image and maps of a view.
#[derive(Debug)]
pub(super) struct RenderedView {
    pub(super) pixels: Pixels,
    /// Depth of each pixel in millimetres along the optical axis, at most 65,535; 0 without a thing.
    pub(super) depth: Vec<u16>,
    /// Number of the thing at each pixel, from 1; 0 without a thing.
    pub(super) things: Vec<u16>,
}

/// Offsets of the four rays of a pixel at an edge, in pixels (rotated grid).
const SUBPIXELS: [[f32; 2]; 4] = [[-0.125, -0.375], [0.375, -0.125], [0.125, 0.375], [-0.375, 0.125]];

/// Linear light of a white surface in the typical light of the view (chosen, so that the rooms are on average as bright
/// as photographs of rooms).
const EXPOSURE: f32 = 0.98;

/// Minimum difference of tone-mapped colours between neighbouring pixels that makes an edge (chosen).
const EDGE_CONTRAST: f32 = 0.06;

/// Renders the image and the maps of a scene. `encoding` is the encoding of the image.
pub(super) fn render(scene: &Scene, tree: &Bvh, camera: &Pinhole, encoding: RoomLight) -> RenderedView {
    let [width, height] = camera.size;
    let points = trace_pixels(scene, tree, camera);
    let lighting = estimate_lighting(scene, tree, &points);
    let radiances = match encoding {
        RoomLight::Display => Vec::new(),
        RoomLight::Linear => scene.radiances(),
    };
    let light = LightGrid::new(&lighting, &points, camera.size, radiances);
    let colors: Vec<Vec3> = points
        .par_iter()
        .enumerate()
        .map(|(i, point)| match point {
            Some(point) => {
                let [x, y] = [i % width, i / width].map(|n| n as f32);
                light.shade(point, camera.position, [x, y])
            }
            None => Vec3::ZERO,
        })
        .collect();
    let exposure = EXPOSURE / light.typical().max(1e-6);
    // Light of a pixel; the curve is applied to each of its rays.
    let pixel = |i: usize, curve: fn(Vec3) -> Vec3| {
        let (at, color) = ([i % width, i / width], colors[i]);
        if is_edge(&points, &colors, camera.size, at, exposure) {
            SUBPIXELS
                .map(|[dx, dy]| [at[0] as f32 + dx, at[1] as f32 + dy])
                .map(|[x, y]| {
                    let point = SurfacePoint::through_mirror(scene, tree, &camera.ray(x, y));
                    let color = point.map_or(color, |point| light.shade(&point, camera.position, [x, y]));
                    curve(color * exposure)
                })
                .iter()
                .sum::<Vec3>()
                / 4.0
        } else {
            curve(color * exposure)
        }
    };
    let indices = (0..width * height).into_par_iter();
    let pixels = match encoding {
        RoomLight::Display => {
            let codes: Vec<[u8; 3]> = indices.map(|i| pixel(i, tone_map).to_array().map(srgb_code)).collect();
            let image = Rgb::new(height, width, codes.concat()).unwrap_or_else(|_| Rgb::black(height, width));
            Pixels::Codes8(Arc::new(image))
        }
        RoomLight::Linear => {
            let light: Vec<[f32; 3]> = indices.map(|i| pixel(i, |light| light.max(Vec3::ZERO)).to_array()).collect();
            let image = Light::new(height, width, light.concat()).unwrap_or_else(|_| Light::black(height, width));
            Pixels::Light(Arc::new(image))
        }
    };
    RenderedView {
        depth: depth(&points, camera),
        things: points.iter().map(|point| point.map_or(0, |point| point.thing as u16 + 1)).collect(),
        pixels,
    }
}

/// Returns the first surface point on the ray through the center of each pixel.
fn trace_pixels(scene: &Scene, tree: &Bvh, camera: &Pinhole) -> Vec<Option<SurfacePoint>> {
    let [width, height] = camera.size;
    (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(|i| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            SurfacePoint::through_mirror(scene, tree, &ray)
        })
        .collect()
}

/// Depth of each pixel in millimetres along the optical axis, at most 65,535; 0 without a thing.
fn depth(points: &[Option<SurfacePoint>], camera: &Pinhole) -> Vec<u16> {
    let (width, axis) = (camera.size[0], camera.axis());
    points
        .iter()
        .enumerate()
        .map(|(i, point)| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            point.map_or(0, |point| (point.distance * ray.direction.dot(axis) * 1000.0 + 0.5) as u16)
        })
        .collect()
}

/// Number of the thing at each pixel of a small view, from 1; 0 without a thing.
pub(super) fn preview(scene: &Scene, tree: &Bvh, camera: &Pinhole) -> Vec<u32> {
    let [width, height] = camera.size;
    (0..width * height)
        .map(|i| {
            let ray = camera.ray((i % width) as f32, (i / width) as f32);
            let hit = tree.closest_hit(&ray, super::light::FAR);
            hit.map_or(0, |hit| scene.face_owners[hit.face] as u32 + 1)
        })
        .collect()
}

/// Estimates the ambient light of a scene from the direct light and the colours of visible points.
fn estimate_lighting<'a>(scene: &'a Scene, tree: &'a Bvh, points: &[Option<SurfacePoint>]) -> Lighting<'a> {
    let mut lighting = Lighting { scene, tree, ambient: Vec3::ZERO };
    let step = (points.len() / 1024).max(1);
    let (mut direct, mut albedo, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for (i, point) in points.iter().step_by(step).flatten().enumerate() {
        if point.glow == Vec3::ZERO {
            let sample = LightSample { stratum: i % (STRATA * STRATA), pixel: [i as i32, -1] };
            direct += lighting.direct(point.position, point.normal, sample);
            albedo += point.color;
            count += 1.0;
        }
    }
    if count > 0.0 {
        let (direct, albedo) = (direct / count, albedo / count);
        // All bounces together reflect a / (1 − a) of the light for an albedo a. A part of that is sampled.
        let bounced = albedo / (Vec3::ONE - albedo.min(Vec3::splat(0.75)));
        let ambient = direct * (bounced * 0.9 + 0.36);
        // The visible colours differ from those of the whole room, so the ambient colour is moved towards grey.
        lighting.ambient = ambient.lerp(Vec3::splat(luminance(ambient)), 0.65);
    }
    lighting
}

/// True if a pixel is at an edge between things or colours.
fn is_edge(
    points: &[Option<SurfacePoint>],
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
        let is_thing_edge = match (&points[own], &points[other]) {
            (Some(a), Some(b)) => a.thing != b.thing || a.seen_thing != b.seen_thing,
            _ => true,
        };
        let (a, b) = (tone_map(colors[own] * exposure), tone_map(colors[other] * exposure));
        is_thing_edge || (a - b).abs().max_element() > EDGE_CONTRAST
    })
}

/// Compresses bright linear light, so that windows keep details. All channels are divided by the same number, so that a
/// bright colour keeps its name.
fn tone_map(light: Vec3) -> Vec3 {
    const KNEE: f32 = 0.6;
    let most = light.max_element();
    if most <= KNEE {
        return light.max(Vec3::ZERO);
    }
    let over = (most - KNEE) / (1.0 - KNEE);
    let compressed = KNEE + (1.0 - KNEE) * over / (1.0 + over * 0.8).min(1.0 + over);
    (light * (compressed.min(1.0) / most)).max(Vec3::ZERO)
}

/// Returns the nearest sRGB code of linear light (IEC 61966-2-1).
fn srgb_code(value: f32) -> u8 {
    /// Minimum light of each code above 0: that of the code minus one half.
    static STEPS: LazyLock<Vec<f32>> = LazyLock::new(|| {
        (1..=255)
            .map(|code: u16| {
                let value = (f32::from(code) - 0.5) / 255.0;
                if value <= 0.04045 { value / 12.92 } else { libm::powf((value + 0.055) / 1.055, 2.4) }
            })
            .collect()
    });
    STEPS.partition_point(|step| *step <= value) as u8
}
