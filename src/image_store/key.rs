//! The key of an image in the store: [`Key`].

use serde::Serialize;
use serde_json::Value;

use crate::error::Result;
use crate::types::Digest;

/// Name and version of what keys are digests of. The version is raised when the same recipe gives another image, or when an entry has
/// other facts; entries of other versions are not found any more, and leave by their age.
const DOMAIN: &str = "darkqa.image-store/1";

/// Digest of all that decides the file of an image, with the canonical JSON that it is the digest of.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Key {
    digest: Digest,
    recipe: Value,
}

impl Key {
    /// The key of a recipe: all that decides the bytes of an image, and nothing else.
    ///
    /// # Errors
    /// If a number of the recipe is infinite or NaN.
    pub(crate) fn from_recipe(recipe: &impl Serialize) -> Result<Self> {
        let (digest, recipe) = Digest::canonical_value(DOMAIN, recipe)?;
        Ok(Self { digest, recipe })
    }

    pub(crate) fn digest(&self) -> &Digest {
        &self.digest
    }

    /// The recipe as canonical JSON.
    pub(super) fn recipe(&self) -> &Value {
        &self.recipe
    }
}
