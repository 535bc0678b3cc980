//! The Batch API of a vendor, from the table of vendors: [`VendorBatch`].

use std::num::{NonZeroU64, NonZeroUsize};

use serde::Deserialize;

/// The Batch API of a vendor; a field that is `None` is that of OpenAI.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct VendorBatch {
    #[serde(default)]
    pub(super) form: BatchForm,
    /// The purpose under which files are uploaded.
    pub(super) purpose: Option<String>,
    /// The largest file, in MB.
    pub(super) file_size: Option<NonZeroU64>,
    /// The most requests in a file.
    pub(super) requests: Option<NonZeroUsize>,
    /// The path of chat completions in a line.
    pub(super) url: Option<String>,
}

/// The form of a Batch API.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum BatchForm {
    /// Files of requests and batches of files, as at OpenAI.
    #[default]
    Files,
    /// Another form.
    Other,
    /// There is no Batch API.
    None,
}
