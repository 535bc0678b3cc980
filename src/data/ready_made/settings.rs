//! Flags for ready-made sets: [`SetArgs`].

use clap::{Args, ValueEnum};

use super::columns::map::ColumnMap;
use super::omissions::SkipBad;
use crate::root::RootArgs;
use darkqa_base::types::Decides;

/// Flags for reading a ready-made set.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Ready-made sets")]
pub struct SetArgs {
    /// Columns of a ready-made set, as
    /// question=frage,image=pics/{bild}.png,options=auswahl:split(|),answer=richtig:index1; default: by their names
    #[arg(long, value_name = "ROLE=COLUMN,…", add = Decides::Reply)]
    pub map: Vec<ColumnMap>,
    /// The well-known set that `--data NAME:FILE` names.
    #[arg(skip)]
    pub preset: Option<String>,
    /// The configuration that the rules of that set name.
    #[arg(skip)]
    pub preset_config: Option<String>,
    /// Read only the images: no row needs a question, options or an answer.
    #[arg(skip)]
    pub images_alone: bool,
    /// Configuration of a repository, or all; default: the default of its card
    #[arg(long, value_name = "NAME|all", add = Decides::Reply)]
    pub config_name: Option<String>,
    /// Split, or all; default: the only one, or test
    #[arg(long, value_name = "NAME|all", add = Decides::Reply)]
    pub split: Option<String>,
    /// Path to the rows in a JSON file, as items or images.*.qa; default: the whole file
    #[arg(long, value_name = "FIELD", add = Decides::Reply)]
    pub rows: Option<String>,
    /// Rows with several images: leave them out, or send all images in one request; default: stop
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
    /// Leave out broken rows, and images that are missing or cannot be read, up to this share of all: 5 % for the key
    /// alone; default: stop
    #[arg(long, value_name = "PERCENT", add = Decides::Trials)]
    pub bad: Option<SkipBad>,
    /// Further folders of the data.
    #[command(flatten)]
    pub root: RootArgs,
    /// Keep answer instructions at the end of questions; default: cut, because the prompt has its own
    #[arg(long, add = Decides::Reply)]
    pub keep_instructions: bool,
}

/// The treatment of rows with several images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SeveralImages {
    /// Leave them out and print their number
    Skip,
    /// Send all images of a row in one request, in order and in the same condition; <image 2> in a text places the
    /// second
    Send,
}

/// The treatment of rows that cannot be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LeaveOut {
    /// Leave them out and print their number
    Skip,
}
