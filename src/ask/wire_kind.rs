//! The APIs through which a model is asked ([`Wire`]), and the flag that chooses one ([`WireSetting`]).

use clap::ValueEnum;

use crate::types::flags::flag_words;

/// An API through which a model is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wire {
    /// OpenAI's chat completions, which most servers support.
    Chat,
    /// Chat completions whose replies come as event streams: some models answer in no other way.
    ChatStream,
    /// OpenAI's Responses API, through which alone some of its models are asked.
    Responses,
}

impl Wire {
    /// One wire for each path of requests.
    pub(super) const ALL: [Self; 2] = [Self::Chat, Self::Responses];

    /// The path of requests, below the base URL.
    pub(super) fn path(self) -> &'static str {
        match self {
            Self::Chat | Self::ChatStream => "chat/completions",
            Self::Responses => "responses",
        }
    }

    /// The path in a line of a Batch API's file.
    pub(super) fn batch_url(self) -> &'static str {
        match self {
            Self::Chat | Self::ChatStream => "/v1/chat/completions",
            Self::Responses => "/v1/responses",
        }
    }

    /// The wire of a batch's lines: replies in a file are whole.
    pub(super) fn in_batch(self) -> Self {
        match self {
            Self::ChatStream => Self::Chat,
            wire => wire,
        }
    }
}

/// The setting of the API.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum WireSetting {
    /// Chat completions; streamed, or the Responses API, where the server answers that it takes nothing else
    #[default]
    Auto,
    /// Chat completions in one piece
    Chat,
    /// Chat completions as an event stream
    ChatStream,
    /// The Responses API
    Responses,
}

impl WireSetting {
    /// The wire of the first request.
    pub(super) fn first(self) -> Wire {
        match self {
            Self::Auto | Self::Chat => Wire::Chat,
            Self::ChatStream => Wire::ChatStream,
            Self::Responses => Wire::Responses,
        }
    }

    /// The name in the content that decides a reply: a streamed reply is the same as a whole one, and what `auto` finds out is not
    /// known before.
    pub(super) fn content(self) -> &'static str {
        match self {
            Self::Auto | Self::Chat | Self::ChatStream => "chat",
            Self::Responses => "responses",
        }
    }
}

flag_words!(WireSetting);
