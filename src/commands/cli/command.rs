//! The commands of the program and their flags: [`Cli`].

use std::path::PathBuf;

use clap::{Arg, Args, CommandFactory as _, Id, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;

use crate::commands::batch::{BatchFolderArgs, BatchImportArgs, BatchStatusArgs};
use crate::commands::bundle::BundleArgs;
use crate::commands::cache::CacheArgs;
use crate::commands::calibrate::command::CalibrateArgs;
use crate::commands::enhance::EnhanceCommand;
use crate::commands::evaluate::{CheckArgs, EvaluateArgs};
use crate::commands::export::ExportArgs;
use crate::commands::figures::FiguresArgs;
use crate::commands::import::ImportCommand;
use crate::commands::init::InitArgs;
use crate::commands::merge::MergeArgs;
use crate::commands::models::ModelsArgs;
use crate::commands::openeqa::OpenEqaArgs;
use crate::commands::questions::QuestionsArgs;
use crate::commands::realism::RealismArgs;
use crate::commands::rooms::RoomsArgs;
use crate::commands::serve::ServeArgs;
use crate::commands::show::ShowArgs;
use crate::commands::site::SiteArgs;
use crate::commands::study;
use crate::commands::synthesize::SynthesizeCommand;
use darkqa_base::types::Decides;
use darkqa_base::types::flags::KeyedFlag;
use darkqa_engine::batch::{BatchFileArgs, BatchRunArgs};
use darkqa_report::joined::ReportArgs;

use super::keyed::{name_of, with_keyed_flags};

pub(super) const NAME: &str = "darkqa-eval";

/// The text of `darkqa-eval -h`.
pub(super) const SHORT_HELP: &str = include_str!("short_help.txt");

/// The flags of any command that also have a short form.
const SHORT_FORMS: [(&str, char); 6] =
    [("model", 'm'), ("data", 'd'), ("llie", 'e'), ("dry-run", 'n'), ("out", 'o'), ("quiet", 'q')];

/// The flags of any command that also have a second name: `llie` is the paper's word, `enhancer` that of the pages.
const SECOND_NAMES: [(&str, &str); 2] = [("llie", "enhancer"), ("llie-on", "enhancer-on")];

/// The commands that take the flags of an evaluation.
const ON_EVALUATIONS: [&str; 4] = ["check", "plan", "batch", "openeqa"];

/// Shown by `-h` and `--help` of these commands, below their own flags.
const TAKES_FLAGS_OF_EVALUATION: &str = "\
It takes the flags of an evaluation, such as --model, --data and --levels: see darkqa-eval -h, or --help here for all.";

/// Flags of `openeqa` that its `-h` leaves out: they are rarely set. Its `--help` and its manual page list them.
pub(super) const RARE_OPENEQA_FLAGS: [&str; 20] = [
    "splits",
    "categories",
    "subset",
    "degrade",
    "sensor",
    "sampling-seed",
    "judge-api-key-env",
    "judge-api-key-file",
    "judge-temperature",
    "judge-max-tokens",
    "poll",
    "keep-files",
    "no-scout",
    "enqueued-tokens",
    "window",
    "give-up",
    "purpose",
    "file-size",
    "file-requests",
    "url",
];

/// The heading of the flags that `--help` lists first.
const FIRST_HEADING: &str = "Model";

const AFTER_HELP: &str = "\
Precedence: flag, then environment (DARKQA_CONCURRENCY=16 for --concurrency 16), then --config FILE, then default.
OPENAI_BASE_URL, OPENAI_API_KEY and ORT_DYLIB_PATH are defaults: a flag, a DARKQA_ variable or a file replaces them.
Exit codes: 0 everything scored; 1 finished with failures; 2 usage, configuration or a fatal error; 3 stopped by
--max-cost; 130 interrupted.
[trials], [reply] and [pixels] mark what a flag decides: which trials there are, what a model is sent, the content of images. No other flag
changes an answer.
Results go to standard output, progress and logs to standard error (RUST_LOG=darkqa_=debug shows more).";

/// Measures how well a vision-language model sees in the dark.
///
/// Makes low-light versions of indoor images (levels L0–L5: 0, 2, 4, 6, 7.5, 9 EV darker; by exposure drop alone and
/// with sensor noise), enhances them with any enhancement model given as ONNX, asks OpenAI-compatible endpoints
/// multiple-choice questions about each image, and scores the replies by exact match.
///
/// The same command run again continues where it stopped: what was answered is never asked again.
#[derive(Debug, Parser)]
#[command(
    name = NAME, version, about, long_about, max_term_width = 110, after_help = AFTER_HELP,
    override_usage = "darkqa-eval [OPTIONS]\n       darkqa-eval <COMMAND>"
)]
pub(crate) struct Cli {
    /// The command; `None` for an evaluation.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Flags of an evaluation, used without a command.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
    /// Flags that every command has.
    #[command(flatten)]
    pub common: CommonArgs,
}

/// When results have colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColourChoice {
    Auto,
    Always,
    Never,
}

/// Flags that every command has.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct CommonArgs {
    /// Print no progress and no results, only their paths; tables or JSON requested by a flag are printed
    #[arg(long, global = true, add = Decides::Nothing)]
    pub quiet: bool,
    /// Colours of results; auto: on a terminal, without NO_COLOR, CLICOLOR=0 and TERM=dumb
    #[arg(long, global = true, value_name = "WHEN", value_enum, default_value = "auto", add = Decides::Nothing)]
    pub color: ColourChoice,
    /// TOML file of flags by their long names; flags of a single command are in a table of its name; default:
    /// DARKQA_CONFIG, else none
    #[arg(long, global = true, value_name = "FILE", add = Decides::Nothing)]
    pub config: Option<PathBuf>,
}

/// The commands besides an evaluation.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write the low-light versions of images, as an evaluation would send them
    Synthesize(Box<SynthesizeCommand>),
    /// Compare the synthesis with real pairs of images in normal and low light
    ///
    /// It takes no --shard: its means, its pooled residuals and the fitted gain are over all pairs.
    Realism(Box<RealismArgs>),
    /// Measure your own camera, from bias frames and pairs of flats of its sensor, as a file for --noise camera
    Calibrate(Box<CalibrateArgs>),
    /// Make multiple-choice questions about frames, by rule, from their depth, class and segment maps
    Questions(Box<QuestionsArgs>),
    /// Create a runnable example dataset, for your own images and questions
    Init(InitArgs),
    /// Check data, images, models and enhancers before anything is asked or paid
    Check(Box<CheckCommand>),
    /// Write the questions and frames of a run once, with what it will cost, so that no shard of it makes them again
    Plan(Box<EvaluateArgs>),
    /// Import frames of another data set as a folder of frames
    Import(Box<ImportCommand>),
    /// Write ready-made sets for other tools, one for each condition, with its images
    Export(Box<ExportArgs>),
    /// Write the built-in rooms as frames with depth, class and segment maps
    Rooms(RoomsArgs),
    /// Enhance images with an ONNX model, as an evaluation would; or describe or examine the model
    Enhance(Box<EnhanceCommand>),
    /// Show the settings of each model of a file: endpoint, key, request and digest; sends nothing without --check
    Models(ModelsArgs),
    /// Ask through a Batch API, at half the price: submit batches and wait for them, or write and import their files
    #[command(subcommand)]
    Batch(BatchCommand),
    /// Ask OpenEQA's open questions about walks through dark houses, the answers marked by a judge (LLM-Match)
    ///
    /// The frames of each walk are degraded, scaled and sent with upstream's prompts, byte for byte; so are the answers
    /// to the judge. The same answer to the same question is judged once. What was answered or marked is never asked
    /// again.
    #[command(name = "openeqa", mut_args(OpenEqaArgs::own))]
    OpenEqa(Box<OpenEqaArgs>),
    /// Serve the built-in models at an OpenAI-compatible endpoint on this machine, to try clients without keys
    Serve(ServeArgs),
    /// Show the results of runs, from their records alone: tables, figures and one HTML file; several runs are
    /// compared, and shards merged
    Report(ReportCommand),
    /// Draw the figures of runs for a paper, at the width of its columns: PDF, SVG, pgfplots, and their captions
    Figures(FiguresArgs),
    /// Pack a run as one ZIP file to pass on: records, tables, page and findings, without keys and paths of this
    /// machine
    Bundle(BundleArgs),
    /// Write a site of many runs: a leaderboard and the page of each run, to open from a folder or put on any web
    /// server
    Site(SiteArgs),
    /// Merge the shards of an evaluation into one run; an earlier name of report merge
    #[command(hide = true)]
    Merge(MergeArgs),
    /// Make the images of one question again, bit for bit, and check their digests
    Show(ShowArgs),
    /// Show which images an image store (--images-cache) holds, or empty it
    Cache(CacheArgs),
    /// Let people answer what the models were asked: write a page for them, import their answers as a model's
    #[command(subcommand)]
    Study(StudyCommand),
    /// Print the completions of a shell, to save where the shell looks for them
    Completions {
        /// The shell to print them for
        #[arg(value_enum, add = Decides::Nothing)]
        shell: Shell,
    },
    /// Write the manual, one page per command
    Man {
        /// Folder for the pages
        #[arg(value_name = "DIR", add = Decides::Nothing)]
        folder: PathBuf,
    },
}

/// The commands for batches.
#[derive(Debug, Subcommand)]
pub(crate) enum BatchCommand {
    /// Ask what an evaluation has left to ask in batches, and wait for their replies
    ///
    /// Writes the requests as files, uploads them, makes batches of them, waits until they end, and imports the
    /// replies. Ctrl-C leaves the batches running, and the same command continues. What expires is asked again, up to
    /// three times.
    Run(Box<BatchRun>),
    /// Show how far the batches of a run are; changes nothing
    Status(BatchStatusArgs),
    /// Check the batches of a run once, and import the replies of those that have ended; exit code 0 if everything is
    /// answered
    Fetch(BatchFolderArgs),
    /// Cancel the batches of a run, and import the replies that there are
    Cancel(BatchFolderArgs),
    /// Write what an evaluation has left to ask as files of a Batch API
    Export(Box<BatchExportArgs>),
    /// Import the replies of a Batch API into a run
    Import(BatchImportArgs),
}

/// A report on runs, or another form of it.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct ReportCommand {
    /// The form; `None` for a report on runs as they are.
    #[command(subcommand)]
    pub form: Option<ReportForm>,
    /// Flags of the report on runs as they are.
    #[command(flatten)]
    pub report: Option<ReportArgs>,
}

/// The other forms of a report.
#[derive(Debug, Subcommand)]
pub(crate) enum ReportForm {
    /// Merge the shards of an evaluation into one run, with its report
    Merge(MergeArgs),
}

/// The flags of `check`.
#[derive(Debug, Args)]
pub(crate) struct CheckCommand {
    /// Flags of the check.
    #[command(flatten)]
    pub check: CheckArgs,
    /// Flags of the evaluation.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
}

/// The flags of `batch run`.
#[derive(Debug, Args)]
pub(crate) struct BatchRun {
    /// Flags of the evaluation.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
    /// Flags of the input files.
    #[command(flatten)]
    pub files: BatchFileArgs,
    /// Flags of the batches.
    #[command(flatten)]
    pub batch: BatchRunArgs,
}

/// The flags of `batch export`.
#[derive(Debug, Args)]
pub(crate) struct BatchExportArgs {
    /// Flags of the evaluation.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
    /// Flags of the input files.
    #[command(flatten)]
    pub files: BatchFileArgs,
}

/// The commands for people's answers.
#[derive(Debug, Subcommand)]
pub(crate) enum StudyCommand {
    /// Write a page on which people answer the questions of a run about the same images that its models were sent
    Pack(study::PackArgs),
    /// Import people's answers as the run of a model, to compare with `report`
    Read(study::ReadArgs),
}

/// The command line with keyed flags and short forms. The help of each flag ends with its class, such as `[pixels]`.
pub(super) fn command() -> clap::Command {
    let root = with_classes(with_other_forms(with_keyed_flags(Cli::command())));
    let shared: Vec<Arg> = root.get_arguments().cloned().collect();
    let root = ON_EVALUATIONS
        .into_iter()
        .fold(root, |root, name| root.mut_subcommand(name, |command| on_evaluation(command, &shared)));
    first_heading_first(with_rare_openeqa_flags_hidden(root, true))
}

/// The command line for manual pages. They leave out what `-h` leaves out, but list the rare flags of `openeqa`.
pub(super) fn command_for_manual() -> clap::Command {
    with_rare_openeqa_flags_hidden(command(), false)
}

fn with_rare_openeqa_flags_hidden(root: clap::Command, is_hidden: bool) -> clap::Command {
    root.mut_subcommand("openeqa", |command| {
        command.mut_args(|arg| {
            let long = arg.get_long().unwrap_or_default();
            if RARE_OPENEQA_FLAGS.contains(&long) { arg.hide_short_help(is_hidden) } else { arg }
        })
    })
}

/// The command and those in it, with short forms and second names of their flags.
pub(super) fn with_other_forms(command: clap::Command) -> clap::Command {
    command
        .mut_args(|mut arg| {
            let long = arg.get_long().unwrap_or_default();
            let short = SHORT_FORMS.iter().find(|(of, _)| *of == long);
            let second = SECOND_NAMES.iter().find(|(of, _)| *of == long);
            if let Some((_, short)) = short {
                arg = arg.short(*short);
            }
            match second {
                Some((_, second)) => arg.visible_alias(*second),
                None => arg,
            }
        })
        .mut_subcommands(with_other_forms)
}

/// A command that takes the flags of an evaluation, or whose subcommands do. Its `-h` leaves out the flags that mean
/// the same as there.
fn on_evaluation(command: clap::Command, shared: &[Arg]) -> clap::Command {
    if !command.get_arguments().any(|arg| arg.get_long() == Some("model")) {
        return command.mut_subcommands(|inner| on_evaluation(inner, shared));
    }
    command.after_help(TAKES_FLAGS_OF_EVALUATION).mut_args(|arg| {
        let is_shared = shared.iter().any(|own| own.get_id() == arg.get_id() && own.get_help() == arg.get_help());
        arg.hide_short_help(is_shared)
    })
}

/// The command with the flags under [`FIRST_HEADING`] first. Help lists headings in the order of their flags, and a
/// flag that is changed moves to the end. So every other flag is changed.
fn first_heading_first(command: clap::Command) -> clap::Command {
    let others: Vec<Id> = command
        .get_arguments()
        .filter(|arg| arg.get_help_heading() != Some(FIRST_HEADING))
        .map(|arg| arg.get_id().clone())
        .collect();
    others.into_iter().fold(command, |command, id| command.mut_arg(id, |arg| arg))
}

/// The command and those in it, with the class of each flag that decides something at the end of its help.
fn with_classes(command: clap::Command) -> clap::Command {
    command.mut_args(with_class).mut_subcommands(with_classes)
}

fn with_class(arg: Arg) -> Arg {
    let class = Decides::from_arg(&arg).filter(|class| *class != Decides::Nothing);
    let Some(class) = class.map(Decides::word) else {
        return arg;
    };
    let help = arg.get_help().map(|help| format!("{help} [{class}]"));
    let long = arg.get_long_help().map(ToString::to_string);
    let long = long.map(|help| match help.split_once('\n') {
        // The lines of its keys follow, each with its own class.
        Some((first, keys)) if KeyedFlag::from_name(&name_of(&arg)).is_some() => {
            format!("{first} [{class}]\n{keys}")
        }
        _ => format!("{help} [{class}]"),
    });
    let arg = arg.help(help.unwrap_or_default());
    match long {
        Some(long) => arg.long_help(long),
        None => arg,
    }
}
