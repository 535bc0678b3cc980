//! The enhancement models of a command, loaded when they are needed: `OpenEnhancers`.

use std::path::PathBuf;

use clap::Args;

use super::workers::ThreadArgs;
use crate::enhance::{Enhancer, ModelFile, ProbeArgs, RuntimeArgs, SizeArgs};
use crate::error::{Error, Result};

/// Flags for running enhancement models.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct EnhancerRunArgs {
    /// Size of the images and tiles that models take.
    #[command(flatten)]
    pub size: SizeArgs,
    /// Whether their images can be enhanced images.
    #[command(flatten)]
    pub probe: ProbeArgs,
    /// The ONNX Runtime that runs them.
    #[command(flatten)]
    pub runtime: RuntimeArgs,
    /// Number of threads that run them.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The files of the enhancement models. Two files of the same name are an error.
pub(crate) fn read(models: &[PathBuf]) -> Result<Vec<ModelFile>> {
    let mut enhancers: Vec<ModelFile> = Vec::new();
    for path in models {
        let file = ModelFile::read(path)?;
        if enhancers.iter().any(|other| other.name() == file.name()) {
            let problem = format_args!(
                "two models are named {}; rename one of the files",
                file.name()
            );
            return Err(Error::usage("--llie", problem));
        }
        enhancers.push(file);
    }
    Ok(enhancers)
}

/// Enhancement models, loaded or still to be loaded.
pub(crate) struct OpenEnhancers<'a> {
    /// Settings to load `files` with; `None` if nothing remains to be loaded.
    settings: Option<&'a EnhancerRunArgs>,
    files: Vec<ModelFile>,
    pub(crate) enhancers: Vec<Enhancer>,
    /// Version of ONNX Runtime; `None` if it was not opened.
    version: Option<String>,
}

impl<'a> OpenEnhancers<'a> {
    /// The models in these files, loaded by [`Self::take`].
    pub(crate) fn deferred(files: Vec<ModelFile>, settings: &'a EnhancerRunArgs) -> Self {
        Self {
            settings: Some(settings),
            files,
            enhancers: Vec::new(),
            version: None,
        }
    }

    /// The models in these files, loaded.
    ///
    /// # Errors
    /// If ONNX Runtime is not found, or a file is not a model that it can run.
    pub(crate) fn load(files: Vec<ModelFile>, settings: &'a EnhancerRunArgs) -> Result<Self> {
        let mut opened = Self {
            settings: None,
            files: Vec::new(),
            enhancers: Vec::new(),
            version: None,
        };
        if files.is_empty() {
            return Ok(opened);
        }
        let runtime = settings.runtime.search().open()?;
        for file in files {
            let enhancer = Enhancer::open(file, &runtime, settings.threads.threads)?
                .with_tiling(settings.size.tile)
                .with_max_side(settings.size.llie_max_side)
                .with_fitting(settings.size.fitting())
                .with_time_limit(settings.runtime.llie_timeout);
            opened.enhancers.push(enhancer);
        }
        opened.version = Some(runtime.version().to_owned());
        Ok(opened)
    }

    /// The models, loaded now if they are not yet.
    pub(crate) fn take(&mut self) -> Result<Vec<Enhancer>> {
        if let Some(settings) = self.settings.take() {
            *self = Self::load(std::mem::take(&mut self.files), settings)?;
        }
        Ok(std::mem::take(&mut self.enhancers))
    }

    /// Name and version of ONNX Runtime for the manifest; `None` if it was not opened.
    pub(crate) fn version(&self) -> Option<(String, String)> {
        let version = self.version.clone()?;
        Some(("onnxruntime".to_owned(), version))
    }
}
