//! Supported serializations of messages: [`Encoding`].

/// Serialization of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Cdr,
    Ros1,
    Protobuf,
    Json,
}

impl Encoding {
    /// Serialization with this name in a channel; `None` if it is not supported.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        match name {
            "cdr" => Some(Self::Cdr),
            "ros1" => Some(Self::Ros1),
            "protobuf" => Some(Self::Protobuf),
            "json" => Some(Self::Json),
            _ => None,
        }
    }
}
