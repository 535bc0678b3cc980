//! How dark it gets and how noise is made, as flags say it ([`LightArgs`], [`SensorArgs`]), and as it is used ([`LightSettings`], [`SensorSettings`]).

use std::fs;
use std::path::Path;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::reading::{Amplify, Coupling, Draws, LightReading, Readings, Synthesis, Tone};
use super::{Calibration, CameraModel, Sampling};
use crate::error::{Error, Result};
use crate::types::Decides;
use crate::types::degradation::Kind;
use crate::types::{AxisLevel, Degradation, KindSet, ReadingName, Severity};

/// The levels and kinds of degradation.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Light")]
pub(crate) struct LightArgs {
    /// Levels, as L0-L5 or L0,L3, and exposure drops in EV up to 16, as L0,3.3
    #[arg(long, value_name = "LEVELS", default_value = "L0-L5", add = Decides::Trials)]
    pub levels: Levels,
    /// Which of the paired variants: ev (exposure drop alone), noise (with sensor noise), both
    #[arg(long, value_name = "ev|noise|both", default_value_t = KindSet::BOTH, add = Decides::Trials)]
    pub variant: KindSet,
    /// The sensor and its noise.
    #[command(flatten)]
    pub sensor: SensorArgs,
}

/// The sensor and its noise.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Light")]
pub(crate) struct SensorArgs {
    /// The seed of all random draws
    #[arg(long, value_name = "N", default_value_t = 0, add = Decides::Pixels)]
    pub seed: u64,
    /// Light readings, how the paper's noise is understood, one or several as paper,eld; flags beside one go before its parts and
    /// make it custom
    ///
    /// Conditions with noise carry the reading's name, as L3-noise@physical; that of paper is bare, L3-noise.
    #[arg(
        long,
        value_name = "LIST",
        value_enum,
        value_delimiter = ',',
        default_value = "paper", add = Decides::Trials)]
    pub profile: Vec<Profile>,
    /// What the light ratio r amplifies; default: as --profile says, shot-only in paper
    ///
    /// It is the choice that matters most. At grey 128, L1, K 0.77 and r 200, read, row and quantisation noise add 0.03, 0
    /// and 0 codes of deviation by the wording, and 9–19, 1–3 and 1–2 codes with all. The wording is the default because
    /// it is what the paper says, and because the paper's comparison with real images fits the weaker noise.
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub amplify: Option<Amplify>,
    /// Where a forward tone curve stands; default: as --profile says, none in paper
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub tone: Option<Tone>,
    /// Whether the levels of a frame are developed from one noisy RAW image or each from its own; default: as --profile says, shared
    /// in paper
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub draws: Option<Draws>,
    /// What the light ratio r depends on; default: as --profile says, independent in paper
    #[arg(long, value_enum, add = Decides::Pixels)]
    pub coupling: Option<Coupling>,
    /// The sensor: sony-a7s2, nikon-d850, canon-eos-5d4, canon-eos-70d, canon-eos-700d, or a TOML file of a calibration
    #[arg(long, value_name = "NAME|FILE", default_value = "sony-a7s2", add = Decides::Pixels)]
    pub camera: String,
    /// Pin the system gain K of the sensor, in ADU per electron; default: log-uniform in the camera's range (0.1–6 for
    /// sony-a7s2) for each image
    #[arg(long, value_name = "K", add = Decides::Pixels)]
    pub gain: Option<f64>,
    /// Pin the light ratio r of the sensor noise; default: uniform in 100–300 for each image
    #[arg(long, value_name = "R", add = Decides::Pixels)]
    pub ratio: Option<f64>,
    /// Take the middle of every distribution for each image, instead of a draw
    #[arg(long, add = Decides::Pixels)]
    pub fixed: bool,
}

/// Levels, the lightest first, none twice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Levels(pub Vec<AxisLevel>);

/// Light readings by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Profile {
    /// DarkQA to the letter
    Paper,
    /// --amplify all
    Eld,
    /// --coupling photon
    Level,
    /// --amplify all --tone before-ev --coupling photon
    Physical,
    /// All four, beside each other
    All,
}

impl Profile {
    fn readings(self) -> &'static [LightReading] {
        match self {
            Self::Paper => &[LightReading::Paper],
            Self::Eld => &[LightReading::Eld],
            Self::Level => &[LightReading::Level],
            Self::Physical => &[LightReading::Physical],
            Self::All => &LightReading::ALL,
        }
    }
}

/// What is done to frames.
#[derive(Debug)]
pub(crate) struct LightSettings {
    /// The levels, lightest first, none twice.
    pub levels: Vec<AxisLevel>,
    /// The kinds of degradation at all levels but L0.
    pub variants: KindSet,
    /// What takes the noisy images.
    pub sensor: SensorSettings,
}

/// What takes the noisy images.
#[derive(Debug)]
pub(crate) struct SensorSettings {
    /// The seed of all random draws.
    pub seed: u64,
    /// The light readings of the sensor branch.
    pub readings: Readings,
}

impl LightSettings {
    /// Reads the camera's file, if one is named.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub(crate) fn resolve(args: &LightArgs) -> Result<Self> {
        Ok(Self {
            levels: args.levels.0.clone(),
            variants: args.variant,
            sensor: SensorSettings::resolve(&args.sensor)?,
        })
    }

    /// What is done to each frame, level by level: each kind, in each light reading if it has readings; `None` is L0.
    pub(crate) fn degradations(&self) -> Vec<Option<Degradation>> {
        let mut all = Vec::new();
        for level in &self.levels {
            let Some(severity) = level.severity() else {
                all.push(None);
                continue;
            };
            let kinds = self.variants.kinds();
            for kind in kinds.filter(|kind| AxisLevel::new(*kind, severity) == *level) {
                let readings: Vec<Option<ReadingName>> = if kind.has_readings() {
                    let readings = self.sensor.readings.iter();
                    readings.map(|(name, _)| Some(name.clone())).collect()
                } else {
                    vec![None]
                };
                let made = readings
                    .into_iter()
                    .filter_map(|reading| Degradation::new(kind, severity, reading).ok());
                all.extend(made.map(Some));
            }
        }
        all
    }
}

impl SensorSettings {
    /// Reads the camera's file, if one is named.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub(crate) fn resolve(args: &SensorArgs) -> Result<Self> {
        Ok(Self {
            seed: args.seed,
            readings: readings(args)?,
        })
    }
}

/// The readings of `--profile`; one alone with the parts that stand beside it.
fn readings(args: &SensorArgs) -> Result<Readings> {
    let profiles = args.profile.iter();
    let mut chosen: Vec<LightReading> = Vec::new();
    for reading in profiles.flat_map(|profile| profile.readings()) {
        if !chosen.contains(reading) {
            chosen.push(*reading);
        }
    }
    let camera = camera(args)?;
    if let [reading] = chosen[..] {
        return synthesis(args, Synthesis::of(reading, camera)).map(Readings::from);
    }
    let parts = [
        ("--amplify", args.amplify.is_some()),
        ("--tone", args.tone.is_some()),
        ("--draws", args.draws.is_some()),
        ("--coupling", args.coupling.is_some()),
    ];
    if let Some((flag, _)) = parts.into_iter().find(|(_, said)| *said) {
        let problem = "beside several profiles it would make them the same; name one profile";
        return Err(Error::usage(flag, problem));
    }
    let by_light =
        |of: &&LightReading| Synthesis::of(**of, camera.clone()).coupling == Coupling::Photon;
    if args.ratio.is_some()
        && let Some(reading) = chosen.iter().find(by_light)
    {
        let name = reading.name();
        let problem = format!("the ratio of {name} is 2^EV; leave out one of the two");
        return Err(Error::usage("--ratio", problem));
    }
    Ok(Readings::named(&chosen, &camera))
}

/// A reading with the parts that are said beside it.
fn synthesis(args: &SensorArgs, of: Synthesis) -> Result<Synthesis> {
    let synthesis = Synthesis {
        amplify: args.amplify.unwrap_or(of.amplify),
        tone: args.tone.unwrap_or(of.tone),
        draws: args.draws.unwrap_or(of.draws),
        coupling: args.coupling.unwrap_or(of.coupling),
        camera: of.camera,
    };
    if synthesis.coupling == Coupling::Photon && args.ratio.is_some() {
        let problem = "with --coupling photon the ratio is 2^EV; leave out one of the two";
        return Err(Error::usage("--ratio", problem));
    }
    Ok(synthesis)
}

fn camera(args: &SensorArgs) -> Result<CameraModel> {
    let path = Path::new(&args.camera);
    let mut camera = if is_file(path) {
        let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
        CameraModel::new(Calibration::parse(&text, path.display())?)
    } else {
        CameraModel::preset(&args.camera)?
    };
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

/// Whether a file is meant: what ends as one, or lies in a folder, is no name of a camera.
fn is_file(path: &Path) -> bool {
    path.extension().is_some() || path.components().count() > 1
}

/// The most levels of a run.
const MOST_LEVELS: usize = 200;

/// The kind whose names levels of light have.
const LIGHT: Kind = Kind::ALL[0];

impl FromStr for Levels {
    type Err = String;

    /// Reads `L0-L5`, `L0,L3` or numbers of EV, in any order, none twice.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut levels = Vec::new();
        for part in text.split(',').map(str::trim) {
            let Some((first, last)) = part.split_once('-') else {
                levels.push(level(part)?);
                continue;
            };
            let (first, last) = (level(first.trim())?, level(last.trim())?);
            if !part.to_ascii_uppercase().starts_with('L') {
                return Err(format!(
                    "{part:?} is no range; levels are L0-L5, numbers of EV stand alone, as {first},{last}"
                ));
            }
            if first > last {
                return Err(format!("{part:?} runs backwards; {last}-{first} is meant?"));
            }
            let named = LIGHT.ladder().iter();
            let named = named.map(|severity| AxisLevel::new(LIGHT, *severity));
            let all = std::iter::once(AxisLevel::L0).chain(named);
            levels.extend(all.filter(|level| (first..=last).contains(level)));
        }
        levels.sort_unstable();
        levels.dedup();
        if levels.len() > MOST_LEVELS {
            return Err(format!(
                "{} levels; {MOST_LEVELS} is the most",
                levels.len()
            ));
        }
        Ok(Self(levels))
    }
}

/// One level: a name, or a number of EV.
fn level(text: &str) -> Result<AxisLevel, String> {
    let number = text.starts_with(|c: char| c.is_ascii_digit());
    if text.eq_ignore_ascii_case("L0") || number && text.parse::<f64>() == Ok(0.0) {
        return Ok(AxisLevel::L0);
    }
    let severity = if number {
        text.parse::<Severity>()
    } else {
        LIGHT.severity(text)
    };
    let severity = severity.map_err(|e| e.to_string())?;
    if severity > LIGHT.largest() {
        return Err(format!("{text} EV is above {}", LIGHT.largest()));
    }
    Ok(AxisLevel::new(LIGHT, severity))
}

#[cfg(test)]
mod tests {
    use clap::FromArgMatches as _;

    use super::*;

    #[test]
    fn levels_are_read_in_any_form() {
        let names = |text: &str| -> Vec<String> {
            let Levels(levels) = text.parse().unwrap();
            levels.iter().map(ToString::to_string).collect()
        };
        assert_eq!(names("L0-L5"), ["L0", "L1", "L2", "L3", "L4", "L5"]);
        assert_eq!(names("l3, L0,L3"), ["L0", "L3"]);
        assert_eq!(
            names("L4-L5,3.30,6,0,E11"),
            ["L0", "E3.3", "L3", "L4", "L5", "E11"]
        );
        for (wrong, says) in [
            ("L6", "\"L6\" is none of"),
            ("", "\"\" is none of"),
            ("L3-L1", "runs backwards"),
            ("0-5", "is no range"),
            ("3.333", "two decimals"),
            ("16.5", "above 16"),
            ("-2", "none of"),
        ] {
            let error = wrong.parse::<Levels>().unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }

    /// The sensor that these words say.
    fn sensor(words: &[&str]) -> Result<SensorSettings> {
        let command = SensorArgs::augment_args(clap::Command::new("sensor"));
        let words = std::iter::once("sensor").chain(words.iter().copied());
        let matches = command.try_get_matches_from(words);
        let matches = matches.map_err(|e| Error::usage("words", e))?;
        SensorSettings::resolve(&SensorArgs::from_arg_matches(&matches).unwrap())
    }

    #[test]
    fn profiles_are_a_list_and_parts_stand_beside_one() {
        let names = |words: &[&str]| -> Result<Vec<String>> {
            let readings = sensor(words)?.readings;
            Ok(readings.iter().map(|(name, _)| name.to_string()).collect())
        };
        for (words, expected) in [
            (
                &["--profile=physical,paper"][..],
                &["paper", "physical"][..],
            ),
            (&["--profile=all"], &["paper", "eld", "level", "physical"]),
            (&["--profile=physical", "--tone=none"], &["custom"]),
            (&["--profile=physical", "--tone=before-ev"], &["physical"]),
        ] {
            assert_eq!(names(words).unwrap(), expected, "{words:?}");
        }
        for (words, says) in [
            (
                &["--profile=paper,eld", "--tone=none"][..],
                "--tone: beside several profiles",
            ),
            (
                &["--profile=paper,physical", "--ratio=200"],
                "--ratio: the ratio of physical is 2^EV",
            ),
            (
                &["--profile=physical", "--ratio=9"],
                "--ratio: with --coupling photon",
            ),
            (&["--profile=papre"], "invalid value 'papre'"),
            (
                &["--camera=leica"],
                "--camera: \"leica\" is none of sony-a7s2",
            ),
            (&["--camera=no/such.toml"], "no/such.toml"),
        ] {
            let error = names(words).unwrap_err().to_string();
            assert!(error.contains(says), "{words:?}: {error}");
        }
    }

    #[test]
    fn a_flag_goes_before_its_part_of_the_profile() {
        let readings = sensor(&["--profile=physical", "--tone=none"])
            .unwrap()
            .readings;
        let synthesis = readings.only().unwrap();
        assert_eq!(synthesis.amplify, Amplify::All);
        assert_eq!(synthesis.tone, Tone::None);
        assert_eq!(synthesis.coupling, Coupling::Photon);
        assert_eq!(sensor(&[]).unwrap().readings, Readings::default());
        let nikon = sensor(&["--camera=nikon-d850"]).unwrap().readings;
        assert_ne!(nikon, Readings::default());
    }
}
