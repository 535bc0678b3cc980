//! The list of models for the tables of a report: [`listing`].
//!
//! The folder that the report on one run is written into: [`ReportFolder`], [`write_in_place`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde_json::Value;

use super::join::{Joined, JoinedRun};
use super::settings::has_human_answers;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{ModelColumn, ModelListing};
use darkqa_runs::renamed::ADAPTED_FOR;
use darkqa_runs::stored::RunLayout;
use darkqa_runs::training::training_data;
use darkqa_score::answers::record::Detail;
use darkqa_store::{AddressChange, Store};

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

/// The folder that the report on one run is written into.
pub(super) enum ReportFolder<'a, D: Detail> {
    /// The folder of the run.
    Run(&'a Store<D>),
    /// The folder with the shards of the run. Each shard has its own manifest; the folder has none.
    Shards(&'a Path),
}

impl<D: Detail> ReportFolder<'_, D> {
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Run(store) => store.folder(),
            Self::Shards(folder) => folder,
        }
    }

    /// Writes the files of a report and, into the folder of a run, the manifest.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub(super) fn write(&self, contents: &[(String, Vec<u8>)], manifest: &RunManifest) -> Result<()> {
        for (name, content) in contents {
            match self {
                Self::Run(store) => store.write(name, content)?,
                Self::Shards(folder) => {
                    let path = folder.join(name);
                    refuse_link(folder, &path)?;
                    files::write(&path, content)?;
                }
            }
        }
        match self {
            Self::Run(store) => store.write_manifest(manifest),
            Self::Shards(_) => Ok(()),
        }
    }
}

/// Refuses to write into a subfolder that is a symbolic link, because an untrusted folder of shards could redirect the
/// report elsewhere.
fn refuse_link(folder: &Path, path: &Path) -> Result<()> {
    match path.parent() {
        Some(inner) if inner != folder && inner.is_symlink() => Err(Error::data(
            inner.display(),
            "a link; the report would be written to where it leads. Delete the link, or name --out",
        )),
        _ => Ok(()),
    }
}

/// Calls `write` with the folder of a run; returns the text for standard output, `None` with a warning if the folder
/// cannot be written to, or `None` for a run in a ZIP file.
///
/// # Errors
/// If `write` fails for a run that could be opened for writing.
pub(super) fn write_in_place<D: Detail>(
    folder: &Path,
    layout: RunLayout,
    manifest: &RunManifest,
    write: impl FnOnce(&ReportFolder<'_, D>) -> Result<String>,
) -> Result<Option<String>> {
    let written = match layout {
        RunLayout::Whole => match Store::open_checked(folder, manifest, AddressChange::Allowed) {
            Ok(store) => return write(&ReportFolder::Run(&store)).map(Some),
            // A run that another process is writing, or in a read-only folder, is still reported on standard output.
            Err(error) => Err(error),
        },
        RunLayout::Shards => write(&ReportFolder::Shards(folder)),
        RunLayout::Zip => return Ok(None),
    };
    Ok(match written {
        Ok(text) => Some(text),
        Err(error) => {
            tracing::warn!("the report is not written: {error}");
            None
        }
    })
}
