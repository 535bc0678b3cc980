use super::*;
use darkqa_base::types::FrameId;

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

/// The fixed camera, with the middle of every range.
pub(crate) fn median() -> CameraState {
    let mut model = CameraModel::default();
    model.set_sampling(Sampling::Fixed);
    let key = NoiseKey::new(0, &FrameId(String::new()));
    CameraState::draw(&key, &model)
}

#[test]
fn the_fixed_camera_is_the_same_for_all_frames() {
    let state = median();
    assert!((state.system_gain - 0.6f64.sqrt()).abs() < 1e-15);
    assert!((state.ratio - 200.0).abs() < 1e-12);
    let mut model = CameraModel::default();
    model.set_sampling(Sampling::Fixed);
    model.pin_gain(2.0).unwrap();
    let pinned = states(&model, 2);
    assert_eq!(pinned[0], pinned[1]);
    assert!((pinned[0].system_gain - 2.0).abs() < 1e-15);
}

#[test]
fn a_serialized_state_can_be_deserialized() {
    for state in states(&CameraModel::default(), 50) {
        let text = serde_json::to_string(&state).unwrap();
        assert_eq!(serde_json::from_str::<CameraState>(&text).unwrap(), state);
    }
}

#[test]
fn every_calibrated_camera_stays_in_its_ranges() {
    for name in Calibration::names() {
        let model = CameraModel::preset(name).unwrap();
        let [low, high] = model.calibration.gain;
        for state in states(&model, 200) {
            assert!(state.system_gain >= low && state.system_gain <= high, "{name}");
            assert!((100.0..=300.0).contains(&state.ratio), "{name}");
            assert!(state.read_scale > 0.0 && state.read_scale < 500.0, "{name}");
        }
    }
    let error = CameraModel::preset("leica").unwrap_err().to_string();
    assert!(error.contains("canon-eos-70d"), "{error}");
}

fn states(model: &CameraModel, n: usize) -> Vec<CameraState> {
    (0..n)
        .map(|i| {
            let key = NoiseKey::new(5, &FrameId(format!("frame {i}")));
            CameraState::draw(&key, model)
        })
        .collect()
}

/// The Kolmogorov–Smirnov statistic: largest distance between the empirical distribution function and `cdf`, in units
/// of 1/√n.
fn kolmogorov(mut sample: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
    sample.sort_by(f64::total_cmp);
    let n = sample.len() as f64;
    sample
        .iter()
        .enumerate()
        .map(|(i, x)| {
            let f = cdf(*x);
            f64::max((f - i as f64 / n).abs(), ((i + 1) as f64 / n - f).abs())
        })
        .fold(0.0, f64::max)
        * n.sqrt()
}

/// A number of a camera state.
type Number = fn(&CameraState) -> f64;

fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / f64::sqrt(2.0))
}

#[test]
fn numbers_have_their_distributions() {
    let all = states(&CameraModel::default(), 10_000);
    let uniform: [(&str, Number, [f64; 2]); 4] = [
        ("K", |s| s.system_gain.ln(), [0.1f64.ln(), 6.0f64.ln()]),
        ("r", |s| s.ratio, [100.0, 300.0]),
        ("red", |s| s.red_gain, [1.9, 2.4]),
        ("blue", |s| s.blue_gain, [1.5, 1.9]),
    ];
    for (name, number, [low, high]) in uniform {
        let sample = all.iter().map(number).collect();
        let distance = kolmogorov(sample, |x| (x - low) / (high - low));
        assert!(distance < 1.95, "{name}: {distance}");
    }
    let inverse_gains = all.iter().map(|s| 1.0 / s.rgb_gain).collect();
    let tail = normal_cdf(-3.0);
    let distance = kolmogorov(inverse_gains, |inverse| (normal_cdf((inverse - 0.8) / 0.1) - tail) / (1.0 - 2.0 * tail));
    assert!(distance < 1.95, "1/rgb: {distance}");
    assert!(all.iter().all(|s| (0.5..=1.1).contains(&(1.0 / s.rgb_gain))));
    assert!(all.iter().all(|s| (0.1..=6.0).contains(&s.system_gain)));
}

#[test]
fn pinned_numbers_do_not_change_others() {
    let mut pinned = CameraModel::default();
    pinned.pin_ratio(42.0).unwrap();
    let (free, fixed) = (states(&CameraModel::default(), 20), states(&pinned, 20));
    for (free, fixed) in free.into_iter().zip(fixed) {
        assert_eq!(CameraState { ratio: 42.0, ..free }, fixed);
    }
    pinned.pin_gain(6.0).unwrap();
    for state in states(&pinned, 20) {
        assert!((state.system_gain - 6.0).abs() < f64::EPSILON);
        assert!([-1.5595009, -1.5529999].contains(&state.bias[0]));
    }
}

#[test]
fn frames_and_seeds_have_different_cameras() {
    let [first, same, other_seed, other_frame] = [(1, "a"), (1, "a"), (2, "a"), (1, "b")].map(|(seed, frame)| {
        let key = NoiseKey::new(seed, &FrameId(frame.to_owned()));
        CameraState::draw(&key, &CameraModel::default())
    });
    assert_eq!(first, same);
    assert_ne!(first, other_seed);
    assert_ne!(first, other_frame);
}

#[test]
fn pins_are_checked_and_name_their_flag() {
    let mut model = CameraModel::default();
    for wrong in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e9] {
        let gain = model.pin_gain(wrong).unwrap_err().to_string();
        assert!(gain.contains("--noise gain"), "{gain}");
        let ratio = model.pin_ratio(wrong).unwrap_err().to_string();
        assert!(ratio.contains("--noise ratio"), "{ratio}");
    }
    assert_eq!(model, CameraModel::default());
}

const MIXES: [[f64; 4]; 4] = [[1.0, 1.0, 1.0, 1.0], [0.9, 0.001, 0.3, 0.2], [0.0, 1.0, 0.0, 0.0], [0.2, 0.1, 0.0, 7.0]];

#[test]
fn grey_stays_grey() {
    for weights in MIXES {
        for row in rgb_to_camera(weights) {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 5e-16);
        }
    }
}

#[test]
fn inverse_times_matrix_is_identity() {
    for weights in MIXES {
        let matrix = rgb_to_camera(weights);
        let identity = product(&matrix, &inverse(&matrix));
        for (i, row) in identity.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((value - f64::from(u8::from(i == j))).abs() < 1e-14);
            }
        }
    }
}

/// The expected values are from an independent implementation.
#[test]
fn camera_mixes_match_reference_matrices() {
    let mean = [
        [0.6460054538, 0.2714313899, 0.0825631563],
        [0.0825578502, 0.7557543488, 0.161687801],
        [0.0145444844, 0.2250190894, 0.7604364262],
    ];
    let uneven = [
        [0.6218507358, 0.2552155048, 0.1229337595],
        [0.0815851812, 0.7259717238, 0.192443095],
        [0.0112382471, 0.2211703924, 0.7675913605],
    ];
    for (weights, expected) in [([3.0; 4], mean), ([1.0, 2.0, 3.0, 4.0], uneven)] {
        let found = rgb_to_camera(weights);
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-9, "{found} against {expected}");
        }
    }
}
