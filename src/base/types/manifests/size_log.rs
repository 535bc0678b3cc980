//! Counts of the image sizes in which an enhancer ran: [`SizeLog`].

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::types::text::counted;

/// Counts of the ways in which image sizes were adapted to an enhancer, with their parameters. An image can be both
/// padded and tiled.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SizeLog {
    /// Images that were enhanced.
    pub images: usize,
    /// Images that were enhanced at their own size.
    pub whole: usize,
    /// Images that were padded on the right and at the bottom, and cropped afterwards.
    pub padded: usize,
    /// Images that were cut into tiles.
    pub tiled: usize,
    /// Images that were resized to the model's fixed size and back (`--llie-options resize`).
    pub resized: usize,
    /// Images that were reduced by `--llie-options max-side` and enlarged again.
    pub reduced: usize,
    /// Fixed width and height of the model's input; `None` for a side of any length.
    pub fixed: Option<[Option<usize>; 2]>,
    /// Sides must be multiples of this many pixels; `None` if any size will do.
    pub multiple: Option<usize>,
    /// Padding mode, as `reflect`; `None` if no image was padded.
    pub pad: Option<String>,
    /// Width and height of the largest tiles; `None` if no image was cut.
    pub tile: Option<[usize; 2]>,
    /// Largest context of tiles in pixels; `None` if no image was cut.
    pub context: Option<usize>,
    /// Measured radius of the receptive field, in pixels; `None` if it was not measured.
    pub reach: Option<usize>,
    /// Comparison of the pixels in the overlap of two tiles.
    pub seam: SeamCounts,
    /// Images that were not enhanced because of the time limit.
    pub too_long: usize,
}

/// Comparison of the samples in the overlap of two tiles, over all images.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SeamCounts {
    /// Samples that were compared.
    pub compared: usize,
    /// Number of these that are nearly black in both tiles, where a seam cannot be seen.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub black: usize,
    /// Samples that differed.
    pub differing: usize,
    /// Largest difference in 8-bit codes.
    pub most: u8,
}

/// Whether a count is 0.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl SizeLog {
    /// Adds the counts of another session of the same model.
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
        // Maxima do not depend on the order of the images.
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
                // A maximum cannot be subtracted; adding the difference to `earlier` gives the same maximum.
                most: self.seam.most,
            },
            ..self.clone()
        }
    }

    /// Summary in words, as `12 images: 8 as they are, 4 in tiles of 512 × 512 with 8 px context`.
    #[must_use]
    pub fn summary(&self) -> String {
        let pad = self.pad.as_deref().unwrap_or_default();
        let parts: Vec<String> = [
            (self.whole, "as they are".to_owned()),
            (self.padded, format!("filled ({pad}) and cropped")),
            (self.tiled, self.tiles()),
            (self.resized, format!("resized to {} and back", self.fixed())),
            (self.reduced, "reduced by --llie-options max-side and enlarged".to_owned()),
        ]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, words)| if count == self.images { words } else { format!("{count} {words}") })
        .collect();
        let mut text = counted(self.images, "image");
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
        let seam = if self.seam.black > 0 && self.seam.differing == 0 && self.seam.black * 10 >= self.seam.compared * 9
        {
            "seams could not be checked, because the images are nearly black there".to_owned()
        } else if self.seam.differing == 0 {
            "no difference at seams".to_owned()
        } else {
            let SeamCounts { compared, differing, most, .. } = self.seam;
            format!("{differing} of {compared} samples at seams differ, by up to {most}")
        };
        format!("in tiles of {width} × {height} with {} px context ({seam})", self.context.unwrap_or(0))
    }

    /// The fixed input size of the model, as `96 × any`.
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
    fn summary_lists_size_adaptations() {
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
        let log = SizeLog { images: 1, resized: 1, fixed: Some([Some(96), None]), too_long: 2, ..SizeLog::default() };
        assert_eq!(log.summary(), "1 image: resized to 96 × any and back; 2 took too long");
        assert_eq!(SizeLog::default().summary(), "0 images");
        let json = serde_json::to_value(&log).unwrap();
        assert_eq!(json["fixed"], serde_json::json!([96, null]));
    }
}
