//! A frame as the sensor took it: a [`Negative`], developed at any level that it serves; or a whole [`ladder`] at once.

use rayon::prelude::*;

use super::bayer::Bayer;
use super::camera::CameraState;
use super::isp::Developer;
use super::lanes::Isa;
use super::noise::{Noise, Term};
use super::random::NoiseKey;
use super::reading::{Amplify, Coupling, Draws, Synthesis, Tone};
use super::unprocess::Unprocess;
use crate::types::{Rgb, Severity};

/// Rows of a band: it and its neighbours' edges stay in a core's cache from RAW to code.
const BAND: usize = 32;

/// One noisy RAW image: camera and noise are drawn once, and shared by the levels made from it.
///
/// So the levels differ in light alone; each has the distribution that draws of its own would give it.
#[derive(Debug)]
pub struct Negative {
    developer: Developer,
    balanced: Bayer,
    /// The one level that it serves; `None` for all.
    only: Option<Severity>,
    /// Height and width of the frame.
    size: [usize; 2],
}

impl Negative {
    /// Takes `clean` for a level, with camera and noise drawn from the key.
    #[must_use]
    pub fn new(clean: &Rgb, key: &NoiseKey, synthesis: &Synthesis, severity: Severity) -> Self {
        let shot = Capture::new(key, synthesis, severity, Isa::best());
        Self {
            only: (!synthesis.shares_negative()).then_some(severity),
            ..Self::of(clean, shot)
        }
    }

    /// Takes `clean` with a camera in a given state, and with the given terms of noise.
    #[must_use]
    pub fn taken(
        clean: &Rgb,
        key: &NoiseKey,
        state: &CameraState,
        amplify: Amplify,
        tone: Tone,
        terms: &[Term],
    ) -> Self {
        let isa = Isa::best();
        Self::of(clean, Capture::with(key, state, amplify, tone, terms, isa))
    }

    fn of(clean: &Rgb, shot: Capture) -> Self {
        let (height, width) = (clean.height(), clean.width());
        let mut balanced = Bayer::covering(height, width);
        let lines = balanced.lines_mut().enumerate();
        lines.for_each(|(row, mut line)| shot.take(clean, row, &mut line));
        Self {
            developer: shot.developer,
            balanced,
            only: None,
            size: [height, width],
        }
    }

    /// Whether it is the negative of a level.
    #[must_use]
    pub fn serves(&self, severity: Severity) -> bool {
        self.only.is_none_or(|only| only == severity)
    }

    /// The sRGB image at a level.
    #[must_use]
    pub fn develop(&self, severity: Severity) -> Rgb {
        self.develop_by(severity.value())
    }

    /// The sRGB image after any exposure drop.
    #[must_use]
    pub fn develop_by(&self, drop_ev: f64) -> Rgb {
        let [height, width] = self.size;
        let mut dark = Rgb::black(height, width);
        let rows = dark.samples_mut().par_chunks_mut(3 * width).enumerate();
        rows.for_each_init(
            || vec![0.0; 3 * width],
            |display, (row, codes)| {
                self.developer.display(&self.balanced, row, display);
                self.developer.encode(display, drop_ev, codes);
            },
        );
        dark
    }
}

/// The images of a frame at several levels, each in the image of that place in `dark`, of the frame's size.
///
/// They are those of [`Negative::develop`]; made together, they cost less time and memory.
///
/// # Panics
/// Where an image is of another size, or there are more levels than images.
pub fn ladder(
    clean: &Rgb,
    key: &NoiseKey,
    synthesis: &Synthesis,
    levels: &[Severity],
    dark: &mut [Rgb],
) {
    let isa = Isa::best();
    if synthesis.shares_negative() {
        if let Some(level) = levels.first() {
            Capture::new(key, synthesis, *level, isa).develop(clean, levels, dark);
        }
    } else {
        for (level, dark) in levels.iter().zip(dark) {
            let shot = Capture::new(key, synthesis, *level, isa);
            shot.develop(clean, &[*level], std::slice::from_mut(dark));
        }
    }
}

/// One press of the shutter: a camera's state with its noise, ready for any row.
struct Capture {
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
        Self::with(&key, &state, amplify, tone, &Term::ALL, isa)
    }

    fn with(
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

    /// A sensor row, noisy and balanced.
    fn take(&self, clean: &Rgb, row: usize, line: &mut super::bayer::RawRow<'_>) {
        self.unprocess.act(clean, row, line);
        self.noise.act(row, line);
        self.developer.balance(row, line);
        line.seal();
    }

    /// Develops the levels band by band.
    fn develop(&self, clean: &Rgb, levels: &[Severity], dark: &mut [Rgb]) {
        let (height, width) = (clean.height(), clean.width());
        let mut bands: Vec<Vec<&mut [u8]>> = Vec::new();
        bands.resize_with(height.div_ceil(BAND), Vec::new);
        for image in &mut dark[..levels.len()] {
            assert_eq!((image.height(), image.width()), (height, width));
            let parts = image.samples_mut().chunks_mut(BAND * 3 * width);
            for (band, part) in bands.iter_mut().zip(parts) {
                band.push(part);
            }
        }
        // A band has two rows more on either side, so that it begins with a red one; at the image's edges they are none.
        let scratch = || (Bayer::covering(BAND + 4, width), vec![0.0; 3 * width]);
        bands.into_par_iter().enumerate().for_each_init(
            scratch,
            |(raw, display), (band, mut parts)| {
                let first = band * BAND;
                let rows = BAND.min(height - first);
                let lead = if first == 0 { 0 } else { 2 };
                let end = (first + rows + 2).min(height.next_multiple_of(2));
                if raw.height() != end + lead - first {
                    *raw = Bayer::covering(end + lead - first, width);
                }
                for at in lead.saturating_sub(1)..raw.height().min(lead + rows + 1) {
                    self.take(clean, first + at - lead, &mut raw.line_mut(at));
                }
                for row in 0..rows {
                    self.developer.display(raw, lead + row, display);
                    for (level, part) in levels.iter().zip(&mut parts) {
                        let codes = &mut part[row * 3 * width..][..3 * width];
                        self.developer.encode(display, level.value(), codes);
                    }
                }
            },
        );
    }
}

impl Synthesis {
    /// The camera of the frame that `key` belongs to, as it is at a level.
    #[must_use]
    pub fn state(&self, key: &NoiseKey, severity: Severity) -> CameraState {
        self.state_by(key, severity.value())
    }

    /// The same as it is after any exposure drop; light that is not lost is no reason to amplify.
    #[must_use]
    pub fn state_by(&self, key: &NoiseKey, drop_ev: f64) -> CameraState {
        let drawn = CameraState::draw(key, &self.camera);
        match self.coupling {
            Coupling::Independent => drawn,
            Coupling::Photon => CameraState {
                ratio: libm::exp2(drop_ev.max(0.0)),
                ..drawn
            },
        }
    }

    /// Whether all levels of a frame are made from one negative.
    #[must_use]
    pub fn shares_negative(&self) -> bool {
        self.draws == Draws::Shared && self.coupling == Coupling::Independent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::FrameId;

    /// Dark, bright and in between, so that every way through the samplers is taken.
    fn clean() -> Rgb {
        let samples = (0..40 * 150 * 3).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8);
        Rgb::new(40, 150, samples.collect()).unwrap()
    }

    /// No instruction set changes a byte: not of the exposure branch, and not of the sensor branch at any gain or ratio.
    #[test]
    fn instructions_do_not_enter() {
        let sets = Isa::present();
        let clean = clean();
        let key = NoiseKey::new(9, &FrameId("isa".to_owned()));
        let choices = [
            (Amplify::ShotOnly, Tone::None),
            (Amplify::All, Tone::BeforeEv),
            (Amplify::All, Tone::AfterEv),
        ];
        for (gain, ratio) in [(0.1, 100.0), (6.0, 300.0), (0.05, 4.0), (0.01, 1.0)] {
            let drawn = CameraState::draw(&key, &crate::synthesis::CameraModel::default());
            let state = CameraState {
                system_gain: gain,
                ratio,
                ..drawn
            };
            for (amplify, tone) in choices {
                let develop = |isa: &Isa| {
                    let shot = Capture::with(&key, &state, amplify, tone, &Term::ALL, *isa);
                    let mut dark = Severity::LADDER.map(|_| Rgb::black(40, 150));
                    shot.develop(&clean, &Severity::LADDER, &mut dark);
                    dark
                };
                let baseline = develop(&Isa::Baseline);
                for isa in &sets {
                    assert_eq!(baseline, develop(isa), "{isa:?}, K {gain}, r {ratio}");
                }
            }
        }
    }
}
