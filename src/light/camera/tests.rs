use super::*;
use darkqa_base::types::FrameId;

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
