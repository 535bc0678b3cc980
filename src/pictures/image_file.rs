//! Image files of six formats, and their conversion to pixels: [`ImageFile`].

mod cmyk_tiff;
mod exr_layers;
mod facts;
pub mod format;
mod jpeg;
mod png_chunks;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use bytes::Bytes;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageReader, Limits, RgbImage};

use self::exr_layers::ExrFile;
use self::facts::{FileFacts, InkForm, SampleType, fault};
use self::format::FileFormat;
use super::colour::{CodeDepth, CodeMeaning, ColourSpace, ColourTag, Inks};
use super::decode_rule::{ColourRule, DecodeRule, Transfer};
use super::payload::{Payload, PayloadFormat, plain_size};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, guarded};
use darkqa_base::types::{ColourHandling, ColourNote, DepthNote, Digest, InputNote, Light, Pixels, Rgb, Rgb16Image};
use jpeg::with_standard_tables;

/// A PNG, JPEG, WebP, TIFF, BMP or OpenEXR file in memory, not decoded.
#[derive(Debug)]
pub struct ImageFile {
    bytes: Bytes,
    /// Digest of the bytes, computed on first use.
    digest: OnceLock<Digest>,
    place: String,
    rule: DecodeRule,
    orientation_use: OrientationUse,
    /// Facts from the headers, read on first use.
    facts: OnceLock<FileFacts>,
}

/// Use of the EXIF orientation of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum OrientationUse {
    /// Turn the image accordingly.
    Apply,
    /// Keep the image as stored, so that it matches its maps.
    Ignore,
}

/// The EXIF orientation of an image file that must be turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatedOrientation {
    /// EXIF orientation, 2 to 8.
    pub orientation: u8,
    /// Height and width of the image as stored, in pixels.
    pub stored_size: (usize, usize),
}

impl ImageFile {
    /// An image file with these bytes. `place` is its path, and line if any, for messages.
    #[must_use]
    pub fn new(bytes: Vec<u8>, place: String, rule: DecodeRule) -> Self {
        Self {
            bytes: bytes.into(),
            digest: OnceLock::new(),
            place,
            rule,
            orientation_use: OrientationUse::Apply,
            facts: OnceLock::new(),
        }
    }

    /// Reads the file at a path.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn open(path: &Path, rule: DecodeRule) -> Result<Self> {
        let bytes = files::bytes(path)?;
        Ok(Self::new(bytes, path.display().to_string(), rule))
    }

    /// The same file, decoded without applying its EXIF orientation.
    #[must_use]
    pub fn ignoring_orientation(self) -> Self {
        Self { orientation_use: OrientationUse::Ignore, ..self }
    }

    /// The same file, decoded with its EXIF orientation applied.
    #[must_use]
    pub fn applying_orientation(self) -> Self {
        Self { orientation_use: OrientationUse::Apply, ..self }
    }

    /// The EXIF orientation of the file and its size as stored; `None` if the image need not be turned or the file is
    /// broken.
    #[must_use]
    pub fn stated_orientation(&self) -> Option<StatedOrientation> {
        let orientation = self.facts().orientation;
        if orientation == Orientation::NoTransforms {
            return None;
        }
        // Decoding reports a broken image.
        let (width, height) = self.decoder().ok()?.dimensions();
        Some(StatedOrientation { orientation: orientation.to_exif(), stored_size: (height as usize, width as usize) })
    }

    /// Exposure value at ISO 100 of the camera's settings in the EXIF data (aperture, exposure time, sensitivity); `None`
    /// if the file does not state them.
    #[must_use]
    pub fn exposure_value(&self) -> Option<f64> {
        self.facts().exposure_value
    }

    /// Path of the file, and line if any, for messages.
    #[must_use]
    pub fn place(&self) -> &str {
        &self.place
    }

    /// The bytes of the file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The file as a payload, with the same bytes, if it is a PNG file that contains only plain 8-bit RGB pixels and no
    /// chunk that changes their display or adds information; otherwise `None`. The file is not checked for damage: it
    /// must have been decoded before.
    #[must_use]
    pub fn plain_png(&self) -> Option<Payload> {
        let size = plain_size(&self.bytes)?;
        Some(Payload::with_digest(self.bytes.clone(), self.file_digest(), size, PayloadFormat::Png))
    }

    /// The digest of the bytes.
    fn file_digest(&self) -> Digest {
        *self.digest.get_or_init(|| Digest::from_bytes(&self.bytes))
    }

    /// The digest of the file and of the changes that reading makes to its codes. Without changes, the digest of the
    /// file alone.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let file = self.file_digest();
        match self.note().rule() {
            None => file,
            Some(rule) => Digest::from_parts([&b"darkqa.reading/1"[..], file.as_bytes(), rule.as_bytes()]),
        }
    }

    /// Changes that reading makes to the image.
    #[must_use]
    pub fn note(&self) -> InputNote {
        let facts = self.facts();
        let stated = (facts.orientation != Orientation::NoTransforms).then(|| facts.orientation.to_exif());
        let (orientation, orientation_ignored) = match self.orientation_use {
            OrientationUse::Apply => (stated, None),
            OrientationUse::Ignore => (None, stated),
        };
        let interpretation = self.interpretation(facts);
        let depth = match (&interpretation, facts.depth) {
            (Ok(Interpretation::Light(_)), _) => Some(DepthNote::Light),
            (Ok(Interpretation::Codes(_)), SampleType::Sixteen) => Some(DepthNote::Rgb16Image),
            _ => None,
        };
        let is_light = depth == Some(DepthNote::Light);
        InputNote {
            orientation,
            orientation_ignored,
            first_of: facts.first_of.map(str::to_owned),
            colour: self.colour_note(facts),
            depth,
            ..self.rule.input_note(is_light)
        }
    }

    /// The colour space of the file and its handling; `None` for sRGB, and for colours that cannot be converted.
    fn colour_note(&self, facts: &FileFacts) -> Option<ColourNote> {
        let FileFacts { colour, depth, .. } = facts;
        if facts.inks.is_some() {
            return self.ink_colours().ok().map(|inks| inks.note());
        }
        match (self.rule.colour, colour.meaning(depth.code_depth())) {
            (ColourRule::Ignore, Ok(CodeMeaning::Other(space))) => Some(space.note(ColourHandling::Ignored)),
            (ColourRule::Ignore, Ok(CodeMeaning::Linear) | Err(_)) => {
                Some(ColourNote { from: colour.kind().to_owned(), profile: None, handling: ColourHandling::Ignored })
            }
            (_, Err(_) | Ok(CodeMeaning::Linear | CodeMeaning::Srgb)) => None,
            (rule, Ok(CodeMeaning::Other(space))) => {
                let is_refused = rule == ColourRule::Convert && space.handling == ColourHandling::Clipped;
                (!is_refused).then(|| space.note(space.handling))
            }
        }
    }

    /// Interpretation of the file's samples, by its colour information and the reading rule.
    ///
    /// # Errors
    /// If the colour space is not supported, or the file and the rule contradict each other.
    fn interpretation(&self, facts: &FileFacts) -> Result<Interpretation, String> {
        let DecodeRule { colour, transfer, .. } = self.rule;
        if facts.inks.is_some() {
            return Ok(Interpretation::Codes(None));
        }
        let meaning = match colour {
            ColourRule::Ignore => CodeMeaning::Srgb,
            ColourRule::Convert | ColourRule::Clip => facts.colour.meaning(facts.depth.code_depth())?,
        };
        if let CodeMeaning::Other(space) = &meaning
            && space.handling == ColourHandling::Clipped
            && colour == ColourRule::Convert
        {
            return Err(space.hdr_refusal());
        }
        let is_linear = transfer == Transfer::Linear && facts.depth == SampleType::Sixteen;
        Ok(match (meaning, facts.depth) {
            (CodeMeaning::Linear, _) | (CodeMeaning::Srgb, SampleType::Float) => Interpretation::Light(None),
            (CodeMeaning::Other(space), SampleType::Float) => Interpretation::Light(Some(space)),
            (CodeMeaning::Srgb, _) if is_linear => {
                if colour != ColourRule::Ignore && facts.colour != ColourTag::None {
                    return Err(contradiction(&facts.colour));
                }
                Interpretation::Light(None)
            }
            (CodeMeaning::Other(_), _) if is_linear => return Err(contradiction(&facts.colour)),
            (CodeMeaning::Srgb, _) => Interpretation::Codes(None),
            (CodeMeaning::Other(space), _) => Interpretation::Codes(Some(space)),
        })
    }

    /// The usual file name extension of the format, which is detected from the content.
    #[must_use]
    pub fn extension(&self) -> &'static str {
        FileFormat::detect(&self.bytes).map_or("", FileFormat::extension)
    }

    /// Checks that the file can be decoded; returns its width and height, in pixels.
    ///
    /// For an RGB PNG file only the checksums are verified: they find any damage at a hundredth of the cost of
    /// decompression. Every other file is decoded, because JPEG has no checksums and an alpha channel may be
    /// transparent.
    pub fn check(&self) -> Result<(u32, u32)> {
        if FileFormat::detect(&self.bytes) == Ok(FileFormat::Png) {
            let decoder = self.decoder()?;
            if matches!(decoder.color_type(), ColorType::Rgb8 | ColorType::Rgb16) {
                let (width, height) = decoder.dimensions();
                self.check_complete()?;
                self.checked_interpretation(false)?;
                return Ok(match self.orientation().to_exif() {
                    5.. => (height, width),
                    _ => (width, height),
                });
            }
        }
        let pixels = self.pixels()?;
        Ok((pixels.width() as u32, pixels.height() as u32))
    }

    /// Width and height in pixels, as stored: read from the header, without decoding.
    ///
    /// # Errors
    /// If the header cannot be read.
    pub fn stored_size(&self) -> Result<(u32, u32)> {
        Ok(self.decoder()?.dimensions())
    }

    /// Decodes the file to 8-bit sRGB.
    ///
    /// # Errors
    /// See [`Self::pixels`].
    pub fn decode(&self) -> Result<Rgb> {
        let codes = self.pixels()?.codes();
        Ok(Arc::try_unwrap(codes).unwrap_or_else(|shared| (*shared).clone()))
    }

    /// Decodes the file in its own bit depth.
    ///
    /// Grey becomes three equal channels, and a palette becomes its colours. An opaque alpha channel is dropped;
    /// transparency is refused, because the background is unknown. The EXIF orientation is applied, unless the file was
    /// opened without it. Colours are converted to sRGB if the rule asks for it, and CMYK by its profile or, without
    /// one, by a formula.
    ///
    /// # Errors
    /// If the file is truncated, damaged or unsupported; the error names the file.
    pub fn pixels(&self) -> Result<Pixels> {
        if FileFormat::detect(&self.bytes) == Ok(FileFormat::OpenExr) {
            return self.decode_exr();
        }
        if let Some(form) = self.facts().inks {
            return self.decode_cmyk(form);
        }
        let decoder = self.decoder()?;
        // The PNG decoder stops after the last sample, and the JPEG decoder accepts missing samples.
        self.check_complete()?;
        let mut image = guarded(|| DynamicImage::from_decoder(decoder).map_err(|e| format!("not a whole image: {e}")))
            .map_err(|problem| self.error(problem))?;
        if image.color().has_alpha() && !image.to_rgba8().pixels().all(|pixel| pixel.0[3] == u8::MAX) {
            return Err(self.error("the image is transparent in places; flatten it first"));
        }
        let interpretation = self.checked_interpretation(!image.color().has_color())?;
        image.apply_orientation(self.orientation());
        let (width, height) = (image.width() as usize, image.height() as usize);
        let is_16_bit = self.facts().depth == SampleType::Sixteen;
        let pixels = match interpretation {
            Interpretation::Codes(space) if is_16_bit => {
                let mut codes = image.into_rgb16().into_raw();
                if let Some(space) = space {
                    space.conversion.convert_16(&mut codes);
                }
                Rgb16Image::new(height, width, codes).map(|codes| Pixels::Rgb16Image(Arc::new(codes)))
            }
            Interpretation::Codes(space) => {
                let mut codes = image.into_rgb8().into_raw();
                if let Some(space) = space {
                    space.conversion.convert_8(&mut codes);
                }
                Rgb::new(height, width, codes).map(|codes| Pixels::Codes8(Arc::new(codes)))
            }
            Interpretation::Light(_) => {
                let light = image.into_rgb16().into_raw().into_iter().map(|code| f32::from(code) / 65_535.0).collect();
                self.light_pixels(height, width, light)
            }
        };
        pixels.map_err(|e| e.at(self.place.clone()))
    }

    /// Decodes a CMYK file (JPEG or TIFF).
    fn decode_cmyk(&self, form: InkForm) -> Result<Pixels> {
        let (width, height) = self.decoder()?.dimensions();
        self.check_complete()?;
        let colours = self.ink_colours().map_err(|problem| self.error(problem))?;
        let inks = guarded(|| match form {
            InkForm::Tiff => cmyk_tiff::inks(&self.bytes, width as usize * height as usize),
            InkForm::Plain | InkForm::Adobe => jpeg::inks(&with_standard_tables(&self.bytes), form == InkForm::Adobe),
        })
        .map_err(|problem| self.error(problem))?;
        let image = RgbImage::from_raw(width, height, colours.srgb(&inks))
            .ok_or_else(|| self.error("not a whole image: samples are missing"))?;
        let mut image = DynamicImage::from(image);
        image.apply_orientation(self.orientation());
        let (width, height) = (image.width() as usize, image.height() as usize);
        let codes = Rgb::new(height, width, image.into_rgb8().into_raw()).map_err(|e| self.error(e))?;
        Ok(Pixels::Codes8(Arc::new(codes)))
    }

    /// The conversion of the inks of a CMYK file to sRGB.
    fn ink_colours(&self) -> Result<Inks, String> {
        guarded(|| Inks::new(&self.facts().colour, self.rule.colour))
    }

    /// Decodes an OpenEXR file.
    fn decode_exr(&self) -> Result<Pixels> {
        let file = guarded(|| ExrFile::open(&self.bytes, &self.rule)).map_err(|problem| self.error(problem))?;
        let interpretation = self.interpretation(self.facts()).map_err(|problem| self.error(problem))?;
        let mut light = guarded(|| file.light(&self.bytes)).map_err(|problem| self.error(problem))?;
        if let Interpretation::Light(Some(space)) = interpretation {
            space.conversion.convert_light(&mut light);
        }
        let (width, height) = (file.size.0 as usize, file.size.1 as usize);
        self.light_pixels(height, width, light).map_err(|e| self.error(e))
    }

    /// Linear light as pixels, after `--decode exposure`.
    fn light_pixels(&self, height: usize, width: usize, light: Vec<f32>) -> Result<Pixels> {
        let light = Arc::new(Light::new(height, width, light)?);
        Ok(Pixels::Light(self.rule.scale_exposure(light)))
    }

    /// Interpretation of the samples, after a check that a colour image has no grey profile.
    fn checked_interpretation(&self, is_grey: bool) -> Result<Interpretation> {
        let interpretation = self.interpretation(self.facts()).map_err(|problem| self.error(problem))?;
        if let Interpretation::Codes(Some(space)) = &interpretation {
            space.check(is_grey).map_err(|problem| self.error(problem))?;
        }
        Ok(interpretation)
    }

    fn error(&self, problem: impl std::fmt::Display) -> Error {
        Error::data(&self.place, problem)
    }

    /// The orientation to apply.
    fn orientation(&self) -> Orientation {
        match self.orientation_use {
            OrientationUse::Apply => self.facts().orientation,
            OrientationUse::Ignore => Orientation::NoTransforms,
        }
    }

    /// The facts from the headers of the file; [`FileFacts::NONE`] if the file is not an image.
    fn facts(&self) -> &FileFacts {
        self.facts.get_or_init(|| match FileFormat::detect(&self.bytes) {
            Ok(format) => FileFacts::read(&self.bytes, format),
            Err(_) => FileFacts::NONE,
        })
    }

    /// The decoder of a file of integer samples.
    fn decoder(&self) -> Result<impl ImageDecoder + '_> {
        let format = FileFormat::detect(&self.bytes).map_err(|problem| self.error(problem))?;
        if let Some(problem) = &self.facts().unsupported {
            return Err(self.error(problem));
        }
        let bytes = match format {
            FileFormat::Png => png_chunks::without_metadata(&self.bytes),
            FileFormat::Jpeg => with_standard_tables(&self.bytes),
            _ => Cow::Borrowed(&*self.bytes),
        };
        let mut reader = ImageReader::new(Cursor::new(bytes));
        if let Some(format) = format.decoder() {
            reader.set_format(format);
        }
        let mut limits = Limits::default();
        // 8 bytes per pixel: RGBA with 16 bits per channel.
        limits.max_alloc = Some(self.rule.max_pixels.saturating_mul(8));
        reader.limits(limits);
        let decoder = guarded(|| reader.into_decoder().map_err(|e| format!("not a readable image: {e}")))
            .map_err(|problem| self.error(problem))?;
        let (width, height) = decoder.dimensions();
        self.rule.check_size(width as usize, height as usize).map_err(|problem| self.error(problem))?;
        Ok(decoder)
    }

    /// Checks that the file is not truncated, and verifies the checksums of a PNG file.
    fn check_complete(&self) -> Result<()> {
        match FileFormat::detect(&self.bytes).map(|format| fault(&self.bytes, format, self.facts())) {
            Ok(Some(fault)) => Err(self.error(format_args!("not a whole image: {fault}; copy or export it again"))),
            _ => Ok(()),
        }
    }
}

/// Interpretation of a file's samples, with the colour space to convert from; `None` for sRGB primaries and tone curve.
enum Interpretation {
    /// Codes, converted to sRGB codes.
    Codes(Option<Arc<ColourSpace>>),
    /// Linear light, converted to the primaries of sRGB.
    Light(Option<Arc<ColourSpace>>),
}

impl SampleType {
    /// The bit depth of the codes; arbitrary for floats, which have none.
    fn code_depth(self) -> CodeDepth {
        match self {
            Self::Eight => CodeDepth::Eight,
            Self::Sixteen | Self::Float => CodeDepth::Sixteen,
        }
    }
}

fn contradiction(colour: &ColourTag) -> String {
    format!(
        "the file states what its codes mean ({}), and --decode transfer=linear states something else; leave the flag out, or make the flag \
         decide with --decode colour=ignore",
        colour.kind()
    )
}
