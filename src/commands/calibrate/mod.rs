//! Calibration of a camera from its own frames: [`calibrate`] measures the gain, read noise, row noise and offsets of a
//! sensor at each setting of its gain, from bias frames and pairs of flats. [`camera_file()`] writes them for `--noise
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

mod batches;
mod bias;
mod bootstrap;
mod camera_file;
mod checks;
pub(crate) mod command;
mod consistency;
mod flats;
mod frames;
mod hot_pixels;
mod inputs;
mod layout;
mod lines;
mod mean_frame;
mod mosaic;
mod read_noise;
mod recording;
pub(crate) mod report;
mod setting;
mod sums;
mod white;

use std::path::Path;

pub(crate) use camera_file::camera_file;
pub(crate) use frames::{Crop, ReadOptions};
pub(crate) use layout::Cfa;
pub(crate) use lines::{NoiseLine, SlopeSource};
pub(crate) use recording::Recording;
use serde::Serialize;
pub(crate) use setting::{Measured, SettingFit};

use crate::error::{Error, Result};
use crate::types::Digest;
use frames::FrameReader;
use inputs::Inputs;
use lines::NoiseKind;
use setting::MeasureContext;

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
        None => white::white_code(&reader, recording, folder, &mut inputs)?,
    };
    let mut fits = Vec::new();
    for files in &recording.settings {
        let mut context = MeasureContext { reader: &reader, white, inputs: &mut inputs, warnings: &mut warnings };
        fits.push(setting::measure(files, &mut context)?);
        step();
    }
    warnings.extend(consistency::order_doubts(&fits, recording));
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
