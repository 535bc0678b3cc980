//! Embeds the letters of the bundled font that occur in a PDF file: [`EmbeddedFont`]. [`deflated`] compresses its streams.

use std::collections::BTreeMap;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Filter, Finish as _, Name, Pdf, Rect, Ref, Str};
use subsetter::GlyphRemapper;

use super::font::{FILE, Font};
use crate::error::{Error, Result};

/// Name of the font, with the six letters that mark a part of a font (PDF 1.7, 9.6.4).
const NAME: Name<'_> = Name(b"DARKQA+Arimo");

/// Character codes are glyph numbers of the embedded part (PDF 1.7, 9.7.5).
const CODES: SystemInfo<'_> = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
};

/// Thickness of vertical stems in thousandths of the letter height, which a font file does not have; that of Arial.
const STEM: f32 = 80.0;

/// The letters of the bundled font that were used.
#[derive(Default)]
pub(super) struct EmbeddedFont {
    glyphs: GlyphRemapper,
    /// The character and the width of each new glyph number, in thousandths of the letter height.
    letters: BTreeMap<u16, (char, f32)>,
}

impl EmbeddedFont {
    /// A text as character codes, two bytes each.
    pub(super) fn encode(&mut self, text: &str) -> Vec<u8> {
        let letters = Font::bundled().letters(text).into_iter().zip(text.chars());
        letters
            .flat_map(|(letter, character)| {
                let code = self.glyphs.remap(letter.glyph.0);
                self.letters
                    .insert(code, (character, letter.advance * 1000.0));
                code.to_be_bytes()
            })
            .collect()
    }

    /// Writes the font with its letters; `None` if no text was encoded.
    ///
    /// # Errors
    /// If the font file cannot be reduced to these letters.
    pub(super) fn write(&self, pdf: &mut Pdf, next: &mut Ref) -> Result<Option<Ref>> {
        if self.letters.is_empty() {
            return Ok(None);
        }
        let part = subsetter::subset(FILE, 0, &self.glyphs)
            .map_err(|e| Error::data("figure as PDF", format!("bundled font: {e}")))?;
        let (font, cid_font, descriptor) = (next.bump(), next.bump(), next.bump());
        let (characters, file) = (next.bump(), next.bump());
        pdf.type0_font(font)
            .base_font(NAME)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(cid_font)
            .to_unicode(characters);

        let mut cid = pdf.cid_font(cid_font);
        cid.subtype(CidFontType::Type2)
            .base_font(NAME)
            .system_info(CODES)
            .font_descriptor(descriptor)
            .default_width(0.0)
            .cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = cid.widths();
        for (code, (_, width)) in &self.letters {
            widths.consecutive(*code, [*width]);
        }
        widths.finish();
        cid.finish();

        let metrics = Font::bundled().metrics();
        let [left, bottom, right, top] = metrics.bounds;
        pdf.font_descriptor(descriptor)
            .name(NAME)
            .flags(FontFlags::NON_SYMBOLIC)
            .bbox(Rect::new(left, bottom, right, top))
            .italic_angle(0.0)
            .ascent(metrics.ascent)
            .descent(metrics.descent)
            .cap_height(metrics.capital_height)
            .stem_v(STEM)
            .font_file2(file);

        let mut cmap = UnicodeCmap::new(Name(b"Custom"), CODES);
        for (code, (character, _)) in &self.letters {
            cmap.pair(*code, *character);
        }
        pdf.cmap(characters, &cmap.finish());

        let packed = deflated(&part);
        let mut stream = pdf.stream(file, &packed);
        stream.filter(Filter::FlateDecode);
        stream.pair(Name(b"Length1"), part.len() as i32);
        stream.finish();
        Ok(Some(font))
    }
}

/// The bytes, compressed for the filter `FlateDecode`.
pub(super) fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = encoder.write_all(bytes);
    written
        .and_then(|()| encoder.finish())
        .expect("a vector takes every write")
}
