//! In which sizes a run's images were enhanced: [`SizeLog`].

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

/// Counts of the size adaptations of an enhancer's images, and the figures that decided them. An image can count as both padded and tiled.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SizeLog {
    /// Images that were enhanced.
    pub images: usize,
    /// Images that went through as they are.
    pub whole: usize,
    /// Images that were filled to the right and below, and cropped afterwards.
    pub padded: usize,
    /// Images that were cut into tiles.
    pub tiled: usize,
    /// Images that were resized to the model's fixed size and back (`--llie-options resize`).
    pub resized: usize,
    /// Images that were reduced by `--llie-options max-side` and enlarged again.
    pub reduced: usize,
    /// Width and height that a side of every run has; `None` for any.
    pub fixed: Option<[Option<usize>; 2]>,
    /// Sides must be multiples of this many pixels; `None` if any size will do.
    pub multiple: Option<usize>,
    /// Pixels that filled images, as `reflect`; `None` if none was filled.
    pub pad: Option<String>,
    /// Width and height of the largest tiles; `None` if no image was cut.
    pub tile: Option<[usize; 2]>,
    /// Largest context of tiles in pixels; `None` if no image was cut.
    pub context: Option<usize>,
    /// Farthest pixels on which a pixel of the result was seen to depend; `None` if it was not measured.
    pub reach: Option<usize>,
    /// Comparison of all pixels that two tiles gave.
    pub seam: SeamCounts,
    /// Images that took too long, and were not enhanced.
    pub too_long: usize,
}

/// Comparison of the samples that two tiles gave, over all images.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SeamCounts {
    /// Samples that were compared.
    pub compared: usize,
    /// Number of these that are nearly black in both tiles, where a seam cannot be seen.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub black: usize,
    /// Samples that differed.
    pub differing: usize,
    /// Largest difference in codes of 255.
    pub most: u8,
}

/// Whether a count is 0.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl SizeLog {
    /// Adds what another enhancer of the same model did.
    pub fn add(&mut self, other: &Self) {
        let Self {
            images,
            whole,
            padded,
            tiled,
            resized,
            reduced,
            fixed,
            multiple,
            pad,
            tile,
            context,
            reach,
            seam,
            too_long,
        } = other;
        self.images += images;
        self.whole += whole;
        self.padded += padded;
        self.tiled += tiled;
        self.resized += resized;
        self.reduced += reduced;
        self.too_long += too_long;
        self.fixed = fixed.or(self.fixed);
        self.multiple = multiple.or(self.multiple);
        self.pad = pad.clone().or(self.pad.take());
        // The same whatever the order of the images.
        self.tile = self.tile.max(*tile);
        self.context = self.context.max(*context);
        self.reach = self.reach.max(*reach);
        self.seam.compared += seam.compared;
        self.seam.black += seam.black;
        self.seam.differing += seam.differing;
        self.seam.most = self.seam.most.max(seam.most);
    }

    /// Difference to an earlier state of this log.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            images: self.images - earlier.images,
            whole: self.whole - earlier.whole,
            padded: self.padded - earlier.padded,
            tiled: self.tiled - earlier.tiled,
            resized: self.resized - earlier.resized,
            reduced: self.reduced - earlier.reduced,
            too_long: self.too_long - earlier.too_long,
            seam: SeamCounts {
                compared: self.seam.compared - earlier.seam.compared,
                black: self.seam.black - earlier.seam.black,
                differing: self.seam.differing - earlier.seam.differing,
                // The largest of all images so far; sums of parts have the same largest.
                most: self.seam.most,
            },
            ..self.clone()
        }
    }

    /// Summary in words, as `12 images: 8 as they are, 4 in tiles of 512 × 512 with 8 px context`.
    #[must_use]
    pub fn summary(&self) -> String {
        let mut parts = Vec::new();
        let mut part = |count: usize, words: String| {
            if count == self.images && count > 0 {
                parts.push(words);
            } else if count > 0 {
                parts.push(format!("{count} {words}"));
            }
        };
        part(self.whole, "as they are".to_owned());
        let pad = self.pad.as_deref().unwrap_or_default();
        part(self.padded, format!("filled ({pad}) and cropped"));
        part(self.tiled, self.tiles());
        part(
            self.resized,
            format!("resized to {} and back", self.fixed()),
        );
        part(
            self.reduced,
            "reduced by --llie-options max-side and enlarged".to_owned(),
        );
        let images = if self.images == 1 { "image" } else { "images" };
        let mut text = format!("{} {images}", self.images);
        if !parts.is_empty() {
            // Writing to a string cannot fail.
            let _ = write!(text, ": {}", parts.join(", "));
        }
        if self.too_long > 0 {
            let _ = write!(text, "; {} took too long", self.too_long);
        }
        text
    }

    /// The tiles with their context and seams.
    fn tiles(&self) -> String {
        let [width, height] = self.tile.unwrap_or_default();
        let seam = if self.seam.black > 0
            && self.seam.differing == 0
            && self.seam.black * 10 >= self.seam.compared * 9
        {
            "seams could not be checked, because the images are nearly black there".to_owned()
        } else if self.seam.differing == 0 {
            "no difference at seams".to_owned()
        } else {
            let SeamCounts {
                compared,
                differing,
                most,
                ..
            } = self.seam;
            format!("{differing} of {compared} samples at seams differ, by up to {most}")
        };
        format!(
            "in tiles of {width} × {height} with {} px context ({seam})",
            self.context.unwrap_or(0)
        )
    }

    fn fixed(&self) -> String {
        let [width, height] = self
            .fixed
            .unwrap_or_default()
            .map(|side: Option<usize>| side.map_or("any".to_owned(), |side| side.to_string()));
        format!("{width} × {height}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_names_what_was_done() {
        let log = SizeLog {
            images: 12,
            whole: 8,
            padded: 1,
            tiled: 4,
            pad: Some("reflect".to_owned()),
            tile: Some([512, 384]),
            context: Some(8),
            ..SizeLog::default()
        };
        assert_eq!(
            log.summary(),
            "12 images: 8 as they are, 1 filled (reflect) and cropped, 4 in tiles of 512 × 384 with 8 px context (no difference at seams)"
        );
        let log = SizeLog {
            images: 1,
            resized: 1,
            fixed: Some([Some(96), None]),
            too_long: 2,
            ..SizeLog::default()
        };
        assert_eq!(
            log.summary(),
            "1 image: resized to 96 × any and back; 2 took too long"
        );
        assert_eq!(SizeLog::default().summary(), "0 images");
        let json = serde_json::to_value(&log).unwrap();
        assert_eq!(json["fixed"], serde_json::json!([96, null]));
    }
}
