//! Colour space of an image's codes by the colour information of its file: [`ColourTag`] and [`Meaning`].
//!
//! The first of these counts, as in PNG's specification (third edition, section 4.3): code points (`cICP`), an ICC profile, the mark
//! `sRGB`, and gamma with primaries (`gAMA`, `cHRM`). Without any, codes are sRGB. Other formats have only profiles.

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

/// The most bytes of an ICC profile; chosen. Profiles of curves and a matrix have a few thousand, tables for printers up to a
/// few million.
const MOST_PROFILE: usize = 4 << 20;

/// The number of profiles whose conversions are cached. The images of a data set mostly have one.
const CACHED: usize = 16;

/// Remedy for colours that cannot be converted.
const REMEDY: &str =
    "convert it to sRGB first, or take its codes as sRGB with --decode colour=ignore";

/// The colour information of a file that counts.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) enum ColourTag {
    #[default]
    None,
    /// The four code points of H.273: primaries, transfer, matrix, and 1 for the full range.
    CodePoints([u8; 4]),
    /// An ICC profile.
    Profile(Vec<u8>),
    /// A PNG chunk with a compressed ICC profile: its name, a zero, a zero for the method, the data.
    DeflatedProfile(Vec<u8>),
    /// The mark that codes are sRGB.
    Srgb,
    Gamma(Gamma),
    /// The primaries of linear light.
    Primaries(Primaries),
}

/// The exponent and the primaries of a PNG file, in units of 0.00001. Each may be missing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Gamma {
    pub(super) exponent: Option<u32>,
    /// x and y of white, red, green and blue.
    pub(super) primaries: Option<[u32; 8]>,
}

/// The meaning of the codes of an image.
#[derive(Debug, Clone)]
pub(super) enum Meaning {
    Srgb,
    /// Linear light with the primaries of sRGB.
    Linear,
    /// Other colours, that can be converted.
    Other(Arc<ColourSpace>),
}

/// The bits of a code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CodeDepth {
    Eight,
    Sixteen,
}

/// Colours other than sRGB.
#[derive(Debug)]
pub(super) struct ColourSpace {
    pub(super) conversion: Conversion,
    /// The name of the colours: that of their profile, or of the standard.
    name: String,
    /// The digest of the profile; `None` without one.
    profile: Option<Digest>,
    /// Whether they are shades of grey alone.
    is_grey: bool,
}

impl ColourSpace {
    /// Checks that an image with colours has no profile of grey.
    pub(super) fn check(&self, is_grey: bool) -> Result<(), String> {
        if self.is_grey && !is_grey {
            let name = &self.name;
            return Err(format!(
                "the ICC profile {name:?} is for grey, but the image has colours; {REMEDY}"
            ));
        }
        Ok(())
    }

    /// Note for images with these colours and this handling.
    pub(super) fn note(&self, handling: ColourHandling) -> ColourNote {
        ColourNote {
            from: self.name.clone(),
            profile: self.profile,
            handling,
        }
    }
}

impl ColourTag {
    /// The meaning of the codes.
    ///
    /// # Errors
    /// If the colour space is unknown or cannot be converted. The error names the colours and the remedy.
    pub(super) fn meaning(&self, depth: CodeDepth) -> Result<Meaning, String> {
        match self {
            Self::None | Self::Srgb => Ok(Meaning::Srgb),
            Self::CodePoints(points) => meaning_from_code_points(*points),
            Self::Profile(profile) => meaning_from_profile(profile),
            Self::DeflatedProfile(chunk) => meaning_from_profile(&inflated(chunk)?),
            Self::Gamma(gamma) => gamma.meaning(depth),
            Self::Primaries(primaries) => Ok(meaning_from_primaries(primaries)),
        }
    }

    /// The kind of the colour information, for files whose colours are not converted.
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

/// The meaning of linear light with these primaries.
fn meaning_from_primaries(primaries: &Primaries) -> Meaning {
    let Primaries {
        red,
        green,
        blue,
        white,
    } = primaries;
    let numbers = [red, green, blue, white].map(|[x, y]| format!("{x:.4} {y:.4}"));
    let [red, green, blue, white] = numbers;
    let linear = ToneCurve::Gamma(1.0);
    Meaning::Other(Arc::new(ColourSpace {
        conversion: Conversion::new(
            [linear.clone(), linear.clone(), linear],
            primaries.to_srgb(),
        ),
        name: format!("primaries {red}, {green}, {blue}, white {white}"),
        profile: None,
        is_grey: false,
    }))
}

/// The meaning of code points of H.273 (tables 2 to 4).
fn meaning_from_code_points(points: [u8; 4]) -> Result<Meaning, String> {
    let other = |name: &str, curve: ToneCurve, primaries: &Primaries| {
        let conversion =
            Conversion::new([curve.clone(), curve.clone(), curve], primaries.to_srgb());
        Ok(Meaning::Other(Arc::new(ColourSpace {
            conversion,
            name: name.to_owned(),
            profile: None,
            is_grey: false,
        })))
    };
    match points {
        [_, 16, ..] => Err(format!("the codes are PQ (HDR); {REMEDY}")),
        [_, 18, ..] => Err(format!("the codes are HLG (HDR); {REMEDY}")),
        [.., 0] => Err(format!(
            "the codes have the narrow range of video; {REMEDY}"
        )),
        [1, 13, 0, 1] => Ok(Meaning::Srgb),
        [1, 1, 0, 1] => other("BT.709", ToneCurve::Bt709, &Primaries::SRGB),
        [12, 13, 0, 1] => other("Display P3", ToneCurve::Srgb, &Primaries::DISPLAY_P3),
        [primaries, transfer, matrix, range] => Err(format!(
            "the colours have the code points {primaries}/{transfer}/{matrix}/{range} (cICP); 1/13/0/1 (sRGB), 1/1/0/1 (BT.709) or 12/13/0/1 (Display P3) expected: {REMEDY}"
        )),
    }
}

/// The meaning of codes by a profile. The last profiles are cached by their digests.
fn meaning_from_profile(profile: &[u8]) -> Result<Meaning, String> {
    static KNOWN: LazyLock<Recent<Digest, Meaning>> = LazyLock::new(|| Recent::new(CACHED));
    if profile.len() > MOST_PROFILE {
        return Err(too_large());
    }
    let digest = Digest::from_bytes(profile);
    KNOWN.get(&digest, || {
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

/// The profile in a PNG chunk. It is decompressed up to a bound, because a few thousand bytes may stand for millions.
fn inflated(chunk: &[u8]) -> Result<Vec<u8>, String> {
    let broken = || format!("the ICC profile cannot be decompressed; {REMEDY}");
    let end = chunk
        .iter()
        .position(|byte| *byte == 0)
        .ok_or_else(broken)?;
    let data = chunk.get(end + 2..).ok_or_else(broken)?;
    let mut profile = Vec::new();
    let bound = MOST_PROFILE as u64 + 1;
    flate2::read::ZlibDecoder::new(data)
        .take(bound)
        .read_to_end(&mut profile)
        .map_err(|_| broken())?;
    if profile.len() > MOST_PROFILE {
        return Err(too_large());
    }
    Ok(profile)
}

fn too_large() -> String {
    format!(
        "the ICC profile has more than {} MB; {REMEDY}",
        MOST_PROFILE >> 20
    )
}

impl Gamma {
    /// The exponent of sRGB's approximation, and how far another may be away.
    const SRGB: u32 = 45_455;
    const EXPONENT_OFF: u32 = 50;
    /// How far primaries may be away from those of sRGB; encoders round them in many ways (chosen).
    const PRIMARIES_OFF: u32 = 100;

    /// The exponent of linear light, which 8 bits do not hold.
    const LINEAR: u32 = 100_000;

    fn meaning(self, depth: CodeDepth) -> Result<Meaning, String> {
        let unit = |value: u32| f64::from(value) / 100_000.0;
        if let Some(primaries) = self.primaries.filter(|found| !Self::are_srgb(*found)) {
            let [white, red, green, blue] = [0, 2, 4, 6]
                .map(|at| format!("{}, {}", unit(primaries[at]), unit(primaries[at + 1])));
            return Err(format!(
                "the primaries of the image (cHRM) are not those of sRGB (white {white}, red {red}, green {green}, blue {blue}); {REMEDY}"
            ));
        }
        match self.exponent {
            Some(Self::LINEAR) if depth == CodeDepth::Sixteen => Ok(Meaning::Linear),
            Some(found) if found.abs_diff(Self::SRGB) > Self::EXPONENT_OFF => Err(format!(
                "the gamma of the image (gAMA) is {}; {} (sRGB) expected: {REMEDY}",
                unit(found),
                unit(Self::SRGB)
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
            .all(|(found, expected)| found.abs_diff(expected) <= Self::PRIMARIES_OFF)
    }
}

#[cfg(test)]
mod tests;
