//! What replies cost: [`cost`].

use crate::ask::Prices;
use crate::error::Result;
use crate::report::forecast::money;
use crate::types::{Record, Via};

/// What the replies of a run cost at list prices, in words; nothing where no model of it has a known price.
pub(super) fn cost<D>(records: &[Record<D>]) -> Result<Option<String>> {
    let prices = Prices::built_in()?;
    let (mut dollars, mut counted, mut left) = (0.0, 0_usize, 0_usize);
    for record in records.iter().filter(|record| record.reply.is_some()) {
        match (prices.of(&record.model), record.usage) {
            (Some(price), Some(usage)) => {
                let share = match record.via {
                    Via::Direct | Via::File => 1.0,
                    Via::Batch => prices.batch,
                };
                dollars += share * price.charged(usage);
                counted += 1;
            }
            _ => left += 1,
        }
    }
    let rest = match left {
        0 => String::new(),
        n => format!("; {n} replies without a known price or usage"),
    };
    let at = &prices.as_of;
    Ok((counted > 0).then(|| format!("{} at the list prices of {at}{rest}", money(dollars))))
}
