//! Who was asked, and what was shown: [`AskedModel`], [`Server`].

use crate::types::Condition;
use crate::types::record::{Via, View};

/// A model, and the condition of the images that it was shown.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct AskedModel {
    pub(super) model: String,
    pub(super) view: View,
    /// `None` without images.
    pub(super) condition: Option<Condition>,
}

/// The way in which a reply came.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Server {
    /// The model's name in the server's reply.
    pub(super) model: Option<String>,
    /// The provider that a router passed the request on to.
    pub(super) provider: Option<String>,
    pub(super) via: Via,
}
