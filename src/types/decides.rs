//! What a flag of the program decides: [`Decides`].

use clap::Arg;
use clap::builder::ArgExt;

/// What a flag decides. Each flag has its class beside its definition: `#[arg(long, add = Decides::Pixels)]`. The help, the manual
/// and the list of all flags show it, and `tests/identity.rs` holds runs to it: a flag that decides something changes the keys of
/// trials, the columns or the identity of a run; a flag that decides nothing changes none of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Decides {
    /// Which trials there are: questions, models, conditions.
    Trials,
    /// What a model is sent besides the pixels, and who answers.
    Reply,
    /// Images and maps.
    Pixels,
    /// None of these: speed, money, keys, and where the output goes.
    Nothing,
}

impl ArgExt for Decides {}

impl Decides {
    /// The class of a flag; `None` for those that clap adds.
    pub(crate) fn of(arg: &Arg) -> Option<Self> {
        arg.get::<Self>().copied()
    }

    /// The word in help and lists.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Trials => "trials",
            Self::Reply => "reply",
            Self::Pixels => "pixels",
            Self::Nothing => "nothing",
        }
    }
}
