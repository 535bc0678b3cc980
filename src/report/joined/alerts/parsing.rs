//! Alerts about replies that were parsed by another version of the lenient rules: [`parsing_alerts`].

use crate::report::joined::combine::Combined;
use crate::report::joined::lenient_change::LenientChange;
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::TrialRef;

/// One alert for each run whose lenient parsing would change under the rules of this version.
pub(super) fn parsing_alerts(combined: &Combined) -> Vec<Alert> {
    combined
        .runs
        .iter()
        .filter_map(|run| {
            let change = LenientChange::new(&run.manifest);
            if change.is_current() {
                return None;
            }
            let records =
                combined.trials_of(run).map(TrialRef::text).map(|place| combined.texts[place.log()].record(place));
            let text = match change.with_records(records) {
                Ok(change) if change.has_changed() => {
                    format!("{}: {}. --rescore stores what it reads now.", run.name, change.words())
                }
                Ok(_) => return None,
                Err(error) => format!("{}: its replies cannot be read again: {error}", run.name),
            };
            Some(Alert::new(AlertKind::Reading, text))
        })
        .collect()
}
