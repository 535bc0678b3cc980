//! Command-line flags: parsers of their values, and their effect on a run.

#[cfg(feature = "program")]
mod decides;
#[cfg(feature = "program")]
mod flag;
pub mod key_values;
mod keyed_flag;

#[cfg(feature = "program")]
pub use decides::Decides;
#[cfg(feature = "program")]
pub use flag::{flag_words, positive, read_word, seconds, threads, write_word};
pub use keyed_flag::{KEYED_FLAGS, KeyedFlag, KeyedSetting, flag_spelling, keyed_form, setting_spelling};
