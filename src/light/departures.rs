//! Measures the effects of choices that the paper leaves open, and compares them with the table in
//! `src/docs/method.md`.
//!
//! The frame is a flat grey; the camera has the middle of each range (K 0.7746, r 200, brightness gain 1.25).

use rayon::prelude::*;

use super::camera::CameraState;
use super::camera::tests::median;
use super::clean;
use super::draws::{Component, NoiseKey};
use super::noise_profile::{Amplify, Tone};
use super::raw::noise::Term;
use super::raw::{Bayer, Developer, Plane, noise, unprocess};
use darkqa_base::types::images::Isa;
use darkqa_base::types::{FrameId, Rgb, Severity};

const SIZE: usize = 512;

fn key() -> NoiseKey {
    NoiseKey::new(1, &FrameId("departures".to_owned()))
}

/// The noisy RAW image of a flat grey.
fn raw(code: u8, amplify: Amplify, terms: &[Term]) -> Bayer {
    let grey = Rgb::new(SIZE, SIZE, vec![code; SIZE * SIZE * 3]).unwrap();
    let mut raw = unprocess(&grey, &median());
    noise::add(&mut raw, &median(), &key(), amplify, terms);
    raw
}

/// Display values of a RAW image before the exposure drop, as red, green, blue of each pixel.
fn display(mut raw: Bayer, state: &CameraState) -> Vec<f32> {
    let developer = Developer::new(state, Tone::None, Isa::best());
    raw.lines_mut().enumerate().for_each(|(row, mut line)| {
        developer.balance(row, &mut line);
        line.repeat_edges();
    });
    let mut values = vec![0.0; SIZE * SIZE * 3];
    for (row, values) in values.chunks_mut(SIZE * 3).enumerate() {
        developer.display(&raw, row, values);
    }
    values
}

/// Mean of each channel.
fn means(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (i, value) in values.enumerate() {
        sums[i % 3] += value;
    }
    sums.map(|sum| sum / (SIZE * SIZE) as f64)
}

/// Mean linear light of each channel before the exposure drop.
fn light(raw: Bayer, state: &CameraState) -> [f64; 3] {
    let values = display(raw, state);
    means(values.iter().map(|value| clean::gamma_expand(f64::from(*value))))
}

fn quotient(one: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|channel| one[channel] / other[channel])
}

/// Mean linear light of grey 16 with noise, relative to grey 16 without noise.
fn shadow_lift(amplify: Amplify) -> [f64; 3] {
    let clean = light(raw(16, amplify, &[]), &median());
    quotient(light(raw(16, amplify, &Term::ALL), &median()), clean)
}

/// [`shadow_lift`] without clipping.
fn shadow_lift_without_clipping(amplify: Amplify) -> [f64; 3] {
    let [noisy, clean] = [&Term::ALL[..], &[]].map(|terms| {
        let state = median();
        let raw = raw(16, amplify, terms);
        // All steps are linear, so that the means of the planes are sufficient.
        let mut planes = [0.0; 4];
        for row in 0..SIZE {
            for column in 0..SIZE {
                planes[Plane::at(row, column) as usize] += f64::from(raw.sample(row, column));
            }
        }
        let [red, gr, gb, blue] = planes.map(|sum| 4.0 * state.rgb_gain * sum / (SIZE * SIZE) as f64);
        let camera = [state.red_gain * red, f64::midpoint(gr, gb), state.blue_gain * blue];
        state.camera_to_rgb.map(|row| row.iter().zip(camera).map(|(weight, x)| weight * x).sum())
    });
    quotient(noisy, clean)
}

/// Standard deviation of the codes of an image at L1.
fn deviation(raw: Bayer) -> [f64; 3] {
    let values = display(raw, &median());
    let mut codes = vec![0; values.len()];
    let developer = Developer::new(&median(), Tone::None, Isa::best());
    developer.encode(&values, developer.factor(Severity::L1.value()), &mut codes);
    let mean = means(codes.iter().map(|code| f64::from(*code)));
    let squares =
        means(codes.iter().map(|code| f64::from(*code)).enumerate().map(|(i, code)| (code - mean[i % 3]).powi(2)));
    squares.map(f64::sqrt)
}

/// Standard deviation of grey 128 with one noise term.
fn deviation_of_term(amplify: Amplify, term: Term) -> [f64; 3] {
    deviation(raw(128, amplify, &[term]))
}

/// Standard deviation of grey 128 with only amplified row noise, if `rows` sensor rows share one draw.
fn banding(rows: usize) -> [f64; 3] {
    let state = median();
    let mut raw = raw(128, Amplify::All, &[]);
    let stream = key().stream(Component::Row);
    raw.lines_mut().enumerate().for_each(|(row, mut line)| {
        let offset = noise::row(state.row_deviation, stream, row / rows);
        let offset = offset * (state.ratio / state.adu_range) as f32;
        for plane in line.planes() {
            for sample in plane.as_flattened_mut() {
                *sample += offset;
            }
        }
    });
    deviation(raw)
}

/// The rows of the table: a name, and the figures of red, green and blue.
fn documented_figures() -> Vec<(String, [f64; 3])> {
    let place = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/method.md");
    let page = std::fs::read_to_string(place).unwrap();
    page.lines()
        .filter_map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let [_, name, red, green, blue, _] = cells[..] else {
                return None;
            };
            let figures: Vec<f64> = [red, green, blue]
                .iter()
                .map(|cell| cell.trim_start_matches('×').parse().ok())
                .collect::<Option<_>>()?;
            Some((name.to_owned(), figures.try_into().ok()?))
        })
        .collect()
}

/// The tolerance is two units of the last digit, or three per cent.
#[test]
fn documented_effects_equal_the_measured_ones() {
    let clean_128 = raw(128, Amplify::All, &[]);
    let without_brightness = CameraState { rgb_gain: 1.0, ..median() };
    let (paper, eld) = (Amplify::ShotOnly, Amplify::All);
    let found = [
        (
            "light, if the brightness gain were left out",
            quotient(light(clean_128.clone(), &without_brightness), light(clean_128, &median())),
        ),
        ("light of grey 16, `paper`", shadow_lift(paper)),
        ("light of grey 16, `paper`, nothing clipped", shadow_lift_without_clipping(paper)),
        ("light of grey 16, `eld`", shadow_lift(eld)),
        ("light of grey 16, `eld`, nothing clipped", shadow_lift_without_clipping(eld)),
        ("shot noise alone, `paper` and `eld`", deviation_of_term(paper, Term::Shot)),
        ("read noise alone, `paper`", deviation_of_term(paper, Term::Read)),
        ("row noise alone, `paper`", deviation_of_term(paper, Term::Row)),
        ("quantisation noise alone, `paper`", deviation_of_term(paper, Term::Quantisation)),
        ("read noise alone, `eld`", deviation_of_term(eld, Term::Read)),
        ("row noise alone, `eld`", deviation_of_term(eld, Term::Row)),
        ("quantisation noise alone, `eld`", deviation_of_term(eld, Term::Quantisation)),
        ("row noise shared by two sensor rows, `eld`", banding(2)),
    ];
    let documented = documented_figures();
    let mut off = Vec::new();
    for (name, found) in found {
        let row = documented.iter().find(|(documented, _)| documented == name);
        let is_off = row.is_none_or(|(_, stated)| {
            [0, 1, 2].iter().any(|channel: &usize| {
                let (found, stated) = (found[*channel], stated[*channel]);
                (found - stated).abs() > f64::max(0.03 * stated, 0.02)
            })
        });
        if is_off {
            off.push(format!("| {name} | {found:.3?} | {row:?}"));
        }
    }
    assert!(off.is_empty(), "\n{}", off.join("\n"));
}

/// [`banding`] with one draw per sensor row equals the row noise of the pipeline.
#[test]
fn row_noise_is_drawn_for_each_sensor_row() {
    let pipeline = deviation(raw(128, Amplify::All, &[Term::Row]));
    for (found, expected) in pipeline.iter().zip(banding(1)) {
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}
