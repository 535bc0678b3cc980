//! APIs for requests to models ([`Wire`]), and the flag that selects one ([`WireSetting`]).

use clap::ValueEnum;

use darkqa_base::types::flags::flag_words;

/// API for requests to a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wire {
    /// OpenAI's chat completions, which most servers support.
    Chat,
    /// Chat completions as event streams, which some models require.
    ChatStream,
    /// OpenAI's Responses API, which some of its models require.
    Responses,
}

impl Wire {
    /// One API for each request path.
    pub(super) const ALL: [Self; 2] = [Self::Chat, Self::Responses];

    /// Path of requests, relative to the base URL.
    pub(super) fn path(self) -> &'static str {
        match self {
            Self::Chat | Self::ChatStream => "chat/completions",
            Self::Responses => "responses",
        }
    }

    /// Path in the lines of a batch file.
    pub(super) fn batch_url(self) -> &'static str {
        match self {
            Self::Chat | Self::ChatStream => "/v1/chat/completions",
            Self::Responses => "/v1/responses",
        }
    }

    /// API of the lines in a batch: replies in a file are not streamed.
    pub(super) fn in_batch(self) -> Self {
        match self {
            Self::ChatStream => Self::Chat,
            wire => wire,
        }
    }
}

/// Setting of the API.
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
    /// API of the first request.
    pub(super) fn initial(self) -> Wire {
        match self {
            Self::Auto | Self::Chat => Wire::Chat,
            Self::ChatStream => Wire::ChatStream,
            Self::Responses => Wire::Responses,
        }
    }

    /// Name in the content of a model: a streamed reply equals an unstreamed one, and the API that `auto` selects is
    /// not known in advance.
    pub(super) fn content(self) -> &'static str {
        match self {
            Self::Auto | Self::Chat | Self::ChatStream => "chat",
            Self::Responses => "responses",
        }
    }
}

flag_words!(WireSetting);
