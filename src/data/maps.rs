//! Depth, semantic and segment maps of an image: [`MapPaths`], [`MapFiles`].
//!
//! A map has one number for each pixel of its image. A map of another size is refused instead of scaled, because ids
//! cannot be interpolated.
//!
//! Metadata of a frame ([`FrameFacts`]), and its files before decoding ([`FrameFiles`]).
//!
//! Image of a frame before decoding: [`Picture`].

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ndarray::Array2;
use serde::{Serialize, Serializer};

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{
    DepthKind, Digest, Frame, FrameId, InputNote, Intrinsics, Pixels, Rgb, SegmentName, Segmentation,
};
use darkqa_pictures::decode_rule::MAX_PIXELS;
use darkqa_pictures::image_file::StatedOrientation;
use darkqa_pictures::npy::Npy;
use darkqa_pictures::raw_png::{RawPng, SampleForm};
use darkqa_pictures::{DecodeRule, ImageFile};
use darkqa_rooms::Room;

/// Maximum depth of a pixel, in millimetres: a kilometre, deeper than any room (chosen). A larger value means a wrong
/// unit, such as millimetres read as metres.
const MAX_DEPTH_MM: f64 = 1e6;

/// Paths of the maps that a frame has.
#[derive(Debug, Clone, Default)]
pub struct MapPaths {
    pub depth: Option<DepthFile>,
    /// Class of each pixel: a PNG file of 8-bit grey, 16-bit grey or palette indices.
    pub semantic: Option<PathBuf>,
    /// Segment of each pixel, 0 for none: a 16-bit grey PNG file, or a `.npy` file of integers.
    pub segments: Option<PathBuf>,
}

/// File of a depth map.
#[derive(Debug, Clone)]
pub enum DepthFile {
    /// 16-bit grey PNG file; 0 means no depth.
    Png {
        path: PathBuf,
        /// Metres per unit of the samples.
        scale: f64,
    },
    /// `.npy` file of metres as 2-, 4- or 8-byte floats. NaN, infinity, 0 and negative numbers mean no depth.
    Npy(PathBuf),
}

impl DepthFile {
    /// The depth file at `path`; `scale` is the `depth_scale` of the frame.
    pub fn new(path: PathBuf, scale: Option<f64>) -> Result<Self, String> {
        match (is_npy(&path), scale) {
            (true, None | Some(1.0)) => Ok(Self::Npy(path)),
            (true, Some(scale)) => {
                Err(format!("depth_scale is {scale}, but a .npy file of depth is in metres; leave it out"))
            }
            (false, Some(scale)) if scale.is_finite() && scale > 0.0 => Ok(Self::Png { path, scale }),
            (false, Some(scale)) => {
                Err(format!("depth_scale is {scale}; the metres in one unit of the depth PNG expected, as 0.001"))
            }
            (false, None) => {
                Err("depth_scale is missing: the metres in one unit of the depth PNG, as 0.001".to_owned())
            }
        }
    }

    fn path(&self) -> &Path {
        match self {
            Self::Png { path, .. } | Self::Npy(path) => path,
        }
    }

    /// Decodes the depth in millimetres, whatever the size of the map.
    pub fn decode_any_size(&self, bytes: &[u8]) -> Result<Array2<u32>, String> {
        let size = match self {
            Self::Png { .. } => RawPng::open(bytes, &[SampleForm::Grey16], MAX_PIXELS)?.size,
            Self::Npy(_) => Npy::parse(bytes)?.size,
        };
        self.decode(bytes, size)
    }

    /// Decodes the depth in millimetres of a map that must have this size.
    fn decode(&self, bytes: &[u8], size: Size) -> Result<Array2<u32>, String> {
        match self {
            Self::Png { scale, .. } => {
                // Convert the scale first: most scales are a whole number of millimetres, so the product is exact.
                let unit = scale * 1_000.0;
                let table: Vec<u32> =
                    (0..=u16::MAX).map(|units| millimetres(units.into(), unit).unwrap_or(u32::MAX)).collect();
                let depths = png(bytes, &[SampleForm::Grey16], size, |units| table[usize::from(units)])?;
                if let Some(at) = depths.iter().position(|depth| *depth == u32::MAX) {
                    let units = png(bytes, &[SampleForm::Grey16], size, |units| units)?[at];
                    millimetres(units.into(), unit)?;
                }
                Array2::from_shape_vec(size, depths).map_err(|e| e.to_string())
            }
            Self::Npy(_) => {
                let metres = npy(bytes, size)?.floats()?;
                collect_grid(size, metres.map(|metres| millimetres(metres, 1_000.0)))
            }
        }
    }
}

impl MapPaths {
    /// Paths of all map files.
    pub fn paths(&self) -> impl Iterator<Item = PathBuf> {
        self.depth
            .iter()
            .map(|depth| depth.path().to_owned())
            .chain([&self.semantic, &self.segments].into_iter().flatten().cloned())
    }

    /// A frame without maps.
    pub const NONE: Self = Self { depth: None, semantic: None, segments: None };

    /// True if the frame has no maps.
    pub(super) fn is_empty(&self) -> bool {
        self.depth.is_none() && self.semantic.is_none() && self.segments.is_none()
    }

    /// Path and size (height, width) of each map, from its header.
    ///
    /// # Errors
    /// If a file cannot be read or is not a map; the error names it.
    pub(super) fn sizes(&self) -> Result<Vec<(&Path, Size)>> {
        let depth = self.depth.as_ref().map(DepthFile::path);
        let files = [depth, self.semantic.as_deref(), self.segments.as_deref()];
        files
            .into_iter()
            .flatten()
            .map(|path| {
                let bytes = files::bytes(path)?;
                let size = if is_npy(path) {
                    Npy::parse(&bytes).map(|npy| npy.size)
                } else {
                    RawPng::open(&bytes, &SampleForm::ALL, MAX_PIXELS).map(|png| png.size).map_err(String::from)
                };
                Ok((path, with_path(path, size)?))
            })
            .collect()
    }

    /// Turns off the EXIF rotation of the image if it has maps: maps are not rotated, so they must have the size of the
    /// image as stored.
    ///
    /// # Errors
    /// If the file states a rotation and a map has another size than the image as stored.
    pub(super) fn match_orientation(&self, image: ImageFile) -> Result<ImageFile> {
        if self.is_empty() {
            return Ok(image);
        }
        let Some(StatedOrientation { orientation, stored_size }) = image.stated_orientation() else {
            return Ok(image);
        };
        for (path, size) in self.sizes()? {
            if size != stored_size {
                let problem = format_args!(
                    "{} × {} pixels (height × width), but its image {} is stored with {} × {} and turned by its EXIF orientation {orientation}; maps must have the size of the image as stored, which is then not turned, or the file no orientation",
                    size.0,
                    size.1,
                    image.place(),
                    stored_size.0,
                    stored_size.1,
                );
                return Err(Error::data(path.display(), problem));
            }
        }
        Ok(image.ignoring_orientation())
    }

    /// Reads the map files without decoding them.
    ///
    /// # Errors
    /// If a file cannot be read; the error names it.
    pub fn read(&self) -> Result<MapFiles<'_>> {
        Ok(MapFiles {
            maps: self,
            depth: optional_bytes(self.depth.as_ref().map(DepthFile::path))?,
            semantic: optional_bytes(self.semantic.as_deref())?,
            segments: optional_bytes(self.segments.as_deref())?,
        })
    }
}

fn optional_bytes(path: Option<&Path>) -> Result<Option<Vec<u8>>> {
    path.map(files::bytes).transpose()
}

/// Bytes of a frame's map files.
#[derive(Debug)]
pub struct MapFiles<'a> {
    maps: &'a MapPaths,
    depth: Option<Vec<u8>>,
    semantic: Option<Vec<u8>>,
    segments: Option<Vec<u8>>,
}

impl MapFiles<'_> {
    /// Digest of the files and of the unit of depth.
    pub fn digest(&self) -> Digest {
        let unit = match &self.maps.depth {
            Some(DepthFile::Png { scale, .. }) => scale.to_string(),
            Some(DepthFile::Npy(_)) => "m".to_owned(),
            None => String::new(),
        };
        let files = [&self.depth, &self.semantic, &self.segments]
            .map(|file| file.as_deref().map_or_else(Vec::new, |bytes| Digest::from_bytes(bytes).as_bytes().to_vec()));
        Digest::from_parts([unit.as_bytes()].into_iter().chain(files.iter().map(Vec::as_slice)))
    }

    /// Decodes the depth of each pixel, in millimetres; `None` without a depth map.
    ///
    /// # Errors
    /// If the file has another format, another size than the image, or an impossible value; the error names it.
    pub fn depth(&self, size: Size) -> Result<Option<Array2<u32>>> {
        let Some((file, bytes)) = self.maps.depth.as_ref().zip(self.depth.as_ref()) else {
            return Ok(None);
        };
        with_path(file.path(), file.decode(bytes, size)).map(Some)
    }

    /// Decodes the class of each pixel; `None` without a semantic map.
    ///
    /// # Errors
    /// As [`Self::depth`].
    pub fn semantic(&self, size: Size) -> Result<Option<Array2<u16>>> {
        let Some((path, bytes)) = self.maps.semantic.as_ref().zip(self.semantic.as_ref()) else {
            return Ok(None);
        };
        with_path(path, semantic(bytes, size)).map(Some)
    }

    /// Decodes the segment of each pixel; `None` without a segment map.
    ///
    /// # Errors
    /// As [`Self::depth`].
    pub fn segments(&self, size: Size) -> Result<Option<Array2<u32>>> {
        let Some((path, bytes)) = self.maps.segments.as_ref().zip(self.segments.as_ref()) else {
            return Ok(None);
        };
        with_path(path, segments(bytes, size, is_npy(path))).map(Some)
    }
}

/// Height and width in pixels.
pub(super) type Size = (usize, usize);

fn semantic(bytes: &[u8], size: Size) -> Result<Array2<u16>, String> {
    let ids = png(bytes, &SampleForm::ALL, size, |id| id)?;
    Array2::from_shape_vec(size, ids).map_err(|e| e.to_string())
}

fn segments(bytes: &[u8], size: Size, is_npy: bool) -> Result<Array2<u32>, String> {
    if is_npy {
        return collect_grid(size, npy(bytes, size)?.integers()?.map(segment_id));
    }
    // 8-bit files are refused: they have room for 255 segments, and larger ids are lost silently when they are written.
    let ids = png(bytes, &[SampleForm::Grey16], size, u32::from)?;
    Array2::from_shape_vec(size, ids).map_err(|e| e.to_string())
}

/// Checks the range of a segment id.
fn segment_id(id: i128) -> Result<u32, String> {
    u32::try_from(id).map_err(|_| format!("{id} is not the id of a segment; 0 (none) to {} expected", u32::MAX))
}

/// Converts a depth to whole millimetres, rounded half to even; 0 if there is no depth. `unit` is millimetres per unit.
pub fn millimetres(units: f64, unit: f64) -> Result<u32, String> {
    if !units.is_finite() || units <= 0.0 {
        return Ok(0);
    }
    let depth = units * unit;
    if depth > MAX_DEPTH_MM {
        return Err(format!(
            "a depth of {} m, deeper than any room ({} m at most); a .npy file is in metres and a PNG in units of its depth_scale, with 0 where there is no depth",
            depth / 1_000.0,
            MAX_DEPTH_MM / 1_000.0
        ));
    }
    Ok(depth.round_ties_even() as u32)
}

fn is_npy(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npy"))
}

/// Adds the path of the file to the error.
fn with_path<T>(path: &Path, read: Result<T, String>) -> Result<T> {
    read.map_err(|problem| Error::data(path.display(), problem))
}

/// Decodes a PNG map of this size and converts each sample.
fn png<T: Clone>(bytes: &[u8], forms: &[SampleForm], size: Size, convert: impl Fn(u16) -> T) -> Result<Vec<T>, String> {
    let png = RawPng::open(bytes, forms, MAX_PIXELS)?;
    check_size(png.size, size)?;
    png.samples(convert)
}

/// Parses a `.npy` map of this size.
fn npy(bytes: &[u8], size: Size) -> Result<Npy<'_>, String> {
    let npy = Npy::parse(bytes)?;
    check_size(npy.size, size)?;
    Ok(npy)
}

fn check_size(map: Size, image: Size) -> Result<(), String> {
    if map == image {
        return Ok(());
    }
    Err(format!(
        "{} × {} pixels (height × width), but its image has {} × {}; a map must have the size of its image",
        map.0, map.1, image.0, image.1
    ))
}

fn collect_grid<T>(size: Size, values: impl Iterator<Item = Result<T, String>>) -> Result<Array2<T>, String> {
    let values = values.collect::<Result<Vec<T>, String>>()?;
    Array2::from_shape_vec(size, values).map_err(|e| e.to_string())
}

/// Metadata of a frame: scene, camera, names of segments, room.
#[derive(Debug, Clone, Default, Serialize)]
pub struct FrameFacts {
    pub scene: String,
    pub depth_kind: DepthKind,
    pub intrinsics: Option<Intrinsics>,
    pub segmentation: Segmentation,
    #[serde(serialize_with = "serialize_as_pairs")]
    pub names: Arc<BTreeMap<u32, SegmentName>>,
    pub room: Option<String>,
}

/// Serializes a map as a list of pairs, because keys of a JSON object must be strings.
fn serialize_as_pairs<S: Serializer>(
    names: &BTreeMap<u32, SegmentName>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_seq(names)
}

/// Files of a frame, not decoded.
#[derive(Debug)]
pub struct FrameFiles<'a> {
    pub id: &'a FrameId,
    pub picture: Picture,
    pub maps: MapFiles<'a>,
    pub facts: &'a FrameFacts,
}

impl FrameFiles<'_> {
    /// Digest of all files and metadata, without the name of the frame.
    ///
    /// # Errors
    /// If a number of the camera intrinsics is not finite.
    pub fn digest(&self) -> Result<Digest> {
        let parts = [self.picture.digest(), self.maps.digest(), Digest::canonical("darkqa.view/1", self.facts)?];
        Ok(Digest::from_parts(parts.iter().map(|part| &part.as_bytes()[..])))
    }

    /// Changes made to the samples while decoding, such as color conversion.
    #[must_use]
    pub fn note(&self) -> InputNote {
        self.picture.note()
    }

    /// Decodes the image and the maps.
    ///
    /// # Errors
    /// If an image or a map is broken, or a map has another size than the image; the error names the file.
    pub fn decode(&self) -> Result<Frame> {
        if let Picture::Drawn(room, _) = &self.picture {
            return room.frame_with(self.picture.decode()?);
        }
        let rgb = self.picture.decode()?;
        let size = (rgb.height(), rgb.width());
        Ok(Frame {
            id: self.id.clone(),
            scene: self.facts.scene.clone(),
            depth: self.maps.depth(size)?,
            depth_kind: self.facts.depth_kind,
            intrinsics: self.facts.intrinsics,
            semantic: self.maps.semantic(size)?,
            segments: self.maps.segments(size)?,
            segmentation: self.facts.segmentation,
            names: Arc::clone(&self.facts.names),
            room: self.facts.room.clone(),
            rgb,
        })
    }
}

/// Image that is not decoded yet: a file, or a built-in room.
#[derive(Debug)]
pub enum Picture {
    /// Bytes of an image file.
    Encoded(ImageFile),
    /// A built-in room, drawn on demand, and the rule that scales its light.
    Drawn(Room, DecodeRule),
}

impl Picture {
    /// Digest of everything that decides the pixels: the file and its decoding rule, or the settings of a room.
    #[must_use]
    pub fn digest(&self) -> Digest {
        match self {
            Self::Encoded(file) => file.digest(),
            Self::Drawn(room, _) => match self.note().exposure_ev {
                None => room.digest(),
                Some(ev) => Digest::from_parts([
                    &b"darkqa.reading/1"[..],
                    room.digest().as_bytes(),
                    format!("exposure {ev}").as_bytes(),
                ]),
            },
        }
    }

    /// Changes made to the samples while decoding, such as color conversion.
    #[must_use]
    pub fn note(&self) -> InputNote {
        match self {
            Self::Encoded(file) => file.note(),
            Self::Drawn(room, rule) => rule.input_note(room.is_light()),
        }
    }

    /// Exposure value at ISO 100 of the camera's settings; `None` if the file does not state them.
    #[must_use]
    pub fn exposure_value(&self) -> Option<f64> {
        match self {
            Self::Encoded(file) => file.exposure_value(),
            Self::Drawn(..) => None,
        }
    }

    /// Checks that the image can be decoded, and returns its width and height in pixels.
    ///
    /// # Errors
    /// If it cannot be decoded; the error names the file.
    pub fn check(&self) -> Result<(u32, u32)> {
        match self {
            Self::Encoded(file) => file.check(),
            Self::Drawn(room, _) => Ok(room.size().map(|side| side as u32).into()),
        }
    }

    /// Decodes the pixels at their full bit depth.
    ///
    /// # Errors
    /// If the file is broken or not supported; the error names the file.
    pub fn pixels(&self) -> Result<Pixels> {
        match self {
            Self::Encoded(file) => file.pixels(),
            Self::Drawn(room, rule) => Ok(match room.pixels() {
                Pixels::Light(light) => Pixels::Light(rule.scale_exposure(light)),
                codes => codes,
            }),
        }
    }

    /// Decodes the clean image as 8-bit sRGB.
    ///
    /// # Errors
    /// If the file is broken or not supported; the error names the file.
    pub fn decode(&self) -> Result<Rgb> {
        match self {
            Self::Encoded(file) => file.decode(),
            Self::Drawn(..) => Ok(Rgb::clone(&self.pixels()?.codes())),
        }
    }
}
