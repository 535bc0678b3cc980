//! Dictionary from which an image can be computed again: [`Replay`], [`to_dict`], [`from_dict`].

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::arrays::value_error;
use darkqa_base::types::degradations::Kind;
use darkqa_light::{CameraState, CaptureState, SensorState, Streak, version};

/// Everything needed to compute an image again from its frame.
pub(crate) struct Replay {
    pub(crate) kind: Kind,
    pub(crate) seed: u64,
    pub(crate) key: String,
    pub(crate) capture: CaptureState,
}

/// Converts a replay to a flat dictionary of JSON values.
pub(crate) fn to_dict<'py>(py: Python<'py>, replay: &Replay) -> PyResult<Bound<'py, PyAny>> {
    let Replay { kind, seed, key, capture } = replay;
    let mut fields = json!({
        "version": version(*kind),
        "variant": kind.word(),
        "seed": seed,
        "key": key,
        "ev": capture.drop_ev,
        "blur_px": capture.streak.length(),
        "blur_angle": capture.streak.angle(),
    });
    if let (Some(sensor), Some(fields)) = (&capture.sensor, fields.as_object_mut()) {
        fields.insert("amplify".to_owned(), json!(sensor.amplify));
        fields.insert("tone".to_owned(), json!(sensor.tone));
        fields.insert("coupling".to_owned(), json!(sensor.coupling));
        if let Value::Object(camera) = json!(sensor.camera) {
            fields.extend(camera);
        }
    }
    py.import("json")?.call_method1("loads", (fields.to_string(),))
}

/// Parses the dictionary of a replay.
///
/// # Errors
/// `ValueError` that names a key which is missing, unknown or out of range.
pub(crate) fn from_dict(state: &Bound<'_, PyDict>) -> PyResult<Replay> {
    let text = state.py().import("json")?.call_method1("dumps", (state,))?;
    let fields: Value = serde_json::from_str(&text.extract::<String>()?)
        .map_err(|problem| PyValueError::new_err(format!("state: {problem}")))?;
    let Value::Object(mut fields) = fields else {
        return Err(PyValueError::new_err("state: a dict expected"));
    };
    let word: String = take(&mut fields, "variant")?;
    let kind = Kind::from_word(&word).ok_or_else(|| {
        let words = Kind::ALL.map(Kind::word).join(", ");
        PyValueError::new_err(format!("state: variant {word:?} is not one of {words}"))
    })?;
    let made_by: u32 = take(&mut fields, "version")?;
    if made_by != version(kind) {
        return Err(PyValueError::new_err(format!(
            "state: version {made_by} is of another synthesis; this module has version {}",
            version(kind)
        )));
    }
    let (seed, key) = (take(&mut fields, "seed")?, take(&mut fields, "key")?);
    let drop_ev: f64 = take(&mut fields, "ev")?;
    let length = take(&mut fields, "blur_px")?;
    let angle = take(&mut fields, "blur_angle")?;
    let streak = Streak::new(length, angle).map_err(|problem| value_error(&problem))?;
    // L0 has no sensor.
    let is_untouched = drop_ev == 0.0 && fields.is_empty();
    let sensor = if kind.has_noise() && !is_untouched {
        Some(SensorState {
            amplify: take(&mut fields, "amplify")?,
            tone: take(&mut fields, "tone")?,
            coupling: take(&mut fields, "coupling")?,
            camera: parse::<CameraState>(Value::Object(std::mem::take(&mut fields)))?,
        })
    } else {
        None
    };
    if let Some(name) = fields.keys().next() {
        return Err(PyValueError::new_err(format!("state: unknown key {name:?} for variant {word:?}")));
    }
    let capture = CaptureState { drop_ev, streak, sensor };
    capture.check().map_err(|problem| value_error(&problem))?;
    Ok(Replay { kind, seed, key, capture })
}

/// Removes a key and parses its value.
fn take<T: DeserializeOwned>(fields: &mut Map<String, Value>, name: &str) -> PyResult<T> {
    let value = fields.remove(name).ok_or_else(|| PyValueError::new_err(format!("state: missing key {name:?}")))?;
    serde_json::from_value(value).map_err(|problem| PyValueError::new_err(format!("state: {name}: {problem}")))
}

fn parse<T: DeserializeOwned>(value: Value) -> PyResult<T> {
    serde_json::from_value(value).map_err(|problem| PyValueError::new_err(format!("state: {problem}")))
}
