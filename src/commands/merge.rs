//! `report merge`: joins the shards of a run into one run.

use std::path::PathBuf;

use clap::Args;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::FolderAccess;
use darkqa_base::types::{ChoiceDetail, Decides, OpenDetail};
use darkqa_report::joined::written;
use darkqa_runs::missing_thumbnails::MissingThumbnails;
use darkqa_runs::shard_records::append_records;
use darkqa_runs::sharded_run::{MissingShards, ShardedRun, common_kind, run_folders_in};
use darkqa_runs::stored::{ExperimentKind, StoredRun};
use darkqa_runs::{Outcome, PrintArgs, StdoutFormat, record_table};
use darkqa_score::answers::record::Detail;
use darkqa_store::{AddressChange, Store};

/// The flags of `report merge`.
#[derive(Debug, Args)]
pub(crate) struct MergeArgs {
    /// The folders of the shards, or a folder that holds them
    #[arg(value_name = "RUN", required = true, add = Decides::Nothing)]
    pub runs: Vec<PathBuf>,
    /// The folder of the whole run
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// Let other users of this machine read the new folder, as the system's umask says; else it is for you alone
    #[arg(long, add = Decides::Nothing)]
    pub shared: bool,
    /// Merge the shards that there are, even if others are missing
    #[arg(long, add = Decides::Nothing)]
    pub partial: bool,
    /// How the report is printed.
    #[command(flatten)]
    pub show: PrintArgs,
}

/// Merges shards into one run, with all records in the order of the questions and the report that a single run would
/// have written.
///
/// # Errors
/// If a folder has no shard, the shards belong to different runs or have different images, or shards are missing
/// without `--partial`.
pub(crate) fn merge(args: &MergeArgs) -> Result<Outcome> {
    let folders = run_folders(&args.runs)?;
    match common_kind(&folders)? {
        ExperimentKind::Open => merge_all::<OpenDetail>(args, &folders, written::write_open),
        ExperimentKind::Choice => merge_all::<ChoiceDetail>(args, &folders, written::write),
    }
}

fn merge_all<D: Detail>(
    args: &MergeArgs,
    folders: &[PathBuf],
    write: impl FnOnce(&Store<D>, StoredRun<D>, StdoutFormat) -> Result<Outcome>,
) -> Result<Outcome> {
    let missing = if args.partial { MissingShards::Accept } else { MissingShards::Refuse };
    let shards = ShardedRun::<D>::read(folders, missing)?;
    FolderAccess::new(args.shared).create(&args.out)?;
    let mut store = Store::<D>::open(&args.out, &shards.manifest, AddressChange::Refused)?;
    let folders = shards.folders();
    shards.questions.write(&store, &folders)?;
    let records = shards.trials.iter().map(|trial| (trial.key(), trial.text()));
    append_records(&mut store, &shards.manifest, &shards.manifests(), records)?;
    store.sync()?;
    let wanted = MissingThumbnails::new(shards.questions.frames(), Vec::new());
    store.add_thumbnails_from(&folders, |frame| wanted.wants(frame))?;
    store.add_fidelity_from(&folders, |_| true)?;
    drop(folders);
    // The trials are read again from the merged run.
    let manifest = shards.into_manifest();
    let run = StoredRun::reread(&args.out, manifest, None)?;
    let outcome = write(&store, run, args.show.format())?;
    record_table::update(&args.out, args.show.record_table())?;
    Ok(outcome)
}

/// The run folders among the named folders and directly in them.
fn run_folders(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut folders = Vec::new();
    for path in named {
        if darkqa_store::schema(path)?.is_some() {
            folders.push(path.clone());
            continue;
        }
        let inside = run_folders_in(path)?;
        if inside.is_empty() {
            let problem = "neither a run nor a folder of runs".to_owned();
            let path = path.clone();
            return Err(Error::Run { path, problem });
        }
        folders.extend(inside);
    }
    Ok(folders)
}
