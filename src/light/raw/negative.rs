//! Noisy RAW image of a frame, which can be developed at any level ([`Negative`]), and development of several levels at
//! once ([`ladder`]).
//!
//! Noise-free RAW image of a frame, for adding noise of several strengths: [`CleanRaw`].
//!
//! RAW → sRGB: the simple image processing of the paper ([`Developer`]).
//!
//! Two steps are not in the list of the paper. First, the brightness gain is applied again: the paper names only white
//! balance, but calls the processing "an inverse operation of unprocessing", which divides by this gain. Second, light
//! is clipped to [0, 1] before demosaicing and after the matrix, as in the code of Brooks et al. 2019 (`process.py`),
//! so that negative noise becomes black. The module `departures` measures both effects.
//!
//! The steps: white balance and brightness gains, clip; bilinear demosaic; camera → sRGB, clip; exposure drop; gamma
//! compression; 8 bit. Because (2^−ΔEV · x)^(1/2.2) is 2^(−ΔEV/2.2) · x^(1/2.2), the drop is applied as a factor after
//! the gamma compression, and all steps before it are shared by all levels.

use std::sync::LazyLock;

use rayon::prelude::*;

use super::bayer::{self, Bayer, Plane, RawRow, Sites};
use super::noise::{Noise, Term};
use super::unprocess::{Unprocess, unprocess_with_headroom};
use crate::camera::CameraState;
use crate::clean::{self, Clean};
use crate::draws::{LANES, Lanes, NoiseKey, Piecewise};
use crate::noise_profile::{Amplify, Coupling, Draws, Synthesis, Tone};
use darkqa_base::types::images::{Isa, Kernel, Sample};
use darkqa_base::types::{Image, Rgb, Severity};

/// Rows per band; a band is processed from RAW to codes within the cache of a core. Chosen, so that images of 480, 720,
/// 1080 or 1440 rows have an even number of bands, which two threads share equally.
const BAND: usize = 30;

/// Noisy RAW image of a frame. All levels developed from it share the drawn camera and noise, and differ only in light.
/// The distribution of each level is the same as with separate draws.
#[derive(Debug)]
pub struct Negative {
    developer: Developer,
    balanced: Bayer,
    /// The only level that may be developed from this negative; `None` for all levels.
    only_level: Option<Severity>,
    /// Height and width of the frame, in pixels.
    size: [usize; 2],
}

impl Negative {
    /// Makes the negative of `clean` for a level, with camera and noise drawn from the key.
    #[must_use]
    pub fn new<'a>(clean: impl Into<Clean<'a>>, key: &NoiseKey, synthesis: &Synthesis, severity: Severity) -> Self {
        let clean = clean.into();
        let capture = Capture::new(key, synthesis, severity, Isa::best())
            .for_clean(clean, synthesis.headroom_ev(severity.value()));
        Self { only_level: (!synthesis.shares_negative()).then_some(severity), ..Self::from_capture(clean, capture) }
    }

    /// Makes the negative of `clean` for a camera in the given state with the given noise terms, for all levels.
    /// `headroom_ev` is that of the noise profile ([`Synthesis::headroom_ev`]); it only affects linear scene light.
    #[must_use]
    pub fn with_state<'a>(
        clean: impl Into<Clean<'a>>,
        key: &NoiseKey,
        state: &CameraState,
        amplify: Amplify,
        tone: Tone,
        terms: &[Term],
        headroom_ev: f64,
    ) -> Self {
        let clean = clean.into();
        let capture = Capture::from_state(key, state, amplify, tone, terms, Isa::best());
        Self::from_capture(clean, capture.for_clean(clean, headroom_ev))
    }

    /// The negative of a noisy, white-balanced RAW image that covers `size`, for all levels.
    pub(super) fn from_balanced(developer: Developer, balanced: Bayer, size: [usize; 2]) -> Self {
        Self { developer, balanced, only_level: None, size }
    }

    fn from_capture(clean: Clean<'_>, capture: Capture) -> Self {
        let (height, width) = (clean.height(), clean.width());
        let mut balanced = Bayer::covering(height, width);
        balanced.lines_mut().enumerate().for_each(|(row, mut line)| capture.capture_row(clean, row, &mut line));
        Self::from_balanced(capture.developer, balanced, [height, width])
    }

    /// True if a level may be developed from this negative.
    #[must_use]
    pub fn can_develop(&self, severity: Severity) -> bool {
        self.only_level.is_none_or(|only| only == severity)
    }

    /// Develops the sRGB image at a level.
    #[must_use]
    pub fn develop(&self, severity: Severity) -> Rgb {
        self.develop_by(severity.value())
    }

    /// Develops the sRGB image after any exposure drop.
    #[must_use]
    pub fn develop_by(&self, drop_ev: f64) -> Rgb {
        let [height, width] = self.size;
        let factor = self.developer.factor(drop_ev);
        let mut degraded = Rgb::black(height, width);
        degraded.samples_mut().par_chunks_mut(3 * width).enumerate().for_each_init(
            || vec![0.0; 3 * width],
            |display, (row, codes)| {
                self.developer.display(&self.balanced, row, display);
                self.developer.encode(display, factor, codes);
            },
        );
        degraded
    }
}

/// Develops a frame at several levels: `images[i]` receives the samples of the image at `levels[i]`.
///
/// The images equal those of [`Negative::develop`]; together they take less time and memory.
///
/// # Panics
/// If an image has another number of samples than the frame, or there are more levels than images.
pub fn ladder<'a>(
    clean: impl Into<Clean<'a>>,
    key: &NoiseKey,
    synthesis: &Synthesis,
    levels: &[Severity],
    images: &mut [&mut [u8]],
) {
    let (clean, isa) = (clean.into(), Isa::best());
    if synthesis.shares_negative() {
        if let Some(level) = levels.first() {
            let drops: Vec<f64> = levels.iter().map(|level| level.value()).collect();
            let capture = Capture::new(key, synthesis, *level, isa);
            capture.for_clean(clean, 0.0).develop(clean, &drops, images);
        }
    } else {
        for (level, image) in levels.iter().zip(images) {
            let capture = Capture::new(key, synthesis, *level, isa);
            let capture = capture.for_clean(clean, synthesis.headroom_ev(level.value()));
            capture.develop(clean, &[level.value()], std::slice::from_mut(image));
        }
    }
}

/// Makes the image of a frame after an exposure drop, with the noise of the camera drawn from the key.
#[must_use]
pub(crate) fn develop_by(clean: Clean<'_>, key: &NoiseKey, synthesis: &Synthesis, drop_ev: f64) -> Rgb {
    let state = synthesis.state_after_drop(key, drop_ev);
    let Synthesis { amplify, tone, .. } = *synthesis;
    let headroom = synthesis.headroom_ev(drop_ev);
    develop_with_state(clean, key, &state, amplify, tone, [drop_ev, headroom])
}

/// Makes the image of a frame after an exposure drop, with the noise of a camera in the given state. The last argument
/// is the drop and the headroom of the noise profile ([`Synthesis::headroom_ev`]), in EV.
#[must_use]
pub fn develop_with_state(
    clean: Clean<'_>,
    key: &NoiseKey,
    state: &CameraState,
    amplify: Amplify,
    tone: Tone,
    [drop_ev, headroom_ev]: [f64; 2],
) -> Rgb {
    let capture = Capture::from_state(key, state, amplify, tone, &Term::ALL, Isa::best()).for_clean(clean, headroom_ev);
    let mut image = Rgb::black(clean.height(), clean.width());
    capture.develop(clean, &[drop_ev], &mut [image.samples_mut()]);
    image
}

/// A sample type of developed images: 8-bit codes or linear light.
pub(crate) trait OutputSample: Sample + Send {
    /// Converts display values after an exposure drop with this [`Developer::factor`].
    fn write(developer: &Developer, display: &[f32], factor: f32, samples: &mut [Self]);
}

/// 8-bit codes.
impl OutputSample for u8 {
    fn write(developer: &Developer, display: &[f32], factor: f32, samples: &mut [Self]) {
        developer.encode(display, factor, samples);
    }
}

/// Linear light.
impl OutputSample for f32 {
    fn write(developer: &Developer, display: &[f32], factor: f32, samples: &mut [Self]) {
        developer.expand(display, factor, samples);
    }
}

/// One exposure of the sensor: camera state and noise, prepared for any row.
pub(crate) struct Capture {
    unprocess: Unprocess,
    noise: Noise,
    developer: Developer,
}

impl Capture {
    fn new(key: &NoiseKey, synthesis: &Synthesis, severity: Severity, isa: Isa) -> Self {
        let state = synthesis.state(key, severity);
        let key = match synthesis.draws {
            Draws::Shared => *key,
            Draws::Fresh => key.at(severity),
        };
        let Synthesis { amplify, tone, .. } = *synthesis;
        Self::from_state(&key, &state, amplify, tone, &Term::ALL, isa)
    }

    /// Makes the image of a frame after an exposure drop. Drop and headroom of the noise profile are in EV.
    pub(crate) fn image<T: OutputSample>(self, clean: Clean<'_>, drop_ev: f64, headroom_ev: f64) -> Image<T> {
        let mut image = Image::black(clean.height(), clean.width());
        let capture = self.for_clean(clean, headroom_ev);
        capture.develop(clean, &[drop_ev], &mut [image.samples_mut()]);
        image
    }

    pub(crate) fn from_state(
        key: &NoiseKey,
        state: &CameraState,
        amplify: Amplify,
        tone: Tone,
        terms: &[Term],
        isa: Isa,
    ) -> Self {
        Self {
            unprocess: Unprocess::new(state, isa),
            noise: Noise::new(state, key, amplify, terms, isa),
            developer: Developer::new(state, tone, isa),
        }
    }

    /// Adapts the exposure to the pixel format of a frame. For codes and display light the sensor saturates at white.
    /// For linear scene light it saturates `headroom_ev` EV above white, and the tone curve before the drop is omitted,
    /// because it would only undo the inverse tone curve of codes.
    fn for_clean(self, clean: Clean<'_>, headroom_ev: f64) -> Self {
        if !matches!(clean, Clean::Scene(_)) {
            return self;
        }
        Self {
            unprocess: self.unprocess.with_headroom(libm::exp2(headroom_ev) as f32),
            developer: self.developer.for_linear_light(headroom_ev),
            ..self
        }
    }

    /// Fills a sensor row with the frame's samples, noisy and white-balanced.
    fn capture_row(&self, clean: Clean<'_>, row: usize, line: &mut super::bayer::RawRow<'_>) {
        self.unprocess.fill(clean, row, line);
        self.noise.apply(row, line);
        self.developer.balance(row, line);
        line.repeat_edges();
    }

    /// Develops the frame after each of these exposure drops, band by band. `images[i]` receives the samples of the
    /// image for `drops[i]`.
    fn develop<T: OutputSample>(&self, clean: Clean<'_>, drops: &[f64], images: &mut [&mut [T]]) {
        let (height, width) = (clean.height(), clean.width());
        let factors: Vec<f32> = drops.iter().map(|drop_ev| self.developer.factor(*drop_ev)).collect();
        let mut bands: Vec<Vec<&mut [T]>> = Vec::new();
        bands.resize_with(height.div_ceil(BAND), Vec::new);
        for image in &mut images[..drops.len()] {
            assert_eq!(image.len(), 3 * height * width);
            let parts = image.chunks_mut(BAND * 3 * width);
            for (band, part) in bands.iter_mut().zip(parts) {
                band.push(part);
            }
        }
        // A band has two more rows on each side, except at the edges of the image. Two, so that it starts with a row of
        // red sites.
        bands.into_par_iter().enumerate().for_each_init(
            || (Bayer::covering(BAND + 4, width), vec![0.0; 3 * width]),
            |(raw, display), (band, mut parts)| {
                let first = band * BAND;
                let rows = BAND.min(height - first);
                let lead = if first == 0 { 0 } else { 2 };
                let end = (first + rows + 2).min(height.next_multiple_of(2));
                if raw.height() != end + lead - first {
                    *raw = Bayer::covering(end + lead - first, width);
                }
                for at in lead.saturating_sub(1)..raw.height().min(lead + rows + 1) {
                    self.capture_row(clean, first + at - lead, &mut raw.line_mut(at));
                }
                for row in 0..rows {
                    self.developer.display(raw, lead + row, display);
                    for (factor, part) in factors.iter().zip(&mut parts) {
                        let samples = &mut part[row * 3 * width..][..3 * width];
                        T::write(&self.developer, display, *factor, samples);
                    }
                }
            },
        );
    }
}

impl Synthesis {
    /// State of the camera of the frame that `key` belongs to, at a level.
    #[must_use]
    pub fn state(&self, key: &NoiseKey, severity: Severity) -> CameraState {
        self.state_after_drop(key, severity.value())
    }

    /// State of the camera after any exposure drop. With [`Coupling::Photon`], the ratio is 1 for a negative drop.
    #[must_use]
    pub fn state_after_drop(&self, key: &NoiseKey, drop_ev: f64) -> CameraState {
        let drawn = CameraState::draw(key, &self.camera);
        match self.coupling {
            Coupling::Independent => drawn,
            Coupling::Photon => CameraState { ratio: libm::exp2(drop_ev.max(0.0)), ..drawn },
        }
    }

    /// Light at which the sensor saturates after an exposure drop, in EV above white ([`Coupling::headroom_ev`]).
    #[must_use]
    pub fn headroom_ev(&self, drop_ev: f64) -> f64 {
        self.coupling.headroom_ev(drop_ev)
    }

    /// True if all levels of a frame are developed from one negative.
    #[must_use]
    pub fn shares_negative(&self) -> bool {
        self.draws == Draws::Shared && self.coupling == Coupling::Independent
    }
}

/// Noise-free RAW image of a frame by one camera. Saves the conversion of the pixels if only the noise changes, not the
/// colours.
#[derive(Debug)]
pub struct CleanRaw {
    raw: Bayer,
    camera: CameraState,
    /// Light at which the sensor saturates, in EV above white; `None` unless the frame is linear scene light.
    headroom_ev: Option<f64>,
    /// Height and width of the frame, in pixels.
    size: [usize; 2],
}

impl CleanRaw {
    /// The noise-free RAW image of `clean` by a camera in the given state. `headroom_ev` is that of the noise profile
    /// ([`Synthesis::headroom_ev`](crate::Synthesis::headroom_ev)); it only affects linear scene light.
    #[must_use]
    pub fn new<'a>(clean: impl Into<Clean<'a>>, camera: CameraState, headroom_ev: f64) -> Self {
        let clean = clean.into();
        Self {
            raw: unprocess_with_headroom(clean, &camera, headroom_ev),
            camera,
            headroom_ev: matches!(clean, Clean::Scene(_)).then_some(headroom_ev),
            size: [clean.height(), clean.width()],
        }
    }

    /// Adds all noise terms of `state` and returns the negative. Colour matrix and gains are those of the camera of
    /// this image, not of `state`.
    ///
    /// Equals [`Negative::with_state`] if `state` has the same colours.
    #[must_use]
    pub fn negative(&self, key: &NoiseKey, state: &CameraState, amplify: Amplify, tone: Tone) -> Negative {
        let isa = Isa::best();
        let noise = Noise::new(state, key, amplify, &Term::ALL, isa);
        let developer = Developer::new(&self.camera, tone, isa);
        let developer = match self.headroom_ev {
            Some(headroom_ev) => developer.for_linear_light(headroom_ev),
            None => developer,
        };
        let mut balanced = self.raw.clone();
        balanced.lines_mut().enumerate().for_each(|(row, mut line)| {
            noise.apply(row, &mut line);
            developer.balance(row, &mut line);
            line.repeat_edges();
        });
        Negative::from_balanced(developer, balanced, self.size)
    }
}

/// Gamma compression of light from 2⁻³¹ up; light below 10⁻⁸ is treated as 10⁻⁸.
static GAMMA: LazyLock<Piecewise> = LazyLock::new(|| Piecewise::new(-31, clean::gamma_compress));

/// Light of display values from 2⁻³⁰ up.
static LIGHT: LazyLock<Piecewise> = LazyLock::new(|| Piecewise::new(-30, clean::gamma_expand));

/// Smallest display value in the table of light, 2⁻³⁰.
const DARKEST_DISPLAY: f32 = 1.0 / 1_073_741_824.0;

/// Smallest light in the table, 2⁻³¹: black, which is code 0 at every level.
const DARKEST: f32 = 1.0 / 2_147_483_648.0;

/// 2^23: adding it to a number from 0 to 255 leaves the nearest whole number in the lowest byte.
const ROUND: f32 = 8_388_608.0;

/// The light of a display value in [0, 1].
#[inline(always)]
fn expand(light: &Piecewise, display: f32) -> f32 {
    light.at(if display > DARKEST_DISPLAY { display } else { DARKEST_DISPLAY })
}

/// Image processing of one camera, prepared for any row.
#[derive(Debug)]
pub(crate) struct Developer {
    /// Gain of each Bayer plane: white balance times brightness.
    gains: [f32; 4],
    /// Matrix from camera colours to linear sRGB.
    matrix: [[f32; 3]; 3],
    tone: Tone,
    /// Light at which the sensor saturates, in EV above white.
    headroom_ev: f64,
    /// Light at which the sensor saturates; 1 is white.
    headroom: f32,
    isa: Isa,
}

impl Developer {
    pub(crate) fn new(state: &CameraState, tone: Tone, isa: Isa) -> Self {
        Self {
            gains: [state.red_gain, 1.0, 1.0, state.blue_gain].map(|balance| (balance * state.rgb_gain) as f32),
            matrix: state.camera_to_rgb.map(|row| row.map(|value| value as f32)),
            tone,
            headroom_ev: 0.0,
            headroom: 1.0,
            isa,
        }
    }

    /// Prepares for linear scene light and a sensor that saturates this many EV above white. Display values are then in
    /// units of the saturation, and no tone curve is applied before the drop.
    pub(super) fn for_linear_light(self, headroom_ev: f64) -> Self {
        let tone = match self.tone {
            Tone::BeforeEv => Tone::None,
            tone => tone,
        };
        Self { tone, headroom_ev, headroom: libm::exp2(headroom_ev) as f32, ..self }
    }

    /// The factor of an exposure drop on display values.
    pub(crate) fn factor(&self, drop_ev: f64) -> f32 {
        clean::display_factor(drop_ev - self.headroom_ev) as f32
    }

    /// Multiplies a sensor row by the white-balance and brightness gains and clips it between 0 and the sensor's
    /// saturation.
    pub(crate) fn balance(&self, row: usize, line: &mut RawRow<'_>) {
        for (parity, samples) in line.planes().into_iter().enumerate() {
            let gain = self.gains[Plane::at(row, parity) as usize];
            self.isa.run(WhiteBalance { gain, most: self.headroom, samples });
        }
    }

    /// Writes the display values in [0, 1] of a row of pixels before the exposure drop, as red, green, blue of each
    /// pixel. `values` may be shorter than the row.
    ///
    /// `row` is an index into `balanced`. The first and last row are mirrored; if `balanced` is a part of an image, it
    /// must also contain the rows next to those asked for.
    pub(crate) fn display(&self, balanced: &Bayer, row: usize, values: &mut [f32]) {
        let last = balanced.height() - 1;
        let rows = [if row == 0 { 1 } else { row - 1 }, row, if row == last { row - 1 } else { row + 1 }];
        self.isa.run(Display { developer: self, rows: rows.map(|row| balanced.sites(row)), row, values });
    }

    /// Writes the 8-bit codes of display values after an exposure drop with this [`Developer::factor`].
    pub(crate) fn encode(&self, display: &[f32], factor: f32, codes: &mut [u8]) {
        self.isa.run(EncodeNegative { display, factor, tone: self.tone, codes });
    }

    /// Writes the linear light of display values after an exposure drop. [`Developer::encode`] writes the same as
    /// rounded codes.
    pub(super) fn expand(&self, display: &[f32], factor: f32, light: &mut [f32]) {
        self.isa.run(Expand { display, factor, tone: self.tone, light });
    }
}

struct WhiteBalance<'a> {
    gain: f32,
    most: f32,
    samples: &'a mut [Lanes<f32>],
}

impl Kernel for WhiteBalance<'_> {
    #[inline(always)]
    fn run(self) {
        for sample in self.samples.as_flattened_mut() {
            let balanced = *sample * self.gain;
            let balanced = if balanced > 0.0 { balanced } else { 0.0 };
            *sample = if balanced < self.most { balanced } else { self.most };
        }
    }
}

/// Clips to [0, 1].
#[inline(always)]
fn clip(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}

struct Display<'a> {
    developer: &'a Developer,
    /// The rows above, at and below `row`.
    rows: [Sites<'a>; 3],
    row: usize,
    values: &'a mut [f32],
}

impl Kernel for Display<'_> {
    #[inline(always)]
    fn run(self) {
        let gamma = &*GAMMA;
        let scale = 1.0 / self.developer.headroom;
        let mut colours = [[[0.0; LANES]; 3]; 2];
        for (index, values) in self.values.chunks_mut(6 * LANES).enumerate() {
            bayer::demosaic(self.rows, self.row, index, &mut colours);
            self.developer.to_linear_srgb(&mut colours, scale);
            for channel in colours.as_flattened_mut() {
                *channel = gamma.lanes(channel);
            }
            let [[er, eg, eb], [or, og, ob]] = &colours;
            let mut pairs = [[0.0; 6]; LANES];
            for (lane, pair) in pairs.iter_mut().enumerate() {
                *pair = [er[lane], eg[lane], eb[lane], or[lane], og[lane], ob[lane]];
            }
            values.copy_from_slice(&pairs.as_flattened()[..values.len()]);
            if self.developer.tone == Tone::BeforeEv {
                for value in values {
                    *value = clean::smoothstep(*value);
                }
            }
        }
    }
}

impl Developer {
    /// Converts camera colours to linear sRGB in units of the sensor's saturation, clipped to [`DARKEST`] to 1. `scale`
    /// is 1 / that unit.
    #[inline(always)]
    fn to_linear_srgb(&self, colours: &mut bayer::Colours, scale: f32) {
        let [red, green, blue] = self.matrix;
        for [r, g, b] in colours {
            for i in 0..LANES {
                let camera = [r[i], g[i], b[i]];
                let product = |row: [f32; 3]| {
                    let x = row[0] * camera[0] + row[1] * camera[1] + row[2] * camera[2];
                    let x = x * scale;
                    let x = if x > DARKEST { x } else { DARKEST };
                    if x < 1.0 { x } else { 1.0 }
                };
                r[i] = product(red);
                g[i] = product(green);
                b[i] = product(blue);
            }
        }
    }
}

struct EncodeNegative<'a> {
    display: &'a [f32],
    /// Factor of the exposure drop on display values.
    factor: f32,
    tone: Tone,
    codes: &'a mut [u8],
}

impl Kernel for EncodeNegative<'_> {
    #[inline(always)]
    fn run(self) {
        let codes = self.codes.iter_mut().zip(self.display);
        if self.tone == Tone::AfterEv {
            for (code, value) in codes {
                let display = clean::smoothstep(clip(value * self.factor));
                *code = (display * 255.0 + ROUND).to_bits() as u8;
            }
        } else {
            let scale = 255.0 * self.factor;
            for (code, value) in codes {
                let scaled = value * scale;
                let scaled = if scaled < 255.0 { scaled } else { 255.0 };
                *code = (scaled + ROUND).to_bits() as u8;
            }
        }
    }
}

struct Expand<'a> {
    display: &'a [f32],
    /// Factor of the exposure drop on display values.
    factor: f32,
    tone: Tone,
    light: &'a mut [f32],
}

impl Kernel for Expand<'_> {
    #[inline(always)]
    fn run(self) {
        let table = &*LIGHT;
        for (light, value) in self.light.iter_mut().zip(self.display) {
            let display = clip(value * self.factor);
            *light = expand(
                table,
                match self.tone {
                    Tone::AfterEv => clean::smoothstep(display),
                    Tone::None | Tone::BeforeEv => display,
                },
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::median;
    use darkqa_base::types::{FrameId, Light, Rgb, Severity};

    /// Dark, medium and bright samples, so that every branch of the samplers is reached.
    fn clean() -> Rgb {
        let samples = (0..40 * 150 * 3).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8);
        Rgb::new(40, 150, samples.collect()).unwrap()
    }

    /// No instruction set changes a byte of the sensor branch, at any gain or ratio.
    #[test]
    fn the_instruction_set_does_not_change_the_image() {
        let sets = Isa::available();
        let clean = clean();
        let key = NoiseKey::new(9, &FrameId("isa".to_owned()));
        let choices = [(Amplify::ShotOnly, Tone::None), (Amplify::All, Tone::BeforeEv), (Amplify::All, Tone::AfterEv)];
        for (gain, ratio) in [(0.1, 100.0), (6.0, 300.0), (0.05, 4.0), (0.01, 1.0)] {
            let drawn = CameraState::draw(&key, &crate::CameraModel::default());
            let state = CameraState { system_gain: gain, ratio, ..drawn };
            for (amplify, tone) in choices {
                let mut baseline = None;
                for isa in [Isa::Baseline].iter().chain(&sets) {
                    let capture = Capture::from_state(&key, &state, amplify, tone, &Term::ALL, *isa);
                    let mut images = Severity::LADDER.map(|_| Rgb::black(40, 150));
                    let drops = Severity::LADDER.map(Severity::value);
                    let mut samples = images.each_mut().map(Rgb::samples_mut);
                    capture.develop((&clean).into(), &drops, &mut samples);
                    let expected = baseline.get_or_insert_with(|| images.clone());
                    assert_eq!(*expected, images, "{isa:?}, K {gain}, r {ratio}");
                }
            }
        }
    }

    #[test]
    fn negatives_equal_those_made_from_the_frame() {
        let samples = (0..21 * 35 * 3).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8);
        let codes = Rgb::new(21, 35, samples.collect()).unwrap();
        let samples = codes.samples().iter().map(|code| f32::from(*code) / 40.0);
        let light = Light::new(21, 35, samples.collect()).unwrap();
        let key = NoiseKey::new(4, &FrameId("raw".to_owned()));
        for clean in [Clean::Codes(&codes), Clean::Scene(&light)] {
            let raw = CleanRaw::new(clean, median(), 3.0);
            let mut images = Vec::new();
            for (gain, tone) in [(0.1, Tone::None), (6.0, Tone::BeforeEv)] {
                let state = CameraState { system_gain: gain, read_scale: 2.0 * gain, ..median() };
                let found = raw.negative(&key, &state, Amplify::All, tone);
                let found = found.develop_by(3.0);
                let terms = &Term::ALL;
                let whole = Negative::with_state(clean, &key, &state, Amplify::All, tone, terms, 3.0);
                assert_eq!(found, whole.develop_by(3.0), "K {gain}");
                images.push(found);
            }
            assert_ne!(images[0], images[1]);
        }
    }

    fn developer(tone: Tone) -> Developer {
        Developer::new(&median(), tone, Isa::best())
    }

    /// Comparison with the order of operations of the paper, except for light at the edge between two codes.
    #[test]
    fn codes_follow_the_formula_of_the_paper() {
        for level in Severity::LADDER {
            let factor = clean::light_factor(level.value());
            let light: Vec<f32> = (0..=300_000).map(|step| step as f32 / 300_000.0).collect();
            let display: Vec<f32> = light.iter().map(|x| GAMMA.at(x.max(DARKEST))).collect();
            let mut codes = vec![0; light.len()];
            let developer = developer(Tone::None);
            developer.encode(&display, developer.factor(level.value()), &mut codes);
            for (light, code) in light.iter().zip(codes) {
                let expected = clean::gamma_compress(factor * f64::from(*light));
                let edge = (expected * 255.0 + 0.5).fract();
                if edge > 1e-3 && edge < 1.0 - 1e-3 {
                    assert_eq!(code, clean::to_code(expected), "{level:?} at {light}");
                }
            }
        }
    }

    #[test]
    fn black_and_white_have_the_expected_codes() {
        let ends = Severity::LADDER.map(|level| {
            let mut codes = [7; 2];
            let display = [GAMMA.at(DARKEST), GAMMA.at(1.0)];
            let developer = developer(Tone::None);
            developer.encode(&display, developer.factor(level.value()), &mut codes);
            codes
        });
        assert_eq!(ends, [[0, 136], [0, 72], [0, 39], [0, 24], [0, 15]]);
        let mut codes = [0; 2];
        let developer = developer(Tone::None);
        developer.encode(&[0.9, 1.0], developer.factor(-3.0), &mut codes);
        assert_eq!(codes, [255, 255]);
    }

    #[test]
    fn gains_are_applied_to_their_planes_and_clipped() {
        let mut raw = Bayer::covering(2, 4);
        for row in 0..2 {
            let mut line = raw.line_mut(row);
            for plane in line.planes() {
                plane[0][..2].copy_from_slice(&[0.1, if row == 0 { -0.1 } else { 0.9 }]);
            }
            developer(Tone::None).balance(row, &mut line);
            line.repeat_edges();
        }
        let expected = [[0.1 * 2.15 * 1.25, 0.1 * 1.25, 0.0, 0.0], [0.1 * 1.25, 0.1 * 1.7 * 1.25, 1.0, 1.0]];
        for (row, expected) in expected.iter().enumerate() {
            for (column, expected) in expected.iter().enumerate() {
                let found = raw.sample(row, column);
                assert!((found - expected).abs() < 1e-6, "{row}, {column}: {found}");
            }
        }
    }
}
