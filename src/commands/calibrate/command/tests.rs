use super::*;
use crate::commands::calibrate::lines::NoiseKind;
use crate::commands::calibrate::setting::{FigurePoints, FrameCounts};
use crate::commands::calibrate::{Cfa, Measured};
use darkqa_base::types::Digest;

fn measured(value: f64) -> Measured {
    Measured { value, error: Some(0.001) }
}

fn setting(name: &str, gain: f64) -> SettingFit {
    SettingFit {
        name: name.to_owned(),
        frames: FrameCounts { bias: 10, exposures: 5, flat_pairs: 10 },
        gain: measured(gain),
        read_scale: measured(1.5 * gain.sqrt()),
        read_shape: measured(-0.04),
        plot: crate::commands::calibrate::read_noise::PlotFit { shape: -0.03, scale: 1.6 },
        row_deviation: measured(0.4 * gain.sqrt()),
        offsets: [512.1, 511.9, 512.3, 512.0].map(measured).to_vec(),
        read_deviation: 2.7,
        hot_pixels: 0,
        gain_by_plane: vec![Some(gain); 4],
        bend: 0.0,
        intercept: measured(0.0),
        figure: FigurePoints::default(),
    }
}

fn camera(settings: Vec<SettingFit>) -> CameraFit {
    CameraFit {
        schema: "darkqa.calibration/1",
        name: "my \"night\" cam".to_owned(),
        camera: None,
        cfa: Cfa::Rggb,
        size: [512, 512],
        black: 512,
        white: 16383,
        read_scale: NoiseLine::for_settings(&settings, NoiseKind::Read),
        row_deviation: NoiseLine::for_settings(&settings, NoiseKind::Row),
        settings,
        frames: 30,
        frames_digest: Digest::from_bytes(b"frames"),
        dates: Some(["2026:01:01".to_owned(), "2026:01:02\nx = 1".to_owned()]),
        warnings: vec!["iso100: doubtful\n[gain]".to_owned()],
    }
}

#[test]
fn the_file_has_the_measured_values() {
    let camera = camera(["a", "b", "c"].iter().zip([0.1, 0.5, 2.5]).map(|(n, k)| setting(n, k)).collect());
    let text = camera_file(&camera).unwrap();
    let read = Calibration::parse(&text, "camera.toml").unwrap();
    assert_eq!(read.name, camera.name);
    assert!((read.adu_range - 15871.0).abs() < 1e-9);
    assert!((read.gain[0] - 0.1).abs() < 1e-9 && (read.gain[1] - 2.5).abs() < 1e-9);
    assert!((read.read_scale.slope - 0.5).abs() < 1e-5);
    assert!((read.row_deviation.intercept - 0.4_f64.ln()).abs() < 1e-5);
    let noise = read.noise_at(0.6, [0.0; 2], [0.5; 2]);
    assert!((noise.read_shape + 0.04).abs() < 1e-9);
    // The planes R, Gr, Gb, B, whatever the order of the columns.
    for (bias, expected) in noise.bias.iter().zip([0.1, -0.1, 0.3, 0.0]) {
        assert!((bias - expected).abs() < 1e-5, "{:?}", noise.bias);
    }
    for part in ["± 71 % of itself", "# Warning: iso100: doubtful [gain]", "K 0.5000 ± 0.0010"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

/// Comments of a table.
fn comments<'t>(text: &'t str, table: &str) -> Vec<&'t str> {
    let table = text.split_once(&format!("\n[{table}]\n")).unwrap().1;
    table.lines().take_while(|line| !line.is_empty()).filter(|line| line.starts_with('#')).collect()
}

/// Comments state the number of settings without visible row noise.
#[test]
fn lines_state_their_source() {
    let four: Vec<SettingFit> =
        ["a", "b", "c", "d"].into_iter().zip([0.1, 0.5, 2.5, 5.0]).map(|(name, gain)| setting(name, gain)).collect();
    for (quiet, settings, row) in [
        (&[][..], 4, &["# Fitted to 4 settings.", "# The deviation is known to ± 50 % of itself."][..]),
        (
            &[0],
            4,
            &[
                "# Fitted to 3 settings.",
                "# 1 setting without visible noise is left out; the line holds for it, too.",
                "# The deviation is known to ± 71 % of itself.",
            ],
        ),
        (
            &[0, 1],
            4,
            &[
                "# The slope is that of the preset sony-a7s2, because a slope needs 3 settings; the line passes through the mean of 2 settings.",
                "# 2 settings without visible noise are left out; the line holds for them, too.",
                "# The deviation is known to ± 71 % of itself.",
            ],
        ),
        (
            &[],
            1,
            &[
                "# The slope is that of the preset sony-a7s2, because a slope needs 3 settings; the line passes through 1 setting.",
                "# A single setting has no deviation.",
            ],
        ),
        (&[0, 1], 2, &["# No setting has noise of this kind."]),
    ] {
        let mut fits = four[..settings].to_vec();
        for index in quiet {
            fits[*index].row_deviation = measured(0.0);
        }
        let text = camera_file(&camera(fits)).unwrap();
        assert_eq!(comments(&text, "row-deviation"), row);
        // Read noise is visible in all settings.
        let read = comments(&text, "read-scale").concat();
        assert!(!read.contains("left out"), "{read}");
    }
}

#[test]
fn invalid_values_are_not_written() {
    let twice = camera(vec![setting("a", 0.5), setting("b", 0.5)]);
    let error = camera_file(&twice).unwrap_err().to_string();
    assert!(error.contains("step 2, gain: 0.5 is not above 0.5"), "{error}");
    let far = camera(vec![setting("a", 300.0)]);
    assert!(camera_file(&far).unwrap_err().to_string().contains("gain: 300"));
}

#[test]
fn numbers_have_six_digits() {
    for (value, text) in [
        (0.093_900_04, "0.0939000"),
        (-1.234_567_89, "-1.23457"),
        (15871.0, "15871.0"),
        (0.0, "0.0"),
        (1e-20, "0.000000000000"),
    ] {
        assert_eq!(number(value), text);
    }
}
