//! What `enhance` is told, checked once: [`Enhance`].

use std::path::PathBuf;

use super::layers::merge;
use super::{Enhancement, Existing, enhancement, most_pixels};
use crate::cli::{DataArgs, EnhanceArgs, EnhancementArgs, EvaluateArgs, OutputArgs};
use crate::error::Result;

/// A whole enhancement.
#[derive(Debug)]
pub struct Enhance {
    /// The one model, and how it is run.
    pub enhancement: Enhancement,
    /// Images and folders.
    pub inputs: Vec<PathBuf>,
    /// The folder that the images go to; `None` where the model is only described.
    pub out: Option<PathBuf>,
    /// What happens to a file that is there already.
    pub existing: Existing,
    /// The most pixels an image may have.
    pub most_pixels: u64,
}

impl Enhance {
    /// Checks what was said by flags, environment and `--config` file; of the last two, what concerns enhancement and pixels.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: EnhanceArgs) -> Result<Self> {
        let shared = merge(EvaluateArgs {
            data: DataArgs {
                max_pixels: said.max_pixels,
                ..DataArgs::default()
            },
            enhancement: EnhancementArgs {
                llie: vec![said.model],
                tile: said.tile,
                llie_max_side: said.llie_max_side,
                threads: said.threads,
                ort_lib: said.ort_lib,
                offline: said.offline,
                ..EnhancementArgs::default()
            },
            output: OutputArgs {
                config: said.config,
                ..OutputArgs::default()
            },
            ..EvaluateArgs::default()
        })?;
        Ok(Self {
            enhancement: enhancement(shared.enhancement)?,
            inputs: said.inputs,
            out: said.out,
            existing: Existing::said(said.force),
            most_pixels: most_pixels(shared.data.max_pixels),
        })
    }
}
