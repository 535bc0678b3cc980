//! Recognition of the frame that an image shows: [`Likenesses`].
//!
//! The linear light of an image is averaged over a coarse grid, which removes most of the sensor noise, and correlated
//! with that of every frame. A correlation does not depend on the brightness of the image. So a frame is recognised at
//! every level that still shows some of it.

use std::sync::LazyLock;

use rayon::prelude::*;

use crate::dataset::Dataset;
use crate::error::Result;
use crate::images::progress::Progress;
use crate::types::{FrameId, Rgb};

/// The number of grid cells, horizontally and vertically (chosen).
const GRID: [usize; 2] = [32, 24];

/// The minimum correlation for an image to show a frame (chosen).
const LEAST: f64 = 0.5;

/// Linear light of each sRGB code, from 0 to 65,535 (IEC 61966-2-1).
static LINEAR: LazyLock<[u64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let value = code as f64 / 255.0;
        let linear = if value <= 0.04045 {
            value / 12.92
        } else {
            libm::pow((value + 0.055) / 1.055, 2.4)
        };
        (linear * 65_535.0 + 0.5) as u64
    })
});

/// Each frame with its cell values.
pub(super) struct Likenesses(Vec<(FrameId, Vec<f64>)>);

impl Likenesses {
    /// The cell values of every frame of a data set.
    pub(super) fn new(dataset: &Dataset, progress: &Progress) -> Result<Self> {
        let names: Vec<&FrameId> = dataset.frames().collect();
        let bar = progress.bar("looking at frames", names.len());
        names
            .into_par_iter()
            .map(|name| {
                let image = dataset.picture(name)?.decode()?;
                bar.inc();
                Ok((name.clone(), likeness(&image)))
            })
            .collect::<Result<_>>()
            .map(Self)
    }

    /// Number of frames.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// The frame with the highest correlation to an image; `None` if it is below the minimum.
    pub(super) fn most_like(&self, image: &Rgb) -> Option<&FrameId> {
        let own = likeness(image);
        let correlation =
            |other: &[f64]| -> f64 { own.iter().zip(other).map(|(a, b)| a * b).sum() };
        let found = self
            .0
            .iter()
            .map(|(name, other)| (correlation(other), name));
        let (highest, name) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (highest >= LEAST).then_some(name)
    }
}

/// The square root of the light of each cell, shifted to mean 0 and scaled so that the squares sum to 1.
fn likeness(image: &Rgb) -> Vec<f64> {
    let (width, height) = (image.width(), image.height());
    let mut cells = vec![(0_u64, 0_u64); GRID[0] * GRID[1]];
    let (pixels, _) = image.samples().as_chunks::<3>();
    for (i, pixel) in pixels.iter().enumerate() {
        let (x, y) = (i % width * GRID[0] / width, i / width * GRID[1] / height);
        let (light, count) = &mut cells[y * GRID[0] + x];
        *light += pixel
            .iter()
            .map(|code| LINEAR[usize::from(*code)])
            .sum::<u64>();
        *count += 1;
    }
    // The square root keeps a bright window from dominating the rest.
    let lights: Vec<f64> = cells
        .iter()
        .map(|(light, count)| (*light as f64 / (*count).max(1) as f64).sqrt())
        .collect();
    let mean = lights.iter().sum::<f64>() / lights.len() as f64;
    let size = lights
        .iter()
        .map(|light| (light - mean) * (light - mean))
        .sum::<f64>()
        .sqrt();
    let size = if size > 0.0 { size } else { 1.0 };
    lights
        .into_iter()
        .map(|light| (light - mean) / size)
        .collect()
}
