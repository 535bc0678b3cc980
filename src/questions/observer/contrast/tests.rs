use super::*;
use crate::questions::pick::Picker;
use crate::types::FrameId;

const SIZE: [usize; 2] = [240, 180];

/// Approximately normal draws: sums of twelve uniform ones.
fn normal(seed: u64, count: usize) -> Vec<f64> {
    let frame = FrameId("noise".to_owned());
    let picker = Picker {
        seed,
        dataset: "",
        frame: &frame,
    };
    let mut state = picker.bits("", "") | 1;
    let mut uniform = || {
        // Marsaglia's xorshift64 (2003).
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..count)
        .map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0)
        .collect()
}

/// The masks of a disc (2) on a background (1).
fn masks() -> Vec<u32> {
    let [width, height] = SIZE;
    let inside = |i: usize| {
        let (x, y) = ((i % width) as f64 - 120.0, (i / width) as f64 - 90.0);
        x * x + y * y < 40.0 * 40.0
    };
    (0..width * height)
        .map(|i| 1 + u32::from(inside(i)))
        .collect()
}

/// The disc on a background of code 60, brighter by `step` codes, with noise of pixels and of rows.
fn image(step: f64, pixel: f64, row: f64, seed: u64) -> Rgb {
    let [width, height] = SIZE;
    let (draws, rows) = (
        normal(seed, width * height * 3),
        normal(seed + 1000, height),
    );
    let masks = masks();
    let samples = draws.iter().enumerate().map(|(i, draw)| {
        let place = i / 3;
        let light = 60.0 + if masks[place] == 2 { step } else { 0.0 };
        (light + draw * pixel + rows[place / width] * row)
            .round()
            .clamp(0.0, 255.0) as u8
    });
    Rgb::new(height, width, samples.collect()).unwrap()
}

fn sees(image: &Rgb) -> bool {
    let palette = Palette::built_in().unwrap();
    let contrasts = MaskContrasts::measure(image, &masks(), SIZE, 1.0, &palette);
    contrasts.visible().any(|mask| mask == 2)
}

#[test]
fn contrast_is_compared_with_noise() {
    for (step, pixel, row, seen) in [
        (40.0, 0.0, 0.0, true),
        (1.0, 0.0, 0.0, true),
        (0.0, 0.0, 0.0, false),
        (40.0, 20.0, 0.0, true),
        (-20.0, 20.0, 0.0, true),
        (1.0, 30.0, 0.0, false),
        (20.0, 4.0, 3.0, true),
        (2.0, 4.0, 12.0, false),
    ] {
        let found = sees(&image(step, pixel, row, 5));
        assert_eq!(found, seen, "{step} {pixel} {row}");
    }
}

#[test]
fn noise_alone_shows_nothing() {
    for seed in 0..60 {
        for (pixel, row) in [(2.0, 0.0), (15.0, 0.0), (3.0, 6.0), (0.7, 0.0)] {
            assert!(!sees(&image(0.0, pixel, row, seed)), "{seed} {pixel} {row}");
        }
    }
}

#[test]
fn a_gain_makes_nothing_more_visible() {
    let dim = image(6.0, 12.0, 1.0, 9);
    let mut bright = dim.clone();
    for code in bright.samples_mut() {
        *code = (u32::from(*code) * 2).min(255) as u8;
    }
    let signals = |image: &Rgb| {
        let contrasts =
            MaskContrasts::measure(image, &masks(), SIZE, 1.0, &Palette::built_in().unwrap());
        contrasts.signal(&contrasts.borders[&(1, 2)])
    };
    let (a, b) = (signals(&dim), signals(&bright));
    assert!((a - b).abs() < 0.02 * a, "{a} {b}");
}

#[test]
fn the_noise_of_rows_is_estimated() {
    for row in [0.0, 3.0, 8.0] {
        let found = row_noise(&image(30.0, 4.0, row, 2));
        assert!((found - row).abs() < 0.15 * row + 0.6, "{row}: {found}");
    }
}

#[test]
fn colours_are_named_after_the_gain() {
    let [width, height] = SIZE;
    let samples = [24_u8, 4, 4].repeat(width * height);
    let dark = Rgb::new(height, width, samples).unwrap();
    let palette = Palette::built_in().unwrap();
    let name = |gain: f64| {
        let contrasts = MaskContrasts::measure(&dark, &masks(), SIZE, gain, &palette);
        contrasts.colors(2, &palette)[0].name()
    };
    assert_eq!((name(1.0), name(40.0)), ("black", "red"));
    assert!(
        (mean_light(&dark) - 0.0028).abs() < 0.0002,
        "{}",
        mean_light(&dark)
    );
}
