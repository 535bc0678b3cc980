//! The flags of `show`: [`ShowArgs`].

use std::path::PathBuf;

use clap::Args;

use crate::engine::image_rebuilder::RebuildArgs;
use crate::types::{Condition, Decides};

/// The flags of `show`.
#[derive(Debug, Args)]
pub(crate) struct ShowArgs {
    /// The folder of a run
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// The id of a question
    #[arg(value_name = "ITEM", add = Decides::Nothing)]
    pub item: String,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all that it was asked in
    #[arg(long, value_name = "CONDITION", add = Decides::Nothing)]
    pub condition: Vec<Condition>,
    /// Where the images go; default: shown in the folder of the run
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Draw one picture instead, .png or .jpg: the image over the levels, raw above each enhancer, whether each model's
    /// reply was right, and the curves of the run below; default: none
    #[arg(long, value_name = "FILE", conflicts_with_all = ["condition", "out"], add = Decides::Nothing)]
    pub sheet: Option<PathBuf>,
    /// Where the data and enhancers are now.
    #[command(flatten)]
    pub rebuild: RebuildArgs,
}

impl ShowArgs {
    /// The id of the question, without the order of its choices, which the report adds to it.
    pub(super) fn question_id(&self) -> &str {
        self.item.split('#').next().unwrap_or_default()
    }
}
