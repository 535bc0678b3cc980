//! The enhancement models of a command: `OpenEnhancers`, loaded when they are needed.

use std::path::PathBuf;

use clap::Args;

use super::workers::ThreadArgs;
use crate::enhance::{Enhancer, ModelFile, RuntimeArgs, SizeArgs};
use crate::error::{Error, Result};

/// How enhancement models are run.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct EnhancerRunArgs {
    /// In which size.
    #[command(flatten)]
    pub size: SizeArgs,
    /// By which ONNX Runtime.
    #[command(flatten)]
    pub runtime: RuntimeArgs,
    /// On how many threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The enhancement models' files, each under a name of its own.
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

/// Enhancement models, and ONNX Runtime if there are any.
pub(crate) struct OpenEnhancers<'a> {
    settings: Option<&'a EnhancerRunArgs>,
    files: Vec<ModelFile>,
    pub(crate) enhancers: Vec<Enhancer>,
    version: Option<String>,
}

impl<'a> OpenEnhancers<'a> {
    /// The models in these files, loaded when they are taken.
    pub(crate) fn later(files: Vec<ModelFile>, settings: &'a EnhancerRunArgs) -> Self {
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
    /// If ONNX Runtime is not there, or a file is no model that it runs.
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
                .with_max_side(settings.size.llie_max_side);
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

    /// ONNX Runtime and its version, if it was opened; for the manifest.
    pub(crate) fn version(&self) -> Option<(String, String)> {
        let version = self.version.clone()?;
        Some(("onnxruntime".to_owned(), version))
    }
}
