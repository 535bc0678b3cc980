//! The resolved settings of each model of a file: [`models`].

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use crate::engine::models::{
    AskSettings, AskingArgs, KeyUse, ModelArgs, ResolveContext, TextBaseline, check, describe,
};
use crate::error::Result;
use crate::images::progress::Progress;
use crate::runs::Outcome;
use crate::runs::shard::Shard;
use crate::types::Decides;
use crate::types::manifests::Status;

/// The flags of `models`.
#[derive(Debug, Args)]
pub(crate) struct ModelsArgs {
    /// The file of models
    #[arg(value_name = "FILE", add = Decides::Trials)]
    pub file: PathBuf,
    /// Show only these of the models, by their names, separated by commas; default: all
    #[arg(long, value_name = "NAMES", value_delimiter = ',', help_heading = "Model", add = Decides::Trials)]
    pub only: Vec<String>,
    /// One key of one model, which overrides the file; repeatable; default: none
    #[arg(long, value_name = "NAME.KEY=VALUE", help_heading = "Model", add = Decides::Reply)]
    pub set: Vec<String>,
    /// Trust the file of models although the working directory is not in its folder: with --check it may then name any variable and file
    #[arg(long, help_heading = "Model", add = Decides::Nothing)]
    pub trust_models: bool,
    /// Send one small request to each model, with a red image if it is asked with images, and print the replies
    #[arg(long, help_heading = "Model", add = Decides::Nothing)]
    pub check: bool,
}

/// Prints what each model of a file comes to: endpoint, where its key comes from, request and digest. Sends nothing without `--check`.
///
/// # Errors
/// If the file cannot be used, or a key is missing that `--check` needs, or the file may be a stranger's and names what is not its
/// own.
pub(crate) fn models(args: &ModelsArgs, progress: &Progress) -> Result<Outcome> {
    let named = ModelArgs {
        models: Some(args.file.clone()),
        only: args.only.clone(),
        set: args.set.clone(),
        trust_models: args.trust_models,
        ..ModelArgs::default()
    };
    let context = ResolveContext {
        typed: &BTreeSet::new(),
        shard: Shard::WHOLE,
        workers: None,
        keys: if args.check {
            KeyUse::Needed
        } else {
            KeyUse::NotNeeded
        },
        // The data are not known here: they may lie where the file does. Without requests nobody gets anything.
        data: args.check.then_some(args.file.as_path()),
        text_baseline: TextBaseline::default(),
    };
    let ask = AskSettings::resolve(&named, &AskingArgs::defaults()?, context)?;
    let mut output = describe(&ask)?;
    let mut status = Status::Complete;
    if args.check {
        output.push('\n');
        for (name, answer) in check(&ask, progress)? {
            if answer.is_err() {
                status = Status::Incomplete;
            }
            let answer = answer.unwrap_or_else(|problem| format!("FAILED: {problem}"));
            let _ = writeln!(output, "{name}: {answer}");
        }
    }
    Ok(Outcome::text(status, output))
}
