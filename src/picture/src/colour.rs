//! Colour space of an image: the colour information in its file ([`ColourTag`]) and its interpretation ([`Meaning`]).
//!
//! A PNG file may have several kinds of colour information. In order of priority (PNG specification, third edition, section 4.3): code
//! points (`cICP`), an ICC profile, the chunk `sRGB`, gamma and primaries (`gAMA`, `cHRM`). Without any, codes are sRGB. Other formats have
//! only profiles.

mod conversion;
mod curve;
mod icc;
mod inks;
pub(super) mod primaries;
mod srgb;

use std::io::Read as _;
use std::sync::{Arc, LazyLock};

pub(super) use self::conversion::Conversion;
use self::curve::ToneCurve;
use self::icc::Profile;
pub(super) use self::inks::Inks;
use self::primaries::Primaries;
use darkqa_ground::types::values::Recent;
use darkqa_ground::types::{ColourHandling, ColourNote, Digest};

/// Maximum size of an ICC profile, in bytes; chosen. Matrix profiles have a few thousand bytes, printer profiles up to a few million.
const MAX_PROFILE_BYTES: usize = 4 << 20;

/// Number of profiles whose conversions are cached; chosen. The images of a data set usually share one profile.
const CACHED_PROFILES: usize = 16;

/// Remedy for colours that cannot be converted.
const REMEDY: &str =
    "convert it to sRGB first, or take its codes as sRGB with --decode colour=ignore";

/// The colour information of a file; of several, the one with the highest priority.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) enum ColourTag {
    /// No colour information.
    #[default]
    None,
    /// Code points of H.273: primaries, transfer, matrix, and 1 for the full range.
    CodePoints([u8; 4]),
    /// An ICC profile.
    Profile(Vec<u8>),
    /// A PNG chunk `iCCP`: name, a zero byte, a zero byte for the compression method, the compressed profile.
    DeflatedProfile(Vec<u8>),
    /// A PNG chunk `sRGB`.
    Srgb,
    /// The PNG chunks `gAMA` and `cHRM`.
    Gamma(Gamma),
    /// Primaries of linear light.
    Primaries(Primaries),
}

/// Exponent and primaries of a PNG file, in units of 0.00001; `None` if missing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Gamma {
    pub(super) exponent: Option<u32>,
    /// x and y of white, red, green and blue.
    pub(super) primaries: Option<[u32; 8]>,
}

/// Interpretation of the codes of an image.
#[derive(Debug, Clone)]
pub(super) enum Meaning {
    Srgb,
    /// Linear light with the primaries of sRGB.
    Linear,
    /// A colour space that can be converted to sRGB.
    Other(Arc<ColourSpace>),
}

/// Bit depth of the codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CodeDepth {
    Eight,
    Sixteen,
}

/// A colour space other than sRGB.
#[derive(Debug)]
pub(super) struct ColourSpace {
    pub(super) conversion: Conversion,
    /// Name of the profile or of the standard.
    name: String,
    /// Digest of the profile; `None` without a profile.
    profile: Option<Digest>,
    /// True for a grey profile.
    is_grey: bool,
}

impl ColourSpace {
    /// Checks that a colour image has no grey profile. `is_grey` tells if the image is grey.
    pub(super) fn check(&self, is_grey: bool) -> Result<(), String> {
        if self.is_grey && !is_grey {
            let name = &self.name;
            return Err(format!(
                "the ICC profile {name:?} is for grey, but the image has colours; {REMEDY}"
            ));
        }
        Ok(())
    }

    /// Note for images with this colour space and handling.
    pub(super) fn note(&self, handling: ColourHandling) -> ColourNote {
        ColourNote {
            from: self.name.clone(),
            profile: self.profile,
            handling,
        }
    }
}

impl ColourTag {
    /// Interprets the colour information for codes of this depth.
    ///
    /// # Errors
    /// If the colour space is unknown or cannot be converted. The error names the colour space and the remedy.
    pub(super) fn meaning(&self, depth: CodeDepth) -> Result<Meaning, String> {
        match self {
            Self::None | Self::Srgb => Ok(Meaning::Srgb),
            Self::CodePoints(points) => meaning_from_code_points(*points),
            Self::Profile(profile) => meaning_from_profile(profile),
            Self::DeflatedProfile(chunk) => meaning_from_profile(&decompress_profile(chunk)?),
            Self::Gamma(gamma) => gamma.meaning(depth),
            Self::Primaries(primaries) => Ok(meaning_from_primaries(primaries)),
        }
    }

    /// Name of the kind of colour information, for files whose colours are not converted.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::CodePoints(_) => "code points (cICP)",
            Self::Profile(_) | Self::DeflatedProfile(_) => "an ICC profile",
            Self::Srgb => "sRGB",
            Self::Gamma(_) => "gamma or primaries (gAMA, cHRM)",
            Self::Primaries(_) => "primaries (OpenEXR chromaticities)",
        }
    }
}

/// The colour space of linear light with these primaries.
fn meaning_from_primaries(primaries: &Primaries) -> Meaning {
    let Primaries {
        red,
        green,
        blue,
        white,
    } = primaries;
    let [red, green, blue, white] =
        [red, green, blue, white].map(|[x, y]| format!("{x:.4} {y:.4}"));
    let name = format!("primaries {red}, {green}, {blue}, white {white}");
    rgb_space(name, ToneCurve::Gamma(1.0), primaries)
}

/// A colour space with the same tone curve for all channels.
fn rgb_space(name: String, curve: ToneCurve, primaries: &Primaries) -> Meaning {
    Meaning::Other(Arc::new(ColourSpace {
        conversion: Conversion::new([curve.clone(), curve.clone(), curve], primaries.to_srgb()),
        name,
        profile: None,
        is_grey: false,
    }))
}

/// Interprets code points of H.273 (tables 2 to 4).
fn meaning_from_code_points(points: [u8; 4]) -> Result<Meaning, String> {
    match points {
        [_, 16, ..] => Err(format!("the codes are PQ (HDR); {REMEDY}")),
        [_, 18, ..] => Err(format!("the codes are HLG (HDR); {REMEDY}")),
        [.., 0] => Err(format!(
            "the codes have the narrow range of video; {REMEDY}"
        )),
        [1, 13, 0, 1] => Ok(Meaning::Srgb),
        [1, 1, 0, 1] => Ok(rgb_space(
            "BT.709".to_owned(),
            ToneCurve::Bt709,
            &Primaries::SRGB,
        )),
        [12, 13, 0, 1] => Ok(rgb_space(
            "Display P3".to_owned(),
            ToneCurve::Srgb,
            &Primaries::DISPLAY_P3,
        )),
        [primaries, transfer, matrix, range] => Err(format!(
            "the colours have the code points {primaries}/{transfer}/{matrix}/{range} (cICP); 1/13/0/1 (sRGB), 1/1/0/1 (BT.709) or 12/13/0/1 (Display P3) expected: {REMEDY}"
        )),
    }
}

/// Interprets an ICC profile. The most recent profiles are cached by their digests.
fn meaning_from_profile(profile: &[u8]) -> Result<Meaning, String> {
    static CACHE: LazyLock<Recent<Digest, Meaning>> =
        LazyLock::new(|| Recent::new(CACHED_PROFILES));
    if profile.len() > MAX_PROFILE_BYTES {
        return Err(profile_too_large());
    }
    let digest = Digest::from_bytes(profile);
    CACHE.get(&digest, || {
        let Profile {
            name,
            conversion,
            is_grey,
        } = Profile::read(profile).map_err(|problem| format!("{problem}; {REMEDY}"))?;
        if conversion.is_identity() {
            return Ok(Meaning::Srgb);
        }
        Ok(Meaning::Other(Arc::new(ColourSpace {
            conversion,
            name,
            profile: Some(digest),
            is_grey,
        })))
    })
}

/// Decompresses the profile in a PNG chunk `iCCP`, up to [`MAX_PROFILE_BYTES`], because a small chunk may expand to any size.
fn decompress_profile(chunk: &[u8]) -> Result<Vec<u8>, String> {
    let end = chunk
        .iter()
        .position(|byte| *byte == 0)
        .ok_or_else(broken_compression)?;
    let data = chunk.get(end + 2..).ok_or_else(broken_compression)?;
    let mut profile = Vec::new();
    let bound = MAX_PROFILE_BYTES as u64 + 1;
    flate2::read::ZlibDecoder::new(data)
        .take(bound)
        .read_to_end(&mut profile)
        .map_err(|_| broken_compression())?;
    if profile.len() > MAX_PROFILE_BYTES {
        return Err(profile_too_large());
    }
    Ok(profile)
}

fn broken_compression() -> String {
    format!("the ICC profile cannot be decompressed; {REMEDY}")
}

fn profile_too_large() -> String {
    format!(
        "the ICC profile has more than {} MB; {REMEDY}",
        MAX_PROFILE_BYTES >> 20
    )
}

impl Gamma {
    /// Exponent of the approximation of sRGB, 1/2.2.
    const SRGB: u32 = 45_455;
    /// Tolerance for exponents that count as sRGB (chosen).
    const EXPONENT_TOLERANCE: u32 = 50;
    /// Tolerance for primaries that count as sRGB, because encoders round them differently (chosen).
    const PRIMARIES_TOLERANCE: u32 = 100;

    /// Exponent of linear light, which is supported only with 16 bits.
    const LINEAR: u32 = 100_000;

    fn meaning(self, depth: CodeDepth) -> Result<Meaning, String> {
        if let Some(primaries) = self.primaries.filter(|found| !Self::are_srgb(*found)) {
            let [white, red, green, blue] = [0, 2, 4, 6].map(|i| {
                format!(
                    "{}, {}",
                    png_number(primaries[i]),
                    png_number(primaries[i + 1])
                )
            });
            return Err(format!(
                "the primaries of the image (cHRM) are not those of sRGB (white {white}, red {red}, green {green}, blue {blue}); {REMEDY}"
            ));
        }
        match self.exponent {
            Some(Self::LINEAR) if depth == CodeDepth::Sixteen => Ok(Meaning::Linear),
            Some(found) if found.abs_diff(Self::SRGB) > Self::EXPONENT_TOLERANCE => Err(format!(
                "the gamma of the image (gAMA) is {}; {} (sRGB) expected: {REMEDY}",
                png_number(found),
                png_number(Self::SRGB)
            )),
            _ => Ok(Meaning::Srgb),
        }
    }

    fn are_srgb(found: [u32; 8]) -> bool {
        const SRGB: [u32; 8] = [
            31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6_000,
        ];
        found
            .iter()
            .zip(SRGB)
            .all(|(found, expected)| found.abs_diff(expected) <= Self::PRIMARIES_TOLERANCE)
    }
}

/// Converts a number that a PNG file states in units of 0.00001.
fn png_number(stated: u32) -> f64 {
    f64::from(stated) / 100_000.0
}

#[cfg(test)]
mod tests;
