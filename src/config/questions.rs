//! What `questions` is told, checked once: [`Questions`].

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::{fs, str::FromStr};

use super::layers::Shared;
use super::{Show, most_pixels, parsed, threads};
use crate::cli::QuestionsArgs;
use crate::error::{Error, Result};
use crate::questions::balance::Balanced;
use crate::questions::colors::Palette;
use crate::questions::room::RoomSource;
use crate::questions::rules::Rules;
use crate::types::Family;

/// A whole generation of questions.
#[derive(Debug)]
pub struct Questions {
    /// The frames.
    pub data: PathBuf,
    /// The file that the questions go to.
    pub out: PathBuf,
    /// The rulebook.
    pub rules: Rules,
    /// The names of colours.
    pub palette: Palette,
    /// The families that are made.
    pub families: BTreeSet<Family>,
    /// How the answers are evened out.
    pub balance: Balanced,
    /// Who says what room it is.
    pub room: RoomSource,
    /// What is done about numbers that stand for nothing known.
    pub strangers: Strangers,
    /// Where it is told what became of every candidate.
    pub candidates: Option<PathBuf>,
    /// Where the statistics go.
    pub stats: Option<PathBuf>,
    /// The page for a human check.
    pub review: Option<PathBuf>,
    /// What people said on such pages.
    pub verdicts: Vec<PathBuf>,
    /// What standard output gets.
    pub show: Show,
    /// Threads; `None` for all cores.
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have.
    pub most_pixels: u64,
}

/// What is done about numbers of a semantic map that `classes.json` does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Strangers {
    /// They are unlabelled pixels, and counted.
    Counted,
    /// Their frame is refused.
    Refused,
}

impl Questions {
    /// Checks what was said by flags, environment and `--config` file; of the last two, what concerns threads and pixels.
    /// The rulebook and the table of colours are read here.
    ///
    /// # Errors
    /// With the flag or the file that cannot be used.
    pub fn resolve(said: QuestionsArgs) -> Result<Self> {
        let shared = Shared {
            threads: said.threads,
            max_pixels: said.max_pixels,
            config: said.config,
            ..Shared::default()
        }
        .merge()?;
        if said.out.file_stem().is_none() || said.out.is_dir() {
            let problem = format_args!(
                "{}: a file expected, as questions.jsonl",
                said.out.display()
            );
            return Err(Error::usage("--out", problem));
        }
        Ok(Self {
            data: said.data,
            out: said.out,
            rules: match read(said.rules.as_deref(), Rules::parse)? {
                Some(rules) => rules,
                None => Rules::built_in()?,
            },
            palette: match read(said.colors.as_deref(), Palette::parse)? {
                Some(palette) => palette,
                None => Palette::built_in()?,
            },
            families: families(said.families.as_deref())?,
            balance: parsed("--balance", said.balance.as_deref())?.unwrap_or_default(),
            room: parsed("--room", said.room.as_deref())?.unwrap_or_default(),
            strangers: if said.strict {
                Strangers::Refused
            } else {
                Strangers::Counted
            },
            candidates: said.candidates,
            stats: said.stats,
            review: said.review,
            verdicts: said.verdicts,
            show: if said.json { Show::Json } else { Show::Table },
            threads: threads(shared.threads)?,
            most_pixels: most_pixels(shared.max_pixels),
        })
    }
}

fn read<T>(path: Option<&Path>, parse: fn(&str) -> Result<T>) -> Result<Option<T>> {
    let Some(path) = path else {
        return Ok(None);
    };
    let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
    parse(&text)
        .map(Some)
        .map_err(|e| e.at(path.display().to_string()))
}

fn families(list: Option<&str>) -> Result<BTreeSet<Family>> {
    let Some(list) = list else {
        return Ok(Family::PAPER.into_iter().collect());
    };
    let family = |name: &str| match Family::from(name.trim()) {
        Family::Other(name) => Err(Error::usage(
            "--families",
            format_args!("{name:?} is none of room_type, affordance, presence, color, closest"),
        )),
        family => Ok(family),
    };
    list.split(',').map(family).collect()
}

impl FromStr for RoomSource {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "signature" => Ok(Self::Signature),
            "stated" => Ok(Self::Stated),
            _ => Err(Error::usage(
                "room",
                format_args!("{text:?} is none of signature, stated"),
            )),
        }
    }
}
