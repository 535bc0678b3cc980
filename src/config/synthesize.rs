//! What `synthesize` is told, checked once: [`Synthesize`].

use std::num::NonZeroUsize;
use std::path::PathBuf;

use super::layers::Shared;
use super::light::Light;
use super::{most_pixels, parsed, threads};
use crate::cli::SynthesizeArgs;
use crate::error::{Error, Result};

/// A whole synthesis.
#[derive(Debug)]
pub struct Synthesize {
    /// Images and folders.
    pub inputs: Vec<PathBuf>,
    /// The folder that the images go to.
    pub out: PathBuf,
    /// How dark.
    pub light: Light,
    /// What is made of each frame.
    pub product: Product,
    /// What happens to a file that is there already.
    pub existing: Existing,
    /// Threads; `None` for all cores.
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have.
    pub most_pixels: u64,
}

/// What is made of each frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Product {
    /// An image for each level and variant.
    Images,
    /// The one image that this file tells of.
    Replay(PathBuf),
    /// One figure of both variants by level.
    LevelSheet,
    /// One figure of each term of the noise.
    NoiseSheet,
}

/// What happens to a file that is there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// It stays.
    Kept,
    /// It is made again.
    Replaced,
}

impl Existing {
    /// What `--force` says of it.
    pub(super) fn said(force: bool) -> Self {
        if force { Self::Replaced } else { Self::Kept }
    }
}

impl Synthesize {
    /// Checks what was said by flags, environment and `--config` file; of the last two, what concerns light, threads and
    /// pixels.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: SynthesizeArgs) -> Result<Self> {
        let shared = Shared {
            light: said.light,
            sensor: said.sensor,
            threads: said.threads,
            max_pixels: said.max_pixels,
            config: said.config,
        }
        .merge()?;
        Ok(Self {
            inputs: said.inputs,
            out: said.out,
            light: Light::resolve(&shared.light, &shared.sensor)?,
            product: match (said.from, parsed("--sheet", said.sheet.as_deref())?) {
                (Some(sidecar), _) => Product::Replay(sidecar),
                (None, Some(Sheet(product))) => product,
                (None, None) => Product::Images,
            },
            existing: Existing::said(said.force),
            threads: threads(shared.threads)?,
            most_pixels: most_pixels(shared.max_pixels),
        })
    }
}

/// A figure by its name.
struct Sheet(Product);

impl std::str::FromStr for Sheet {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "levels" => Ok(Self(Product::LevelSheet)),
            "noise" => Ok(Self(Product::NoiseSheet)),
            _ => Err(Error::usage(
                "sheet",
                format_args!("{text:?} is none of levels, noise"),
            )),
        }
    }
}
