//! Python values → settings: [`Settings`], [`Level`], [`noise_keys`].

use std::path::PathBuf;

use darkqa_ground::types::degradations::{Axis, Kind};
use darkqa_ground::types::{Degradation, FrameId, ReadingName, Severity};
use darkqa_light::{
    AppliedDegradation, AutoExposure, AutoSettings, CameraModel, CaptureState, FrameView, Motion,
    NoiseKey, NoiseProfile, Streak, Synthesis,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyInt, PyString};

use crate::arrays::Batch;
use crate::errors::{value_error, wrong_type};

/// A level; `None` is L0, the image itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Level(pub(crate) Option<Severity>);

/// Settings shared by all images of a call.
pub(crate) struct Settings {
    pub(crate) kind: Kind,
    pub(crate) synthesis: Synthesis,
    pub(crate) seed: u64,
    auto: AutoExposure,
}

/// A text argument.
fn text(name: &str, expected: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = given
        .cast::<PyString>()
        .map_err(|_| wrong_type(name, expected, given))?;
    let text = text.to_str().map_err(|_| {
        PyValueError::new_err(format!("{name}: text with a lone surrogate is no Unicode"))
    })?;
    Ok(text.to_owned())
}

/// A number of EV that is finite; a bool is none.
fn number(name: &str, given: &Bound<'_, PyAny>) -> PyResult<f64> {
    let wrong = || wrong_type(name, "a number of EV", given);
    if given.is_instance_of::<PyBool>() || given.is_instance_of::<PyString>() {
        return Err(wrong());
    }
    given.extract().map_err(|_| wrong())
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
                Kind::from_word(&word)
                    .ok_or_else(|| one_of("variant", &word, &Kind::ALL.map(Kind::word)))?
            }
        };
        let reading = match profile {
            None => NoiseProfile::Paper,
            Some(given) => {
                let word = text("profile", "a str", given)?;
                NoiseProfile::ALL
                    .into_iter()
                    .find(|reading| reading.name().as_str() == word)
                    .ok_or_else(|| {
                        let names = NoiseProfile::ALL.map(NoiseProfile::name);
                        one_of("profile", &word, &names.each_ref().map(ReadingName::as_str))
                    })?
            }
        };
        let camera = match camera {
            None => CameraModel::default(),
            Some(given) => {
                let expected = "a str or os.PathLike";
                let path: PathBuf = given
                    .extract()
                    .map_err(|_| wrong_type("camera", expected, given))?;
                let name = path
                    .to_str()
                    .ok_or_else(|| PyValueError::new_err("camera: no Unicode"))?;
                CameraModel::open(name).map_err(|problem| value_error(&problem))?
            }
        };
        let seed = match seed {
            None => 0,
            Some(given) => whole("seed", given, [0, u64::MAX])?,
        };
        Ok(Self {
            kind,
            auto: AutoSettings::default().for_camera(&camera),
            synthesis: Synthesis::new(reading, camera),
            seed,
        })
    }

    /// The level of the arguments `level` and `ev`; L3 if neither is given.
    pub(crate) fn level(
        &self,
        level: Option<&Bound<'_, PyAny>>,
        ev: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Level> {
        match (level, ev) {
            (Some(_), Some(_)) => Err(PyValueError::new_err(
                "level, ev: one of them expected, got both",
            )),
            (None, Some(ev)) => self.drop("ev", ev),
            (Some(level), None) => self.named("level", level),
            (None, None) => self.label("level", "L3"),
        }
    }

    /// The levels of a ladder; L1 to L5 if none are given.
    pub(crate) fn levels(&self, levels: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Level>> {
        let Some(levels) = levels else {
            let ladder = self.kind.ladder().iter();
            return Ok(ladder.map(|severity| Level(Some(*severity))).collect());
        };
        let expected = "a list of str and numbers of EV";
        if levels.is_instance_of::<PyString>() {
            return Err(wrong_type("levels", expected, levels));
        }
        let items = levels
            .try_iter()
            .map_err(|_| wrong_type("levels", expected, levels))?;
        let levels = items.map(|item| {
            let item = item?;
            if item.is_instance_of::<PyString>() {
                self.named("levels", &item)
            } else {
                self.drop("levels", &item)
            }
        });
        let levels: Vec<Level> = levels.take(MAX_LEVELS + 1).collect::<PyResult<_>>()?;
        if levels.is_empty() || levels.len() > MAX_LEVELS {
            let problem = format!("levels: from 1 to {MAX_LEVELS} levels expected");
            return Err(PyValueError::new_err(problem));
        }
        Ok(levels)
    }

    fn named(&self, name: &str, given: &Bound<'_, PyAny>) -> PyResult<Level> {
        let is_number = given.is_instance_of::<PyFloat>() || given.is_instance_of::<PyInt>();
        let expected = if is_number {
            "a str such as \"L3\" (a number of EV is the argument ev)"
        } else {
            "a str such as \"L3\""
        };
        self.label(name, &text(name, expected, given)?)
    }

    fn label(&self, name: &str, label: &str) -> PyResult<Level> {
        if label.eq_ignore_ascii_case("L0") {
            return Ok(Level(None));
        }
        // Exposure times have no names of their own; L1 to L5 are those of the ladder.
        let of_ladder = self
            .kind
            .ladder()
            .iter()
            .zip(1..)
            .find(|(_, index)| label.eq_ignore_ascii_case(&format!("L{index}")));
        if let Some((severity, _)) = of_ladder {
            return Ok(Level(Some(*severity)));
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

    /// An exposure drop in EV, rounded to hundredths.
    fn drop(&self, name: &str, given: &Bound<'_, PyAny>) -> PyResult<Level> {
        let drop_ev = number(name, given)?;
        if self.kind.axis() != Axis::LIGHT {
            let problem = format!(
                "{name}: variant {:?} has exposure times; pass a level such as T33.33",
                self.kind.word()
            );
            return Err(PyValueError::new_err(problem));
        }
        let largest = self.kind.max_severity().value();
        if !(0.0..=largest).contains(&drop_ev) {
            return Err(PyValueError::new_err(format!(
                "{name}: a number of EV from 0 to {largest} expected, got {drop_ev}"
            )));
        }
        let hundredths = (100.0 * drop_ev).round() as u16;
        Ok(Level(
            (hundredths > 0).then(|| Severity::from_hundredths(hundredths)),
        ))
    }

    /// The width of the images, which only motion depends on.
    pub(crate) fn width(&self, given: Option<&Bound<'_, PyAny>>) -> PyResult<usize> {
        match given {
            Some(given) => Ok(whole("width", given, [1, MAX_WIDTH])? as usize),
            None if self.kind.has_motion() => Err(PyValueError::new_err(format!(
                "width: the width of the image in pixels expected, because variant {:?} has motion blur",
                self.kind.word()
            ))),
            None => Ok(1),
        }
    }

    /// A degradation of the frame of a key, `width` pixels wide.
    pub(crate) fn applied(
        &self,
        severity: Severity,
        width: usize,
        key: &NoiseKey,
    ) -> PyResult<AppliedDegradation> {
        let reading = self.kind.has_readings().then(|| self.synthesis.name());
        let view = FrameView { width, focal: None };
        let motion = Motion::default();
        Degradation::new(self.kind, severity, reading)
            .and_then(|how| {
                AppliedDegradation::new(&how, &self.synthesis, &self.auto, &motion, view, key)
            })
            .map_err(|problem| value_error(&problem))
    }

    /// The state of the capture of a frame. At L0 it has no sensor: the image itself.
    pub(crate) fn state(
        &self,
        level: Level,
        width: usize,
        key: &NoiseKey,
    ) -> PyResult<CaptureState> {
        let Some(severity) = level.0 else {
            return Ok(CaptureState {
                drop_ev: 0.0,
                streak: Streak::STILL,
                sensor: None,
            });
        };
        let applied = self.applied(severity, width, key)?;
        Ok(CaptureState::new(&applied, key))
    }
}

/// Greatest width of an image, in pixels; chosen.
const MAX_WIDTH: u64 = 1 << 30;

/// Most levels of a ladder; chosen.
const MAX_LEVELS: usize = 200;

fn one_of(name: &str, given: &str, accepted: &[&str]) -> PyErr {
    let accepted = accepted.join(", ");
    PyValueError::new_err(format!("{name}: one of {accepted} expected, got {given:?}"))
}

/// A bool of Python or NumPy.
pub(crate) fn switch(
    name: &str,
    given: Option<&Bound<'_, PyAny>>,
    default: bool,
) -> PyResult<bool> {
    let Some(given) = given else {
        return Ok(default);
    };
    given
        .extract()
        .map_err(|_| wrong_type(name, "a bool", given))
}

/// Most threads; chosen.
const MAX_THREADS: u64 = 256;

/// The number of threads; 1 if it is not given.
pub(crate) fn threads(given: Option<&Bound<'_, PyAny>>) -> PyResult<usize> {
    let threads = given.map(|given| whole("threads", given, [1, MAX_THREADS]));
    Ok(threads.transpose()?.unwrap_or(1) as usize)
}

/// A whole number; a bool is none.
fn whole(name: &str, given: &Bound<'_, PyAny>, [low, high]: [u64; 2]) -> PyResult<u64> {
    if given.is_instance_of::<PyBool>() {
        return Err(wrong_type(name, "an int", given));
    }
    let index = given
        .call_method0("__index__")
        .map_err(|_| wrong_type(name, "an int", given))?;
    let number: Option<u64> = index.extract().ok();
    number
        .filter(|number| (low..=high).contains(number))
        .ok_or_else(|| {
            PyValueError::new_err(format!(
                "{name}: an int from {low} to {high} expected, got {index}"
            ))
        })
}

/// The key of one image.
pub(crate) fn key(given: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
    given.map_or_else(|| Ok(String::new()), |given| text("key", "a str", given))
}

pub(crate) fn noise_key(seed: u64, key: &str) -> NoiseKey {
    NoiseKey::new(seed, &FrameId(key.to_owned()))
}

/// The noise keys of the images of a batch: of a list of N keys, or of one text, to which a batch adds `/i` for image i.
pub(crate) fn noise_keys(
    seed: u64,
    given: Option<&Bound<'_, PyAny>>,
    batch: &Batch,
) -> PyResult<Vec<NoiseKey>> {
    let is_text = given.is_none_or(PyAnyMethods::is_instance_of::<PyString>);
    let Some(given) = given.filter(|_| !is_text) else {
        return Ok(numbered_keys(seed, &key(given)?, batch));
    };
    let Some(count) = batch.count() else {
        return Err(wrong_type("key", "a str", given));
    };
    let expected = "a str or a list of str";
    let items = given
        .try_iter()
        .map_err(|_| wrong_type("key", expected, given))?;
    let keys: Vec<NoiseKey> = items
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

/// The noise keys of the images of a batch that has one text as its key.
pub(crate) fn numbered_keys(seed: u64, key: &str, batch: &Batch) -> Vec<NoiseKey> {
    match batch.count() {
        None => vec![noise_key(seed, key)],
        Some(count) => (0..count)
            .map(|index| noise_key(seed, &format!("{key}/{index}")))
            .collect(),
    }
}
