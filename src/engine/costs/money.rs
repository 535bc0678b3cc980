//! Limits of cost and failures: [`MoneySettings`].

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;
use serde_json::Value;

use darkqa_ask::Prices;
use darkqa_base::error::Result;
use darkqa_base::types::Decides;
use darkqa_base::types::flags::positive;
use darkqa_runs::shard::Shard;

/// Flags of cost and of the limits that end a run.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Sending")]
pub struct MoneyArgs {
    /// Stop when this many trials have failed; default: never
    #[arg(long, value_name = "N", add = Decides::Nothing)]
    pub max_failures: Option<NonZeroUsize>,
    /// Stop the whole run when one of its models fails for good; default: continue with the others
    #[arg(long, add = Decides::Nothing)]
    pub fail_fast: bool,
    /// Stop before the run costs more than this; the same command with a higher limit continues; default: no limit
    #[arg(long, value_name = "DOLLARS", value_parser = positive, add = Decides::Nothing)]
    pub max_cost: Option<f64>,
    /// TOML file of prices that replaces the built-in table; default: built in
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub prices: Option<PathBuf>,
    /// Send nothing: print requests, tokens, dollars, hours and bytes
    #[arg(long, add = Decides::Nothing)]
    pub dry_run: bool,
}

/// Limits of cost and failures, validated.
#[derive(Debug)]
pub struct MoneySettings {
    pub prices: Prices,
    /// Upper limit of the cost of this shard, in US dollars; `None` for no limit.
    pub max_cost: Option<f64>,
    /// Number of failed trials that ends the run; `None` for no limit.
    pub max_failures: Option<usize>,
    /// End the run when one of its models cannot be asked any further.
    pub fail_fast: bool,
    /// Print an estimate, and send nothing.
    pub dry_run: bool,
}

impl MoneySettings {
    /// Validates the flags, and reads the prices: those of `--prices`, else those in the `stored` settings of the run.
    ///
    /// # Errors
    /// If the file of prices, or the table in the settings, cannot be used.
    pub fn resolve(args: &MoneyArgs, shard: Shard, stored: &BTreeMap<String, Value>) -> Result<Self> {
        let prices = match &args.prices {
            Some(path) => Prices::load(path)?,
            None => Prices::from_settings(stored)?,
        };
        if args.prices.is_none() && args.max_cost.is_some() && prices.setting().is_some() {
            // The folder may come from another user, and its prices determine when the run stops.
            tracing::warn!("--max-cost counts with the prices that the run folder keeps; --prices FILE names others");
        }
        Ok(Self {
            prices,
            max_cost: args.max_cost.map(|whole| shard.share_of_cost(whole)),
            max_failures: args.max_failures.map(NonZeroUsize::get),
            fail_fast: args.fail_fast,
            dry_run: args.dry_run,
        })
    }
}
