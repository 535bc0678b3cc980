//! Effect of the choices that the paper does not state: the figures of the table in `src/docs/method.md`, measured.
//!
//! The camera is the middle of its ranges (K 0.7746, r 200, brightness gain 1.25), the frame a flat grey.

use rayon::prelude::*;

use super::camera::CameraState;
use super::camera::tests::median;
use super::curve;
use super::draws::{Component, NoiseKey};
use super::noise_profile::{Amplify, Tone};
use super::raw::noise::{self, Term};
use super::raw::{Bayer, Developer, Plane, unprocess};
use darkqa_ground::types::images::Isa;
use darkqa_ground::types::{FrameId, Rgb, Severity};

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
    means(
        values
            .iter()
            .map(|value| curve::gamma_expand(f64::from(*value))),
    )
}

fn quotient(one: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|channel| one[channel] / other[channel])
}

/// Mean linear light of a noisy grey 16, relative to the one without noise.
fn lifted(amplify: Amplify) -> [f64; 3] {
    let clean = light(raw(16, amplify, &[]), &median());
    quotient(light(raw(16, amplify, &Term::ALL), &median()), clean)
}

/// The same if nothing were clipped: all steps are linear, so the means of the planes decide.
fn lifted_without_clipping(amplify: Amplify) -> [f64; 3] {
    let state = median();
    let light = |terms: &[Term]| {
        let raw = raw(16, amplify, terms);
        let mut planes = [0.0; 4];
        for row in 0..SIZE {
            for column in 0..SIZE {
                planes[Plane::at(row, column) as usize] += f64::from(raw.sample(row, column));
            }
        }
        let [red, gr, gb, blue] =
            planes.map(|sum| 4.0 * state.rgb_gain * sum / (SIZE * SIZE) as f64);
        let camera = [
            state.red_gain * red,
            f64::midpoint(gr, gb),
            state.blue_gain * blue,
        ];
        state
            .camera_to_rgb
            .map(|row| row.iter().zip(camera).map(|(weight, x)| weight * x).sum())
    };
    quotient(light(&Term::ALL), light(&[]))
}

/// Standard deviation of the codes of an image at L1.
fn deviation(raw: Bayer) -> [f64; 3] {
    let values = display(raw, &median());
    let mut codes = vec![0; values.len()];
    let developer = Developer::new(&median(), Tone::None, Isa::best());
    developer.encode(&values, developer.factor(Severity::L1.value()), &mut codes);
    let codes = || codes.iter().map(|code| f64::from(*code));
    let mean = means(codes());
    let squares = means(
        codes()
            .enumerate()
            .map(|(i, code)| (code - mean[i % 3]).powi(2)),
    );
    squares.map(f64::sqrt)
}

/// The deviation of grey 128 with row noise alone, amplified, if `rows` sensor rows share one draw.
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
fn documented() -> Vec<(String, [f64; 3])> {
    let place = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/method.md");
    let page = std::fs::read_to_string(place).unwrap();
    page.lines()
        .filter_map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let [_, name, red, green, blue, _] = cells[..] else {
                return None;
            };
            let figure = |cell: &str| cell.trim_start_matches('×').parse().ok();
            Some((
                name.to_owned(),
                [figure(red)?, figure(green)?, figure(blue)?],
            ))
        })
        .collect()
}

/// Two units of the last digit, or three per cent.
#[test]
fn the_effects_of_the_departures_are_measured() {
    let clean = |state: &CameraState| light(raw(128, Amplify::All, &[]), state);
    let without_brightness = CameraState {
        rgb_gain: 1.0,
        ..median()
    };
    let alone = |amplify, term| deviation(raw(128, amplify, &[term]));
    let (paper, eld) = (Amplify::ShotOnly, Amplify::All);
    let found = [
        (
            "light, if the brightness gain were left out",
            quotient(clean(&without_brightness), clean(&median())),
        ),
        ("light of grey 16, `paper`", lifted(paper)),
        (
            "light of grey 16, `paper`, nothing clipped",
            lifted_without_clipping(paper),
        ),
        ("light of grey 16, `eld`", lifted(eld)),
        (
            "light of grey 16, `eld`, nothing clipped",
            lifted_without_clipping(eld),
        ),
        (
            "shot noise alone, `paper` and `eld`",
            alone(paper, Term::Shot),
        ),
        ("read noise alone, `paper`", alone(paper, Term::Read)),
        ("row noise alone, `paper`", alone(paper, Term::Row)),
        (
            "quantisation noise alone, `paper`",
            alone(paper, Term::Quantisation),
        ),
        ("read noise alone, `eld`", alone(eld, Term::Read)),
        ("row noise alone, `eld`", alone(eld, Term::Row)),
        (
            "quantisation noise alone, `eld`",
            alone(eld, Term::Quantisation),
        ),
        ("row noise shared by two sensor rows, `eld`", banding(2)),
    ];
    let documented = documented();
    let mut off = Vec::new();
    for (name, found) in found {
        let row = documented.iter().find(|(documented, _)| documented == name);
        let is_off =
            |(found, stated): (&f64, &f64)| (found - stated).abs() > f64::max(0.03 * stated, 0.02);
        if row.is_none_or(|(_, stated)| found.iter().zip(stated).any(is_off)) {
            off.push(format!("| {name} | {found:.3?} | {row:?}"));
        }
    }
    assert!(off.is_empty(), "\n{}", off.join("\n"));
}

/// The table's test draws one number for each sensor row, as the pipeline does.
#[test]
fn row_noise_is_drawn_for_each_sensor_row() {
    let pipeline = deviation(raw(128, Amplify::All, &[Term::Row]));
    for (found, expected) in pipeline.iter().zip(banding(1)) {
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}
