//! The command line: commands, their flags, and exit codes.
//!
//! The flags of a command are a struct in the module of the command. Flags that several commands share are groups in
//! the modules that use them. The environment and a `--config` file are turned into words before parsing (see
//! `cli/layers.rs`), so one parser reads all values.

mod command;
mod keyed;
mod layers;
mod no_effect;

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use anstream::{AutoStream, ColorChoice};
use clap::parser::ValueSource;
use clap::{ArgMatches, FromArgMatches as _};
use clap_complete::Shell;
use tracing_subscriber::EnvFilter;

use crate::commands::evaluate::{check, evaluate, export_batch, plan, run_batch};
use crate::commands::merge::merge;
use crate::commands::openeqa::openeqa;
use crate::commands::{self, study};
use crate::engine::images::progress::{Progress, Verbosity};
use crate::engine::images::recipes::image_words;
use crate::engine::interrupt::{INTERRUPTED, end_at_interrupts};
use crate::engine::open_files::raise_limit;
use crate::error::{Error, Result};
use crate::report::joined::report;
use crate::runs::Outcome;
use crate::types::manifests::Status;
use crate::types::text::{escape_hidden, escape_hidden_except_styles};

use command::{BatchCommand, Colours, Command, NAME, ReportCommand, ReportForm, StudyCommand};
use layers::one_line;

use command::Cli;

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
    for line in no_effect::without_effect(&cli, &parsed.matches) {
        tracing::warn!("{line}");
    }
    let colours = match cli.common.color {
        Colours::Auto => AutoStream::choice(&std::io::stdout()),
        Colours::Always => ColorChoice::Always,
        Colours::Never => ColorChoice::Never,
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
        job.image_flags = image_words::typed_flags(own)?;
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

#[cfg(test)]
mod tests;
