//! Reader for the frames of a recording, which must have the same size, form and camera: [`FrameReader`].

use std::path::Path;
use std::str::FromStr;

use super::layout::{Cfa, Layout};
use super::mosaic::{FrameFacts, Mosaic};
use crate::error::{Error, Result};

/// Minimum number of rows and of columns of a frame (chosen for row means and the correlation of neighbours).
const MIN_SIDE: usize = 256;

/// Options for reading files as frames.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReadOptions {
    /// Colour filters of the sensor.
    pub cfa: Cfa,
    /// Part of each frame to use; `None` for the whole frame.
    pub crop: Option<Crop>,
    /// Maximum number of samples of a file.
    pub most_pixels: u64,
}

/// Part of a frame, in sites of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Crop {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

impl FromStr for Crop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, width, height]) => Ok(Self { x, y, width, height }),
            _ => Err("four whole numbers expected: X,Y,WIDTH,HEIGHT".to_owned()),
        }
    }
}

/// A frame with the size of the layout.
#[derive(Debug)]
pub(super) struct Frame {
    pub(super) samples: Vec<u16>,
    pub(super) facts: FrameFacts,
}

/// Reader that requires all frames to match the first one.
#[derive(Debug)]
pub(super) struct FrameReader {
    pub(super) layout: Layout,
    options: ReadOptions,
    first: FirstFrame,
}

/// First frame, which all other frames must match.
#[derive(Debug)]
struct FirstFrame {
    place: String,
    size: [usize; 2],
    facts: FrameFacts,
}

impl FrameReader {
    /// Reads the first frame.
    ///
    /// # Errors
    /// If the frame cannot be read or is too small, or the crop is not inside it.
    pub(super) fn open(path: &Path, options: ReadOptions) -> Result<Self> {
        let mosaic = Mosaic::read(path, options.most_pixels)?;
        let size = [mosaic.width, mosaic.height];
        Ok(Self {
            layout: layout(options, size).map_err(|problem| Error::data(path.display(), problem))?,
            options,
            first: FirstFrame { place: path.display().to_string(), size, facts: mosaic.facts },
        })
    }

    /// Note on rows or columns that are left out; `None` if all are used.
    pub(super) fn omission_note(&self) -> Option<String> {
        let [width, height] = self.first.size;
        let Layout { width: used_width, height: used_height, .. } = self.layout;
        let is_odd = self.options.crop.is_none() && [used_width, used_height] != self.first.size;
        is_odd.then(|| {
            format!("frames of {width} × {height} sites: the last row or column has no whole group of filters and is left out")
        })
    }

    /// Name of the camera in the files.
    pub(super) fn camera(&self) -> Option<&str> {
        self.first.facts.camera.as_deref()
    }

    /// Memory for reading a frame, in bytes: the file, its samples, and the cropped samples.
    pub(super) fn bytes_of_frame(&self) -> usize {
        let [width, height] = self.first.size;
        6 * width * height
    }

    /// Reads and crops a frame.
    ///
    /// # Errors
    /// If the frame cannot be read, or does not match the first frame.
    pub(super) fn read(&self, path: &Path) -> Result<Frame> {
        let mosaic = Mosaic::read(path, self.options.most_pixels)?;
        if let Some(problem) = self.difference(&mosaic) {
            return Err(Error::data(path.display(), problem));
        }
        let Layout { width, height, .. } = self.layout;
        let (x, y) = self.options.crop.map_or((0, 0), |crop| (crop.x, crop.y));
        let samples = if [width, height] == self.first.size {
            mosaic.samples
        } else {
            mosaic
                .samples
                .chunks_exact(mosaic.width)
                .skip(y)
                .take(height)
                .map(|row| &row[x..x + width])
                .collect::<Vec<_>>()
                .concat()
        };
        Ok(Frame { samples, facts: mosaic.facts })
    }

    /// Describes the first difference from the first frame; `None` if the frames match.
    fn difference(&self, mosaic: &Mosaic) -> Option<String> {
        let FirstFrame { place, size, facts } = &self.first;
        let [width, height] = size;
        if [mosaic.width, mosaic.height] != *size {
            return Some(format!(
                "{} × {} sites, but {place} has {width} × {height}; all frames must have one size",
                mosaic.width, mosaic.height
            ));
        }
        if mosaic.facts.form != facts.form {
            return Some(format!(
                "{}, but {place} is {}; all frames must be exported in one way",
                mosaic.facts.form, facts.form
            ));
        }
        if let (Some(camera), Some(first)) = (&mosaic.facts.camera, &facts.camera)
            && camera != first
        {
            return Some(format!("taken by {camera}, but {place} by {first}; all frames must be of one camera"));
        }
        None
    }
}

/// Layout of frames with this width and height, after cropping.
fn layout(options: ReadOptions, [width, height]: [usize; 2]) -> Result<Layout, String> {
    let ReadOptions { cfa, crop, .. } = options;
    let step = cfa.step();
    if let Some(crop) = crop {
        let ends = [crop.x.checked_add(crop.width), crop.y.checked_add(crop.height)];
        let is_inside = ends.iter().zip([width, height]).all(|(end, size)| end.is_some_and(|end| end <= size));
        if !is_inside {
            return Err(format!("--crop reaches beyond the frame of {width} × {height} sites"));
        }
        let sides = [crop.x, crop.y, crop.width, crop.height];
        if sides.iter().any(|side| !side.is_multiple_of(step)) {
            return Err(format!(
                "--crop X,Y,WIDTH,HEIGHT: all four must be even, so that the crop begins with the pattern {cfa}"
            ));
        }
    }
    let (width, height) = crop.map_or((width, height), |crop| (crop.width, crop.height));
    if width < MIN_SIDE || height < MIN_SIDE {
        return Err(format!(
            "{width} × {height} sites are too few for row noise: at least {MIN_SIDE} × {MIN_SIDE} are needed, 512 × 512 are better"
        ));
    }
    // The last row or column of an odd side is not part of a complete filter pattern.
    Ok(Layout { cfa, width: width - width % step, height: height - height % step })
}

#[cfg(test)]
mod tests;
