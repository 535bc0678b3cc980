//! A vendor's Batch API: [`BatchInterface`].

use std::num::{NonZeroU64, NonZeroUsize};

use super::endpoints::BaseUrl;
use super::vendors::{BatchForm, Vendor, VendorBatch};
use crate::error::{Error, Result};

/// The Batch API at an address; that of OpenAI if the address is not in the table of vendors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BatchInterface {
    vendor: Option<&'static Vendor>,
}

/// The limits of OpenAI and Azure: 200 MB and 50,000 requests a file.
const FILE_SIZE: NonZeroU64 = NonZeroU64::new(200).unwrap();
const REQUESTS: NonZeroUsize = NonZeroUsize::new(50_000).unwrap();

/// The purpose of OpenAI's input files.
const PURPOSE: &str = "batch";

impl BatchInterface {
    /// The Batch API at an address, as messages show it.
    pub(crate) fn at(base: &str) -> Self {
        let base = base.parse::<BaseUrl>().ok();
        let vendor = base.and_then(|base| Vendor::at_host(base.host()));
        Self { vendor }
    }

    fn known(self) -> Option<&'static VendorBatch> {
        self.vendor?.batch.as_ref()
    }

    /// The purpose under which files are uploaded.
    pub(crate) fn purpose(self) -> &'static str {
        let known = self.known().and_then(|known| known.purpose.as_deref());
        known.unwrap_or(PURPOSE)
    }

    /// The largest file, in MB.
    pub(crate) fn file_size(self) -> NonZeroU64 {
        let known = self.known().and_then(|known| known.file_size);
        known.unwrap_or(FILE_SIZE)
    }

    /// The most requests in a file.
    pub(crate) fn requests(self) -> NonZeroUsize {
        let known = self.known().and_then(|known| known.requests);
        known.unwrap_or(REQUESTS)
    }

    /// The path in a line, for requests that the API takes at the path `usual`: the vendor's own for chat completions.
    pub(crate) fn url(self, usual: &str) -> &str {
        let chat = usual.ends_with("/chat/completions");
        let known = self.known().and_then(|known| known.url.as_deref());
        known.filter(|_| chat).unwrap_or(usual)
    }

    /// Checks that files can be submitted.
    ///
    /// # Errors
    /// If the vendor has no Batch API, or one of another form.
    pub(crate) fn require_files(self) -> Result<()> {
        let name = self.vendor.map_or("", |vendor| &*vendor.name);
        let form = self.known().map_or(BatchForm::Files, |known| known.form);
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
    fn the_batch_api_is_known_by_the_address() {
        let together = BatchInterface::at("https://api.together.xyz/v1");
        assert_eq!(
            (together.purpose(), together.file_size().get()),
            ("batch-api", 100)
        );
        let own = BatchInterface::at("http://127.0.0.1:8000/v1");
        assert_eq!((own.purpose(), own.file_size().get()), ("batch", 200));
        assert_eq!(own.requests().get(), 50_000);
        let azure = BatchInterface::at("https://r.openai.azure.com/openai/v1");
        let of = |usual| azure.url(usual).to_owned();
        assert_eq!(of("/v1/chat/completions"), "/chat/completions");
        assert_eq!(of("/v1/responses"), "/v1/responses");
        assert_eq!(own.url("/v1/chat/completions"), "/v1/chat/completions");
    }

    #[test]
    fn a_batch_api_of_another_form_is_refused_by_name() {
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
