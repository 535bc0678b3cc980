//! The command line: commands, their flags, and exit codes.
//!
//! The flags of a command are a struct in the module of the command. Flags that several commands share are groups in
//! the modules that use them. The environment and a `--config` file are turned into words before parsing (see
//! `cli/layers.rs`), so one parser reads all values.
//!
//! Warnings about flags that have no effect in a call: [`without_effect`].

mod command;
mod keyed;
pub(crate) mod layers;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use anstream::{AutoStream, ColorChoice};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command as Clap, FromArgMatches as _};
use clap_complete::Shell;
use tracing_subscriber::EnvFilter;

use super::evaluate::{EvaluateArgs, ShrinkArgs};
use super::openeqa::{JudgeArgs, OpenEqaArgs};
use super::synthesize::SheetKind;
use crate::commands::evaluate::{check, evaluate, export_batch, plan, run_batch};
use crate::commands::merge::merge;
use crate::commands::openeqa::openeqa;
use crate::commands::{self, study};
use command::{BatchCommand, CheckCommand, Cli, ColourChoice, Command, NAME, ReportCommand, ReportForm, StudyCommand};
use darkqa_ask::{AccessArgs, Parameters, RequestArgs, Sending};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::flags::flag_spelling;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::{escape_hidden, escape_hidden_except_styles};
use darkqa_base::types::{AxisLevel, SetLight};
use darkqa_data::{DecodeArgs, SetArgs};
use darkqa_engine::batch::{BatchFileArgs, BatchRunArgs};
use darkqa_engine::image_cache::StoreArgs;
use darkqa_engine::images::progress::{Progress, Verbosity};
use darkqa_engine::images::recipes::image_recipe;
use darkqa_engine::interrupt::{INTERRUPTED, end_at_interrupts};
use darkqa_engine::models::ModelName;
use darkqa_engine::open_files::raise_limit;
use darkqa_engine::settings::JobArgs;
use darkqa_enhance::{EnhancerArgs, ProbeArgs, RuntimeArgs, SizeArgs};
use darkqa_light::{CameraArgs, LightArgs, SensorArgs};
use darkqa_pictures::ImageArgs;
use darkqa_report::joined::report;
use darkqa_runs::Outcome;
use darkqa_score::photographs::realism::residual::Bins;
use layers::one_line;

/// Exit code: finished, but some trials failed.
const WITH_FAILURES: u8 = 1;

/// Exit code: wrong usage or configuration, or an error that stops everything.
const FATAL: u8 = 2;

/// Exit code: stopped by `--max-cost`. The same command would stop again, so a scheduler must not start it again by
/// itself.
const OVER_BUDGET: u8 = 3;

/// Default log filter. The names of all crates of this workspace begin with `darkqa_`.
const LOGGED: &str = "darkqa_=warn";

/// Printed after the error of a call without any word.
const FIRST_STEPS: &str = "
  darkqa-eval --model room-net --llie lift                    try it, without key or data
  darkqa-eval --model gpt-4o --data my-frames/ --dry-run      your own images: the requests, tokens and dollars it would take
  darkqa-eval --help                                          every flag and command
  https://github.com/darkqa-eval/darkqa-eval                  the documentation";

/// The exit code of the program, after it has carried out the command that these words name.
#[must_use]
pub fn main(words: impl Iterator<Item = OsString>) -> ExitCode {
    end_at_interrupts();
    raise_limit();
    let words: Vec<OsString> = words.collect();
    let first_steps = if words.len() == 1 { FIRST_STEPS } else { "" };
    let called: Vec<String> = words.iter().skip(1).map(word_text).collect();
    let parsed = match layers::parse(command::command(), words, |name| std::env::var_os(name)) {
        Ok(parsed) => parsed,
        Err(layers::Problem::Error(e)) => return fail(&e.to_string()),
        Err(layers::Problem::Help(help)) => {
            let written = help.print();
            // A part of the command is missing: clap prints its help on standard error.
            return match written {
                Ok(()) if !help.use_stderr() => ExitCode::SUCCESS,
                _ => ExitCode::from(FATAL),
            };
        }
    };
    let cli = match to_cli(&parsed, &called) {
        Ok(cli) => cli,
        Err(e) => return fail(&e.to_string()),
    };
    let verbosity = if cli.common.quiet { Verbosity::Quiet } else { Verbosity::Normal };
    let progress = Progress::new(verbosity);
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(LOGGED));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_target(false)
        .without_time()
        .with_writer(progress.clone())
        .init();
    for line in without_effect(&cli, &parsed.matches) {
        tracing::warn!("{line}");
    }
    let colours = match cli.common.color {
        ColourChoice::Auto => AutoStream::choice(&std::io::stdout()),
        ColourChoice::Always => ColorChoice::Always,
        ColourChoice::Never => ColorChoice::Never,
    };
    match carry_out(cli, &progress) {
        Ok(outcome) => finish(&outcome, verbosity, colours),
        // The text of an error of this crate includes its cause.
        Err(e) => fail(&format!("{e}{first_steps}")),
    }
}

/// A word of the call as text.
fn word_text(word: &OsString) -> String {
    word.to_string_lossy().into_owned()
}

/// The command line as a structure, with the image flags that the manifest of a run stores.
fn to_cli(parsed: &layers::Parsed, words: &[String]) -> Result<Cli> {
    let matches = &parsed.matches;
    let mut cli = Cli::from_arg_matches(matches).map_err(|e| Error::usage("the command line", one_line(&e)))?;
    let own = layers::command_matches(matches);
    let job = match &mut cli.command {
        None => Some(&mut cli.evaluate.job),
        Some(Command::Batch(BatchCommand::Export(args))) => Some(&mut args.evaluate.job),
        Some(Command::Batch(BatchCommand::Run(args))) => Some(&mut args.evaluate.job),
        Some(Command::Check(args)) => Some(&mut args.evaluate.job),
        Some(Command::Plan(args)) => Some(&mut args.job),
        Some(Command::OpenEqa(args)) => Some(&mut args.job),
        _ => None,
    };
    if let Some(job) = job {
        job.image_flags = image_recipe::typed_flags(own)?;
        job.typed.clone_from(&parsed.typed);
        job.unset = unset_flags(own);
        job.words = words.to_vec();
    }
    Ok(cli)
}

/// Long names of the flags that keep their defaults.
fn unset_flags(own: &ArgMatches) -> BTreeSet<String> {
    own.ids()
        .map(clap::Id::as_str)
        .filter(|id| own.value_source(id) == Some(ValueSource::DefaultValue))
        .map(|id| id.replace('_', "-"))
        .collect()
}

fn carry_out(cli: Cli, progress: &Progress) -> Result<Outcome> {
    let Some(command) = cli.command else {
        return evaluate(cli.evaluate, progress);
    };
    match command {
        Command::Synthesize(args) => commands::synthesize::synthesize(&args, progress),
        Command::Realism(args) => commands::realism::realism(&args, progress),
        Command::Calibrate(args) => commands::calibrate::command::calibrate(&args, progress),
        Command::Questions(args) => commands::questions::questions(&args, progress),
        Command::Init(args) => commands::init::init(&args, progress),
        Command::Check(args) => check(args.evaluate, &args.check, progress),
        Command::Plan(args) => plan(*args, progress),
        Command::Import(args) => commands::import::import(&args, progress),
        Command::Export(args) => commands::export::export(&args, progress),
        Command::Rooms(args) => commands::rooms::rooms(&args, progress),
        Command::Models(args) => commands::models::models(&args, progress),
        Command::Enhance(args) => commands::enhance::enhance(&args, progress),
        Command::OpenEqa(args) => openeqa(*args, progress),
        Command::Batch(BatchCommand::Export(args)) => export_batch(args.evaluate, &args.files, progress),
        Command::Batch(BatchCommand::Run(args)) => run_batch(args.evaluate, &args.files, &args.batch, progress),
        Command::Batch(BatchCommand::Status(args)) => commands::batch::status(&args),
        Command::Batch(BatchCommand::Fetch(args)) => commands::batch::fetch(&args, progress),
        Command::Batch(BatchCommand::Cancel(args)) => commands::batch::cancel(&args, progress),
        Command::Batch(BatchCommand::Import(args)) => commands::batch::import(&args),
        Command::Serve(args) => commands::serve::serve(&args, progress),
        Command::Merge(args) | Command::Report(ReportCommand { form: Some(ReportForm::Merge(args)), .. }) => {
            merge(&args)
        }
        Command::Report(ReportCommand { report: args, .. }) => report(&args.ok_or_else(no_run)?),
        Command::Figures(args) => commands::figures::figures(&args),
        Command::Bundle(args) => commands::bundle::bundle(&args),
        Command::Cache(args) => commands::cache::cache(&args),
        Command::Site(args) => commands::site::site(&args),
        Command::Show(args) => commands::show::show(args),
        Command::Study(StudyCommand::Pack(args)) => study::pack(args, progress),
        Command::Study(StudyCommand::Read(args)) => study::read(&args),
        Command::Completions { shell } => Ok(completions(shell)),
        Command::Man { folder } => manual(&folder),
    }
}

/// The error of a report without a run, which the parser finds first.
fn no_run() -> Error {
    Error::CommandLine("report: the folder of a run is missing".to_owned())
}

/// All commands and flags of the program. A test compares the documentation with them.
#[must_use]
pub fn command() -> clap::Command {
    command::command()
}

/// Checks the words of a call as far as the parser does. A test checks the calls in the documentation with it.
///
/// # Errors
/// The text of the error.
pub fn check_words(words: impl IntoIterator<Item = OsString>) -> Result<(), String> {
    let words = words.into_iter().collect();
    match layers::parse(command::command(), words, |_| None) {
        Err(layers::Problem::Error(e)) => Err(e.to_string()),
        Err(layers::Problem::Help(help)) if help.use_stderr() => Err(help.to_string()),
        Ok(_) | Err(layers::Problem::Help(_)) => Ok(()),
    }
}

/// The completions of the command line for a shell.
fn completions(shell: Shell) -> Outcome {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut keyed::without_hidden(&command::command()), NAME, &mut script);
    Outcome::text(Status::Complete, String::from_utf8_lossy(&script).into_owned())
}

/// Writes the manual pages into a folder.
fn manual(folder: &Path) -> Result<Outcome> {
    std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e))?;
    let command = command::command_for_manual().disable_help_subcommand(true);
    clap_mangen::generate_to(command, folder).map_err(|e| Error::file(folder, "write", e))?;
    Ok(Outcome::wrote(folder, Status::Complete, format!("{}: man {NAME}.1 shows the first page\n", folder.display())))
}

/// Prints the outcome of a command, and returns the exit code for it.
fn finish(outcome: &Outcome, verbosity: Verbosity, colours: ColorChoice) -> ExitCode {
    let mut stdout = AutoStream::new(std::io::stdout().lock(), colours);
    let printed = if verbosity == Verbosity::Normal || outcome.written.is_empty() {
        stdout.write_all(escape_hidden_except_styles(&outcome.output).as_bytes())
    } else {
        // An incomplete run is reported on standard error, without colours, so that standard output has only the paths.
        if outcome.status != Status::Complete {
            let mut stderr = AutoStream::never(std::io::stderr());
            let _ = stderr.write_all(escape_hidden_except_styles(&outcome.output).as_bytes());
        }
        outcome.written.iter().try_for_each(|path| writeln!(stdout, "{}", path.display()))
    };
    match (outcome.status, printed) {
        (Status::Cancelled, _) => ExitCode::from(INTERRUPTED),
        (Status::OverBudget, _) => ExitCode::from(OVER_BUDGET),
        // A reader of the output, such as `head`, may close the pipe early.
        (_, Err(e)) if e.kind() != std::io::ErrorKind::BrokenPipe => fail(&e.to_string()),
        (Status::Complete, _) => ExitCode::SUCCESS,
        _ => ExitCode::from(WITH_FAILURES),
    }
}

/// Prints an error on standard error, and returns the exit code for it. It ignores a standard error that is closed.
fn fail(problem: &str) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "error: {}", escape_hidden(problem));
    ExitCode::from(FATAL)
}

/// One line for each reason why flags of the call have no effect.
fn without_effect(cli: &Cli, matches: &ArgMatches) -> Vec<String> {
    let mut idle = NoEffect::new(layers::command_matches(matches));
    match &cli.command {
        None => idle.evaluation(&cli.evaluate),
        Some(Command::Batch(BatchCommand::Export(args))) => idle.batch_evaluation(&args.evaluate),
        Some(Command::Batch(BatchCommand::Run(args))) => idle.batch_evaluation(&args.evaluate),
        Some(Command::Plan(args)) => {
            let others = ["timings", "max_failures", "fail_fast", "max_cost", "dry_run", "resume"];
            idle.because("plan asks nothing", &others.map(str::to_owned));
            let why = "a plan is of the whole run, and the same for all its parts";
            idle.because(why, &["shard".to_owned(), "workers".to_owned()]);
            idle.evaluation(args);
        }
        Some(Command::Check(args)) => idle.check(args),
        Some(Command::OpenEqa(args)) => idle.open_questions(args),
        Some(Command::Synthesize(command)) => {
            if let Some(args) = &command.images {
                if args.sheet == Some(SheetKind::Noise) {
                    let why = "this sheet shows the noise variant";
                    idle.because(why, &[vec!["variant".into()], camera()].concat());
                }
                idle.light(&args.light);
            }
        }
        Some(Command::Report(command)) if command.report.as_ref().is_some_and(|args| !args.writes_into_run()) => {
            let why = "the report is not written into the folder of a run";
            idle.because(why, &["no_parquet".into()]);
        }
        Some(Command::Export(args)) => {
            idle.light(&args.light);
            idle.enhancement(&args.enhancers, false);
        }
        Some(Command::Questions(args)) if args.shard.as_deref().is_some_and(|shard| shard != "none") => {
            let of_all =
                ["families", "balance", "room", "candidates", "stats", "against", "review", "verdicts", "json"];
            let why = "a part measures its frames, and the same command without --shard makes the questions";
            idle.because(why, &of_all.map(str::to_owned));
        }
        Some(Command::Realism(args)) if args.kl_bins == Bins::Kousha => {
            let why = "the bins of kousha have one count added to each";
            idle.because(why, &["kl_empty".into()]);
        }
        _ => {}
    }
    idle.lines
}

/// The ids of the flags in a group.
fn ids<A: Args>() -> Vec<String> {
    let command = A::augment_args(Clap::new(""));
    command.get_arguments().map(|arg| arg.get_id().to_string()).collect()
}

/// The flags that affect only degraded images. The seed is not one of them: it affects guesses and orders too.
fn light() -> Vec<String> {
    without("seed", ids::<LightArgs>())
}

/// The flags that affect only noise.
fn sensor() -> Vec<String> {
    without("seed", ids::<SensorArgs>())
}

/// The flags that affect only automatic exposure and motion blur.
fn camera() -> Vec<String> {
    ids::<CameraArgs>()
}

/// The flags of the sensor that automatic exposure uses. The other ones affect only the noise variant.
const SENSOR_FLAGS_OF_AUTO: [&str; 2] = ["camera", "fixed"];

fn without(name: &str, mut ids: Vec<String>) -> Vec<String> {
    ids.retain(|id| id != name);
    ids
}

/// The flags that affect only enhanced images, without those for ONNX Runtime.
fn enhancement() -> Vec<String> {
    [ids::<EnhancerArgs>(), ids::<SizeArgs>(), ids::<ProbeArgs>()].concat()
}

/// The flags that were typed, and the warnings about those without effect.
struct NoEffect {
    typed: BTreeSet<String>,
    lines: Vec<String>,
}

impl NoEffect {
    fn new(matches: &ArgMatches) -> Self {
        let typed = matches.ids().map(ToString::to_string).filter(|id| {
            let is_flag = matches.try_contains_id(id).unwrap_or(false);
            is_flag && matches.value_source(id) == Some(ValueSource::CommandLine)
        });
        Self { typed: typed.collect(), lines: Vec::new() }
    }

    /// Adds a warning that names those of the given flags that were typed. Each flag is named once, with the first
    /// reason.
    fn because(&mut self, why: &str, flags: &[String]) {
        let idle: Vec<String> =
            flags.iter().filter(|id| self.typed.remove(*id)).map(|id| flag_spelling(&id.replace('_', "-"))).collect();
        if !idle.is_empty() {
            self.lines.push(format!("{}: no effect: {why}", idle.join(", ")));
        }
    }

    fn evaluation(&mut self, args: &EvaluateArgs) {
        let replies = ["constrain".to_owned(), "probabilities".to_owned()];
        let models = &args.job.models;
        if models.blind || !models.model.contains(&ModelName::Observer(None)) {
            let why = "the observer is not asked about images";
            self.because(why, &["observer_controls".to_owned()]);
        }
        if args.bank.ask.is_none() {
            self.because("no --ask is named", &["ask_per_image".to_owned()]);
        }
        let images = [ids::<ShrinkArgs>(), vec!["image_first".into()]].concat();
        if !models.model.iter().any(|name| matches!(name, ModelName::Remote(_))) {
            let why = "no model at an endpoint is shown an image";
            self.because(why, &["image_first".to_owned()]);
        }
        if !args.asks_in_several_ways() {
            let why = "every question is asked in one wording, order and draw";
            self.because(why, &["design".to_owned()]);
        }
        let light = &args.job.light;
        if light.levels(SetLight::Lit).0.iter().all(|level| *level == AxisLevel::L0)
            || !light.variant.kinds().any(Kind::has_noise)
        {
            self.because("no image has noise", &["noise_seeds".to_owned()]);
        }
        if args.scene.pairs.is_some() {
            self.because("--pairs names the data", &["data".to_owned()]);
        }
        if args.scene.pairs.is_none() && args.data.place().path().is_none() {
            self.because("the built-in rooms are not files", &ids::<SetArgs>());
        }
        self.job(&args.job, &images, &replies, None);
    }

    fn batch_evaluation(&mut self, args: &EvaluateArgs) {
        self.because("a batch has no request in flight", &["grace".to_owned()]);
        self.evaluation(args);
    }

    fn check(&mut self, args: &CheckCommand) {
        if let Some(place) = &args.check.place {
            let why = "the data are named without it";
            self.because(why, &["data".to_owned()]);
            if place.path().is_none() {
                self.because("the built-in rooms are not files", &ids::<SetArgs>());
            }
        }
    }

    fn open_questions(&mut self, args: &OpenEqaArgs) {
        if args.study.is_some() {
            let asking =
                [ids::<AccessArgs>(), ids::<Parameters>(), ids::<RequestArgs>(), ids::<Sending>(), ids::<JudgeArgs>()];
            self.because("--study asks no model", &asking.concat());
        }
        let long = ["full".into(), "findings".into()];
        self.because("open questions have one table", &long);
        if args.judge.judge.is_none() {
            self.because("no judge is named", &ids::<JudgeArgs>());
        }
        if !args.batch && !args.batch_run {
            let why = "only --batch and --batch-run write such files";
            self.because(why, &ids::<BatchFileArgs>());
        }
        if !args.batch_run {
            let why = "only --batch-run submits batches";
            self.because(why, &ids::<BatchRunArgs>());
        }
        if args.study.is_none() {
            self.job(&args.job, &[], &[], args.judge.judge.as_ref());
        }
    }

    /// Checks the flags that both experiments have. `images` adds flags for images, `replies` adds flags for requests
    /// to servers.
    fn job(&mut self, args: &JobArgs, images: &[String], replies: &[String], judge: Option<&ModelName>) {
        let models = &args.models;
        if models.models.is_none() && (models.blind || models.model.is_empty()) {
            let shown = [
                light(),
                enhancement(),
                ids::<ImageArgs>(),
                without("max_pixels", ids::<DecodeArgs>()),
                images.to_vec(),
            ];
            let shown = [shown.concat(), vec!["detail".into(), "max_image".into()]].concat();
            self.because("no model is shown an image", &shown);
        }
        if models.models.is_none() {
            self.because("no file of models is named", &["trust_models".into()]);
        }
        self.light(&args.light);
        let may_run = models.models.is_some() || models.model.contains(&ModelName::RoomNet);
        self.enhancement(&args.enhancers, may_run);
        let mut names = models.model.iter().chain(&models.blind_model).chain(judge);
        if models.models.is_none() && !names.any(|name| matches!(name, ModelName::Remote(_))) {
            let sent =
                [ids::<AccessArgs>(), ids::<Parameters>(), ids::<RequestArgs>(), ids::<Sending>(), replies.to_vec()];
            let others = ["max_cost".into(), "prices".into(), "grace".into()];
            self.because("all models are built in", &[sent.concat(), others.to_vec()].concat());
        }
        if args.money.dry_run {
            self.because(
                "--dry-run sends nothing",
                &["grace", "timings", "max_failures", "fail_fast", "no_parquet"].map(String::from),
            );
        }
        if args.stored.images_cache.is_none() {
            self.because("no --images-cache is named", &ids::<StoreArgs>());
        }
    }

    /// Checks the flags for degradation against the levels and variants.
    fn light(&mut self, args: &LightArgs) {
        let kinds: Vec<Kind> = args.variant.kinds().collect();
        let levels = args.levels(SetLight::Lit).0;
        if levels.iter().all(|level| *level == AxisLevel::L0) {
            let idle = [sensor(), camera(), vec!["variant".into()]].concat();
            self.because("the only level is L0, which is not degraded", &idle);
            return;
        }
        if !kinds.iter().any(|kind| kind.has_noise()) {
            self.because("no variant has noise", &sensor());
        } else if !kinds.iter().any(|kind| kind.has_profiles()) {
            let mut idle = sensor();
            idle.retain(|id| !SENSOR_FLAGS_OF_AUTO.contains(&&**id));
            let why = "automatic exposure has the reading physical, and a gain of its own (--auto)";
            self.because(why, &idle);
        }
        if !kinds.contains(&Kind::Auto) {
            self.because("no variant has automatic exposure", &["auto".into()]);
        }
        if !kinds.iter().any(|kind| kind.has_motion()) {
            self.because("no variant has motion blur", &["motion".into()]);
        }
    }

    /// Checks the flags for enhancement. Enhancers that no condition uses are an error elsewhere. The model `room-net`
    /// needs ONNX Runtime too.
    fn enhancement(&mut self, args: &EnhancerArgs, may_run_room_net: bool) {
        let mut runtime = ids::<RuntimeArgs>();
        runtime.retain(|id| !(may_run_room_net && ["ort_lib", "offline"].contains(&&**id)));
        if args.is_empty() {
            let mut idle = enhancement();
            idle.extend(runtime);
            self.because("no --llie is named", &idle);
        } else if args.llie.is_empty() {
            let mut idle = ids::<SizeArgs>();
            idle.extend(runtime);
            idle.retain(|id| id != "enhanced");
            self.because("no --llie is named, and --enhanced runs no model", &idle);
        }
    }
}
