//! Patterns of surfaces: [`Pattern`] varies a colour with the position in the coordinates of the thing.
//!
//! Details smaller than a pixel fade out, as in a camera. A pattern therefore needs the width of a pixel on the
//! surface.
//!
//! Pseudo-random functions of a position: [`hash`] and [`value_noise`].
//!
//! Paints in colours whose names people agree on: [`Paint`].
//!
//! Surfaces of things: [`Surface`].

use glam::{Vec2, Vec3, vec2, vec3};

use super::seeded_rng::SeededRng;

/// How the colour varies over a surface. Lengths are metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pattern {
    Plain,
    /// Paint with traces of the brush or roller.
    Brushed,
    /// Rough plaster.
    Plaster,
    /// Wood with its grain along an axis (0 x, 1 y, 2 z).
    Grain(usize),
    /// Boards along an axis, of this width.
    Boards(usize, f32),
    /// Tiles of this width and height, with joints of this colour. Every second row is shifted by half a tile if the
    /// tiles are wider than high.
    Tiles([f32; 2], Vec3),
    /// Stones of different sizes, with joints.
    Masonry,
    /// Woven cloth with visible threads and creases.
    Cloth,
    /// The soft pile of towels and carpets.
    Pile,
    /// Stone with darker specks and veins, such as that of counters.
    Stone,
    /// Stripes of this width along y, in a second colour.
    Stripes(f32, Vec3),
    /// Checks of this width, in tones of the colour.
    Checks(f32),
    /// Printed flowers at this spacing, in a second colour.
    Flowers(f32, Vec3),
    /// A painting of this width and height, generated from this seed.
    Painting(Vec2, u32),
    /// A rug of this width and depth, with motifs and a border in a second colour.
    Rug(Vec2, Vec3),
    /// The view through a window of this height, with its sill at y = 0.
    Outdoors(f32),
    /// A dark screen of this width and height.
    Screen(Vec2),
}

/// A point of a surface at which a pattern is evaluated.
#[derive(Debug, Clone, Copy)]
struct PatternPoint {
    position: Vec3,
    /// The two coordinates on the axis plane that is closest to the face.
    uv: Vec2,
    /// Width of a pixel in metres.
    pixel_width: f32,
}

impl PatternPoint {
    /// Smooth noise from −1 to 1 with this many cells per metre. It fades out where a cell is smaller than a pixel.
    fn noise(&self, cells: f32) -> f32 {
        self.noise_at(self.position, Vec3::splat(cells))
    }

    fn noise_at(&self, position: Vec3, cells: Vec3) -> f32 {
        let sharpness = 2.0 - 1.6 * cells.max_element() * self.pixel_width;
        if sharpness <= 0.0 {
            return 0.0;
        }
        (2.0 * value_noise(position * cells) - 1.0) * sharpness.min(1.0)
    }

    /// Visibility of a line of this width, from 0 to 1; 1 if it is at least as wide as a pixel.
    fn line_visibility(&self, width: f32) -> f32 {
        (width / self.pixel_width).min(1.0)
    }

    /// Brightness of wood with streaks along an axis.
    fn grain(&self, position: Vec3, axis: usize) -> f32 {
        let [fine, streaks, broad] = [(190.0, 0.04), (70.0, 0.05), (14.0, 0.1)].map(|(cells, stretch)| {
            let mut cells = Vec3::splat(cells);
            cells[axis] *= stretch;
            self.noise_at(position, cells)
        });
        0.97 + 0.1 * fine + 0.16 * streaks + 0.12 * broad
    }

    /// Brightness of boards along an axis, with joints between them.
    fn boards(&self, axis: usize, width: f32) -> f32 {
        const LENGTH: f32 = 1.2;
        let (side, along) = match axis {
            0 => (self.position.z, self.position.x),
            1 => (self.uv.x, self.position.y),
            _ => (self.position.x, self.position.z),
        };
        let row = (side / width).floor();
        let along = along + hash(row as i32, 7, 1) * LENGTH;
        let piece = (along / LENGTH).floor();
        let (x, z) = (side - row * width, along - piece * LENGTH);
        let tint = 0.76 + 0.44 * hash(row as i32, piece as i32, 2);
        let shift = Vec3::splat(hash(row as i32, piece as i32, 3) * 9.0);
        let wood = tint * self.grain(self.position + shift, axis);
        let joint = x.min(width - x).min(z.min(LENGTH - z)) < 0.003_f32.max(self.pixel_width * 0.5);
        if joint { wood * (1.0 - 0.6 * self.line_visibility(0.006)) } else { wood }
    }

    fn tiles(&self, color: Vec3, [width, height]: [f32; 2], joint: Vec3) -> Vec3 {
        let row = (self.uv.y / height).floor();
        let odd = width > height && row.rem_euclid(2.0) > 0.5;
        let along = self.uv.x + if odd { width / 2.0 } else { 0.0 };
        let column = (along / width).floor();
        let (x, y) = (along - column * width, self.uv.y - row * height);
        let inside = x.min(width - x).min(y.min(height - y));
        let tone = 0.9 + 0.2 * hash(column as i32, row as i32, 4);
        let tile = color * (tone + 0.07 * self.noise(60.0) + 0.05 * self.noise(9.0));
        if inside < 0.003_f32.max(self.pixel_width * 0.5) {
            tile.lerp(joint, self.line_visibility(0.006))
        } else {
            tile
        }
    }

    /// Colour of masonry: the stones are cells of a jittered grid (Worley, SIGGRAPH 1996), with a joint where two are
    /// equally near.
    fn masonry(&self, color: Vec3) -> Vec3 {
        let scaled = self.uv * vec2(3.4, 6.0);
        let cell = scaled.floor();
        let (mut first, mut second, mut own) = (f32::MAX, f32::MAX, 0.0);
        for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
            let [x, y] = [cell.x as i32 + i, cell.y as i32 + j];
            let middle = vec2(x as f32 + hash(x, y, 31), y as f32 + hash(x, y, 32));
            let away = (scaled - middle).abs();
            let distance = away.x.max(away.y) + 0.3 * (away.x + away.y);
            if distance < first {
                (second, first, own) = (first, distance, hash(x, y, 33));
            } else {
                second = second.min(distance);
            }
        }
        let stone = color * (0.62 + 0.5 * own + 0.16 * self.noise(60.0) + 0.14 * self.noise(18.0));
        stone.lerp(color * 1.05, ((0.14 - (second - first)) / 0.05).clamp(0.0, 1.0))
    }

    /// Brightness of woven cloth.
    fn cloth(&self) -> f32 {
        let threads = ripple(self.uv.x * 160.0) * ripple(self.uv.y * 160.0);
        let fold = 1.0 - (self.noise(5.0) + 0.5 * self.noise(11.0)).abs();
        0.93 + 0.05 * threads * (1.0 - 250.0 * self.pixel_width).max(0.0)
            + 0.09 * self.noise(110.0)
            + 0.07 * self.noise(30.0)
            - 0.12 * (fold - 0.6).max(0.0)
    }

    /// Brightness of the pile of a towel or carpet.
    fn pile(&self) -> f32 {
        0.92 + 0.2 * self.noise(150.0) + 0.16 * self.noise(60.0) + 0.08 * self.noise(18.0)
    }

    /// True if the point is on a printed flower. The flowers have five petals and form a grid with every second row
    /// shifted.
    fn is_on_flower(&self, distance: f32) -> bool {
        let row = (self.uv.y / distance).floor();
        let x = self.uv.x / distance + 0.5 * row.rem_euclid(2.0);
        let at = vec2(x - x.floor(), self.uv.y / distance - row) - 0.5;
        let turn = libm::atan2f(at.y, at.x) + hash(row as i32, x.floor() as i32, 41);
        at.length() < 0.24 + 0.1 * ripple(turn * 5.0 / std::f32::consts::PI)
    }

    /// Colour of a rug.
    fn rug(&self, color: Vec3, size: Vec2, border: Vec3) -> Vec3 {
        let edge = (size.x / 2.0 - self.position.x.abs()).min(size.y / 2.0 - self.position.z.abs());
        let motif = edge > 0.22 && (0.3..0.42).contains(&diamond(self.uv * 3.1));
        let small = edge < 0.17 && diamond(self.uv * 12.0) < 0.3 || edge > 0.22 && diamond(self.uv * 9.3) < 0.2;
        let dyed = match () {
            () if (0.03..0.05).contains(&edge) || (0.17..0.2).contains(&edge) || motif => border,
            () if small => color.lerp(border, 0.55),
            () if edge < 0.17 => color * 0.55,
            () => color,
        };
        dyed * self.pile()
    }
}

impl Pattern {
    /// Applies the pattern to a colour at a position with a surface normal, both in the coordinates of the thing.
    /// `pixel_width` is the width of a pixel there, in metres.
    pub(super) fn color(self, color: Vec3, position: Vec3, normal: Vec3, pixel_width: f32) -> Vec3 {
        let point = PatternPoint { position, uv: project_to_axis_plane(position, normal), pixel_width };
        match self {
            Self::Plain => color,
            Self::Brushed => color * (1.0 + 0.07 * point.noise(90.0) + 0.06 * point.noise(30.0)),
            Self::Plaster => {
                let fine = 0.11 * point.noise(140.0) + 0.12 * point.noise(52.0);
                color * (1.0 + fine + 0.04 * point.noise(6.0) + 0.04 * point.noise(1.3))
            }
            Self::Grain(axis) => color * point.grain(position, axis),
            Self::Boards(axis, width) => color * point.boards(axis, width),
            Self::Tiles(size, joint) => point.tiles(color, size, joint),
            Self::Masonry => point.masonry(color),
            Self::Cloth => color * point.cloth(),
            Self::Pile => color * point.pile(),
            Self::Stone => {
                let vein = (0.05 - point.noise(4.0).abs()).max(0.0) * 6.0;
                let speck = point.noise(120.0).max(0.0) + point.noise(60.0).max(0.0);
                color * (1.0 - 0.28 * speck - vein * 0.5 + 0.06 * point.noise(11.0))
            }
            Self::Stripes(width, other) => {
                let odd = (point.uv.x / width).floor().rem_euclid(2.0) > 0.5;
                (if odd { other } else { color }) * point.cloth()
            }
            Self::Checks(width) => {
                let dark = (point.uv / width).floor().rem_euclid(Vec2::splat(2.0));
                let thin = (point.uv / width * 2.0 + 0.06).rem_euclid(Vec2::splat(2.0));
                let line = if thin.min_element() < 0.14 { 1.18 } else { 1.0 };
                color * ((0.82 + 0.15 * (dark.x + dark.y)) * line) * point.cloth()
            }
            Self::Flowers(distance, other) => {
                let is_printed = point.is_on_flower(distance);
                (if is_printed { other } else { color }) * point.cloth()
            }
            Self::Painting(size, seed) => painting(position, size, seed),
            Self::Rug(size, border) => point.rug(color, size, border),
            Self::Outdoors(height) => outdoor_view(position, height),
            Self::Screen(size) => {
                let share = (position.x / size.x + position.y / size.y) * 0.5;
                color * (1.0 + 0.8 * (share - share.floor()))
            }
        }
    }
}

/// The two coordinates of a point on the axis plane that is closest to the face.
fn project_to_axis_plane(position: Vec3, normal: Vec3) -> Vec2 {
    let size = normal.abs();
    if size.y >= size.x && size.y >= size.z {
        vec2(position.x, position.z)
    } else if size.x >= size.z {
        vec2(position.z, position.y)
    } else {
        vec2(position.x, position.y)
    }
}

/// Distance to the middle of a cell of size 1, along its sides.
fn diamond(at: Vec2) -> f32 {
    let at = (at - at.floor() - 0.5).abs();
    at.x + at.y
}

/// Colour of part `i` of a painting.
fn tint(seed: i32, i: i32) -> Vec3 {
    let light = 0.12 + 0.6 * hash(seed, i, 5);
    Vec3::from([6, 7, 8].map(|channel| light * (0.3 + 1.1 * hash(seed, i, channel))))
}

/// Colour of a painting of hills, discs or rectangles, depending on its seed.
fn painting(position: Vec3, size: Vec2, seed: u32) -> Vec3 {
    let seed = seed as i32;
    let at = vec2(position.x / size.x + 0.5, position.y / size.y);
    let strokes = 0.75 + 0.5 * value_noise(position * vec3(60.0, 140.0, 1.0));
    // Three of seven paintings have a paper margin.
    let margin = at.min(1.0 - at) * size;
    if seed % 7 < 3 && margin.min_element() < 0.06 {
        return vec3(0.66, 0.64, 0.58);
    }
    let mut color = tint(seed, 0) * (0.7 + 0.6 * at.y);
    match seed % 3 {
        0 => {
            color = color.lerp(vec3(0.6, 0.68, 0.8), 0.3 + 0.5 * at.y);
            for hill in 1..6 {
                let wave = value_noise(vec3(at.x * 4.0, (hill * 17 + seed) as f32, 0.5));
                if at.y < 0.78 - 0.14 * hill as f32 + 0.22 * wave {
                    color = tint(seed, hill);
                }
            }
        }
        1 => {
            for disc in 1..11 {
                let middle = vec2(hash(seed, disc, 9), hash(seed, disc, 10));
                let reach = 0.05 + 0.16 * hash(seed, disc, 11);
                let away = ((at - middle) * vec2(1.0, size.y / size.x)).length();
                if away < reach && !(0.6..0.7).contains(&(away / reach)) {
                    color = tint(seed, disc);
                }
            }
        }
        _ => {
            for rectangle in 1..9 {
                let [x, y, to_x, to_y] = [9, 10, 11, 12].map(|which| hash(seed, rectangle, which));
                let low = vec2(x.min(to_x), y.min(to_y));
                if at.cmpge(low).all() && at.cmple(vec2(x.max(to_x), y.max(to_y))).all() {
                    color = tint(seed, rectangle);
                }
            }
        }
    }
    color * strokes
}

/// Colour of the view through a window: trees under a sky.
fn outdoor_view(position: Vec3, height: f32) -> Vec3 {
    let up = position.y / height;
    let trees = 0.34 + 0.3 * value_noise(vec3(position.x * 2.2, 3.0, 7.0)) + 0.12 * value_noise(position * 9.0);
    let sky = vec3(0.72, 0.84, 1.0).lerp(vec3(0.95, 0.97, 1.0), (1.0 - up).clamp(0.0, 1.0));
    let leaves = 0.4 + 0.7 * value_noise(position * 9.0) + 0.5 * value_noise(position * 34.0);
    let green = vec3(0.22, 0.33, 0.16) * leaves;
    let blur = ((up - trees) / 0.05).clamp(0.0, 1.0);
    green.lerp(sky, blur)
}

/// Wave from −1 to 1 with a period of 2. It uses no function whose rounding differs between machines.
fn ripple(value: f32) -> f32 {
    let share = value * 0.5 - (value * 0.5).floor();
    let tent = 1.0 - 4.0 * (share - 0.5).abs();
    tent * (1.5 - 0.5 * tent * tent)
}

/// Maps three integers to a pseudo-random number from 0 to 1.
pub(super) fn hash(x: i32, y: i32, z: i32) -> f32 {
    let mut bits = (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    bits ^= bits >> 15;
    (bits >> 8) as f32 / (1_u32 << 24) as f32
}

/// Value noise from 0 to 1: random values at integer lattice points, interpolated smoothly.
fn value_noise(position: Vec3) -> f32 {
    let cell = position.floor();
    let share = position - cell;
    let share = share * share * (Vec3::splat(3.0) - 2.0 * share);
    let [x, y, z] = [cell.x as i32, cell.y as i32, cell.z as i32];
    let sheets = [0, 1].map(|k| {
        let rows = [0, 1].map(|j| {
            let corners = [0, 1].map(|i| hash(x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k)));
            mix(corners, share.x)
        });
        mix(rows, share.y)
    });
    mix(sheets, share.z)
}

/// Interpolates linearly between two values.
fn mix([a, b]: [f32; 2], share: f32) -> f32 {
    a + (b - a) * share
}

/// Colour and its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Paint {
    /// One of the eleven basic colour terms; empty if people would disagree.
    pub(super) name: &'static str,
    /// Linear light of red, green and blue.
    pub(super) color: Vec3,
}

/// sRGB codes of the paints of each name. The colours are strong, so that shade does not change their name.
const PAINTS: [(&str, &[[u8; 3]]); 11] = [
    ("black", &[[24, 24, 26], [30, 28, 28]]),
    ("grey", &[[108, 108, 112], [116, 118, 118], [122, 120, 116]]),
    ("white", &[[250, 250, 248], [248, 249, 250]]),
    ("red", &[[176, 32, 36], [150, 26, 36], [166, 42, 40]]),
    ("orange", &[[255, 156, 60], [255, 152, 54]]),
    ("yellow", &[[250, 218, 84], [248, 214, 92]]),
    ("green", &[[84, 126, 78], [120, 140, 92], [58, 100, 72]]),
    ("blue", &[[60, 92, 150], [92, 122, 168], [52, 72, 122]]),
    ("purple", &[[116, 74, 142], [104, 66, 128], [128, 92, 150]]),
    ("pink", &[[255, 182, 206], [252, 176, 198]]),
    ("brown", &[[120, 80, 52], [110, 72, 46], [128, 88, 58]]),
];

/// Linear light of one sRGB code (IEC 61966-2-1).
fn linear(code: u8) -> f32 {
    let value = f32::from(code) / 255.0;
    if value <= 0.04045 { value / 12.92 } else { libm::powf((value + 0.055) / 1.055, 2.4) }
}

/// sRGB codes of a number in the form `0xrrggbb`.
pub(super) fn codes_from_hex(number: u32) -> [u8; 3] {
    [16, 8, 0].map(|shift| (number >> shift) as u8)
}

/// Linear light of three sRGB codes.
pub(super) fn linear_rgb([red, green, blue]: [u8; 3]) -> Vec3 {
    vec3(linear(red), linear(green), linear(blue))
}

impl Paint {
    /// Returns a random paint with one of these names.
    pub(super) fn random(names: &[&str], rng: &mut SeededRng) -> Self {
        let name = rng.pick(names);
        let (name, codes) = PAINTS.iter().find(|(known, _)| *known == name).map_or(PAINTS[0], |found| *found);
        Self { name, color: linear_rgb(rng.pick(codes)) }
    }

    /// Creates a paint whose colour has no name that people agree on.
    pub(super) fn nameless(codes: [u8; 3]) -> Self {
        Self { name: "", color: linear_rgb(codes) }
    }
}

/// Colour names for furniture and textiles. A name that is listed twice is twice as likely.
pub(super) const COMMON_COLORS: [&str; 16] = [
    "black", "grey", "grey", "white", "white", "red", "red", "orange", "yellow", "green", "green", "blue", "blue",
    "purple", "pink", "brown",
];

/// The eleven basic colour terms.
pub(super) const ALL_COLORS: [&str; 11] =
    ["black", "grey", "white", "red", "orange", "yellow", "green", "blue", "purple", "pink", "brown"];

/// The material of a face.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Surface {
    /// Share of linear light that the surface reflects, by channel, before the pattern is applied.
    pub(super) color: Vec3,
    pub(super) pattern: Pattern,
    pub(super) finish: SurfaceFinish,
}

/// How a surface reflects light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SurfaceFinish {
    /// Reflects the same light in all directions.
    Matte,
    /// Matte with a highlight.
    Glossy,
    /// Mirrors the room.
    Mirror,
    /// Emits light, this many times as bright as its colour. Casts no shadow.
    Glow(f32),
}

impl Surface {
    fn new(color: Vec3, pattern: Pattern, finish: SurfaceFinish) -> Self {
        Self { color, pattern, finish }
    }

    /// Matte paint of one colour.
    pub(super) fn paint(paint: Paint) -> Self {
        Self::new(paint.color, Pattern::Brushed, SurfaceFinish::Matte)
    }

    /// Lacquer, ceramic or plastic.
    pub(super) fn gloss(paint: Paint) -> Self {
        Self::new(paint.color, Pattern::Plain, SurfaceFinish::Glossy)
    }

    /// Matte cloth of one colour.
    pub(super) fn cloth(paint: Paint) -> Self {
        Self::new(paint.color, Pattern::Cloth, SurfaceFinish::Matte)
    }

    /// Cloth of one colour, often woven or printed in two tones.
    pub(super) fn fabric(paint: Paint, rng: &mut SeededRng) -> Self {
        let cloth = Self::cloth(paint);
        // Two tones of a light colour may have two names.
        if ["white", "yellow", "orange", "pink"].contains(&paint.name) {
            return cloth;
        }
        let darker = paint.color * 0.66;
        match rng.below(6) {
            0 => cloth.with_pattern(Pattern::Checks(rng.between(0.05, 0.16))),
            1 | 2 => cloth.with_pattern(Pattern::Flowers(rng.between(0.08, 0.26), darker)),
            3 => cloth.with_pattern(Pattern::Stripes(rng.between(0.02, 0.08), darker)),
            _ => cloth,
        }
    }

    /// Matte colour, given by its sRGB codes.
    pub(super) fn plain(codes: [u8; 3]) -> Self {
        Self::new(linear_rgb(codes), Pattern::Plain, SurfaceFinish::Matte)
    }

    /// Glossy grey metal.
    pub(super) fn steel() -> Self {
        let steel = linear_rgb([164, 166, 170]);
        Self::new(steel, Pattern::Plain, SurfaceFinish::Glossy)
    }

    /// Wood in the colour of a paint, with its grain along an axis (0 x, 1 y, 2 z).
    pub(super) fn wood(paint: Paint, axis: usize) -> Self {
        Self::new(paint.color, Pattern::Grain(axis), SurfaceFinish::Matte)
    }

    /// Colour at a point with a surface normal, both in the coordinates of the thing. `pixel_width` is the width of a
    /// pixel there, in metres.
    pub(super) fn color_at(&self, point: Vec3, normal: Vec3, pixel_width: f32) -> Vec3 {
        self.pattern.color(self.color, point, normal, pixel_width)
    }

    pub(super) fn with_pattern(&self, pattern: Pattern) -> Self {
        Self { pattern, ..self.clone() }
    }

    pub(super) fn with_finish(&self, finish: SurfaceFinish) -> Self {
        Self { finish, ..self.clone() }
    }
}
