//! The figures of `src/docs/camera.md` that no command of the program makes: errors by number of frames, and times.
//! They take minutes: `cargo test --release --test program calibrate::measure -- --ignored --nocapture`.

#![expect(clippy::print_stdout, reason = "the measured figures")]

use std::time::Instant;

use super::sensor::{Form, Sensor, Shots, WHITE};
use super::{Bench, measured, number, truths};

/// Runs of each row.
const RUNS: u64 = 4;

/// Root mean square errors for the five built-in cameras at a low, a middle and a high gain, by number of frames.
#[test]
#[ignore = "measures"]
fn errors_by_number_of_frames() {
    println!("| camera | K | bias frames | pairs | K % | σ_TL % (mean) | λ | σ_row % | bias ADU | warnings |");
    for camera in ["sony-a7s2", "nikon-d850", "canon-eos-5d4", "canon-eos-70d", "canon-eos-700d"] {
        for gain in [0.15, 0.8, 5.0] {
            for (bias, pairs) in [(2, 1), (10, 2), (40, 4)] {
                row(camera, gain, bias, pairs);
            }
        }
    }
}

fn row(camera: &str, gain: f64, bias: usize, pairs: usize) {
    let mut squares = [0.0; 5];
    let mut scale_off = 0.0;
    let mut warnings = Vec::new();
    for run in 0..RUNS {
        let sensor = Sensor::new(camera, gain, 512, 100 + run);
        let bench = Bench::new();
        let shots = Shots::take(&sensor, bias, pairs);
        shots.write(&bench.path("camera/iso800"), Form::Pgm);
        let found = measured(&bench, &format!("camera --white {WHITE} --black 512"));
        warnings.extend(found["warnings"].as_array().unwrap().clone());
        let setting = &found["settings"][0];
        for (sum, (name, truth, _)) in squares.iter_mut().zip(truths(&sensor)) {
            let scale = if name == "read_shape" { 1.0 } else { truth / 100.0 };
            let value = number(setting, &format!("/{name}/value"));
            *sum += ((value - truth) / scale).powi(2) / RUNS as f64;
            if name == "read_scale" {
                scale_off += (value - truth) / scale / RUNS as f64;
            }
        }
        let off = sensor
            .state
            .bias
            .iter()
            .enumerate()
            .map(|(plane, truth)| (number(setting, &format!("/bias/{plane}/value")) - truth).abs());
        squares[4] += off.fold(0.0, f64::max).powi(2) / RUNS as f64;
    }
    let [gain_error, scale, shape, row, offset] = squares.map(f64::sqrt);
    println!(
        "| {camera} | {gain} | {bias} | {pairs} | {gain_error:.2} | {scale:.2} ({scale_off:+.2}) | {shape:.4} | {row:.1} | {offset:.3} | {} |",
        warnings.len()
    );
    for warning in warnings {
        println!("  {warning}");
    }
}

/// A recording of seven settings of the default size, and one setting of 24 megapixels.
#[test]
#[ignore = "measures"]
fn calibration_time_by_size() {
    let bench = Bench::new();
    for index in 0..7 {
        let gain = 0.0939 * f64::from(1 << index);
        let shots = Shots::take(&Sensor::new("sony-a7s2", gain, 512, 20 + index), 10, 2);
        for (name, form) in [("pgm", Form::Pgm), ("png", Form::Png)] {
            shots.write(&bench.path(&format!("{name}/iso{}", 100 << index)), form);
        }
    }
    let large = Sensor::new("sony-a7s2", 0.7513, 4900, 30);
    Shots::take(&large, 10, 2).write(&bench.path("large/iso800"), Form::Pgm);
    for name in ["pgm", "png", "large"] {
        for threads in [1, 2] {
            let start = Instant::now();
            measured(&bench, &format!("{name} --white {WHITE} --threads {threads}"));
            println!("{name}, {threads} threads: {:.2} s", start.elapsed().as_secs_f64());
        }
    }
}
