//! Properties of a vendor's Batch API: [`BatchInterface`].

use std::num::{NonZeroU64, NonZeroUsize};

use super::endpoints::BaseUrl;
use super::vendors::{BatchForm, Vendor, VendorBatch};
use crate::error::{Error, Result};

/// Properties of the Batch API at an address; those of OpenAI if the address is not in the table of vendors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BatchInterface {
    vendor: Option<&'static Vendor>,
}

/// Limits of OpenAI and Azure per file: 200 MB and 50,000 requests.
const MAX_FILE_SIZE: NonZeroU64 = NonZeroU64::new(200).unwrap();
const MAX_REQUESTS: NonZeroUsize = NonZeroUsize::new(50_000).unwrap();

/// Purpose of OpenAI's input files.
const PURPOSE: &str = "batch";

impl BatchInterface {
    /// Looks up the Batch API at a base URL.
    pub(crate) fn at(base: &str) -> Self {
        let base = base.parse::<BaseUrl>().ok();
        let vendor = base.and_then(|base| Vendor::at_host(base.host()));
        Self { vendor }
    }

    /// Entry in the table of vendors.
    fn entry(self) -> Option<&'static VendorBatch> {
        self.vendor?.batch.as_ref()
    }

    /// Purpose under which files are uploaded.
    pub(crate) fn purpose(self) -> &'static str {
        self.entry().and_then(|entry| entry.purpose.as_deref()).unwrap_or(PURPOSE)
    }

    /// Maximum size of a file, in MB.
    pub(crate) fn file_size(self) -> NonZeroU64 {
        self.entry().and_then(|entry| entry.file_size).unwrap_or(MAX_FILE_SIZE)
    }

    /// Maximum number of requests in a file.
    pub(crate) fn requests(self) -> NonZeroUsize {
        self.entry().and_then(|entry| entry.requests).unwrap_or(MAX_REQUESTS)
    }

    /// Path in the lines of a file, for requests with OpenAI's path `default`. Some vendors have another path for chat
    /// completions.
    pub(crate) fn url(self, default: &str) -> &str {
        if !default.ends_with("/chat/completions") {
            return default;
        }
        self.entry().and_then(|entry| entry.url.as_deref()).unwrap_or(default)
    }

    /// Checks that batches can be submitted as files.
    ///
    /// # Errors
    /// If the vendor has no Batch API, or one of another form.
    pub(crate) fn require_files(self) -> Result<()> {
        let name = self.vendor.map_or("", |vendor| &*vendor.name);
        let form = self.entry().map_or(BatchForm::Files, |entry| entry.form);
        let problem = match form {
            BatchForm::Files => return Ok(()),
            BatchForm::Other => format!(
                "the Batch API of {name} has another form than OpenAI's, which batch run knows; ask directly, or convert the files of \
                 batch export"
            ),
            BatchForm::None => format!("{name} has no Batch API; ask directly, without batch run"),
        };
        Err(Error::usage("--base-url", problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_address_decides_the_batch_api() {
        let together = BatchInterface::at("https://api.together.xyz/v1");
        assert_eq!((together.purpose(), together.file_size().get()), ("batch-api", 100));
        let unknown = BatchInterface::at("http://127.0.0.1:8000/v1");
        assert_eq!((unknown.purpose(), unknown.file_size().get()), ("batch", 200));
        assert_eq!(unknown.requests().get(), 50_000);
        let azure = BatchInterface::at("https://r.openai.azure.com/openai/v1");
        assert_eq!(azure.url("/v1/chat/completions"), "/chat/completions");
        assert_eq!(azure.url("/v1/responses"), "/v1/responses");
        assert_eq!(unknown.url("/v1/chat/completions"), "/v1/chat/completions");
    }

    #[test]
    fn other_batch_apis_are_refused() {
        for (base, expected) in [
            ("https://api.anthropic.com/v1", "Anthropic has another form"),
            ("https://api.mistral.ai/v1", "Mistral has another form"),
            ("https://api.deepseek.com", "DeepSeek has no Batch API"),
        ] {
            let error = BatchInterface::at(base).require_files().unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
        }
        for base in [
            "https://api.openai.com/v1",
            "https://api.groq.com/openai/v1",
            "https://api.together.xyz/v1",
            "http://127.0.0.1:8000/v1",
            "https://gateway.example/v1",
        ] {
            assert!(BatchInterface::at(base).require_files().is_ok(), "{base}");
        }
    }
}
