//! Patterns of surfaces: [`Pattern`], the way in which a colour varies with the point in the coordinates of the thing.
//!
//! Details that are smaller than a pixel fade out, as they do in a camera. So a pattern is given the width of a pixel on the
//! surface.

use glam::{Vec2, Vec3, vec2, vec3};

use super::noise::{hash, noise};

/// The way in which the colour varies over a surface. Lengths are metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pattern {
    Plain,
    /// Paint with the traces of its brush or roller.
    Brushed,
    /// Rough plaster.
    Plaster,
    /// Wood with its grain along an axis (0 x, 1 y, 2 z).
    Grain(usize),
    /// Boards along an axis, of this width.
    Boards(usize, f32),
    /// Tiles of this width and height, each row shifted by half a tile if they are no squares, with joints of this colour.
    Tiles([f32; 2], Vec3),
    /// Stones of different sizes, with joints.
    Masonry,
    /// Woven cloth with visible threads and creases.
    Cloth,
    /// The soft pile of towels and carpets.
    Pile,
    /// Stone with darker specks and veins, as of counters.
    Stone,
    /// Stripes along y of this width, in a second colour.
    Stripes(f32, Vec3),
    /// Checks of this width, in tones of the colour.
    Checks(f32),
    /// Printed flowers with this distance, in a second colour.
    Print(f32, Vec3),
    /// A painting on a canvas of this width and height, drawn from this seed.
    Canvas(Vec2, u32),
    /// A rug of this width and depth, with motifs and a border of a second colour.
    Rug(Vec2, Vec3),
    /// The view out of a window of this height, with its sill at y = 0.
    Outdoors(f32),
    /// The dark face of a screen of this width and height.
    Screen(Vec2),
}

/// A point of a surface at which a pattern is looked at.
#[derive(Debug, Clone, Copy)]
struct PatternPoint {
    place: Vec3,
    /// The two coordinates on the axis plane that is closest to the face.
    across: Vec2,
    /// The width of a pixel in metres.
    pixel: f32,
}

impl PatternPoint {
    /// Smooth noise from −1 to 1 with this many cells per metre. It fades out where a cell is smaller than a pixel.
    fn rough(&self, cells: f32) -> f32 {
        self.rough_at(self.place, Vec3::splat(cells))
    }

    fn rough_at(&self, place: Vec3, cells: Vec3) -> f32 {
        let sharp = 2.0 - 1.6 * cells.max_element() * self.pixel;
        if sharp <= 0.0 {
            return 0.0;
        }
        (2.0 * noise(place * cells) - 1.0) * sharp.min(1.0)
    }

    /// How much of a line of this width is seen: 1 if it is as wide as a pixel.
    fn line(&self, width: f32) -> f32 {
        (width / self.pixel).min(1.0)
    }

    /// The brightness of wood: streaks along an axis.
    fn grain(&self, place: Vec3, axis: usize) -> f32 {
        let along = |cells: f32, share: f32| {
            let mut cells = Vec3::splat(cells);
            cells[axis] *= share;
            cells
        };
        let fine = self.rough_at(place, along(190.0, 0.04));
        let streaks = self.rough_at(place, along(70.0, 0.05));
        let broad = self.rough_at(place, along(14.0, 0.1));
        0.97 + 0.1 * fine + 0.16 * streaks + 0.12 * broad
    }

    fn boards(&self, axis: usize, width: f32) -> f32 {
        const LENGTH: f32 = 1.2;
        let (side, along) = match axis {
            0 => (self.place.z, self.place.x),
            1 => (self.across.x, self.place.y),
            _ => (self.place.x, self.place.z),
        };
        let row = (side / width).floor();
        let along = along + hash(row as i32, 7, 1) * LENGTH;
        let piece = (along / LENGTH).floor();
        let (x, z) = (side - row * width, along - piece * LENGTH);
        let tint = 0.76 + 0.44 * hash(row as i32, piece as i32, 2);
        let shift = Vec3::splat(hash(row as i32, piece as i32, 3) * 9.0);
        let wood = tint * self.grain(self.place + shift, axis);
        let joint = x.min(width - x).min(z.min(LENGTH - z)) < 0.003_f32.max(self.pixel * 0.5);
        if joint {
            wood * (1.0 - 0.6 * self.line(0.006))
        } else {
            wood
        }
    }

    fn tiles(&self, color: Vec3, [width, height]: [f32; 2], joint: Vec3) -> Vec3 {
        let row = (self.across.y / height).floor();
        let odd = width > height && row.rem_euclid(2.0) > 0.5;
        let along = self.across.x + if odd { width / 2.0 } else { 0.0 };
        let column = (along / width).floor();
        let (x, y) = (along - column * width, self.across.y - row * height);
        let inside = x.min(width - x).min(y.min(height - y));
        let tone = 0.9 + 0.2 * hash(column as i32, row as i32, 4);
        let tile = color * (tone + 0.07 * self.rough(60.0) + 0.05 * self.rough(9.0));
        if inside < 0.003_f32.max(self.pixel * 0.5) {
            tile.lerp(joint, self.line(0.006))
        } else {
            tile
        }
    }

    /// Stones: the cells of a jittered grid (Worley, SIGGRAPH 1996), with a joint where two are equally near.
    fn masonry(&self, color: Vec3) -> Vec3 {
        let scaled = self.across * vec2(3.4, 6.0);
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
        let stone = color * (0.62 + 0.5 * own + 0.16 * self.rough(60.0) + 0.14 * self.rough(18.0));
        stone.lerp(
            color * 1.05,
            ((0.14 - (second - first)) / 0.05).clamp(0.0, 1.0),
        )
    }

    fn cloth(&self) -> f32 {
        let threads = ripple(self.across.x * 160.0) * ripple(self.across.y * 160.0);
        let fold = 1.0 - (self.rough(5.0) + 0.5 * self.rough(11.0)).abs();
        0.93 + 0.05 * threads * (1.0 - 250.0 * self.pixel).max(0.0)
            + 0.09 * self.rough(110.0)
            + 0.07 * self.rough(30.0)
            - 0.12 * (fold - 0.6).max(0.0)
    }

    fn pile(&self) -> f32 {
        0.92 + 0.2 * self.rough(150.0) + 0.16 * self.rough(60.0) + 0.08 * self.rough(18.0)
    }

    /// Flowers in a grid, every second row shifted: five leaves around a middle.
    fn print(&self, distance: f32) -> bool {
        let row = (self.across.y / distance).floor();
        let x = self.across.x / distance + 0.5 * row.rem_euclid(2.0);
        let at = vec2(x - x.floor(), self.across.y / distance - row) - 0.5;
        let turn = libm::atan2f(at.y, at.x) + hash(row as i32, x.floor() as i32, 41);
        at.length() < 0.24 + 0.1 * ripple(turn * 5.0 / std::f32::consts::PI)
    }

    fn rug(&self, color: Vec3, size: Vec2, border: Vec3) -> Vec3 {
        let edge = (size.x / 2.0 - self.place.x.abs()).min(size.y / 2.0 - self.place.z.abs());
        let line = |from: f32, to: f32| (from..to).contains(&edge);
        let diamond = |cells: f32| {
            let at = self.across * cells;
            let at = (at - at.floor() - 0.5).abs();
            at.x + at.y
        };
        let motif = edge > 0.22 && (0.3..0.42).contains(&diamond(3.1));
        let small = edge < 0.17 && diamond(12.0) < 0.3 || edge > 0.22 && diamond(9.3) < 0.2;
        let dyed = match () {
            () if line(0.03, 0.05) || line(0.17, 0.2) || motif => border,
            () if small => color.lerp(border, 0.55),
            () if edge < 0.17 => color * 0.55,
            () => color,
        };
        dyed * self.pile()
    }
}

impl Pattern {
    /// Applies the pattern to a colour at a point with a surface normal, both in the coordinates of the object. `pixel` is the width of a
    /// pixel there, in metres.
    pub(super) fn color(self, color: Vec3, place: Vec3, normal: Vec3, pixel: f32) -> Vec3 {
        let point = PatternPoint {
            place,
            across: flat(place, normal),
            pixel,
        };
        match self {
            Self::Plain => color,
            Self::Brushed => color * (1.0 + 0.07 * point.rough(90.0) + 0.06 * point.rough(30.0)),
            Self::Plaster => {
                let fine = 0.11 * point.rough(140.0) + 0.12 * point.rough(52.0);
                color * (1.0 + fine + 0.04 * point.rough(6.0) + 0.04 * point.rough(1.3))
            }
            Self::Grain(axis) => color * point.grain(place, axis),
            Self::Boards(axis, width) => color * point.boards(axis, width),
            Self::Tiles(size, joint) => point.tiles(color, size, joint),
            Self::Masonry => point.masonry(color),
            Self::Cloth => color * point.cloth(),
            Self::Pile => color * point.pile(),
            Self::Stone => {
                let vein = (0.05 - point.rough(4.0).abs()).max(0.0) * 6.0;
                let speck = point.rough(120.0).max(0.0) + point.rough(60.0).max(0.0);
                color * (1.0 - 0.28 * speck - vein * 0.5 + 0.06 * point.rough(11.0))
            }
            Self::Stripes(width, other) => {
                let odd = (point.across.x / width).floor().rem_euclid(2.0) > 0.5;
                (if odd { other } else { color }) * point.cloth()
            }
            Self::Checks(width) => {
                let dark = (point.across / width).floor().rem_euclid(Vec2::splat(2.0));
                let thin = (point.across / width * 2.0 + 0.06).rem_euclid(Vec2::splat(2.0));
                let line = if thin.min_element() < 0.14 { 1.18 } else { 1.0 };
                color * ((0.82 + 0.15 * (dark.x + dark.y)) * line) * point.cloth()
            }
            Self::Print(distance, other) => {
                let printed = point.print(distance);
                (if printed { other } else { color }) * point.cloth()
            }
            Self::Canvas(size, seed) => canvas(place, size, seed),
            Self::Rug(size, border) => point.rug(color, size, border),
            Self::Outdoors(height) => outdoors(place, height),
            Self::Screen(size) => {
                let share = (place.x / size.x + place.y / size.y) * 0.5;
                color * (1.0 + 0.8 * (share - share.floor()))
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

/// The colour of a painting: hills, discs or fields by its seed.
fn canvas(place: Vec3, size: Vec2, seed: u32) -> Vec3 {
    let seed = seed as i32;
    let at = vec2(place.x / size.x + 0.5, place.y / size.y);
    let tint = |i: i32| {
        let light = 0.12 + 0.6 * hash(seed, i, 5);
        let dyed = |which| light * (0.3 + 1.1 * hash(seed, i, which));
        vec3(dyed(6), dyed(7), dyed(8))
    };
    let strokes = 0.75 + 0.5 * noise(place * vec3(60.0, 140.0, 1.0));
    // A third of all pictures has a margin of paper.
    let margin = at.min(1.0 - at) * size;
    if seed % 7 < 3 && margin.min_element() < 0.06 {
        return vec3(0.66, 0.64, 0.58);
    }
    let mut color = tint(0) * (0.7 + 0.6 * at.y);
    match seed % 3 {
        0 => {
            color = color.lerp(vec3(0.6, 0.68, 0.8), 0.3 + 0.5 * at.y);
            for hill in 1..6 {
                let wave = noise(vec3(at.x * 4.0, (hill * 17 + seed) as f32, 0.5));
                if at.y < 0.78 - 0.14 * hill as f32 + 0.22 * wave {
                    color = tint(hill);
                }
            }
        }
        1 => {
            for disc in 1..11 {
                let middle = vec2(hash(seed, disc, 9), hash(seed, disc, 10));
                let reach = 0.05 + 0.16 * hash(seed, disc, 11);
                let away = ((at - middle) * vec2(1.0, size.y / size.x)).length();
                if away < reach && !(0.6..0.7).contains(&(away / reach)) {
                    color = tint(disc);
                }
            }
        }
        _ => {
            for field in 1..9 {
                let [x, y, to_x, to_y] = [9, 10, 11, 12].map(|which| hash(seed, field, which));
                let low = vec2(x.min(to_x), y.min(to_y));
                if at.cmpge(low).all() && at.cmple(vec2(x.max(to_x), y.max(to_y))).all() {
                    color = tint(field);
                }
            }
        }
    }
    color * strokes
}

/// The colour of the view out of a window: trees and a house under a sky.
fn outdoors(place: Vec3, height: f32) -> Vec3 {
    let up = place.y / height;
    let trees = 0.34 + 0.3 * noise(vec3(place.x * 2.2, 3.0, 7.0)) + 0.12 * noise(place * 9.0);
    let sky = vec3(0.72, 0.84, 1.0).lerp(vec3(0.95, 0.97, 1.0), (1.0 - up).clamp(0.0, 1.0));
    let leaves = 0.4 + 0.7 * noise(place * 9.0) + 0.5 * noise(place * 34.0);
    let green = vec3(0.22, 0.33, 0.16) * leaves;
    let blur = ((up - trees) / 0.05).clamp(0.0, 1.0);
    green.lerp(sky, blur)
}

/// A wave from -1 to 1 with a period of 2. It uses no function whose rounding differs between machines.
fn ripple(value: f32) -> f32 {
    let share = value * 0.5 - (value * 0.5).floor();
    let tent = 1.0 - 4.0 * (share - 0.5).abs();
    tent * (1.5 - 0.5 * tent * tent)
}
