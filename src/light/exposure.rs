//! Exposure drops without noise ("exposure branch").
//!
//! Several degradations of one frame with shared work: [`Exposures`].
//!
//! Exposure difference between two photographs of the same scene: [`PairEv`].

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::applied::AppliedDegradation;
use super::clean::{self, Clean, GAMMA, display_light};
use super::draws::NoiseKey;
use super::movement::Streak;
use crate::movement::blur::{blur, blurred_codes};
use crate::raw::negative::{Negative, develop_by};
use darkqa_base::types::images::{Isa, Kernel};
use darkqa_base::types::{Light, ProfileName, Rgb, Rgb16Image, Severity};

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
    let factor = clean::display_factor(drop.value()) as f32;
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
    let factor = 255.0 * clean::display_factor(drop_ev);
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
    let steps: [f64; 255] = std::array::from_fn(|below| libm::pow((below as f64 + 0.5) / 255.0, clean::GAMMA) * drop);
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
                *light = darken(clean::gamma_expand(f64::from(*code) / 65_535.0), factor);
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
    let (factor, isa) = (clean::display_factor(drop_ev) as f32, Isa::best());
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
    let factor = clean::display_factor(drop.value());
    std::array::from_fn(|code| (code as f64 * factor + 0.5 + TIE).floor() as u8)
}

/// Makes degraded images of one frame. Caches the last [`Negative`] of each noise profile, and the last blurred frame.
#[derive(Debug, Default)]
pub struct Exposures {
    /// The key of each negative is that of its noise.
    negatives: BTreeMap<ProfileName, (NoiseKey, Negative)>,
    /// Blurred light of the last path; levels with equal exposure time share it.
    blurred: Option<(Streak, Light)>,
}

impl Exposures {
    /// Applies a degradation to the frame. Frame and noise profiles must be the same in each call. Images of one key are
    /// made fastest in sequence.
    #[must_use]
    pub fn degrade(&mut self, clean: Clean<'_>, degradation: &AppliedDegradation, key: &NoiseKey) -> Rgb {
        match degradation {
            AppliedDegradation::Exposure(severity) => expose(clean, *severity),
            AppliedDegradation::Sensor { severity, reading, synthesis } => {
                let cached = self.negatives.remove(reading);
                let negative = cached
                    .filter(|(known, negative)| known == key && negative.can_develop(*severity))
                    .map_or_else(|| Negative::new(clean, key, synthesis, *severity), |(_, negative)| negative);
                let degraded = negative.develop(*severity);
                self.negatives.insert(reading.clone(), (*key, negative));
                degraded
            }
            AppliedDegradation::Auto { shot, streak, synthesis } => {
                let light = self.blurred(clean, *streak);
                develop_by(light, key, synthesis, shot.dark)
            }
            AppliedDegradation::Motion { streak, .. } => blurred_codes(clean, *streak),
        }
    }

    /// The frame blurred along a path; unchanged if the path has no length.
    fn blurred<'a>(&'a mut self, clean: Clean<'a>, streak: Streak) -> Clean<'a> {
        if streak.is_still() {
            return clean;
        }
        let cached = self.blurred.take().filter(|(path, _)| *path == streak);
        let (_, light) = self.blurred.insert(cached.unwrap_or_else(|| (streak, blur(clean, streak))));
        clean.with_light(light)
    }
}

/// Weights of red, green and blue in the luminance of linear sRGB (ITU-R BT.709).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Exposure difference between two photographs of the same scene, in EV; positive if the second is darker. The
/// photographs may be misaligned and differ in size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairEv {
    /// log₂ of the ratio of the mean linear luminances, bright to dark.
    pub mean: f64,
    /// Median of the per-pixel log₂ luminance ratios, without pixels that are black in either image. For images of
    /// different sizes, log₂ of the ratio of the median luminances. `None` if no ratio is defined.
    pub median: Option<f64>,
    /// Exposure drop with which [`expose`] makes the bright image as dark as the other one: like `mean`,
    /// but with light computed as code^2.2.
    pub synthesis: f64,
}

impl PairEv {
    /// Measures a pair, the bright image first; `None` if at least one image is black.
    ///
    /// Luminance is linear sRGB (IEC 61966-2-1), so that `mean` matches the change of shutter time and gain, within
    /// 0.03 EV up to 9 EV. Noise that is clipped at black brightens the dark image: above 6 EV, `mean` is too small for
    /// noisy images. The paper's synthesis uses the power 2.2 instead, which differs near black: for a real pair of
    /// LOL-v2, `mean` is 3.59 EV and `synthesis` 4.08 EV.
    #[must_use]
    pub fn measure(normal: &Rgb, low: &Rgb) -> Option<Self> {
        let (bright, dark) = (luminance(normal, srgb_to_linear), luminance(low, srgb_to_linear));
        let is_same_size = (normal.height(), normal.width()) == (low.height(), low.width());
        let [gamma_bright, gamma_dark] =
            [normal, low].map(|image| mean(&luminance(image, |code| libm::pow(code, GAMMA))));
        Some(Self {
            mean: ev_difference(mean(&bright), mean(&dark))?,
            synthesis: ev_difference(gamma_bright, gamma_dark)?,
            median: if is_same_size {
                median(bright.iter().zip(&dark).filter_map(|(bright, dark)| ev_difference(*bright, *dark)).collect())
            } else {
                median(bright).zip(median(dark)).and_then(|(bright, dark)| ev_difference(bright, dark))
            },
        })
    }
}

/// log₂ of the ratio of two luminances; `None` if one of them is 0.
fn ev_difference(bright: f64, dark: f64) -> Option<f64> {
    (bright > 0.0 && dark > 0.0).then(|| libm::log2(bright / dark))
}

/// Mean linear luminance of an image, from 0 to 1; 0 for an image without pixels.
#[must_use]
pub fn mean_luminance(image: &Rgb) -> f64 {
    mean(&luminance(image, srgb_to_linear))
}

/// Converts an sRGB code to linear light, both from 0 to 1 (IEC 61966-2-1).
fn srgb_to_linear(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { libm::pow((code + 0.055) / 1.055, 2.4) }
}

/// Luminance of each pixel. `to_linear` converts a code to linear light, both from 0 to 1.
fn luminance(image: &Rgb, to_linear: impl Fn(f64) -> f64) -> Vec<f64> {
    let linear: [f64; 256] = std::array::from_fn(|code| to_linear(code as f64 / 255.0));
    image
        .samples()
        .chunks_exact(3)
        .map(|pixel| pixel.iter().zip(LUMINANCE).map(|(code, weight)| weight * linear[usize::from(*code)]).sum::<f64>())
        .collect()
}

/// Mean; 0 for an empty slice.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Upper median; `None` for an empty vector.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise_profile::{Amplify, NoiseProfile, Synthesis};
    use crate::raw::noise::{Term, add};
    use crate::raw::{Bayer, unprocess};
    use crate::{AutoSettings, CameraModel, CameraState, FrameView, Motion, expose_by};
    use darkqa_base::error::Result;
    use darkqa_base::types::degradations::Kind;
    use darkqa_base::types::{Degradation, FrameId, Severity};

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
            let factor = clean::light_factor(level.value());
            let by_steps: [u8; 256] = std::array::from_fn(|code| {
                let linear = clean::gamma_expand(code as f64 / 255.0);
                clean::to_code(clean::gamma_compress(factor * linear))
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

    fn key(frame: &str) -> NoiseKey {
        NoiseKey::new(5, &FrameId(frame.to_owned()))
    }

    fn picture() -> Rgb {
        Rgb::new(40, 150, (0..3 * 40 * 150).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect())
            .unwrap()
    }

    /// The parameters of a degradation with these settings.
    fn apply(synthesis: &Synthesis, how: &str, auto: &str, motion: &str) -> Result<AppliedDegradation> {
        let auto: AutoSettings = auto.parse().unwrap();
        let auto = auto.for_camera(&CameraModel::default());
        let motion: Motion = motion.parse().unwrap();
        let how: Degradation = how.parse().unwrap();
        let view = FrameView { width: 640, focal: None };
        AppliedDegradation::new(&how, synthesis, &auto, &motion, view, &key("a"))
    }

    /// [`apply`] for a sensor with pinned gain and ratio, which automatic exposure ignores.
    fn applied(how: &str, auto: &str, motion: &str) -> AppliedDegradation {
        let mut camera = CameraModel::default();
        camera.pin_gain(3.0).unwrap();
        camera.pin_ratio(7.0).unwrap();
        let synthesis = Synthesis::new(NoiseProfile::Eld, camera);
        apply(&synthesis, how, auto, motion).unwrap()
    }

    fn image(how: &str, auto: &str, motion: &str) -> Rgb {
        Exposures::default().degrade((&picture()).into(), &applied(how, auto, motion), &key("a"))
    }

    /// The noise variant in the noise profile `physical`, with a pinned gain.
    fn physical(severity: Severity, gain: f64) -> Rgb {
        let mut camera = CameraModel::default();
        camera.pin_gain(gain).unwrap();
        let synthesis = Synthesis::new(NoiseProfile::Physical, camera);
        Negative::new(&picture(), &key("a"), &synthesis, severity).develop(severity)
    }

    #[test]
    fn without_reaction_and_motion_auto_equals_the_physical_profile() {
        let none = "shutter=0,gain=0,base-gain=1.5";
        for severity in Severity::LADDER {
            let level = Kind::Auto.label(severity);
            let found = image(&format!("{level}-auto"), none, "speed=0");
            assert_eq!(found, physical(severity, 1.5), "{level}");
        }
        let expected = physical(Severity::L3, 1.5);
        for (auto, motion) in [
            ("shutter=0.01,gain=0,base-gain=1.5", "speed=0"),
            ("shutter=0,gain=0.01,base-gain=1.5", "speed=0"),
            ("shutter=0,gain=0,base-gain=1.51", "speed=0"),
            (none, "speed=5"),
        ] {
            assert_ne!(image("L3-auto", auto, motion), expected, "{auto} {motion}");
        }
    }

    /// At L3 shutter and gain compensate the whole drop: the image is as bright as without a drop, with the noise of
    /// the gain K = 0.375 · 2⁴.
    #[test]
    fn gain_brightens_and_keeps_the_noise_of_its_photons() {
        let AppliedDegradation::Auto { shot, synthesis, .. } = applied("L3-auto", "gain=4", "speed=0") else {
            panic!("automatic exposure expected");
        };
        let state = synthesis.state_after_drop(&key("a"), shot.dark);
        assert!((state.system_gain - 6.0).abs() < 1e-12 && (state.ratio - 1.0).abs() < 1e-12);
        let (bright, dark) = (image("L3-auto", "gain=4", "speed=0"), physical(Severity::L3, 6.0));
        let [bright, dark] =
            [bright, dark].map(|image| image.samples().iter().map(|code| u64::from(*code)).sum::<u64>());
        assert!(bright > 4 * dark);
    }

    /// Green samples of an image of 256 × 256 sites.
    fn green_samples(raw: &Bayer) -> Vec<f64> {
        (0..256)
            .flat_map(|row| (0..128).map(move |i| (row, 2 * i + (row + 1) % 2)))
            .map(|(row, column)| f64::from(raw.sample(row, column)))
            .collect()
    }

    fn mean_and_variance(samples: &[f64]) -> (f64, f64) {
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let squares = samples.iter().map(|sample| (sample - mean).powi(2));
        (mean, squares.sum::<f64>() / n)
    }

    /// Variance of the shot noise of a flat grey, relative to the squared signal, times the signal in ADU.
    fn relative_shot_variance(auto: &str, how: &str) -> f64 {
        let AppliedDegradation::Auto { shot, synthesis, .. } = applied(how, auto, "speed=0") else {
            panic!("automatic exposure expected");
        };
        let grey = Rgb::new(256, 256, vec![117; 3 * 256 * 256]).unwrap();
        let state = synthesis.state_after_drop(&key("a"), shot.dark);
        let mut raw = unprocess(&grey, &state);
        let (light, _) = mean_and_variance(&green_samples(&raw));
        add(&mut raw, &state, &key("a"), Amplify::All, &[Term::Shot]);
        let (mean, variance) = mean_and_variance(&green_samples(&raw));
        assert!((mean / light - 1.0).abs() < 0.02, "{auto}: {mean} {light}");
        variance / (light * light) * (light * state.adu_range)
    }

    /// The relative variance of the shot noise is K₀ · 2^(ΔEV − s) / y, whatever the split between gain and darkness.
    #[test]
    fn shot_noise_follows_the_photons_alone() {
        for (auto, how, expected) in [
            ("shutter=2,gain=4", "L3-auto", 0.375 * 16.0),
            ("shutter=2,gain=0", "L3-auto", 0.375 * 16.0),
            ("shutter=2,gain=2.5", "L3-auto", 0.375 * 16.0),
            ("shutter=4,gain=1", "L3-auto", 0.375 * 4.0),
            ("shutter=0,gain=3", "L1-auto", 0.375 * 4.0),
            ("shutter=2,gain=4", "L5-auto", 0.375 * 128.0),
        ] {
            let found = relative_shot_variance(auto, how);
            let off = found / expected - 1.0;
            assert!(off.abs() < 0.03, "{auto} at {how}: {found} instead of {expected}");
        }
    }

    fn camera_state(how: &str, motion: &str) -> CameraState {
        let applied = applied(how, "gain=4", motion);
        let synthesis = applied.synthesis().unwrap();
        synthesis.state_after_drop(&key("a"), applied.drop_ev())
    }

    /// σ of read and row noise, relative to its median at the same gain.
    fn fit_scatter(state: &CameraState) -> [f64; 2] {
        let mut camera = CameraModel::default();
        camera.set_sampling(crate::Sampling::Fixed);
        camera.pin_gain(state.system_gain).unwrap();
        let median = CameraState::draw(&key("a"), &camera);
        [state.read_scale / median.read_scale, state.row_deviation / median.row_deviation]
    }

    /// Common random numbers: all kinds of degradation share the draws of a frame, and a random direction does not
    /// change them.
    #[test]
    fn auto_and_noise_share_their_draws() {
        let noise = camera_state("L3-noise@eld", "angle=0");
        let auto = camera_state("L3-auto", "angle=random");
        assert_eq!(noise.rgb_to_camera, auto.rgb_to_camera);
        let [noise_gains, auto_gains] =
            [&noise, &auto].map(|state| [state.rgb_gain, state.red_gain, state.blue_gain].map(f64::to_bits));
        assert_eq!(noise_gains, auto_gains);
        // The scatter of the fits is shared, too.
        for (noise, auto) in fit_scatter(&noise).iter().zip(fit_scatter(&auto)) {
            assert!((noise / auto - 1.0).abs() < 1e-12 && (noise - 1.0).abs() > 1e-3);
        }
        let still = image("L3-auto", "gain=4", "speed=0,angle=0");
        assert_eq!(image("L3-auto", "gain=4", "speed=0,angle=random"), still);
        let moved = image("L3-auto", "gain=4", "angle=random");
        assert_ne!(moved, image("L3-auto", "gain=4", "angle=0"));
    }

    fn mean_light(image: &Rgb) -> f64 {
        image.samples().iter().map(|code| (f64::from(*code) / 255.0).powf(2.2)).sum::<f64>()
            / image.samples().len() as f64
    }

    /// Motion blur alone does not change the mean light; without motion, the image is unchanged.
    #[test]
    fn motion_blurs_and_does_not_darken() {
        assert_eq!(image("T33.33-motion", "gain=4", "speed=0"), picture());
        let blurred = image("T33.33-motion", "gain=4", "angle=20");
        assert_ne!(blurred, picture());
        assert!((mean_light(&blurred) / mean_light(&picture()) - 1.0).abs() < 0.01);
        let facts = applied("T33.33-motion", "gain=4", "angle=20").exposure().unwrap();
        assert_eq!((facts.shutter, facts.system_gain), (None, None));
        assert!((facts.time_ms - 33.33).abs() < 1e-9);
        assert!((facts.blur_px.unwrap() - 6.776).abs() < 1e-2);
    }

    /// Images of one instance in any order equal images of separate instances.
    #[test]
    fn the_cache_does_not_change_images() {
        let mut exposures = Exposures::default();
        for how in ["L5-auto", "L1-auto", "E1-auto", "L3-auto", "L3-noise@eld", "T16.67-motion"] {
            let applied = applied(how, "gain=4", "speed=30");
            let found = exposures.degrade((&picture()).into(), &applied, &key("a"));
            assert_eq!(found, image(how, "gain=4", "speed=30"), "{how}");
        }
    }

    /// Images of several draws of the noise share an instance.
    #[test]
    fn each_key_has_its_own_noise() {
        let mut exposures = Exposures::default();
        for how in ["L1-noise", "L3-noise", "L3-auto"] {
            let applied = applied(how, "gain=4", "speed=0");
            let [first, second, again] =
                ["a", "b", "a"].map(|name| exposures.degrade((&picture()).into(), &applied, &key(name)));
            assert!(first == again && first != second, "{how}");
        }
    }

    fn apply_error(how: &str, auto: &str, motion: &str) -> String {
        apply(&Synthesis::default(), how, auto, motion).unwrap_err().to_string()
    }

    #[test]
    fn impossible_gains_and_paths_are_refused() {
        let error = apply_error("L5-auto", "gain=5", "speed=30");
        assert!(error.contains("K from 0.1 to 6"), "{error}");
        let error = apply_error("T133.33-motion", "gain=4", "speed=360");
        assert!(error.contains("325.20 pixels") && error.contains("at most 256"), "{error}");
        let error = apply_error("L1-auto", "shutter=2", "speed=1200");
        assert!(error.contains("pixels during the exposure"), "{error}");
    }

    /// Pseudo-random image without black pixels.
    fn scene() -> Rgb {
        let samples = (0..96 * 128 * 3_u32).map(|i| (40 + (i.wrapping_mul(2_654_435_761) >> 8) % 200) as u8);
        Rgb::new(96, 128, samples.collect()).unwrap()
    }

    /// Darkens an image by `ev` EV. A dither before rounding to 8 bits preserves the mean of dark codes.
    fn darker(image: &Rgb, ev: f64) -> Rgb {
        let mut dark = image.clone();
        for (index, code) in dark.samples_mut().iter_mut().enumerate() {
            let light = srgb_to_linear(f64::from(*code) / 255.0) * libm::exp2(-ev);
            let exact = if light <= 0.003_130_8 {
                255.0 * 12.92 * light
            } else {
                255.0 * (1.055 * libm::pow(light, 1.0 / 2.4) - 0.055)
            };
            let dither = f64::from((index as u32).wrapping_mul(2_246_822_519) >> 8) / f64::from(1 << 24);
            *code = (exact + dither).floor() as u8;
        }
        dark
    }

    #[test]
    fn mean_recovers_exposure_drop() {
        for drop in [0.5, 2.0, 3.6, 6.0, 9.0] {
            let ev = PairEv::measure(&scene(), &darker(&scene(), drop)).unwrap();
            assert!((ev.mean - drop).abs() < 0.03, "{drop}: {ev:?}");
        }
    }

    #[test]
    fn synthesis_recovers_synthetic_drop() {
        for drop in [0.5, 2.0, 3.6, 6.0] {
            let ev = PairEv::measure(&scene(), &expose_by(&scene(), drop)).unwrap();
            assert!((ev.synthesis - drop).abs() < 0.03, "{drop}: {ev:?}");
        }
        // Near black, sRGB and the power 2.2 differ.
        let ev = PairEv::measure(&scene(), &expose_by(&scene(), 6.0)).unwrap();
        assert!(ev.mean < 5.5, "{ev:?}");
    }

    #[test]
    fn identical_images_differ_by_zero() {
        let same = PairEv { mean: 0.0, median: Some(0.0), synthesis: 0.0 };
        assert_eq!(PairEv::measure(&scene(), &scene()), Some(same));
    }

    #[test]
    fn swapped_images_have_negative_drop() {
        let swapped = PairEv::measure(&darker(&scene(), 3.0), &scene()).unwrap();
        assert!((swapped.mean + 3.0).abs() < 0.03, "{swapped:?}");
    }

    #[test]
    fn bright_spots_lower_only_mean() {
        let mut low = darker(&scene(), 3.0);
        for code in low.samples_mut().iter_mut().step_by(40) {
            *code = 255;
        }
        let ev = PairEv::measure(&scene(), &low).unwrap();
        assert!(ev.median.unwrap() - ev.mean > 0.2, "{ev:?}");
    }

    #[test]
    fn image_sizes_may_differ() {
        let small = Rgb::new(1, 2, vec![128; 6]).unwrap();
        let large = Rgb::new(4, 4, vec![64; 48]).unwrap();
        let ev = PairEv::measure(&small, &large).unwrap();
        let exact = libm::log2(srgb_to_linear(128.0 / 255.0) / srgb_to_linear(64.0 / 255.0));
        assert!((ev.mean - exact).abs() < 1e-9 && (ev.median.unwrap() - exact).abs() < 1e-9);
    }

    #[test]
    fn black_images_have_no_drop() {
        let grey = Rgb::new(1, 2, vec![128; 6]).unwrap();
        let black = Rgb::black(2, 2);
        assert_eq!(PairEv::measure(&grey, &black), None);
        assert_eq!(PairEv::measure(&black, &grey), None);
    }
}
