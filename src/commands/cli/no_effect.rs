//! Warnings about flags that have no effect in a call: [`without_effect`].

use std::collections::BTreeSet;

use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command as Clap};

use super::command::{BatchCommand, CheckCommand, Cli, Command};
use super::layers;
use crate::ask::{AccessArgs, Parameters, RequestArgs, Sending};
use crate::commands::evaluate::{EvaluateArgs, ShrinkArgs};
use crate::commands::openeqa::{JudgeArgs, OpenEqaArgs};
use crate::commands::synthesize::Sheet;
use crate::data::{DecodeArgs, SetArgs};
use crate::engine::batch::{BatchFileArgs, BatchRunArgs};
use crate::engine::image_cache::StoreArgs;
use crate::engine::models::ModelName;
use crate::engine::settings::JobArgs;
use crate::pictures::ImageArgs;
use crate::types::degradations::Kind;
use crate::types::flags::flag_spelling;
use crate::types::{AxisLevel, SetLight};
use darkqa_enhance::{EnhancerArgs, ProbeArgs, RuntimeArgs, SizeArgs};
use darkqa_light::{CameraArgs, LightArgs, SensorArgs};
use darkqa_score::photographs::realism::residual::Bins;

/// One line for each reason why flags of the call have no effect.
pub(super) fn without_effect(cli: &Cli, matches: &ArgMatches) -> Vec<String> {
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
                if args.sheet == Some(Sheet::Noise) {
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

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use clap::FromArgMatches as _;

    use super::*;
    use crate::commands::cli::command;

    fn lines(words: &str) -> Vec<String> {
        let words: Vec<OsString> = std::iter::once("darkqa-eval").chain(words.split(' ')).map(OsString::from).collect();
        let parsed = layers::parse(command::command(), words, |_| None);
        let matches = parsed.map_err(|_| "not parsed").unwrap().matches;
        without_effect(&Cli::from_arg_matches(&matches).unwrap(), &matches)
    }

    /// Command lines, each with the beginning of the one warning about it.
    const WITH_WARNING: &[(&str, &str)] = &[
        ("--model m --blind --llie f.onnx --levels L3", "--levels, --llie: no effect: no model is shown an image"),
        (
            "--blind-model m --max-side 9 --image jpeg:9 --detail low",
            "--image, --image max-side, --image detail: no effect: no model is shown",
        ),
        (
            "--blind-model m --colour ignore --transfer linear --exposure 1",
            "--decode colour, --decode transfer, --decode exposure: no effect: no model is shown",
        ),
        (
            "--model m --levels L0 --variant ev --ratio 9 --fixed",
            "--noise ratio, --noise fixed, --variant: no effect: the only level is L0",
        ),
        ("--model m --variant ev --profile eld", "--profile: no effect: no variant has noise"),
        (
            "--model m --tile whole --offline",
            "--llie-options tile, --llie-options offline: no effect: no --llie is named",
        ),
        (
            "--model m --levels L0 --llie-on l0 --ort-lib x --llie-max-side 9",
            "--llie-on, --llie-options max-side, --llie-options ort-lib: no effect: no --llie is named",
        ),
        (
            "--model random --temperature 0 --rpm 9 --max-cost 1 --grace 9",
            "--temperature, --rpm, --max-cost, --stop grace: no effect: all models are built in",
        ),
        ("--model random --constrain json", "--request constrain: no effect: all models are built in"),
        ("--model random --observer-controls", "--observer-controls: no effect: the observer is not asked"),
        ("--model m --ask-per-image 3", "--ask per-image: no effect: no --ask is named"),
        ("--model m --trust-models", "--allow models-file: no effect: no file of models is named"),
        ("--model m --dry-run --timings --grace 9", "--stop grace, --timings: no effect: --dry-run sends nothing"),
        ("batch run --model m --grace 9", "--stop grace: no effect: a batch has no request in flight"),
        ("--model m --dry-run --no-parquet", "--no-parquet: no effect: --dry-run sends nothing"),
        (
            "questions data --out q.jsonl --shard 1/2 --balance none --json",
            "--balance, --json: no effect: a part measures its frames, and the same command without --shard makes the questions",
        ),
        ("report a b --no-parquet", "--no-parquet: no effect: the report is not written"),
        ("report a --out b --no-parquet", "--no-parquet: no effect: the report is not written"),
        ("--model m --images-cache-size 9", "--images-cache size: no effect: no --images-cache is named"),
        (
            "openeqa --questions q --frames f --model m --judge-temperature 1",
            "--judge-temperature: no effect: no judge is named",
        ),
        ("openeqa --questions q --frames f --model m --url /v1", "--url: no effect: only --batch"),
        ("openeqa --questions q --frames f --study s --rpm 9", "--rpm: no effect: --study asks no model"),
        (
            "openeqa --questions q --frames f --model m --levels L0 --gain 1",
            "--noise gain: no effect: the only level is L0",
        ),
        ("synthesize a --out b --sheet noise --variant ev", "--variant: no effect: this sheet"),
        ("--model m --motion speed=3", "--motion: no effect: no variant has motion blur"),
        ("--model m --auto gain=3", "--auto: no effect: no variant has automatic exposure"),
        (
            "--model m --variant motion --profile eld --gain 1",
            "--profile, --noise gain: no effect: no variant has noise",
        ),
        (
            "--model m --variant auto --profile eld --gain 1 --camera nikon-d850",
            "--profile, --noise gain: no effect: automatic exposure has",
        ),
        ("export llava a --out b --levels L0 --auto gain=3", "--auto: no effect: the only level is L0"),
        ("synthesize a --out b --levels L0 --tone none", "--noise tone: no effect: the only level is L0"),
        ("export llava a --out b --llie-on ev", "--llie-on: no effect: no --llie"),
        ("realism a --kl-bins kousha --kl-empty drop", "--kl-empty: no effect: the bins of kousha"),
        (
            "plan --model m --out r --shard 1/2 --workers 2",
            "--shard, --shard workers: no effect: a plan is of the whole run",
        ),
        ("plan --model m --out r --dry-run", "--dry-run: no effect: plan asks nothing"),
    ];

    #[test]
    fn flags_without_effect_are_named() {
        for (words, idle) in WITH_WARNING {
            let lines = lines(words);
            assert_eq!(lines.len(), 1, "{words}: {lines:?}");
            assert!(lines[0].starts_with(idle), "{words}: {lines:?}");
        }
        for words in [
            "--model m",
            "--model m --dry-run --images-cache d",
            "openeqa --questions q --frames f --study s --images-cache d",
            "--model m --llie f.onnx --tile whole --profile eld --image jpeg:90 --rpm 9",
            "--model m --ask home --ask-per-image 3",
            "report a --no-parquet",
            "merge a --out b --no-parquet",
            "--model m --blind --seed 3 --temperature 1",
            "--model random --seed 3 --shuffle-options",
            "--model observer --observer-controls",
            "--model room-net --offline",
            "openeqa --questions q --frames f --model script:a --judge j --judge-temperature 1 --rpm 9",
            "synthesize a --out b --sheet levels --profile eld",
            "synthesize a --out b --sheet levels --variant ev",
            "--model m --variant ev,motion --motion speed=3",
            "--model m --variant auto --auto gain=3 --motion speed=3 --camera nikon-d850 --fixed",
            "export llava a --out b --llie f.onnx --llie-on both",
            "--model m --levels L0 --llie f.onnx --llie-on l0 --tile whole",
            "realism a --kl-empty drop",
            "enhance m a --out b --tile whole",
        ] {
            assert_eq!(lines(words), [""; 0], "{words}");
        }
    }
}
