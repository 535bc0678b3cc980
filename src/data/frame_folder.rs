//! Writer of a folder of frames in the format that [`crate::frames`] reads: [`FrameOutput`].

use std::collections::BTreeMap;
use std::path::Path;

use ndarray::Array2;
use serde_json::{Map, Value, json};

use darkqa_base::error::{Error, Result};
use darkqa_base::files::write;
use darkqa_base::labels;
use darkqa_base::types::{DepthKind, Labels, SegmentName, Segmentation};
use darkqa_pictures::grey_png;

/// File that lists the frames.
pub const FRAMES: &str = "frames.jsonl";

/// Writes the files of one frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameOutput<'a> {
    /// Output folder of all frames.
    pub out: &'a Path,
    pub scene: &'a str,
    pub frame: &'a str,
}

/// One line of `frames.jsonl`.
type ListLine = Map<String, Value>;

impl FrameOutput<'_> {
    /// Starts the line of the frame with its scene, name, width and height.
    pub fn line(&self, width: usize, height: usize) -> ListLine {
        let facts = [
            ("scene", json!(self.scene)),
            ("frame", json!(self.frame)),
            ("width", json!(width)),
            ("height", json!(height)),
        ];
        facts.map(|(key, value)| (key.to_owned(), value)).into_iter().collect()
    }

    /// Writes one file of the frame, and returns its path relative to the output folder.
    pub fn write(&self, kind: &str, ending: &str, bytes: &[u8]) -> Result<String> {
        let path = format!("scenes/{}/{kind}/{}.{ending}", self.scene, self.frame);
        write(&self.out.join(&path), bytes)?;
        Ok(path)
    }

    /// Writes the depth in millimetres as a 16-bit PNG, and adds it to the line.
    pub fn write_depth(&self, line: &mut ListLine, depth: &Array2<u32>, kind: DepthKind) -> Result<()> {
        let units = depth.mapv(|depth| u16::try_from(depth).unwrap_or(u16::MAX));
        let path = self.write("depth", "png", &grey16_png(&units)?)?;
        line.insert("depth".to_owned(), json!(path));
        line.insert("depth_scale".to_owned(), json!(0.001));
        line.insert("depth_kind".to_owned(), json!(kind));
        Ok(())
    }

    /// Writes the class of each pixel as a 16-bit PNG, and adds it to the line.
    pub fn write_semantic(&self, line: &mut ListLine, semantic: &Array2<u16>) -> Result<()> {
        let path = self.write("sem", "png", &grey16_png(semantic)?)?;
        line.insert("sem".to_owned(), json!(path));
        Ok(())
    }

    /// Writes the segments as a 16-bit PNG, or as `.npy` if an id needs more than 16 bits, and adds them to the line.
    pub fn write_segments(
        &self,
        line: &mut ListLine,
        segments: &Array2<u32>,
        segmentation: Segmentation,
    ) -> Result<()> {
        let max_id = segments.iter().copied().max().unwrap_or(0);
        let path = if u16::try_from(max_id).is_ok() {
            self.write("over", "png", &grey16_png(&segments.mapv(|id| id as u16))?)?
        } else {
            self.write("over", "npy", &npy_bytes(segments))?
        };
        let source = match segmentation {
            Segmentation::Instances => "renderer",
            Segmentation::Parts => "superpixel",
        };
        line.insert("over".to_owned(), json!(path));
        line.insert("over_source".to_owned(), json!(source));
        Ok(())
    }
}

/// Writes the names of the segments of a scene; no file if there are none.
pub fn write_segment_names(out: &Path, scene: &str, names: &BTreeMap<u32, SegmentName>) -> Result<()> {
    if names.is_empty() {
        return Ok(());
    }
    let text = serde_json::to_string_pretty(names).map_err(|e| Error::data("segments", e))?;
    let path = out.join("scenes").join(scene).join("segments.json");
    write(&path, text.as_bytes())
}

/// Writes the files about the whole folder. The list of frames comes last, because it marks the folder as complete.
pub fn write_folder_files<'a>(
    out: &Path,
    labels: &Labels,
    info: &Value,
    lines: impl Iterator<Item = &'a ListLine>,
) -> Result<()> {
    write(&out.join("classes.json"), labels::json(labels).as_bytes())?;
    write(&out.join("dataset.json"), format!("{info:#}\n").as_bytes())?;
    let mut list = String::new();
    for line in lines {
        let line = serde_json::to_string(line).map_err(|e| Error::data(FRAMES, e))?;
        list.push_str(&line);
        list.push('\n');
    }
    write(&out.join(FRAMES), list.as_bytes())
}

/// Encodes segments as a `.npy` file (numpy.lib.format, version 1.0).
fn npy_bytes(segments: &Array2<u32>) -> Vec<u8> {
    let (height, width) = segments.dim();
    let header = format!("{{'descr': '<u4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    // The header ends with a newline, padded so that the data start at a multiple of 64 bytes.
    let length = (header.len() + 11).next_multiple_of(64) - 10;
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((length as u16).to_le_bytes());
    file.extend(format!("{header:<width$}\n", width = length - 1).bytes());
    file.extend(segments.iter().flat_map(|id| id.to_le_bytes()));
    file
}

/// Encodes a map as a 16-bit grey PNG.
fn grey16_png(map: &Array2<u16>) -> Result<Vec<u8>> {
    let (height, width) = map.dim();
    let samples: Vec<u16> = map.iter().copied().collect();
    grey_png(width, height, &samples)
}
