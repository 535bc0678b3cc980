//! The file format in which images are sent: [`PayloadFormat`], set by [`ImageArgs`].

use std::fmt;
use std::str::FromStr;

use clap::Args;

use darkqa_base::types::Decides;

/// The file format in which images are sent: PNG or JPEG, because servers refuse other formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PayloadFormat {
    /// Lossless: the model receives exactly the pixels that were made.
    Png,
    /// Smaller, without chroma subsampling. Compression removes the noise of dark areas first.
    Jpeg(Quality),
}

/// The quality of a JPEG, 1 to 100.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quality(pub(crate) u8);

/// The flag for the file format of images.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Sending")]
pub struct ImageArgs {
    /// Format of sent images: png (lossless) or jpeg:QUALITY
    #[arg(long, value_name = "FORMAT", default_value_t = PayloadFormat::Png, add = Decides::Pixels)]
    pub image: PayloadFormat,
}

impl Quality {
    /// Checks a quality; `None` outside 1 to 100.
    #[must_use]
    pub fn new(quality: u8) -> Option<Self> {
        (1..=100).contains(&quality).then_some(Self(quality))
    }
}

impl PayloadFormat {
    /// The subtype of the media type `image/…`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg(_) => "jpeg",
        }
    }
}

impl fmt::Display for PayloadFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Png => f.write_str("png"),
            Self::Jpeg(Quality(quality)) => write!(f, "jpeg:{quality}"),
        }
    }
}

impl FromStr for PayloadFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "png" {
            return Ok(Self::Png);
        }
        text.strip_prefix("jpeg:")
            .and_then(|quality| Quality::new(quality.parse().ok()?))
            .map(Self::Jpeg)
            .ok_or_else(|| "png, or jpeg:QUALITY with a quality from 1 to 100, as jpeg:95, expected".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_parse_their_own_text() {
        for text in ["png", "jpeg:1", "jpeg:95", "jpeg:100"] {
            assert_eq!(text.parse::<PayloadFormat>().unwrap().to_string(), text);
        }
        for wrong in ["", "PNG", "jpeg", "jpeg:", "jpeg:0", "jpeg:101", "jpeg:-1", "webp"] {
            assert!(wrong.parse::<PayloadFormat>().is_err(), "{wrong}");
        }
    }
}
