//! A simulated sensor: the program's own noise, with whole codes, sites that respond differently, and light that falls
//! off.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use darkqa_base::types::FrameId;
use darkqa_light::raw::Bayer;
use darkqa_light::raw::noise::{Term, add as add_noise};
use darkqa_light::{Amplify, CameraModel, CameraState, NoiseKey, Sampling};
use rayon::prelude::*;
use tiff::encoder::colortype::Gray16;
use tiff::encoder::{Compression, TiffEncoder};

pub(super) const BLACK: u16 = 512;
pub(super) const WHITE: u16 = 16383;

/// A sensor at one gain.
#[derive(Clone)]
pub(super) struct Sensor {
    pub(super) state: CameraState,
    pub(super) side: usize,
    seed: u64,
    /// Light that each site gets of even light, in shares.
    response: Vec<f32>,
}

impl Sensor {
    /// A sensor with the noise that a built-in camera has at this gain in the middle of its distributions.
    pub(super) fn new(camera: &str, gain: f64, side: usize, seed: u64) -> Self {
        let mut model = CameraModel::preset(camera).unwrap();
        model.set_sampling(Sampling::Fixed);
        model.pin_gain(gain).unwrap();
        let key = NoiseKey::new(seed, &FrameId("camera".to_owned()));
        let state = CameraState { ratio: 1.0, adu_range: f64::from(WHITE - BLACK), ..CameraState::draw(&key, &model) };
        Self { state, side, seed, response: response(side, seed) }
    }

    /// One frame; without light it is a bias frame. `light` is in shares of white.
    pub(super) fn shoot(&self, name: &str, light: f32) -> Vec<u16> {
        let side = self.side;
        let mut raw = Bayer::covering(side, side);
        raw.lines_mut().enumerate().for_each(|(row, mut line)| {
            for (parity, plane) in line.planes().into_iter().enumerate() {
                let sites = plane.as_flattened_mut().iter_mut().take(side / 2);
                for (column, site) in sites.enumerate() {
                    *site = light * self.response[row * side + 2 * column + parity];
                }
            }
        });
        let key = NoiseKey::new(self.seed, &FrameId(name.to_owned()));
        let terms = [Term::Shot, Term::Read, Term::Row];
        add_noise(&mut raw, &self.state, &key, Amplify::All, &terms);
        let code = |sample: f32| {
            let adu = f64::from(sample) * self.state.adu_range + f64::from(BLACK);
            (adu + 0.5).floor().clamp(0.0, f64::from(WHITE)) as u16
        };
        let sites = (0..side * side).into_par_iter();
        sites.map(|site| code(raw.sample(site / side, site % side))).collect()
    }
}

/// Responses with a deviation of 0.8 %, under light that falls off by 25 % from the middle to the corners.
fn response(side: usize, seed: u64) -> Vec<f32> {
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 16_777_216.0
    };
    let place = |at: usize| 2.0 * at as f32 / (side - 1) as f32 - 1.0;
    (0..side * side)
        .map(|site| {
            // Twelve uniform numbers have the variance 1.
            let normal = (0..12).map(|_| uniform()).sum::<f32>() - 6.0;
            let (x, y) = (place(site % side), place(site / side));
            (1.0 - 0.125 * (x * x + y * y)) * (1.0 + 0.008 * normal)
        })
        .collect()
}

/// The frames of one setting.
#[derive(Clone)]
pub(super) struct Shots {
    pub(super) side: usize,
    pub(super) bias: Vec<Vec<u16>>,
    /// Frames by exposure.
    pub(super) flats: Vec<Vec<Vec<u16>>>,
}

impl Shots {
    /// So many bias frames, and pairs of flats at five exposures from 2 to 60 % of white.
    pub(super) fn take(sensor: &Sensor, bias: usize, pairs: usize) -> Self {
        Self::take_drifting(sensor, bias, pairs, 0.0)
    }

    /// The same under a lamp that gives the second frame of each pair more light, by the share `drift`.
    pub(super) fn take_drifting(sensor: &Sensor, bias: usize, pairs: usize, drift: f32) -> Self {
        let level = |exposure: i32| 0.02 * 30_f32.powf(exposure as f32 / 4.0);
        let bias = (0..bias).map(|i| sensor.shoot(&format!("bias {i}"), 0.0));
        let flats = (0..5).map(|exposure| {
            let frames = 0..2 * pairs;
            let shoot = |i| {
                let light = level(exposure) * if i % 2 == 1 { 1.0 + drift } else { 1.0 };
                sensor.shoot(&format!("flat {exposure} {i}"), light)
            };
            frames.map(shoot).collect()
        });
        Self { side: sensor.side, bias: bias.collect(), flats: flats.collect() }
    }

    /// The same with every frame changed.
    pub(super) fn each(&self, mut change: impl FnMut(&[u16]) -> Vec<u16>) -> Self {
        let mut all = |frames: &[Vec<u16>]| frames.iter().map(|frame| change(frame)).collect();
        Self { side: self.side, bias: all(&self.bias), flats: self.flats.iter().map(|frames| all(frames)).collect() }
    }

    /// Writes the frames into the folders of a setting.
    pub(super) fn write(&self, folder: &Path, form: Form) {
        let write = |kind: &str, frames: &[Vec<u16>]| {
            for (index, frame) in frames.iter().enumerate() {
                let name = format!("{kind}/{index:02}.{}", form.ending());
                let path = folder.join(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, form.encode(frame, self.side)).unwrap();
            }
        };
        write("bias", &self.bias);
        for (index, frames) in self.flats.iter().enumerate() {
            write(&format!("flat-{index}"), frames);
        }
    }
}

/// A form of files.
#[derive(Clone, Copy)]
pub(super) enum Form {
    Png,
    Tiff(Compression),
    Pgm,
}

impl Form {
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Tiff(_) => "tif",
            Self::Pgm => "pgm",
        }
    }

    /// A file of a square frame.
    pub(super) fn encode(self, frame: &[u16], side: usize) -> Vec<u8> {
        let bytes = frame.iter().flat_map(|sample| sample.to_be_bytes());
        let mut file = Cursor::new(Vec::new());
        let size = side as u32;
        match self {
            Self::Pgm => {
                let header = format!("P5\n{side} {side}\n65535\n");
                return header.bytes().chain(bytes).collect();
            }
            Self::Png => {
                let mut encoder = png::Encoder::new(&mut file, size, size);
                encoder.set_color(png::ColorType::Grayscale);
                encoder.set_depth(png::BitDepth::Sixteen);
                encoder.set_compression(png::Compression::Fast);
                let mut writer = encoder.write_header().unwrap();
                let bytes: Vec<u8> = bytes.collect();
                writer.write_image_data(&bytes).unwrap();
            }
            Self::Tiff(compression) => {
                let encoder = TiffEncoder::new(&mut file).unwrap();
                let mut encoder = encoder.with_compression(compression);
                encoder.write_image::<Gray16>(size, size, frame).unwrap();
            }
        }
        file.into_inner()
    }
}
