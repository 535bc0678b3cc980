//! Recordings that spoil the numbers: each is refused, or named, by a message of its own.

use std::fs;
use std::sync::LazyLock;

use serde_json::Value;

use super::sensor::{BLACK, Form, Sensor, Shots, WHITE};
use super::{Bench, check_rows, measured, number, refused, write};
use crate::support::snapshot::redacted;

const SIDE: usize = 256;

/// A small recording: 4 bias frames, and one pair at each of 5 exposures.
static SMALL: LazyLock<(Sensor, Shots)> = LazyLock::new(|| {
    let sensor = Sensor::new("sony-a7s2", 0.7513, SIDE, 3);
    let shots = Shots::take(&sensor, 4, 1);
    (sensor, shots)
});

/// Codes from an expression of the light above black, cut to the range of codes.
fn code(light: f64) -> u16 {
    (f64::from(BLACK) + light).clamp(0.0, 65535.0) as u16
}

fn light(code: u16) -> f64 {
    f64::from(code) - f64::from(BLACK)
}

fn flats(change: impl Fn(usize, usize, u16) -> u16) -> Shots {
    let mut shots = SMALL.1.clone();
    for (exposure, frames) in shots.flats.iter_mut().enumerate() {
        for (index, frame) in frames.iter_mut().enumerate() {
            for sample in frame {
                *sample = change(exposure, index, *sample);
            }
        }
    }
    shots
}

fn bias(change: impl Fn(usize, usize, u16) -> u16) -> Shots {
    let mut shots = SMALL.1.clone();
    for (index, frame) in shots.bias.iter_mut().enumerate() {
        for (site, sample) in frame.iter_mut().enumerate() {
            *sample = change(index, site, *sample);
        }
    }
    shots
}

/// Each row and its left neighbour of the same colour, averaged.
fn smoothed(frame: &[u16]) -> Vec<u16> {
    frame.chunks(SIDE).flat_map(|row| (0..SIDE).map(|x| row[x].midpoint(row[(x + SIDE - 2) % SIDE]))).collect()
}

fn found(name: &str, shots: &Shots) -> Value {
    let bench = Bench::new();
    write(&bench, name, shots);
    measured(&bench, &format!("{name} --white {WHITE}"))
}

fn warnings(found: &Value) -> Vec<&str> {
    let warnings = found["warnings"].as_array().unwrap();
    warnings.iter().map(|line| line.as_str().unwrap()).collect()
}

#[test]
fn a_sound_recording_gives_no_warning() {
    let found = found("sound", &SMALL.1);
    assert_eq!(warnings(&found), [""; 0]);
}

#[test]
fn useless_recordings_are_refused() {
    let small = &SMALL.1;
    // The second frame of each pair is the first of the next exposure.
    let mut unpaired = small.clone();
    for exposure in 0..4 {
        unpaired.flats[exposure][1] = small.flats[exposure + 1][0].clone();
    }
    let compressed = |share: f64| {
        small.each(|frame| {
            let bent = |x: f64| x - share * x * x / f64::from(WHITE - BLACK);
            frame.iter().map(|sample| code(bent(light(*sample)))).collect()
        })
    };
    let rows: Vec<(&str, Shots, &[&str])> = vec![
        (
            "cut",
            small.each(|frame| frame.iter().map(|sample| sample.saturating_sub(BLACK)).collect()),
            &["bias/00.pgm: 4", "bias frames must keep negative noise; export without subtracting"],
        ),
        ("unpaired", unpaired, &["flat-0/00.pgm: ", "flat-0/01.pgm has ", " % more light"]),
        ("smoothed", small.each(smoothed), &["bias/00.pgm: not raw", "neighbours of one colour correlates by 0."]),
        (
            "smoothed flats",
            Shots { bias: small.bias.clone(), ..small.each(smoothed) },
            &["flat-0/00.pgm: not raw", "smoothed or resized"],
        ),
        ("compressed", compressed(0.12), &["photon transfer bends by -", "not linear"]),
        (
            "clipped",
            small.each(|frame| frame.iter().map(|sample| (*sample).min(1800)).collect()),
            &[
                "2 of 5 exposures can be used, at least 3 are needed",
                "exposure 2: clipped, 99.9 % of a colour are at code 1800, the greatest, where white is 16383",
            ],
        ),
        (
            "leak",
            bias(|_, site, sample| sample + (4 * (site % SIDE) / SIDE) as u16),
            &["bias: light on bias frames", "close the lens"],
        ),
        (
            "hot",
            bias(|_, site, sample| sample + if site % 150 == 7 { 200 } else { 0 }),
            &["0.67 % of the pixels are hot (limit 0.5 %)"],
        ),
        (
            "multiplied",
            small.each(|frame| frame.iter().map(|sample| (sample & 0x0FFF) * 4).collect()),
            &["every code is a multiple of 4"],
        ),
        ("constant", bias(|index, site, _| BLACK + u16::from(site == index)), &["noise"]),
    ];
    check_rows(rows, |(name, shots, parts)| {
        let bench = Bench::new();
        let name = name.replace(' ', "-");
        write(&bench, &name, &shots);
        let message = refused(&bench, &format!("{name} --white {WHITE}"));
        for part in parts {
            assert!(message.contains(part), "{name}: {message}");
        }
    });
}

#[test]
fn doubtful_recordings_are_named() {
    let small = &SMALL.1;
    let compressed = small.each(|frame| {
        let bent = |x: f64| x - 0.05 * x * x / f64::from(WHITE - BLACK);
        frame.iter().map(|sample| code(bent(light(*sample)))).collect()
    });
    let rows: Vec<(&str, Shots, &str)> = vec![
        ("compressed", compressed, "photon transfer bends by -"),
        (
            "clipped",
            flats(|_, _, sample| sample.min(7000)),
            "exposure 4: clipped, 100.0 % of a colour are at code 7000, the greatest, where white is 16383; left out",
        ),
        (
            "clipped low",
            flats(|_, _, sample| sample.min(7000)),
            "exposure 4 is clipped at 7000, far below white, 16383",
        ),
        ("dark current", flats(|_, _, sample| sample + 40), "photon transfer does not pass through 0"),
    ];
    check_rows(rows, |(name, shots, part)| {
        let found = found(&name.replace(' ', "-"), &shots);
        let warnings = warnings(&found);
        assert!(warnings.iter().any(|line| line.contains(part)), "{name}: {warnings:?}");
    });
}

/// Dark frames of the exposures say what the bias frames do not.
#[test]
fn dark_frames_explain_an_offset() {
    let shots = flats(|_, _, sample| sample + 40);
    let bench = Bench::new();
    write(&bench, "dark", &shots);
    for exposure in 0..5 {
        for (index, frame) in SMALL.1.bias.iter().take(2).enumerate() {
            // Other frames for each exposure: the sites are turned.
            let mut frame: Vec<u16> = frame.iter().map(|sample| sample + 40).collect();
            frame.rotate_left(2 * SIDE * (exposure + 1));
            let path = bench.path(&format!("dark/iso800/dark-{exposure}/{index}.pgm"));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, Form::Pgm.encode(&frame, SIDE)).unwrap();
        }
    }
    let found = measured(&bench, &format!("dark --white {WHITE}"));
    assert_eq!(warnings(&found), [""; 0]);
    let gain = number(&found, "/settings/0/gain/value");
    assert!((gain / SMALL.0.state.system_gain - 1.0).abs() < 0.01, "{gain}");
}

/// Hot pixels are left out of everything; without that λ falls by 0.1.
#[test]
fn hot_pixels_are_masked_and_counted() {
    let hot = bias(|_, site, sample| sample + if site % 997 == 5 { 200 } else { 0 });
    let (plain, masked) = (found("plain", &SMALL.1), found("hot", &hot));
    assert_eq!(masked["settings"][0]["hot_pixels"], 66);
    insta::assert_snapshot!(redacted(warnings(&masked)[0]), @"iso800: 66 hot pixels (0.101 %) are left out");
    for (path, allowed) in [("read_shape", 0.003), ("read_scale", 0.004), ("gain", 0.002)] {
        let path = format!("/settings/0/{path}/value");
        let (a, b) = (number(&plain, &path), number(&masked, &path));
        assert!((a - b).abs() < allowed, "{path}: {a}, {b}");
    }
}

/// A fixed pattern is taken off from 16 bias frames on; fewer are warned about.
#[test]
fn fixed_pattern_is_removed_with_biases() {
    let (sensor, _) = &*SMALL;
    let shots = Shots::take(sensor, 16, 1);
    // A deviation of 1.9 ADU, where noise has 2.7: half of its variance.
    let mut state = 7_u64;
    let pattern: Vec<u16> = (0..SIDE * SIDE)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((state >> 33) % 7) as u16
        })
        .collect();
    let mut fixed = shots.clone();
    for frame in &mut fixed.bias {
        frame.iter_mut().zip(&pattern).for_each(|(sample, p)| *sample += p);
    }
    for frame in fixed.flats.iter_mut().flatten() {
        frame.iter_mut().zip(&pattern).for_each(|(sample, p)| *sample += p);
    }
    let scale = |found: &Value| number(found, "/settings/0/read_scale/value");
    let (plain, with_it) = (found("plain", &shots), found("fixed", &fixed));
    // The mean of 16 frames has noise of its own, which makes what is left a little more normal.
    let ratio = scale(&with_it) / scale(&plain);
    assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
    insta::assert_snapshot!(redacted(warnings(&with_it)[0]), @"
    iso800: a fixed pattern has 42 % of the variance of the noise: the mean of all bias frames is taken off; the
        model has no fixed pattern
    ");
    // What a mean takes with it is given back in both fits: without that, one would be 3 % smaller than the other.
    let plot = |found: &Value| number(found, "/settings/0/plot/scale") / scale(found);
    let ratio = plot(&with_it) / plot(&plain);
    assert!((ratio - 1.0).abs() < 0.015, "{ratio}");
    let few = Shots { bias: fixed.bias[..8].to_vec(), ..fixed };
    let few = found("few", &few);
    insta::assert_snapshot!(redacted(warnings(&few)[0]), @"
    iso800: a fixed pattern has 42 % of the variance of the noise: σ_TL holds it, too; with 16 bias frames or more
        their mean is taken off; the model has no fixed pattern
    ");
    assert!(scale(&few) > 1.1 * scale(&plain));
}

/// Row noise that cannot be seen is said so, and the camera file says that its line is of nothing.
#[test]
fn invisible_row_noise_is_named() {
    let mut silent = SMALL.1.clone();
    // The rows of both frames of a pair get one mean.
    for pair in silent.bias.chunks_mut(2) {
        let (first, second) = pair.split_at_mut(1);
        for (a, b) in first[0].chunks(SIDE).zip(second[0].chunks_mut(SIDE)) {
            let sum = |row: &[u16]| row.iter().map(|sample| i32::from(*sample)).sum::<i32>();
            let difference = sum(a) - sum(b);
            for site in 0..difference.unsigned_abs() as usize {
                let sample = &mut b[site % SIDE];
                *sample = sample.saturating_add_signed(difference.signum() as i16);
            }
        }
    }
    let bench = Bench::new();
    write(&bench, "silent", &silent);
    let found = measured(&bench, &format!("silent --white {WHITE}"));
    assert!(number(&found, "/settings/0/row_deviation/value").abs() < f64::EPSILON);
    let lines = warnings(&found);
    assert!(
        lines.len() == 1
            && lines[0].contains("row noise cannot be seen below about 0.1")
            && lines[0].contains("does not count in the line of σ_row"),
        "{lines:?}"
    );
    let text = fs::read_to_string(bench.path("camera.toml")).unwrap();
    assert!(text.contains("[row-deviation]\n# No setting has noise of this kind.\nslope = "), "{text}");
}

#[test]
fn settings_in_wrong_folders_are_named() {
    let bench = Bench::new();
    let at = |gain: f64, seed: u64| Shots::take(&Sensor::new("sony-a7s2", gain, SIDE, seed), 2, 1);
    let shots = [at(0.1879, 4), at(0.7513, 5), at(3.0053, 6), at(6.0106, 7)];
    let names = ["iso200", "iso800", "iso3200", "iso6400"];
    for (name, shots) in names.iter().zip(&shots) {
        shots.write(&bench.path(&format!("right/{name}")), Form::Pgm);
    }
    let found = measured(&bench, &format!("right --white {WHITE}"));
    assert_eq!(warnings(&found), [""; 0]);
    for (name, place) in names.iter().zip([0, 2, 1, 3]) {
        shots[place].write(&bench.path(&format!("mixed/{name}")), Form::Pgm);
    }
    let found = measured(&bench, &format!("mixed --white {WHITE}"));
    let lines = warnings(&found);
    assert!(lines.len() == 1 && lines[0].contains("iso3200: K 0.75"), "{lines:?}");
    assert!(lines[0].contains("is not above that of iso800"), "{lines:?}");
    for (index, (name, shots)) in names.iter().zip(&shots).enumerate() {
        let more = if index == 1 { 90 } else { 0 };
        let shots = shots.each(|frame| frame.iter().map(|sample| sample + more).collect());
        shots.write(&bench.path(&format!("other/{name}")), Form::Pgm);
    }
    let found = measured(&bench, &format!("other --white {WHITE}"));
    let lines = warnings(&found);
    assert!(lines.len() == 1, "{lines:?}");
    assert!(lines[0].contains("iso800: the offset of its bias frames, 60"), "{lines:?}");
}
