//! Lamps that drift: the second frame of each pair has more light than the first.

use super::sensor::{Sensor, Shots, WHITE};
use super::{Bench, check_rows, measured, number, write};

const SIDE: usize = 256;

/// Light that drifts and falls off towards the corners is taken for noise neither in K nor between neighbours. The frames are
/// unevenly lit by 25 %, so that a drift of 4.9 % without compensation makes K 7 % too large where noise is smallest.
#[test]
fn a_drifting_lamp_leaves_gain_as_it_is() {
    let rows: Vec<(f64, f32)> = [0.0939, 0.7513]
        .into_iter()
        .flat_map(|gain| [0.0, 0.03, 0.049, -0.049].map(|drift| (gain, drift)))
        .collect();
    check_rows(rows, |(gain, drift)| {
        let sensor = Sensor::new("sony-a7s2", gain, SIDE, 5);
        let bench = Bench::new();
        write(&bench, "lamp", &Shots::take_drifting(&sensor, 4, 2, drift));
        let found = measured(&bench, &format!("lamp --white {WHITE}"));
        let setting = &found["settings"][0];
        let error = number(setting, "/gain/value") / sensor.state.system_gain - 1.0;
        let bend = number(setting, "/bend");
        assert!(error.abs() < 0.008, "K {gain}, {drift}: {error:+.4}");
        assert!(bend.abs() < 0.03, "K {gain}, {drift}: bends by {bend:+.4}");
        let warnings = found["warnings"].as_array().unwrap();
        let expected = if drift == 0.0 { 0 } else { 10 };
        assert_eq!(warnings.len(), expected, "{warnings:?}");
    });
}
