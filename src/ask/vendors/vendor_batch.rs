//! The Batch API of a vendor, from the table of vendors: [`VendorBatch`].

use std::num::{NonZeroU64, NonZeroUsize};

use serde::Deserialize;

/// Batch API of a vendor; `None` in a field means the value of OpenAI.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(in crate::ask) struct VendorBatch {
    #[serde(default)]
    pub(in crate::ask) form: BatchForm,
    /// Purpose under which files are uploaded.
    pub(in crate::ask) purpose: Option<String>,
    /// Maximum size of a file, in MB.
    pub(in crate::ask) file_size: Option<NonZeroU64>,
    /// Maximum number of requests in a file.
    pub(in crate::ask) requests: Option<NonZeroUsize>,
    /// Path of chat completions in the lines of a file.
    pub(in crate::ask) url: Option<String>,
}

/// Form of a Batch API.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::ask) enum BatchForm {
    /// Batches of uploaded files, as at OpenAI.
    #[default]
    Files,
    /// Another form.
    Other,
    /// The vendor has no Batch API.
    None,
}
