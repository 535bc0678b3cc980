//! Limits on the images in requests to an endpoint: [`ImageLimit`].

use crate::endpoints::Access;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::ImageFacts;

/// Limits on the images that an endpoint accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageLimit {
    /// Maximum size of the encoded file, in bytes.
    pub bytes: usize,
    /// Maximum length of a side, in pixels; `None` for any.
    pub side: Option<u32>,
    /// Provider or setting that the limit comes from.
    pub origin: &'static str,
    /// Limits on requests with several images.
    request: ImageLimits,
}

/// Limits on a request with several images; `None` for no or an unknown limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct ImageLimits {
    /// Maximum number of images.
    images: Option<ProviderLimit<usize>>,
    /// Maximum side of an image, in pixels, in a request with more than [`MANY`] images.
    side_many: Option<ProviderLimit<u32>>,
    /// Maximum size of the body, in bytes.
    bytes: Option<ProviderLimit<usize>>,
}

/// A limit and the name of the provider.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct ProviderLimit<T> {
    max: T,
    origin: &'static str,
}

/// Number of images beyond which Anthropic accepts only smaller images (platform.claude.com/docs, "Vision").
const MANY: usize = 20;

const fn limit(bytes: usize, side: Option<u32>, origin: &'static str) -> ImageLimit {
    ImageLimit { bytes, side, origin, request: ImageLimits { images: None, side_many: None, bytes: None } }
}

impl ImageLimit {
    /// Limit for unknown endpoints: 20 MB, the maximum of all hosted models.
    pub const UNKNOWN: Self = limit(20_000_000, None, "the default");

    /// Limit on single images at an endpoint.
    #[must_use]
    pub fn from_access(access: &Access) -> Self {
        let Some(vendor) = access.vendor else {
            return Self::UNKNOWN;
        };
        match (vendor.image_bytes, vendor.image_side) {
            (None, None) => Self::UNKNOWN,
            (bytes, side) => limit(bytes.unwrap_or(Self::UNKNOWN.bytes), side, &vendor.name),
        }
    }

    /// Adds the limits on requests with several images to an endpoint.
    #[must_use]
    pub fn with_requests_to(mut self, access: &Access) -> Self {
        let Some(vendor) = access.vendor else {
            return self;
        };
        let (origin, request) = (&*vendor.name, &mut self.request);
        request.images = stricter(request.images, vendor.images, origin);
        request.side_many = stricter(request.side_many, vendor.image_side_many, origin);
        request.bytes = stricter(request.bytes, vendor.request_bytes, origin);
        self
    }

    /// Checks the number of images in a request, and the side of the largest one, `image`, if it is known. The size of
    /// the body is not checked, because the other images may be smaller: see [`Self::may_exceed`].
    ///
    /// # Errors
    /// [`Error::Data`] about the request, with the remedy.
    pub fn check_request(&self, images: usize, image: Option<&ImageFacts>) -> Result<()> {
        if let Some(ProviderLimit { max, origin }) = self.request.images
            && images > max
        {
            let problem = format!(
                "{images} images in a request are more than the {max} of {origin}; show fewer frames, or ask another endpoint"
            );
            return Err(Error::data("request", problem));
        }
        let side = image.map_or(0, |image| image.width.max(image.height));
        if let Some(ProviderLimit { max, origin }) = self.request.side_many
            && images > MANY
            && side > max as usize
        {
            let problem = format!(
                "a side of {side} pixels is more than the {max} of {origin} for requests with more than {MANY} images; make images \
                 smaller with --image max-side={max}"
            );
            return Err(Error::data("request", problem));
        }
        Ok(())
    }

    /// Warning that the body of a request with `images` images, with `image` as the largest, may be too large in
    /// base64. `None` if the images fit in any case.
    #[must_use]
    pub fn may_exceed(&self, images: usize, image: &ImageFacts) -> Option<String> {
        let bytes = images * image.bytes.div_ceil(3) * 4;
        let ProviderLimit { max, origin } = self.request.bytes.filter(|limit| bytes > limit.max)?;
        Some(format!(
            "a request may have up to {:.1} MB, with {images} images, and {origin} takes {} MB; make images smaller with --image max-side=N, or \
             with --image jpeg:95",
            megabytes(bytes),
            megabytes(max)
        ))
    }

    /// Checks the file size and the sides of an image.
    ///
    /// # Errors
    /// [`Error::Data`] about the image, with the flags that make it smaller.
    pub fn check(&self, image: &ImageFacts) -> Result<()> {
        let remedy = "make it smaller with --image max-side=N, or with --image jpeg:95";
        if image.bytes > self.bytes {
            let problem = format!(
                "{} × {} pixels are {:.1} MB as {}, more than the {} MB of {}; {remedy}, or set another limit with --image max-mb",
                image.width,
                image.height,
                megabytes(image.bytes),
                image.format,
                megabytes(self.bytes),
                self.origin,
            );
            return Err(Error::data("image", problem));
        }
        let side = image.width.max(image.height);
        if let Some(max) = self.side
            && side > max as usize
        {
            let problem = format!("a side of {side} pixels is more than the {max} of {}; {remedy}", self.origin);
            return Err(Error::data("image", problem));
        }
        Ok(())
    }

    /// The stricter value of each limit; the origin is that of the smaller file size.
    #[must_use]
    pub fn stricter(self, other: Self) -> Self {
        let (small, large) = if self.bytes <= other.bytes { (self, other) } else { (other, self) };
        let side = small.side.into_iter().chain(large.side).min();
        let (one, two) = (small.request, large.request);
        let request = ImageLimits {
            images: one.images.into_iter().chain(two.images).min(),
            side_many: one.side_many.into_iter().chain(two.side_many).min(),
            bytes: one.bytes.into_iter().chain(two.bytes).min(),
        };
        Self { side, request, ..small }
    }

    /// Limit from `--image max-mb`.
    #[must_use]
    pub fn from_user(bytes: usize) -> Self {
        limit(bytes, None, "--image max-mb")
    }
}

fn megabytes(bytes: usize) -> f64 {
    bytes as f64 / 1e6
}

/// The stricter of a limit and the limit `max` of the provider `origin`.
fn stricter<T: Ord>(limit: Option<ProviderLimit<T>>, max: Option<T>, origin: &'static str) -> Option<ProviderLimit<T>> {
    let other = max.map(|max| ProviderLimit { max, origin });
    limit.into_iter().chain(other).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit_at(base: &str) -> ImageLimit {
        ImageLimit::from_access(&Access::new(base.parse().unwrap()))
    }

    #[test]
    fn the_host_decides_the_limit() {
        assert_eq!(limit_at("https://api.anthropic.com/v1").side, Some(8000));
        assert_eq!(limit_at("https://r.openai.azure.com/openai/v1").origin, "Azure");
        assert_eq!(limit_at("http://127.0.0.1:8000/v1"), ImageLimit::UNKNOWN);
    }

    /// A PNG file of this many bytes and this width.
    fn image(bytes: usize, width: usize) -> ImageFacts {
        ImageFacts {
            digest: darkqa_base::types::Digest::from_bytes(b""),
            bytes,
            width,
            height: 10,
            format: "png".into(),
            orientation: None,
            exposure: None,
            pair: None,
        }
    }

    #[test]
    fn images_beyond_the_limit_are_errors() {
        let limit = ImageLimit::from_access(&Access::new("https://api.anthropic.com/v1".parse().unwrap()));
        assert!(limit.check(&image(7_500_000, 8000)).is_ok());
        for beyond in [image(7_500_001, 10), image(10, 8001)] {
            let error = limit.check(&beyond).unwrap_err().to_string();
            assert!(error.contains("Anthropic") && error.contains("--image max-side"), "{error}");
        }
        let both = limit.stricter(ImageLimit::from_user(5));
        assert_eq!((both.bytes, both.side, both.origin), (5, Some(8000), "--image max-mb"));
        assert!(ImageLimit::from_user(5).check(&image(6, 10)).is_err());
    }

    fn user_limit_at(base: &str) -> ImageLimit {
        ImageLimit::from_user(1).with_requests_to(&Access::new(base.parse().unwrap()))
    }

    #[test]
    fn requests_with_several_images_have_limits() {
        let groq = user_limit_at("https://api.groq.com/openai/v1");
        assert!(groq.check_request(5, None).is_ok());
        let error = groq.check_request(6, None).unwrap_err().to_string();
        assert!(error.contains("6 images") && error.contains("5 of Groq"), "{error}");
        let anthropic = user_limit_at("https://api.anthropic.com/v1");
        let wide = image(10, 2001);
        assert!(anthropic.check_request(20, Some(&wide)).is_ok());
        let error = anthropic.check_request(21, Some(&wide)).unwrap_err();
        assert!(error.to_string().contains("--image max-side=2000"), "{error}");
        assert!(anthropic.check_request(21, Some(&image(10, 2000))).is_ok());
        // 50 images of 300 kB are 20 MB of base64.
        let gemini = user_limit_at("https://generativelanguage.googleapis.com/v1beta/openai");
        assert_eq!(gemini.may_exceed(50, &image(300_000, 10)), None);
        let warning = gemini.may_exceed(50, &image(300_003, 10)).unwrap();
        assert!(warning.contains("Gemini takes 20 MB"), "{warning}");
        // The stricter of two limits, and no limit at an unknown server.
        let both = groq.stricter(anthropic);
        assert!(both.check_request(6, None).is_err() && both.check_request(5, Some(&wide)).is_ok());
        let unknown = user_limit_at("http://127.0.0.1:8000/v1");
        assert!(unknown.check_request(1000, Some(&wide)).is_ok());
        assert_eq!(unknown.may_exceed(1000, &wide), None);
    }
}
