//! Colour spaces of images: [`Meaning`] and [`ColourSpace`].

use std::sync::Arc;

use super::conversion::Conversion;
use super::curve::{ToneCurve, WHITE_NITS};
use super::primaries::Primaries;
use darkqa_base::types::{ColourHandling, ColourNote, Digest};

/// Remedy for colours that cannot be converted.
pub(super) const REMEDY: &str = "convert it to sRGB first, or take its codes as sRGB with --decode colour=ignore";

/// Interpretation of the codes of an image.
#[derive(Debug, Clone)]
pub(crate) enum Meaning {
    Srgb,
    /// Linear light with the primaries of sRGB.
    Linear,
    /// A colour space that can be converted to sRGB.
    Other(Arc<ColourSpace>),
}

/// Bit depth of the codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CodeDepth {
    Eight,
    Sixteen,
}

/// A colour space other than sRGB.
#[derive(Debug)]
pub(crate) struct ColourSpace {
    pub(crate) conversion: Conversion,
    /// Name of the profile or of the standard.
    pub(super) name: String,
    /// Digest of the profile; `None` without a profile.
    pub(super) profile: Option<Digest>,
    /// True for a grey profile.
    pub(super) is_grey: bool,
    /// What the conversion does.
    pub(crate) handling: ColourHandling,
}

impl ColourSpace {
    /// Checks that a colour image has no grey profile. `is_grey` tells if the image is grey.
    pub(crate) fn check(&self, is_grey: bool) -> Result<(), String> {
        if self.is_grey && !is_grey {
            let name = &self.name;
            return Err(format!("the ICC profile {name:?} is for grey, but the image has colours; {REMEDY}"));
        }
        Ok(())
    }

    /// Note for images with this colour space and handling.
    pub(crate) fn note(&self, handling: ColourHandling) -> ColourNote {
        ColourNote { from: self.name.clone(), profile: self.profile, handling }
    }

    /// Name of the profile or of the standard.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The reason why HDR is not converted unless `--decode colour=clip` asks for it.
    pub(crate) fn hdr_refusal(&self) -> String {
        format!(
            "the codes are {}; --decode colour=clip converts them to sRGB, where light above {WHITE_NITS} cd/m² becomes white; or {REMEDY}",
            self.name
        )
    }
}

/// A colour space with the same tone curve for all channels.
pub(super) fn rgb_space(
    name: String,
    curve: ToneCurve,
    primaries: &Primaries,
    handling: ColourHandling,
) -> ColourSpace {
    ColourSpace {
        conversion: Conversion::new([curve.clone(), curve.clone(), curve], primaries.to_srgb()),
        name,
        profile: None,
        is_grey: false,
        handling,
    }
}
