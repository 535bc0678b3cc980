//! Python module `darkqa_light`: dark images from NumPy arrays, computed by the crate `darkqa-light`.
//!
//! - `lib.rs`: the Python functions, whose types are in `darkqa_light/_core.pyi`.
//! - [`arguments`]: conversion of arguments to settings, with a `TypeError` or `ValueError` about each wrong value.
//! - [`arrays`]: conversion between NumPy arrays and images.
//! - [`state`]: conversion between capture states and dictionaries.
//! - `pools`: thread pools, one for each process and number of threads.
//!
//! Images are computed without the GIL.
//!
//! Thread pools: [`pool`].
//!
//! The threads of a pool do not survive a fork. So each process, such as a worker of a `DataLoader`, starts its own
//! pools when they are first needed. The table of pools, and the tables that the synthesis computes once, are filled
//! only while the GIL is held. `os.fork` holds the GIL, too, so a forked process never inherits a locked mutex.

mod arguments;
mod arrays;
mod state;

use std::collections::HashMap;
use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use arguments::{Level, Settings, noise_keys, numbered_keys};
use arrays::{ArrayElement, Batch};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Degradation, FrameId, Image, Rgb, Severity};
use darkqa_light::raw::negative;
use darkqa_light::{
    AppliedDegradation, AutoExposure, CaptureState, Exposures, FrameView, Motion, NoiseKey, NoiseTerms, Synthesis,
};

/// Dark images, as a camera would take them in less light.
#[pymodule]
mod _core {
    use super::{Bound, PyModule, PyModuleMethods, PyResult};

    #[pymodule_export]
    use super::{cameras, degrade, ladder, replay, sensor_state};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

/// Names of the built-in cameras, the default first.
#[pyfunction]
fn cameras() -> Vec<&'static str> {
    darkqa_light::Calibration::names().collect()
}

/// Return an image, or a batch of images, in less light.
///
/// `image` is a numpy.ndarray of dtype uint8 and shape (H, W, 3) or (N, H, W, 3): sRGB. The result has the same shape.
///
/// level: "L1" to "L5", "L0" for the image itself; with variant="motion" also an exposure time in ms, as "T33.33".
/// ev: an exposure drop in EV instead, from 0 to 16, rounded to 0.01.
/// variant: "ev" (less light alone), "noise" (with sensor noise), "auto" (automatic exposure), "motion" (motion blur).
/// profile: "paper", "eld", "level" or "physical", the way the noise follows the light.
/// camera: a name of cameras(), or the path of a TOML file of a calibration; None for the first of cameras().
/// seed, key: the same seed and key give the same image. Key is the name of a frame in `darkqa-eval synthesize`. A
/// batch
///     takes a list of N keys; with one str, image i has the key f"{key}/{i}".
/// noise: False for the noise-free image at the same exposure, a training target.
/// linear: True for float32 linear light before it is rounded to 8-bit codes; white is 1.
/// threads: from 1 to 256.
#[pyfunction]
#[pyo3(
    signature = (image, level = None, variant = None, profile = None, camera = None, seed = None, key = None, *, ev = None, noise = None, linear = None, threads = None),
    text_signature = "(image, level='L3', variant='noise', profile='paper', camera=None, seed=0, key='', *, ev=None, noise=True, linear=False, threads=1)"
)]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
fn degrade<'py>(
    image: &Bound<'py, PyAny>,
    level: Option<&Bound<'py, PyAny>>,
    variant: Option<&Bound<'py, PyAny>>,
    profile: Option<&Bound<'py, PyAny>>,
    camera: Option<&Bound<'py, PyAny>>,
    seed: Option<&Bound<'py, PyAny>>,
    key: Option<&Bound<'py, PyAny>>,
    ev: Option<&Bound<'py, PyAny>>,
    noise: Option<&Bound<'py, PyAny>>,
    linear: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    let settings = Settings::new(variant, profile, camera, seed)?;
    let level = settings.level(level, ev)?;
    let noise = terms(arguments::switch("noise", noise, true)?);
    let is_linear = arguments::switch("linear", linear, false)?;
    let threads = arguments::threads(threads)?;
    let batch = Batch::read(image)?;
    let keys = noise_keys(settings.seed, key, &batch)?;
    let states = keys.iter().map(|key| settings.state(level, batch.width, key)).collect::<PyResult<Vec<_>>>()?;
    if is_linear {
        output(py, &batch, &[], threads, |index, clean| {
            states[index].light(clean.into(), &keys[index], noise).into_samples()
        })
    } else {
        output(py, &batch, &[], threads, |index, clean| {
            states[index].image(clean.into(), &keys[index], noise).into_samples()
        })
    }
}

/// Return an image, or each image of a batch, at several levels, with one camera and one noise field for each image.
///
/// The shape is (L, H, W, 3), or (N, L, H, W, 3) for a batch. Levels are str as in degrade(), or numbers of EV; each
/// image equals that of degrade() at this level. They take less time together.
#[pyfunction]
#[pyo3(
    signature = (image, levels = None, variant = None, profile = None, camera = None, seed = None, key = None, *, noise = None, linear = None, threads = None),
    text_signature = "(image, levels=('L1', 'L2', 'L3', 'L4', 'L5'), variant='noise', profile='paper', camera=None, seed=0, key='', *, noise=True, linear=False, threads=1)"
)]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
fn ladder<'py>(
    image: &Bound<'py, PyAny>,
    levels: Option<&Bound<'py, PyAny>>,
    variant: Option<&Bound<'py, PyAny>>,
    profile: Option<&Bound<'py, PyAny>>,
    camera: Option<&Bound<'py, PyAny>>,
    seed: Option<&Bound<'py, PyAny>>,
    key: Option<&Bound<'py, PyAny>>,
    noise: Option<&Bound<'py, PyAny>>,
    linear: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    let settings = Settings::new(variant, profile, camera, seed)?;
    let levels = settings.levels(levels)?;
    let noise = terms(arguments::switch("noise", noise, true)?);
    let is_linear = arguments::switch("linear", linear, false)?;
    let threads = arguments::threads(threads)?;
    let batch = Batch::read(image)?;
    let keys = noise_keys(settings.seed, key, &batch)?;
    let mut states: Vec<Vec<CaptureState>> = Vec::new();
    for key in &keys {
        let states_of_key =
            levels.iter().map(|level| settings.state(*level, batch.width, key)).collect::<PyResult<_>>()?;
        states.push(states_of_key);
    }
    let shape = [levels.len()];
    if is_linear {
        return output(py, &batch, &shape, threads, |index, clean| {
            join_samples(states[index].iter().map(|state| state.light(clean.into(), &keys[index], noise)))
        });
    }
    output(py, &batch, &shape, threads, |index, clean| {
        if noise == NoiseTerms::All {
            return degrade_to_levels(&settings, &levels, clean, &keys[index]);
        }
        join_samples(states[index].iter().map(|state| state.image(clean.into(), &keys[index], noise)))
    })
}

/// Samples of one frame at several levels with all noise terms, which share intermediate results.
fn degrade_to_levels(settings: &Settings, levels: &[Level], clean: &Rgb, key: &NoiseKey) -> Vec<u8> {
    if settings.kind == Kind::Sensor {
        let mut samples = vec![0; levels.len() * clean.samples().len()];
        let (mut severities, mut images) = (Vec::new(), Vec::new());
        let parts = samples.chunks_exact_mut(clean.samples().len());
        for (level, part) in levels.iter().zip(parts) {
            if let Some(severity) = level.0 {
                severities.push(severity);
                images.push(part);
            } else {
                part.copy_from_slice(clean.samples());
            }
        }
        negative::ladder(clean, key, &settings.synthesis, &severities, &mut images);
        return samples;
    }
    let mut exposures = Exposures::default();
    join_samples(levels.iter().map(|level| {
        let applied = level.0.map(|severity| settings.applied(severity, clean.width(), key));
        match applied {
            Some(Ok(applied)) => exposures.degrade(clean.into(), &applied, key),
            // No level fails here, because the capture states of all levels were computed before.
            None | Some(Err(_)) => clean.clone(),
        }
    }))
}

/// Return the numbers that decide an image of degrade(): exposure drop, motion and the state of the sensor.
///
/// The dictionary holds int, float, str, and lists of float, so that it can be written as JSON. replay() makes the
/// image again from it. `width` is the width of the image in pixels, which the motion of the variants "auto" and
/// "motion" needs.
#[pyfunction]
#[pyo3(
    signature = (level = None, variant = None, profile = None, camera = None, seed = None, key = None, *, ev = None, width = None),
    text_signature = "(level='L3', variant='noise', profile='paper', camera=None, seed=0, key='', *, ev=None, width=None)"
)]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
fn sensor_state<'py>(
    py: Python<'py>,
    level: Option<&Bound<'py, PyAny>>,
    variant: Option<&Bound<'py, PyAny>>,
    profile: Option<&Bound<'py, PyAny>>,
    camera: Option<&Bound<'py, PyAny>>,
    seed: Option<&Bound<'py, PyAny>>,
    key: Option<&Bound<'py, PyAny>>,
    ev: Option<&Bound<'py, PyAny>>,
    width: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let settings = Settings::new(variant, profile, camera, seed)?;
    let level = settings.level(level, ev)?;
    let key = arguments::key(key)?;
    let width = settings.width(width)?;
    let noise_key = arguments::noise_key(settings.seed, &key);
    let capture = settings.state(level, width, &noise_key)?;
    state::to_dict(py, &state::Replay { kind: settings.kind, seed: settings.seed, key, capture })
}

/// Return an image, or a batch of images, with the numbers of a dictionary of sensor_state(), which may have been
/// changed.
///
/// All images of a batch have the same camera; image i of a batch has the noise of the key f"{key}/{i}".
#[pyfunction]
#[pyo3(
    signature = (image, state, *, noise = None, linear = None, threads = None),
    text_signature = "(image, state, *, noise=True, linear=False, threads=1)"
)]
fn replay<'py>(
    image: &Bound<'py, PyAny>,
    state: &Bound<'py, PyAny>,
    noise: Option<&Bound<'py, PyAny>>,
    linear: Option<&Bound<'py, PyAny>>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    let state = state.cast::<PyDict>().map_err(|_| arrays::wrong_type("state", "a dict of sensor_state()", state))?;
    let replay = state::from_dict(state)?;
    let noise = terms(arguments::switch("noise", noise, true)?);
    let is_linear = arguments::switch("linear", linear, false)?;
    let threads = arguments::threads(threads)?;
    let batch = Batch::read(image)?;
    let keys = numbered_keys(replay.seed, &replay.key, &batch);
    let capture = &replay.capture;
    if is_linear {
        output(py, &batch, &[], threads, |index, clean| capture.light(clean.into(), &keys[index], noise).into_samples())
    } else {
        output(py, &batch, &[], threads, |index, clean| capture.image(clean.into(), &keys[index], noise).into_samples())
    }
}

fn terms(noise: bool) -> NoiseTerms {
    if noise { NoiseTerms::All } else { NoiseTerms::None }
}

/// Array of the samples that `make` computes from the index and pixels of each image of a batch. For `levels` see
/// [`Batch::output_shape`].
fn output<'py, T: ArrayElement>(
    py: Python<'py>,
    batch: &Batch,
    levels: &[usize],
    threads: usize,
    make: impl Fn(usize, &Rgb) -> Vec<T> + Sync,
) -> PyResult<Bound<'py, PyAny>> {
    let shape = batch.output_shape(levels);
    // Three copies at most: single images, the images of each frame joined, and all frames joined.
    let bytes = shape.iter().fold(size_of::<T>(), |product, n| product.saturating_mul(*n));
    arrays::require_memory(3, bytes)?;
    let pool = pool(py, threads)?;
    let samples: Vec<T> = py.detach(|| {
        pool.install(|| {
            if let [only] = &batch.images[..] {
                return make(0, only);
            }
            batch
                .images
                .par_iter()
                .enumerate()
                .map(|(index, clean)| make(index, clean))
                .collect::<Vec<Vec<T>>>()
                .concat()
        })
    });
    arrays::to_numpy(py, samples, &shape)
}

/// Concatenated samples of images of one size.
fn join_samples<T: ArrayElement>(images: impl Iterator<Item = Image<T>>) -> Vec<T> {
    images.map(Image::into_samples).collect::<Vec<Vec<T>>>().concat()
}

type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;

static POOLS: Mutex<Option<Pools>> = Mutex::new(None);

/// Pool of this process with this number of threads.
///
/// # Errors
/// `RuntimeError` if the threads cannot be started.
fn pool(_attached: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let is_first = pools.is_none();
    let pools = pools.get_or_insert_default();
    let process = process::id();
    if let Some(pool) = pools.get(&(process, threads)) {
        return Ok(Arc::clone(pool));
    }
    // Pools of a parent process stay in the table: dropping them would wait for threads that do not exist here.
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("darkqa-light-{index}"))
        .build()
        .map_err(|problem| PyRuntimeError::new_err(format!("threads: {threads} cannot be started: {problem}")))?;
    if is_first {
        pool.install(fill_tables);
    }
    let pool = Arc::new(pool);
    pools.insert((process, threads), Arc::clone(&pool));
    Ok(pool)
}

/// Computes a small image of each variant, so that all tables of the synthesis are filled.
fn fill_tables() {
    let clean = Rgb::black(4, 4);
    let key = NoiseKey::new(0, &FrameId(String::new()));
    let (auto, motion) = (AutoExposure::default(), Motion::default());
    let view = FrameView { width: 640, focal: None };
    for kind in Kind::ALL {
        let applied = Degradation::new(kind, Severity::L3, None)
            .and_then(|how| AppliedDegradation::new(&how, &Synthesis::default(), &auto, &motion, view, &key));
        if let Ok(applied) = applied {
            let state = CaptureState::new(&applied, &key);
            drop(state.image((&clean).into(), &key, NoiseTerms::All));
            drop(state.light((&clean).into(), &key, NoiseTerms::All));
        }
    }
}
