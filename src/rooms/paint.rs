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
    ("grey", &[[128, 128, 130], [118, 120, 122], [136, 134, 132]]),
    ("white", &[[248, 248, 246], [246, 247, 248]]),
    ("red", &[[186, 32, 36], [170, 26, 40], [196, 42, 40]]),
    ("orange", &[[255, 152, 56], [255, 148, 50]]),
    ("yellow", &[[250, 216, 66], [246, 208, 72]]),
    ("green", &[[70, 136, 76], [92, 146, 78], [46, 110, 74]]),
    ("blue", &[[52, 92, 178], [66, 114, 190], [44, 70, 142]]),
    ("purple", &[[122, 66, 156], [108, 58, 140]]),
    ("pink", &[[248, 164, 192], [246, 152, 184]]),
    ("brown", &[[120, 76, 44], [106, 66, 38], [132, 86, 52]]),
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

/// The linear light of three sRGB codes.
pub(super) fn rgb([red, green, blue]: [u8; 3]) -> Vec3 {
    vec3(linear(red), linear(green), linear(blue))
}

impl Paint {
    /// A random paint with one of these names.
    pub(super) fn of(names: &[&str], dice: &mut Dice) -> Self {
        let name = dice.pick(names);
        let known = NAMED.iter().find(|(known, _)| *known == name);
        let (name, codes) = known.map_or(NAMED[0], |found| *found);
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

/// The eleven names of paints.
pub(super) const ALL: [&str; 11] = [
    "black", "grey", "white", "red", "orange", "yellow", "green", "blue", "purple", "pink", "brown",
];
