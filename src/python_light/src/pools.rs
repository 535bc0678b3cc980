//! Threads: [`pool`].
//!
//! A forked process has no threads of its parent's pools. So pools belong to a process, and are started when they are first
//! needed: in each worker of a `DataLoader` anew. The table of pools and all tables that the synthesis computes once are
//! only filled while the GIL is held, which `os.fork` holds, too: no fork finds a lock taken.

use std::collections::HashMap;
use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use darkqa_ground::types::degradations::Kind;
use darkqa_ground::types::{Degradation, FrameId, Rgb, Severity};
use darkqa_light::{
    AppliedDegradation, AutoExposure, CaptureState, FrameView, Motion, NoiseKey, NoiseTerms,
    Synthesis,
};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;

static POOLS: Mutex<Option<Pools>> = Mutex::new(None);

/// The pool of this process with this many threads.
///
/// # Errors
/// `RuntimeError` if the system refuses to start them.
pub(crate) fn pool(_attached: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let is_first = pools.is_none();
    let pools = pools.get_or_insert_default();
    let process = process::id();
    if let Some(pool) = pools.get(&(process, threads)) {
        return Ok(Arc::clone(pool));
    }
    // Pools of a parent are kept, because their threads cannot be joined here.
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("darkqa-light-{index}"))
        .build()
        .map_err(|problem| {
            PyRuntimeError::new_err(format!("threads: {threads} cannot be started: {problem}"))
        })?;
    if is_first {
        pool.install(fill_tables);
    }
    let pool = Arc::new(pool);
    pools.insert((process, threads), Arc::clone(&pool));
    Ok(pool)
}

/// Makes a small image of each kind, so that all tables are computed.
fn fill_tables() {
    let clean = Rgb::black(4, 4);
    let key = NoiseKey::new(0, &FrameId(String::new()));
    let (auto, motion) = (AutoExposure::default(), Motion::default());
    let view = FrameView {
        width: 640,
        focal: None,
    };
    for kind in Kind::ALL {
        let applied = Degradation::new(kind, Severity::L3, None).and_then(|how| {
            AppliedDegradation::new(&how, &Synthesis::default(), &auto, &motion, view, &key)
        });
        if let Ok(applied) = applied {
            let state = CaptureState::new(&applied, &key);
            drop(state.image((&clean).into(), &key, NoiseTerms::All));
            drop(state.light((&clean).into(), &key, NoiseTerms::All));
        }
    }
}
