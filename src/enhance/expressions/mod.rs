//! Pixelwise arithmetic expressions of sidecars.

mod channel_slice;
mod expression;
mod parser;
mod term;

pub(super) use channel_slice::ChannelSlice;
pub(super) use expression::Expression;
pub(super) use term::Sample;
