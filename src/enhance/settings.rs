//! Flags of enhancers: [`EnhancerArgs`], [`SizeArgs`], [`RuntimeArgs`].
//!
//! Value of the flag for images that another program enhanced: [`EnhancedFolder`].

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;
use std::{env, fmt};

use clap::Args;

use super::enhancer::Fitting;
use super::libraries::{Install, RuntimeSearch};
use super::limits::{MemoryLimit, TimeLimit};
use super::probes::Implausible;
use super::sizing::Tiling;
use darkqa_base::types::{Decides, EnhancerName, SetLight, TreatmentSet};

/// The enhancers, and the images that they enhance.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct EnhancerArgs {
    /// Enhancer: lift or gray-gain (built in), FILE.onnx, or PRESET:FILE.onnx (zero-dce, zero-dce++, ruas-lol,
    /// ruas-upe, ruas-dark, sci, iat, pairlie, pairlie-lol, enlightengan, uretinex, retinexformer, darkir, cidnet,
    /// llformer, restormer, mirnet, kind, agllnet, zero-dce-tf); repeatable: each is compared with raw; default: none
    #[arg(long, value_name = "NAME|FILE", add = Decides::Trials)]
    pub llie: Vec<PathBuf>,
    /// Images enhanced by another program, evaluated as enhancer NAME: DIR has one image for each that `synthesize`
    /// writes, with the same name and its JSON file; repeatable; default: none
    #[arg(long, value_name = "NAME=DIR", add = Decides::Trials)]
    pub enhanced: Vec<EnhancedFolder>,
    /// Images to enhance, separated by commas: a variant (ev, noise, auto, motion); l0 (untouched images, for
    /// photographs that are dark already); dark (the dark photographs of pairs); both (ev,noise); all; default: noise,
    /// or l0 for photographs that are dark already
    #[arg(long, value_name = "l0|noise|ev|auto|motion|both|dark|all", add = Decides::Trials)]
    pub llie_on: Option<TreatmentSet>,
}

impl EnhancerArgs {
    /// Treatments whose images are enhanced: those of the flag, by default the noise variant.
    #[must_use]
    pub fn on(&self) -> TreatmentSet {
        self.llie_on.unwrap_or(TreatmentSet::NOISE)
    }

    /// True if the flags name neither an enhancer nor a folder of enhanced images.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.llie.is_empty() && self.enhanced.is_empty()
    }

    /// The same flags with the default for a data set in this light: for photographs that are dark already, L0 is
    /// enhanced.
    #[must_use]
    pub fn for_set(self, set: SetLight) -> Self {
        let default = match set {
            SetLight::Lit => None,
            SetLight::Dark => Some(TreatmentSet::only(None)),
        };
        Self { llie_on: self.llie_on.or(default), ..self }
    }
}

/// Size in which images are enhanced.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct SizeArgs {
    /// Enhance in tiles of N × N pixels, their seams checked, or whole; auto is 256 for images above 1280 × 720 if
    /// sidecar or preset state that tiles are exact, else whole
    #[arg(long, value_name = "N|whole|auto", default_value_t, add = Decides::Pixels)]
    pub tile: Tiling,
    /// Largest longer side in pixels: larger images are reduced to it, enhanced and scaled back (bilinear); for models
    /// that must see the whole image and need too much memory for it; default: no limit
    #[arg(long, value_name = "PIXELS", add = Decides::Pixels)]
    pub llie_max_side: Option<NonZeroUsize>,
    /// Resize images to the fixed size of an enhancer, and the results back (bilinear), instead of filling and cutting
    /// them; for enhancers that need the whole image; it blurs, and moves brightness by some codes of 255
    #[arg(long, add = Decides::Pixels)]
    pub llie_resize: bool,
}

impl SizeArgs {
    /// How images of other sizes reach an enhancer with a fixed size.
    #[must_use]
    pub fn fitting(&self) -> Fitting {
        if self.llie_resize { Fitting::Resize } else { Fitting::Tiles }
    }
}

/// The treatment of an enhancer whose output cannot be an enhanced image.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct ProbeArgs {
    /// Use an enhancer whose images are implausible: flat, inverted, in swapped colours or in another value range; the
    /// report marks it
    #[arg(long, add = Decides::Nothing)]
    pub llie_anyway: bool,
}

impl ProbeArgs {
    /// Whether an enhancer with implausible images is used.
    pub fn implausible(&self) -> Implausible {
        if self.llie_anyway { Implausible::Used } else { Implausible::Refused }
    }
}

/// Source of the library of ONNX Runtime, and the time that it may take.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct RuntimeArgs {
    /// ONNX Runtime library; default: ORT_DYLIB_PATH, else the first found next to the program, in its Python
    /// environment, the cache folder, the Python environments on PATH, or the system; else pip installs it once
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub ort_lib: Option<PathBuf>,
    /// Never install ONNX Runtime
    #[arg(long, add = Decides::Nothing)]
    pub offline: bool,
    /// Maximum seconds for loading an enhancer and for one image; a slower image fails, and three failures in a row
    /// stop the enhancer; 0 is no limit
    #[arg(long, value_name = "SECONDS", default_value_t, add = Decides::Nothing)]
    pub llie_timeout: TimeLimit,
    /// Maximum memory of the program in GB (10⁹ bytes) while an enhancer runs, on Linux; an image that takes more
    /// fails, and three failures in a row stop the enhancer; 0 is no limit; default: 80 % of the free memory at the
    /// start
    #[arg(long, value_name = "GB", add = Decides::Nothing)]
    pub llie_max_memory: Option<MemoryLimit>,
}

impl RuntimeArgs {
    /// Limit of the process's memory while an enhancer runs; automatic without the flag.
    pub fn memory_limit(&self) -> MemoryLimit {
        self.llie_max_memory.unwrap_or_else(MemoryLimit::automatic)
    }

    /// Search for ONNX Runtime by the flags, else by the environment variable `ORT_DYLIB_PATH` of the `ort` crate.
    #[must_use]
    pub fn search(&self) -> RuntimeSearch {
        RuntimeSearch {
            library: self
                .ort_lib
                .clone()
                .or_else(|| env::var_os("ORT_DYLIB_PATH").filter(|path| !path.is_empty()).map(PathBuf::from)),
            install: if self.offline { Install::Offline } else { Install::Allowed },
        }
    }
}

/// A folder of images that another program enhanced (`NAME=DIR`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EnhancedFolder {
    /// The name of the enhancer in tables and records.
    pub name: EnhancerName,
    /// Folder of the images.
    pub folder: PathBuf,
}

impl FromStr for EnhancedFolder {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, folder) = text
            .split_once('=')
            .filter(|(_, folder)| !folder.is_empty())
            .ok_or("expected NAME=DIR, such as mine=enhanced/")?;
        let name = EnhancerName::new(name)
            .map_err(|_| format!("{name:?} is not a valid name; use letters, digits, '_', '-' and '.'"))?;
        Ok(Self { name, folder: folder.into() })
    }
}

impl fmt::Display for EnhancedFolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.name, self.folder.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_needs_a_name() {
        let read: EnhancedFolder = "mine=a=b/c".parse().unwrap();
        assert_eq!(read.to_string(), "mine=a=b/c");
        assert_eq!(read.folder, PathBuf::from("a=b/c"));
        for text in ["mine", "mine=", "=out", "my one=out"] {
            assert!(text.parse::<EnhancedFolder>().is_err(), "{text}");
        }
    }
}
