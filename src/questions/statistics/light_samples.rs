//! Light of a frame, estimated from its surfaces: [`LightSamples`].
//!
//! A surface that looks grey may be a white one in shade, so colours are judged relative to the brightest surfaces in
//! the same light: the "highest luminance is white" rule of anchoring (Gilchrist et al. 1999, Psychol. Rev. 106:795),
//! which is max-RGB of colour constancy (Land and McCann 1971, J. Opt. Soc. Am. 61:1). A quantile replaces the maximum,
//! because single bright pixels may be glints (Funt and Shi 2010, "The rehabilitation of MaxRGB", CIC 18:256).

use super::mask_core::{pixel_luma, quantile};
use super::scene_maps::SceneMaps;
use crate::rules::MeasureRule;
use darkqa_base::types::Frame;

/// A pixel of a surface.
struct Sample {
    position: [usize; 2],
    mask: u32,
    rgb: [u8; 3],
}

/// Pixels of the frame's surfaces on a regular grid, sorted by row. Classes that emit light or show something else are
/// left out.
pub(super) struct LightSamples {
    samples: Vec<Sample>,
    /// Quantile of the light of the frame, in percent.
    frame_percent: u64,
    /// Quantile of the light around a mask, in percent.
    around_percent: u64,
}

impl LightSamples {
    /// Samples a frame.
    pub(super) fn from_frame(frame: &Frame, scene: &SceneMaps<'_>, rule: &MeasureRule) -> Self {
        let [width, height] = scene.size;
        let step = (height / rule.light_rows).max(1);
        let (pixels, _) = frame.rgb.samples().as_chunks::<3>();
        let mut samples = Vec::new();
        for y in (0..height).step_by(step) {
            scene.each_run_in_row(y, &mut |left, right, mask, id| {
                let is_surface = scene.class(id).is_some_and(|class| !rule.luminous.contains(class));
                if is_surface {
                    let (left, right) = (left - y * width, right - y * width);
                    let columns = (left.next_multiple_of(step)..right).step_by(step);
                    samples.extend(columns.map(|x| Sample { position: [x, y], mask, rgb: pixels[y * width + x] }));
                }
            });
        }
        Self { samples, frame_percent: rule.light_percent, around_percent: rule.around_percent }
    }

    /// Light of the frame: a high quantile of each channel over all surfaces. White without surfaces.
    pub(super) fn light(&self) -> [u8; 3] {
        [0, 1, 2].map(|channel| {
            let codes = self.samples.iter().map(|sample| sample.rgb[channel]);
            code_quantile(codes, self.frame_percent).unwrap_or(u8::MAX)
        })
    }

    /// Light around a mask: a high quantile of luma over the other surfaces in its bounding box, enlarged by half of
    /// the longer side on each side. `None` without such surfaces.
    pub(super) fn around(&self, mask: u32, [left, top, right, bottom]: [usize; 4]) -> Option<u8> {
        let reach = (right - left).max(bottom - top) / 2;
        let columns = left.saturating_sub(reach)..right + reach;
        let rows = top.saturating_sub(reach)..bottom + reach;
        let first = self.samples.partition_point(|sample| sample.position[1] < rows.start);
        let last = self.samples.partition_point(|sample| sample.position[1] < rows.end);
        let near = self.samples[first..last]
            .iter()
            .filter(|sample| sample.mask != mask && columns.contains(&sample.position[0]));
        code_quantile(near.map(|sample| pixel_luma(sample.rgb)), self.around_percent)
    }
}

/// Quantile of codes; `None` without codes.
fn code_quantile(codes: impl Iterator<Item = u8>, percent: u64) -> Option<u8> {
    let (mut counts, mut count) = ([0_u32; 256], 0);
    for code in codes {
        counts[usize::from(code)] += 1;
        count += 1;
    }
    (count > 0).then(|| quantile(&counts, count, percent))
}
