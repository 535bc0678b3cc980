//! The training data of enhancers: [`training_data`].

use std::collections::BTreeMap;

use serde_json::Value;

use crate::types::manifests::RunManifest;
use darkqa_enhance::ModelFile;

/// Data that each enhancer of a run was trained on, by its name: as the run noted them; of a run without a note, those of the
/// program's enhancer with the same digest.
pub(crate) fn training_data(run: &RunManifest) -> BTreeMap<&str, String> {
    let columns = run.columns.get("enhancer");
    columns
        .into_iter()
        .flatten()
        .filter_map(|(name, content)| {
            let noted = run.enhancers.get(name).and_then(|note| note.trained_on());
            let data = noted.map(str::to_owned).or_else(|| {
                let digest = content.get("--llie").and_then(Value::as_str)?;
                ModelFile::built_in_with(digest)?
                    .trained_on()
                    .map(str::to_owned)
            })?;
            Some((&**name, data))
        })
        .collect()
}
