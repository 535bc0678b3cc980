//! The exposure branch: less light and nothing else.

use rayon::prelude::*;

use super::curve;
use super::lanes::{Isa, Kernel};
use crate::types::{DarkLevel, Rgb, Stops};

/// The version of the exposure branch: raised whenever a pixel changes.
pub const VERSION: u32 = 1;

/// Samples that one thread takes at a time.
const PART: usize = 1 << 16;

/// Adding it to a number from 0 to 255 leaves the nearest whole number in the lowest byte.
const ROUND: f32 = 8_388_608.0;

/// The image at a darker level, without noise (DarkQA, eqs. 1–3).
#[must_use]
pub fn expose(clean: &Rgb, level: DarkLevel) -> Rgb {
    expose_by(clean, level.exposure_drop())
}

/// The image after any exposure drop, without noise.
#[must_use]
pub fn expose_by(clean: &Rgb, drop: Stops) -> Rgb {
    let mut dark = Rgb::black(clean.height(), clean.width());
    expose_into(clean, drop, &mut dark);
    dark
}

/// The same into an image of the same size.
///
/// As (2^−ΔEV · x^2.2)^(1/2.2) is 2^(−ΔEV/2.2) · x, the drop is a factor on the codes.
///
/// # Panics
/// Where the sizes differ.
pub fn expose_into(clean: &Rgb, drop: Stops, dark: &mut Rgb) {
    assert_eq!(
        (clean.height(), clean.width()),
        (dark.height(), dark.width())
    );
    let (left, isa) = (curve::display_left(drop) as f32, Isa::best());
    let parts = dark.samples_mut().par_chunks_mut(PART);
    parts
        .zip(clean.samples().par_chunks(PART))
        .for_each(|(codes, clean)| isa.run(Scale { clean, left, codes }));
}

struct Scale<'a> {
    clean: &'a [u8],
    left: f32,
    codes: &'a mut [u8],
}

impl Kernel for Scale<'_> {
    #[inline(always)]
    fn run(self) {
        for (code, clean) in self.codes.iter_mut().zip(self.clean) {
            let dark = f32::from(*clean) * self.left;
            let dark = if dark < 255.0 { dark } else { 255.0 };
            *code = (dark + ROUND).to_bits() as u8;
        }
    }
}

/// The code that each 8-bit code becomes at a level, by the paper's own steps.
#[must_use]
pub fn table(level: DarkLevel) -> [u8; 256] {
    let left = curve::light_left(level.exposure_drop());
    std::array::from_fn(|code| {
        let linear = curve::gamma_expand(code as f64 / 255.0);
        curve::to_code(curve::gamma_compress(left * linear))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CRC-32 as PNG has it: reflected, polynomial 0xEDB88320.
    fn crc32(bytes: &[u8]) -> u32 {
        let mut crc = u32::MAX;
        for byte in bytes {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = (crc >> 1) ^ (0xEDB8_8320 * (crc & 1));
            }
        }
        !crc
    }

    struct Case {
        level: DarkLevel,
        distinct: usize,
        first_light: usize,
        /// At 32, 64, 96, 128, 160, 192, 224 and 255.
        entries: [u8; 8],
        sum: u32,
        crc: u32,
    }

    const CASES: [Case; 5] = [
        Case {
            level: DarkLevel::L1,
            distinct: 137,
            first_light: 1,
            entries: [17, 34, 51, 68, 85, 102, 119, 136],
            sum: 17383,
            crc: 0xbf6b_89db,
        },
        Case {
            level: DarkLevel::L2,
            distinct: 73,
            first_light: 2,
            entries: [9, 18, 27, 36, 45, 54, 64, 72],
            sum: 9256,
            crc: 0x32e9_6a7f,
        },
        Case {
            level: DarkLevel::L3,
            distinct: 40,
            first_light: 4,
            entries: [5, 10, 14, 19, 24, 29, 34, 39],
            sum: 4929,
            crc: 0xb92f_c0e1,
        },
        Case {
            level: DarkLevel::L4,
            distinct: 25,
            first_light: 6,
            entries: [3, 6, 9, 12, 15, 18, 21, 24],
            sum: 3072,
            crc: 0x9680_e44d,
        },
        Case {
            level: DarkLevel::L5,
            distinct: 16,
            first_light: 9,
            entries: [2, 4, 6, 8, 9, 11, 13, 15],
            sum: 1917,
            crc: 0xc59b_9430,
        },
    ];

    #[test]
    fn tables_are_exact() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        for case in CASES {
            let table = table(case.level);
            let level = case.level;
            let entries = [32, 64, 96, 128, 160, 192, 224, 255].map(|code: usize| table[code]);
            assert_eq!(entries, case.entries, "{level:?}");
            let mut distinct = table.to_vec();
            distinct.dedup();
            assert_eq!(distinct.len(), case.distinct, "{level:?}");
            assert!(table.is_sorted(), "{level:?}");
            let first = table.iter().position(|code| *code > 0);
            assert_eq!(first, Some(case.first_light), "{level:?}");
            let sum: u32 = table.iter().map(|code| u32::from(*code)).sum();
            assert_eq!(sum, case.sum, "{level:?}");
            assert_eq!(crc32(&table), case.crc, "{level:?}");
        }
    }

    #[test]
    fn a_darker_level_is_nowhere_lighter() {
        for pair in DarkLevel::ALL.windows(2) {
            let (light, dark) = (table(pair[0]), table(pair[1]));
            assert!(light.iter().zip(dark).all(|(l, d)| d <= *l));
        }
    }

    #[test]
    fn every_sample_goes_through_the_table() {
        let clean = Rgb::new(16, 16, (0..768).map(|i| i as u8).collect()).unwrap();
        for level in DarkLevel::ALL {
            let table = table(level);
            let dark = expose(&clean, level);
            for (clean, dark) in clean.samples().iter().zip(dark.samples()) {
                assert_eq!(table[usize::from(*clean)], *dark, "{level:?}");
            }
        }
        let brighter = expose_by(&clean, Stops(-2.0));
        assert_eq!(brighter.samples()[..3], [0, 2, 4]);
        assert_eq!(brighter.samples()[255], 255);
    }
}
