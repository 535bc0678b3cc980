//! The enhancement models of a command, loaded on demand: [`EnhancerModels`].
//!
//! An enhancer that is opened only if the image store lacks one of its images: [`LazyEnhancer`].

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use clap::Args;

use crate::images::workers::ThreadArgs;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Digest, EnhancerName, Rgb};
use darkqa_enhance::{
    Enhancer, ImageUse, Implausible, LoadLimits, ModelFile, ProbeArgs, ProbeFindings, Runtime, RuntimeArgs, SizeArgs,
    Stopper, Usage,
};

/// Flags for running enhancement models.
#[derive(Debug, Clone, Default, Args)]
pub struct EnhancerRunArgs {
    /// Size of the images and tiles that models take.
    #[command(flatten)]
    pub size: SizeArgs,
    /// Whether their images are plausible.
    #[command(flatten)]
    pub probe: ProbeArgs,
    /// The ONNX Runtime that runs them.
    #[command(flatten)]
    pub runtime: RuntimeArgs,
    /// Number of threads that run them.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

impl EnhancerRunArgs {
    /// Opens a session of the model in a file with these settings.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or the file is not a model that it can run.
    pub fn open(&self, file: ModelFile) -> Result<Enhancer> {
        let runtime = self.runtime.search().open()?;
        let limits = LoadLimits { time: self.runtime.llie_timeout, memory: self.runtime.memory_limit() };
        let enhancer = Enhancer::open_within(file, &runtime, self.threads.threads, limits)?
            .with_tiling(self.size.tile)
            .with_max_side(self.size.llie_max_side)
            .with_fitting(self.size.fitting());
        Ok(enhancer)
    }
}

/// Reads the files of enhancement models.
///
/// # Errors
/// If a file cannot be read, or two models have the same name.
pub fn read_models(models: &[PathBuf]) -> Result<Vec<ModelFile>> {
    let mut enhancers: Vec<ModelFile> = Vec::new();
    for path in models {
        let file = ModelFile::read(path)?;
        if enhancers.iter().any(|other| other.name() == file.name()) {
            let problem = format_args!("two models are named {}; rename one of the files", file.name());
            return Err(Error::usage("--llie", problem));
        }
        enhancers.push(file);
    }
    Ok(enhancers)
}

/// An enhancement model of a command.
#[expect(clippy::large_enum_variant, reason = "few are alive at a time")]
pub enum Model {
    /// Its file, without a session.
    File(ModelFile),
    /// Its open session, with the digest of its file and sidecar ([`ModelFile::probe_digest`]).
    Open(Enhancer, Digest),
}

impl Model {
    pub fn name(&self) -> &EnhancerName {
        match self {
            Self::File(file) => file.name(),
            Self::Open(enhancer, _) => enhancer.name(),
        }
    }

    /// Path of the file, for messages.
    pub fn path(&self) -> &Path {
        match self {
            Self::File(file) => file.path(),
            Self::Open(enhancer, _) => enhancer.path(),
        }
    }

    /// Digest of everything in the model's files that decides the findings of its probe.
    ///
    /// # Errors
    /// If a number of the sidecar is infinite or NaN.
    pub fn stated(&self) -> Result<Digest> {
        match self {
            Self::File(file) => file.probe_digest(),
            Self::Open(_, stated) => Ok(*stated),
        }
    }

    /// Opens the session of the model with these settings, unless it is open.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or the file is not a model that it can run.
    pub fn open(self, settings: &EnhancerRunArgs) -> Result<Enhancer> {
        match self {
            Self::File(file) => settings.open(file),
            Self::Open(enhancer, _) => Ok(enhancer),
        }
    }
}

/// The enhancement models of a command, loaded or not.
pub struct EnhancerModels<'a> {
    settings: &'a EnhancerRunArgs,
    models: Vec<Model>,
    /// ONNX Runtime; `None` if it is not open.
    runtime: Option<Runtime>,
}

impl<'a> EnhancerModels<'a> {
    /// The models in these files, not loaded yet.
    pub fn from_files(files: Vec<ModelFile>, settings: &'a EnhancerRunArgs) -> Self {
        Self { settings, models: files.into_iter().map(Model::File).collect(), runtime: None }
    }

    /// Loads the models in these files.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or a file is not a model that it can run.
    pub fn load(files: Vec<ModelFile>, settings: &'a EnhancerRunArgs) -> Result<Self> {
        let mut models = Self::from_files(files, settings);
        models.open()?;
        Ok(models)
    }

    /// Loads the models that are not loaded yet.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or a file is not a model that it can run.
    pub fn open(&mut self) -> Result<()> {
        self.open_runtime()?;
        self.models = std::mem::take(&mut self.models)
            .into_iter()
            .map(|model| match model {
                Model::File(file) => {
                    let stated = file.probe_digest()?;
                    Ok(Model::Open(self.settings.open(file)?, stated))
                }
                open @ Model::Open(..) => Ok(open),
            })
            .collect::<Result<_>>()?;
        Ok(())
    }

    /// Opens ONNX Runtime if there are models and it is not open.
    ///
    /// # Errors
    /// If it is not found.
    pub fn open_runtime(&mut self) -> Result<()> {
        if self.runtime.is_none() && !self.models.is_empty() {
            self.runtime = Some(self.settings.runtime.search().open()?);
        }
        Ok(())
    }

    /// Takes all models out, loaded.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn take(&mut self) -> Result<Vec<Enhancer>> {
        self.take_models()?.into_iter().map(|model| model.open(self.settings)).collect()
    }

    /// Takes all models out, loaded or not, and opens ONNX Runtime.
    ///
    /// # Errors
    /// If it is not found.
    pub fn take_models(&mut self) -> Result<Vec<Model>> {
        self.open_runtime()?;
        Ok(std::mem::take(&mut self.models))
    }

    /// The models, loaded or not.
    pub fn models(&self) -> &[Model] {
        &self.models
    }

    /// Name and version of ONNX Runtime for the manifest; `None` if it was not opened.
    pub fn version(&self) -> Option<(String, String)> {
        let runtime = self.runtime.as_ref()?;
        Some(("onnxruntime".to_owned(), runtime.version().to_owned()))
    }
}

/// An enhancer that an earlier run probed, and whose images were all in the store when this run began. It is opened
/// once, for all threads, if a stored image turns out to be missing or damaged.
pub struct LazyEnhancer {
    name: EnhancerName,
    path: PathBuf,
    settings: EnhancerRunArgs,
    findings: ProbeFindings,
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
    pub fn new(file: ModelFile, settings: EnhancerRunArgs, findings: ProbeFindings) -> Self {
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

    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// Path of the model's file, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The usage note.
    pub fn usage(&self) -> &Usage {
        &self.usage
    }

    /// Opens the enhancer if necessary and calls [`Enhancer::enhance_and_judge`].
    ///
    /// # Errors
    /// If it cannot be opened (which ends the run), or fails on the image.
    pub fn enhance_and_judge(
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
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        if let Some(stopper) = self.stopper.get() {
            stopper.stop();
        }
    }
}
