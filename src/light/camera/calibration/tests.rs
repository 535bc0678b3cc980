use super::*;

fn sony() -> Calibration {
    Calibration::preset("sony-a7s2").unwrap()
}

#[test]
fn presets_are_parsed_and_have_their_names() {
    for (name, text) in PRESETS {
        assert_eq!(Calibration::parse(text, name).unwrap().name, name);
    }
    assert!(Calibration::preset("sony").is_none());
}

#[test]
fn fits_give_the_calibrated_medians() {
    for (gain, read, row) in [
        (0.1, 0.6075, 0.1642),
        (0.3, 1.0094, 0.2932),
        (1.0, 1.7607, 0.5534),
        (3.0, 2.9253, 0.9879),
        (6.0, 4.0297, 1.4241),
    ] {
        let noise = sony().noise_at(gain, [0.0; 2], [0.0; 2]);
        assert!((noise.read_scale - read).abs() < 6e-5, "{gain}");
        assert!((noise.row_deviation - row).abs() < 6e-5, "{gain}");
    }
    let scattered = sony().noise_at(1.0, [1.0, -1.0], [0.0; 2]);
    assert!((scattered.read_scale.ln() - 0.56571 - 0.26337).abs() < 1e-5);
    assert!((scattered.row_deviation.ln() + 0.59170 + 0.29429).abs() < 1e-5);
}

#[test]
fn the_nearest_step_is_used() {
    for (gain, step) in
        [(0.01, 0), (0.1, 0), (0.1328, 0), (0.1329, 1), (0.7746, 3), (4.2, 5), (4.3, 6), (6.0, 6), (100.0, 6)]
    {
        assert_eq!(sony().nearest_step(gain), step, "K = {gain}");
    }
    for (gain, shape) in [(0.1, 0.1143), (0.7746, -0.0429), (6.0, -0.1143)] {
        let noise = sony().noise_at(gain, [0.0; 2], [0.0; 2]);
        assert!((noise.read_shape - shape).abs() < 5e-5);
    }
    let first = sony().noise_at(0.7746, [0.0; 2], [0.0, 0.5]);
    assert!((first.read_shape + 3.0 / 70.0).abs() < 1e-15);
    let second = sony().noise_at(0.7746, [0.0; 2], [0.5, 0.0]);
    assert!((second.read_shape + 4.0 / 70.0).abs() < 1e-15);
    assert!((first.bias[0] - 0.60525787).abs() < 1e-15);
}

/// A step of a calibration whose shape equals its gain.
fn step_toml(gain: f64) -> String {
    format!("[[step]]\ngain = {gain}\nshape = [{gain}]\nbias = [[0.0, 0.0, 0.0, 0.0]]\n")
}

/// If each step has its own gain, the step nearest in ln K is used.
#[test]
fn steps_with_their_own_gains_need_not_be_doublings() {
    let head = PRESETS[0].1.split("[[step]]").next().unwrap();
    let bare = head.replace("first-gain = 0.09391607086816033\n", "");
    let text = bare.clone() + &[0.1, 0.3, 1.2].map(step_toml).concat();
    let camera = Calibration::parse(&text, "my.toml").unwrap();
    // The middles between the steps are √(0.1 · 0.3) = 0.1732 and √(0.3 · 1.2) = 0.6.
    for (gain, expected) in [(0.01, 0.1), (0.173, 0.1), (0.174, 0.3), (0.599, 0.3), (0.601, 1.2), (90.0, 1.2)] {
        let shape = camera.noise_at(gain, [0.0; 2], [0.0; 2]).read_shape;
        assert!((shape - expected).abs() < 1e-15, "K = {gain}: {shape}");
    }
    let text = toml::to_string(&camera).unwrap();
    assert_eq!(Calibration::parse(&text, "again").unwrap(), camera);
    // As with first-gain, steps above the range of K are not used.
    let low_gains = Calibration { gain: [0.1, 0.3], ..camera };
    assert!((low_gains.noise_at(1.2, [0.0; 2], [0.0; 2]).read_shape - 0.3).abs() < 1e-15);
    let (low, high) = (step_toml(0.1), step_toml(0.3));
    let without = high.replace("gain = 0.3\n", "");
    for (text, part) in [
        (bare.clone() + &low + &without, "step 2, gain: missing"),
        (head.to_owned() + &low, "first-gain: every [[step]]"),
        (bare.clone() + &without, "first-gain: missing"),
        (bare.clone() + &high + &low, "step 2, gain: 0.1 is not above 0.3"),
        (bare + &step_toml(200.0), "step 1, gain: 200"),
    ] {
        let error = Calibration::parse(&text, "my.toml").unwrap_err().to_string();
        assert!(error.starts_with("my.toml") && error.contains(part), "{error}");
    }
}

/// The digest of a camera is computed from its JSON, which must not contain keys that the file does not have.
#[test]
fn a_preset_is_written_without_keys_that_it_lacks() {
    let text = serde_json::to_string(&sony()).unwrap();
    assert!(text.contains("\"first-gain\":0.0939"), "{text}");
    assert!(text.contains("\"step\":[{\"shape\":"), "{text}");
}

/// The calibration's columns are R, G1, B, G2; the planes are R, Gr, Gb, B.
#[test]
fn offsets_reach_their_planes() {
    let bias = sony().noise_at(6.0, [0.0; 2], [0.0; 2]).bias;
    let expected = [-1.5595009, -1.5976678, -1.3571521, -1.3204409];
    assert!(bias.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15));
}

#[test]
fn errors_name_the_key_of_an_invalid_calibration() {
    let good = PRESETS[0].1;
    for (from, to, part) in [
        ("adu-range = 15871.0", "adu-range = nan", "adu-range: NaN"),
        ("gain = [0.1, 6.0]", "gain = [6.0, 0.1]", "gain: the range"),
        ("gain = [0.1, 6.0]", "gain = [0.1, inf]", "gain: inf"),
        ("ratio = [100.0, 300.0]", "ratio = [0.0, 300.0]", "ratio: 0"),
        ("[read-scale]", "[read-scales]", "read-scale"),
        ("[read-scale]", "[read-scale]\nshape = 3", "shape"),
        ("name = ", "nmae = ", "nmae"),
        ("adu-range = 15871.0\n", "", "adu-range"),
        ("[[step]]\nshape = [0.1142", "[[step]]\nshape = [9.1142", "step 1, shape: 9.1"),
    ] {
        assert!(good.contains(from), "{from}");
        let text = good.replacen(from, to, 1);
        let error = Calibration::parse(&text, "my.toml").unwrap_err().to_string();
        assert!(error.starts_with("my.toml") && error.contains(part), "{error}");
    }
    let bare = good.split("[[step]]").next().unwrap();
    let error = Calibration::parse(bare, "my.toml").unwrap_err().to_string();
    assert!(error.contains("step"), "{error}");
}

#[test]
fn a_written_calibration_can_be_parsed() {
    for (name, _) in PRESETS {
        let calibration = Calibration::preset(name).unwrap();
        let text = calibration.to_toml(&["a".to_owned(), "b = 1".to_owned()]);
        let text = text.unwrap();
        assert!(text.starts_with("# a\n# b = 1\nname = "), "{text}");
        assert_eq!(Calibration::parse(&text, name).unwrap(), calibration);
    }
}
