//! The command line: what can be called, and with which flags.
//!
//! The flags of a command stand in a structure beside the command; several share groups of flags, each in the room that uses it. The
//! environment and a `--config` file are turned into words before they are parsed (see [`layers`]), so every value is read by one parser.

mod layers;

use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{ArgMatches, Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use tracing_subscriber::EnvFilter;

use crate::error::Result;
use crate::job::Outcome;
use crate::job::batch::BatchFiles;
use crate::job::merge::{MergeArgs, merge};
use crate::job::picture_words;
use crate::job::progress::{Loudness, Progress};
use crate::job::report::{ReportArgs, report};
use crate::run::batch::BatchImportArgs;
use crate::run::enhance::EnhanceArgs;
use crate::run::evaluate::{EvaluateArgs, evaluate, export_batch};
use crate::run::export::ExportArgs;
use crate::run::import::ImportArgs;
use crate::run::openeqa::{OpenEqaArgs, openeqa};
use crate::run::questions::QuestionsArgs;
use crate::run::realism::RealismArgs;
use crate::run::rooms::RoomsArgs;
use crate::run::serve::ServeArgs;
use crate::run::show::ShowArgs;
use crate::run::synthesize::SynthesizeArgs;
use crate::run::{self, study};
use crate::types::manifest::Status;

use layers::one_line;

/// Measures how well a vision-language model sees in the dark.
///
/// Makes low-light versions of indoor images (levels L0–L5: 0, 2, 4, 6, 7.5, 9 EV darker; by exposure drop alone and
/// with sensor noise), enhances them with any enhancement model given as ONNX, asks OpenAI-compatible endpoints
/// multiple-choice questions about each image, and scores the replies by exact match.
///
/// The same command run again goes on where it stopped: what was answered is never asked again.
#[derive(Debug, Parser)]
#[command(
    name = "darkqa-eval", version, about, long_about, max_term_width = 110, after_help = AFTER_HELP,
    args_conflicts_with_subcommands = true
)]
pub struct Cli {
    /// Anything but an evaluation.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// What to evaluate, and how.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
    /// What every command has.
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What every command has.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub struct CommonArgs {
    /// No progress
    #[arg(long, global = true)]
    pub quiet: bool,
    /// A TOML file of flags by their long names; those of one command alone stand in a table of its name; default:
    /// DARKQA_CONFIG, else none
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

/// What can be done besides evaluating.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write the low-light versions of images, as an evaluation would send them
    Synthesize(Box<SynthesizeArgs>),
    /// Hold the synthesis against real pairs of images in normal and low light
    Realism(Box<RealismArgs>),
    /// Make multiple-choice questions about frames, by rule, from their depth, class and segment maps
    Questions(Box<QuestionsArgs>),
    /// Take over frames of another data set into the common interface
    Import(Box<ImportArgs>),
    /// Write ready-made sets for other tools, one for each condition, with its images
    Export(Box<ExportArgs>),
    /// Write the built-in rooms as frames with depth, class and segment maps
    Rooms(RoomsArgs),
    /// Enhance images by an ONNX model, as an evaluation would; or tell how it is fed and read
    Enhance(Box<EnhanceArgs>),
    /// Ask through a Batch API, at half the price: write its input files, take over its output files
    #[command(subcommand)]
    Batch(BatchCommand),
    /// Ask OpenEQA's open questions about walks through dark houses, the answers marked by a judge (LLM-Match)
    ///
    /// The frames of each walk are darkened, scaled and sent with upstream's prompts, byte for byte; so are the answers to the
    /// judge. The same answer to the same question is judged once. What was answered or marked is never asked again.
    #[command(name = "openeqa", mut_args(OpenEqaArgs::own))]
    OpenEqa(Box<OpenEqaArgs>),
    /// Answer as the built-in models do behind an OpenAI-compatible endpoint on this machine, for trying clients without keys
    Serve(ServeArgs),
    /// Show what runs hold, from their records alone: tables, figures and one HTML file; several runs are compared
    Report(ReportArgs),
    /// Put the shards of an evaluation together as the one run that they are
    Merge(MergeArgs),
    /// Make the images that one question was asked with again, bit for bit, and prove it by their digests
    Show(ShowArgs),
    /// Let people answer what the models were asked: write a page for them, take their answers over as a model's
    #[command(subcommand)]
    Study(StudyCommand),
}

/// What can be done with batches.
#[derive(Debug, Subcommand)]
pub enum BatchCommand {
    /// Write what an evaluation has left to ask as files of a Batch API; takes the flags of the evaluation
    Export(Box<BatchExportArgs>),
    /// Take the replies of a Batch API over into a run
    Import(BatchImportArgs),
}

/// The flags of `batch export`.
#[derive(Debug, Args)]
pub struct BatchExportArgs {
    /// The evaluation.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
    /// Its files.
    #[command(flatten)]
    pub files: BatchFiles,
}

/// What can be done with people's answers.
#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    /// Write a page on which people answer the questions of a run about the very images that its models were sent
    Pack(study::PackArgs),
    /// Take people's answers over as a run of a model of their own, to be compared by report
    Read(study::ReadArgs),
}

const AFTER_HELP: &str = "\
Precedence: flag, then environment (DARKQA_CONCURRENCY=16 for --concurrency 16), then --config FILE, then default.
OPENAI_BASE_URL, OPENAI_API_KEY and ORT_DYLIB_PATH are defaults: whatever names another goes before them.
Exit codes: 0 everything scored; 1 finished with failures; 2 usage, configuration or a fatal error; 130 interrupted,
or stopped by --max-cost.
Results go to standard output, progress and logs to standard error (RUST_LOG=darkqa_eval=debug shows more).";

/// Finished, but some trials failed.
const WITH_FAILURES: u8 = 1;
/// Usage, configuration, or an error that stops everything.
const FATAL: u8 = 2;
/// Interrupted; the same command goes on.
const INTERRUPTED: u8 = 130;

/// The program: what these words ask for, carried out.
#[must_use]
pub fn main(words: impl Iterator<Item = OsString>) -> ExitCode {
    let matches = match layers::parse(Cli::command(), words.collect(), |name| {
        std::env::var_os(name)
    }) {
        Ok(matches) => matches,
        Err(layers::Problem::Error(e)) => return fail(&e.to_string()),
        Err(layers::Problem::Help(help)) => {
            let written = help.print();
            // Half a command: its help says the other half, on standard error.
            return match written {
                Ok(()) if !help.use_stderr() => ExitCode::SUCCESS,
                _ => ExitCode::from(FATAL),
            };
        }
    };
    let cli = match read(&matches) {
        Ok(cli) => cli,
        Err(e) => return fail(&e.to_string()),
    };
    let progress = Progress::new(if cli.common.quiet {
        Loudness::Quiet
    } else {
        Loudness::Normal
    });
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("darkqa_eval=warn"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_target(false)
        .without_time()
        .with_writer(progress.clone())
        .init();
    match carry_out(cli, &progress) {
        Ok(outcome) => finish(outcome),
        // An error of this crate says its cause itself.
        Err(e) => fail(&e.to_string()),
    }
}

/// The command line with the words that its run keeps.
fn read(matches: &ArgMatches) -> Result<Cli> {
    let mut cli = Cli::from_arg_matches(matches)
        .map_err(|e| crate::error::Error::usage("the command line", one_line(&e)))?;
    let own = layers::own(matches);
    let job = match &mut cli.command {
        None => Some(&mut cli.evaluate.job),
        Some(Command::Batch(BatchCommand::Export(args))) => Some(&mut args.evaluate.job),
        Some(Command::OpenEqa(args)) => Some(&mut args.job),
        _ => None,
    };
    if let Some(job) = job {
        job.pictures = picture_words::said(own)?;
    }
    Ok(cli)
}

fn carry_out(cli: Cli, progress: &Progress) -> Result<Outcome> {
    let Some(command) = cli.command else {
        return evaluate(cli.evaluate, progress);
    };
    match command {
        Command::Synthesize(args) => run::synthesize::synthesize(&args, progress),
        Command::Realism(args) => run::realism::realism(&args, progress),
        Command::Questions(args) => run::questions::questions(&args, progress),
        Command::Import(args) => run::import::import(&args, progress),
        Command::Export(args) => run::export::export(&args, progress),
        Command::Rooms(args) => run::rooms::rooms(&args, progress),
        Command::Enhance(args) => run::enhance::enhance(&args, progress),
        Command::OpenEqa(args) => openeqa(*args, progress),
        Command::Batch(BatchCommand::Export(args)) => {
            export_batch(args.evaluate, &args.files, progress)
        }
        Command::Batch(BatchCommand::Import(args)) => run::batch::import(&args),
        Command::Serve(args) => run::serve::serve(&args, progress),
        Command::Report(args) => report(&args),
        Command::Merge(args) => merge(&args),
        Command::Show(args) => run::show::show(args),
        Command::Study(StudyCommand::Pack(args)) => study::pack(args, progress),
        Command::Study(StudyCommand::Read(args)) => study::read(&args),
    }
}

fn finish(Outcome { status, output }: Outcome) -> ExitCode {
    let written = std::io::stdout().lock().write_all(output.as_bytes());
    match (status, written) {
        (Status::Cancelled, _) => ExitCode::from(INTERRUPTED),
        // Whoever reads the output may have enough of it.
        (_, Err(e)) if e.kind() != std::io::ErrorKind::BrokenPipe => fail(&e.to_string()),
        (Status::Complete, _) => ExitCode::SUCCESS,
        _ => ExitCode::from(WITH_FAILURES),
    }
}

#[expect(
    clippy::print_stderr,
    reason = "the one place where an error reaches the user"
)]
fn fail(problem: &str) -> ExitCode {
    eprintln!("error: {problem}");
    ExitCode::from(FATAL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().help_expected(true).debug_assert();
    }
}
