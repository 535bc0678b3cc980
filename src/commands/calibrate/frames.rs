//! Reader for the frames of a recording, which must have the same size, form and camera: [`FrameReader`].
//!
//! Parallel processing of many frames with bounded memory: [`in_batches`].
//!
//! Hot pixels, which are left out of all sums: [`HotPixels`].
//!
//! Colour filters of a sensor ([`Cfa`]), and the planes, rows and tiles of its frames ([`Layout`]).
//!
//! Input files of a calibration: [`Inputs`].

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

use clap::ValueEnum;
use rayon::prelude::*;
use serde::Serialize;

use super::mosaic::{FrameFacts, Mosaic};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Digest;
use darkqa_base::types::flags::flag_words;

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

/// Memory limit for the frames in memory, in bytes (chosen). Reading a frame of 24 megapixels takes 0.14 GB.
const MEMORY: usize = 1 << 30;

/// Calls `work` for the items on all threads, and `take` with the results in the order of the items. `bytes` is the
/// memory for one item; at least one item is processed at a time.
///
/// # Errors
/// The error of the first item that fails, in the order of the items.
pub(super) fn in_batches<T: Sync, R: Send>(
    items: &[T],
    bytes: usize,
    work: impl Fn(&T) -> Result<R> + Sync,
    mut take: impl FnMut(&T, R) -> Result<()>,
) -> Result<()> {
    let batch_size = (MEMORY / bytes.max(1)).clamp(1, 2 * rayon::current_num_threads());
    for batch in items.chunks(batch_size) {
        let results: Vec<Result<R>> = batch.par_iter().map(&work).collect();
        for (item, result) in batch.iter().zip(results) {
            take(item, result?)?;
        }
    }
    Ok(())
}

/// Hot pixels by part of a row, see [`Layout::place`](Layout::place).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct HotPixels {
    /// Columns within the plane for each part of a row, in ascending order.
    columns: Vec<Vec<u32>>,
    count: usize,
}

impl HotPixels {
    /// Hot pixels by part of a row; each list of columns must be in ascending order.
    pub(super) fn new(columns: Vec<Vec<u32>>) -> Self {
        let count = columns.iter().map(Vec::len).sum();
        Self { columns, count }
    }

    /// No hot pixels, in a layout with this number of parts of rows.
    pub(super) fn none(plane_rows: usize) -> Self {
        Self::new(vec![Vec::new(); plane_rows])
    }

    /// Hot columns in a part of a row.
    pub(super) fn columns(&self, plane_row: usize) -> impl Iterator<Item = usize> + '_ {
        self.columns[plane_row].iter().map(|column| *column as usize)
    }

    /// Number of hot pixels.
    pub(super) fn count(&self) -> usize {
        self.count
    }
}

/// Number of tiles of a plane along each side (chosen). Photon transfer is fitted to tiles, so that the fall-off of
/// light towards the corners adds points and not variance.
pub(super) const TILES: usize = 8;

/// The colours of the four sites at the upper left corner of a frame, row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum, Serialize)]
#[serde(rename_all = "UPPERCASE")]
#[value(rename_all = "UPPER")]
pub(crate) enum Cfa {
    /// Red and green above green and blue
    #[default]
    Rggb,
    /// Blue and green above green and red
    Bggr,
    /// Green and red above blue and green
    Grbg,
    /// Green and blue above red and green
    Gbrg,
    /// No colour filters
    #[value(name = "mono")]
    #[serde(rename = "mono")]
    Mono,
}

flag_words!(Cfa);

impl Cfa {
    /// Period of the pattern in rows and columns: the number of planes in a row.
    pub(super) fn step(self) -> usize {
        if self == Self::Mono { 1 } else { 2 }
    }

    /// Number of planes.
    pub(super) fn planes(self) -> usize {
        self.step() * self.step()
    }

    /// Plane of the sites in a row whose column modulo the period is `parity`. Planes 0 to 3 are red, green in red
    /// rows, green in blue rows, and blue; the only plane of a sensor without filters is 0.
    pub(super) fn plane(self, row: usize, parity: usize) -> usize {
        let [first_row, first_column] = match self {
            Self::Mono => return 0,
            Self::Rggb => [0, 0],
            Self::Grbg => [0, 1],
            Self::Gbrg => [1, 0],
            Self::Bggr => [1, 1],
        };
        2 * ((row + first_row) % 2) + (parity + first_column) % 2
    }

    /// Names of the planes, in order.
    pub(crate) fn plane_names(self) -> &'static [&'static str] {
        match self {
            Self::Mono => &["all"],
            _ => &["R", "G1", "G2", "B"],
        }
    }
}

/// Colour filters and size of all frames of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(super) cfa: Cfa,
    pub(super) height: usize,
    pub(super) width: usize,
}

impl Layout {
    /// Rows and columns of each plane.
    pub(super) fn plane_size(self) -> [usize; 2] {
        [self.height, self.width].map(|side| side / self.cfa.step())
    }

    /// Number of parts of rows, each with the sites of one plane in one row. They are numbered row by row, and by
    /// parity within a row.
    pub(super) fn plane_rows(self) -> usize {
        self.height * self.cfa.step()
    }

    /// Row and column parity of a part of a row.
    pub(super) fn place(self, plane_row: usize) -> [usize; 2] {
        let step = self.cfa.step();
        [plane_row / step, plane_row % step]
    }

    /// Rows or columns of a tile, for a plane with `side` rows or columns.
    pub(super) fn tile(side: usize, tile: usize) -> Range<usize> {
        tile * side / TILES..(tile + 1) * side / TILES
    }

    /// Tile row of a sensor row.
    pub(super) fn tile_row(self, row: usize) -> usize {
        let [rows, _] = self.plane_size();
        let row = row / self.cfa.step();
        (0..TILES).find(|tile| Self::tile(rows, *tile).contains(&row)).unwrap_or(TILES - 1)
    }
}

/// All frames read so far, in the order of the recording.
#[derive(Debug, Default)]
pub(super) struct Inputs {
    /// Path and digest of each frame.
    list: Vec<(String, Digest)>,
    /// Path of the bias, flat or dark frame with each digest.
    places: BTreeMap<Digest, String>,
    /// First and last date in the files.
    dates: Option<[String; 2]>,
}

impl Inputs {
    /// Adds a frame.
    pub(super) fn add(&mut self, path: &Path, facts: &FrameFacts) {
        self.list.push((path.display().to_string(), facts.digest));
        if let Some(taken) = &facts.taken {
            let [first, last] = self.dates.get_or_insert_with(|| [taken.clone(), taken.clone()]);
            if taken < first {
                first.clone_from(taken);
            }
            if taken > last {
                last.clone_from(taken);
            }
        }
    }

    /// Adds a frame that may be used only once.
    ///
    /// # Errors
    /// See [`check_unique`](Self::check_unique).
    pub(super) fn add_unique(&mut self, path: &Path, facts: &FrameFacts) -> Result<()> {
        self.check_unique(&path.display().to_string(), facts.digest)?;
        self.add(path, facts);
        Ok(())
    }

    /// Checks that a frame is not a copy of an earlier one. Overexposed frames need no check, because they may be
    /// identical.
    ///
    /// # Errors
    /// If the same frame was used before: copies have no independent noise.
    pub(super) fn check_unique(&mut self, place: &str, digest: Digest) -> Result<()> {
        match self.places.insert(digest, place.to_owned()) {
            Some(first) => Err(Error::data(
                place,
                format_args!("the same frame as {first}; copies have no noise between them, use each frame once"),
            )),
            None => Ok(()),
        }
    }

    /// Number of frames.
    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// Digest of the paths of all frames, relative to `folder`, and of their contents.
    ///
    /// # Errors
    /// Never for strings; only numbers that are not finite have no canonical form.
    pub(super) fn digest(&self, folder: &Path) -> Result<Digest> {
        let prefix = folder.display().to_string();
        let list: Vec<(String, String)> = self
            .list
            .iter()
            .map(|(place, digest)| {
                let inner = place.strip_prefix(&prefix).unwrap_or(place);
                let inner = inner.trim_start_matches(['/', '\\']).replace('\\', "/");
                (inner, digest.to_string())
            })
            .collect();
        Digest::canonical("darkqa.calibration-frames/1", &list)
    }

    /// First and last date in the files.
    pub(super) fn dates(&self) -> Option<&[String; 2]> {
        self.dates.as_ref()
    }
}
