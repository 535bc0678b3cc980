//! ICC profiles: matrix profiles for RGB and grey ([`IccProfile`]), and CMYK profiles ([`InkProfile`]).

use moxcms::{ColorProfile, DataColorSpace, ProfileText, ToneReprCurve};

use super::conversion::{Conversion, IDENTITY, ToneCurve, xyz_to_srgb};

/// Maximum number of characters of a profile's name in messages; chosen.
const MAX_NAME: usize = 60;

/// A profile of tone curves and a matrix, or of one curve for grey.
pub(super) struct IccProfile {
    /// Description text of the profile.
    pub(super) name: String,
    pub(super) conversion: Conversion,
    /// True for a grey profile.
    pub(super) is_grey: bool,
    /// True if the profile has the curve of video cameras. It is replaced by that of sRGB, because codes of video are
    /// taken as displayed.
    pub(super) is_video: bool,
}

impl IccProfile {
    /// Reads a profile (ICC.1:2022).
    ///
    /// # Errors
    /// If it is broken, or not a matrix or grey profile.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let header = ProfileHeader::read(bytes)?;
        // The header is checked first, because the library would also parse printer tables, which may be large.
        match &header.space {
            b"RGB " | b"GRAY" => {}
            b"CMYK" => return Err("the ICC profile is for CMYK".to_owned()),
            b"Lab " => return Err("the ICC profile is for Lab".to_owned()),
            space => {
                let space = readable(&String::from_utf8_lossy(space));
                return Err(format!("the ICC profile is for colours of the kind {space:?}"));
            }
        }
        if header.has_tables {
            let problem = "the ICC profile converts colours by tables (A2B), not by curves and a matrix";
            return Err(problem.to_owned());
        }
        if &header.connection != b"XYZ " {
            return Err("the connection space of the ICC profile is not XYZ".to_owned());
        }
        let profile = parse(bytes)?;
        let name = profile_name(&profile);
        let is_grey = profile.color_space == DataColorSpace::Gray;
        let (curves, matrix) = if is_grey {
            let grey = tone_curve(&name, profile.gray_trc.as_ref())?;
            ([grey.clone(), grey.clone(), grey], IDENTITY)
        } else {
            let curves = [
                tone_curve(&name, profile.red_trc.as_ref())?,
                tone_curve(&name, profile.green_trc.as_ref())?,
                tone_curve(&name, profile.blue_trc.as_ref())?,
            ];
            let [r, g, b] = [profile.red_colorant, profile.green_colorant, profile.blue_colorant];
            let matrix = [[r.x, g.x, b.x], [r.y, g.y, b.y], [r.z, g.z, b.z]];
            (curves, xyz_to_srgb(matrix))
        };
        let numbers = matrix.as_flattened();
        if numbers.iter().any(|number| !number.is_finite()) || numbers.iter().all(|n| *n == 0.0) {
            return Err(missing(&name, "matrix"));
        }
        let is_video = curves.iter().all(ToneCurve::is_video);
        let curves = if is_video { [ToneCurve::Srgb, ToneCurve::Srgb, ToneCurve::Srgb] } else { curves };
        Ok(Self { name, conversion: Conversion::new(curves, matrix), is_grey, is_video })
    }
}

/// A profile of cyan, magenta, yellow and black.
pub(super) struct InkProfile {
    /// Description text of the profile.
    pub(super) name: String,
    pub(super) profile: ColorProfile,
}

impl InkProfile {
    /// Reads a profile (ICC.1:2022).
    ///
    /// # Errors
    /// If it is broken, or not a CMYK profile.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let header = ProfileHeader::read(bytes)?;
        if &header.space != b"CMYK" {
            return Err("the image is CMYK, but its ICC profile is not for CMYK".to_owned());
        }
        let profile = parse(bytes)?;
        Ok(Self { name: profile_name(&profile), profile })
    }
}

/// The error for a profile without a required part.
fn missing(name: &str, part: &str) -> String {
    format!("the ICC profile {name:?} has no {part}")
}

/// Converts a tone curve of the profile `name`, which must have it.
fn tone_curve(name: &str, curve: Option<&ToneReprCurve>) -> Result<ToneCurve, String> {
    ToneCurve::from_profile(curve.ok_or_else(|| missing(name, "curve"))?)
}

fn parse(bytes: &[u8]) -> Result<ColorProfile, String> {
    ColorProfile::new_from_slice(bytes).map_err(|e| format!("the ICC profile is broken: {}", readable(&e.to_string())))
}

/// The code points of H.273 in a profile for RGB (ICC.1:2022, section 9.2.17): primaries, transfer, matrix and range.
pub(super) fn code_points(profile: &[u8]) -> Option<[u8; 4]> {
    if four_bytes(profile, 16)? != *b"RGB " {
        return None;
    }
    let tags = u32::from_be_bytes(four_bytes(profile, 128)?) as usize;
    let entry = (0..tags.min(profile.len() / 12))
        .map(|tag| 132 + 12 * tag)
        .find(|entry| four_bytes(profile, *entry).as_ref() == Some(b"cicp"))?;
    let start = u32::from_be_bytes(four_bytes(profile, entry + 4)?) as usize;
    // The type and four reserved bytes come first.
    four_bytes(profile, start.checked_add(8)?)
}

/// Fields of a profile that decide if it is supported.
struct ProfileHeader {
    /// Signature of the colour space of the codes.
    space: [u8; 4],
    /// Signature of the profile connection space.
    connection: [u8; 4],
    /// True if the profile has tables from codes to the connection space.
    has_tables: bool,
}

impl ProfileHeader {
    fn read(bytes: &[u8]) -> Result<Self, &'static str> {
        Self::fields(bytes).ok_or("the ICC profile is broken: it ends too early")
    }

    fn fields(bytes: &[u8]) -> Option<Self> {
        let tags = u32::from_be_bytes(four_bytes(bytes, 128)?) as usize;
        // Each entry of the tag table has 12 bytes.
        let has_tables = (0..tags.min(bytes.len() / 12))
            .map_while(|tag| four_bytes(bytes, 132 + 12 * tag))
            .into_iter()
            .any(|tag| [b"A2B0", b"A2B1", b"A2B2", b"D2B0", b"D2B1", b"D2B2", b"D2B3"].contains(&&tag));
        Some(Self { space: four_bytes(bytes, 16)?, connection: four_bytes(bytes, 20)?, has_tables })
    }
}

fn four_bytes(bytes: &[u8], at: usize) -> Option<[u8; 4]> {
    bytes.get(at..)?.first_chunk::<4>().copied()
}

/// The description text of a profile.
fn profile_name(profile: &ColorProfile) -> String {
    let text = match &profile.description {
        None => "",
        Some(ProfileText::PlainString(text)) => text,
        Some(ProfileText::Localizable(texts)) => texts.first().map_or("", |text| &text.value),
        Some(ProfileText::Description(text)) if text.ascii_string.is_empty() => &text.unicode_string,
        Some(ProfileText::Description(text)) => &text.ascii_string,
    };
    match readable(text) {
        name if name.is_empty() => "without a name".to_owned(),
        name => name,
    }
}

/// The printable characters of a text, cut to [`MAX_NAME`] characters.
fn readable(text: &str) -> String {
    let text: String = text.chars().filter(|character| !character.is_control()).take(MAX_NAME).collect();
    text.trim().to_owned()
}
