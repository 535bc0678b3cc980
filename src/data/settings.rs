//! Flags for data: [`DataArgs`], [`SelectionArgs`], [`BankArgs`], [`PixelLimit`], [`DecodeArgs`], [`FolderArgs`].

use std::convert::Infallible;
use std::fmt;
use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;

use super::bank::BankSource;
use super::ready_made::{is_known_set, known_sets};
use super::{DataSource, RootArgs, SetArgs};
use darkqa_base::types::{Decides, Family, shell_word};
use darkqa_pictures::decode_rule::{ColourRule, DecodeRule, MAX_PIXELS, Transfer};
use darkqa_rooms::Rooms;

/// Flags for the place of the data and the reading of ready-made sets.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Data")]
pub struct DataArgs {
    /// A folder of frames, a ready-made set (.parquet, .tsv, .csv, .json, .jsonl, a folder of them; a well-known one by
    /// its name, as mmbench:FILE), or built-in rooms, rooms:frames=N,seed=N,size=WIDTHxHEIGHT,light=linear; repeatable
    /// for the files of one set
    #[arg(long, value_name = "DIR|FILE|rooms:…", value_parser = parse_data_source, default_values_t = [DataSource::default()], add = Decides::Reply)]
    pub data: Vec<DataSource>,
    /// Options for reading a ready-made set.
    #[command(flatten)]
    pub set: SetArgs,
}

impl DataArgs {
    /// Place of the data, from all `--data` flags together.
    pub fn place(&self) -> DataSource {
        match &*self.data {
            [] => DataSource::default(),
            [place] => place.clone(),
            places => DataSource::Files(
                places
                    .iter()
                    .map(|place| match place {
                        DataSource::Path(path) => path.clone(),
                        other => PathBuf::from(other.to_string()),
                    })
                    .collect(),
            ),
        }
    }
}

/// Flags that select questions.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Data")]
pub struct SelectionArgs {
    /// Questions file for a folder of frames; default: its questions.jsonl, else made by rule from its maps
    #[arg(long, value_name = "FILE", add = Decides::Reply)]
    pub questions: Option<PathBuf>,
    /// Rulebook that makes questions for data without any, and by which the observer answers; default: built in
    /// (src/questions/rules.toml)
    #[arg(long, value_name = "FILE", add = Decides::Reply)]
    pub rules: Option<PathBuf>,
    /// Only the first N questions; default: all
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub limit: Option<NonZeroUsize>,
    /// Only these question families (or categories of a ready-made set), separated by commas; default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_family, add = Decides::Trials)]
    pub families: Vec<Family>,
}

/// Flags that ask the same questions about every image.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Data")]
pub struct BankArgs {
    /// Ask questions without known answers about every image of --data; the report gives each model's agreement with
    /// its own answer in the light; home or home:uncertain (built in), or a JSONL file of id, question, choices;
    /// default: none
    #[arg(long, value_name = "home|home:uncertain|FILE", conflicts_with_all = ["questions", "rules"], add = Decides::Reply)]
    pub ask: Option<BankSource>,
    /// Ask only N of the questions about each image, drawn by its name; default: all
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub ask_per_image: Option<NonZeroUsize>,
}

/// Flag for the maximum size of an image.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Data")]
pub struct PixelLimit {
    /// The maximum number of pixels of an image; a larger one is refused before it is decoded
    #[arg(long, value_name = "N", default_value_t = NonZeroU64::new(MAX_PIXELS).unwrap_or(NonZeroU64::MIN), add = Decides::Nothing)]
    pub max_pixels: NonZeroU64,
}

/// Flags for the decoding of images.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Data")]
pub struct DecodeArgs {
    /// The maximum size of an image.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// Treatment of images whose file states other colours than sRGB (an ICC profile, cICP, gAMA); clip also converts
    /// HDR, where light above 203 cd/m² becomes white
    #[arg(long, value_enum, default_value_t, add = Decides::Pixels)]
    pub colour: ColourRule,
    /// Encoding of the samples of 16-bit PNG and TIFF images; OpenEXR images are always linear light, 8-bit images
    /// never
    #[arg(long, value_enum, default_value_t, add = Decides::Pixels)]
    pub transfer: Transfer,
    /// Scale linear light by this many EV before everything else, -20 to 20; default: not at all
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = parse_exposure, add = Decides::Pixels)]
    pub exposure: Option<f32>,
}

/// Flags for reading folders of images.
#[derive(Debug, Clone, Args)]
pub struct FolderArgs {
    /// The decoding of images.
    #[command(flatten)]
    pub decode: DecodeArgs,
    /// Further folders in which images may lie.
    #[command(flatten)]
    pub root: RootArgs,
}

/// Parses the value of `--exposure`, in EV.
fn parse_exposure(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|ev| (-20.0..=20.0).contains(ev))
        .ok_or_else(|| "a number from -20 to 20 expected".to_owned())
}

impl DecodeArgs {
    /// Rule by which images are decoded.
    pub fn rule(self) -> DecodeRule {
        DecodeRule {
            max_pixels: self.limit.max_pixels.get(),
            colour: self.colour,
            transfer: self.transfer,
            exposure_ev: self.exposure,
        }
    }
}

/// Parses the value of `--data`: a path, `rooms`, `rooms:frames=48,seed=7,size=1280x720`, or a well-known set with its
/// path, such as `mmvp:FILE`. An existing file or folder with the same name takes precedence, except for `rooms:…`.
pub fn parse_data_source(text: &str) -> Result<DataSource, String> {
    let path = PathBuf::from(text);
    match text.strip_prefix("rooms:") {
        Some(rooms) => rooms.parse().map(DataSource::Rooms),
        None if text == "rooms" && !path.exists() => Ok(DataSource::Rooms(Rooms::default())),
        None if path.exists() => Ok(DataSource::Path(path)),
        None => match text.split_once(':') {
            Some((name, place)) if is_known_set(name) => {
                Ok(DataSource::Known { name: name.to_owned(), path: PathBuf::from(place) })
            }
            // A single letter before the colon is a drive on Windows.
            Some((name, place)) if name.len() > 1 && PathBuf::from(place).exists() => Err(format!(
                "no rules for a set named {name:?}; there are {}; other sets are read by the names of their columns: --data {}",
                known_sets().join(", "),
                shell_word(place)
            )),
            _ => Ok(DataSource::Path(path)),
        },
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the form of a value parser")]
fn parse_family(name: &str) -> Result<Family, Infallible> {
    Ok(Family::from(name.trim()))
}

impl Default for DataSource {
    fn default() -> Self {
        Self::Rooms(Rooms::default())
    }
}

impl fmt::Display for DataSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rooms(rooms) => write!(f, "rooms:{rooms}"),
            Self::Path(path) => path.display().fmt(f),
            Self::Files(paths) => {
                let paths: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
                f.write_str(&paths.join(", "))
            }
            Self::Known { name, path } => write!(f, "{name}:{}", path.display()),
        }
    }
}
