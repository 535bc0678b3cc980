//! Flags for ready-made sets: [`SetArgs`].

use clap::{Args, ValueEnum};

use super::columns::map::ColumnMap;
use super::omissions::SkipBad;
use crate::dataset::root::RootArgs;
use crate::types::Decides;

/// Flags for reading a ready-made set.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Ready-made sets")]
pub struct SetArgs {
    /// Which column of a ready-made set is which, as question=frage,image=pics/{bild}.png,options=auswahl:split(|),answer=richtig:index1;
    /// default: by their names
    #[arg(long, value_name = "ROLE=COLUMN,…", add = Decides::Reply)]
    pub map: Vec<ColumnMap>,
    /// The well-known set that `--data NAME:FILE` names.
    #[arg(skip)]
    pub preset: Option<String>,
    /// The configuration that the rules of that set name.
    #[arg(skip)]
    pub preset_config: Option<String>,
    /// The configuration of a repository of several, or all of them; default: the one that its card makes the default
    #[arg(long, value_name = "NAME|all", add = Decides::Reply)]
    pub config_name: Option<String>,
    /// The split, or all of them; default: the only one, or test
    #[arg(long, value_name = "NAME|all", add = Decides::Reply)]
    pub split: Option<String>,
    /// Where the rows are in a JSON file, as items or images.*.qa; default: the whole file
    #[arg(long, value_name = "FIELD", add = Decides::Reply)]
    pub rows: Option<String>,
    /// Treatment of rows that show several images: leave them out, or send all images of a row in one request; default: stop
    #[arg(long, value_name = "skip|send", add = Decides::Trials)]
    pub multi_image: Option<SeveralImages>,
    /// Leave out rows without an image; default: stop
    #[arg(long, value_name = "skip", add = Decides::Trials)]
    pub no_image: Option<LeaveOut>,
    /// Leave out open questions, which have no options; default: stop
    #[arg(long, value_name = "skip", add = Decides::Trials)]
    pub open: Option<LeaveOut>,
    /// Leave out rows with several true options; default: stop
    #[arg(long, value_name = "skip", add = Decides::Trials)]
    pub several: Option<LeaveOut>,
    /// Leave out broken rows, and images that are missing or cannot be read, up to this share of all: 5 % for the key alone; default: stop
    #[arg(long, value_name = "PERCENT", add = Decides::Trials)]
    pub bad: Option<SkipBad>,
    /// Further folders of the data.
    #[command(flatten)]
    pub root: RootArgs,
    /// Keep sentences at the end of questions that say in what form to answer; default: cut, because the prompt says it too
    #[arg(long, add = Decides::Reply)]
    pub keep_instructions: bool,
}

/// The treatment of rows with several images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SeveralImages {
    /// Leave them out, and state how many
    Skip,
    /// Send all images of a row in one request, in order, each in the same condition; <image 2> in a text is the place of the second
    Send,
}

/// The treatment of rows that cannot be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LeaveOut {
    /// Leave them out, and state how many
    Skip,
}
