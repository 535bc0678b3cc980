//! Images, frames with their maps, and pixels.
//!
//! Images of three channels: 8-bit codes ([`Rgb`]), 16-bit codes ([`Rgb16Image`]) and linear light ([`Light`]).
//!
//! Images and their maps: [`Frame`], [`FrameId`].
//!
//! Class names of the numbers in semantic and segment maps: [`Labels`], [`SegmentName`].
//!
//! The pixels of a clean frame in the bit depth of its file: [`Pixels`].
//!
//! Conversion of 16-bit codes and linear light to the 8-bit codes of the undarkened image: [`from_rgb16`],
//! [`from_linear`].
//!
//! The instruction sets ([`Isa`]) that a [`Kernel`] over samples is compiled for.
//!
//! Kernels are plain loops over arrays, which the compiler turns into vector instructions. They use only operations of
//! IEEE 754 (no fused multiply-add, no reordering) and of integers. So each instruction set gives the same bits, which
//! tests check.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, LazyLock};

use serde::{Deserialize, Serialize};

use super::values::Digest;
use crate::error::Error;

#[cfg(feature = "program")]
use ndarray::Array2;

/// An image of height × width × 3 samples and at least one pixel.
#[derive(Clone, PartialEq, Eq)]
pub struct Image<T> {
    height: usize,
    width: usize,
    samples: Vec<T>,
}

/// An 8-bit sRGB image.
pub type Rgb = Image<u8>;

/// An image of 16-bit sRGB codes.
pub type Rgb16Image = Image<u16>;

/// Linear light of an image, with the primaries of sRGB; black is 0, white is 1.
///
/// Either the light of a scene, or the light that a display emits for codes: their gamma is undone, the tone curve of
/// the camera is not.
pub type Light = Image<f32>;

/// A sample of an [`Image`].
pub trait Sample: Copy + Default + fmt::Display {
    /// Description of such an image, for messages.
    const IMAGE: &str;
    /// Name of the image type, for `Debug`.
    const NAME: &str;

    /// True if the value is allowed in an image.
    fn is_valid(self) -> bool {
        true
    }
}

impl Sample for u8 {
    const IMAGE: &str = "RGB image";
    const NAME: &str = "Rgb";
}

impl Sample for u16 {
    const IMAGE: &str = "image of 16 bits";
    const NAME: &str = "Rgb16Image";
}

impl Sample for f32 {
    const IMAGE: &str = "image of light";
    const NAME: &str = "Light";

    fn is_valid(self) -> bool {
        self.is_finite() && self >= 0.0
    }
}

impl<T: Sample> Image<T> {
    /// An image from height × width × 3 samples, row by row, red first.
    ///
    /// # Errors
    /// If the number of samples is not `height * width * 3`, or is zero, or a sample of light is not a finite number of
    /// at least 0.
    pub fn new(height: usize, width: usize, samples: Vec<T>) -> Result<Self, Error> {
        let found = samples.len();
        let expected = height.checked_mul(width).and_then(|n| n.checked_mul(3));
        if found == 0 || expected != Some(found) {
            let image = T::IMAGE;
            return Err(Error::data("image", format_args!("{found} samples do not make a {height} × {width} {image}")));
        }
        if let Some(sample) = samples.iter().find(|sample| !sample.is_valid()) {
            return Err(Error::data(
                "image",
                format_args!("{sample} is not an amount of light; expected a finite number of at least 0"),
            ));
        }
        Ok(Self { height, width, samples })
    }

    /// A black image of at least one pixel.
    #[must_use]
    pub fn black(height: usize, width: usize) -> Self {
        let (height, width) = (height.max(1), width.max(1));
        Self { height, width, samples: vec![T::default(); height * width * 3] }
    }

    /// The height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The samples, row by row, red first.
    #[must_use]
    pub fn samples(&self) -> &[T] {
        &self.samples
    }

    /// Converts the image into its samples.
    #[must_use]
    pub fn into_samples(self) -> Vec<T> {
        self.samples
    }

    /// The samples, to change them in place.
    #[must_use]
    pub fn samples_mut(&mut self) -> &mut [T] {
        &mut self.samples
    }
}

impl<T: Sample> fmt::Debug for Image<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({} × {})", T::NAME, self.height, self.width)
    }
}

/// The name of a frame, unique in its data set: `scene/frame`, or the path of an image in a ready-made set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FrameId(pub String);

impl FrameId {
    /// The name without the extension of an image file, if it has one.
    #[must_use]
    pub fn bare(&self) -> &str {
        match self.0.rsplit_once('.') {
            Some((bare, ending)) if is_image_ending(ending) && !bare.is_empty() && !bare.ends_with('/') => bare,
            _ => &self.0,
        }
    }
}

impl fmt::Display for FrameId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// The extensions of supported image files, in lower case.
const IMAGE_ENDINGS: [&str; 8] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "exr"];

/// True if the extension, in any case, is that of a supported image format.
pub fn is_image_ending(ending: &str) -> bool {
    IMAGE_ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// One view of a scene: an image and, if the data set has them, its maps of the same height and width.
#[cfg(feature = "program")]
#[derive(Debug, Clone)]
pub struct Frame {
    /// The name of the frame, unique in its data set.
    pub id: FrameId,
    /// The scene of the frame; empty if the data set names no scenes.
    pub scene: String,
    /// The pixels of the image, 8-bit sRGB.
    pub rgb: Rgb,
    /// The depth of each pixel in millimetres, 0 where it is unknown.
    pub depth: Option<Array2<u32>>,
    /// The direction along which depth is measured.
    pub depth_kind: DepthKind,
    /// The camera's projection; `None` if the data set does not state it.
    pub intrinsics: Option<Intrinsics>,
    /// The class of each pixel, as a number in the data set's label space.
    pub semantic: Option<Array2<u16>>,
    /// The segment of each pixel, 0 for none.
    pub segments: Option<Array2<u32>>,
    /// Whether a segment is a whole object or a part of one.
    pub segmentation: Segmentation,
    /// The names of the scene's segments, by segment; some may be missing.
    pub names: Arc<BTreeMap<u32, SegmentName>>,
    /// The type of the room; `None` if the data set does not state it.
    pub room: Option<String>,
}

/// The direction along which depth is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "program", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum DepthKind {
    /// The optical axis: z.
    #[default]
    Planar,
    /// The ray through the pixel: the distance itself.
    Euclid,
}

/// The meaning of a segment in a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Segmentation {
    /// Each object is one segment.
    #[default]
    Instances,
    /// A segment may be a part of an object, such as a superpixel; neighbouring segments of one class are one object.
    Parts,
}

/// A pinhole camera; all values are in pixels, and (0, 0) is the centre of the first pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// The focal length along a row, in pixels.
    pub fx: f64,
    /// The focal length along a column, in pixels.
    pub fy: f64,
    /// The position of the optical axis along a row, in pixels.
    pub cx: f64,
    /// The position of the optical axis along a column, in pixels.
    pub cy: f64,
}

/// Suffixes in HM3D-Sem's names of objects seen through a door or window. They name the place of the object, not its
/// class.
pub const OTHER_PLACES: [&str; 5] = ["/otherroom", "/ otherroom", "/other room", "/outside", "/ outside"];

/// The class of one number in a semantic map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Label {
    /// The name in the data set, as `night stand`.
    pub name: String,
    /// The class in the canonical label space (mpcat40), as `chest_of_drawers`.
    pub canonical: String,
}

/// The label space of a data set: its numbers and names, with their canonical classes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Labels {
    /// The name of the label space, as `nyu40`.
    pub space: String,
    /// The numbers of unlabelled pixels.
    pub void: BTreeSet<u16>,
    /// The class of each number.
    pub labels: BTreeMap<u16, Label>,
    /// The canonical classes with a label of their own: if the map does not contain one, neither does the image. A
    /// class that is not in this set may be present under a more general label, as sinks are labelled `objects` in
    /// NYU13.
    pub expressible: BTreeSet<String>,
}

impl Labels {
    /// The digest of the numbers, names and canonical classes; the space's name is not in it.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let numbers = self.void.iter().map(|id| vec![id.to_string()]);
        let labels =
            self.labels.iter().map(|(id, label)| vec![id.to_string(), label.name.clone(), label.canonical.clone()]);
        let expressible = self.expressible.iter().map(|name| vec![name.clone()]);
        let words: Vec<String> = numbers
            .chain([vec![";".to_owned()]])
            .chain(labels)
            .chain([vec![";".to_owned()]])
            .chain(expressible)
            .flatten()
            .collect();
        Digest::from_parts(words.iter().map(String::as_bytes))
    }
}

/// The name and class of one segment.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentName {
    /// The name in the data set, as `kitchen cabinet`.
    pub name: String,
    /// The canonical class, as `cabinet`.
    pub canonical: String,
    /// The region (room) of the scene that the segment is in; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<i64>,
}

/// The pixels of a clean frame in the bit depth of its file. Clones share the pixels.
#[derive(Debug, Clone)]
pub enum Pixels {
    /// 8-bit sRGB codes.
    Codes8(Arc<Rgb>),
    /// 16-bit sRGB codes.
    Rgb16Image(Arc<Rgb16Image>),
    /// Linear light of the scene, with the primaries of sRGB. White is 1; brighter light is above 1.
    Light(Arc<Light>),
}

impl Pixels {
    /// The height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        match self {
            Self::Codes8(codes) => codes.height(),
            Self::Rgb16Image(codes) => codes.height(),
            Self::Light(light) => light.height(),
        }
    }

    /// The width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::Codes8(codes) => codes.width(),
            Self::Rgb16Image(codes) => codes.width(),
            Self::Light(light) => light.width(),
        }
    }

    /// The 8-bit codes of the undarkened frame, L0.
    #[must_use]
    pub fn codes(&self) -> Arc<Rgb> {
        match self {
            Self::Codes8(codes) => Arc::clone(codes),
            Self::Rgb16Image(codes) => Arc::new(from_rgb16(codes)),
            Self::Light(light) => Arc::new(from_linear(light)),
        }
    }
}

/// Exponent between codes and light, as in the exposure drop (DarkQA, eqs. 1 and 3): the undarkened image equals a drop
/// of 0 EV.
const GAMMA: f64 = 2.2;

/// Rounds 16-bit codes to the nearest 8-bit codes.
fn from_rgb16(codes: &Rgb16Image) -> Rgb {
    let nearest = codes.samples().iter().map(|code| ((u32::from(*code) + 128) / 257) as u8);
    new_image(codes.height(), codes.width(), nearest)
}

/// The codes floor(255 · min(1, L)^(1/2.2) + ½) of light L.
fn from_linear(light: &Light) -> Rgb {
    /// Lower bound of the light of each code from 1 to 255.
    static STEPS: LazyLock<[f64; 255]> =
        LazyLock::new(|| std::array::from_fn(|below| libm::pow((below as f64 + 0.5) / 255.0, GAMMA)));
    let steps = &*STEPS;
    let codes = light.samples().iter().map(|light| steps.partition_point(|step| *step <= f64::from(*light)) as u8);
    new_image(light.height(), light.width(), codes)
}

fn new_image(height: usize, width: usize, codes: impl Iterator<Item = u8>) -> Rgb {
    let mut image = Rgb::black(height, width);
    for (sample, code) in image.samples_mut().iter_mut().zip(codes) {
        *sample = code;
    }
    image
}

/// A computation that is compiled separately for each [`Isa`].
pub trait Kernel {
    /// Runs the computation. This method and all functions that it calls must be `#[inline(always)]`: only inlined code
    /// is compiled for the caller's instruction set.
    fn run(self);
}

/// Instruction set that kernels are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// Instructions that every machine of the architecture has.
    Baseline,
    /// x86-64 with 256-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// x86-64 with 512-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// Instruction sets of this machine, the best last. For tests.
    #[must_use]
    pub fn available() -> Vec<Self> {
        [
            Some(Self::Baseline),
            #[cfg(target_arch = "x86_64")]
            is_x86_feature_detected!("avx2").then_some(Self::Avx2),
            #[cfg(target_arch = "x86_64")]
            has_avx512().then_some(Self::Avx512),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Best instruction set of this machine.
    #[must_use]
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            return Self::Avx512;
        } else if is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Baseline
    }

    /// Runs a kernel with this instruction set, or with the baseline if the machine does not have it.
    #[expect(unsafe_code, reason = "the match guards check the CPU feature before each call")]
    pub fn run(self, kernel: impl Kernel) {
        match self {
            // SAFETY: the machine has the instructions that the function is compiled for.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if is_x86_feature_detected!("avx2") => unsafe { avx2(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if has_avx512() => unsafe { avx512(kernel) },
            _ => kernel.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2(kernel: impl Kernel) {
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512(kernel: impl Kernel) {
    kernel.run();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked() {
        assert!(Rgb::new(2, 2, vec![0; 12]).is_ok());
        assert!(Rgb16Image::new(2, 2, vec![0; 12]).is_ok());
        assert!(Light::new(2, 2, vec![0.5; 12]).is_ok());
        for (height, width, samples) in [(2, 2, 11), (0, 2, 0), (usize::MAX, 2, 12), (2, 2, 13)] {
            assert!(Rgb::new(height, width, vec![0; samples]).is_err());
            assert!(Rgb16Image::new(height, width, vec![0; samples]).is_err());
            assert!(Light::new(height, width, vec![0.5; samples]).is_err());
        }
    }

    #[test]
    fn amounts_of_light_are_checked() {
        for wrong in [f32::NAN, f32::INFINITY, -0.01] {
            let error = Light::new(1, 1, vec![0.5, wrong, 0.5]).unwrap_err();
            assert!(error.to_string().contains("not an amount of light"));
        }
        assert!(Light::new(1, 1, vec![0.0, 1.0, 16.0]).is_ok());
    }

    #[test]
    fn bare_name_has_no_image_extension() {
        for (name, bare) in [
            ("a/b.PNG", "a/b"),
            ("a.b.jpeg", "a.b"),
            ("a.WebP", "a"),
            ("a.heic", "a.heic"),
            ("a.b", "a.b"),
            ("a/.png", "a/.png"),
            ("scene/1", "scene/1"),
        ] {
            assert_eq!(FrameId(name.into()).bare(), bare);
        }
    }

    #[test]
    fn sixteen_bits_become_the_nearest_eight() {
        let codes: Vec<u16> = (0..=65_535).chain([0, 0]).collect();
        let image = from_rgb16(&Rgb16Image::new(1, codes.len() / 3, codes.clone()).unwrap());
        for (code, shown) in codes.iter().zip(image.samples()) {
            let expected = (f64::from(*code) / 257.0).round();
            assert!((f64::from(*shown) - expected).abs() < 0.5, "{code}");
        }
    }

    #[test]
    fn light_becomes_codes_by_the_power_of_the_exposure_drop() {
        let lights: Vec<f32> = (0..30_000).map(|i| (i as f32 / 20_000.0).powi(2)).collect();
        let image = from_linear(&Light::new(100, 100, lights.clone()).unwrap());
        for (light, shown) in lights.iter().zip(image.samples()) {
            let value = 255.0 * f64::from(*light).min(1.0).powf(1.0 / 2.2) + 0.5;
            // Between two codes both are right.
            if (value - value.round()).abs() > 1e-9 {
                assert!((f64::from(*shown) - value.floor()).abs() < 0.5, "{light}");
            }
        }
        assert_eq!(image.samples()[..2], [0, 0]);
        assert_eq!(image.samples()[29_999], 255);
    }
}
