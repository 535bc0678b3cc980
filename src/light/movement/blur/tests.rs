//! Tests of motion blur against its definition.

use rayon::ThreadPoolBuilder;

use super::*;

/// Textured pixels, a bright lamp and a dark corner.
fn picture(height: usize, width: usize) -> Rgb {
    Rgb::new(
        height,
        width,
        (0..3 * height * width)
            .map(|i: usize| match (i / 3 / width, i / 3 % width) {
                (row, column) if row < 4 && column < 4 => 0,
                (row, column) if row % 9 == 5 && column % 11 == 6 => 255,
                _ => (i.wrapping_mul(2_654_435_761) >> 24) as u8,
            })
            .collect(),
    )
    .unwrap()
}

fn streak(length: f64, angle: f64) -> Streak {
    Streak::new(length, angle).unwrap()
}

/// Reference in double precision: each pixel is the weighted mean of its neighbours, with repeated edges.
fn reference(clean: &Rgb, streak: Streak) -> Vec<f64> {
    let (height, width) = (clean.height(), clean.width());
    let taps = streak.taps();
    let mut blurred = Vec::new();
    for i in 0..3 * height * width {
        let (row, column, channel) = (i / 3 / width, i / 3 % width, i % 3);
        let weighted = taps.iter().map(|tap| {
            let [right, down] = tap.offset;
            let row = row.saturating_add_signed(down).min(height - 1);
            let column = column.saturating_add_signed(right).min(width - 1);
            let code = clean.samples()[3 * (row * width + column) + channel];
            tap.weight * libm::pow(f64::from(code) / 255.0, 2.2)
        });
        blurred.push(weighted.sum());
    }
    blurred
}

const PATHS: [(f64, f64); 14] = [
    (0.3, 0.0),
    (1.0, 0.0),
    (2.5, 0.0),
    (5.9, 0.0),
    (6.0, 180.0),
    (6.78, 0.0),
    (13.3, 0.0),
    (16.0, 0.0),
    (31.99, 0.0),
    (64.0, 0.0),
    (16.0, 90.0),
    (5.5, 30.0),
    (16.0, 137.0),
    (64.0, 45.0),
];

#[test]
fn light_is_the_weighted_mean_of_the_path() {
    for (height, width) in [(23, 61), (3, 5), (1, 1), (40, 150)] {
        let clean = picture(height, width);
        for (length, angle) in PATHS {
            let expected = reference(&clean, streak(length, angle));
            let found = blur((&clean).into(), streak(length, angle));
            for (found, expected) in found.samples().iter().zip(&expected) {
                let off = (f64::from(*found) - expected).abs();
                let bound = 2e-7 + 1e-6 * expected;
                assert!(off < bound, "{length} at {angle}: {found} {expected}");
            }
            let codes = blurred_codes(&clean, streak(length, angle));
            for (code, light) in codes.samples().iter().zip(&expected) {
                let exact = 255.0 * libm::pow(*light, 1.0 / 2.2);
                assert!((f64::from(*code) - exact).abs() < 0.501, "{length} at {angle}");
            }
        }
    }
}

/// A white edge blurred over four pixels gives 99, 163, 206 and 240. Blurring codes would give 32, 96, 159 and 223.
#[test]
fn an_edge_is_blurred_in_light_and_not_in_codes() {
    let edge = (0..36).map(|i| if i < 18 { 0 } else { 255 }).collect();
    let edge = Rgb::new(1, 12, edge).unwrap();
    let blurred = blurred_codes(&edge, streak(4.0, 0.0));
    let red: Vec<u8> = blurred.samples().iter().step_by(3).copied().collect();
    assert_eq!(red, [0, 0, 0, 0, 99, 163, 206, 240, 255, 255, 255, 255]);
}

#[test]
fn still_and_uniform_images_are_unchanged() {
    let clean = picture(9, 17);
    assert_eq!(blurred_codes(&clean, streak(0.0, 33.0)), clean);
    assert_ne!(blurred_codes(&clean, streak(0.4, 33.0)), clean);
    for code in [0, 1, 2, 128, 254, 255] {
        let even = Rgb::new(8, 9, vec![code; 3 * 72]).unwrap();
        for (length, angle) in PATHS {
            let blurred = blurred_codes(&even, streak(length, angle));
            assert_eq!(blurred, even, "{code}, {length} at {angle}");
        }
    }
}

/// The result depends neither on threads nor on the instruction set, and is the same for codes and for their light.
#[test]
fn threads_and_instructions_change_nothing() {
    let clean = picture(40, 150);
    let light = clean.samples().iter().map(|code| display_light()[usize::from(*code)]);
    let light = Light::new(40, 150, light.collect()).unwrap();
    for (length, angle) in PATHS {
        let path = streak(length, angle);
        let expected = blur((&clean).into(), path);
        assert_eq!(blur((&light).into(), path), expected);
        for threads in [1, 3] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build();
            let found = pool.unwrap().install(|| blur((&clean).into(), path));
            assert_eq!(found, expected, "{threads} threads, {length} at {angle}");
        }
        for isa in Isa::available() {
            let blur = Blur::new((&clean).into(), path, isa);
            let mut scratch = Scratch::default();
            for row in [0, 20, 39] {
                let mut found = vec![7.0; 450];
                blur.row(row, &mut scratch, &mut found);
                assert_eq!(found, expected.samples()[450 * row..][..450], "{isa:?}");
            }
        }
    }
}
