//! The cost of the replies of a run: [`cost`].

use crate::ask::Prices;
use crate::error::Result;
use crate::report::forecast::money;
use crate::types::{Record, Via};

/// The cost of a run's replies at list prices, as text; `None` if no model of the run has a known price.
pub(super) fn cost<D>(records: &[Record<D>]) -> Result<Option<String>> {
    let prices = Prices::built_in()?;
    let (mut dollars, mut counted, mut unknown) = (0.0, 0_usize, 0_usize);
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
            _ => unknown += 1,
        }
    }
    let note = match unknown {
        0 => String::new(),
        n => format!("; {n} replies without a known price or usage"),
    };
    let date = &prices.as_of;
    Ok((counted > 0).then(|| format!("{} at the list prices of {date}{note}", money(dollars))))
}
