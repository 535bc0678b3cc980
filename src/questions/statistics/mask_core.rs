//! Colour and depth of the core pixels of a mask, [`MaskCore`], and measurements over all pixels of a frame.

use ndarray::{CowArray, Ix2};

use super::{DepthAxis, FrameDepth, Segment, SegmentDepth};
use crate::colors::{BINS, Palette};
use crate::rules::MeasureRule;
use darkqa_base::types::{DepthKind, Frame, Intrinsics};

/// Colours and depths of the core pixels of a mask.
pub(super) struct MaskCore {
    pub(super) count: u64,
    colors: [u64; BINS],
    channels: [[u32; 256]; 3],
    bright: u64,
    crushed: u64,
    depths: Option<Vec<u32>>,
}

impl MaskCore {
    /// Creates an empty core, with capacity for the depths of `area` pixels.
    pub(super) fn new(area: u64, frame: &Frame) -> Self {
        Self {
            count: 0,
            colors: [0; BINS],
            channels: [[0; 256]; 3],
            bright: 0,
            crushed: 0,
            depths: frame.depth.as_ref().map(|_| Vec::with_capacity(area as usize)),
        }
    }

    /// Writes the measurements into a segment.
    pub(super) fn write_to(self, segment: &mut Segment) {
        segment.core = self.count;
        segment.colors = self.colors;
        segment.median = self.channels.map(|counts| quantile(&counts, self.count, 50));
        (segment.bright, segment.crushed) = (self.bright, self.crushed);
        segment.depth = self.depths.and_then(depth_quantiles);
    }
}

/// Nearest-rank quantiles of depths; `None` without depths.
fn depth_quantiles(mut depths: Vec<u32>) -> Option<SegmentDepth> {
    if depths.is_empty() {
        return None;
    }
    let count = depths.len() as u64;
    let [near, middle, far] = [10, 50, 90].map(|percent| rank(count, percent) as usize);
    // The values before the median are smaller and those after it larger, so each outer quantile is searched in its
    // half only.
    let (nearer, &mut median, farther) = depths.select_nth_unstable(middle);
    Some(SegmentDepth {
        valid: count,
        p10: if near < middle { *nearer.select_nth_unstable(near).1 } else { median },
        median,
        p90: match far.checked_sub(middle + 1) {
            Some(far) => *farther.select_nth_unstable(far).1,
            None => median,
        },
    })
}

/// Index of a quantile in a sorted list: ⌈percent · count / 100⌉ − 1.
fn rank(count: u64, percent: u64) -> u64 {
    (percent * count).div_ceil(100).saturating_sub(1)
}

/// Quantile of 8-bit values, from their histogram.
pub(super) fn quantile(counts: &[u32; 256], count: u64, percent: u64) -> u8 {
    let rank = rank(count, percent);
    let mut seen = 0;
    let value = counts.iter().position(|count| {
        seen += u64::from(*count);
        seen > rank
    });
    value.unwrap_or(0) as u8
}

/// Image and depth of a frame, prepared for reading runs of pixels.
pub(super) struct PixelLight<'a> {
    frame: &'a Frame,
    rule: &'a MeasureRule,
    palette: &'a Palette,
    depth: Option<CowArray<'a, u32, Ix2>>,
    /// Squares of the slopes of rays, by column and by row; `None` if the depth needs no conversion.
    slopes: Option<[Vec<f64>; 2]>,
}

impl<'a> PixelLight<'a> {
    pub(super) fn new(frame: &'a Frame, rule: &'a MeasureRule, palette: &'a Palette) -> Self {
        let slopes = depth_conversion(frame).map(|camera| {
            [(frame.rgb.width(), camera.fx, camera.cx), (frame.rgb.height(), camera.fy, camera.cy)].map(
                |(length, focal, center)| {
                    (0..length).map(|i| (i as f64 - center) / focal).map(|slope| slope * slope).collect()
                },
            )
        });
        Self { frame, rule, palette, depth: frame.depth.as_ref().map(|depth| depth.as_standard_layout()), slopes }
    }

    /// Adds a run of pixels of a row to a core.
    pub(super) fn add_run(&self, core: &mut MaskCore, y: usize, left: usize, right: usize) {
        let start = y * self.frame.rgb.width();
        let samples = &self.frame.rgb.samples()[(start + left) * 3..(start + right) * 3];
        core.count += (right - left) as u64;
        for &rgb in samples.as_chunks::<3>().0 {
            core.colors[self.palette.bin(rgb)] += 1;
            for (counts, value) in core.channels.iter_mut().zip(rgb) {
                counts[usize::from(value)] += 1;
            }
            let max = rgb[0].max(rgb[1]).max(rgb[2]);
            core.bright += u64::from(max >= self.rule.bright);
            core.crushed += u64::from(max <= self.rule.crushed);
        }
        let depth = self.depth.as_ref().and_then(|depth| depth.as_slice());
        let (Some(depth), Some(depths)) = (depth, &mut core.depths) else {
            return;
        };
        let row = &depth[start + left..start + right];
        let valid = |depth: &u32| (1..=self.rule.most_depth_mm).contains(depth);
        match &self.slopes {
            None => depths.extend(row.iter().copied().filter(valid)),
            Some([columns, rows]) => {
                let steep = 1.0 + rows[y];
                let along = row
                    .iter()
                    .zip(&columns[left..right])
                    .map(|(z, slope)| (f64::from(*z) * (steep + slope).sqrt() + 0.5) as u32);
                depths.extend(along.filter(valid));
            }
        }
    }
}

/// Camera intrinsics, if depth must be converted from the optical axis to the rays.
fn depth_conversion(frame: &Frame) -> Option<Intrinsics> {
    frame.intrinsics.filter(|_| frame.depth_kind == DepthKind::Planar)
}

/// Measures the depth map of a frame; `None` without one.
pub(super) fn frame_depth(frame: &Frame) -> Option<FrameDepth> {
    const SIZE: usize = 1 << 16;
    let depth = frame.depth.as_ref()?;
    let mut counts = vec![0_u32; SIZE];
    for depth in depth {
        counts[(*depth as usize).min(SIZE - 1)] += 1;
    }
    let holes = u64::from(counts[0]);
    let rank = rank(depth.len() as u64 - holes, 50);
    let mut seen = 0;
    let median = counts.iter().skip(1).position(|count| {
        seen += u64::from(*count);
        seen > rank
    });
    Some(FrameDepth {
        holes,
        median: median.map_or(0, |median| median as u32 + 1),
        along: match (frame.depth_kind, depth_conversion(frame)) {
            (DepthKind::Euclid, _) | (_, Some(_)) => DepthAxis::Ray,
            (DepthKind::Planar, None) => DepthAxis::Axis,
        },
    })
}

/// 10 %, 50 % and 90 % quantiles of luma.
pub(super) fn luma(frame: &Frame) -> [u8; 3] {
    let mut counts = [0; 256];
    let (pixels, _) = frame.rgb.samples().as_chunks::<3>();
    for pixel in pixels {
        counts[usize::from(pixel_luma(*pixel))] += 1;
    }
    [10, 50, 90].map(|percent| quantile(&counts, pixels.len() as u64, percent))
}

/// Luma of a pixel (weights of ITU-R BT.709 in 256ths).
pub(super) fn pixel_luma([red, green, blue]: [u8; 3]) -> u8 {
    let luma = 54 * u32::from(red) + 183 * u32::from(green) + 19 * u32::from(blue);
    (luma >> 8) as u8
}
