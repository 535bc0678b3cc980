//! Matching of an image to the frame of a data set that it shows: [`FrameMatcher`].
//!
//! The linear light of the image is averaged over a coarse grid, which removes most of the sensor noise. The cell
//! values are then correlated with those of every frame. The correlation does not depend on the brightness of the
//! image, so a frame is recognised at every level at which some of it is visible.

use std::sync::LazyLock;

use rayon::prelude::*;

use crate::data::Dataset;
use crate::engine::images::progress::Progress;
use crate::error::Result;
use crate::types::{FrameId, Rgb};

/// Number of grid cells, horizontally and vertically (chosen).
const GRID: [usize; 2] = [32, 24];

/// Minimum correlation at which an image is matched to a frame (chosen).
const MIN_CORRELATION: f64 = 0.5;

/// Linear light of each sRGB code, from 0 to 65,535 (IEC 61966-2-1).
static LINEAR: LazyLock<[u64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let value = code as f64 / 255.0;
        let linear = if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
        (linear * 65_535.0 + 0.5) as u64
    })
});

/// Frames of a data set, each with its normalised cell values.
pub(super) struct FrameMatcher(Vec<(FrameId, Vec<f64>)>);

impl FrameMatcher {
    /// Computes the cell values of every frame of a data set.
    ///
    /// # Errors
    /// If an image cannot be read or decoded.
    pub(super) fn new(dataset: &Dataset, progress: &Progress) -> Result<Self> {
        let ids: Vec<&FrameId> = dataset.frames().collect();
        let bar = progress.bar("looking at frames", ids.len());
        ids.into_par_iter()
            .map(|id| {
                let image = dataset.picture(id)?.decode()?;
                bar.inc();
                Ok((id.clone(), cell_values(&image)))
            })
            .collect::<Result<_>>()
            .map(Self)
    }

    /// Number of frames.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Frame with the highest correlation to an image; `None` if the highest correlation is below the minimum.
    pub(super) fn best_match(&self, image: &Rgb) -> Option<&FrameId> {
        let own = cell_values(image);
        let (highest, id) = self
            .0
            .iter()
            .map(|(id, other)| {
                let correlation: f64 = own.iter().zip(other).map(|(a, b)| a * b).sum();
                (correlation, id)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        (highest >= MIN_CORRELATION).then_some(id)
    }
}

/// Square root of the mean linear light of each cell, normalised to mean 0 and Euclidean norm 1.
fn cell_values(image: &Rgb) -> Vec<f64> {
    let (width, height) = (image.width(), image.height());
    let mut cells = vec![(0_u64, 0_u64); GRID[0] * GRID[1]];
    let (pixels, _) = image.samples().as_chunks::<3>();
    for (i, pixel) in pixels.iter().enumerate() {
        let (x, y) = (i % width * GRID[0] / width, i / width * GRID[1] / height);
        let (light, count) = &mut cells[y * GRID[0] + x];
        *light += pixel.iter().map(|code| LINEAR[usize::from(*code)]).sum::<u64>();
        *count += 1;
    }
    // The square root keeps a bright window from dominating the rest.
    let lights: Vec<f64> = cells.iter().map(|(light, count)| (*light as f64 / (*count).max(1) as f64).sqrt()).collect();
    let mean = lights.iter().sum::<f64>() / lights.len() as f64;
    let norm = lights.iter().map(|light| (light - mean) * (light - mean)).sum::<f64>().sqrt();
    let norm = if norm > 0.0 { norm } else { 1.0 };
    lights.into_iter().map(|light| (light - mean) / norm).collect()
}
