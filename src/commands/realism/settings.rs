//! The flags of `realism`: [`RealismArgs`].

use std::path::PathBuf;

use clap::Args;

use crate::data::{DecodeArgs, RootArgs};
use crate::engine::images::workers::ThreadArgs;
use crate::types::Decides;
use darkqa_light::SensorArgs;
use darkqa_score::photographs::realism::residual::{Bins, EmptyBins};

/// Minimum and maximum of `--ev`, in EV.
const DROP_RANGE: [f32; 2] = [-20.0, 20.0];

/// The flags of `realism`.
#[derive(Debug, Args)]
pub(crate) struct RealismArgs {
    /// A folder of pairs: normal/ and low/, high/ and low/, val_rgb_h/ and val_rgb_l/, or files like normal1.png and
    /// low1.png
    #[arg(
        value_name = "PAIRS",
        required_unless_present = "normal",
        conflicts_with = "normal", add = Decides::Pixels)]
    pub pairs: Option<PathBuf>,
    /// The images in normal light, if they lie elsewhere; default: in PAIRS
    #[arg(long, value_name = "DIR", requires = "low", add = Decides::Pixels)]
    pub normal: Option<PathBuf>,
    /// The images in low light, of the same names; default: in PAIRS
    #[arg(long, value_name = "DIR", requires = "normal", add = Decides::Pixels)]
    pub low: Option<PathBuf>,
    /// Further folders that images may lie in.
    #[command(flatten)]
    pub root: RootArgs,
    /// The exposure drop of every pair in EV, -20 to 20; default: estimated for each from its mean light
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = drop_ev, add = Decides::Pixels)]
    pub ev: Option<f32>,
    /// Fit the sensor's gain K to the noise of each pair, in each noise profile, and compare the fitted camera too
    ///
    /// The gain is the one whose noise has the spread of the low-light image in blocks that are smooth in normal light,
    /// as saved: a smaller K than the sensor's means that noise was averaged away. paper and eld take the middle of the
    /// camera's r, or --noise ratio, because images show the product rK alone. With 3 fitted pairs or more, each pair
    /// is judged by the gains of the others. --out also gets a camera file for --noise camera: fitted.toml, or
    /// fitted-READING.toml for each of several readings.
    #[arg(long, conflicts_with = "gain", add = Decides::Pixels)]
    pub fit: bool,
    /// The bins of the residuals' divergence
    #[arg(long, value_enum, default_value_t, add = Decides::Nothing)]
    pub kl_bins: Bins,
    /// Treatment of empty bins of fu; both are shown
    #[arg(long, value_enum, default_value_t, add = Decides::Nothing)]
    pub kl_empty: EmptyBins,
    /// The sensor and its noise.
    #[command(flatten)]
    pub sensor: SensorArgs,
    /// Where the numbers by pair, the summary and the figures go; default: nowhere
    #[arg(long, value_name = "DIR", help_heading = "Output", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub json: bool,
    /// The reading of images.
    #[command(flatten)]
    pub decode: DecodeArgs,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Parses an exposure drop in EV.
fn drop_ev(text: &str) -> Result<f32, String> {
    let [min, max] = DROP_RANGE;
    text.parse()
        .ok()
        .filter(|ev| (min..=max).contains(ev))
        .ok_or_else(|| format!("a number from {min} to {max} expected"))
}
