//! Thread pools: [`pool`].
//!
//! The threads of a pool do not survive a fork. So each process, such as a worker of a `DataLoader`, starts its own
//! pools when they are first needed. The table of pools, and the tables that the synthesis computes once, are filled
//! only while the GIL is held. `os.fork` holds the GIL, too, so a forked process never inherits a locked mutex.

use std::collections::HashMap;
use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Degradation, FrameId, Rgb, Severity};
use darkqa_light::{
    AppliedDegradation, AutoExposure, CaptureState, FrameView, Motion, NoiseKey, NoiseTerms, Synthesis,
};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;

static POOLS: Mutex<Option<Pools>> = Mutex::new(None);

/// Pool of this process with this number of threads.
///
/// # Errors
/// `RuntimeError` if the threads cannot be started.
pub(crate) fn pool(_attached: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
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
