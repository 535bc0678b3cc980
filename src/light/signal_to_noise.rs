//! Tests of the signal-to-noise ratio of flat greys by level and noise profile: RAW samples against a formula, and
//! codes against the documentation.
//!
//! For a sample y in ADU and v = σ_TL² · var(λ) + σ_row² + 1/12, the variance of the noise is r · K · y + v, or r · K ·
//! y + r² · v if r amplifies all terms. If less light means fewer photons, r is 2^ΔEV.

use super::camera::{CameraModel, CameraState, Sampling};
use super::raw::noise::{self, Term};
use super::raw::{Plane, unprocess};
use super::{Amplify, Negative, NoiseKey, NoiseProfile, Synthesis};
use darkqa_base::types::{FrameId, Rgb, Severity};

const SIZE: usize = 256;

/// Codes of flat greys with 18 % and 50 % of linear light.
const GREYS: [u8; 2] = [117, 186];

/// Variance of a Tukey-λ variable of scale 1 (Joiner and Rosenblatt 1971, J. Am. Stat. Assoc. 66:394).
fn tukey_variance(shape: f64) -> f64 {
    if shape.abs() < 1e-12 {
        return std::f64::consts::PI.powi(2) / 3.0;
    }
    let gamma = libm::tgamma;
    let middle = gamma(shape + 1.0).powi(2) / gamma(2.0 * shape + 2.0);
    2.0 / (shape * shape) * (1.0 / (1.0 + 2.0 * shape) - middle)
}

/// The noise profile with the camera in the middle of its ranges and gain K.
fn fixed(reading: NoiseProfile, gain: f64) -> Synthesis {
    let mut camera = CameraModel::default();
    camera.set_sampling(Sampling::Fixed);
    camera.pin_gain(gain).unwrap();
    Synthesis::new(reading, camera)
}

fn flat(code: u8) -> Rgb {
    Rgb::new(SIZE, SIZE, vec![code; SIZE * SIZE * 3]).unwrap()
}

fn key(code: u8) -> NoiseKey {
    NoiseKey::new(1, &FrameId(format!("grey {code}")))
}

/// Mean and standard deviation.
fn moments(numbers: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let n = numbers.clone().count() as f64;
    let mean = numbers.clone().sum::<f64>() / n;
    let variance = numbers.map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
    [mean, variance.sqrt()]
}

/// The ratio by formula for a sample of `y` ADU.
fn expected_ratio(amplify: Amplify, state: &CameraState, y: f64) -> f64 {
    let after = state.read_scale.powi(2) * tukey_variance(state.read_shape) + state.row_deviation.powi(2) + 1.0 / 12.0;
    let amplified = match amplify {
        Amplify::ShotOnly => 1.0,
        Amplify::All => state.ratio * state.ratio,
    };
    y / (state.ratio * state.system_gain * y + amplified * after).sqrt()
}

/// The ratio of green RAW samples: measured, and by formula.
fn raw_ratios(reading: NoiseProfile, gain: f64, code: u8, level: Severity) -> [f64; 2] {
    let synthesis = fixed(reading, gain);
    let state = synthesis.state(&key(code), level);
    let mut raw = unprocess(&flat(code), &state);
    let y = f64::from(raw.sample(0, 1)) * state.adu_range;
    noise::add(&mut raw, &state, &key(code), synthesis.amplify, &Term::ALL);
    // Only one of the two green planes is used, because each has its own offset.
    assert_eq!(Plane::at(0, 1), Plane::Gr);
    let greens = (0..SIZE / 2)
        .flat_map(|row| (0..SIZE / 2).map(move |column| [row, column]))
        .map(|[row, column]| f64::from(raw.sample(2 * row, 2 * column + 1)));
    let [_, deviation] = moments(greens);
    [y / (deviation * state.adu_range), expected_ratio(synthesis.amplify, &state, y)]
}

/// The ratio of green codes: mean over standard deviation.
fn code_ratio(reading: NoiseProfile, gain: f64, code: u8, level: Severity) -> f64 {
    let synthesis = fixed(reading, gain);
    let image = Negative::new(&flat(code), &key(code), &synthesis, level).develop(level);
    let greens = image.samples().iter().skip(1).step_by(3);
    let [mean, deviation] = moments(greens.map(|green| f64::from(*green)));
    mean / deviation
}

/// K 0.7746, the middle of the paper's range.
fn middle_gain() -> f64 {
    0.6_f64.sqrt()
}

#[test]
fn raw_ratios_follow_the_formula() {
    for reading in NoiseProfile::ALL {
        for grey in GREYS {
            let falls: Vec<f64> = Severity::LADDER
                .map(|level| {
                    let [found, expected] = raw_ratios(reading, middle_gain(), grey, level);
                    let name = reading.name();
                    assert!(
                        (found / expected - 1.0).abs() < 0.03,
                        "{name}, {grey}, {level:?}: {found} against {expected}"
                    );
                    found
                })
                .windows(2)
                .map(|pair| pair[0] / pair[1])
                .collect();
            match reading {
                NoiseProfile::Paper | NoiseProfile::Eld => {
                    assert!(falls.iter().all(|fall| (fall - 1.0).abs() < 0.01));
                }
                // The ratio falls at least with the square root of the light.
                NoiseProfile::Level | NoiseProfile::Physical => {
                    let steps = Severity::LADDER.windows(2).map(|pair| pair[1].value() - pair[0].value());
                    for (fall, step) in falls.iter().zip(steps) {
                        let root = libm::exp2(step / 2.0);
                        assert!(*fall > 0.98 * root, "{reading:?}: {fall} against {root}");
                    }
                }
            }
        }
    }
}

/// The formula of another profile is off by far more than the tolerance of the test above.
#[test]
fn the_formula_distinguishes_profiles() {
    let (grey, level) = (GREYS[0], Severity::L5);
    let [paper, _] = raw_ratios(NoiseProfile::Paper, middle_gain(), grey, level);
    for other in [NoiseProfile::Eld, NoiseProfile::Level, NoiseProfile::Physical] {
        let [_, expected] = raw_ratios(other, middle_gain(), grey, level);
        assert!((paper / expected - 1.0).abs() > 0.2, "{other:?}");
    }
}

/// The rows of the table in `src/docs/light.md`: the name of a noise profile, and RAW and code ratios at L1 to L5 of
/// both greys.
fn documented_ratios() -> Vec<(String, [[f64; 5]; 4])> {
    let place = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/light.md");
    let page = std::fs::read_to_string(place).unwrap();
    page.lines()
        .filter_map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let [_, name, numbers @ .., _] = &cells[..] else {
                return None;
            };
            let numbers: Vec<[f64; 5]> = numbers
                .iter()
                .map(|cell| -> Option<[f64; 5]> {
                    cell.split(' ').map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>()?.try_into().ok()
                })
                .collect::<Option<_>>()?;
            Some((name.trim_matches('`').to_owned(), numbers.try_into().ok()?))
        })
        .collect()
}

/// The tolerance is 2 %, because the numbers of the page have two or three digits.
#[test]
fn documented_ratios_equal_the_measured_ones() {
    let mut off = Vec::new();
    let documented = documented_ratios();
    let names = NoiseProfile::ALL.map(|reading| reading.name().to_string());
    assert!(documented.iter().map(|(name, _)| name).eq(&names));
    for (reading, (_, rows)) in NoiseProfile::ALL.into_iter().zip(documented) {
        let raw = GREYS.map(|grey| Severity::LADDER.map(|level| raw_ratios(reading, middle_gain(), grey, level)[0]));
        let code = GREYS.map(|grey| Severity::LADDER.map(|level| code_ratio(reading, middle_gain(), grey, level)));
        for (found, row) in raw.iter().chain(&code).zip(rows) {
            if found.iter().zip(row).any(|(found, stated)| f64::abs(found / stated - 1.0) > 0.02) {
                off.push(format!("{reading:?} {found:.2?}, stated {row:?}"));
            }
        }
    }
    assert!(off.is_empty(), "\n{}", off.join("\n"));
}
