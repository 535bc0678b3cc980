//! Noisy RAW image of a frame, which can be developed at any level ([`Negative`]), and development of several levels at
//! once ([`ladder`]).

use rayon::prelude::*;

use super::bayer::Bayer;
use super::isp::Developer;
use super::noise::{Noise, Term};
use super::unprocess::Unprocess;
use crate::camera::CameraState;
use crate::clean::Clean;
use crate::draws::NoiseKey;
use crate::noise_profile::{Amplify, Coupling, Draws, Synthesis, Tone};
use darkqa_base::types::images::{Isa, Sample};
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

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::FrameId;

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
}
