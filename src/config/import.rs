//! What `import` is told, checked once: [`Import`].

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

use super::layers::Shared;
use super::{Existing, most_pixels, parsed, threads};
use crate::cli::ImportArgs;
use crate::dataset::import::keyframes::Every;
use crate::dataset::import::{Kind, Stated};
use crate::error::{Error, Result};
use crate::types::DepthKind;

/// A whole import.
#[derive(Debug)]
pub struct Import {
    /// What lies there.
    pub kind: Kind,
    /// Where it lies.
    pub source: PathBuf,
    /// Where the frames go.
    pub out: PathBuf,
    /// The name of the data set.
    pub name: String,
    /// What is said of its maps.
    pub stated: Stated,
    /// Which frames are taken.
    pub every: Every,
    /// What happens to frames that are there already.
    pub existing: Existing,
    /// Threads; `None` for all cores.
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have.
    pub most_pixels: u64,
}

impl Import {
    /// Checks what was said by flags, environment and `--config` file; of the last two, what concerns threads and pixels.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: ImportArgs) -> Result<Self> {
        let shared = Shared {
            threads: said.threads,
            max_pixels: said.max_pixels,
            config: said.config,
            ..Shared::default()
        }
        .merge()?;
        let kind: Kind = said.kind.parse()?;
        let above = |flag: &str, value: Option<f64>, most: f64| match value {
            Some(value) if !(value > 0.0 && value < most) => {
                let problem = format_args!("{value}: a number above 0 and below {most} expected");
                Err(Error::usage(flag, problem))
            }
            value => Ok(value),
        };
        let seconds = above("--every", said.every, 1e6)?;
        Ok(Self {
            kind,
            source: said.src,
            out: said.out,
            name: said.name.unwrap_or_else(|| kind.to_string()),
            stated: Stated {
                labels: said.labels,
                depth_scale: above("--depth-scale", said.depth_scale, 1e3)?,
                depth_kind: parsed("--depth-kind", said.depth_kind.as_deref())?,
                hfov: above("--hfov", said.hfov, 180.0)?,
                fps: above("--fps", said.fps, 1e6)?,
            },
            every: match (seconds, said.count) {
                (Some(seconds), _) => Every::Seconds(seconds),
                (None, Some(count)) => Every::Count(count.get()),
                (None, None) => Every::Frame,
            },
            existing: Existing::said(said.force),
            threads: threads(shared.threads)?,
            most_pixels: most_pixels(shared.max_pixels),
        })
    }
}

impl FromStr for DepthKind {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "planar" => Ok(Self::Planar),
            "euclid" => Ok(Self::Euclid),
            _ => Err(Error::usage(
                "depth-kind",
                format_args!("{text:?} is none of planar, euclid"),
            )),
        }
    }
}
