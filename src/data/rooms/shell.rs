//! Surfaces of floor and walls, and doorways: [`Shell`].

use std::f32::consts::{FRAC_PI_2, PI};

use super::paint::{codes_from_hex, linear_rgb};
use super::pattern::Pattern;
use super::seeded_rng::SeededRng;
use super::surface::Surface;

/// A wall of the room; the north wall is at z = 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wall {
    North,
    East,
    South,
    West,
}

pub(super) const WALLS: [Wall; 4] = [Wall::North, Wall::East, Wall::South, Wall::West];

impl Wall {
    /// Rotation in radians of a piece with its back to the wall.
    pub(super) fn angle(self) -> f32 {
        match self {
            Self::North => 0.0,
            Self::East => -FRAC_PI_2,
            Self::South => PI,
            Self::West => FRAC_PI_2,
        }
    }

    pub(super) fn opposite(self) -> Self {
        match self {
            Self::North => Self::South,
            Self::East => Self::West,
            Self::South => Self::North,
            Self::West => Self::East,
        }
    }

    /// The two adjacent walls.
    pub(super) fn neighbours(self) -> [Self; 2] {
        match self {
            Self::North | Self::South => [Self::East, Self::West],
            Self::East | Self::West => [Self::North, Self::South],
        }
    }
}

/// Kind of floor covering.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flooring {
    Wood,
    Tiles,
    Carpet,
}

/// Thickness of walls in metres.
pub(super) const WALL_THICKNESS: f32 = 0.1;

/// A doorway in a wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Doorway {
    pub(super) wall: Wall,
    /// Left and right edge in metres along the wall.
    pub(super) along: [f32; 2],
    /// Height in metres.
    pub(super) top: f32,
}

/// Surfaces of the walls, and the doorways in them.
#[derive(Debug)]
pub(super) struct Shell {
    pub(super) walls: [Surface; 4],
    /// Covering of the lower part of all walls, with its height in metres; `None` for a uniform wall.
    pub(super) lower: Option<(Surface, f32)>,
    pub(super) skirting: Surface,
    pub(super) doorways: Vec<Doorway>,
}

/// sRGB codes of paints for walls.
const WALL_PAINTS: [u32; 14] = [
    0xcec6b8, 0xc2b8a8, 0xb8bcb6, 0xbaa892, 0x96a298, 0x9eaab8, 0xccba9c, 0x88949e, 0xb88e76, 0xd2ccc0, 0x8a9078,
    0xb0a0a4, 0x787e86, 0xc4b080,
];

/// sRGB codes of floors: boards, tiles and carpets.
const BOARDS: [u32; 6] = [0x9e7046, 0x765032, 0xb08a60, 0x84705c, 0x5c3e2a, 0x92623e];
const TILES: [u32; 6] = [0xb0aaa0, 0x808082, 0xa89680, 0x606266, 0x967058, 0xbab0a0];
const CARPETS: [u32; 6] = [0x9c9080, 0x6e707a, 0x8a7a6c, 0x565c68, 0x7e5c54, 0x687060];

impl Shell {
    /// Chooses random surfaces. If `tiled`, the lower 1.3 to 2.1 m of the walls are tiled.
    pub(super) fn new(tiled: bool, rng: &mut SeededRng) -> Self {
        let tint = linear_rgb(codes_from_hex(rng.pick(&WALL_PAINTS)));
        let base = Surface::plain([0; 3]).with_pattern(Pattern::Plaster);
        let plaster = Surface { color: tint, ..base.clone() };
        let other = tint * rng.between(0.66, 0.84);
        let paper = match rng.below(9) {
            0 => Pattern::Stripes(rng.between(0.04, 0.12), other),
            1 | 2 => Pattern::Flowers(rng.between(0.1, 0.26), other),
            3 => Pattern::Checks(rng.between(0.05, 0.12)),
            4 => Pattern::Masonry,
            _ => Pattern::Plaster,
        };
        let mut walls = [(); 4].map(|()| plaster.with_pattern(paper));
        // One wall may differ from the others.
        let accent = rng.pick(&[[140, 92, 74], [150, 138, 120], [104, 84, 66], [76, 88, 96]]);
        let stone = match rng.below(8) {
            0 => Some(Pattern::Tiles([0.24, 0.08], linear_rgb([176, 170, 160]))),
            1 => Some(Pattern::Masonry),
            2 => Some(Pattern::Boards(1, 0.14)),
            3 => Some(Pattern::Plaster),
            _ => None,
        };
        if let Some(stone) = stone {
            walls[rng.below(4)] = Surface::plain(accent).with_pattern(stone);
        }
        let glaze = rng.pick(&[[182, 194, 196], [150, 172, 168], [192, 184, 168], [140, 152, 168]]);
        let side = rng.pick(&[[0.2, 0.2], [0.15, 0.15], [0.3, 0.1], [0.25, 0.4]]);
        let wood = rng.pick(&[[110, 78, 54], [168, 160, 144], [88, 98, 96]]);
        let lower = if tiled {
            let tiles = Pattern::Tiles(side, linear_rgb([208, 204, 196]));
            Some((Surface::plain(glaze).with_pattern(tiles), rng.between(1.3, 2.1)))
        } else {
            let panels = Surface::plain(wood).with_pattern(Pattern::Boards(1, 0.1));
            rng.chance(0.15).then_some((panels, 0.9))
        };
        Self {
            walls,
            lower,
            skirting: Surface::plain(rng.pick(&[[188, 184, 174], [96, 66, 44], [150, 146, 138]])),
            doorways: Vec::new(),
        }
    }
}

/// Chooses a random surface for a floor.
pub(super) fn floor_surface(flooring: Flooring, rng: &mut SeededRng) -> Surface {
    match flooring {
        Flooring::Wood => {
            let width = rng.between(0.07, 0.16);
            let axis = rng.pick(&[0, 2]);
            Surface::plain(codes_from_hex(rng.pick(&BOARDS))).with_pattern(Pattern::Boards(axis, width))
        }
        Flooring::Tiles => {
            let side = rng.between(0.15, 0.4);
            let joint = linear_rgb(rng.pick(&[[110, 106, 100], [198, 194, 186]]));
            Surface::plain(codes_from_hex(rng.pick(&TILES))).with_pattern(Pattern::Tiles([side, side], joint))
        }
        Flooring::Carpet => {
            let surface = Surface::plain(codes_from_hex(rng.pick(&CARPETS)));
            match rng.below(3) {
                0 => {
                    let other = surface.color * rng.between(0.6, 0.8);
                    surface.with_pattern(Pattern::Flowers(rng.between(0.1, 0.3), other))
                }
                _ => surface.with_pattern(Pattern::Pile),
            }
        }
    }
}
