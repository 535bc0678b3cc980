//! The parts of a run, read as one run: [`RunParts`].

use std::path::{Path, PathBuf};

use super::coverage::Coverage;
use super::joined_manifest;
use super::missing::{self, MissingParts};
use super::part::StoredPart;
use super::questions::PartQuestions;
use super::trials::each_once;
use crate::error::Result;
use crate::runs::placed_trials::read_part;
use crate::runs::stored::sort;
use crate::types::Trials;
use crate::types::manifests::{Counts, RunManifest, Status};
use darkqa_score::answers::record::Detail;

/// The parts of one run, of any divisions of it.
pub(crate) struct RunParts<D: Detail> {
    parts: Vec<StoredPart>,
    pub(crate) questions: PartQuestions,
    /// Each trial once, in the order of the questions, conditions and models. The file of a text is the number of its part.
    pub(crate) trials: Trials<D>,
    /// The manifest of the run that the parts are together.
    pub(crate) manifest: RunManifest,
}

impl<D: Detail> RunParts<D> {
    /// Reads the parts in these folders.
    ///
    /// # Errors
    /// If a folder holds no part, one is of another run, an image of a trial differs in two, or sources are in no part and that is refused.
    pub(crate) fn read(folders: &[PathBuf], missing: MissingParts) -> Result<Self> {
        let parts: Result<Vec<StoredPart>> = folders
            .iter()
            .map(|folder| StoredPart::open(folder))
            .collect();
        let mut parts = parts?;
        parts.sort_by_key(|part| (part.shard.count(), part.shard));
        joined_manifest::check_same_run(&parts)?;
        let places = parts
            .iter()
            .map(|part| (part.shard, &*part.folder, &part.manifest));
        let coverage = Coverage::from_parts(places)?;
        let plan = missing::plan(&parts, &coverage)?;
        let is_missing = missing::check(&parts, &coverage, plan.as_ref(), missing)?;
        missing::warn_unfinished(&parts, plan.as_ref());
        let mut manifest = joined_manifest::joined_manifest(&parts, &coverage)?;
        let folders: Vec<&Path> = parts.iter().map(|part| &*part.folder).collect();
        let questions = PartQuestions::read(&folders)?;
        let mut trials = Trials::default();
        for (number, part) in parts.iter().enumerate() {
            read_part(&mut trials, &part.folder, &part.manifest, number)?;
        }
        let twice = each_once(&mut trials, &folders)?;
        if twice > 0 {
            tracing::warn!(
                "{twice} replies differ in two parts: they were paid for twice; those of the first part are taken"
            );
        }
        sort(&mut trials, questions.ids(), &manifest.models);
        let failed = trials.iter().filter(|trial| trial.failed()).count();
        manifest.count(Counts {
            trials: coverage.trials().max(trials.len()),
            answered: trials.len() - failed,
            failed,
        });
        if is_missing {
            manifest.status = Status::Incomplete;
        }
        Ok(Self {
            parts,
            questions,
            trials,
            manifest,
        })
    }

    /// The folders of the parts, by their numbers.
    pub(crate) fn folders(&self) -> Vec<&Path> {
        self.parts.iter().map(|part| &*part.folder).collect()
    }

    /// The manifest of the run, of which nothing else is needed any more.
    pub(crate) fn into_manifest(self) -> RunManifest {
        self.manifest
    }

    /// The folder and the manifest of each part, by their numbers.
    pub(crate) fn manifests(&self) -> Vec<(&Path, &RunManifest)> {
        self.parts
            .iter()
            .map(|part| (&*part.folder, &part.manifest))
            .collect()
    }
}
