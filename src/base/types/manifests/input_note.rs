//! Changes made to images when their files were read: of one image ([`InputNote`]), and of all images of a run
//! ([`InputSummary`]).
//!
//! [`Flaw`]: a reason to distrust an enhanced image.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::types::images::FrameId;
use crate::types::text::words::words;
use crate::types::values::Digest;

/// Version of the colour conversion, raised whenever it produces another pixel value.
const COLOUR_VERSION: u32 = 1;

/// Changes made to one image when it was read. By default its codes were used unchanged.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct InputNote {
    /// The EXIF orientation, 2 to 8, that was applied to the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<u8>,
    /// The EXIF orientation that was not applied, because the maps have the size of the image as stored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation_ignored: Option<u8>,
    /// Kind of the file, as `animated WebP`, if it has several pictures; only the first was read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_of: Option<String>,
    /// The colours of the file, if they are not sRGB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<ColourNote>,
    /// The depth of the pixels, if it is more than 8 bits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<DepthNote>,
    /// Scaling of the light, in EV; `None` if it was not scaled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure_ev: Option<f32>,
    /// The flags for linear light that had no effect, because the image has integer codes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub no_light: Vec<String>,
}

/// The depth of the pixels of an image, if it is more than 8 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum DepthNote {
    /// Codes of 16 bits.
    #[serde(rename = "16-bit")]
    Rgb16Image,
    /// Linear light.
    #[serde(rename = "light")]
    Light,
}

/// Colours of a file that are not sRGB, and their handling.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ColourNote {
    /// Name of the colour space, as `Display P3`, from the profile or the standard.
    pub from: String,
    /// The digest of the profile; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<Digest>,
    /// How the colours were handled.
    pub handling: ColourHandling,
}

/// Handling of colours that are not sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColourHandling {
    /// They were converted to sRGB.
    Converted,
    /// Their primaries were converted to those of sRGB. The codes are of video, whose curve counts as that of sRGB.
    Video,
    /// They are HDR, and were converted to sRGB, where light above diffuse white is clipped.
    Clipped,
    /// Their codes were taken as sRGB.
    Ignored,
}

impl InputNote {
    /// Description of every change of the pixels, as one text for digests; `None` if the pixels are the codes of the
    /// file.
    #[must_use]
    pub fn rule(&self) -> Option<String> {
        let orientation = self.orientation.map(|turn| format!("orientation {turn}"));
        let colour = self.colour.as_ref().and_then(|colour| match colour.handling {
            ColourHandling::Converted => Some(format!("colour {COLOUR_VERSION}")),
            ColourHandling::Video => Some(format!("video colour {COLOUR_VERSION}")),
            ColourHandling::Clipped => Some(format!("clipped colour {COLOUR_VERSION}")),
            ColourHandling::Ignored => None,
        });
        let depth = self.depth.map(|depth| depth.words().to_owned());
        let exposure = self.exposure_ev.map(|ev| format!("exposure {ev}"));
        let parts: Vec<String> = [orientation, colour, depth, exposure].into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// Each change with its details, for messages.
    fn remarks(&self) -> Vec<(Remark, String)> {
        let mut remarks = Vec::new();
        if let Some(orientation) = self.orientation {
            remarks.push((Remark::Turned, format!("orientation {orientation}")));
        }
        if let Some(orientation) = self.orientation_ignored {
            remarks.push((Remark::NotTurned, format!("orientation {orientation}")));
        }
        if let Some(kind) = &self.first_of {
            remarks.push((Remark::FirstOfSeveral, kind.clone()));
        }
        if let Some(colour) = &self.colour {
            let remark = match colour.handling {
                ColourHandling::Converted => Remark::Converted,
                ColourHandling::Video => Remark::ConvertedVideo,
                ColourHandling::Clipped => Remark::Clipped,
                ColourHandling::Ignored => Remark::NotConverted,
            };
            remarks.push((remark, colour.from.clone()));
        }
        if let Some(depth) = self.depth {
            remarks.push((Remark::Deep, depth.words().to_owned()));
        }
        if let Some(ev) = self.exposure_ev {
            remarks.push((Remark::Scaled, format!("{ev} EV")));
        }
        for flag in &self.no_light {
            remarks.push((Remark::NoLight, flag.clone()));
        }
        remarks
    }
}

impl DepthNote {
    fn words(self) -> &'static str {
        match self {
            Self::Rgb16Image => "16-bit codes",
            Self::Light => "linear light",
        }
    }
}

/// A change that is made to an image when it is read, or a change that was left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Remark {
    /// EXIF orientation applied.
    Turned,
    /// EXIF orientation not applied, because the maps of the image are not rotated either.
    NotTurned,
    /// The first picture of a file that has several.
    FirstOfSeveral,
    /// Converted to sRGB.
    Converted,
    /// Converted to the primaries of sRGB, with codes of video.
    ConvertedVideo,
    /// HDR, converted to sRGB.
    Clipped,
    /// Interpreted as sRGB, although the file states another colour space.
    NotConverted,
    /// Kept in more than 8 bits.
    Deep,
    /// Linear light, scaled.
    Scaled,
    /// No linear light, although a flag for it was given.
    NoLight,
}

impl Remark {
    /// The handling as a predicate after "are" or "is".
    fn words(self) -> &'static str {
        match self {
            Self::Turned => "turned as the EXIF orientation of the file states",
            Self::NotTurned => {
                "not turned as the EXIF orientation of the file states, because the maps beside the image are not turned"
            }
            Self::FirstOfSeveral => "the first picture of a file with several",
            Self::Converted => "converted to sRGB",
            Self::ConvertedVideo => "converted to the primaries of sRGB, with codes of video taken as displayed",
            Self::Clipped => "converted to sRGB by --decode colour=clip, where light above 203 cd/m² becomes white",
            Self::NotConverted => {
                "taken as sRGB, because of --decode colour=ignore, although the file states other colours"
            }
            Self::Deep => "of more than 8 bits, which are rounded to 8 only after the light is reduced",
            Self::Scaled => "scaled by --decode exposure",
            Self::NoLight => "not linear light, so that a flag does not apply",
        }
    }
}

/// Changes made to the images of a command or a run when they were read.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct InputSummary(BTreeMap<Remark, RemarkCount>);

/// The images with one remark.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct RemarkCount {
    /// The numbers of images, by the detail of the remark.
    pub images: BTreeMap<String, usize>,
    /// The first of these images by name.
    pub example: String,
}

impl InputSummary {
    /// Counts one image.
    pub fn add(&mut self, frame: &FrameId, note: &InputNote) {
        for (remark, detail) in note.remarks() {
            let count = self.0.entry(remark).or_default();
            *count.images.entry(detail).or_default() += 1;
            count.keep_first_name(&frame.0);
        }
    }

    /// Adds the images of another shard.
    pub fn merge(&mut self, other: &Self) {
        for (remark, others) in &other.0 {
            let count = self.0.entry(*remark).or_default();
            for (detail, images) in &others.images {
                *count.images.entry(detail.clone()).or_default() += images;
            }
            count.keep_first_name(&others.example);
        }
    }

    /// True if all images were used unchanged.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.0.is_empty()
    }

    /// One sentence for each kind of remark, without a full stop.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|(remark, count)| {
            let found: usize = count.images.values().sum();
            let verb = if found == 1 { " is" } else { "s are" };
            let details: Vec<String> =
                count.images.iter().map(|(detail, images)| format!("{detail}: {images}")).collect();
            format!("{found} image{verb} {} ({}; for example {})", remark.words(), details.join(", "), count.example)
        })
    }
}

impl RemarkCount {
    /// Keeps the first name in alphabetical order, so that the example does not depend on the order of the images.
    fn keep_first_name(&mut self, name: &str) {
        if self.example.is_empty() || name < self.example.as_str() {
            name.clone_into(&mut self.example);
        }
    }
}

/// A fault of an enhancer's image of a dark frame, in the order of the checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Flaw {
    /// Values that are NaN.
    Nan,
    /// Values far outside the expected range.
    Range,
    /// No structure.
    Flat,
    /// Hardly brighter than the frame.
    Unlit,
    /// Almost all white.
    White,
    /// Bright where the frame is dark.
    Inverted,
    /// Edges that differ from those of the frame.
    Shuffled,
    /// Blue where the frame is red.
    Hue,
    /// Three equal channels where the frame has colours.
    Grey,
    /// No dark pixel at all.
    Haze,
}

words!(Flaw {
    Nan = "nan",
    Range = "range",
    Flat = "flat",
    Unlit = "unlit",
    White = "white",
    Inverted = "inverted",
    Shuffled = "shuffled",
    Hue = "hue",
    Grey = "grey",
    Haze = "haze",
});

impl Flaw {
    /// Predicate that describes the flaw, to follow "the enhanced images".
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Nan => "have values that are not numbers",
            Self::Range => "have values far outside the range in which they are read",
            Self::Flat => "are flat",
            Self::Unlit => "are not brighter than the dark frames",
            Self::White => "are almost all white",
            Self::Inverted => "are bright where the frames are dark",
            Self::Shuffled => "have edges that are not those of the frames",
            Self::Hue => "are blue where the frames are red",
            Self::Grey => "have no colour, unlike the frames",
            Self::Haze => "have no dark pixel",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(orientation: u8) -> InputNote {
        InputNote { orientation: Some(orientation), ..InputNote::default() }
    }

    #[test]
    fn images_are_counted_by_remark() {
        let mut summary = InputSummary::default();
        let images = [("c", turned(6)), ("b", turned(8)), ("d", turned(6))];
        for (name, note) in &images {
            summary.add(&FrameId((*name).to_owned()), note);
        }
        summary.add(&FrameId("a".to_owned()), &InputNote::default());
        let lines: Vec<String> = summary.lines().collect();
        let expected = "3 images are turned as the EXIF orientation of the file states (orientation 6: 2, orientation 8: 1; for example b)";
        assert_eq!(lines, [expected]);
        let mut parts = InputSummary::default();
        parts.merge(&summary);
        parts.merge(&InputSummary::default());
        assert_eq!(parts, summary);
        parts.add(&FrameId("e".to_owned()), &turned(3));
        assert!(parts.lines().all(|line| line.starts_with("4 images")));
        let json = serde_json::to_string(&parts).unwrap();
        assert_eq!(serde_json::from_str::<InputSummary>(&json).unwrap(), parts);
    }

    #[test]
    fn unchanged_images_have_no_remark() {
        let mut summary = InputSummary::default();
        summary.add(&FrameId("a".to_owned()), &InputNote::default());
        assert!(summary.is_plain());
        assert_eq!(summary.lines().count(), 0);
    }
}
