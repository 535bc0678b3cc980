//! What `realism` is told, checked once: [`Realism`].

use std::num::NonZeroUsize;
use std::path::PathBuf;

use super::layers::Shared;
use super::light::Sensor;
use super::{Show, most_pixels, parsed, threads};
use crate::cli::RealismArgs;
use crate::error::{Error, Result};
use crate::score::realism::residual::{Bins, Empty};

/// The exposure drops that can be asked for, in EV.
const DROPS: [f32; 2] = [-20.0, 20.0];

/// A whole comparison with real pairs.
#[derive(Debug)]
pub struct Realism {
    /// Where the pairs are.
    pub pairs: PairPlace,
    /// The exposure drop of every pair; `None` to estimate each.
    pub drop: Option<f32>,
    /// The bins of the divergence.
    pub bins: Bins,
    /// What is done about empty ones.
    pub empty: Empty,
    /// What takes the noisy images.
    pub sensor: Sensor,
    /// Where the files go; `None` for nowhere.
    pub out: Option<PathBuf>,
    /// What standard output gets.
    pub show: Show,
    /// Threads; `None` for all cores.
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have.
    pub most_pixels: u64,
}

/// Where pairs are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PairPlace {
    /// One folder.
    Together(PathBuf),
    /// A folder for each light.
    Apart {
        /// In normal light.
        normal: PathBuf,
        /// In low light.
        low: PathBuf,
    },
}

impl Realism {
    /// Checks what was said by flags, environment and `--config` file; of the last two, what concerns the sensor, threads
    /// and pixels.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: RealismArgs) -> Result<Self> {
        let shared = Shared {
            sensor: said.sensor,
            threads: said.threads,
            max_pixels: said.max_pixels,
            config: said.config,
            ..Shared::default()
        }
        .merge()?;
        if let Some(ev) = said.ev.filter(|ev| !(DROPS[0]..=DROPS[1]).contains(ev)) {
            let problem = format!("{ev} is not a number from {} to {}", DROPS[0], DROPS[1]);
            return Err(Error::usage("--ev", problem));
        }
        Ok(Self {
            pairs: match (said.pairs, said.normal, said.low) {
                (Some(folder), ..) => PairPlace::Together(folder),
                (None, Some(normal), Some(low)) => PairPlace::Apart { normal, low },
                _ => return Err(Error::usage("PAIRS", "a folder of pairs is needed")),
            },
            drop: said.ev,
            bins: parsed("--kl-bins", said.kl_bins.as_deref())?.unwrap_or_default(),
            empty: parsed("--kl-empty", said.kl_empty.as_deref())?.unwrap_or_default(),
            sensor: Sensor::resolve(&shared.sensor)?,
            out: said.out,
            show: if said.json { Show::Json } else { Show::Table },
            threads: threads(shared.threads)?,
            most_pixels: most_pixels(shared.max_pixels),
        })
    }
}
