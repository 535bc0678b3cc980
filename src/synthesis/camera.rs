//! The camera that a frame is taken with: [`CameraModel`] and one [`CameraState`] of it.

use serde::Serialize;

use super::colour::{self, Matrix};
use super::random::{Component, NoiseKey, Site, Stream};
use super::sensor;
use crate::error::{Error, Result};

/// The system gains K that may be pinned; the calibration's own range is 0.094 to 6.01.
const GAINS: [f64; 2] = [0.01, 100.0];
/// The amplification ratios r that may be pinned.
const RATIOS: [f64; 2] = [1.0, 10000.0];

/// The distribution that each frame's camera is drawn from.
///
/// The default is the paper's: a Sony A7S2 with its gain K log-uniform in [0.1, 6.0] and its amplification ratio r
/// uniform in [100, 300]. Either may be pinned; pinning one leaves every other number of the state as it was drawn,
/// save what is a function of K.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct CameraModel {
    gain: Option<f64>,
    ratio: Option<f64>,
}

impl CameraModel {
    /// Pins the system gain K, in ADU an electron (`--gain`).
    ///
    /// # Errors
    /// Where K is not within 0.01 to 100.
    pub fn pin_gain(&mut self, gain: f64) -> Result<()> {
        self.gain = Some(within("--gain", gain, GAINS)?);
        Ok(())
    }

    /// Pins the ratio r by which the light is cut before the shot noise and amplified after it (`--ratio`).
    ///
    /// # Errors
    /// Where r is not within 1 to 10000.
    pub fn pin_ratio(&mut self, ratio: f64) -> Result<()> {
        self.ratio = Some(within("--ratio", ratio, RATIOS)?);
        Ok(())
    }
}

fn within(flag: &str, value: f64, [low, high]: [f64; 2]) -> Result<f64> {
    if value >= low && value <= high {
        Ok(value)
    } else {
        Err(Error::usage(
            flag,
            format_args!("{value} is not a number from {low} to {high}"),
        ))
    }
}

/// Everything about the camera that takes one frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraState {
    /// Linear sRGB → camera, rows summing to 1.
    pub rgb_to_camera: Matrix,
    /// Camera → linear sRGB: the inverse of `rgb_to_camera`.
    pub camera_to_rgb: Matrix,
    /// Brightness gain of all channels.
    pub rgb_gain: f64,
    /// White-balance gain of red.
    pub red_gain: f64,
    /// White-balance gain of blue.
    pub blue_gain: f64,
    /// System gain K, in ADU an electron.
    pub system_gain: f64,
    /// Amplification ratio r.
    pub ratio: f64,
    /// Scale σ_TL of the read noise's Tukey-λ distribution, in ADU; not its standard deviation.
    pub read_scale: f64,
    /// Shape λ of the same distribution.
    pub read_shape: f64,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: f64,
    /// Offset of each Bayer plane, in ADU, in the order R, Gr, Gb, B.
    pub bias: [f64; 4],
    /// The range of a sample above its black level, in ADU.
    pub adu_range: f64,
}

impl CameraState {
    /// Draws the camera of the frame that `key` belongs to.
    ///
    /// Matrix and gains follow Brooks et al. 2019, the sensor's noise Wei et al. 2021, K and r DarkQA.
    #[must_use]
    pub fn draw(key: &NoiseKey, model: &CameraModel) -> Self {
        let draws = Draws(key.stream(Component::Camera));
        let weights = Number::WEIGHTS.map(|number| draws.uniform(number));
        let rgb_to_camera = colour::rgb_to_camera(weights);
        let drawn_gain = 0.1 * libm::exp(draws.uniform(Number::Gain) * libm::log(60.0));
        let system_gain = model.gain.unwrap_or(drawn_gain);
        let noise = sensor::noise_at(
            system_gain,
            [
                draws.normal(Number::ReadScale, 0),
                draws.normal(Number::RowDeviation, 0),
            ],
            [Number::ReadShape, Number::Bias].map(|number| draws.uniform(number)),
        );
        Self {
            rgb_to_camera,
            camera_to_rgb: colour::inverse(&rgb_to_camera),
            rgb_gain: 1.0 / draws.cut_normal(Number::RgbGain),
            red_gain: draws.between(Number::RedGain, 1.9, 2.4),
            blue_gain: draws.between(Number::BlueGain, 1.5, 1.9),
            system_gain,
            ratio: model
                .ratio
                .unwrap_or_else(|| draws.between(Number::Ratio, 100.0, 300.0)),
            read_scale: noise.read_scale,
            read_shape: noise.read_shape,
            row_deviation: noise.row_deviation,
            bias: noise.bias,
            adu_range: sensor::ADU_RANGE,
        }
    }
}

/// The numbers of a state, each with its own place in the camera's stream: none depends on how many others are drawn.
#[derive(Debug, Clone, Copy)]
enum Number {
    FirstWeight,
    SecondWeight,
    ThirdWeight,
    FourthWeight,
    RgbGain,
    RedGain,
    BlueGain,
    Gain,
    Ratio,
    ReadScale,
    RowDeviation,
    ReadShape,
    Bias,
}

impl Number {
    const WEIGHTS: [Self; 4] = [
        Self::FirstWeight,
        Self::SecondWeight,
        Self::ThirdWeight,
        Self::FourthWeight,
    ];
}

/// The camera's stream, addressed by what is drawn.
#[derive(Debug, Clone, Copy)]
struct Draws(Stream);

impl Draws {
    fn uniform(self, number: Number) -> f64 {
        self.0.uniform(Site::new(number as usize, 0))
    }

    fn normal(self, number: Number, draw: u32) -> f64 {
        self.0.normal(Site::new(number as usize, 0), draw)
    }

    fn between(self, number: Number, low: f64, high: f64) -> f64 {
        low + self.uniform(number) * (high - low)
    }

    /// N(0.8, 0.1), drawn again beyond three deviations: uncut, its inverse, the brightness gain, has no bound.
    fn cut_normal(self, number: Number) -> f64 {
        let mut draw = 0;
        loop {
            let z = self.normal(number, draw);
            if z.abs() <= 3.0 {
                return 0.8 + 0.1 * z;
            }
            draw += 1;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::types::FrameId;

    /// The camera at the middle of each distribution: the one that published figures of flat greys are for.
    pub(in crate::synthesis) fn median() -> CameraState {
        let rgb_to_camera = colour::rgb_to_camera([1.0; 4]);
        let system_gain = 0.6f64.sqrt();
        let noise = sensor::noise_at(system_gain, [0.0; 2], [0.0; 2]);
        CameraState {
            rgb_to_camera,
            camera_to_rgb: colour::inverse(&rgb_to_camera),
            rgb_gain: 1.25,
            red_gain: 2.15,
            blue_gain: 1.7,
            system_gain,
            ratio: 200.0,
            read_scale: noise.read_scale,
            read_shape: noise.read_shape,
            row_deviation: noise.row_deviation,
            bias: noise.bias,
            adu_range: sensor::ADU_RANGE,
        }
    }

    fn states(model: &CameraModel, n: usize) -> Vec<CameraState> {
        let key = |i| NoiseKey::new(5, &FrameId(format!("frame {i}")));
        (0..n).map(|i| CameraState::draw(&key(i), model)).collect()
    }

    /// The largest distance between the sample's distribution function and `cdf`, in units of 1/√n.
    fn kolmogorov(mut sample: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
        sample.sort_by(f64::total_cmp);
        let n = sample.len() as f64;
        let gap = |(i, x): (usize, &f64)| {
            let f = cdf(*x);
            (f - i as f64 / n).abs().max(((i + 1) as f64 / n - f).abs())
        };
        sample.iter().enumerate().map(gap).fold(0.0, f64::max) * n.sqrt()
    }

    #[test]
    fn numbers_have_their_distributions() {
        let all = states(&CameraModel::default(), 10_000);
        let of = |f: fn(&CameraState) -> f64| all.iter().map(f).collect::<Vec<_>>();
        let uniform = |low: f64, high: f64| move |x: f64| (x - low) / (high - low);
        let normal = |z: f64| 0.5 * libm::erfc(-z / f64::sqrt(2.0));
        let cut = |inverse: f64| {
            (normal((inverse - 0.8) / 0.1) - normal(-3.0)) / (1.0 - 2.0 * normal(-3.0))
        };
        let cases = [
            (
                "K",
                kolmogorov(
                    of(|s| s.system_gain.ln()),
                    uniform(0.1f64.ln(), 6.0f64.ln()),
                ),
            ),
            ("r", kolmogorov(of(|s| s.ratio), uniform(100.0, 300.0))),
            ("red", kolmogorov(of(|s| s.red_gain), uniform(1.9, 2.4))),
            ("blue", kolmogorov(of(|s| s.blue_gain), uniform(1.5, 1.9))),
            ("1/rgb", kolmogorov(of(|s| 1.0 / s.rgb_gain), cut)),
        ];
        for (name, distance) in cases {
            assert!(distance < 1.95, "{name}: {distance}");
        }
        assert!(
            all.iter()
                .all(|s| (0.5..=1.1).contains(&(1.0 / s.rgb_gain)))
        );
        assert!(all.iter().all(|s| (0.1..=6.0).contains(&s.system_gain)));
    }

    #[test]
    fn a_pinned_number_moves_no_other() {
        let mut pinned = CameraModel::default();
        pinned.pin_ratio(42.0).unwrap();
        let (free, fixed) = (states(&CameraModel::default(), 20), states(&pinned, 20));
        for (free, fixed) in free.into_iter().zip(fixed) {
            assert_eq!(
                CameraState {
                    ratio: 42.0,
                    ..free
                },
                fixed
            );
        }
        pinned.pin_gain(6.0).unwrap();
        for state in states(&pinned, 20) {
            assert!((state.system_gain - 6.0).abs() < f64::EPSILON);
            assert!([-1.5595009, -1.5529999].contains(&state.bias[0]));
        }
    }

    #[test]
    fn frames_and_seeds_have_their_own_camera() {
        let draw = |seed, id: &str| {
            CameraState::draw(
                &NoiseKey::new(seed, &FrameId(id.to_owned())),
                &CameraModel::default(),
            )
        };
        assert_eq!(draw(1, "a"), draw(1, "a"));
        assert_ne!(draw(1, "a"), draw(2, "a"));
        assert_ne!(draw(1, "a"), draw(1, "b"));
    }

    #[test]
    fn pins_are_checked_and_name_their_flag() {
        let mut model = CameraModel::default();
        for wrong in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e9] {
            let gain = model.pin_gain(wrong).unwrap_err().to_string();
            assert!(gain.contains("--gain"), "{gain}");
            let ratio = model.pin_ratio(wrong).unwrap_err().to_string();
            assert!(ratio.contains("--ratio"), "{ratio}");
        }
        assert_eq!(model, CameraModel::default());
    }
}
