//! The flags for data: [`DataArgs`], [`SelectionArgs`], [`PixelLimit`].

use std::convert::Infallible;
use std::fmt;
use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;

use super::DataPlace;
use super::picture::MOST_PIXELS;
use crate::rooms::Rooms;
use crate::types::{Decides, Family};

/// The flag for the place of the data.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct DataArgs {
    /// A folder of frames, a ready-made set (.tsv, .jsonl), or built-in rooms, rooms:frames=N,seed=N,size=WIDTHxHEIGHT
    #[arg(long, value_name = "DIR|FILE|rooms:…", value_parser = place, default_value_t, add = Decides::Reply)]
    pub data: DataPlace,
}

/// The flags that select questions.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct SelectionArgs {
    /// The questions about a folder of frames; default: questions.jsonl in it, else made by rule from its maps
    #[arg(long, value_name = "FILE", add = Decides::Reply)]
    pub questions: Option<PathBuf>,
    /// The rulebook that makes the questions of data that have none, and that the observer answers by; default: the one built in
    /// (src/questions/rules.toml)
    #[arg(long, value_name = "FILE", add = Decides::Reply)]
    pub rules: Option<PathBuf>,
    /// Only the first N questions; default: all
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub limit: Option<NonZeroUsize>,
    /// Only these question families (or categories of a ready-made set), separated by commas; default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = family, add = Decides::Trials)]
    pub families: Vec<Family>,
}

/// The flag for the maximum size of an image.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct PixelLimit {
    /// The maximum number of pixels of an image; a larger one is refused before it is decoded
    #[arg(long, value_name = "N", default_value_t = NonZeroU64::new(MOST_PIXELS).unwrap_or(NonZeroU64::MIN), add = Decides::Nothing)]
    pub max_pixels: NonZeroU64,
}

/// The place in a text: a path, `rooms` or `rooms:frames=48,seed=7,size=1280x720`. A file or folder named `rooms` is a path.
pub(crate) fn place(text: &str) -> Result<DataPlace, String> {
    let path = PathBuf::from(text);
    match text.strip_prefix("rooms:") {
        Some(rooms) => rooms.parse().map(DataPlace::Rooms),
        None if text == "rooms" && !path.exists() => Ok(DataPlace::Rooms(Rooms::default())),
        None => Ok(DataPlace::Path(path)),
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the form of a value parser")]
fn family(name: &str) -> Result<Family, Infallible> {
    Ok(Family::from(name.trim()))
}

impl Default for DataPlace {
    fn default() -> Self {
        Self::Rooms(Rooms::default())
    }
}

impl fmt::Display for DataPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rooms(rooms) => write!(f, "rooms:{rooms}"),
            Self::Path(path) => path.display().fmt(f),
        }
    }
}
