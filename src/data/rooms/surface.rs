//! Surfaces of things: [`Surface`].

use glam::Vec3;

use super::paint::{Paint, linear_rgb};
use super::pattern::Pattern;
use super::seeded_rng::SeededRng;

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
