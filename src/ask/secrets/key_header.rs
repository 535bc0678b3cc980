//! The header that carries a key: [`KeyHeader`].

use clap::ValueEnum;

use crate::types::flags::flag_words;

/// The header that carries a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum KeyHeader {
    /// `api-key` at Azure, `Authorization` elsewhere.
    #[default]
    Auto,
    /// `Authorization: Bearer …`; at Azure for tokens of Microsoft Entra.
    Bearer,
    /// `api-key: …`, as Azure and gateways before it require it.
    ApiKey,
}

flag_words!(KeyHeader);
