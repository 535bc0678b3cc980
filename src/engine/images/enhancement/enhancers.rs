//! The enhancement models of a command, loaded on demand: [`EnhancerModels`].

use std::path::{Path, PathBuf};

use clap::Args;

use crate::engine::images::workers::ThreadArgs;
use crate::error::{Error, Result};
use crate::types::{Digest, EnhancerName};
use darkqa_enhance::{Enhancer, LoadLimits, ModelFile, ProbeArgs, Runtime, RuntimeArgs, SizeArgs};

/// Flags for running enhancement models.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct EnhancerRunArgs {
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
    pub(crate) fn open(&self, file: ModelFile) -> Result<Enhancer> {
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
pub(crate) fn read_models(models: &[PathBuf]) -> Result<Vec<ModelFile>> {
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
pub(crate) enum Model {
    /// Its file, without a session.
    File(ModelFile),
    /// Its open session, with the digest of its file and sidecar ([`ModelFile::probe_digest`]).
    Open(Enhancer, Digest),
}

impl Model {
    pub(crate) fn name(&self) -> &EnhancerName {
        match self {
            Self::File(file) => file.name(),
            Self::Open(enhancer, _) => enhancer.name(),
        }
    }

    /// Path of the file, for messages.
    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::File(file) => file.path(),
            Self::Open(enhancer, _) => enhancer.path(),
        }
    }

    /// Digest of everything in the model's files that decides the findings of its probe.
    ///
    /// # Errors
    /// If a number of the sidecar is infinite or NaN.
    pub(crate) fn stated(&self) -> Result<Digest> {
        match self {
            Self::File(file) => file.probe_digest(),
            Self::Open(_, stated) => Ok(*stated),
        }
    }

    /// Opens the session of the model with these settings, unless it is open.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or the file is not a model that it can run.
    pub(crate) fn open(self, settings: &EnhancerRunArgs) -> Result<Enhancer> {
        match self {
            Self::File(file) => settings.open(file),
            Self::Open(enhancer, _) => Ok(enhancer),
        }
    }
}

/// The enhancement models of a command, loaded or not.
pub(crate) struct EnhancerModels<'a> {
    settings: &'a EnhancerRunArgs,
    models: Vec<Model>,
    /// ONNX Runtime; `None` if it is not open.
    runtime: Option<Runtime>,
}

impl<'a> EnhancerModels<'a> {
    /// The models in these files, not loaded yet.
    pub(crate) fn from_files(files: Vec<ModelFile>, settings: &'a EnhancerRunArgs) -> Self {
        Self { settings, models: files.into_iter().map(Model::File).collect(), runtime: None }
    }

    /// Loads the models in these files.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or a file is not a model that it can run.
    pub(crate) fn load(files: Vec<ModelFile>, settings: &'a EnhancerRunArgs) -> Result<Self> {
        let mut models = Self::from_files(files, settings);
        models.open()?;
        Ok(models)
    }

    /// Loads the models that are not loaded yet.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or a file is not a model that it can run.
    pub(crate) fn open(&mut self) -> Result<()> {
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
    pub(crate) fn open_runtime(&mut self) -> Result<()> {
        if self.runtime.is_none() && !self.models.is_empty() {
            self.runtime = Some(self.settings.runtime.search().open()?);
        }
        Ok(())
    }

    /// Takes all models out, loaded.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub(crate) fn take(&mut self) -> Result<Vec<Enhancer>> {
        self.take_models()?.into_iter().map(|model| model.open(self.settings)).collect()
    }

    /// Takes all models out, loaded or not, and opens ONNX Runtime.
    ///
    /// # Errors
    /// If it is not found.
    pub(crate) fn take_models(&mut self) -> Result<Vec<Model>> {
        self.open_runtime()?;
        Ok(std::mem::take(&mut self.models))
    }

    /// The models, loaded or not.
    pub(crate) fn models(&self) -> &[Model] {
        &self.models
    }

    /// Name and version of ONNX Runtime for the manifest; `None` if it was not opened.
    pub(crate) fn version(&self) -> Option<(String, String)> {
        let runtime = self.runtime.as_ref()?;
        Some(("onnxruntime".to_owned(), runtime.version().to_owned()))
    }
}
