//! Parsers for flags whose values are numbers or words, and the macro `flag_words`.
//!
//! Errors name the expected value; the command line adds the name of the flag.
//!
//! [`Decides`]: which part of a run a flag decides.

use std::fmt;
use std::num::NonZeroUsize;
use std::time::Duration;

use clap::builder::ArgExt;
use clap::{Arg, ValueEnum};

use crate::error::{self, Error};

/// Implements `Display` for enums: the word of the value on the command line.
#[macro_export]
macro_rules! flag_words {
    ($($type:ty),+ $(,)?) => {
        $(impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                $crate::types::flags::write_word(self, f)
            }
        })+
    };
}

pub use flag_words;

/// The maximum of `--threads`; chosen: more than any machine needs, and few enough not to exhaust one.
const MAX_THREADS: usize = 1024;

/// Reads a finite number above 0.
///
/// # Errors
/// If the text is anything else; the error names the expected value.
pub fn positive(text: &str) -> Result<f64, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite() && *value > 0.0)
        .ok_or_else(|| "a number above 0 expected".to_owned())
}

/// Reads a duration above 0, in seconds.
///
/// # Errors
/// If the text is anything else; the error names the expected value.
pub fn seconds(text: &str) -> Result<Duration, String> {
    positive(text)
        .ok()
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .filter(|duration| !duration.is_zero())
        .ok_or_else(|| "a number of seconds above 0 expected".to_owned())
}

/// Reads a duration above 0, such as `50ms`, `0.05s` or `50` (milliseconds); returns milliseconds.
///
/// # Errors
/// If the text is anything else; the error names the expected value.
pub fn milliseconds(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let (number, factor) = match text.strip_suffix("ms") {
        Some(number) => (number, 1.0),
        None => text.strip_suffix('s').map_or((text, 1.0), |number| (number, 1e3)),
    };
    positive(number).map(|value| value * factor).map_err(|_| "a time such as 50ms or 0.05s expected".to_owned())
}

/// Reads a number of threads.
///
/// # Errors
/// If the text is anything else; the error names the expected value.
pub fn threads(text: &str) -> Result<NonZeroUsize, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|threads: &NonZeroUsize| threads.get() <= MAX_THREADS)
        .ok_or_else(|| format!("a number from 1 to {MAX_THREADS} expected"))
}

/// Writes an enum's value as its word on the command line.
pub fn write_word(value: &impl ValueEnum, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    value.to_possible_value().map_or(Ok(()), |value| f.pad(value.get_name()))
}

/// Reads an enum's value from its word, as a manifest stores it.
///
/// # Errors
/// If no value of the enum has this word.
pub fn read_word<T: ValueEnum>(word: &str) -> error::Result<T> {
    T::from_str(word, false).map_err(|_| {
        let words: Vec<String> = T::value_variants()
            .iter()
            .filter_map(|value| Some(value.to_possible_value()?.get_name().to_owned()))
            .collect();
        let problem = format_args!("it is not one of {}", words.join(", "));
        Error::data(format_args!("{word:?}"), problem)
    })
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_outside_the_limits_are_refused() {
        assert_eq!(positive("0.5"), Ok(0.5));
        assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
        assert_eq!(threads("1024").map(NonZeroUsize::get), Ok(1024));
        for wrong in ["0", "-2", "NaN", "inf", "", "x"] {
            assert!(positive(wrong).is_err(), "{wrong}");
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
        assert!(seconds("1e-12").is_err() && seconds("1e300").is_err());
        assert!(threads("0").is_err() && threads("1025").is_err());
    }
}
