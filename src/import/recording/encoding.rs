//! The serializations of messages that are read: [`Encoding`].

/// The serialization of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Cdr,
    Ros1,
    Protobuf,
    Json,
}

impl Encoding {
    /// The serialization that a channel names; `None` if it is not read.
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
