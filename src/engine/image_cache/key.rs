//! Key of an entry in the store: [`Key`].

use serde::Serialize;
use serde_json::Value;

use crate::error::Result;
use crate::types::Digest;

/// Domain and version of the digests. The version is raised when the same recipe gives another image, or when entries
/// get other facts. Entries of other versions are not found any more, and are evicted when they are old.
const DOMAIN: &str = "darkqa.image-store/1";

/// Digest of a recipe (everything that determines the file of an image), with the recipe as canonical JSON.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Key {
    digest: Digest,
    recipe: Value,
}

impl Key {
    /// The key of a recipe, which must contain everything that determines the bytes of an image, and nothing else.
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
