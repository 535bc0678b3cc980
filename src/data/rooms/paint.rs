//! Paints in colours whose names people agree on: [`Paint`].

use glam::{Vec3, vec3};

use super::seeded_rng::SeededRng;

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
