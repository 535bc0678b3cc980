//! Lamps that drift: the second frame of each pair has more light than the first.

use serde_json::Value;

use super::sensor::{Sensor, Shots, WHITE};
use super::{Bench, check_rows, measured, number, refused, write};

const SIDE: usize = 256;

/// What is measured of a sensor at this gain, if the second frame of each pair has more light by a share.
fn under(gain: f64, drift: f32) -> Value {
    let sensor = Sensor::new("sony-a7s2", gain, SIDE, 5);
    let bench = Bench::new();
    write(&bench, "lamp", &Shots::take_drifting(&sensor, 4, 2, drift));
    measured(&bench, &format!("lamp --white {WHITE}"))
}

/// Light that drifts and falls off towards the corners is taken for noise neither in K nor between neighbours. The
/// frames fall off by 25 %: without compensation, 3 % more light makes neighbours correlate by more than is allowed at
/// both gains, and 4.9 % makes K 7 % too large at the lower one.
#[test]
fn drifting_lamp_keeps_gain() {
    check_rows([0.0939, 0.7513], |gain| {
        let steady = under(gain, 0.0);
        assert_eq!(steady["warnings"], Value::Array(Vec::new()));
        let measured_gain = |found: &Value| number(found, "/settings/0/gain/value");
        let truth = Sensor::new("sony-a7s2", gain, SIDE, 5).state.system_gain;
        let error = measured_gain(&steady) / truth - 1.0;
        assert!(error.abs() < 0.004, "K {gain}: {error:+.5}");
        for drift in [0.03, 0.049, -0.049] {
            let found = under(gain, drift);
            let change = measured_gain(&found) / measured_gain(&steady) - 1.0;
            assert!(change.abs() < 5e-4, "K {gain}, {drift}: {change:+.5}");
            let bend = number(&found, "/settings/0/bend");
            assert!(bend.abs() < 0.02, "K {gain}, {drift}: {bend:+.4}");
            // A line for each pair, and no other doubt.
            let warnings = found["warnings"].as_array().unwrap();
            let word = if drift < 0.0 { " % less light;" } else { " % more light;" };
            assert!(
                warnings.len() == 10 && warnings.iter().all(|line| line.as_str().unwrap().contains(word)),
                "{warnings:?}"
            );
        }
    });
}

/// Frames whose light differs by more than 5 % are no pair.
#[test]
fn pairs_of_unequal_light_are_refused() {
    for (drift, part) in [(0.06, "6.0 % more light"), (-0.06, "6.0 % less light")] {
        let sensor = Sensor::new("sony-a7s2", 0.7513, SIDE, 3);
        let bench = Bench::new();
        write(&bench, "lamp", &Shots::take_drifting(&sensor, 2, 1, drift));
        let message = refused(&bench, &format!("lamp --white {WHITE}"));
        for part in [
            "flat-0/00.pgm: ",
            "flat-0/01.pgm has ",
            part,
            " than this frame; the two frames of a pair must have equal light (limit 5 %)",
        ] {
            assert!(message.contains(part), "{message}");
        }
    }
}
