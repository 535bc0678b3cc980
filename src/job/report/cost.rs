//! The cost of the replies of a run: [`cost`], [`dollars`].

use crate::ask::Prices;
use crate::error::Result;
use crate::report::forecast::money;
use crate::types::{Record, Via};

/// The cost of replies of a model at list prices, in US dollars; `None` if the model has no known price or no reply says its tokens.
pub(super) fn dollars<D>(model: &str, records: &[&Record<D>]) -> Result<Option<f64>> {
    let prices = Prices::built_in()?;
    let replies = records.iter().filter(|record| record.reply.is_some());
    let charged = replies.filter_map(|record| charged(&prices, model, record));
    let charged: Vec<f64> = charged.collect();
    Ok((!charged.is_empty()).then(|| charged.iter().sum()))
}

/// The cost of a reply; `None` if it is not known.
fn charged<D>(prices: &Prices, model: &str, record: &Record<D>) -> Option<f64> {
    let share = match record.via {
        Via::Direct | Via::File => 1.0,
        Via::Batch => prices.batch,
    };
    Some(share * prices.of(model)?.charged(record.usage?))
}

/// The cost of a run's replies at list prices, as text; `None` if no model of the run has a known price.
pub(super) fn cost<D>(records: &[Record<D>]) -> Result<Option<String>> {
    let prices = Prices::built_in()?;
    let (mut dollars, mut counted, mut unknown) = (0.0, 0_usize, 0_usize);
    for record in records.iter().filter(|record| record.reply.is_some()) {
        match charged(&prices, &record.model, record) {
            Some(cost) => {
                dollars += cost;
                counted += 1;
            }
            None => unknown += 1,
        }
    }
    let note = match unknown {
        0 => String::new(),
        n => format!("; {n} replies without a known price or usage"),
    };
    let date = &prices.as_of;
    Ok((counted > 0).then(|| format!("{} at the list prices of {date}{note}", money(dollars))))
}
