//! Subset of the bundled font for a PDF file ([`EmbeddedFont`]), and compression of its streams ([`deflate`]).

use std::collections::BTreeMap;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Filter, Finish as _, Name, Pdf, Rect, Ref, Str};
use subsetter::GlyphRemapper;

use super::font::{FONT_FILE, Font};
use crate::error::{Error, Result};

/// Name of the font, after the six letters that mark a subset (PDF 1.7, 9.6.4).
const NAME: Name<'_> = Name(b"DARKQA+Arimo");

/// Character codes are glyph numbers of the subset (PDF 1.7, 9.7.5).
const CODES: SystemInfo<'_> = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// Thickness of vertical stems in thousandths of an em. The font file lacks it, so it is the value of Arial.
const STEM: f32 = 80.0;

/// The glyphs of the bundled font that a file uses.
#[derive(Default)]
pub(super) struct EmbeddedFont {
    glyphs: GlyphRemapper,
    /// Character and width, in thousandths of an em, by glyph number in the subset.
    letters: BTreeMap<u16, (char, f32)>,
}

impl EmbeddedFont {
    /// Encodes a text as character codes of two bytes each, and adds its glyphs to the subset.
    pub(super) fn encode(&mut self, text: &str) -> Vec<u8> {
        Font::bundled()
            .letters(text)
            .into_iter()
            .zip(text.chars())
            .flat_map(|(letter, character)| {
                let code = self.glyphs.remap(letter.glyph.0);
                self.letters.insert(code, (character, letter.advance * 1000.0));
                code.to_be_bytes()
            })
            .collect()
    }

    /// Writes the subset and returns its reference; `None` if no text was encoded.
    ///
    /// # Errors
    /// If the subset cannot be made.
    pub(super) fn write(&self, pdf: &mut Pdf, next: &mut Ref) -> Result<Option<Ref>> {
        if self.letters.is_empty() {
            return Ok(None);
        }
        let subset = subsetter::subset(FONT_FILE, 0, &self.glyphs)
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

        let packed = deflate(&subset);
        let mut stream = pdf.stream(file, &packed);
        stream.filter(Filter::FlateDecode);
        stream.pair(Name(b"Length1"), subset.len() as i32);
        stream.finish();
        Ok(Some(font))
    }
}

/// Compresses bytes for the PDF filter `FlateDecode`.
pub(super) fn deflate(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("a vector takes every write")
}
