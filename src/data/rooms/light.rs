//! Light that reaches a point: [`Lighting`].
//!
//! Direct light comes from lamps and windows; each is sampled with a shadow ray. Indirect light comes from other
//! surfaces: rays over the half-space (cosine-weighted) return the colour of the surface that they hit, lit by one
//! light each, plus a constant ambient light. So the first bounce is sampled and later bounces are averaged. This gives
//! soft shadows, dark corners and colour bleeding, but no caustics.
//!
//! Light in a view, sampled coarsely and smoothed: [`LightGrid`].
//!
//! Point where a ray hits a thing of the scene: [`SurfacePoint`].
//!
//! [`RoomLight`]: encoding of the pixels of the built-in rooms.

use clap::ValueEnum;
use glam::{Vec3, vec3};
use rayon::prelude::*;

use super::bvh::{Bvh, Hit, Ray};
use super::mesh::{LightSource, Scene, cos_sin};
use super::pattern::{SurfaceFinish, hash};
use darkqa_base::types::flags::flag_words;

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

/// Encoding of the pixels of the rooms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum RoomLight {
    /// 8-bit codes of a display, with highlights compressed
    #[default]
    Display,
    /// Linear light: windows and lamps keep their ratio to the room
    Linear,
}

flag_words!(RoomLight);
