//! What `export` is told, checked once: [`Export`].

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use super::layers::merge;
use super::light::Light;
use super::{Data, Enhancement, Existing, data, enhancement};
use crate::cli::{DataArgs, EvaluateArgs, ExportArgs, OutputArgs};
use crate::error::{Error, Result};

/// A whole export.
#[derive(Debug)]
pub struct Export {
    /// In what form.
    pub form: Form,
    /// Which images and questions.
    pub data: Data,
    /// How dark.
    pub light: Light,
    /// What mends the images.
    pub enhancement: Enhancement,
    /// Where the sets go.
    pub out: PathBuf,
    /// What happens to sets that are there already.
    pub existing: Existing,
}

/// The form of a ready-made set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// A table as VLMEvalKit reads it, with the images in it.
    VlmEvalKit,
    /// A folder of images with `metadata.jsonl`, as Hugging Face's `imagefolder` and lmms-eval read it.
    ImageFolder,
    /// Questions as LLaVA reads them, with a folder of images.
    Llava,
}

impl Form {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::VlmEvalKit, Self::ImageFolder, Self::Llava];
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::VlmEvalKit => "vlmevalkit",
            Self::ImageFolder => "imagefolder",
            Self::Llava => "llava",
        })
    }
}

impl FromStr for Form {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|form| form.to_string() == text)
            .ok_or_else(|| {
                let names = Self::ALL.map(|form| form.to_string()).join(", ");
                Error::usage("KIND", format_args!("{text:?} is none of {names}"))
            })
    }
}

impl Export {
    /// Checks what was said by flags, environment and `--config` file.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: ExportArgs) -> Result<Self> {
        let form = said.kind.parse()?;
        let merged = merge(EvaluateArgs {
            data: DataArgs {
                data: Some(said.data),
                questions: said.questions,
                limit: said.limit,
                families: said.families,
                max_pixels: said.max_pixels,
                ..DataArgs::default()
            },
            light: said.light,
            sensor: said.sensor,
            enhancement: said.enhancement,
            output: OutputArgs {
                config: said.config,
                ..OutputArgs::default()
            },
            ..EvaluateArgs::default()
        })?;
        Ok(Self {
            form,
            data: data(merged.data)?,
            light: Light::resolve(&merged.light, &merged.sensor)?,
            enhancement: enhancement(merged.enhancement)?,
            out: said.out,
            existing: Existing::said(said.force),
        })
    }
}
