//! Warnings about the model names in replies: [`ServedNames`].

use crate::engine::models::ModelUnderTest;
use crate::types::Reply;
use crate::types::text::model_names::{is_other_model, is_same_name};

/// The name in the replies of one model.
#[derive(Debug, Clone, Default)]
pub(super) struct ServedNames {
    /// Name in the first reply that has one.
    first: Option<String>,
    has_warned: bool,
}

impl ServedNames {
    /// Adds a reply. Warns if the first name is evidently that of another model, and once if a later name differs from
    /// the first.
    pub(super) fn add(&mut self, model: &ModelUnderTest, reply: &Reply) {
        let Some(served) = reply.served_model.as_deref().filter(|name| !name.is_empty()) else {
            return;
        };
        let name = &model.name;
        match &self.first {
            None => {
                if is_other_model(model.model.name(), served) {
                    tracing::warn!(
                        "{name}: its replies name another model, {served}: check which model the server has loaded, or serves under this \
                         name"
                    );
                }
                self.first = Some(served.to_owned());
            }
            Some(first) if !self.has_warned && !is_same_name(first, served) => {
                self.has_warned = true;
                tracing::warn!(
                    "{name}: its replies name several models, first {first}, now {served}: replies of two models are no comparison of \
                     light; the report counts them for each level (a --model with a date or version, or no fallback, keeps one)"
                );
            }
            Some(_) => {}
        }
    }
}
