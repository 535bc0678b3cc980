//! [`Decides`]: which part of a run a flag decides.

use clap::Arg;
use clap::builder::ArgExt;

/// The part of a run that a flag decides. Each flag states its class in its definition: `#[arg(long, add =
/// Decides::Pixels)]`. The help, the manual and the list of all flags show the class. `tests/program/runs/identity.rs`
/// checks it: a flag that decides something changes the keys of trials, the columns or the identity of a run; a flag
/// that decides nothing changes none of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decides {
    /// The set of trials: questions, models, conditions.
    Trials,
    /// The request to a model besides the pixels, and the model that answers.
    Reply,
    /// The pixels of images and maps.
    Pixels,
    /// None of these: speed, cost, keys, and the place of the output.
    Nothing,
}

impl ArgExt for Decides {}

impl Decides {
    /// The class of a flag; `None` for flags that clap adds.
    pub fn from_arg(arg: &Arg) -> Option<Self> {
        arg.get::<Self>().copied()
    }

    /// The word for the class in help and lists.
    pub fn word(self) -> &'static str {
        match self {
            Self::Trials => "trials",
            Self::Reply => "reply",
            Self::Pixels => "pixels",
            Self::Nothing => "nothing",
        }
    }
}
