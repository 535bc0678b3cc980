//! The Batch API of a vendor, from the table of vendors: [`VendorBatch`].

use std::num::{NonZeroU64, NonZeroUsize};

use serde::Deserialize;

/// The Batch API of a vendor; a field that is `None` is that of OpenAI.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(in crate::ask) struct VendorBatch {
    #[serde(default)]
    pub(in crate::ask) form: BatchForm,
    /// The purpose under which files are uploaded.
    pub(in crate::ask) purpose: Option<String>,
    /// The largest file, in MB.
    pub(in crate::ask) file_size: Option<NonZeroU64>,
    /// The most requests in a file.
    pub(in crate::ask) requests: Option<NonZeroUsize>,
    /// The path of chat completions in a line.
    pub(in crate::ask) url: Option<String>,
}

/// The form of a Batch API.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::ask) enum BatchForm {
    /// Files of requests and batches of files, as at OpenAI.
    #[default]
    Files,
    /// Another form.
    Other,
    /// There is no Batch API.
    None,
}
