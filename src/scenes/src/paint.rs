//! Paints in colours that people agree on: [`Paint`].

use glam::{Vec3, vec3};

use super::dice::Dice;

/// A colour and its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Paint {
    /// One of the eleven basic colour terms; empty if people would disagree.
    pub(super) name: &'static str,
    /// The colour in linear light, red, green and blue.
    pub(super) color: Vec3,
}

/// The sRGB codes of the paints of each name. The colours are strong, so that shade does not change their name.
const NAMED: [(&str, &[[u8; 3]]); 11] = [
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

/// The linear light of one sRGB code (IEC 61966-2-1).
pub(super) fn linear(code: u8) -> f32 {
    let value = f32::from(code) / 255.0;
    if value <= 0.04045 {
        value / 12.92
    } else {
        libm::powf((value + 0.055) / 1.055, 2.4)
    }
}

/// The three sRGB codes of a number in the form `0xrrggbb`.
pub(super) fn codes(number: u32) -> [u8; 3] {
    [16, 8, 0].map(|shift| (number >> shift) as u8)
}

/// The linear light of three sRGB codes.
pub(super) fn rgb([red, green, blue]: [u8; 3]) -> Vec3 {
    vec3(linear(red), linear(green), linear(blue))
}

impl Paint {
    /// A random paint with one of these names.
    pub(super) fn random(names: &[&str], dice: &mut Dice) -> Self {
        let name = dice.pick(names);
        let (name, codes) = NAMED
            .iter()
            .find(|(known, _)| *known == name)
            .map_or(NAMED[0], |found| *found);
        Self {
            name,
            color: rgb(dice.pick(codes)),
        }
    }

    /// A colour without a name that people agree on.
    pub(super) fn nameless(codes: [u8; 3]) -> Self {
        Self {
            name: "",
            color: rgb(codes),
        }
    }
}

/// The names of paints for furniture and textiles. One that is listed twice is twice as likely.
pub(super) const USUAL: [&str; 16] = [
    "black", "grey", "grey", "white", "white", "red", "red", "orange", "yellow", "green", "green",
    "blue", "blue", "purple", "pink", "brown",
];

/// The eleven names of paints.
pub(super) const ALL: [&str; 11] = [
    "black", "grey", "white", "red", "orange", "yellow", "green", "blue", "purple", "pink", "brown",
];
