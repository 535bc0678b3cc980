//! Tests of the whole pipeline: its figures, and that pixels depend only on its arguments.

use super::camera::tests::median;
use super::raw::negative::ladder;
use super::raw::noise::Term;
use super::*;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Digest, FrameId, Severity};

fn key(seed: u64, frame: &str) -> NoiseKey {
    NoiseKey::new(seed, &FrameId(frame.to_owned()))
}

fn sensor(severity: Severity) -> Degradation {
    Degradation::new(Kind::Sensor, severity, None).unwrap()
}

fn exposure_drop(severity: Severity) -> Degradation {
    Degradation::new(Kind::Exposure, severity, None).unwrap()
}

fn flat(code: u8, size: usize) -> Rgb {
    Rgb::new(size, size, vec![code; size * size * 3]).unwrap()
}

/// Red rises along a row, green along a column, blue falls along the diagonal.
fn ramps(height: usize, width: usize) -> Rgb {
    let samples = (0..height * width).flat_map(|i| {
        let (row, column) = (i / width, i % width);
        let diagonal = 255 - ramp_code(row + column, height + width);
        [ramp_code(column, width), ramp_code(row, height), diagonal]
    });
    Rgb::new(height, width, samples.collect()).unwrap()
}

fn ramp_code(position: usize, size: usize) -> u8 {
    (position * 255 / size.max(2)) as u8
}

/// Mean and standard deviation of each channel.
fn statistics(image: &Rgb) -> [[f64; 2]; 3] {
    let n = (image.height() * image.width()) as f64;
    std::array::from_fn(|channel| {
        let codes: Vec<f64> = image.samples().iter().skip(channel).step_by(3).map(|code| f64::from(*code)).collect();
        let mean = codes.iter().sum::<f64>() / n;
        let variance = codes.iter().map(|code| (code - mean).powi(2)).sum::<f64>() / n;
        [mean, variance.sqrt()]
    })
}

#[test]
fn without_a_degradation_the_frame_is_unchanged() {
    let clean = ramps(5, 7);
    let same = degrade(&clean, None, &key(1, "a"), &Synthesis::default()).unwrap();
    assert_eq!(same, clean);
}

#[test]
fn one_negative_gives_the_images_of_degrade() {
    let (clean, key, paper) = (ramps(10, 14), key(1, "a"), Synthesis::default());
    let negative = Negative::new(&clean, &key, &paper, Severity::L1);
    for level in Severity::LADDER {
        let alone = degrade(&clean, Some(&sensor(level)), &key, &paper).unwrap();
        assert_eq!(alone, negative.develop(level));
        let exposed = degrade(&clean, Some(&exposure_drop(level)), &key, &paper).unwrap();
        assert_eq!(exposed, expose(&clean, level));
    }
}

/// If these bytes change, every result changes, so [`VERSION`] must be raised.
#[test]
fn bytes_match_this_version() {
    let clean = ramps(48, 63);
    let mut bytes = Vec::new();
    for level in Severity::LADDER {
        bytes.extend_from_slice(expose(&clean, level).samples());
    }
    let exposure = Digest::from_bytes(&bytes).to_string();
    bytes.clear();
    for frame in ["first", "second", "third", "fourth"] {
        let negative = Negative::new(&clean, &key(20, frame), &Synthesis::default(), Severity::L1);
        for level in Severity::LADDER {
            bytes.extend_from_slice(negative.develop(level).samples());
        }
    }
    let sensor = Digest::from_bytes(&bytes).to_string();
    assert_eq!(VERSION, 2);
    assert_eq!(exposure, "ef493dc91ffe0b7f1558f10c2c581c4419340505a34a969706ef98b04cf79a9e");
    assert_eq!(sensor, "17eaa7dfafd65e100705809ef73a8dc5d8b77f97f6429524752b72b3fc52c72c");
}

/// Bytes of other choices than the default, including another camera.
#[test]
fn bytes_of_other_choices_match_this_version() {
    let clean = ramps(37, 130);
    let camera = CameraModel::preset("nikon-d850").unwrap();
    let choices = [
        Synthesis::new(NoiseProfile::Physical, CameraModel::default()),
        Synthesis::new(NoiseProfile::Physical, camera.clone()),
        Synthesis { draws: Draws::Fresh, tone: Tone::AfterEv, ..Synthesis::new(NoiseProfile::Paper, camera) },
    ];
    let mut bytes = Vec::new();
    for synthesis in &choices {
        let mut images = Severity::LADDER.map(|_| Rgb::black(37, 130));
        ladder(&clean, &key(20, "frame"), synthesis, &Severity::LADDER, &mut images.each_mut().map(Rgb::samples_mut));
        for image in &images {
            bytes.extend_from_slice(image.samples());
        }
    }
    assert_eq!(VERSION, 2);
    let digest = "135736c6e5e5372959f81423e99612b894d09f2ba87bad7c88d6cd5ed9fcf884";
    assert_eq!(Digest::from_bytes(&bytes).to_string(), digest);
}

#[test]
fn the_number_of_threads_does_not_change_the_image() {
    let [one, two, five] = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let negative = Negative::new(&ramps(61, 40), &key(3, "a"), &Synthesis::default(), Severity::L1);
            Severity::LADDER.map(|level| negative.develop(level))
        })
    });
    assert_eq!(one, two);
    assert_eq!(one, five);
}

#[test]
fn seed_and_frame_change_the_image() {
    let clean = flat(128, 64);
    let [first, other_seed, other_frame] = [(1, "a"), (2, "a"), (1, "b")].map(|(seed, frame)| {
        let negative =
            Negative::with_state(&clean, &key(seed, frame), &median(), Amplify::ShotOnly, Tone::None, &Term::ALL, 0.0);
        negative.develop(Severity::L1)
    });
    for other in [other_seed, other_frame] {
        let changed = first.samples().chunks(3).zip(other.samples().chunks(3)).filter(|(a, b)| a != b).count();
        assert!(changed * 10 > 64 * 64 * 9, "{changed} changed");
    }
}

#[test]
fn the_size_never_changes() {
    for (height, width) in [(1, 1), (1, 2), (1, 9), (2, 1), (9, 1), (3, 5), (4, 5), (5, 4)] {
        let clean = ramps(height, width);
        let how = sensor(Severity::L2);
        let degraded = degrade(&clean, Some(&how), &key(1, "a"), &Synthesis::default()).unwrap();
        assert_eq!((degraded.height(), degraded.width()), (height, width));
    }
}

/// Documented figures of flat greys with the fixed camera: mean and standard deviation of red, green and blue.
#[test]
fn flat_greys_have_the_documented_figures() {
    let cases = [
        (128, Severity::L1, [[66.1, 15.2], [67.3, 9.4], [67.0, 11.0]]),
        (128, Severity::L3, [[18.7, 4.3], [19.1, 2.7], [19.0, 3.1]]),
        (128, Severity::L5, [[7.3, 1.7], [7.4, 1.1], [7.4, 1.3]]),
        (32, Severity::L3, [[7.5, 4.4], [7.9, 3.2], [7.7, 3.6]]),
    ];
    for (code, level, expected) in cases {
        let clean = flat(code, 512);
        let negative =
            Negative::with_state(&clean, &key(4, "flat"), &median(), Amplify::ShotOnly, Tone::None, &Term::ALL, 0.0);
        let found = statistics(&negative.develop(level));
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            let is_close = (found - expected).abs() < 0.01 * expected + 0.07;
            assert!(is_close, "grey {code}, {level:?}: {found} against {expected}");
        }
    }
}

#[test]
fn noise_shrinks_with_the_light() {
    let negative =
        Negative::with_state(&flat(128, 256), &key(5, "a"), &median(), Amplify::ShotOnly, Tone::None, &Term::ALL, 0.0);
    let [lower, higher] =
        [Severity::L1, Severity::L2].map(|level| statistics(&negative.develop(level)).map(|[_, deviation]| deviation));
    for (lower, higher) in lower.iter().zip(higher) {
        assert!((higher / lower * f64::exp2(2.0 / 2.2) - 1.0).abs() < 0.02);
    }
}

#[test]
fn without_noise_mid_grey_and_white_equal_the_exposure_branch() {
    for code in [128, 255] {
        let clean = flat(code, 4);
        for seed in 0..20 {
            let key = key(seed, "a");
            let state = CameraState::draw(&key, &CameraModel::default());
            // With a brightness gain below 1, white cannot be reached.
            if code == 255 && state.rgb_gain < 1.0 {
                continue;
            }
            let negative = Negative::with_state(&clean, &key, &state, Amplify::ShotOnly, Tone::None, &[], 0.0);
            for level in Severity::LADDER {
                assert_eq!(negative.develop(level), expose(&clean, level), "{code}, {level:?}");
            }
        }
    }
}

/// With the tone curve, which the paper omits, the sensor branch does not change greys.
#[test]
fn a_grey_ramp_is_unchanged_with_the_tone_curve() {
    let samples = (0..4 * 256).flat_map(|i| [(i % 256) as u8; 3]).collect();
    let clean = Rgb::new(4, 256, samples).unwrap();
    for seed in 0..20 {
        let state = CameraState::draw(&key(seed, "a"), &CameraModel::default());
        let tone = Tone::BeforeEv;
        let key = key(seed, "a");
        let negative = Negative::with_state(&clean, &key, &state, Amplify::ShotOnly, tone, &[], 0.0);
        let developed = negative.develop_by(0.0);
        for (column, codes) in developed.samples().chunks(3).enumerate() {
            for code in codes {
                assert!(code.abs_diff((column % 256) as u8) <= 2, "{column} became {code}");
            }
        }
    }
}

/// Before the drop, the tone curve gives the greys of the exposure branch; after the drop, it is applied to the
/// degraded image.
#[test]
fn the_tone_curve_is_applied_where_it_is_set() {
    let clean = flat(100, 4);
    let [none, before, after] = [Tone::None, Tone::BeforeEv, Tone::AfterEv].map(|tone| {
        let negative = Negative::with_state(&clean, &key(1, "a"), &median(), Amplify::All, tone, &[], 0.0);
        negative.develop(Severity::L1)
    });
    assert_eq!(before, expose(&clean, Severity::L1));
    let degraded = f64::from(none.samples()[0]) / 255.0;
    let after = after.samples()[0];
    let expected = degraded * degraded * (3.0 - 2.0 * degraded) * 255.0;
    assert!((f64::from(after) - expected).abs() < 1.0, "{after} for {expected}");
}

/// With [`Coupling::Photon`], the ratio is 2^ΔEV; in the paper's profile it does not depend on the level.
#[test]
fn photon_coupling_sets_the_ratio_by_the_drop() {
    let physical = Synthesis::new(NoiseProfile::Physical, CameraModel::default());
    for (found, expected) in Severity::LADDER
        .map(|level| physical.state(&key(1, "a"), level).ratio)
        .iter()
        .zip([4.0, 16.0, 64.0, 181.02, 512.0])
    {
        assert!((found - expected).abs() < 0.01, "{found}");
    }
    let paper = Synthesis::default();
    let [l1, l5] = [Severity::L1, Severity::L5].map(|level| paper.state(&key(1, "a"), level));
    assert_eq!(l1, l5);
}

/// [`ladder`] makes the same images as single negatives, for all sizes and choices of draws.
#[test]
fn ladders_equal_single_negatives() {
    let settings = [
        Synthesis::default(),
        Synthesis::new(NoiseProfile::Physical, CameraModel::default()),
        Synthesis { draws: Draws::Fresh, tone: Tone::AfterEv, ..Synthesis::default() },
    ];
    for (height, width) in [(1, 1), (2, 3), (33, 130), (64, 129), (67, 300)] {
        let (clean, key) = (ramps(height, width), key(6, "a"));
        for synthesis in &settings {
            let mut images = Severity::LADDER.map(|_| Rgb::black(height, width));
            let mut samples = images.each_mut().map(Rgb::samples_mut);
            ladder(&clean, &key, synthesis, &Severity::LADDER, &mut samples);
            for (level, image) in Severity::LADDER.into_iter().zip(&images) {
                let negative = Negative::new(&clean, &key, synthesis, level);
                assert!(negative.can_develop(level));
                assert_eq!(negative.develop(level), *image, "{height} × {width}, {level:?}");
            }
        }
    }
}

#[test]
fn fresh_draws_differ_between_levels() {
    let fresh = Synthesis { draws: Draws::Fresh, ..Synthesis::default() };
    let clean = flat(128, 32);
    let levels = [Severity::L1, Severity::L2];
    let [first, second] = levels.map(|level| Negative::new(&clean, &key(1, "a"), &fresh, level));
    assert!(!first.can_develop(Severity::L2));
    assert_ne!(first.develop(Severity::L3), second.develop(Severity::L3));
    let [first, second] = levels.map(|level| fresh.state(&key(1, "a"), level));
    assert_eq!(first, second);
}

#[test]
fn a_state_is_serialised_with_all_its_numbers() {
    let state = serde_json::to_value(median()).unwrap();
    assert_eq!(state["ratio"], 200.0);
    assert_eq!(state["bias"].as_array().map(Vec::len), Some(4));
    assert_eq!(state["rgb_to_camera"][2].as_array().map(Vec::len), Some(3));
}

#[test]
fn every_kind_of_degradation_is_made_described_and_tested() {
    use darkqa_base::types::degradations::Kind;
    use darkqa_base::types::{Degradation, FrameId};

    let clean = ramps(32, 64);
    let key = super::NoiseKey::new(0, &FrameId("a".to_owned()));
    let described = include_str!("../docs/files.md");
    let tested = include_str!("../../tests/program/images/synthesize.rs");
    let mut missing = Vec::new();
    for kind in Kind::ALL {
        let how = Degradation::new(kind, kind.ladder()[2], None).unwrap();
        let degraded = degrade(&clean, Some(&how), &key, &Synthesis::default());
        if degraded.unwrap() == clean {
            missing.push(format!("{kind:?} changes no pixel"));
        }
        let word = kind.word();
        if !described.contains(&format!("`{word}`")) {
            missing.push(format!("{word} in src/docs/files.md"));
        }
        if !tested.contains(&format!("-{word}")) {
            missing.push(format!("L…-{word} in tests/program/images/synthesize.rs"));
        }
    }
    assert!(missing.is_empty(), "{missing:?}");
}
