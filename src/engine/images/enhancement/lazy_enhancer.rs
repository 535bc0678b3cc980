//! An enhancer that is opened only if the image store lacks one of its images: [`LazyEnhancer`].

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use crate::engine::images::enhancement::enhancers::EnhancerRunArgs;
use crate::error::{Error, Result};
use crate::types::{EnhancerName, Rgb};
use darkqa_enhance::{Enhancer, Findings, ImageUse, Implausible, ModelFile, Stopper, Usage};

/// An enhancer that an earlier run probed, and whose images were all in the store when this run began. It is opened
/// once, for all threads, if a stored image turns out to be missing or damaged.
pub(crate) struct LazyEnhancer {
    name: EnhancerName,
    path: PathBuf,
    settings: EnhancerRunArgs,
    findings: Findings,
    usage: Usage,
    session: Mutex<Session>,
    /// Stops the session; set when it is opened.
    stopper: OnceLock<Stopper>,
    is_stopped: AtomicBool,
}

#[expect(clippy::large_enum_variant, reason = "there is one for each enhancer")]
enum Session {
    Closed(ModelFile),
    Open(Enhancer),
    /// The reason why it could not be opened.
    Failed(String),
}

impl LazyEnhancer {
    /// The model in a file, with the findings of its probe in an earlier run.
    pub(crate) fn new(file: ModelFile, settings: EnhancerRunArgs, findings: Findings) -> Self {
        findings.warn(file.name(), file.path());
        tracing::debug!("{}: not opened, because the store has all its images", file.name());
        Self {
            name: file.name().clone(),
            path: file.path().to_owned(),
            settings,
            usage: findings.usage(),
            findings,
            session: Mutex::new(Session::Closed(file)),
            stopper: OnceLock::new(),
            is_stopped: AtomicBool::new(false),
        }
    }

    pub(crate) fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// Path of the model's file, for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The usage note.
    pub(crate) fn usage(&self) -> &Usage {
        &self.usage
    }

    /// Opens the enhancer if necessary and calls [`Enhancer::enhance_and_judge`].
    ///
    /// # Errors
    /// If it cannot be opened (which ends the run), or fails on the image.
    pub(crate) fn enhance_and_judge(
        &self,
        image: &Rgb,
        place: [&dyn ToString; 2],
        implausible: Implausible,
    ) -> Result<(Rgb, ImageUse)> {
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        if let Session::Closed(_) = &*session {
            tracing::debug!("{}: opened, because the store lacks an image", self.name);
            let not_open = Session::Failed("was not opened".to_owned());
            let closed = std::mem::replace(&mut *session, not_open);
            *session = match self.open(closed) {
                Ok(enhancer) => Session::Open(enhancer),
                Err(problem) => Session::Failed(problem.to_string()),
            };
        }
        match &mut *session {
            Session::Open(enhancer) => enhancer.enhance_and_judge(image, place, implausible),
            Session::Closed(_) => Err(self.ended("was not opened")),
            Session::Failed(problem) => Err(self.ended(problem)),
        }
    }

    fn open(&self, session: Session) -> Result<Enhancer> {
        let Session::Closed(file) = session else {
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
        Error::EnhancerEnded { path: self.path.clone(), problem: problem.to_owned() }
    }

    /// Stops the current image and all later ones; may be called from another thread.
    pub(crate) fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        if let Some(stopper) = self.stopper.get() {
            stopper.stop();
        }
    }
}
