//! Calibration of a camera from its own frames: [`calibrate`] measures the gain, read noise, row noise and offsets of a
//! sensor at each setting of its gain, from bias frames and pairs of flats. [`command`] writes them for `--noise
//! camera`.
//!
//! ```text
//! bias frames ─ mean ──► offsets, light, hot pixels, fixed pattern
//!             ─ differences of two ──► row noise σ_r, variance within rows
//!             ─ residuals about rows and planes ──► λ and σ_TL by likelihood of whole codes
//! flats ─ differences of two, by tile ──► photon transfer: variance = K · signal
//! settings ──► ln σ over ln K
//! ```
//!
//! Only a few frames are in memory at once, whatever the size of the recording. Sums over sites are integers, so that
//! the result does not depend on the number of threads.
//!
//! Sources: Wei et al., "Physics-based noise modeling for extreme low-light photography" (ELD); Janesick, *Photon
//! Transfer*; EMVA 1288 release 4 Linear.
//!
//! Code of white from overexposed frames: [`white_code`].
//!
//! Consistency checks between settings: [`order_doubts`].

mod bias;
pub(crate) mod command;
pub(crate) mod flats;
mod frames;
mod lines;
pub(crate) mod mosaic;
pub(crate) mod read_noise;
pub(crate) mod recording;
pub(crate) mod setting;
pub(crate) mod sums;

use std::path::{Path, PathBuf};

use serde::Serialize;

use darkqa_base::error::{Error, Result};
use darkqa_base::types::Digest;
use frames::{FrameReader, Inputs, in_batches};
use lines::NoiseKind;
use mosaic::FrameFacts;
use recording::SettingFiles;
use setting::MeasureContext;

pub(crate) use frames::{Cfa, Crop, ReadOptions};
pub(crate) use lines::{NoiseLine, SlopeSource};
pub(crate) use recording::Recording;
pub(crate) use setting::{Measured, SettingFit};

/// Settings of a calibration.
#[derive(Debug, Clone)]
pub(crate) struct CalibrateSettings {
    /// Options for reading files as frames.
    pub read: ReadOptions,
    /// Black level in ADU; `None` for the mean offset, rounded.
    pub black: Option<u16>,
    /// Code of white; `None` to measure it from the frames in `white/`.
    pub white: Option<u16>,
    /// Name of the camera.
    pub name: String,
}

/// Measured properties of a camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CameraFit {
    pub schema: &'static str,
    pub name: String,
    /// Name of the camera in the files.
    pub camera: Option<String>,
    pub cfa: Cfa,
    /// Width and height of the measured frames, in sites.
    pub size: [usize; 2],
    /// Black level in ADU.
    pub black: u16,
    /// Code of white.
    pub white: u16,
    /// Settings, in ascending order of K.
    pub settings: Vec<SettingFit>,
    /// σ_TL over K.
    pub read_scale: NoiseLine,
    /// σ_r over K.
    pub row_deviation: NoiseLine,
    /// Number of frames.
    pub frames: usize,
    /// Digest of the names and contents of all frames.
    pub frames_digest: Digest,
    /// First and last date in the files.
    pub dates: Option<[String; 2]>,
    /// Warnings and omissions.
    pub warnings: Vec<String>,
}

impl CameraFit {
    /// Range of a sample above the black level, in ADU.
    pub(crate) fn adu_range(&self) -> f64 {
        f64::from(self.white) - f64::from(self.black)
    }

    /// Offsets of the planes of a setting above the black level, in ADU.
    pub(crate) fn bias(&self, setting: &SettingFit) -> Vec<Measured> {
        let black = f64::from(self.black);
        setting.offsets.iter().map(|offset| Measured { value: offset.value - black, ..*offset }).collect()
    }
}

/// Measures a camera from its recording in `folder`. Calls `step` after each setting.
///
/// # Errors
/// If a frame cannot be read or differs from the others, or a check fails.
pub(crate) fn calibrate(
    folder: &Path,
    recording: &Recording,
    settings: &CalibrateSettings,
    step: impl Fn(),
) -> Result<CameraFit> {
    let reader = FrameReader::open(recording.first(), settings.read)?;
    let mut inputs = Inputs::default();
    let mut warnings = recording.notes.clone();
    warnings.extend(reader.omission_note());
    let white = match settings.white {
        Some(white) => {
            if recording.settings.iter().any(|setting| !setting.white.is_empty()) {
                warnings.push("frames in white/ are left out, because --white is set".to_owned());
            }
            white
        }
        None => white_code(&reader, recording, folder, &mut inputs)?,
    };
    let mut fits = Vec::new();
    for files in &recording.settings {
        let mut context = MeasureContext { reader: &reader, white, inputs: &mut inputs, warnings: &mut warnings };
        fits.push(setting::measure(files, &mut context)?);
        step();
    }
    warnings.extend(order_doubts(&fits, recording));
    fits.sort_by(|a, b| a.gain.value.total_cmp(&b.gain.value));
    let black = match settings.black {
        Some(black) => black,
        None => black_level(&fits),
    };
    if black >= white {
        let problem = format!("the black level {black} is not below white, {white}");
        return Err(Error::usage("--black", problem));
    }
    Ok(CameraFit {
        schema: "darkqa.calibration/1",
        name: settings.name.clone(),
        camera: reader.camera().map(str::to_owned),
        cfa: settings.read.cfa,
        size: [reader.layout.width, reader.layout.height],
        black,
        white,
        read_scale: NoiseLine::for_settings(&fits, NoiseKind::Read),
        row_deviation: NoiseLine::for_settings(&fits, NoiseKind::Row),
        settings: fits,
        frames: inputs.count(),
        frames_digest: inputs.digest(folder)?,
        dates: inputs.dates().cloned(),
        warnings,
    })
}

/// Black level in ADU: the mean offset of all planes of all settings, rounded.
fn black_level(fits: &[SettingFit]) -> u16 {
    let [count, sum] = fits
        .iter()
        .flat_map(|fit| &fit.offsets)
        .fold([0.0; 2], |[count, sum], offset| [count + 1.0, sum + offset.value]);
    (sum / f64::max(count, 1.0)).round() as u16
}

/// Minimum share of the samples of an overexposed frame at its maximum code (chosen).
const MIN_AT_WHITE: f64 = 0.5;

/// Maximum code of all overexposed frames.
///
/// # Errors
/// If no such frame exists, a frame is not overexposed, or their maximum codes differ.
fn white_code(reader: &FrameReader, recording: &Recording, folder: &Path, inputs: &mut Inputs) -> Result<u16> {
    let files: Vec<&PathBuf> = recording.settings.iter().flat_map(|setting| &setting.white).collect();
    let mut white: Option<(u16, &PathBuf)> = None;
    in_batches(
        &files,
        reader.bytes_of_frame(),
        |path| top_code(reader, path),
        |path, (top, facts)| {
            inputs.add(path, &facts);
            match white {
                Some((known, first)) if known != top => {
                    let problem = format!(
                        "white is {top}, but {known} in {}: state one code of white with --white",
                        first.display()
                    );
                    Err(Error::data(path.display(), problem))
                }
                _ => {
                    white = Some((top, path));
                    Ok(())
                }
            }
        },
    )?;
    let problem = "the code of white is not known: state it with --white, or add overexposed frames in SETTING/white/";
    white.map_or_else(|| Err(Error::data(folder.display(), problem)), |(code, _)| Ok(code))
}

/// Maximum code of an overexposed frame, with the facts of its file.
fn top_code(reader: &FrameReader, path: &Path) -> Result<(u16, FrameFacts)> {
    let frame = reader.read(path)?;
    let top = frame.samples.iter().copied().max().unwrap_or(0);
    let with_it = frame.samples.iter().filter(|sample| **sample == top).count();
    let share = with_it as f64 / frame.samples.len() as f64;
    if share < MIN_AT_WHITE {
        let problem = format!(
            "{:.1} % of the samples are at the greatest code, {top}, and a frame in white/ needs {:.0} %: overexpose it more, or state the code of white with --white",
            100.0 * share,
            100.0 * MIN_AT_WHITE
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok((top, frame.facts))
}

/// Maximum distance of the offset of a setting from the trend of all settings, in standard deviations of the noise
/// (chosen).
const MAX_OFF_TREND: f64 = 5.0;

/// Warnings about settings, which are in the order of the numbers in their names: K must rise, and offsets must follow
/// a trend.
fn order_doubts(settings: &[SettingFit], recording: &Recording) -> Vec<String> {
    let mut doubts = Vec::new();
    let numbers = recording.settings.iter().map(SettingFiles::number);
    let numbered: Vec<(&SettingFit, f64)> =
        settings.iter().zip(numbers).filter_map(|(fit, number)| Some((fit, number?))).collect();
    for pair in numbered.windows(2) {
        let [(low, first), (high, second)] = [pair[0], pair[1]];
        if first < second && high.gain.value <= low.gain.value {
            doubts.push(format!(
                "{}: K {:.4} is not above that of {}, {:.4}: are frames in the wrong folder?",
                high.name, high.gain.value, low.name, low.gain.value
            ));
        }
    }
    doubts.extend(off_trend(settings));
    doubts
}

/// Warnings about settings whose offset is far from the trend over ln K. The trend is a line with the median slope
/// (Theil–Sen estimator), which is robust to outliers among up to a third of the settings; with at most three settings
/// it is their median.
fn off_trend(settings: &[SettingFit]) -> Vec<String> {
    let points: Vec<[f64; 2]> = settings
        .iter()
        .map(|fit| {
            let offsets: f64 = fit.offsets.iter().map(|offset| offset.value).sum();
            [libm::log(fit.gain.value), offsets / fit.offsets.len() as f64]
        })
        .collect();
    if points.len() < 2 {
        return Vec::new();
    }
    let slope = if points.len() > 3 {
        let slopes = points
            .iter()
            .enumerate()
            .flat_map(|(i, a)| points[i + 1..].iter().map(move |b| (a, b)))
            .filter(|(a, b)| (a[0] - b[0]).abs() > 1e-9);
        median(slopes.map(|(a, b)| (b[1] - a[1]) / (b[0] - a[0])).collect())
    } else {
        0.0
    };
    let level = median(points.iter().map(|[x, y]| y - slope * x).collect());
    settings.iter().zip(&points).filter_map(|(fit, [x, y])| {
        let off = y - slope * x - level;
        (off.abs() > MAX_OFF_TREND * fit.read_deviation).then(|| {
            format!(
                "{}: the offset of its bias frames, {y:.1} ADU, is {off:+.1} ADU off the trend of all settings: are they of another camera, or of another black level?",
                fit.name
            )
        })
    }).collect()
}

/// Median of numbers: the upper one of two middle numbers, and 0 without any.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}
