//! The shards of a run, joined into one run: [`ShardedRun`]. `report merge` writes this run, and `report` reports on it
//! without writing it.

mod coverage;
mod joined_manifest;
mod missing;
mod open;
mod questions;
mod stored_shard;
mod trials;

use std::path::{Path, PathBuf};

use self::coverage::Coverage;
use self::questions::ShardQuestions;
use self::stored_shard::StoredShard;
use self::trials::remove_duplicates;
use crate::error::Result;
use crate::runs::shard_records::read_shard;
use crate::runs::stored::sort_trials;
use crate::types::Trials;
use crate::types::manifests::{Counts, RunManifest, Status};
use darkqa_score::answers::record::Detail;

pub(crate) use missing::MissingShards;
pub(crate) use open::{common_kind, open_any_run, open_choice_run, run_folders_in};

/// The shards of one run, which may come from several divisions of it.
pub(crate) struct ShardedRun<D: Detail> {
    shards: Vec<StoredShard>,
    pub(crate) questions: ShardQuestions,
    /// Distinct trials, in the order of questions, conditions and models. The file number of a text is the index of its
    /// shard.
    pub(crate) trials: Trials<D>,
    /// The manifest of the whole run.
    pub(crate) manifest: RunManifest,
}

impl<D: Detail> ShardedRun<D> {
    /// Reads and joins the shards in these folders.
    ///
    /// # Errors
    /// If a folder has no shard, the shards belong to different runs, the same trial has different images in two
    /// shards, or sources are in no shard and `missing` is [`MissingShards::Refuse`].
    pub(crate) fn read(folders: &[PathBuf], missing: MissingShards) -> Result<Self> {
        let mut shards: Vec<StoredShard> =
            folders.iter().map(|folder| StoredShard::open(folder)).collect::<Result<_>>()?;
        shards.sort_by_key(|shard| (shard.shard.count(), shard.shard));
        joined_manifest::check_same_run(&shards)?;
        let coverage =
            Coverage::from_shards(shards.iter().map(|shard| (shard.shard, &*shard.folder, &shard.manifest)))?;
        let plan = missing::plan(&shards, &coverage)?;
        let is_missing = missing::check(&shards, &coverage, plan.as_ref(), missing)?;
        missing::warn_unfinished(&shards, plan.as_ref());
        let mut manifest = joined_manifest::joined_manifest(&shards, &coverage)?;
        let folders: Vec<&Path> = shards.iter().map(|shard| &*shard.folder).collect();
        let questions = ShardQuestions::read(&folders)?;
        let mut trials = Trials::default();
        for (number, shard) in shards.iter().enumerate() {
            read_shard(&mut trials, &shard.folder, &shard.manifest, number)?;
        }
        let paid_twice = remove_duplicates(&mut trials, &folders)?;
        if paid_twice > 0 {
            tracing::warn!(
                "{paid_twice} replies differ in two parts: they were paid for twice; those of the first part are taken"
            );
        }
        sort_trials(&mut trials, questions.ids(), &manifest.models);
        let failed = trials.iter().filter(|trial| trial.failed()).count();
        manifest.set_counts(Counts {
            trials: coverage.trials().max(trials.len()),
            answered: trials.len() - failed,
            failed,
        });
        if is_missing {
            manifest.status = Status::Incomplete;
        }
        Ok(Self { shards, questions, trials, manifest })
    }

    /// The folder of each shard.
    pub(crate) fn folders(&self) -> Vec<&Path> {
        self.shards.iter().map(|shard| &*shard.folder).collect()
    }

    /// The manifest of the whole run; frees everything else.
    pub(crate) fn into_manifest(self) -> RunManifest {
        self.manifest
    }

    /// The folder and the manifest of each shard.
    pub(crate) fn manifests(&self) -> Vec<(&Path, &RunManifest)> {
        self.shards.iter().map(|shard| (&*shard.folder, &shard.manifest)).collect()
    }
}
