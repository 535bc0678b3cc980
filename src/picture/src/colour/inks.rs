//! Amounts of ink → sRGB codes: [`Inks`], for images of cyan, magenta, yellow and black (CMYK).

mod table;

use std::sync::{Arc, LazyLock};

use self::table::InkTable;
use super::icc::InkProfile;
use super::{CACHED, ColourTag, MOST_PROFILE, REMEDY, too_large};
use crate::reading_rule::ColourRule;
use darkqa_ground::types::recent::Recent;
use darkqa_ground::types::{ColourHandling, ColourNote, Digest};

/// The name of inks whose file has no profile.
const WITHOUT_PROFILE: &str = "CMYK without a profile";

/// The colours of the inks of an image.
#[derive(Debug, Clone)]
pub(crate) enum Inks {
    /// By a formula: each ink takes its share of red, green or blue, and black its share of all.
    Formula(ColourNote),
    /// By the table of a profile.
    Profile(Arc<InkColours>),
}

/// The table of a profile of inks, and the name and the digest of the profile.
#[derive(Debug)]
pub(crate) struct InkColours {
    table: InkTable,
    name: String,
    profile: Digest,
}

impl Inks {
    /// The colours of inks by the profile of their file.
    ///
    /// # Errors
    /// If the profile is not one of four inks, or is broken. The error names it, and the flag that leaves it aside.
    pub(crate) fn new(tag: &ColourTag, rule: ColourRule) -> Result<Self, String> {
        let formula = |from: &str, handling| {
            Self::Formula(ColourNote {
                from: from.to_owned(),
                profile: None,
                handling,
            })
        };
        match (tag, rule) {
            (ColourTag::Profile(profile), ColourRule::Convert) => {
                by_profile(profile).map(Self::Profile)
            }
            (ColourTag::Profile(_), ColourRule::Ignore) => {
                let from = "CMYK, whose profile is ignored";
                Ok(formula(from, ColourHandling::Converted))
            }
            _ => Ok(formula(WITHOUT_PROFILE, ColourHandling::Converted)),
        }
    }

    /// The note of an image with these inks.
    pub(crate) fn note(&self) -> ColourNote {
        match self {
            Self::Formula(note) => note.clone(),
            Self::Profile(colours) => ColourNote {
                from: colours.name.clone(),
                profile: Some(colours.profile),
                handling: ColourHandling::Converted,
            },
        }
    }

    /// The sRGB codes of pixels, red, green and blue of each, from their amounts of ink, 0 for none and 255 for full.
    pub(crate) fn srgb(&self, inks: &[u8]) -> Vec<u8> {
        let (pixels, _) = inks.as_chunks::<4>();
        match self {
            Self::Formula(_) => pixels.iter().flat_map(|inks| by_formula(*inks)).collect(),
            Self::Profile(colours) => {
                let mut last = ([0; 4], colours.table.srgb([0; 4]));
                pixels
                    .iter()
                    .flat_map(|inks| {
                        if last.0 != *inks {
                            last = (*inks, colours.table.srgb(*inks));
                        }
                        last.1
                    })
                    .collect()
            }
        }
    }
}

/// The codes of inks of no known colour (PostScript Language Reference, third edition, section 7.2.4, with products in place of sums,
/// as libjpeg's users have it).
fn by_formula([cyan, magenta, yellow, black]: [u8; 4]) -> [u8; 3] {
    [cyan, magenta, yellow].map(|ink| {
        let left = u32::from(255 - ink) * u32::from(255 - black);
        ((left + 127) / 255) as u8
    })
}

/// The colours of a profile. The last profiles are cached by their digests.
fn by_profile(profile: &[u8]) -> Result<Arc<InkColours>, String> {
    static KNOWN: LazyLock<Recent<Digest, Arc<InkColours>>> = LazyLock::new(|| Recent::new(CACHED));
    if profile.len() > MOST_PROFILE {
        return Err(too_large());
    }
    let digest = Digest::from_bytes(profile);
    KNOWN.get(&digest, || {
        let (name, table) = table(profile).map_err(|problem| format!("{problem}; {REMEDY}"))?;
        Ok(Arc::new(InkColours {
            table,
            name,
            profile: digest,
        }))
    })
}

/// The name and the table of a profile.
fn table(profile: &[u8]) -> Result<(String, InkTable), String> {
    let InkProfile { name, profile } = InkProfile::read(profile)?;
    // White paper is white in both; most printers' profiles have the first.
    let table = profile
        .lut_a_to_b_colorimetric
        .or(profile.lut_a_to_b_perceptual);
    let problem = |problem: &str| format!("the ICC profile {name:?} cannot be used: {problem}");
    let table = table.ok_or_else(|| problem("it has no table of colours (A2B)"))?;
    let table = InkTable::new(&table, profile.pcs).map_err(|found| problem(&found))?;
    Ok((name, table))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inks_without_a_profile_take_their_share_of_light() {
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
    fn a_profile_of_other_colours_is_refused_and_can_be_ignored() {
        let mut profile = vec![0; 200];
        profile[16..20].copy_from_slice(b"RGB ");
        let tag = ColourTag::Profile(profile);
        let problem = Inks::new(&tag, ColourRule::Convert).unwrap_err();
        assert!(
            problem.contains("not for CMYK") && problem.contains("--decode colour=ignore"),
            "{problem}"
        );
        let ignored = Inks::new(&tag, ColourRule::Ignore).unwrap();
        assert_eq!(ignored.srgb(&[0, 0, 0, 255]), [0, 0, 0]);
    }
}
