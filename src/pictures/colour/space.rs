//! Colour spaces of images: [`CodeMeaning`] and [`ColourSpace`].
//!
//! Colours that PNG files and videos state by the numbers of ITU-T H.273: [`CodePoints`].
//!
//! Codes of video are taken as they are displayed: as sRGB codes. Cameras and players treat the curve of BT.709 as that
//! of the camera, not as the inverse of a display's, and the same frame saved as JPEG, which states no curve, has the
//! same codes.

use std::sync::Arc;

use super::conversion::{Conversion, Ootf, Primaries, ToneCurve, WHITE_NITS};
use darkqa_base::types::{ColourHandling, ColourNote, Digest};

/// Remedy for colours that cannot be converted.
pub(super) const REMEDY: &str = "convert it to sRGB first, or take its codes as sRGB with --decode colour=ignore";

/// Interpretation of the codes of an image.
#[derive(Debug, Clone)]
pub(crate) enum CodeMeaning {
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

/// Primaries and transfer of RGB codes of full range, by the numbers of ITU-T H.273, tables 2 and 3.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CodePoints {
    pub(crate) primaries: u8,
    pub(crate) transfer: u8,
}

/// Primaries that a file states.
#[derive(Debug, Clone, Copy)]
enum StatedPrimaries {
    /// None.
    Unspecified,
    /// Those of BT.709 or of standard-definition television. The latter are taken as those of BT.709, as players do:
    /// files are often tagged so by the size of the picture alone.
    Television,
    /// Others, with their name.
    Other(&'static str, Primaries),
}

/// Handling of a transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StatedTransfer {
    Unspecified,
    /// sRGB, or the gamma of 2.2 that approximates it.
    Srgb,
    /// A curve of video cameras.
    Video,
    /// A display gamma of 2.8.
    Gamma28,
    Linear,
    Pq,
    Hlg,
}

impl CodePoints {
    /// Interpretation of RGB codes with these colours.
    ///
    /// # Errors
    /// If the codes cannot be converted. The error names the reason, without a remedy.
    pub(crate) fn meaning(self, depth: CodeDepth) -> Result<CodeMeaning, String> {
        let (primaries, transfer) = (self.stated_primaries()?, self.stated_transfer()?);
        let space =
            |name, curve, given, handling| Ok(CodeMeaning::Other(Arc::new(rgb_space(name, curve, &given, handling))));
        let (name, given) = match primaries {
            StatedPrimaries::Unspecified | StatedPrimaries::Television => (None, Primaries::SRGB),
            StatedPrimaries::Other(name, given) => (Some(name), given),
        };
        match (transfer, name) {
            (StatedTransfer::Pq | StatedTransfer::Hlg, _) => Ok(CodeMeaning::Other(Arc::new(hdr(transfer, primaries)))),
            (StatedTransfer::Linear, None) if depth == CodeDepth::Sixteen => Ok(CodeMeaning::Linear),
            (StatedTransfer::Linear, None) => Err("the codes are linear light in 8 bits; 16 bits expected".to_owned()),
            (StatedTransfer::Linear, Some(name)) => {
                Err(format!("the codes are linear light with {name} primaries; those of sRGB expected"))
            }
            (StatedTransfer::Gamma28, name) => {
                let name = name.map_or("gamma 2.8".to_owned(), |name| format!("gamma 2.8, {name}"));
                space(name, ToneCurve::Gamma(2.8), given, ColourHandling::Converted)
            }
            (_, None) => Ok(CodeMeaning::Srgb),
            (StatedTransfer::Unspecified, Some(name)) => {
                Err(format!("the primaries are {name}, but no transfer is stated: the codes may be HDR"))
            }
            (StatedTransfer::Srgb, Some(name)) => {
                space(name.to_owned(), ToneCurve::Srgb, given, ColourHandling::Converted)
            }
            (StatedTransfer::Video, Some(name)) => {
                space(name.to_owned(), ToneCurve::Srgb, given, ColourHandling::Video)
            }
        }
    }

    fn stated_primaries(self) -> Result<StatedPrimaries, String> {
        Ok(match self.primaries {
            2 => StatedPrimaries::Unspecified,
            1 | 5 | 6 | 7 | 22 => StatedPrimaries::Television,
            4 => StatedPrimaries::Other("BT.470 M", Primaries::BT470_M),
            8 => StatedPrimaries::Other("film", Primaries::FILM),
            9 => StatedPrimaries::Other("BT.2020", Primaries::BT2020),
            11 => StatedPrimaries::Other("DCI P3", Primaries::DCI_P3),
            12 => StatedPrimaries::Other("Display P3", Primaries::DISPLAY_P3),
            10 => return Err("the codes are XYZ (SMPTE ST 428)".to_owned()),
            other => {
                return Err(format!("the primaries have the unknown number {other} of H.273"));
            }
        })
    }

    fn stated_transfer(self) -> Result<StatedTransfer, String> {
        Ok(match self.transfer {
            2 => StatedTransfer::Unspecified,
            4 | 13 => StatedTransfer::Srgb,
            5 => StatedTransfer::Gamma28,
            // BT.709, SMPTE 170M and 240M, xvYCC, BT.1361, and BT.2020 of 10 and 12 bits.
            1 | 6 | 7 | 11 | 12 | 14 | 15 => StatedTransfer::Video,
            8 => StatedTransfer::Linear,
            16 => StatedTransfer::Pq,
            18 => StatedTransfer::Hlg,
            9 | 10 => return Err("the codes are logarithmic".to_owned()),
            17 => return Err("the codes are those of digital cinema (SMPTE ST 428)".to_owned()),
            other => {
                return Err(format!("the transfer has the unknown number {other} of H.273"));
            }
        })
    }
}

/// The colour space of PQ or HLG codes (BT.2100). Without stated primaries, they are those of BT.2020, the only ones of
/// BT.2100.
fn hdr(transfer: StatedTransfer, primaries: StatedPrimaries) -> ColourSpace {
    let (name, given) = match primaries {
        StatedPrimaries::Unspecified => ("BT.2020", Primaries::BT2020),
        StatedPrimaries::Television => ("BT.709", Primaries::SRGB),
        StatedPrimaries::Other(name, given) => (name, given),
    };
    let (kind, curve, ootf) = match transfer {
        StatedTransfer::Hlg => ("HLG", ToneCurve::Hlg, Some(Ootf::new(given.luminance()))),
        _ => ("PQ", ToneCurve::Pq, None),
    };
    let name = format!("{kind} (HDR), {name}");
    let mut space = rgb_space(name, curve, &given, ColourHandling::Clipped);
    space.conversion.ootf = ootf;
    space
}

/// The number in H.273 of the primaries that a PNG file states: x and y of white, red, green and blue, in units of
/// 0.00001. `None` if they are not among those with a number.
pub(super) fn primaries_number(stated: [u32; 8]) -> Option<u8> {
    /// Tolerance, because encoders round primaries differently (chosen).
    const TOLERANCE: u32 = 100;
    NUMBERED
        .iter()
        .find(|(_, primaries)| {
            let Primaries { red, green, blue, white } = primaries;
            let numbers = [white, red, green, blue].into_iter().flatten();
            numbers.zip(stated).all(|(number, stated)| ((number * 1e5).round() as u32).abs_diff(stated) <= TOLERANCE)
        })
        .map(|(number, _)| *number)
}

/// Primaries by their numbers in H.273, table 2.
const NUMBERED: [(u8, Primaries); 9] = [
    (1, Primaries::SRGB),
    (4, Primaries::BT470_M),
    (5, Primaries::BT470_BG),
    (6, Primaries::SMPTE_170M),
    (8, Primaries::FILM),
    (9, Primaries::BT2020),
    (11, Primaries::DCI_P3),
    (12, Primaries::DISPLAY_P3),
    (22, Primaries::EBU_3213),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn meaning(primaries: u8, transfer: u8) -> Result<CodeMeaning, String> {
        CodePoints { primaries, transfer }.meaning(CodeDepth::Sixteen)
    }

    /// The 16-bit sRGB codes of one colour.
    fn converted(primaries: u8, transfer: u8, colour: [f64; 3]) -> [f64; 3] {
        let mut codes = colour.map(|value| (value * 65_535.0).round() as u16);
        if let CodeMeaning::Other(space) = meaning(primaries, transfer).unwrap() {
            space.conversion.convert_16(&mut codes);
        }
        codes.map(|code| f64::from(code) / 65_535.0 * 255.0)
    }

    fn assert_near(found: [f64; 3], expected: [f64; 3]) {
        let is_near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.6);
        assert!(is_near, "{found:?}, not {expected:?}");
    }

    #[test]
    fn codes_of_video_are_taken_as_displayed() {
        for primaries in [1, 2, 5, 6, 7, 22] {
            for transfer in [1, 2, 4, 6, 7, 11, 12, 13, 14, 15] {
                let found = meaning(primaries, transfer);
                assert!(matches!(found, Ok(CodeMeaning::Srgb)), "{primaries}/{transfer}");
            }
        }
    }

    /// BT.2020 of sRGB's red, green and blue in linear light (BT.2087, inverse), and the same by the curve of sRGB.
    #[test]
    fn wide_primaries_are_converted() {
        let red = [0.627_404, 0.069_097, 0.016_391].map(|light: f64| 1.055 * light.powf(1.0 / 2.4) - 0.055);
        for (transfer, handling) in [
            (1, ColourHandling::Video),
            (14, ColourHandling::Video),
            (15, ColourHandling::Video),
            (13, ColourHandling::Converted),
            (4, ColourHandling::Converted),
        ] {
            assert_near(converted(9, transfer, red), [255.0, 0.0, 0.0]);
            let Ok(CodeMeaning::Other(space)) = meaning(9, transfer) else { panic!("{transfer}") };
            assert_eq!(space.handling, handling);
        }
        for primaries in [4, 8, 9, 11, 12] {
            assert_near(converted(primaries, 1, [0.5; 3]), [127.5; 3]);
            assert!(meaning(primaries, 2).unwrap_err().contains("may be HDR"));
        }
    }

    /// Levels of BT.2408-7, table 1: diffuse white of 203 cd/m² is 58 % in PQ and 75 % in HLG; a grey card of 18 % (26
    /// cd/m²) is 38 %.
    #[test]
    fn hdr_has_the_reference_levels() {
        let grey = 255.0 * (1.055 * (26.0_f64 / 203.0).powf(1.0 / 2.4) - 0.055);
        for primaries in [1, 2, 9, 12] {
            for (transfer, white, card) in [(16, 0.580_69, 0.3797), (18, 0.75, 0.38)] {
                assert_near(converted(primaries, transfer, [white; 3]), [255.0; 3]);
                assert_near(converted(primaries, transfer, [0.0; 3]), [0.0; 3]);
                let [found, ..] = converted(primaries, transfer, [card; 3]);
                assert!((found - grey).abs() < 1.5, "{transfer}: {found}, not {grey}");
                // Highlights are clipped, and codes below white are not.
                assert_near(converted(primaries, transfer, [1.0; 3]), [255.0; 3]);
                let [below, ..] = converted(primaries, transfer, [white - 0.02; 3]);
                assert!(below < 250.0, "{below}");
            }
        }
    }

    #[test]
    fn gamma_of_2_8_is_converted() {
        let code = 255.0 * (1.055 * 0.5_f64.powf(2.8 / 2.4) - 0.055);
        assert_near(converted(5, 5, [0.5; 3]), [code; 3]);
        assert_near(converted(9, 5, [0.5; 3]), [code; 3]);
    }

    #[test]
    fn linear_light_needs_16_bits_and_the_primaries_of_srgb() {
        assert!(matches!(meaning(1, 8), Ok(CodeMeaning::Linear)));
        assert!(meaning(9, 8).unwrap_err().contains("BT.2020"));
        let linear = CodePoints { primaries: 1, transfer: 8 };
        assert!(linear.meaning(CodeDepth::Eight).is_err());
    }

    #[test]
    fn unknown_numbers_are_refused() {
        for (primaries, transfer, expected) in [
            (1, 9, "logarithmic"),
            (1, 17, "digital cinema"),
            (10, 13, "XYZ"),
            (3, 13, "primaries have the unknown number 3"),
            (1, 19, "transfer has the unknown number 19"),
        ] {
            let problem = meaning(primaries, transfer).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
    }

    #[test]
    fn primaries_of_png_have_numbers() {
        let bt2020 = [31_270, 32_900, 70_800, 29_200, 17_000, 79_700, 13_100, 4_600];
        assert_eq!(primaries_number(bt2020), Some(9));
        let smpte = [31_270, 32_900, 63_000, 34_000, 31_000, 59_500, 15_500, 7_000];
        assert_eq!(primaries_number(smpte), Some(6));
        assert_eq!(primaries_number([31_270, 32_900, 64_000, 33_000, 21_000, 71_000, 15_000, 6_000]), None);
    }
}
