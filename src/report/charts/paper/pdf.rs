//! Writer of a sheet as a PDF file: [`pdf`].
//!
//! The file has one page of the sheet's size. Text can be selected; the glyphs that occur are embedded. The same sheet
//! always gives the same bytes, because the file has no date.
//!
//! Subset of the bundled font for a PDF file ([`EmbeddedFont`]), and compression of its streams ([`deflate`]).

use std::collections::BTreeMap;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{CidFontType, FontFlags, LineJoinStyle, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish as _, Name, Pdf, Rect, Ref, Str, TextStr};
use subsetter::GlyphRemapper;

use super::font::{FONT_FILE, Font};
use super::sheet::{Colour, Point, Shape, Sheet, Stroke, TextDirection, TextLabel};
use crate::charts::chart::INK;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Rgb;

/// Distance of a control point from its end point, in radii, of a Bézier curve for a quarter of a circle: 4 (√2 − 1) /
/// 3.
const HANDLE: f64 = 0.552_284_749_8;

/// Resource name of the font.
const FONT: Name<'_> = Name(b"F");

/// Writes a sheet as a PDF 1.4 file, the version that every TeX engine embeds without a warning.
///
/// # Errors
/// If the sheet has no area or the font cannot be embedded.
pub fn pdf(sheet: &Sheet, title: &str) -> Result<Vec<u8>> {
    let [width, height] = sheet.size.map(|length| length as f32);
    if !(width > 0.0 && height > 0.0) {
        return Err(Error::data("figure as PDF", format!("a figure of {width} × {height} points has no area")));
    }
    let mut page = PdfPage::new(height);
    for shape in &sheet.shapes {
        page.draw(shape);
    }
    page.document([width, height], title)
}

/// The content of the page, with the fonts, opacities and pictures it refers to.
struct PdfPage<'a> {
    content: Content,
    font: EmbeddedFont,
    /// Names of graphics states by opacity in thousandths.
    opacities: BTreeMap<u16, String>,
    pictures: Vec<&'a Rgb>,
}

impl<'a> PdfPage<'a> {
    /// Empty page whose y axis points down, as on a sheet.
    fn new(height: f32) -> Self {
        let mut content = Content::new();
        content.transform([1.0, 0.0, 0.0, -1.0, 0.0, height]);
        content.set_line_join(LineJoinStyle::RoundJoin);
        Self { content, font: EmbeddedFont::default(), opacities: BTreeMap::new(), pictures: Vec::new() }
    }

    fn draw(&mut self, shape: &'a Shape) {
        match shape {
            Shape::Line { points, stroke } => {
                self.path(points);
                self.paint(None, Some(stroke));
            }
            Shape::Area { corners, fill, opacity } => {
                self.content.save_state();
                self.set_opacity(*opacity);
                self.path(corners);
                self.content.close_path();
                self.paint(Some(*fill), None);
                self.content.restore_state();
            }
            Shape::Disc { centre, radius, fill, edge } => {
                self.circle(*centre, *radius);
                self.paint(*fill, edge.as_ref());
            }
            Shape::Label(label) => self.write_label(label),
            Shape::Group(group) => group.shapes.iter().for_each(|shape| self.draw(shape)),
            Shape::Picture { corner: [x, y], size: [width, height], image } => {
                let [x, y, width, height] = [x, y, width, height].map(|length| *length as f32);
                let name = picture_name(self.pictures.len());
                self.pictures.push(image);
                self.content.save_state();
                // PDF draws an image in the unit square, its first row at the top.
                self.content.transform([width, 0.0, 0.0, -height, x, y + height]);
                self.content.x_object(Name(name.as_bytes()));
                self.content.restore_state();
            }
        }
    }

    fn path(&mut self, points: &[Point]) {
        for (index, [x, y]) in points.iter().enumerate() {
            let (x, y) = (*x as f32, *y as f32);
            if index == 0 {
                self.content.move_to(x, y);
            } else {
                self.content.line_to(x, y);
            }
        }
    }

    fn circle(&mut self, [x, y]: Point, radius: f64) {
        let at = |across: f64, down: f64| {
            let [x, y] = [x + radius * across, y + radius * down];
            [x as f32, y as f32]
        };
        let [start_x, start_y] = at(1.0, 0.0);
        self.content.move_to(start_x, start_y);
        // Unit vectors of the start and the end of each quarter.
        for ([from_x, from_y], [to_x, to_y]) in
            [([1.0, 0.0], [0.0, 1.0]), ([0.0, 1.0], [-1.0, 0.0]), ([-1.0, 0.0], [0.0, -1.0]), ([0.0, -1.0], [1.0, 0.0])]
        {
            let [x1, y1] = at(from_x + HANDLE * to_x, from_y + HANDLE * to_y);
            let [x2, y2] = at(to_x + HANDLE * from_x, to_y + HANDLE * from_y);
            let [x3, y3] = at(to_x, to_y);
            self.content.cubic_to(x1, y1, x2, y2, x3, y3);
        }
        self.content.close_path();
    }

    /// Fills and strokes the current path.
    fn paint(&mut self, fill: Option<Colour>, stroke: Option<&Stroke>) {
        if let Some(fill) = fill {
            self.set_fill(fill);
        }
        if let Some(stroke) = stroke {
            let [red, green, blue] = rgb_shares(stroke.colour);
            let dash = stroke.dash.iter().map(|length| *length as f32);
            self.content
                .set_stroke_rgb(red, green, blue)
                .set_line_width(stroke.width as f32)
                .set_dash_pattern(dash, 0.0);
        }
        match (fill, stroke) {
            (Some(_), Some(_)) => self.content.fill_nonzero_and_stroke(),
            (Some(_), None) => self.content.fill_nonzero(),
            (None, Some(_)) => self.content.stroke(),
            (None, None) => self.content.end_path(),
        };
    }

    fn set_fill(&mut self, colour: Colour) {
        let [red, green, blue] = rgb_shares(colour);
        self.content.set_fill_rgb(red, green, blue);
    }

    fn set_opacity(&mut self, opacity: f64) {
        let thousandths = (opacity.clamp(0.0, 1.0) * 1000.0).round() as u16;
        let name = self.opacities.entry(thousandths).or_insert_with(|| format!("G{thousandths}"));
        self.content.set_parameters(Name(name.as_bytes()));
    }

    fn write_label(&mut self, label: &TextLabel) {
        let [x, y] = label.start.map(|part| part as f32);
        // Flip the text, because the y axis of the page points down.
        let matrix = match label.direction {
            TextDirection::Right => [1.0, 0.0, 0.0, -1.0, x, y],
            TextDirection::Up => [0.0, -1.0, -1.0, 0.0, x, y],
        };
        let text = self.font.encode(&label.text);
        self.set_fill(INK);
        self.content.begin_text().set_font(FONT, label.size as f32).set_text_matrix(matrix).show(Str(&text)).end_text();
    }

    /// Writes the whole file.
    fn document(self, [width, height]: [f32; 2], title: &str) -> Result<Vec<u8>> {
        let mut next = Ref::new(1);
        let (catalog, pages, page) = (next.bump(), next.bump(), next.bump());
        let (content, info) = (next.bump(), next.bump());
        let mut pdf = Pdf::new();
        pdf.set_version(1, 4);
        let id = title.as_bytes().to_vec();
        pdf.set_file_id((id.clone(), id));
        pdf.catalog(catalog).pages(pages);
        pdf.document_info(info).title(TextStr(title));
        pdf.pages(pages).kids([page]).count(1);
        let packed = deflate(&self.content.finish());
        pdf.stream(content, &packed).filter(Filter::FlateDecode);

        let font = self.font.write(&mut pdf, &mut next)?;
        let pictures: Vec<Ref> =
            self.pictures.iter().map(|image| write_picture(&mut pdf, next.bump(), image)).collect();

        let mut entry = pdf.page(page);
        entry.parent(pages).media_box(Rect::new(0.0, 0.0, width, height)).contents(content);
        let mut resources = entry.resources();
        if let Some(font) = font {
            resources.fonts().pair(FONT, font);
        }
        let mut states = resources.ext_g_states();
        for (thousandths, name) in &self.opacities {
            states
                .insert(Name(name.as_bytes()))
                .start::<pdf_writer::writers::ExtGraphicsState<'_>>()
                .non_stroking_alpha(f32::from(*thousandths) / 1000.0);
        }
        states.finish();
        let mut objects = resources.x_objects();
        for (index, picture) in pictures.into_iter().enumerate() {
            objects.pair(Name(picture_name(index).as_bytes()), picture);
        }
        objects.finish();
        resources.finish();
        entry.finish();
        Ok(pdf.finish())
    }
}

fn write_picture(pdf: &mut Pdf, id: Ref, image: &Rgb) -> Ref {
    let packed = deflate(image.samples());
    let mut object = pdf.image_xobject(id, &packed);
    object.filter(Filter::FlateDecode);
    object.width(image.width() as i32).height(image.height() as i32).bits_per_component(8).color_space().device_rgb();
    id
}

fn picture_name(index: usize) -> String {
    format!("I{index}")
}

/// Red, green and blue from 0 to 1.
fn rgb_shares(colour: Colour) -> [f32; 3] {
    colour.map(|part| f32::from(part) / 255.0)
}

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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::font::FONT_FILE;
    use super::super::sheet::Anchor;
    use super::*;
    use darkqa_base::types::Rgb;

    fn sheet() -> Sheet {
        let mut sheet = Sheet { size: [100.0, 50.0], ..Sheet::default() };
        sheet.label("accuracy −5 μ", [10.0, 20.0], 8.0, Anchor::Start);
        sheet.line(&[[0.0, 0.0], [50.0, 25.0]], &Stroke::solid(INK, 1.0));
        sheet.area(vec![[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]], [1, 2, 3], 0.2);
        sheet.shapes.push(Shape::Picture { corner: [5.0, 5.0], size: [20.0, 10.0], image: Arc::new(Rgb::black(2, 4)) });
        sheet
    }

    fn has(file: &[u8], label: &str) -> bool {
        file.windows(label.len()).any(|part| part == label.as_bytes())
    }

    #[test]
    fn a_pdf_is_reproducible_and_embeds_its_font() {
        let file = pdf(&sheet(), "accuracy").unwrap();
        assert_eq!(file, pdf(&sheet(), "accuracy").unwrap());
        assert!(file.starts_with(b"%PDF-1.4"));
        for present in ["/FontFile2", "+Arimo", "/ToUnicode", "/MediaBox", "/Image"] {
            assert!(has(&file, present), "{present}");
        }
        for absent in ["/Type3", "/CreationDate", "/ModDate"] {
            assert!(!has(&file, absent), "{absent}");
        }
        let mut moved = sheet();
        moved.line(&[[0.0, 0.0], [50.0, 26.0]], &Stroke::solid(INK, 1.0));
        assert_ne!(file, pdf(&moved, "accuracy").unwrap());
        // Only the glyphs that occur are embedded.
        assert!(file.len() < FONT_FILE.len());
    }

    #[test]
    fn a_sheet_without_labels_has_no_font() {
        let mut bare = sheet();
        bare.shapes.remove(0);
        assert!(!has(&pdf(&bare, "bare").unwrap(), "/FontFile2"));
    }

    #[test]
    fn a_sheet_without_area_is_refused() {
        let mut empty = sheet();
        empty.size = [0.0, 0.0];
        assert!(pdf(&empty, "empty").is_err());
    }

    #[test]
    fn missing_characters_are_named() {
        let mut sheet = sheet();
        assert!(sheet.check_characters().is_ok());
        sheet.label("模型", [0.0, 0.0], 8.0, Anchor::Start);
        let error = sheet.check_characters().unwrap_err().to_string();
        assert!(error.contains("模型") && error.contains("--label"), "{error}");
    }
}
