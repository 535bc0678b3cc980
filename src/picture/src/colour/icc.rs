//! ICC profiles: [`Profile`] of curves and a matrix, [`InkProfile`] of four inks.

use moxcms::{ColorProfile, DataColorSpace, ProfileText, ToneReprCurve};

use super::conversion::Conversion;
use super::curve::ToneCurve;
use super::primaries::{IDENTITY, xyz_to_srgb};

/// Most letters of a profile's name in messages; chosen.
const LONGEST: usize = 60;

/// A profile of curves and a matrix, or of one curve for grey.
pub(super) struct Profile {
    /// The description of the profile.
    pub(super) name: String,
    pub(super) conversion: Conversion,
    /// Whether it is a profile of grey.
    pub(super) is_grey: bool,
}

impl Profile {
    /// Reads a profile (ICC.1:2022).
    ///
    /// # Errors
    /// If it is broken, or not of curves and a matrix. The error names it.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let header = Header::read(bytes)?;
        // A library would read the tables of printers, too, which may be large and are not needed.
        match &header.space {
            b"RGB " | b"GRAY" => {}
            b"CMYK" => return Err("the ICC profile is for CMYK".to_owned()),
            b"Lab " => return Err("the ICC profile is for Lab".to_owned()),
            space => {
                let space = readable(&String::from_utf8_lossy(space));
                return Err(format!(
                    "the ICC profile is for colours of the kind {space:?}"
                ));
            }
        }
        if header.has_tables {
            let problem =
                "the ICC profile converts colours by tables (A2B), not by curves and a matrix";
            return Err(problem.to_owned());
        }
        if &header.connection != b"XYZ " {
            return Err("the connection space of the ICC profile is not XYZ".to_owned());
        }
        let profile = parsed(bytes)?;
        let name = name(&profile);
        let lacks = |what: &str| format!("the ICC profile {name:?} has no {what}");
        let curve = |curve: &Option<ToneReprCurve>| {
            let curve = curve.as_ref().ok_or_else(|| lacks("curve"))?;
            ToneCurve::from_profile(curve)
        };
        let is_grey = profile.color_space == DataColorSpace::Gray;
        let (curves, matrix) = if is_grey {
            let grey = curve(&profile.gray_trc)?;
            ([grey.clone(), grey.clone(), grey], IDENTITY)
        } else {
            let curves = [
                curve(&profile.red_trc)?,
                curve(&profile.green_trc)?,
                curve(&profile.blue_trc)?,
            ];
            let [r, g, b] = [
                profile.red_colorant,
                profile.green_colorant,
                profile.blue_colorant,
            ];
            let matrix = [[r.x, g.x, b.x], [r.y, g.y, b.y], [r.z, g.z, b.z]];
            (curves, xyz_to_srgb(matrix))
        };
        let numbers = matrix.as_flattened();
        if numbers.iter().any(|number| !number.is_finite()) || numbers.iter().all(|n| *n == 0.0) {
            return Err(lacks("matrix"));
        }
        Ok(Self {
            name,
            conversion: Conversion::new(curves, matrix),
            is_grey,
        })
    }
}

/// A profile of cyan, magenta, yellow and black.
pub(super) struct InkProfile {
    /// The description of the profile.
    pub(super) name: String,
    pub(super) profile: ColorProfile,
}

impl InkProfile {
    /// Reads a profile (ICC.1:2022).
    ///
    /// # Errors
    /// If it is broken, or not of these inks.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let header = Header::read(bytes)?;
        if &header.space != b"CMYK" {
            return Err("the image is CMYK, but its ICC profile is not for CMYK".to_owned());
        }
        let profile = parsed(bytes)?;
        Ok(Self {
            name: name(&profile),
            profile,
        })
    }
}

/// All parts of a profile.
fn parsed(bytes: &[u8]) -> Result<ColorProfile, String> {
    ColorProfile::new_from_slice(bytes)
        .map_err(|e| format!("the ICC profile is broken: {}", readable(&e.to_string())))
}

/// The fields at the head of a profile that decide whether it can be used.
struct Header {
    space: [u8; 4],
    connection: [u8; 4],
    /// Whether it has tables from codes to the connection space.
    has_tables: bool,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Self, &'static str> {
        Self::fields(bytes).ok_or("the ICC profile is broken: it ends too early")
    }

    fn fields(bytes: &[u8]) -> Option<Self> {
        let four = |at: usize| bytes.get(at..)?.first_chunk::<4>().copied();
        let tags = u32::from_be_bytes(four(128)?) as usize;
        // Each tag takes 12 bytes of the profile.
        let has_tables = (0..tags.min(bytes.len() / 12))
            .map_while(|tag| four(132 + 12 * tag))
            .into_iter()
            .any(|tag| {
                [
                    b"A2B0", b"A2B1", b"A2B2", b"D2B0", b"D2B1", b"D2B2", b"D2B3",
                ]
                .contains(&&tag)
            });
        Some(Self {
            space: four(16)?,
            connection: four(20)?,
            has_tables,
        })
    }
}

/// The description of a profile.
fn name(profile: &ColorProfile) -> String {
    let text = match &profile.description {
        None => "",
        Some(ProfileText::PlainString(text)) => text,
        Some(ProfileText::Localizable(texts)) => texts.first().map_or("", |text| &text.value),
        Some(ProfileText::Description(text)) if text.ascii_string.is_empty() => {
            &text.unicode_string
        }
        Some(ProfileText::Description(text)) => &text.ascii_string,
    };
    match readable(text) {
        name if name.is_empty() => "without a name".to_owned(),
        name => name,
    }
}

/// The printable characters of a text, cut to [`LONGEST`] letters.
fn readable(text: &str) -> String {
    let text: String = text
        .chars()
        .filter(|letter| !letter.is_control())
        .take(LONGEST)
        .collect();
    text.trim().to_owned()
}
