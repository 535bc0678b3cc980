//! Levels, kinds and noise of degradations: flags ([`LightArgs`], [`SensorArgs`]) and resolved settings
//! ([`LightSettings`], [`SensorSettings`]).

use std::num::NonZeroU16;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::applied::AppliedDegradation;
use super::auto::{AutoExposure, AutoSettings};
use super::draws::NoiseKey;
use super::levels::{LIGHT, Levels, ladder};
use super::movement::{FrameView, Motion};
use super::noise_profile::{Amplify, Coupling, Draws, NoiseProfile, NoiseProfiles, Synthesis, Tone};
use super::{CameraModel, Sampling};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, Decides, Degradation, KindSet, PairDark, ProfileName, SetLight};

/// The levels and kinds of degradation.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Light")]
pub struct LightArgs {
    /// Levels, as L0-L5 or L0,L3, exposure drops in EV up to 16, as L0,3.3, and ranges of them, as 0..10:0.5; of
    /// motion, exposure times in ms, as T33.33 or T8.33-T133.33; match is as dark as the photograph in the dark of each
    /// frame; default: L0-L5, of photographs in the dark L0
    ///
    /// L0-L5 is also the ladder of motion, T8.33-T133.33, unless exposure times are named.
    #[arg(long, value_name = "LEVELS", add = Decides::Trials)]
    pub levels: Option<Levels>,
    /// Variants, as ev,auto: ev (exposure drop alone), noise (with sensor noise), both (of these two), auto (as a
    /// camera with automatic exposure responds to the drop), motion (motion blur alone), all
    #[arg(long, value_name = "LIST", default_value_t = KindSet::BOTH, add = Decides::Trials)]
    pub variant: KindSet,
    /// The sensor and its noise.
    #[command(flatten)]
    pub sensor: SensorArgs,
    /// The camera's automatic exposure and its motion.
    #[command(flatten)]
    pub camera: CameraArgs,
}

impl LightArgs {
    /// The named levels; by default L0 to L5, or only L0 for photographs in the dark, which contain real noise.
    pub fn levels(&self, set: SetLight) -> Levels {
        self.levels.clone().unwrap_or_else(|| {
            Levels(match set {
                SetLight::Lit => ladder(LIGHT),
                SetLight::Dark => vec![AxisLevel::L0],
            })
        })
    }
}

/// The camera's automatic exposure and its motion.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Light")]
pub struct CameraArgs {
    /// Automatic exposure of the variant auto: maximum stops of longer exposure (shutter), then of gain; at L0 the
    /// system gain is base-gain (ADU per electron) and the exposure time base-time (seconds); the rest of the drop
    /// stays dark
    ///
    /// Defaults of gain and base-gain follow from the sensor of --noise camera: gain ends at its largest K and starts 4
    /// stops below, or at its smallest K (for the paper's sensor gain=4,base-gain=0.375). The noise is that of the
    /// noise profile physical at this gain, in this sensor.
    #[arg(long, value_name = "KEY=VALUE,…", default_value_t = AutoSettings::default(), add = Decides::Pixels)]
    pub auto: AutoSettings,
    /// Camera rotation during an exposure, in the variants motion and auto: speed in degrees per second, hfov
    /// (horizontal field of view, degrees) for data without camera, angle in degrees (0: sideways, 90: up or down) or
    /// random for each image
    ///
    /// Keys that are not given have their defaults.
    #[arg(long, value_name = "KEY=VALUE,…", default_value_t = Motion::default(), add = Decides::Pixels)]
    pub motion: Motion,
}

/// The sensor and its noise.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Light")]
pub struct SensorArgs {
    /// Seed of all random draws
    #[arg(long, value_name = "N", default_value_t = 0, add = Decides::Pixels)]
    pub seed: u64,
    /// Noise profiles (interpretations of the paper's noise model), as paper,eld; amplify, tone, draws and coupling of
    /// --noise change a single profile, which is then called custom, or by the name of an equal profile
    ///
    /// By default the noise variant has the same signal-to-noise ratio at every level: the levels are one noisy image
    /// at five brightnesses. `--profile physical` loses photons with the light; `--profile all` asks under every
    /// profile of the paper.
    ///
    /// Names of noisy conditions end with the profile, as L3-noise@physical; for paper it is omitted: L3-noise.
    #[arg(
        long,
        value_name = "LIST",
        value_enum,
        value_delimiter = ',',
        default_value = "paper", add = Decides::Trials)]
    pub profile: Vec<Profile>,
    /// Noise that the light ratio r amplifies; default: from --profile (paper: shot-only)
    ///
    /// It is the choice that matters most. At grey 128, L1, K 0.77 and r 200, read, row and quantisation noise add
    /// 0.03, 0 and 0 codes of deviation with shot-only, and 9–19, 1–3 and 1–2 codes with all. shot-only is the default
    /// because it is what the paper says, and because the paper's comparison with real images fits the weaker noise.
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub amplify: Option<Amplify>,
    /// Where a forward tone curve is applied; default: from --profile (paper: none)
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub tone: Option<Tone>,
    /// One noisy RAW image for all levels of a frame (shared), or one for each level (fresh); default: from --profile
    /// (paper: shared)
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub draws: Option<Draws>,
    /// Quantity that the light ratio r depends on; default: from --profile (paper: independent)
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub coupling: Option<Coupling>,
    /// The sensor: sony-a7s2, nikon-d850, canon-eos-5d4, canon-eos-70d, canon-eos-700d, or a TOML file of a calibration
    #[arg(long, value_name = "NAME|FILE", default_value = "sony-a7s2", add = Decides::Pixels)]
    pub camera: String,
    /// Pin the system gain K of the noise variant's sensor, in ADU per electron; default: log-uniform in the camera's
    /// range (0.1–6 for sony-a7s2) for each image
    #[arg(long, value_name = "K", add = Decides::Pixels)]
    pub gain: Option<f64>,
    /// Pin the light ratio r of the sensor noise; not with --noise coupling=photon, where it is 2^EV; default: uniform
    /// in the camera's range for each image (100–300 for the built-in ones)
    #[arg(long, value_name = "R", add = Decides::Pixels)]
    pub ratio: Option<f64>,
    /// Take the middle of every distribution for each image, instead of a draw
    #[arg(long, add = Decides::Pixels)]
    pub fixed: bool,
}

/// Word of `--profile`: a noise profile or all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Profile {
    /// As the DarkQA paper states it
    Paper,
    /// --noise amplify=all
    Eld,
    /// --noise coupling=photon
    Level,
    /// --noise amplify=all,tone=before-ev,coupling=photon
    Physical,
    /// All four, side by side
    All,
}

impl Profile {
    fn readings(self) -> &'static [NoiseProfile] {
        match self {
            Self::Paper => &[NoiseProfile::Paper],
            Self::Eld => &[NoiseProfile::Eld],
            Self::Level => &[NoiseProfile::Level],
            Self::Physical => &[NoiseProfile::Physical],
            Self::All => &NoiseProfile::ALL,
        }
    }
}

/// Degradations that a run applies to its frames.
#[derive(Debug)]
pub struct LightSettings {
    /// Levels in ascending order of degradation, axis by axis, without duplicates.
    pub levels: Vec<AxisLevel>,
    /// Synthetic images that are as dark as each frame's own photograph; empty unless `--levels` includes `match`.
    pub matches: Vec<PairDark>,
    /// Kinds of degradation at all levels of their axis except L0.
    pub variants: KindSet,
    /// Settings of each kind.
    pub kinds: KindSettings,
    /// Number of draws of the noise of each noisy image.
    pub draws: NonZeroU16,
}

/// Settings of each kind of degradation.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct KindSettings {
    /// Settings of the sensor branch.
    pub sensor: SensorSettings,
    /// The automatic exposure.
    pub auto: AutoExposure,
    /// The motion of the camera.
    pub motion: Motion,
}

/// Settings of the sensor branch, which makes the noisy images.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SensorSettings {
    /// Seed of all random draws.
    pub seed: u64,
    /// Noise profiles of the noisy images.
    pub readings: NoiseProfiles,
}

impl LightSettings {
    /// Resolves the flags; reads the camera's file if `--noise camera` names one.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(args: &LightArgs, set: SetLight) -> Result<Self> {
        let levels = args.levels(set);
        let kinds = KindSettings::resolve(&args.sensor, &args.camera)?;
        let light = Self {
            levels: levels.for_kinds(args.variant)?,
            matches: levels.matches(args.variant, &kinds.sensor.readings)?,
            variants: args.variant,
            kinds,
            draws: NonZeroU16::MIN,
        };
        for how in light.degradations().iter().flatten() {
            light.kinds.check(how)?;
        }
        Ok(light)
    }

    /// Refuses the level `match` for data without photographs in the dark; `why` is the reason in the message.
    ///
    /// # Errors
    /// If `--levels` includes `match`.
    pub fn refuse_matches(&self, why: &str) -> Result<()> {
        if self.matches.is_empty() {
            return Ok(());
        }
        let problem = format_args!(
            "match makes each frame as dark as its photograph in the dark, and {why}; name levels as L0-L5"
        );
        Err(Error::usage("--levels", problem))
    }

    /// All degradations of a frame, level by level: each kind with each of its noise profiles; `None` stands for L0. The
    /// further draws of the noise follow, draw by draw, because the levels of a draw share its noise.
    pub fn degradations(&self) -> Vec<Option<Degradation>> {
        let mut all = self.first_draws();
        let noisy: Vec<Degradation> = all.iter().flatten().filter(|how| how.kind().has_noise()).cloned().collect();
        for draw in 1..self.draws.get() {
            all.extend(noisy.iter().map(|how| Some(how.clone().with_draw(draw))));
        }
        all
    }

    /// The degradations in the first draw of the noise.
    fn first_draws(&self) -> Vec<Option<Degradation>> {
        let mut all = Vec::new();
        for level in &self.levels {
            let Some(severity) = level.severity() else {
                all.push(None);
                continue;
            };
            let kinds = self.variants.kinds();
            for kind in kinds.filter(|kind| AxisLevel::new(*kind, severity) == *level) {
                let readings: Vec<Option<ProfileName>> = if kind.has_profiles() {
                    self.kinds.sensor.readings.iter().map(|(name, _)| Some(name.clone())).collect()
                } else {
                    vec![None]
                };
                all.extend(
                    readings.into_iter().filter_map(|reading| Degradation::new(kind, severity, reading).ok()).map(Some),
                );
            }
        }
        all
    }
}

impl KindSettings {
    /// Resolves the flags; reads the camera's file if `--noise camera` names one.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(sensor: &SensorArgs, camera: &CameraArgs) -> Result<Self> {
        let sensor = SensorSettings::resolve(sensor)?;
        Ok(Self { auto: camera.auto.for_camera(&sensor.readings.camera()), sensor, motion: camera.motion })
    }

    /// Resolves a degradation for a frame.
    ///
    /// # Errors
    /// If `--profile` does not include the noise profile, the sensor does not have the gain that automatic exposure
    /// needs, or the image would move too far.
    pub fn apply(&self, how: &Degradation, view: FrameView, key: &NoiseKey) -> Result<AppliedDegradation> {
        let synthesis = self.sensor.readings.for_degradation(Some(how))?;
        AppliedDegradation::new(how, synthesis, &self.auto, &self.motion, view, key)
    }

    /// Checks a degradation as far as possible without its frame.
    ///
    /// # Errors
    /// If the sensor does not have the gain that automatic exposure needs.
    fn check(&self, how: &Degradation) -> Result<()> {
        if how.kind() == Kind::Auto {
            let camera = self.sensor.readings.camera();
            self.auto.shot(how.severity()).synthesis(&camera)?;
        }
        Ok(())
    }
}

impl SensorSettings {
    /// Resolves the flags; reads the camera's file if `--noise camera` names one.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(args: &SensorArgs) -> Result<Self> {
        Ok(Self { seed: args.seed, readings: readings(args)? })
    }
}

/// The profiles of `--profile`; a single one with the choices of the other flags.
fn readings(args: &SensorArgs) -> Result<NoiseProfiles> {
    let mut chosen: Vec<NoiseProfile> = Vec::new();
    for reading in args.profile.iter().flat_map(|profile| profile.readings()) {
        if !chosen.contains(reading) {
            chosen.push(*reading);
        }
    }
    let camera = camera(args)?;
    if let [reading] = chosen[..] {
        return synthesis(args, Synthesis::new(reading, camera)).map(NoiseProfiles::from);
    }
    let choices = [
        ("--noise amplify", args.amplify.is_some()),
        ("--noise tone", args.tone.is_some()),
        ("--noise draws", args.draws.is_some()),
        ("--noise coupling", args.coupling.is_some()),
    ];
    if let Some((flag, _)) = choices.into_iter().find(|(_, is_set)| *is_set) {
        let problem = "cannot be combined with several profiles; name one in --profile";
        return Err(Error::usage(flag, problem));
    }
    if args.ratio.is_some()
        && let Some(reading) =
            chosen.iter().find(|reading| Synthesis::new(**reading, camera.clone()).coupling == Coupling::Photon)
    {
        let name = reading.name();
        let problem = format!("the ratio of {name} is 2^EV; leave out --noise ratio or {name}");
        return Err(Error::usage("--noise ratio", problem));
    }
    Ok(NoiseProfiles::from_profiles(&chosen, &camera))
}

/// A profile's choices, each replaced if its flag is set.
fn synthesis(args: &SensorArgs, reading: Synthesis) -> Result<Synthesis> {
    let synthesis = Synthesis {
        amplify: args.amplify.unwrap_or(reading.amplify),
        tone: args.tone.unwrap_or(reading.tone),
        draws: args.draws.unwrap_or(reading.draws),
        coupling: args.coupling.unwrap_or(reading.coupling),
        camera: reading.camera,
    };
    if synthesis.coupling == Coupling::Photon && args.ratio.is_some() {
        let problem =
            "with --noise coupling=photon, or a profile that has it, the ratio is 2^EV; leave out --noise ratio";
        return Err(Error::usage("--noise ratio", problem));
    }
    Ok(synthesis)
}

fn camera(args: &SensorArgs) -> Result<CameraModel> {
    let mut camera = CameraModel::open(&args.camera)?;
    if args.fixed {
        camera.set_sampling(Sampling::Fixed);
    }
    if let Some(gain) = args.gain {
        camera.pin_gain(gain)?;
    }
    if let Some(ratio) = args.ratio {
        camera.pin_ratio(ratio)?;
    }
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use clap::FromArgMatches as _;

    use super::*;

    /// The sensor settings of these command-line words.
    fn sensor(words: &[&str]) -> Result<SensorSettings> {
        let words = std::iter::once("sensor").chain(words.iter().copied());
        let matches = SensorArgs::augment_args(clap::Command::new("sensor"))
            .try_get_matches_from(words)
            .map_err(|e| Error::usage("words", e))?;
        SensorSettings::resolve(&SensorArgs::from_arg_matches(&matches).unwrap())
    }

    fn profile_names(words: &[&str]) -> Result<Vec<String>> {
        Ok(sensor(words)?.readings.iter().map(|(name, _)| name.to_string()).collect())
    }

    #[test]
    fn profiles_are_a_list_and_flags_change_a_single_one() {
        for (words, expected) in [
            (&["--profile=physical,paper"][..], &["paper", "physical"][..]),
            (&["--profile=all"], &["paper", "eld", "level", "physical"]),
            (&["--profile=physical", "--tone=none"], &["custom"]),
            (&["--profile=physical", "--tone=before-ev"], &["physical"]),
        ] {
            assert_eq!(profile_names(words).unwrap(), expected, "{words:?}");
        }
        for (words, part) in [
            (&["--profile=paper,eld", "--tone=none"][..], "--noise tone: cannot be combined with several profiles"),
            (&["--profile=paper,physical", "--ratio=200"], "--noise ratio: the ratio of physical is 2^EV"),
            (&["--profile=physical", "--ratio=9"], "--noise ratio: with --noise coupling=photon"),
            (&["--profile=papre"], "invalid value 'papre'"),
            (&["--camera=leica"], "--noise camera: \"leica\" is not one of sony-a7s2"),
            (&["--camera=no/such.toml"], "no/such.toml"),
        ] {
            let error = profile_names(words).unwrap_err().to_string();
            assert!(error.contains(part), "{words:?}: {error}");
        }
    }

    #[test]
    fn a_flag_replaces_the_choice_of_the_profile() {
        let readings = sensor(&["--profile=physical", "--tone=none"]).unwrap().readings;
        let synthesis = readings.only().unwrap();
        assert_eq!(synthesis.amplify, Amplify::All);
        assert_eq!(synthesis.tone, Tone::None);
        assert_eq!(synthesis.coupling, Coupling::Photon);
        assert_eq!(sensor(&[]).unwrap().readings, NoiseProfiles::default());
        let nikon = sensor(&["--camera=nikon-d850"]).unwrap().readings;
        assert_ne!(nikon, NoiseProfiles::default());
    }
}
