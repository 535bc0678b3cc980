//! Alerts about replies that do not follow the requested constraint: [`constraint_alerts`].

use std::collections::BTreeMap;

use crate::report::joined::join::JoinedRun;
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::text::plural;
use crate::types::{ChoiceDetail, Trials};

/// One alert for each model that was asked with `--request constrain` and has replies of another form. A reply that
/// follows the constraint is stored as a single letter.
pub(super) fn constraint_alerts(runs: &[JoinedRun], trials: &Trials<ChoiceDetail>) -> Vec<Alert> {
    let constrained: BTreeMap<&String, &str> = runs
        .iter()
        .filter_map(|run| run.manifest.columns.get("model"))
        .flat_map(BTreeMap::iter)
        .filter_map(|(name, content)| Some((name, content["--constrain"].as_str()?)))
        .filter(|(_, constraint)| *constraint != "none")
        .collect();
    constrained.iter().filter_map(|(model, constraint)| {
        let (all, other) = trials
            .iter()
            .filter(|trial| trial.model() == **model && !trial.failed())
            .fold((0_usize, 0_usize), |(all, other), trial| {
                (all + 1, other + usize::from(!trial.is_letter()))
            });
        (other > 0).then(|| {
            let replies = plural(all, "reply", "replies");
            let text = format!(
                "Constraint not followed: {other} of {replies} of {model} have another form than --request constrain={constraint} asks for, \
                 and are read as any reply."
            );
            Alert::new(AlertKind::Constrain, text)
        })
    }).collect()
}
