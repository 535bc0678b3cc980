//! The maximum size of an image that an endpoint accepts: [`ImageLimit`].

use super::url::BaseUrl;
use super::vendor::Vendor;
use crate::error::{Error, Result};
use crate::types::ImageFacts;

/// The maximum size of images that an endpoint accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ImageLimit {
    /// The maximum size of the encoded file, in bytes.
    pub bytes: usize,
    /// The maximum length of a side, in pixels; `None` for any.
    pub side: Option<u32>,
    /// The provider or setting that the limit comes from.
    pub origin: &'static str,
}

const fn limit(bytes: usize, side: Option<u32>, origin: &'static str) -> ImageLimit {
    ImageLimit {
        bytes,
        side,
        origin,
    }
}

impl ImageLimit {
    /// The limit for unknown endpoints: 20 MB; no hosted model accepts more.
    pub(crate) const UNKNOWN: Self = limit(20_000_000, None, "the default");

    /// The limit of an endpoint.
    #[must_use]
    pub(crate) fn of(base: &BaseUrl) -> Self {
        let Some(vendor) = Vendor::of(base.host()) else {
            return Self::UNKNOWN;
        };
        match (vendor.image_bytes, vendor.image_side) {
            (None, None) => Self::UNKNOWN,
            (bytes, side) => limit(bytes.unwrap_or(Self::UNKNOWN.bytes), side, &vendor.name),
        }
    }

    /// Checks that an image is within the limit.
    ///
    /// # Errors
    /// [`Error::Data`] about the image, with the flags that make it smaller.
    pub(crate) fn check(&self, image: &ImageFacts) -> Result<()> {
        let long = image.width.max(image.height);
        let remedy = "make it smaller by --max-side, or by --image jpeg:95";
        let wrong = |problem: String| Err(Error::data("image", problem));
        let megabytes = |bytes: usize| bytes as f64 / 1e6;
        if image.bytes > self.bytes {
            return wrong(format!(
                "{} × {} pixels are {:.1} MB as {}, more than the {} MB of {}; {remedy}, or take another limit by --max-image",
                image.width,
                image.height,
                megabytes(image.bytes),
                image.format,
                megabytes(self.bytes),
                self.origin,
            ));
        }
        match self.side {
            Some(side) if long > side as usize => wrong(format!(
                "a side of {long} pixels is more than the {side} of {}; {remedy}",
                self.origin
            )),
            _ => Ok(()),
        }
    }

    /// The limit that holds if both do; the origin is that of the smaller file.
    #[must_use]
    pub(crate) fn stricter(self, other: Self) -> Self {
        let (small, large) = if self.bytes <= other.bytes {
            (self, other)
        } else {
            (other, self)
        };
        let side = small.side.into_iter().chain(large.side).min();
        Self { side, ..small }
    }

    /// The limit that the user set by `--max-image`.
    #[must_use]
    pub(crate) fn stated(bytes: usize) -> Self {
        limit(bytes, None, "--max-image")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_known_by_host() {
        let of = |base: &str| ImageLimit::of(&base.parse().unwrap());
        assert_eq!(of("https://api.anthropic.com/v1").side, Some(8000));
        assert_eq!(of("https://r.openai.azure.com/openai/v1").origin, "Azure");
        assert_eq!(of("http://127.0.0.1:8000/v1"), ImageLimit::UNKNOWN);
    }

    #[test]
    fn an_image_beyond_the_limit_is_an_error_with_a_remedy() {
        let image = |bytes, width| ImageFacts {
            digest: crate::types::Digest::of(b""),
            bytes,
            width,
            height: 10,
            format: "png".into(),
            orientation: None,
            exposure: None,
        };
        let limit = ImageLimit::of(&"https://api.anthropic.com/v1".parse().unwrap());
        assert!(limit.check(&image(7_500_000, 8000)).is_ok());
        for beyond in [image(7_500_001, 10), image(10, 8001)] {
            let error = limit.check(&beyond).unwrap_err().to_string();
            assert!(
                error.contains("Anthropic") && error.contains("--max-side"),
                "{error}"
            );
        }
        let both = limit.stricter(ImageLimit::stated(5));
        assert_eq!(
            (both.bytes, both.side, both.origin),
            (5, Some(8000), "--max-image")
        );
        assert!(ImageLimit::stated(5).check(&image(6, 10)).is_err());
    }
}
