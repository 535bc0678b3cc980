//! Flags of enhancers: [`EnhancerArgs`], [`SizeArgs`], [`RuntimeArgs`].

use std::env;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

use super::enhanced_folder::EnhancedFolder;
use super::enhancer::Fitting;
use super::libraries::{Install, RuntimeSearch};
use super::limits::{MemoryLimit, TimeLimit};
use super::probes::Implausible;
use super::sizing::Tiling;
use darkqa_ground::types::{Decides, SetLight, TreatmentSet};

/// The enhancers, and the images that they enhance.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct EnhancerArgs {
    /// An enhancer: lift or gray-gain, which are built in; FILE.onnx; or PRESET:FILE.onnx (zero-dce, zero-dce++, ruas-lol,
    /// ruas-upe, ruas-dark, sci, iat, pairlie, pairlie-lol, enlightengan, uretinex, retinexformer, darkir, cidnet, llformer,
    /// restormer, mirnet, kind, agllnet, zero-dce-tf); repeatable: each is shown beside raw; default: none
    #[arg(long, value_name = "NAME|FILE", add = Decides::Trials)]
    pub llie: Vec<PathBuf>,
    /// Images that were enhanced elsewhere, shown beside raw like those of an enhancer NAME: DIR has an image for each one that `synthesize`
    /// writes, under its name and with its JSON file; repeatable; default: none
    #[arg(long, value_name = "NAME=DIR", add = Decides::Trials)]
    pub enhanced: Vec<EnhancedFolder>,
    /// Which images are enhanced, several with commas: those of a variant (ev, noise, auto, motion); l0, the untouched images, for
    /// photographs that are dark already; dark, the photographs in the dark beside their frames; both is ev,noise; all is all of these;
    /// default: noise, or l0 for photographs that are dark already
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

    /// The same flags with the default for a data set in this light: for photographs that are dark already, L0 is enhanced.
    #[must_use]
    pub fn for_set(self, set: SetLight) -> Self {
        let default = match set {
            SetLight::Lit => None,
            SetLight::Dark => Some(TreatmentSet::only(None)),
        };
        Self {
            llie_on: self.llie_on.or(default),
            ..self
        }
    }
}

/// Size in which images are enhanced.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct SizeArgs {
    /// Enhance in tiles of N × N pixels, their seams checked, or whole; auto is 256 for images above 1280 × 720 if sidecar or preset state
    /// that tiles are exact, else whole
    #[arg(long, value_name = "N|whole|auto", default_value_t, add = Decides::Pixels)]
    pub tile: Tiling,
    /// Largest longer side in pixels: larger images are reduced to it, enhanced and scaled back (bilinear); for models that must see the
    /// whole image and need too much memory for it; default: no limit
    #[arg(long, value_name = "PIXELS", add = Decides::Pixels)]
    pub llie_max_side: Option<NonZeroUsize>,
    /// Resize images to the fixed size of an enhancer, and the results back (bilinear), instead of filling and cutting them;
    /// for enhancers that need the whole image; it blurs, and moves brightness by some codes of 255
    #[arg(long, add = Decides::Pixels)]
    pub llie_resize: bool,
}

impl SizeArgs {
    /// How images of other sizes reach an enhancer with a fixed size.
    #[must_use]
    pub fn fitting(&self) -> Fitting {
        if self.llie_resize {
            Fitting::Resize
        } else {
            Fitting::Tiles
        }
    }
}

/// The treatment of an enhancer whose output cannot be an enhanced image.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct ProbeArgs {
    /// Use an enhancer even if its images of dark frames are implausible: flat, inverted, in swapped colours, or in another value
    /// range than the one in which they are read; the report marks it
    #[arg(long, add = Decides::Nothing)]
    pub llie_anyway: bool,
}

impl ProbeArgs {
    /// Whether an enhancer with implausible images is used.
    pub fn implausible(&self) -> Implausible {
        if self.llie_anyway {
            Implausible::Used
        } else {
            Implausible::Refused
        }
    }
}

/// Source of the library of ONNX Runtime, and the time that it may take.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct RuntimeArgs {
    /// The ONNX Runtime library to load; default: ORT_DYLIB_PATH, else the first found beside the program, in its Python
    /// environment, in the cache folder, in the Python environments on PATH, in the system; else installed once by pip
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub ort_lib: Option<PathBuf>,
    /// Never install ONNX Runtime
    #[arg(long, add = Decides::Nothing)]
    pub offline: bool,
    /// Seconds that an enhancer may take to load, and for one image; a slower one is an error of that image, and after three in a row
    /// the enhancer is not run any more; 0 is no limit
    #[arg(long, value_name = "SECONDS", default_value_t, add = Decides::Nothing)]
    pub llie_timeout: TimeLimit,
    /// GB (10⁹ bytes) of memory that the program may take while an enhancer runs, on Linux; what takes more is an error of its image,
    /// and after three in a row the enhancer is not run any more; 0 is no limit; default: 80 % of what is free at the start
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
            library: self.ort_lib.clone().or_else(|| {
                env::var_os("ORT_DYLIB_PATH")
                    .filter(|path| !path.is_empty())
                    .map(PathBuf::from)
            }),
            install: if self.offline {
                Install::Offline
            } else {
                Install::Allowed
            },
        }
    }
}
