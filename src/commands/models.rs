//! `models`: prints the resolved settings of each model in a models file ([`models`]).

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use darkqa_base::error::Result;
use darkqa_base::types::Decides;
use darkqa_base::types::manifests::Status;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::models::{
    AskSettings, AskingArgs, KeyUse, ModelArgs, ResolveContext, TextBaseline, check, describe,
};
use darkqa_runs::Outcome;
use darkqa_runs::shard::Shard;

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
    /// Trust the file of models although the working directory is not in its folder: with --check it may then name any
    /// variable and file
    #[arg(long, help_heading = "Model", add = Decides::Nothing)]
    pub trust_models: bool,
    /// Send one small request to each model, with a red image if it is asked with images, and print the replies
    #[arg(long, help_heading = "Model", add = Decides::Nothing)]
    pub check: bool,
}

/// Prints endpoint, source of the key, request and digest of each model in a file. Sends nothing without `--check`.
///
/// # Errors
/// If the file is invalid, a key that `--check` needs is missing, or the file is not trusted and names variables or
/// files outside of its folder.
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
        keys: if args.check { KeyUse::Needed } else { KeyUse::NotNeeded },
        // The data are unknown here, but may be next to the models file. Without requests, nothing can leak.
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
