//! Surfaces of things: [`Surface`], with patterns that depend on the point in the coordinates of the thing.

use glam::{Vec2, Vec3, vec2, vec3};

use super::paint::{Paint, rgb};

/// The material of a face.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Surface {
    /// The share of linear light that the surface reflects, by channel, before the pattern changes it.
    pub(super) color: Vec3,
    pub(super) pattern: Pattern,
    pub(super) finish: SurfaceFinish,
}

/// The way in which the colour varies over a surface. Lengths are metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pattern {
    Plain,
    /// Wood with its grain along an axis (0 x, 1 y, 2 z).
    Grain(usize),
    /// Floor boards along z, of this width.
    Boards(f32),
    /// Square tiles of this size, with joints of this colour.
    Tiles(f32, Vec3),
    /// Woven cloth with visible threads.
    Cloth,
    /// The soft pile of towels and carpets.
    Pile,
    /// Stone with darker specks, as of counters.
    Stone,
    /// Stripes along y of this width, in a second colour.
    Stripes(f32, Vec3),
    /// A painting on a canvas of this width and height, drawn from this seed.
    Canvas(Vec2, u32),
    /// A rug of this width and depth with a border of a second colour.
    Rug(Vec2, Vec3),
    /// The view out of a window of this height, with its sill at y = 0.
    Outdoors(f32),
    /// The dark face of a screen of this width and height.
    Screen(Vec2),
}

/// The way in which a surface reflects light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SurfaceFinish {
    /// The same light in all directions.
    Matte,
    /// Matte with a highlight.
    Glossy,
    /// A mirror image of the room.
    Mirror,
    /// A source of light, this many times as bright as its colour; it casts no shadow.
    Glow(f32),
}

impl Surface {
    fn new(color: Vec3, pattern: Pattern, finish: SurfaceFinish) -> Self {
        Self {
            color,
            pattern,
            finish,
        }
    }

    /// Matte paint of one colour.
    pub(super) fn paint(paint: Paint) -> Self {
        Self::new(paint.color, Pattern::Plain, SurfaceFinish::Matte)
    }

    /// Lacquer, ceramic or plastic.
    pub(super) fn gloss(paint: Paint) -> Self {
        Self::new(paint.color, Pattern::Plain, SurfaceFinish::Glossy)
    }

    /// Matte cloth of one colour.
    pub(super) fn cloth(paint: Paint) -> Self {
        Self::new(paint.color, Pattern::Cloth, SurfaceFinish::Matte)
    }

    /// A matte colour by its sRGB codes.
    pub(super) fn plain(codes: [u8; 3]) -> Self {
        Self::new(rgb(codes), Pattern::Plain, SurfaceFinish::Matte)
    }

    /// Glossy grey metal, as steel.
    pub(super) fn steel() -> Self {
        Self::new(rgb([176, 178, 182]), Pattern::Plain, SurfaceFinish::Glossy)
    }

    pub(super) fn with(&self, pattern: Pattern) -> Self {
        Self {
            pattern,
            ..self.clone()
        }
    }

    pub(super) fn finished(&self, finish: SurfaceFinish) -> Self {
        Self {
            finish,
            ..self.clone()
        }
    }

    /// Wood with its grain along an axis, in the colour of a paint.
    pub(super) fn wood(paint: Paint, axis: usize) -> Self {
        Self::new(paint.color, Pattern::Grain(axis), SurfaceFinish::Matte)
    }

    /// The colour at a point with a surface normal, both in the coordinates of the thing.
    pub(super) fn color_at(&self, place: Vec3, normal: Vec3) -> Vec3 {
        let across = flat(place, normal);
        match self.pattern {
            Pattern::Plain => self.color,
            Pattern::Grain(axis) => self.color * grain(place, axis),
            Pattern::Boards(width) => self.color * boards(place, width),
            Pattern::Tiles(size, joint) => tiles(self.color, across, size, joint),
            Pattern::Cloth => {
                let threads = ripple(across.x * 160.0) * ripple(across.y * 160.0);
                self.color * (0.97 + 0.05 * threads + 0.08 * (noise(place * 24.0) - 0.5))
            }
            Pattern::Pile => {
                self.color * (0.8 + 0.22 * noise(place * 90.0) + 0.18 * noise(place * 28.0))
            }
            Pattern::Stone => {
                let speck = noise(place * 130.0);
                self.color
                    * (0.92 + 0.16 * noise(place * 11.0) - if speck > 0.78 { 0.18 } else { 0.0 })
            }
            Pattern::Stripes(width, other) => {
                let odd = (across.x / width).floor().rem_euclid(2.0) > 0.5;
                let color = if odd { other } else { self.color };
                color * (0.96 + 0.08 * noise(place * 30.0))
            }
            Pattern::Canvas(size, seed) => canvas(place, size, seed),
            Pattern::Rug(size, border) => rug(self.color, place, size, border),
            Pattern::Outdoors(height) => outdoors(place, height),
            Pattern::Screen(size) => {
                let share = (place.x / size.x + place.y / size.y) * 0.5;
                self.color * (1.0 + 0.8 * (share - share.floor()))
            }
        }
    }
}

/// The two coordinates of a point on the axis plane that is closest to the face.
fn flat(place: Vec3, normal: Vec3) -> Vec2 {
    let size = normal.abs();
    if size.y >= size.x && size.y >= size.z {
        vec2(place.x, place.z)
    } else if size.x >= size.z {
        vec2(place.z, place.y)
    } else {
        vec2(place.x, place.y)
    }
}

/// The brightness of wood: streaks along an axis.
fn grain(place: Vec3, axis: usize) -> f32 {
    let mut stretched = place * 42.0;
    stretched[axis] *= 0.05;
    let mut broad = place * 9.0;
    broad[axis] *= 0.12;
    0.84 + 0.2 * noise(stretched) + 0.14 * noise(broad)
}

fn boards(place: Vec3, width: f32) -> f32 {
    let row = (place.x / width).floor();
    let shift = hash(row as i32, 7, 1) * 1.2;
    let length = 1.2;
    let piece = ((place.z + shift) / length).floor();
    let (x, z) = (place.x / width - row, (place.z + shift) / length - piece);
    let joint = x * width < 0.003 || z * length < 0.003;
    let tint = 0.86 + 0.26 * hash(row as i32, piece as i32, 2);
    let shifted = place + Vec3::splat(hash(row as i32, piece as i32, 3) * 9.0);
    if joint {
        0.45
    } else {
        tint * grain(shifted, 2)
    }
}

fn tiles(color: Vec3, across: Vec2, size: f32, joint: Vec3) -> Vec3 {
    let cell = (across / size).floor();
    let inside = (across - cell * size).min((cell + 1.0) * size - across);
    if inside.min_element() < 0.0025 {
        joint
    } else {
        color * (0.97 + 0.06 * hash(cell.x as i32, cell.y as i32, 4))
    }
}

fn rug(color: Vec3, place: Vec3, size: Vec2, border: Vec3) -> Vec3 {
    let edge = (size.x / 2.0 - place.x.abs()).min(size.y / 2.0 - place.z.abs());
    let weave = 0.86 + 0.2 * noise(place * 80.0);
    let line = |from: f32, to: f32| (from..to).contains(&edge);
    if line(0.05, 0.13) || line(0.17, 0.19) {
        border * weave
    } else {
        color * weave
    }
}

/// The colour of a painting: hills for even seeds, discs for odd ones.
fn canvas(place: Vec3, size: Vec2, seed: u32) -> Vec3 {
    let seed = seed as i32;
    let at = vec2(place.x / size.x + 0.5, place.y / size.y);
    let tint = |i: i32| {
        let light = 0.25 + 0.6 * hash(seed, i, 5);
        vec3(
            light * (0.4 + hash(seed, i, 6)),
            light * (0.4 + hash(seed, i, 7)),
            light * (0.4 + hash(seed, i, 8)),
        )
    };
    if seed % 2 == 0 {
        // Hills under a sky
        let mut color = tint(0).lerp(vec3(0.75, 0.82, 0.9), 0.35 + 0.5 * at.y);
        for hill in 1..4 {
            let height = 0.62 - 0.17 * hill as f32
                + 0.2 * noise(vec3(at.x * 3.0, (hill * 17 + seed) as f32, 0.5));
            if at.y < height {
                color = tint(hill);
            }
        }
        color
    } else {
        // Discs on a background
        let mut color = tint(0) * 0.6 + Vec3::splat(0.3);
        for disc in 1..6 {
            let middle = vec2(hash(seed, disc, 9), hash(seed, disc, 10));
            let reach = 0.08 + 0.2 * hash(seed, disc, 11);
            if ((at - middle) * vec2(1.0, size.y / size.x)).length() < reach {
                color = tint(disc);
            }
        }
        color
    }
}

/// The colour of a blurred view of trees under a sky.
fn outdoors(place: Vec3, height: f32) -> Vec3 {
    let up = place.y / height;
    let trees = 0.3 + 0.22 * noise(vec3(place.x * 2.2, 3.0, 7.0)) + 0.06 * noise(place * 9.0);
    let sky = vec3(0.72, 0.84, 1.0).lerp(vec3(0.95, 0.97, 1.0), (1.0 - up).clamp(0.0, 1.0));
    let green = vec3(0.30, 0.42, 0.24) * (0.7 + 0.6 * noise(place * 7.0));
    let blur = ((up - trees) / 0.08).clamp(0.0, 1.0);
    green.lerp(sky, blur)
}

/// A wave from -1 to 1 with a period of 2. It uses no function whose rounding differs between machines.
fn ripple(value: f32) -> f32 {
    let share = value * 0.5 - (value * 0.5).floor();
    let tent = 1.0 - 4.0 * (share - 0.5).abs();
    tent * (1.5 - 0.5 * tent * tent)
}

/// A pseudo-random number from 0 to 1, decided by three whole numbers.
pub(super) fn hash(x: i32, y: i32, z: i32) -> f32 {
    let mut bits = (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    bits ^= bits >> 15;
    (bits >> 8) as f32 / (1_u32 << 24) as f32
}

/// Smooth noise from 0 to 1 (value noise on a lattice of whole numbers).
pub(super) fn noise(place: Vec3) -> f32 {
    let cell = place.floor();
    let share = place - cell;
    let share = share * share * (Vec3::splat(3.0) - 2.0 * share);
    let [x, y, z] = [cell.x as i32, cell.y as i32, cell.z as i32];
    let at = |i: i32, j: i32, k: i32| hash(x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k));
    let mix = |a: f32, b: f32, share: f32| a + (b - a) * share;
    let row = |j: i32, k: i32| mix(at(0, j, k), at(1, j, k), share.x);
    let sheet = |k: i32| mix(row(0, k), row(1, k), share.y);
    mix(sheet(0), sheet(1), share.z)
}
