//! The list of models for the tables of a report: [`listing`].

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::join::{Joined, JoinedRun};
use super::settings::has_human_answers;
use crate::runs::renamed::ADAPTED_FOR;
use crate::runs::training::training_data;
use crate::types::{ModelColumn, ModelListing};
use darkqa_score::answers::record::Detail;

/// The models with their order and groups from the models files of all runs, in the order of the runs' names, and facts
/// about each model.
pub(super) fn listing<D: Detail>(joined: &Joined<D>) -> ModelListing {
    let mut runs: Vec<(usize, &JoinedRun)> = joined.runs.iter().enumerate().collect();
    runs.sort_by_key(|(_, run)| (&run.name, &run.folder));
    let listed = runs.iter().flat_map(|(_, run)| run.manifest.models.clone());
    let mut listing = ModelListing::new(listed);
    let mut facts = BTreeMap::<(ModelColumn, String), BTreeSet<String>>::new();
    for (index, run) in runs {
        // The name of a model in the report.
        let shown = |model: &str| {
            let group = joined.model_names.group(model, index);
            group.map_or_else(|| model.to_owned(), |(_, name)| name.clone())
        };
        if has_human_answers(&run.manifest) {
            for name in strings(run.manifest.identity.get("--model")) {
                listing.add_people(shown(name));
            }
        }
        for (enhancer, data) in training_data(&run.manifest) {
            listing.add_training(enhancer, data);
        }
        for (field, changes) in &run.manifest.settings {
            if let Some(model) = field.strip_prefix(ADAPTED_FOR) {
                let changes = strings(Some(changes)).map(str::to_owned);
                listing.add_changes(&shown(model), changes);
            }
        }
        for (model, content) in run.manifest.columns.get("model").into_iter().flatten() {
            let known =
                [(ModelColumn::Id, content.get("--model")), (ModelColumn::Deployment, content.get("deployment"))];
            for (column, value) in known {
                if let Some(value) = value.and_then(Value::as_str) {
                    let values = facts.entry((column, shown(model))).or_default();
                    values.insert(value.to_owned());
                }
            }
        }
        for (model, names) in &run.served {
            let values = facts.entry((ModelColumn::Served, shown(model))).or_default();
            values.extend(names.iter().cloned());
        }
    }
    for ((column, model), values) in facts {
        let values: Vec<String> = values.into_iter().collect();
        listing.set_cell(column, model, values.join(", "));
    }
    listing
}

/// The strings in an array; none if the value is missing or not an array.
fn strings(value: Option<&Value>) -> impl Iterator<Item = &str> {
    value.and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str)
}
