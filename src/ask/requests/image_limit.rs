//! The maximum size of an image that an endpoint accepts: [`ImageLimit`].

use crate::ask::endpoints::Access;
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
    /// The limits of requests with several images.
    request: RequestLimit,
}

/// The limits of a request with several images; `None` for any, or where none is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct RequestLimit {
    /// The most images.
    images: Option<Known<usize>>,
    /// The longest side of an image, in pixels, if there are more than [`MANY`].
    side_many: Option<Known<u32>>,
    /// The largest body, in bytes.
    bytes: Option<Known<usize>>,
}

/// A limit, with the provider that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Known<T> {
    most: T,
    origin: &'static str,
}

/// The number of images beyond which Anthropic takes smaller ones alone (platform.claude.com/docs, "Vision").
const MANY: usize = 20;

const fn limit(bytes: usize, side: Option<u32>, origin: &'static str) -> ImageLimit {
    ImageLimit {
        bytes,
        side,
        origin,
        request: RequestLimit {
            images: None,
            side_many: None,
            bytes: None,
        },
    }
}

impl ImageLimit {
    /// The limit for unknown endpoints: 20 MB; no hosted model accepts more.
    pub(crate) const UNKNOWN: Self = limit(20_000_000, None, "the default");

    /// The limit of an endpoint.
    #[must_use]
    pub(crate) fn from_access(access: &Access) -> Self {
        let Some(vendor) = access.vendor else {
            return Self::UNKNOWN;
        };
        match (vendor.image_bytes, vendor.image_side) {
            (None, None) => Self::UNKNOWN,
            (bytes, side) => limit(bytes.unwrap_or(Self::UNKNOWN.bytes), side, &vendor.name),
        }
    }

    /// This limit, and that of requests with several images to a model at an endpoint that sees them.
    #[must_use]
    pub(crate) fn with_requests_to(mut self, access: &Access) -> Self {
        let Some(vendor) = access.vendor else {
            return self;
        };
        let (origin, own) = (&*vendor.name, &mut self.request);
        own.images = stricter(own.images, vendor.images, origin);
        own.side_many = stricter(own.side_many, vendor.image_side_many, origin);
        own.bytes = stricter(own.bytes, vendor.request_bytes, origin);
        self
    }

    /// Checks that a request with so many images is within the limit. `image` is the largest of them, if it is known. A body that
    /// may be too large is not refused here, as the other images may be smaller: see [`Self::may_exceed`].
    ///
    /// # Errors
    /// [`Error::Data`] about the request, with what to do.
    pub(crate) fn check_request(&self, images: usize, image: Option<&ImageFacts>) -> Result<()> {
        if let Some(Known { most, origin }) =
            self.request.images.filter(|known| images > known.most)
        {
            let problem = format!(
                "{images} images in a request are more than the {most} of {origin}; show fewer frames, or ask another endpoint"
            );
            return Err(Error::data("request", problem));
        }
        let long = image.map_or(0, |image| image.width.max(image.height));
        let many = self.request.side_many.filter(|_| images > MANY);
        match many.filter(|known| long > known.most as usize) {
            None => Ok(()),
            Some(Known { most, origin }) => {
                let problem = format!(
                    "a side of {long} pixels is more than the {most} of {origin} for requests with more than {MANY} images; make images \
                     smaller with --image max-side={most}"
                );
                Err(Error::data("request", problem))
            }
        }
    }

    /// The reason why a request with `images` images, of which `image` is the largest, may be refused: as base64 they may exceed what a
    /// body may have. `None` if they fit.
    #[must_use]
    pub(crate) fn may_exceed(&self, images: usize, image: &ImageFacts) -> Option<String> {
        let bytes = images * image.bytes.div_ceil(3) * 4;
        let Known { most, origin } = self.request.bytes.filter(|known| bytes > known.most)?;
        let megabytes = |bytes: usize| bytes as f64 / 1e6;
        Some(format!(
            "a request may have up to {:.1} MB, with {images} images, and {origin} takes {} MB; make images smaller with --image max-side=N, or \
             with --image jpeg:95",
            megabytes(bytes),
            megabytes(most)
        ))
    }

    /// Checks that an image is within the limit.
    ///
    /// # Errors
    /// [`Error::Data`] about the image, with the flags that make it smaller.
    pub(crate) fn check(&self, image: &ImageFacts) -> Result<()> {
        let long = image.width.max(image.height);
        let remedy = "make it smaller with --image max-side=N, or with --image jpeg:95";
        let wrong = |problem: String| Err(Error::data("image", problem));
        let megabytes = |bytes: usize| bytes as f64 / 1e6;
        if image.bytes > self.bytes {
            return wrong(format!(
                "{} × {} pixels are {:.1} MB as {}, more than the {} MB of {}; {remedy}, or set another limit with --image max-mb",
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
        let (one, two) = (small.request, large.request);
        let request = RequestLimit {
            images: one.images.into_iter().chain(two.images).min(),
            side_many: one.side_many.into_iter().chain(two.side_many).min(),
            bytes: one.bytes.into_iter().chain(two.bytes).min(),
        };
        Self {
            side,
            request,
            ..small
        }
    }

    /// The limit that the user set by `--image max-mb`.
    #[must_use]
    pub(crate) fn stated(bytes: usize) -> Self {
        limit(bytes, None, "--image max-mb")
    }
}

/// The stricter of a limit and that of another provider.
fn stricter<T: Ord>(
    known: Option<Known<T>>,
    most: Option<T>,
    origin: &'static str,
) -> Option<Known<T>> {
    let other = most.map(|most| Known { most, origin });
    known.into_iter().chain(other).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_known_by_host() {
        let of = |base: &str| ImageLimit::from_access(&Access::new(base.parse().unwrap()));
        assert_eq!(of("https://api.anthropic.com/v1").side, Some(8000));
        assert_eq!(of("https://r.openai.azure.com/openai/v1").origin, "Azure");
        assert_eq!(of("http://127.0.0.1:8000/v1"), ImageLimit::UNKNOWN);
    }

    /// A PNG file of this many bytes and this width.
    fn image(bytes: usize, width: usize) -> ImageFacts {
        ImageFacts {
            digest: crate::types::Digest::from_bytes(b""),
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
    fn an_image_beyond_the_limit_is_an_error_with_a_remedy() {
        let limit = ImageLimit::from_access(&Access::new(
            "https://api.anthropic.com/v1".parse().unwrap(),
        ));
        assert!(limit.check(&image(7_500_000, 8000)).is_ok());
        for beyond in [image(7_500_001, 10), image(10, 8001)] {
            let error = limit.check(&beyond).unwrap_err().to_string();
            assert!(
                error.contains("Anthropic") && error.contains("--image max-side"),
                "{error}"
            );
        }
        let both = limit.stricter(ImageLimit::stated(5));
        assert_eq!(
            (both.bytes, both.side, both.origin),
            (5, Some(8000), "--image max-mb")
        );
        assert!(ImageLimit::stated(5).check(&image(6, 10)).is_err());
    }

    #[test]
    fn several_images_in_a_request_have_limits_of_their_own() {
        let at = |base: &str| {
            ImageLimit::stated(1).with_requests_to(&Access::new(base.parse().unwrap()))
        };
        let groq = at("https://api.groq.com/openai/v1");
        assert!(groq.check_request(5, None).is_ok());
        let error = groq.check_request(6, None).unwrap_err().to_string();
        assert!(
            error.contains("6 images") && error.contains("5 of Groq"),
            "{error}"
        );
        let anthropic = at("https://api.anthropic.com/v1");
        let wide = image(10, 2001);
        assert!(anthropic.check_request(20, Some(&wide)).is_ok());
        let error = anthropic.check_request(21, Some(&wide)).unwrap_err();
        assert!(
            error.to_string().contains("--image max-side=2000"),
            "{error}"
        );
        assert!(anthropic.check_request(21, Some(&image(10, 2000))).is_ok());
        // 50 images of 300 kB are 20 MB of base64.
        let gemini = at("https://generativelanguage.googleapis.com/v1beta/openai");
        assert_eq!(gemini.may_exceed(50, &image(300_000, 10)), None);
        let words = gemini.may_exceed(50, &image(300_003, 10)).unwrap();
        assert!(words.contains("Gemini takes 20 MB"), "{words}");
        // The stricter of two, and none at a server that is not known.
        let both = groq.stricter(anthropic);
        assert!(both.check_request(6, None).is_err() && both.check_request(5, Some(&wide)).is_ok());
        let own = at("http://127.0.0.1:8000/v1");
        assert!(own.check_request(1000, Some(&wide)).is_ok());
        assert_eq!(own.may_exceed(1000, &wide), None);
    }
}
