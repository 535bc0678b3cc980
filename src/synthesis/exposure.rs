//! The exposure branch: less light and nothing else.

use rayon::prelude::*;

use super::curve;
use super::lanes::{Isa, Kernel};
use crate::types::{Rgb, Severity};

/// The version of the exposure branch: raised whenever a pixel changes.
pub(crate) const VERSION: u32 = 1;

/// Samples that one thread takes at a time.
const PART: usize = 1 << 16;

/// Adding it to a number from 0 to 255 leaves the nearest whole number in the lowest byte.
const ROUND: f32 = 8_388_608.0;

/// The image under an exposure drop, without noise (DarkQA, eqs. 1–3): each code through the [`table`].
#[must_use]
pub fn expose(clean: &Rgb, drop: Severity) -> Rgb {
    let table = table(drop);
    let codes: [u8; 256] = std::array::from_fn(|code| code as u8);
    let mut scaled = [0; 256];
    let left = curve::display_left(drop.value()) as f32;
    let isa = Isa::best();
    isa.run(Scale {
        clean: &codes,
        left,
        codes: &mut scaled,
    });
    // Scaling is faster; single precision misses a tie of some drops, none of the paper's.
    if scaled == table {
        return expose_by(clean, drop.value());
    }
    let mut dark = clean.clone();
    for part in dark.samples_mut() {
        *part = table[usize::from(*part)];
    }
    dark
}

/// The image after any exposure drop in EV, without noise; ties between codes fall as single precision has them.
#[must_use]
pub(crate) fn expose_by(clean: &Rgb, drop_ev: f64) -> Rgb {
    let mut dark = Rgb::black(clean.height(), clean.width());
    expose_into(clean, drop_ev, &mut dark);
    dark
}

/// The same into an image of the same size.
///
/// As (2^−ΔEV · x^2.2)^(1/2.2) is 2^(−ΔEV/2.2) · x, the drop is a factor on the codes.
///
/// # Panics
/// Where the sizes differ.
pub fn expose_into(clean: &Rgb, drop_ev: f64, dark: &mut Rgb) {
    assert_eq!(
        (clean.height(), clean.width()),
        (dark.height(), dark.width())
    );
    let (left, isa) = (curve::display_left(drop_ev) as f32, Isa::best());
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

/// Added before rounding, so that an exact tie goes up whatever the last bit of a power: at whole multiples of 2.2 EV the
/// factor is a power of two. The nearest tie elsewhere is 1.4e-6 away (measured over all 1600 drops).
const TIE: f64 = 1e-9;

/// The code that each 8-bit code becomes: floor(2^(−ΔEV/2.2) · code + ½), ties up.
#[must_use]
pub(crate) fn table(drop: Severity) -> [u8; 256] {
    let left = curve::display_left(drop.value());
    std::array::from_fn(|code| (code as f64 * left + 0.5 + TIE).floor() as u8)
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
        level: Severity,
        distinct: usize,
        first_light: usize,
        /// At 32, 64, 96, 128, 160, 192, 224 and 255.
        entries: [u8; 8],
        sum: u32,
        crc: u32,
    }

    const CASES: [Case; 5] = [
        Case {
            level: Severity::L1,
            distinct: 137,
            first_light: 1,
            entries: [17, 34, 51, 68, 85, 102, 119, 136],
            sum: 17383,
            crc: 0xbf6b_89db,
        },
        Case {
            level: Severity::L2,
            distinct: 73,
            first_light: 2,
            entries: [9, 18, 27, 36, 45, 54, 64, 72],
            sum: 9256,
            crc: 0x32e9_6a7f,
        },
        Case {
            level: Severity::L3,
            distinct: 40,
            first_light: 4,
            entries: [5, 10, 14, 19, 24, 29, 34, 39],
            sum: 4929,
            crc: 0xb92f_c0e1,
        },
        Case {
            level: Severity::L4,
            distinct: 25,
            first_light: 6,
            entries: [3, 6, 9, 12, 15, 18, 21, 24],
            sum: 3072,
            crc: 0x9680_e44d,
        },
        Case {
            level: Severity::L5,
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

    /// Whole numbers of EV, halves between codes (2.2 and 11 EV), and every table there is.
    #[test]
    fn tables_of_any_drop_are_exact() {
        let entries = [
            (100, [23, 47, 70, 93, 117, 140, 163, 186], 0x47fb_07cd),
            (220, [16, 32, 48, 64, 80, 96, 112, 128], 0xcec6_b4fb),
            (330, [11, 23, 34, 45, 57, 68, 79, 90], 0x2864_cfeb),
            (500, [7, 13, 20, 26, 33, 40, 46, 53], 0xa803_b90c),
            (1100, [1, 2, 3, 4, 5, 6, 7, 8], 0x6a99_1e1f),
            (1400, [0, 1, 1, 2, 2, 2, 3, 3], 0xb741_6698),
            (1600, [0, 0, 1, 1, 1, 1, 1, 2], 0xa670_34d3),
        ];
        for (hundredths, due, crc) in entries {
            let table = table(Severity::hundredths(hundredths));
            let found = [32, 64, 96, 128, 160, 192, 224, 255].map(|code: usize| table[code]);
            assert_eq!(found, due, "{hundredths}");
            assert_eq!(crc32(&table), crc, "{hundredths}");
        }
        let all: Vec<u8> = (1..=1600)
            .flat_map(|drop| table(Severity::hundredths(drop)))
            .collect();
        assert_eq!(crc32(&all), 0x2f73_04d1);
    }

    /// The tables of the paper's levels are its own steps, one by one.
    #[test]
    fn the_papers_steps_give_the_papers_tables() {
        for level in Severity::LADDER {
            let left = curve::light_left(level.value());
            let by_steps: [u8; 256] = std::array::from_fn(|code| {
                let linear = curve::gamma_expand(code as f64 / 255.0);
                curve::to_code(curve::gamma_compress(left * linear))
            });
            assert_eq!(table(level), by_steps, "{level}");
        }
    }

    #[test]
    fn a_darker_level_is_nowhere_lighter() {
        for pair in Severity::LADDER.windows(2) {
            let (light, dark) = (table(pair[0]), table(pair[1]));
            assert!(light.iter().zip(dark).all(|(l, d)| d <= *l));
        }
    }

    #[test]
    fn every_sample_goes_through_the_table() {
        let clean = Rgb::new(16, 16, (0..768).map(|i| i as u8).collect()).unwrap();
        for level in Severity::LADDER
            .into_iter()
            .chain([220, 440, 1333].map(Severity::hundredths))
        {
            let table = table(level);
            let dark = expose(&clean, level);
            for (clean, dark) in clean.samples().iter().zip(dark.samples()) {
                assert_eq!(table[usize::from(*clean)], *dark, "{level:?}");
            }
        }
        let brighter = expose_by(&clean, -2.0);
        assert_eq!(brighter.samples()[..3], [0, 2, 4]);
        assert_eq!(brighter.samples()[255], 255);
    }
}
