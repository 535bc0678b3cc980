//! What a run may cost: [`Money`].

use super::{Shard, positive};
use crate::ask::Prices;
use crate::cli::SendingArgs;
use crate::error::Result;

/// What it may cost.
#[derive(Debug)]
pub struct Money {
    /// What models cost.
    pub prices: Prices,
    /// The most that this part of a run may cost, in dollars.
    pub most: Option<f64>,
}

impl Money {
    /// What was said.
    pub(super) fn said(said: &SendingArgs, shard: Shard) -> Result<Self> {
        Ok(Self {
            prices: match &said.prices {
                Some(path) => Prices::load(path)?,
                None => Prices::built_in()?,
            },
            most: positive("--max-cost", said.max_cost)?.map(|most| shard.part_of(most)),
        })
    }
}
