//! The enhancers in `models/`.

use std::path::{Path, PathBuf};

use darkqa_base::types::{Rgb, Severity};
use darkqa_enhance::Enhancer;
use darkqa_light::exposure::expose;
use darkqa_light::raw::negative::Negative;
use darkqa_light::{NoiseKey, Synthesis};
use darkqa_rooms::Rooms;

use super::open;
use crate::support::onnx;
use crate::support::table::check_rows;

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("models/gray-gain.onnx")
}

/// `DARKQA_BLESS=1 cargo test --test program enhance::` writes the file anew.
#[test]
fn shipped_enhancer_is_what_writer_makes() {
    let model = onnx::gray_gain().model();
    if std::env::var_os("DARKQA_BLESS").is_some_and(|value| value == "1") {
        std::fs::write(shipped(), &model).unwrap();
    }
    assert!(
        std::fs::read(shipped()).unwrap() == model,
        "models/gray-gain.onnx differs; write it anew with DARKQA_BLESS=1"
    );
}

#[test]
fn the_shipped_enhancer_exposes_for_gray() {
    let mut enhancer = open(&shipped()).unwrap();
    let light = |byte: f64| {
        let x = byte / 255.0;
        if x < 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055_f64).powf(2.4) }
    };
    let mean = |image: &Rgb| {
        let sum: f64 = image.samples().iter().map(|b| light(f64::from(*b))).sum();
        sum / image.samples().len() as f64
    };
    // Six stops below middle gray.
    let dark = Rgb::new(6, 8, (0..144).map(|i| 5 + (i % 9) as u8).collect()).unwrap();
    assert!((mean(&enhancer.enhance(&dark).unwrap()) - 0.18).abs() < 0.004);
    // A bright image is not darkened, and a black one is not lifted.
    check_rows([0, 200], |byte| {
        let flat = Rgb::new(6, 8, vec![byte; 144]).unwrap();
        assert_eq!(enhancer.enhance(&flat).unwrap(), flat);
    });
}

fn lift() -> Enhancer {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/lift.onnx");
    assert!(std::fs::metadata(&path).unwrap().len() <= 100_000);
    open(&path).unwrap()
}

/// The mean square of the difference of two images, as a ratio to the brightest in dB.
fn psnr(a: &Rgb, b: &Rgb) -> f64 {
    let sum: f64 = a.samples().iter().zip(b.samples()).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
    10.0 * (255.0_f64.powi(2) * a.samples().len() as f64 / sum.max(1e-9)).log10()
}

#[test]
fn trained_enhancer_brings_room_back() {
    let mut enhancer = lift();
    let rooms = Rooms { frames: 6, seed: 3003, size: [240, 180], ..Rooms::default() };
    for (id, room) in rooms.all() {
        let lit = room.frame().unwrap().rgb.clone();
        let (mut negative, key) = (None, NoiseKey::new(0, &id));
        for level in Severity::LADDER {
            let film = negative.get_or_insert_with(|| Negative::new(&lit, &key, &Synthesis::default(), level));
            for (dark, gain) in [(expose(&lit, level), 8.0), (film.develop(level), 5.0)] {
                let (before, after) = (psnr(&dark, &lit), psnr(&enhancer.enhance(&dark).unwrap(), &lit));
                assert!(after - before > gain, "{id} {level:?}: {before} dB, then {after} dB");
            }
        }
        // What is lit stays nearly as it is. Rooms differ in their mean light, which the enhancer can only guess.
        let same = psnr(&enhancer.enhance(&lit).unwrap(), &lit);
        assert!(same > 20.0, "{id}: {same} dB");
    }
}

/// Flat areas stay flat, empty ones stay empty, and no new edges appear.
#[test]
fn the_trained_enhancer_invents_nothing() {
    let mut enhancer = lift();
    let rows = [[0, 0, 0], [3, 3, 3], [20, 16, 12], [90, 110, 130], [255, 255, 255]];
    check_rows(rows, |color| {
        let flat = Rgb::new(64, 96, color.repeat(64 * 96)).unwrap();
        let lifted = enhancer.enhance(&flat).unwrap();
        let (pixels, _) = lifted.samples().as_chunks::<3>();
        // Away from the rim, where convolutions see the end of the image.
        let inner = (24..40).flat_map(|y| &pixels[y * 96 + 24..y * 96 + 72]);
        for channel in 0..3 {
            let codes: Vec<u8> = inner.clone().map(|pixel| pixel[channel]).collect();
            let spread = codes.iter().max().unwrap() - codes.iter().min().unwrap();
            assert!(spread <= 8, "{color:?}: {spread} codes apart");
        }
    });
    // One edge in, one edge out.
    let halves: Vec<u8> = (0..64 * 96).flat_map(|i| if i % 96 < 48 { [8, 8, 8] } else { [24, 20, 16] }).collect();
    let lifted = enhancer.enhance(&Rgb::new(64, 96, halves).unwrap()).unwrap();
    let row = &lifted.samples()[32 * 96 * 3..33 * 96 * 3];
    let steps: Vec<u8> = (24..71).map(|x| row[x * 3].abs_diff(row[x * 3 + 3])).collect();
    let edge = 47 - 24;
    assert!(steps[edge] > 40, "{steps:?}");
    let away = steps.iter().enumerate().filter(|(x, _)| x.abs_diff(edge) > 6);
    assert!(away.clone().all(|(_, step)| *step <= 8), "{steps:?}");
}
