//! The Batch API of a vendor, from the table of vendors: [`VendorBatch`].

use std::num::{NonZeroU64, NonZeroUsize};

use serde::Deserialize;

/// Batch API of a vendor; `None` in a field means the value of OpenAI.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct VendorBatch {
    #[serde(default)]
    pub(crate) form: BatchForm,
    /// Purpose under which files are uploaded.
    pub(crate) purpose: Option<String>,
    /// Maximum size of a file, in MB.
    pub(crate) file_size: Option<NonZeroU64>,
    /// Maximum number of requests in a file.
    pub(crate) requests: Option<NonZeroUsize>,
    /// Path of chat completions in the lines of a file.
    pub(crate) url: Option<String>,
}

/// Form of a Batch API.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum BatchForm {
    /// Batches of uploaded files, as at OpenAI.
    #[default]
    Files,
    /// Another form.
    Other,
    /// The vendor has no Batch API.
    None,
}
