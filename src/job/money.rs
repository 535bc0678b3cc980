//! What a run may cost: [`MoneySettings`].

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

use super::shard::Shard;
use crate::ask::Prices;
use crate::error::Result;
use crate::types::Decides;
use crate::types::flag::positive;

/// When to stop.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Sending")]
pub(crate) struct MoneyArgs {
    /// Stop when this many trials have failed; default: never
    #[arg(long, value_name = "N", add = Decides::Nothing)]
    pub max_failures: Option<NonZeroUsize>,
    /// Stop before the run has cost more than this; the same command with more goes on; default: never
    #[arg(long, value_name = "DOLLARS", value_parser = positive, add = Decides::Nothing)]
    pub max_cost: Option<f64>,
    /// A TOML file of prices in place of the built-in table; default: the built-in table
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub prices: Option<PathBuf>,
    /// Send nothing: print requests, tokens, dollars, hours and bytes
    #[arg(long, add = Decides::Nothing)]
    pub dry_run: bool,
}

/// What a run may cost, and whether it is carried out.
#[derive(Debug)]
pub(crate) struct MoneySettings {
    /// What models cost.
    pub prices: Prices,
    /// The most that this part of a run may cost, in dollars.
    pub most: Option<f64>,
    /// This many failed trials end the run.
    pub max_failures: Option<usize>,
    /// Whether to say what it would take, and send nothing.
    pub dry_run: bool,
}

impl MoneySettings {
    /// Reads the prices.
    ///
    /// # Errors
    /// If the file of prices cannot be used.
    pub(super) fn resolve(args: &MoneyArgs, shard: Shard) -> Result<Self> {
        Ok(Self {
            prices: match &args.prices {
                Some(path) => Prices::load(path)?,
                None => Prices::built_in()?,
            },
            most: args.max_cost.map(|most| shard.part_of(most)),
            max_failures: args.max_failures.map(NonZeroUsize::get),
            dry_run: args.dry_run,
        })
    }
}
