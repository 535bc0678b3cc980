//! Surfaces of things: [`Surface`].

use glam::Vec3;

use super::dice::Dice;
use super::paint::{Paint, rgb};
use super::pattern::Pattern;

/// The material of a face.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Surface {
    /// The share of linear light that the surface reflects, by channel, before the pattern changes it.
    pub(super) color: Vec3,
    pub(super) pattern: Pattern,
    pub(super) finish: SurfaceFinish,
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

    /// Cloth of one colour, often woven or printed in two tones of it.
    pub(super) fn fabric(paint: Paint, dice: &mut Dice) -> Self {
        let cloth = Self::cloth(paint);
        // Two tones of a light colour may have two names.
        if ["white", "yellow", "orange", "pink"].contains(&paint.name) {
            return cloth;
        }
        let darker = paint.color * 0.66;
        match dice.below(6) {
            0 => cloth.with(Pattern::Checks(dice.between(0.05, 0.16))),
            1 | 2 => cloth.with(Pattern::Print(dice.between(0.08, 0.26), darker)),
            3 => cloth.with(Pattern::Stripes(dice.between(0.02, 0.08), darker)),
            _ => cloth,
        }
    }

    /// A matte colour by its sRGB codes.
    pub(super) fn plain(codes: [u8; 3]) -> Self {
        Self::new(rgb(codes), Pattern::Plain, SurfaceFinish::Matte)
    }

    /// Glossy grey metal, as steel.
    pub(super) fn steel() -> Self {
        let steel = rgb([164, 166, 170]);
        Self::new(steel, Pattern::Plain, SurfaceFinish::Glossy)
    }

    /// Wood with its grain along an axis, in the colour of a paint.
    pub(super) fn wood(paint: Paint, axis: usize) -> Self {
        Self::new(paint.color, Pattern::Grain(axis), SurfaceFinish::Matte)
    }

    /// The colour at a point with a surface normal, both in the coordinates of the thing. `pixel` is the width of a pixel there,
    /// in metres.
    pub(super) fn color_at(&self, place: Vec3, normal: Vec3, pixel: f32) -> Vec3 {
        self.pattern.color(self.color, place, normal, pixel)
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
}
