//! The program: parse, resolve, log, run, exit code.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;
use darkqa_eval::cli::{BatchCommand, Cli, Command, EvaluateArgs, OpenEqaArgs, StudyCommand};
use darkqa_eval::config::{
    self, BatchExport, BatchImport, Config, Enhance, Export, Import, MakeRooms, Merge, OpenEqa,
    Questions, Realism, Report, Serve, ShowItem, StudyPack, StudyRead, Synthesize,
};
use darkqa_eval::enhance;
use darkqa_eval::job::Outcome;
use darkqa_eval::job::merge::merge;
use darkqa_eval::job::progress::{Loudness, Progress};
use darkqa_eval::job::report::report;
use darkqa_eval::run::evaluate::{evaluate, export_batch};
use darkqa_eval::run::export::export;
use darkqa_eval::run::import::import;
use darkqa_eval::run::openeqa::openeqa;
use darkqa_eval::run::questions::questions;
use darkqa_eval::run::realism::realism;
use darkqa_eval::run::rooms::rooms;
use darkqa_eval::run::serve::serve;
use darkqa_eval::run::show::show;
use darkqa_eval::run::study;
use darkqa_eval::run::synthesize::synthesize;
use darkqa_eval::run::{self, batch};
use darkqa_eval::types::manifest::Status;
use tracing_subscriber::EnvFilter;

/// Finished, but some trials failed.
const WITH_FAILURES: u8 = 1;
/// Usage, configuration, or an error that stops everything.
const FATAL: u8 = 2;
/// Interrupted; the same command goes on.
const INTERRUPTED: u8 = 130;

#[expect(
    unsafe_code,
    reason = "a switch that ONNX Runtime reads from the environment alone"
)]
fn main() -> ExitCode {
    // SAFETY: nothing has started a thread yet.
    unsafe { enhance::forbid_telemetry() };
    run()
}

fn run() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            return if e.print().is_ok() {
                ExitCode::SUCCESS
            } else {
                ExitCode::from(FATAL)
            };
        }
        Err(e) if e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            // Half a command: its help says the other half, on standard error.
            let _ = e.print();
            return ExitCode::from(FATAL);
        }
        Err(e) => return fail(&config::one_line(&e)),
    };
    let job = match Job::resolve(cli) {
        Ok(job) => job,
        Err(e) => return fail(&e.to_string()),
    };
    let progress = Progress::new(job.loudness);
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("darkqa_eval=warn"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_target(false)
        .without_time()
        .with_writer(progress.clone())
        .init();
    match carry_out(job.task, &progress) {
        Ok(code) => code,
        // An error of this crate says its cause itself.
        Err(e) => fail(&e.to_string()),
    }
}

/// What is to be done, before the world is looked at.
struct Job {
    loudness: Loudness,
    task: Task,
}

enum Task {
    Evaluate(Box<EvaluateArgs>),
    Synthesize(Box<Synthesize>),
    Realism(Box<Realism>),
    Questions(Box<Questions>),
    Import(Box<Import>),
    Export(Box<Export>),
    Enhance(Box<Enhance>),
    OpenEqa(Box<OpenEqaArgs>),
    BatchExport(Box<BatchExport>),
    BatchImport(BatchImport),
    Report(Report),
    Merge(Merge),
    Show(Box<ShowItem>),
    StudyPack(Box<StudyPack>),
    StudyRead(StudyRead),
    Rooms(MakeRooms),
    Serve(Serve),
}

impl Job {
    fn resolve(cli: Cli) -> anyhow::Result<Self> {
        let (quiet, task) = match cli.command {
            None => {
                let said = config::merge(cli.evaluate)?;
                (said.output.quiet, Task::Evaluate(Box::new(said)))
            }
            Some(Command::Synthesize(said)) => {
                let quiet = said.quiet;
                let config = Synthesize::resolve(said)?;
                (quiet, Task::Synthesize(Box::new(config)))
            }
            Some(Command::Realism(said)) => {
                let quiet = said.quiet;
                (quiet, Task::Realism(Box::new(Realism::resolve(said)?)))
            }
            Some(Command::Export(said)) => {
                let quiet = said.quiet;
                (quiet, Task::Export(Box::new(Export::resolve(*said)?)))
            }
            Some(Command::Enhance(said)) => {
                let quiet = said.quiet;
                (quiet, Task::Enhance(Box::new(Enhance::resolve(said)?)))
            }
            Some(Command::Import(said)) => {
                let quiet = said.quiet;
                (quiet, Task::Import(Box::new(Import::resolve(said)?)))
            }
            Some(Command::OpenEqa(said)) => {
                let quiet = said.output.quiet;
                (quiet, Task::OpenEqa(said))
            }
            Some(Command::Batch(BatchCommand::Export(said))) => {
                let quiet = said.evaluate.output.quiet;
                let config = BatchExport::resolve(*said)?;
                (quiet, Task::BatchExport(Box::new(config)))
            }
            Some(Command::Batch(BatchCommand::Import(said))) => {
                (false, Task::BatchImport(BatchImport::resolve(said)))
            }
            Some(Command::Rooms(said)) => {
                let quiet = said.quiet;
                (quiet, Task::Rooms(MakeRooms::resolve(said)?))
            }
            Some(Command::Serve(said)) => {
                let quiet = said.quiet;
                (quiet, Task::Serve(Serve::resolve(said)?))
            }
            Some(Command::Show(said)) => (false, Task::Show(Box::new(ShowItem::resolve(said)?))),
            Some(Command::Study(StudyCommand::Pack(said))) => {
                let quiet = said.quiet;
                (quiet, Task::StudyPack(Box::new(StudyPack::resolve(said)?)))
            }
            Some(Command::Study(StudyCommand::Read(said))) => {
                (false, Task::StudyRead(StudyRead::resolve(said)?))
            }
            Some(Command::Merge(said)) => (false, Task::Merge(Merge::resolve(said))),
            Some(Command::Report(said)) => (false, Task::Report(Report::resolve(said))),
            Some(Command::Questions(said)) => {
                let quiet = said.quiet;
                (quiet, Task::Questions(Box::new(Questions::resolve(said)?)))
            }
        };
        let loudness = if quiet {
            Loudness::Quiet
        } else {
            Loudness::Normal
        };
        Ok(Self { loudness, task })
    }
}

fn carry_out(task: Task, progress: &Progress) -> anyhow::Result<ExitCode> {
    let Outcome { status, output } = match task {
        Task::Evaluate(said) => evaluate(&Config::resolve(*said)?, progress)?,
        Task::Synthesize(config) => synthesize(&config, progress)?,
        Task::Realism(config) => realism(&config, progress)?,
        Task::Questions(config) => questions(&config, progress)?,
        Task::Import(config) => import(&config, progress)?,
        Task::Export(config) => export(&config, progress)?,
        Task::Enhance(config) => run::enhance::enhance(&config, progress)?,
        Task::OpenEqa(said) => openeqa(&OpenEqa::resolve(*said)?, progress)?,
        Task::BatchExport(config) => export_batch(&config.evaluation, &config.files, progress)?,
        Task::BatchImport(config) => batch::import(&config)?,
        Task::Rooms(config) => rooms(&config, progress)?,
        Task::Serve(config) => serve(&config, progress)?,
        Task::StudyPack(config) => study::pack(*config, progress)?,
        Task::StudyRead(config) => study::read(&config)?,
        Task::Show(config) => show(*config)?,
        Task::Merge(config) => merge(&config)?,
        Task::Report(config) => report(&config)?,
    };
    let written = std::io::stdout().lock().write_all(output.as_bytes());
    match (status, written) {
        (Status::Cancelled, _) => Ok(ExitCode::from(INTERRUPTED)),
        // Whoever reads the output may have enough of it.
        (_, Err(e)) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(e.into()),
        (Status::Complete, _) => Ok(ExitCode::SUCCESS),
        _ => Ok(ExitCode::from(WITH_FAILURES)),
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
