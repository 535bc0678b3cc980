//! Conversion of images in cyan, magenta, yellow and black (CMYK) to sRGB: [`Inks`].

mod table;

use std::sync::{Arc, LazyLock};

use self::table::InkTable;
use super::icc::InkProfile;
use super::{CACHED_PROFILES, ColourTag, MAX_PROFILE_BYTES, REMEDY, profile_too_large};
use crate::decode_rule::ColourRule;
use darkqa_base::types::values::Recent;
use darkqa_base::types::{ColourHandling, ColourNote, Digest};

/// Name of the colours of an image file without a profile, for its note.
const WITHOUT_PROFILE: &str = "CMYK without a profile";

/// Conversion of an image from CMYK to sRGB.
#[derive(Debug, Clone)]
pub(crate) enum Inks {
    /// Converts by a formula: each coloured ink absorbs its share of red, green or blue, and black absorbs its share of
    /// all three.
    Formula(ColourNote),
    /// Converts by the table of an ICC profile.
    Profile(Arc<CmykProfile>),
}

/// Table of a CMYK profile, with the profile's name and digest.
#[derive(Debug)]
pub(crate) struct CmykProfile {
    table: InkTable,
    name: String,
    digest: Digest,
}

impl Inks {
    /// Converts by the profile of the image file; by the formula if the file has none, or if the profile is ignored.
    ///
    /// # Errors
    /// If the profile is not for CMYK, or is broken. The message names the profile and the flag that ignores it.
    pub(crate) fn new(tag: &ColourTag, rule: ColourRule) -> Result<Self, String> {
        match (tag, rule) {
            (ColourTag::Profile(profile), ColourRule::Convert | ColourRule::Clip) => {
                cached_profile(profile).map(Self::Profile)
            }
            (ColourTag::Profile(_), ColourRule::Ignore) => Ok(Self::formula("CMYK, whose profile is ignored")),
            _ => Ok(Self::formula(WITHOUT_PROFILE)),
        }
    }

    /// Converts by the formula. `from` is the name of the colours in the note.
    fn formula(from: &str) -> Self {
        Self::Formula(ColourNote { from: from.to_owned(), profile: None, handling: ColourHandling::Converted })
    }

    /// Note about the conversion.
    pub(crate) fn note(&self) -> ColourNote {
        match self {
            Self::Formula(note) => note.clone(),
            Self::Profile(profile) => ColourNote {
                from: profile.name.clone(),
                profile: Some(profile.digest),
                handling: ColourHandling::Converted,
            },
        }
    }

    /// Converts pixels of four ink amounts, from 0 (none) to 255 (full), to sRGB codes of red, green and blue.
    pub(crate) fn srgb(&self, inks: &[u8]) -> Vec<u8> {
        let (pixels, _) = inks.as_chunks::<4>();
        match self {
            Self::Formula(_) => pixels.iter().flat_map(|inks| srgb_by_formula(*inks)).collect(),
            Self::Profile(profile) => {
                // Consecutive pixels with the same inks are converted once.
                let (mut last_inks, mut last_srgb) = ([0; 4], profile.table.srgb([0; 4]));
                pixels
                    .iter()
                    .flat_map(|inks| {
                        if last_inks != *inks {
                            last_inks = *inks;
                            last_srgb = profile.table.srgb(*inks);
                        }
                        last_srgb
                    })
                    .collect()
            }
        }
    }
}

/// Converts inks of unknown colour to sRGB codes (PostScript Language Reference, third edition, section 7.2.4, with
/// products in place of sums, as in programs that use libjpeg).
fn srgb_by_formula([cyan, magenta, yellow, black]: [u8; 4]) -> [u8; 3] {
    [cyan, magenta, yellow].map(|ink| {
        let light = u32::from(255 - ink) * u32::from(255 - black);
        ((light + 127) / 255) as u8
    })
}

/// Reads a profile. The most recent [`CACHED_PROFILES`] profiles are cached by their digests.
fn cached_profile(profile: &[u8]) -> Result<Arc<CmykProfile>, String> {
    static CACHE: LazyLock<Recent<Digest, Arc<CmykProfile>>> = LazyLock::new(|| Recent::new(CACHED_PROFILES));
    if profile.len() > MAX_PROFILE_BYTES {
        return Err(profile_too_large());
    }
    let digest = Digest::from_bytes(profile);
    CACHE.get(&digest, || {
        let (name, table) = name_and_table(profile).map_err(|problem| format!("{problem}; {REMEDY}"))?;
        Ok(Arc::new(CmykProfile { table, name, digest }))
    })
}

/// Reads the name and the table of a profile.
fn name_and_table(profile: &[u8]) -> Result<(String, InkTable), String> {
    let InkProfile { name, profile } = InkProfile::read(profile)?;
    // Both tables map the white of the paper to white. Most printer profiles have the colorimetric one.
    profile
        .lut_a_to_b_colorimetric
        .or(profile.lut_a_to_b_perceptual)
        .ok_or_else(|| "it has no table of colours (A2B)".to_owned())
        .and_then(|lut| InkTable::new(&lut, profile.pcs))
        .map_err(|reason| format!("the ICC profile {name:?} cannot be used: {reason}"))
        .map(|table| (name, table))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inks_without_a_profile_are_converted_by_the_formula() {
        let inks = Inks::new(&ColourTag::None, ColourRule::Convert).unwrap();
        assert_eq!(inks.note().from, "CMYK without a profile");
        for (amounts, codes) in [
            ([0, 0, 0, 0], [255, 255, 255]),
            ([255, 0, 0, 0], [0, 255, 255]),
            ([0, 0, 0, 255], [0, 0, 0]),
            ([0, 51, 102, 128], [127, 102, 76]),
        ] {
            assert_eq!(inks.srgb(&amounts), codes, "{amounts:?}");
        }
    }

    #[test]
    fn an_rgb_profile_is_refused_and_can_be_ignored() {
        let mut profile = vec![0; 200];
        profile[16..20].copy_from_slice(b"RGB ");
        let tag = ColourTag::Profile(profile);
        let problem = Inks::new(&tag, ColourRule::Convert).unwrap_err();
        assert!(problem.contains("not for CMYK") && problem.contains("--decode colour=ignore"), "{problem}");
        let ignored = Inks::new(&tag, ColourRule::Ignore).unwrap();
        assert_eq!(ignored.srgb(&[0, 0, 0, 255]), [0, 0, 0]);
    }
}
