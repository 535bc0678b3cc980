//! An image file in memory: [`ImageFile`].

mod cmyk_jpeg;
mod cmyk_tiff;
mod exr_layers;
mod facts;
pub mod format;
mod jpeg_markers;
mod png_chunks;
mod tiff_tags;
mod webp_chunks;

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageReader, Limits, RgbImage};

use self::exr_layers::ExrFile;
use self::facts::{Depth, FileFacts, InkForm, fault};
use self::format::FileFormat;
use super::colour::{CodeDepth, ColourSpace, ColourTag, Inks, Meaning};
use super::reading_rule::{ColourRule, ReadingRule, Transfer};
use darkqa_ground::error::{Error, Result};
use darkqa_ground::files::guarded::guarded;
use darkqa_ground::files::reading;
use darkqa_ground::types::{
    ColourHandling, ColourNote, DepthNote, Digest, InputNote, Light, Pixels, Rgb, Rgb16Image,
};

/// A PNG, JPEG, WebP, TIFF, BMP or OpenEXR file that is not decoded.
#[derive(Debug)]
pub struct ImageFile {
    bytes: Vec<u8>,
    place: String,
    rule: ReadingRule,
    turning: Turning,
    /// Read from the header when they are first needed.
    facts: OnceLock<FileFacts>,
}

/// Whether an image is turned as the EXIF orientation of its file states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turning {
    AsStated,
    /// Never, because maps belong to the image as it is stored.
    Never,
}

/// A turn that an image file states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatedTurn {
    /// EXIF orientation, 2 to 8.
    pub orientation: u8,
    /// Height and width of the image before it is turned, in pixels.
    pub stored: (usize, usize),
}

impl ImageFile {
    /// The image file with these bytes. `place` is its path and line, for messages.
    #[must_use]
    pub fn new(bytes: Vec<u8>, place: String, rule: ReadingRule) -> Self {
        Self {
            bytes,
            place,
            rule,
            turning: Turning::AsStated,
            facts: OnceLock::new(),
        }
    }

    /// The file at a path.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn open(path: &Path, rule: ReadingRule) -> Result<Self> {
        let bytes = reading::bytes(path)?;
        Ok(Self::new(bytes, path.display().to_string(), rule))
    }

    /// The same file, whose image is never turned.
    #[must_use]
    pub fn never_turned(self) -> Self {
        Self {
            turning: Turning::Never,
            ..self
        }
    }

    /// The same file, whose image is turned as it states.
    #[must_use]
    pub fn turned_as_stated(self) -> Self {
        Self {
            turning: Turning::AsStated,
            ..self
        }
    }

    /// The turn that the file states, and its size as it is stored; `None` if it states none or is broken. Formats of light state no
    /// turn.
    #[must_use]
    pub fn stated_turn(&self) -> Option<StatedTurn> {
        let orientation = self.facts().orientation;
        if orientation == Orientation::NoTransforms {
            return None;
        }
        // A broken image is named when it is decoded.
        let (width, height) = self.decoder().ok()?.dimensions();
        Some(StatedTurn {
            orientation: orientation.to_exif(),
            stored: (height as usize, width as usize),
        })
    }

    /// The path and line of the file, for messages.
    #[must_use]
    pub fn place(&self) -> &str {
        &self.place
    }

    /// The bytes of the file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The digest of the file and of what its reading does besides taking the codes. Of an image whose codes are taken as
    /// they are, it is the digest of the file.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let file = Digest::from_bytes(&self.bytes);
        match self.note().rule() {
            None => file,
            Some(rule) => {
                Digest::from_parts([&b"darkqa.reading/1"[..], file.as_bytes(), rule.as_bytes()])
            }
        }
    }

    /// Changes that reading makes to the image.
    #[must_use]
    pub fn note(&self) -> InputNote {
        let facts = self.facts();
        let stated = facts.orientation;
        let stated = (stated != Orientation::NoTransforms).then(|| stated.to_exif());
        let (orientation, orientation_ignored) = match self.turning {
            Turning::AsStated => (stated, None),
            Turning::Never => (None, stated),
        };
        let samples = self.samples(facts);
        let depth = match (&samples, facts.depth) {
            (Ok(Samples::Light(_)), _) => Some(DepthNote::Light),
            (Ok(Samples::Codes(_)), Depth::Sixteen) => Some(DepthNote::Rgb16Image),
            _ => None,
        };
        let is_light = depth == Some(DepthNote::Light);
        InputNote {
            orientation,
            orientation_ignored,
            first_of: facts.first_of.map(str::to_owned),
            colour: self.colour_note(facts),
            depth,
            ..self.rule.note_of(is_light)
        }
    }

    /// Handling of the file's colours; `None` if they are sRGB, or cannot be converted.
    fn colour_note(&self, facts: &FileFacts) -> Option<ColourNote> {
        let FileFacts { colour, depth, .. } = facts;
        if facts.inks.is_some() {
            return self.ink_colours().ok().map(|inks| inks.note());
        }
        match (self.rule.colour, colour.meaning(depth.code_depth())) {
            (ColourRule::Convert, Err(_) | Ok(Meaning::Linear)) | (_, Ok(Meaning::Srgb)) => None,
            (ColourRule::Convert, Ok(Meaning::Other(space))) => {
                Some(space.note(ColourHandling::Converted))
            }
            (ColourRule::Ignore, Ok(Meaning::Other(space))) => {
                Some(space.note(ColourHandling::Ignored))
            }
            (ColourRule::Ignore, Ok(Meaning::Linear) | Err(_)) => Some(ColourNote {
                from: colour.kind().to_owned(),
                profile: None,
                handling: ColourHandling::Ignored,
            }),
        }
    }

    /// Interpretation of the file's samples, by its colour information and by the rule.
    ///
    /// # Errors
    /// If it cannot be known, or the two contradict each other.
    fn samples(&self, facts: &FileFacts) -> Result<Samples, String> {
        let ReadingRule {
            colour, transfer, ..
        } = self.rule;
        if facts.inks.is_some() {
            return Ok(Samples::Codes(None));
        }
        let meaning = match colour {
            ColourRule::Ignore => Meaning::Srgb,
            ColourRule::Convert => facts.colour.meaning(facts.depth.code_depth())?,
        };
        let is_linear = transfer == Transfer::Linear && facts.depth == Depth::Sixteen;
        Ok(match (meaning, facts.depth) {
            (Meaning::Linear, _) | (Meaning::Srgb, Depth::Float) => Samples::Light(None),
            (Meaning::Other(space), Depth::Float) => Samples::Light(Some(space)),
            (Meaning::Srgb, _) if is_linear => {
                if colour == ColourRule::Convert && facts.colour != ColourTag::None {
                    return Err(contradiction(&facts.colour));
                }
                Samples::Light(None)
            }
            (Meaning::Other(_), _) if is_linear => return Err(contradiction(&facts.colour)),
            (Meaning::Srgb, _) => Samples::Codes(None),
            (Meaning::Other(space), _) => Samples::Codes(Some(space)),
        })
    }

    /// The usual ending of a name for the file: by its content, not by its own name.
    #[must_use]
    pub fn ending(&self) -> &'static str {
        FileFormat::detect(&self.bytes).map_or("", FileFormat::ending)
    }

    /// The width and height in pixels, after a check that the file can be decoded.
    ///
    /// For an RGB PNG the checksums are enough: they find any damage at a hundredth of the cost of decompressing. Every
    /// other file is decoded, because JPEG has no checksums and an alpha channel may be transparent.
    pub fn check(&self) -> Result<(u32, u32)> {
        if FileFormat::detect(&self.bytes) == Ok(FileFormat::Png) {
            let decoder = self.decoder()?;
            if matches!(decoder.color_type(), ColorType::Rgb8 | ColorType::Rgb16) {
                let (width, height) = decoder.dimensions();
                self.check_complete()?;
                self.samples_of(false)?;
                return Ok(match self.orientation().to_exif() {
                    5.. => (height, width),
                    _ => (width, height),
                });
            }
        }
        let pixels = self.pixels()?;
        Ok((pixels.width() as u32, pixels.height() as u32))
    }

    /// The pixels as 8-bit sRGB, as they are shown undarkened.
    ///
    /// # Errors
    /// As of [`Self::pixels`].
    pub fn decode(&self) -> Result<Rgb> {
        let codes = self.pixels()?.codes();
        Ok(Arc::try_unwrap(codes).unwrap_or_else(|shared| (*shared).clone()))
    }

    /// The pixels in the depth of the file. A truncated file, or a PNG with a wrong checksum, is refused.
    ///
    /// Grey becomes three equal channels, and a palette becomes its colours. An alpha channel is dropped if it is opaque
    /// everywhere; transparency is refused, because there is no one right way to show it. The image is turned as its EXIF
    /// orientation states, unless it has maps. Colours are converted to sRGB by the rule, inks by their profile, or by a formula
    /// without one.
    ///
    /// # Errors
    /// If the file is broken, or cannot be shown as it is; the error names the file.
    pub fn pixels(&self) -> Result<Pixels> {
        if FileFormat::detect(&self.bytes) == Ok(FileFormat::OpenExr) {
            return self.light_of_layers();
        }
        if let Some(form) = self.facts().inks {
            return self.pixels_of_inks(form);
        }
        let decoder = self.decoder()?;
        // The PNG decoder stops after the last sample, and the JPEG decoder accepts fewer samples than it should.
        self.check_complete()?;
        let decode = || {
            let image = DynamicImage::from_decoder(decoder);
            image.map_err(|e| format!("not a whole image: {e}"))
        };
        let mut image = guarded(decode).map_err(|problem| self.wrong(problem))?;
        if image.color().has_alpha()
            && !image.to_rgba8().pixels().all(|pixel| pixel.0[3] == u8::MAX)
        {
            return Err(self.wrong("the image is transparent in places; flatten it first"));
        }
        let samples = self.samples_of(!image.color().has_color())?;
        image.apply_orientation(self.orientation());
        let (width, height) = (image.width() as usize, image.height() as usize);
        let is_deep = self.facts().depth == Depth::Sixteen;
        let pixels = match samples {
            Samples::Codes(space) if is_deep => {
                let mut codes = image.into_rgb16().into_raw();
                if let Some(space) = space {
                    space.conversion.convert_16(&mut codes);
                }
                Rgb16Image::new(height, width, codes)
                    .map(|codes| Pixels::Rgb16Image(Arc::new(codes)))
            }
            Samples::Codes(space) => {
                let mut codes = image.into_rgb8().into_raw();
                if let Some(space) = space {
                    space.conversion.convert_8(&mut codes);
                }
                Rgb::new(height, width, codes).map(|codes| Pixels::Codes8(Arc::new(codes)))
            }
            Samples::Light(_) => {
                let light = image
                    .into_rgb16()
                    .into_raw()
                    .into_iter()
                    .map(|code| f32::from(code) / 65_535.0);
                self.scaled_light(height, width, light.collect())
            }
        };
        pixels.map_err(|e| e.at(self.place.clone()))
    }

    /// The pixels of a JPEG or TIFF file of four inks.
    fn pixels_of_inks(&self, form: InkForm) -> Result<Pixels> {
        let (width, height) = self.decoder()?.dimensions();
        self.check_complete()?;
        let read = || {
            let colours = self.ink_colours()?;
            let inks = guarded(|| match form {
                InkForm::Tiff => cmyk_tiff::inks(&self.bytes, width as usize * height as usize),
                InkForm::Plain | InkForm::Adobe => {
                    cmyk_jpeg::inks(&self.bytes, form == InkForm::Adobe)
                }
            })?;
            let image = RgbImage::from_raw(width, height, colours.srgb(&inks));
            let mut image =
                DynamicImage::from(image.ok_or("not a whole image: samples are missing")?);
            image.apply_orientation(self.orientation());
            let (width, height) = (image.width() as usize, image.height() as usize);
            let codes = Rgb::new(height, width, image.into_rgb8().into_raw());
            codes.map_err(|e| e.to_string())
        };
        let codes = read().map_err(|problem: String| self.wrong(problem))?;
        Ok(Pixels::Codes8(Arc::new(codes)))
    }

    /// The colours of the inks of a file of four components.
    fn ink_colours(&self) -> Result<Inks, String> {
        guarded(|| Inks::new(&self.facts().colour, self.rule.colour))
    }

    /// The pixels of an OpenEXR file.
    fn light_of_layers(&self) -> Result<Pixels> {
        let read = || {
            let file = guarded(|| ExrFile::open(&self.bytes, &self.rule))?;
            let samples = self.samples(self.facts())?;
            let mut light = guarded(|| file.light(&self.bytes))?;
            if let Samples::Light(Some(space)) = samples {
                space.conversion.convert_light(&mut light);
            }
            let (width, height) = (file.size.0 as usize, file.size.1 as usize);
            self.scaled_light(height, width, light)
                .map_err(|e| e.to_string())
        };
        read().map_err(|problem| self.wrong(problem))
    }

    /// Light after `--decode exposure`.
    fn scaled_light(&self, height: usize, width: usize, light: Vec<f32>) -> Result<Pixels> {
        let light = Arc::new(Light::new(height, width, light)?);
        Ok(Pixels::Light(self.rule.scaled(light)))
    }

    /// Interpretation of the samples, after a check that a colour image has no grey profile.
    fn samples_of(&self, is_grey: bool) -> Result<Samples> {
        self.samples(self.facts())
            .and_then(|samples| {
                if let Samples::Codes(Some(space)) = &samples {
                    space.check(is_grey)?;
                }
                Ok(samples)
            })
            .map_err(|problem| self.wrong(problem))
    }

    fn wrong(&self, problem: impl std::fmt::Display) -> Error {
        Error::data(&self.place, problem)
    }

    /// The orientation by which the image is turned.
    fn orientation(&self) -> Orientation {
        match self.turning {
            Turning::AsStated => self.facts().orientation,
            Turning::Never => Orientation::NoTransforms,
        }
    }

    /// The facts of the file beside its pixels; of a file that is no image, none.
    fn facts(&self) -> &FileFacts {
        self.facts
            .get_or_init(|| match FileFormat::detect(&self.bytes) {
                Ok(format) => FileFacts::read(&self.bytes, format),
                Err(_) => FileFacts::NONE,
            })
    }

    /// The decoder of a file of codes.
    fn decoder(&self) -> Result<impl ImageDecoder + '_> {
        let format = FileFormat::detect(&self.bytes).map_err(|problem| self.wrong(problem))?;
        if let Some(problem) = &self.facts().unshowable {
            return Err(self.wrong(problem));
        }
        let samples = match format {
            FileFormat::Png => png_chunks::samples_alone(&self.bytes),
            _ => Cow::Borrowed(&*self.bytes),
        };
        let mut reader = ImageReader::new(Cursor::new(samples));
        if let Some(format) = format.decoder() {
            reader.set_format(format);
        }
        let most_pixels = self.rule.most_pixels;
        let mut limits = Limits::default();
        limits.max_alloc = Some(most_pixels.saturating_mul(8));
        reader.limits(limits);
        let open = || {
            let decoder = reader.into_decoder();
            decoder.map_err(|e| format!("not a readable image: {e}"))
        };
        let decoder = guarded(open).map_err(|problem| self.wrong(problem))?;
        let (width, height) = decoder.dimensions();
        let size = self.rule.check_size(width as usize, height as usize);
        size.map_err(|problem| self.wrong(problem))?;
        Ok(decoder)
    }

    /// Checks that the file reaches its end, and that the checksums of a PNG are right.
    fn check_complete(&self) -> Result<()> {
        match FileFormat::detect(&self.bytes).map(|format| fault(&self.bytes, format, self.facts()))
        {
            Ok(Some(fault)) => Err(self.wrong(format_args!(
                "not a whole image: {fault}; copy or export it again"
            ))),
            _ => Ok(()),
        }
    }
}

/// Interpretation of a file's samples, and the colours from which they are converted.
enum Samples {
    /// Codes, which are sRGB after the conversion.
    Codes(Option<Arc<ColourSpace>>),
    /// Linear light.
    Light(Option<Arc<ColourSpace>>),
}

impl Depth {
    /// The bits of a code; of floats, which have none, it does not matter.
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

#[cfg(test)]
mod tests;
