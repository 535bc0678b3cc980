//! An enhancer whose images are all in the image store: [`RestingEnhancer`].

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use crate::error::{Error, Result};
use crate::images::enhancement::enhancers::EnhancerRunArgs;
use crate::types::{EnhancerName, Rgb};
use darkqa_enhance::{Enhancer, Findings, ImageUse, Implausible, ModelFile, Stopper, Usage};

/// An enhancer that was opened and tried in another run, and all of whose images were in the store when the run began. It is opened if one
/// of them is missing or damaged after all, once for all threads.
pub(crate) struct RestingEnhancer {
    name: EnhancerName,
    path: PathBuf,
    settings: EnhancerRunArgs,
    findings: Findings,
    usage: Usage,
    state: Mutex<State>,
    /// Ends its runs, once it is open.
    stopper: OnceLock<Stopper>,
    is_stopped: AtomicBool,
}

#[expect(clippy::large_enum_variant, reason = "there is one for each enhancer")]
enum State {
    Closed(ModelFile),
    Open(Enhancer),
    /// It could not be opened, and why.
    Failed(String),
}

impl RestingEnhancer {
    /// The model in a file, of which this is known.
    pub(crate) fn new(file: ModelFile, settings: EnhancerRunArgs, findings: Findings) -> Self {
        findings.warn(file.name(), file.path());
        tracing::debug!(
            "{}: not opened, because the store has all its images",
            file.name()
        );
        Self {
            name: file.name().clone(),
            path: file.path().to_owned(),
            settings,
            usage: findings.usage(),
            findings,
            state: Mutex::new(State::Closed(file)),
            stopper: OnceLock::new(),
            is_stopped: AtomicBool::new(false),
        }
    }

    pub(crate) fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// Path of the model's file, as messages call it.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// A handle to its note.
    pub(crate) fn usage(&self) -> &Usage {
        &self.usage
    }

    /// Enhances a frame in a condition, and looks at the result, as [`Enhancer::enhance_and_judge`] does.
    ///
    /// # Errors
    /// If it cannot be opened, which ends the run, or fails on the image.
    pub(crate) fn enhance_and_judge(
        &self,
        image: &Rgb,
        place: [&dyn ToString; 2],
        implausible: Implausible,
    ) -> Result<(Rgb, ImageUse)> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if let State::Closed(_) = &*state {
            tracing::debug!("{}: opened, because the store lacks an image", self.name);
            let not_open = State::Failed("was not opened".to_owned());
            let closed = std::mem::replace(&mut *state, not_open);
            *state = match self.opened(closed) {
                Ok(enhancer) => State::Open(enhancer),
                Err(problem) => State::Failed(problem.to_string()),
            };
        }
        match &mut *state {
            State::Open(enhancer) => enhancer.enhance_and_judge(image, place, implausible),
            State::Closed(_) => Err(self.ended("was not opened")),
            State::Failed(problem) => Err(self.ended(problem)),
        }
    }

    fn opened(&self, state: State) -> Result<Enhancer> {
        let State::Closed(file) = state else {
            return Err(self.ended("is in use"));
        };
        let enhancer = self.settings.open(file)?;
        let enhancer = enhancer.with_findings(&self.findings, self.usage.clone())?;
        let stopper = self.stopper.get_or_init(|| enhancer.stopper());
        if self.is_stopped.load(Ordering::SeqCst) {
            stopper.stop();
        }
        Ok(enhancer)
    }

    fn ended(&self, problem: &str) -> Error {
        Error::EnhancerEnded {
            path: self.path.clone(),
            problem: problem.to_owned(),
        }
    }

    /// Stops its current image, and every later one, from another thread.
    pub(crate) fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        if let Some(stopper) = self.stopper.get() {
            stopper.stop();
        }
    }
}
