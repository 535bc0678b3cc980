//! Exposure drops without noise ("exposure branch").

use rayon::prelude::*;

use super::clean::Clean;
use super::codes::display_light;
use super::curve;
use darkqa_base::types::images::{Isa, Kernel};
use darkqa_base::types::{Light, Rgb, Rgb16Image, Severity};

/// Version of the exposure branch, raised whenever a pixel changes.
pub const VERSION: u32 = 1;

/// Number of samples that one thread processes at a time; chosen.
const CHUNK: usize = 1 << 16;

/// 2^23: adding it to a number from 0 to 255 leaves the nearest whole number in the lowest byte.
const ROUND: f32 = 8_388_608.0;

/// Applies an exposure drop without noise (DarkQA, eqs. 1–3). 8-bit codes follow the [`table`]; 16-bit codes and light
/// are rounded to 8 bits after the drop.
#[must_use]
pub fn expose<'a>(clean: impl Into<Clean<'a>>, drop: Severity) -> Rgb {
    match clean.into() {
        Clean::Codes(codes) => expose_codes(codes, drop),
        other => expose_by(other, drop.value()),
    }
}

fn expose_codes(clean: &Rgb, drop: Severity) -> Rgb {
    let table = table(drop);
    let codes: [u8; 256] = std::array::from_fn(|code| code as u8);
    let mut scaled = [0; 256];
    let factor = curve::display_factor(drop.value()) as f32;
    let isa = Isa::best();
    isa.run(Scale { clean: &codes, factor, codes: &mut scaled });
    // Scaling is faster, but for some drops (not those of the paper) single precision rounds a tie differently.
    if scaled == table {
        return expose_by(clean, drop.value());
    }
    let mut degraded = clean.clone();
    for sample in degraded.samples_mut() {
        *sample = table[usize::from(*sample)];
    }
    degraded
}

/// Applies an exposure drop of any number of EV without noise. Ties between 8-bit codes are rounded as in single
/// precision.
#[must_use]
pub fn expose_by<'a>(clean: impl Into<Clean<'a>>, drop_ev: f64) -> Rgb {
    let clean = clean.into();
    let mut degraded = Rgb::black(clean.height(), clean.width());
    match clean {
        Clean::Codes(codes) => expose_into(codes, drop_ev, &mut degraded),
        Clean::Rgb16Image(codes) => expose_16_bits(codes, drop_ev, &mut degraded),
        Clean::Light(light) | Clean::Scene(light) => expose_light(light, drop_ev, &mut degraded),
    }
    degraded
}

/// Converts 16-bit codes v to floor(2^(−ΔEV/2.2) · 255 · v/65535 + ½), at most 255; ties are rounded up.
fn expose_16_bits(clean: &Rgb16Image, drop_ev: f64, degraded: &mut Rgb) {
    let factor = 255.0 * curve::display_factor(drop_ev);
    let table: Vec<u8> = (0..=u16::MAX)
        .map(|code| {
            let scaled = factor * (f64::from(code) / 65_535.0) + 0.5 + TIE;
            scaled.floor().min(255.0) as u8
        })
        .collect();
    let chunks = degraded.samples_mut().par_chunks_mut(CHUNK);
    let clean = clean.samples().par_chunks(CHUNK);
    chunks.zip(clean).for_each(|(codes, clean)| {
        for (code, clean) in codes.iter_mut().zip(clean) {
            *code = table[usize::from(*clean)];
        }
    });
}

/// Converts light L to the codes floor(255 · min(1, 2^(−ΔEV) · L)^(1/2.2) + ½).
fn expose_light(clean: &Light, drop_ev: f64, degraded: &mut Rgb) {
    // Lower limit in light of each code from 1: halfway, in codes, to the code below.
    let drop = libm::exp2(drop_ev);
    let steps: [f64; 255] = std::array::from_fn(|below| libm::pow((below as f64 + 0.5) / 255.0, curve::GAMMA) * drop);
    let chunks = degraded.samples_mut().par_chunks_mut(CHUNK);
    let clean = clean.samples().par_chunks(CHUNK);
    chunks.zip(clean).for_each(|(codes, clean)| {
        for (code, light) in codes.iter_mut().zip(clean) {
            *code = steps.partition_point(|step| *step <= f64::from(*light)) as u8;
        }
    });
}

/// Applies an exposure drop of any number of EV without noise; returns linear display light, not rounded to codes.
pub(super) fn expose_to_light(clean: Clean<'_>, drop_ev: f64) -> Light {
    let mut degraded = Light::black(clean.height(), clean.width());
    let factor = libm::exp2(-drop_ev);
    match clean {
        Clean::Codes(codes) => {
            let table = display_light().map(|light| darken(f64::from(light), factor));
            for (light, code) in degraded.samples_mut().iter_mut().zip(codes.samples()) {
                *light = table[usize::from(*code)];
            }
        }
        Clean::Rgb16Image(codes) => {
            for (light, code) in degraded.samples_mut().iter_mut().zip(codes.samples()) {
                *light = darken(curve::gamma_expand(f64::from(*code) / 65_535.0), factor);
            }
        }
        Clean::Light(clean) | Clean::Scene(clean) => {
            for (light, clean) in degraded.samples_mut().iter_mut().zip(clean.samples()) {
                *light = darken(f64::from(*clean), factor);
            }
        }
    }
    degraded
}

fn darken(light: f64, factor: f64) -> f32 {
    (light * factor).min(1.0) as f32
}

/// Writes the image after an exposure drop into `degraded`, an image of the same size.
///
/// The drop is a factor on the codes, because (2^−ΔEV · x^2.2)^(1/2.2) is 2^(−ΔEV/2.2) · x.
///
/// # Panics
/// If the sizes differ.
pub fn expose_into(clean: &Rgb, drop_ev: f64, degraded: &mut Rgb) {
    assert_eq!((clean.height(), clean.width()), (degraded.height(), degraded.width()));
    let (factor, isa) = (curve::display_factor(drop_ev) as f32, Isa::best());
    let chunks = degraded.samples_mut().par_chunks_mut(CHUNK);
    chunks.zip(clean.samples().par_chunks(CHUNK)).for_each(|(codes, clean)| {
        isa.run(Scale { clean, factor, codes });
    });
}

struct Scale<'a> {
    clean: &'a [u8],
    factor: f32,
    codes: &'a mut [u8],
}

impl Kernel for Scale<'_> {
    #[inline(always)]
    fn run(self) {
        for (code, clean) in self.codes.iter_mut().zip(self.clean) {
            let scaled = f32::from(*clean) * self.factor;
            let scaled = if scaled < 255.0 { scaled } else { 255.0 };
            *code = (scaled + ROUND).to_bits() as u8;
        }
    }
}

/// Offset before rounding, so that exact ties are rounded up despite the rounding error of the power. Exact ties occur
/// at multiples of 2.2 EV, whose factor is a power of two; elsewhere the nearest tie is 1.4e-6 away (measured over all
/// 1600 drops).
const TIE: f64 = 1e-9;

/// Code after the drop for each 8-bit code: floor(2^(−ΔEV/2.2) · code + ½); ties are rounded up.
#[must_use]
pub fn table(drop: Severity) -> [u8; 256] {
    let factor = curve::display_factor(drop.value());
    std::array::from_fn(|code| (code as f64 * factor + 0.5 + TIE).floor() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CRC-32 as in PNG: reflected, polynomial 0xEDB88320.
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
        first_nonzero: usize,
        /// Codes after the drop for 32, 64, 96, 128, 160, 192, 224 and 255.
        entries: [u8; 8],
        sum: u32,
        crc: u32,
    }

    const CASES: [Case; 5] = [
        Case {
            level: Severity::L1,
            distinct: 137,
            first_nonzero: 1,
            entries: [17, 34, 51, 68, 85, 102, 119, 136],
            sum: 17383,
            crc: 0xbf6b_89db,
        },
        Case {
            level: Severity::L2,
            distinct: 73,
            first_nonzero: 2,
            entries: [9, 18, 27, 36, 45, 54, 64, 72],
            sum: 9256,
            crc: 0x32e9_6a7f,
        },
        Case {
            level: Severity::L3,
            distinct: 40,
            first_nonzero: 4,
            entries: [5, 10, 14, 19, 24, 29, 34, 39],
            sum: 4929,
            crc: 0xb92f_c0e1,
        },
        Case {
            level: Severity::L4,
            distinct: 25,
            first_nonzero: 6,
            entries: [3, 6, 9, 12, 15, 18, 21, 24],
            sum: 3072,
            crc: 0x9680_e44d,
        },
        Case {
            level: Severity::L5,
            distinct: 16,
            first_nonzero: 9,
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
            assert_eq!(first, Some(case.first_nonzero), "{level:?}");
            let sum: u32 = table.iter().map(|code| u32::from(*code)).sum();
            assert_eq!(sum, case.sum, "{level:?}");
            assert_eq!(crc32(&table), case.crc, "{level:?}");
        }
    }

    /// Whole numbers of EV, exact ties between codes (2.2 and 11 EV), and all 1600 tables.
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
        for (hundredths, expected, crc) in entries {
            let table = table(Severity::from_hundredths(hundredths));
            let found = [32, 64, 96, 128, 160, 192, 224, 255].map(|code: usize| table[code]);
            assert_eq!(found, expected, "{hundredths}");
            assert_eq!(crc32(&table), crc, "{hundredths}");
        }
        let all: Vec<u8> = (1..=1600).flat_map(|drop| table(Severity::from_hundredths(drop))).collect();
        assert_eq!(crc32(&all), 0x2f73_04d1);
    }

    /// For the levels of the paper, the tables equal the separate steps of the paper.
    #[test]
    fn tables_equal_the_separate_steps_of_the_paper() {
        for level in Severity::LADDER {
            let factor = curve::light_factor(level.value());
            let by_steps: [u8; 256] = std::array::from_fn(|code| {
                let linear = curve::gamma_expand(code as f64 / 255.0);
                curve::to_code(curve::gamma_compress(factor * linear))
            });
            assert_eq!(table(level), by_steps, "{level}");
        }
    }

    #[test]
    fn higher_levels_are_never_brighter() {
        for pair in Severity::LADDER.windows(2) {
            let (lower, higher) = (table(pair[0]), table(pair[1]));
            assert!(lower.iter().zip(higher).all(|(low, high)| high <= *low));
        }
    }

    #[test]
    fn the_documentation_has_the_codes_of_each_level() {
        let page = include_str!("../docs/method.md");
        for (index, case) in (1..).zip(CASES) {
            let [.., white] = case.entries;
            let (distinct, first) = (case.distinct, case.first_nonzero);
            let row = format!("| L{index} | {white} | {distinct} | {first} |");
            assert!(page.contains(&row), "not on the page: {row}");
        }
    }

    #[test]
    fn every_sample_follows_the_table() {
        let clean = Rgb::new(16, 16, (0..768).map(|i| i as u8).collect()).unwrap();
        for level in Severity::LADDER.into_iter().chain([220, 440, 1333].map(Severity::from_hundredths)) {
            let table = table(level);
            let degraded = expose(&clean, level);
            for (clean, degraded) in clean.samples().iter().zip(degraded.samples()) {
                assert_eq!(table[usize::from(*clean)], *degraded, "{level:?}");
            }
        }
        let brighter = expose_by(&clean, -2.0);
        assert_eq!(brighter.samples()[..3], [0, 2, 4]);
        assert_eq!(brighter.samples()[255], 255);
    }
}
