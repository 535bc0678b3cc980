//! Conversion of Python arguments to settings: [`Settings`], [`Level`], [`noise_keys`].

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyInt, PyString};

use super::arrays::{value_error, wrong_type};
use crate::arrays::Batch;
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{Degradation, FrameId, ProfileName, Severity};
use darkqa_light::{
    AppliedDegradation, AutoExposure, AutoSettings, CameraModel, CaptureState, FrameView, Motion, NoiseKey,
    NoiseProfile, Streak, Synthesis,
};

/// A level of darkness; `None` is L0, the unchanged image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Level(pub(crate) Option<Severity>);

/// Settings shared by all images of a call.
pub(crate) struct Settings {
    pub(crate) kind: Kind,
    pub(crate) synthesis: Synthesis,
    pub(crate) seed: u64,
    auto: AutoExposure,
}

/// Converts a `str` argument.
fn text(name: &str, expected: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = given.cast::<PyString>().map_err(|_| wrong_type(name, expected, given))?;
    let text = text
        .to_str()
        .map_err(|_| PyValueError::new_err(format!("{name}: text with a lone surrogate is no Unicode")))?;
    Ok(text.to_owned())
}

/// Converts a number of EV; refuses `bool` and `str`.
fn number(name: &str, given: &Bound<'_, PyAny>) -> PyResult<f64> {
    let is_refused = given.is_instance_of::<PyBool>() || given.is_instance_of::<PyString>();
    given.extract().ok().filter(|_| !is_refused).ok_or_else(|| wrong_type(name, "a number of EV", given))
}

impl Settings {
    pub(crate) fn new(
        variant: Option<&Bound<'_, PyAny>>,
        profile: Option<&Bound<'_, PyAny>>,
        camera: Option<&Bound<'_, PyAny>>,
        seed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let kind = match variant {
            None => Kind::Sensor,
            Some(given) => {
                let word = text("variant", "a str", given)?;
                Kind::from_word(&word).ok_or_else(|| one_of("variant", &word, &Kind::ALL.map(Kind::word)))?
            }
        };
        let reading = match profile {
            None => NoiseProfile::Paper,
            Some(given) => {
                let word = text("profile", "a str", given)?;
                NoiseProfile::ALL.into_iter().find(|reading| reading.name().as_str() == word).ok_or_else(|| {
                    let names = NoiseProfile::ALL.map(NoiseProfile::name);
                    one_of("profile", &word, &names.each_ref().map(ProfileName::as_str))
                })?
            }
        };
        let camera = match camera {
            None => CameraModel::default(),
            Some(given) => {
                let expected = "a str or os.PathLike";
                let path: PathBuf = given.extract().map_err(|_| wrong_type("camera", expected, given))?;
                let name = path.to_str().ok_or_else(|| PyValueError::new_err("camera: no Unicode"))?;
                CameraModel::open(name).map_err(|problem| value_error(&problem))?
            }
        };
        let seed = match seed {
            None => 0,
            Some(given) => integer("seed", given, [0, u64::MAX])?,
        };
        Ok(Self {
            kind,
            auto: AutoSettings::default().for_camera(&camera),
            synthesis: Synthesis::new(reading, camera),
            seed,
        })
    }

    /// Level from the arguments `level` and `ev`, of which only one may be given; L3 by default.
    pub(crate) fn level(&self, level: Option<&Bound<'_, PyAny>>, ev: Option<&Bound<'_, PyAny>>) -> PyResult<Level> {
        match (level, ev) {
            (Some(_), Some(_)) => Err(PyValueError::new_err("level, ev: one of them expected, got both")),
            (None, Some(ev)) => self.level_from_ev("ev", ev),
            (Some(level), None) => self.level_from_str("level", level),
            (None, None) => self.level_from_label("level", "L3"),
        }
    }

    /// Levels of a ladder; L1 to L5 by default.
    pub(crate) fn levels(&self, levels: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Level>> {
        let Some(levels) = levels else {
            return Ok(self.kind.ladder().iter().map(|severity| Level(Some(*severity))).collect());
        };
        let expected = "a list of str and numbers of EV";
        if levels.is_instance_of::<PyString>() {
            return Err(wrong_type("levels", expected, levels));
        }
        let levels: Vec<Level> = levels
            .try_iter()
            .map_err(|_| wrong_type("levels", expected, levels))?
            .map(|item| {
                let item = item?;
                if item.is_instance_of::<PyString>() {
                    self.level_from_str("levels", &item)
                } else {
                    self.level_from_ev("levels", &item)
                }
            })
            .take(MAX_LEVELS + 1)
            .collect::<PyResult<_>>()?;
        if levels.is_empty() || levels.len() > MAX_LEVELS {
            let problem = format!("levels: from 1 to {MAX_LEVELS} levels expected");
            return Err(PyValueError::new_err(problem));
        }
        Ok(levels)
    }

    /// Level from the `str` argument `name`.
    fn level_from_str(&self, name: &str, given: &Bound<'_, PyAny>) -> PyResult<Level> {
        let is_number = given.is_instance_of::<PyFloat>() || given.is_instance_of::<PyInt>();
        let expected =
            if is_number { "a str such as \"L3\" (a number of EV is the argument ev)" } else { "a str such as \"L3\"" };
        self.level_from_label(name, &text(name, expected, given)?)
    }

    /// Level with a label such as `L3` or `E3.3`; `name` is the argument's.
    fn level_from_label(&self, name: &str, label: &str) -> PyResult<Level> {
        if label.eq_ignore_ascii_case("L0") {
            return Ok(Level(None));
        }
        // L1 to L5 are the severities of the variant's ladder, also for exposure times.
        for (severity, index) in self.kind.ladder().iter().zip(1..) {
            if label.eq_ignore_ascii_case(&format!("L{index}")) {
                return Ok(Level(Some(*severity)));
            }
        }
        let severity = self.kind.severity(label).map_err(|_| {
            let expected = if self.kind.axis() == Axis::MOTION {
                "L0 to L5, or an exposure time in ms such as T33.33"
            } else {
                "L0 to L5, or an exposure drop in EV such as E3.3"
            };
            PyValueError::new_err(format!("{name}: {expected} expected, got {label:?}"))
        })?;
        Ok(Level(Some(severity)))
    }

    /// Level from an exposure drop in EV, rounded to hundredths.
    fn level_from_ev(&self, name: &str, given: &Bound<'_, PyAny>) -> PyResult<Level> {
        let drop_ev = number(name, given)?;
        if self.kind.axis() != Axis::LIGHT {
            let problem =
                format!("{name}: variant {:?} has exposure times; pass a level such as T33.33", self.kind.word());
            return Err(PyValueError::new_err(problem));
        }
        let largest = self.kind.max_severity().value();
        if !(0.0..=largest).contains(&drop_ev) {
            return Err(PyValueError::new_err(format!(
                "{name}: a number of EV from 0 to {largest} expected, got {drop_ev}"
            )));
        }
        let hundredths = (100.0 * drop_ev).round() as u16;
        Ok(Level((hundredths > 0).then(|| Severity::from_hundredths(hundredths))))
    }

    /// Width of the images in pixels, which affects only motion blur.
    pub(crate) fn width(&self, given: Option<&Bound<'_, PyAny>>) -> PyResult<usize> {
        match given {
            Some(given) => Ok(integer("width", given, [1, MAX_WIDTH])? as usize),
            None if self.kind.has_motion() => Err(PyValueError::new_err(format!(
                "width: the width of the image in pixels expected, because variant {:?} has motion blur",
                self.kind.word()
            ))),
            None => Ok(1),
        }
    }

    /// Degradation of a frame with this key and width in pixels.
    pub(crate) fn applied(&self, severity: Severity, width: usize, key: &NoiseKey) -> PyResult<AppliedDegradation> {
        let reading = self.kind.has_profiles().then(|| self.synthesis.name());
        let view = FrameView { width, focal: None };
        let motion = Motion::default();
        Degradation::new(self.kind, severity, reading)
            .and_then(|how| AppliedDegradation::new(&how, &self.synthesis, &self.auto, &motion, view, key))
            .map_err(|problem| value_error(&problem))
    }

    /// Capture state of a frame with this key and width in pixels. At L0 it has no sensor, because the image is
    /// unchanged.
    pub(crate) fn state(&self, level: Level, width: usize, key: &NoiseKey) -> PyResult<CaptureState> {
        let Some(severity) = level.0 else {
            return Ok(CaptureState { drop_ev: 0.0, streak: Streak::STILL, sensor: None });
        };
        let applied = self.applied(severity, width, key)?;
        Ok(CaptureState::new(&applied, key))
    }
}

/// Maximum width of an image, in pixels; chosen.
const MAX_WIDTH: u64 = 1 << 30;

/// Maximum number of levels of a ladder; chosen.
const MAX_LEVELS: usize = 200;

fn one_of(name: &str, given: &str, accepted: &[&str]) -> PyErr {
    let accepted = accepted.join(", ");
    PyValueError::new_err(format!("{name}: one of {accepted} expected, got {given:?}"))
}

/// Converts a `bool` of Python or NumPy.
pub(crate) fn switch(name: &str, given: Option<&Bound<'_, PyAny>>, default: bool) -> PyResult<bool> {
    let Some(given) = given else {
        return Ok(default);
    };
    given.extract().map_err(|_| wrong_type(name, "a bool", given))
}

/// Maximum number of threads; chosen.
const MAX_THREADS: u64 = 256;

/// Number of threads; 1 by default.
pub(crate) fn threads(given: Option<&Bound<'_, PyAny>>) -> PyResult<usize> {
    match given {
        Some(given) => Ok(integer("threads", given, [1, MAX_THREADS])? as usize),
        None => Ok(1),
    }
}

/// Converts an integer within bounds; refuses `bool`.
fn integer(name: &str, given: &Bound<'_, PyAny>, [low, high]: [u64; 2]) -> PyResult<u64> {
    if given.is_instance_of::<PyBool>() {
        return Err(wrong_type(name, "an int", given));
    }
    let index = given.call_method0("__index__").map_err(|_| wrong_type(name, "an int", given))?;
    index
        .extract()
        .ok()
        .filter(|number: &u64| (low..=high).contains(number))
        .ok_or_else(|| PyValueError::new_err(format!("{name}: an int from {low} to {high} expected, got {index}")))
}

/// Key of one image; empty by default.
pub(crate) fn key(given: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
    match given {
        Some(given) => text("key", "a str", given),
        None => Ok(String::new()),
    }
}

pub(crate) fn noise_key(seed: u64, key: &str) -> NoiseKey {
    NoiseKey::new(seed, &FrameId(key.to_owned()))
}

/// Noise keys of the images of a batch, from a list of N keys, or from one key to which `/i` is added for image i of a
/// batch.
pub(crate) fn noise_keys(seed: u64, given: Option<&Bound<'_, PyAny>>, batch: &Batch) -> PyResult<Vec<NoiseKey>> {
    let is_text = given.is_none_or(PyAnyMethods::is_instance_of::<PyString>);
    let Some(given) = given.filter(|_| !is_text) else {
        return Ok(numbered_keys(seed, &key(given)?, batch));
    };
    let Some(count) = batch.count() else {
        return Err(wrong_type("key", "a str", given));
    };
    let expected = "a str or a list of str";
    let keys: Vec<NoiseKey> = given
        .try_iter()
        .map_err(|_| wrong_type("key", expected, given))?
        .take(count + 1)
        .map(|item| {
            let key = text("key", expected, &item?)?;
            Ok(noise_key(seed, &key))
        })
        .collect::<PyResult<_>>()?;
    if keys.len() != count {
        let got = if keys.len() > count { "more" } else { "fewer" };
        return Err(PyValueError::new_err(format!(
            "key: a list of {count} keys expected, one for each image, got {got}"
        )));
    }
    Ok(keys)
}

/// Noise keys of the images of a batch from one key, to which `/i` is added for image i.
pub(crate) fn numbered_keys(seed: u64, key: &str, batch: &Batch) -> Vec<NoiseKey> {
    match batch.count() {
        None => vec![noise_key(seed, key)],
        Some(count) => (0..count).map(|index| noise_key(seed, &format!("{key}/{index}"))).collect(),
    }
}
