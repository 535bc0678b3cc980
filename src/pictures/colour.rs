//! Colour space of an image: the colour information in its file ([`ColourTag`]) and its interpretation ([`CodeMeaning`]).
//!
//! A PNG file may have several kinds of colour information. In order of priority (PNG specification, third edition,
//! section 4.3): code points (`cICP`), an ICC profile, the chunk `sRGB`, gamma and primaries (`gAMA`, `cHRM`). Without
//! any, codes are sRGB. Other formats have only profiles.
//!
//! Conversion of decoded video to sRGB: [`StatedColours`] and [`FrameConversion`].

pub(super) mod conversion;
mod icc;
pub(crate) mod inks;
mod space;
#[cfg(test)]
mod tests;

use std::io::Read as _;
use std::sync::{Arc, LazyLock};

use self::icc::IccProfile;
use self::space::{REMEDY, rgb_space};
use conversion::{Primaries, ToneCurve};
use darkqa_base::types::values::Recent;
use darkqa_base::types::{ColourHandling, Digest};
use space::primaries_number;

pub(super) use self::inks::Inks;
pub(super) use self::space::{CodeDepth, CodeMeaning, ColourSpace};
pub(super) use space::CodePoints;

/// Maximum size of an ICC profile, in bytes; chosen. Matrix profiles have a few thousand bytes, printer profiles up to
/// a few million.
const MAX_PROFILE_BYTES: usize = 4 << 20;

/// Number of profiles whose conversions are cached; chosen. The images of a data set usually share one profile.
const CACHED_PROFILES: usize = 16;

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

impl ColourTag {
    /// Interprets the colour information for codes of this depth.
    ///
    /// # Errors
    /// If the colour space is unknown or cannot be converted. The error names the colour space and the remedy.
    pub(super) fn meaning(&self, depth: CodeDepth) -> Result<CodeMeaning, String> {
        match self {
            Self::None | Self::Srgb => Ok(CodeMeaning::Srgb),
            Self::CodePoints(points) => meaning_from_code_points(*points, depth),
            Self::Profile(profile) => meaning_from_profile(profile, depth),
            Self::DeflatedProfile(chunk) => meaning_from_profile(&decompress_profile(chunk)?, depth),
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
fn meaning_from_primaries(primaries: &Primaries) -> CodeMeaning {
    let Primaries { red, green, blue, white } = primaries;
    let [red, green, blue, white] = [red, green, blue, white].map(|[x, y]| format!("{x:.4} {y:.4}"));
    let name = format!("primaries {red}, {green}, {blue}, white {white}");
    CodeMeaning::Other(Arc::new(rgb_space(name, ToneCurve::Gamma(1.0), primaries, ColourHandling::Converted)))
}

/// Interprets code points of H.273: primaries, transfer, matrix, and 1 for the full range.
fn meaning_from_code_points(points: [u8; 4], depth: CodeDepth) -> Result<CodeMeaning, String> {
    let [primaries, transfer, matrix, range] = points;
    if range == 0 {
        return Err(format!("the codes have the narrow range of video; {REMEDY}"));
    }
    if matrix != 0 || range != 1 {
        return Err(format!(
            "the colours have the code points {primaries}/{transfer}/{matrix}/{range} (cICP); matrix 0 (RGB) and range 1 (full) expected: {REMEDY}"
        ));
    }
    let points = CodePoints { primaries, transfer };
    points.meaning(depth).map_err(|problem| format!("{problem} (cICP {primaries}/{transfer}); {REMEDY}"))
}

/// Interprets an ICC profile. The most recent profiles are cached by their digests.
///
/// Of HDR profiles, which convert by tables, the code points are used.
fn meaning_from_profile(profile: &[u8], depth: CodeDepth) -> Result<CodeMeaning, String> {
    static CACHE: LazyLock<Recent<Digest, CodeMeaning>> = LazyLock::new(|| Recent::new(CACHED_PROFILES));
    if profile.len() > MAX_PROFILE_BYTES {
        return Err(profile_too_large());
    }
    if let Some(points @ [_, 16 | 18, ..]) = icc::code_points(profile) {
        return meaning_from_code_points(points, depth);
    }
    let digest = Digest::from_bytes(profile);
    CACHE.get(&digest, || {
        let IccProfile { name, conversion, is_grey, is_video } =
            IccProfile::read(profile).map_err(|problem| format!("{problem}; {REMEDY}"))?;
        if conversion.is_identity() {
            return Ok(CodeMeaning::Srgb);
        }
        Ok(CodeMeaning::Other(Arc::new(ColourSpace {
            conversion,
            name,
            profile: Some(digest),
            is_grey,
            handling: if is_video { ColourHandling::Video } else { ColourHandling::Converted },
        })))
    })
}

/// Decompresses the profile in a PNG chunk `iCCP`, up to [`MAX_PROFILE_BYTES`], because a small chunk may expand to any
/// size.
fn decompress_profile(chunk: &[u8]) -> Result<Vec<u8>, String> {
    let end = chunk.iter().position(|byte| *byte == 0).ok_or_else(broken_compression)?;
    let data = chunk.get(end + 2..).ok_or_else(broken_compression)?;
    let mut profile = Vec::new();
    let bound = MAX_PROFILE_BYTES as u64 + 1;
    flate2::read::ZlibDecoder::new(data).take(bound).read_to_end(&mut profile).map_err(|_| broken_compression())?;
    if profile.len() > MAX_PROFILE_BYTES {
        return Err(profile_too_large());
    }
    Ok(profile)
}

fn broken_compression() -> String {
    format!("the ICC profile cannot be decompressed; {REMEDY}")
}

fn profile_too_large() -> String {
    format!("the ICC profile has more than {} MB; {REMEDY}", MAX_PROFILE_BYTES >> 20)
}

impl Gamma {
    /// Exponents with their transfers in H.273: 1/2.2 for sRGB, 1/1.961 for BT.709 as ffmpeg up to version 7 writes it,
    /// 1/2.8, and linear light.
    const TRANSFERS: [(u32, u8); 4] = [(Self::SRGB, 13), (50_994, 1), (35_714, 5), (100_000, 8)];
    /// Exponent of the approximation of sRGB, 1/2.2.
    const SRGB: u32 = 45_455;
    /// Tolerance for exponents, because encoders round them differently (chosen).
    const TOLERANCE: u32 = 50;

    fn meaning(self, depth: CodeDepth) -> Result<CodeMeaning, String> {
        let primaries = match self.primaries {
            None => 1,
            Some(stated) => primaries_number(stated).ok_or_else(|| unknown_primaries(stated))?,
        };
        let transfer = match self.exponent {
            // Wide primaries alone are no description: ffmpeg 5.1 writes HLG and PQ so.
            None => 2,
            Some(found) => Self::TRANSFERS
                .iter()
                .find(|(exponent, _)| found.abs_diff(*exponent) <= Self::TOLERANCE)
                .map(|(_, transfer)| *transfer)
                .ok_or_else(|| {
                    format!(
                        "the gamma of the image (gAMA) is {}; {} (sRGB) expected: {REMEDY}",
                        png_number(found),
                        png_number(Self::SRGB)
                    )
                })?,
        };
        CodePoints { primaries, transfer }.meaning(depth).map_err(|problem| format!("{problem} (gAMA, cHRM); {REMEDY}"))
    }
}

/// The error for primaries without a number in H.273.
fn unknown_primaries(stated: [u32; 8]) -> String {
    let [white, red, green, blue] =
        [0, 2, 4, 6].map(|i| format!("{}, {}", png_number(stated[i]), png_number(stated[i + 1])));
    format!(
        "the primaries of the image (cHRM) are not those of sRGB (white {white}, red {red}, green {green}, blue {blue}); {REMEDY}"
    )
}

/// Converts a number that a PNG file states in units of 0.00001.
fn png_number(stated: u32) -> f64 {
    f64::from(stated) / 100_000.0
}

/// Primaries and transfer that a video states, by the numbers of ITU-T H.273, tables 2 and 3. The same rules hold for
/// images: the numbers in `cICP` of a PNG file have the same meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatedColours {
    /// Number of the primaries; 2 if they are not stated.
    pub primaries: u8,
    /// Number of the transfer; 2 if it is not stated.
    pub transfer: u8,
}

/// Conversion of RGB codes of 16 bits to sRGB codes of 8 bits.
#[derive(Debug, Clone)]
pub struct FrameConversion {
    space: Arc<ColourSpace>,
    /// Light of each code, per channel.
    tables: [Vec<f64>; 3],
}

impl StatedColours {
    /// The conversion of RGB codes of full range; `None` if they are taken as sRGB codes.
    ///
    /// # Errors
    /// If these colours are not converted. The error names the reason, without a remedy.
    pub fn conversion(self) -> Result<Option<FrameConversion>, String> {
        let points = CodePoints { primaries: self.primaries, transfer: self.transfer };
        // Frames have 8 bits at the end, in which linear light has too few codes.
        match points.meaning(CodeDepth::Eight)? {
            CodeMeaning::Srgb | CodeMeaning::Linear => Ok(None),
            CodeMeaning::Other(space) => {
                Ok(Some(FrameConversion { tables: space.conversion.tables(u16::MAX.into()), space }))
            }
        }
    }
}

impl FrameConversion {
    /// Name of the colours, as `HLG (HDR), BT.2020`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.space.name()
    }

    /// True for HDR, where light above diffuse white becomes white.
    #[must_use]
    pub fn is_hdr(&self) -> bool {
        self.space.handling == ColourHandling::Clipped
    }

    /// Converts interleaved RGB samples. Also returns the number of pixels with a channel above white.
    #[must_use]
    pub fn convert(&self, samples: &[u16]) -> (Vec<u8>, usize) {
        let conversion = &self.space.conversion;
        let mut clipped = 0;
        let mut converted = Vec::with_capacity(samples.len());
        for pixel in samples.as_chunks::<3>().0 {
            let lights = [0, 1, 2].map(|i| self.tables[i][usize::from(pixel[i])]);
            let (codes, is_clipped) = conversion.encode_8(lights);
            clipped += usize::from(is_clipped);
            converted.extend(codes);
        }
        (converted, clipped)
    }
}
