//! Thumbnails of the first frames by level, for the page ([`samples`]) and as a figure ([`figure`]).

use std::collections::BTreeSet;
use std::fmt::Write;

use serde::Serialize;

use crate::text::words::light;
use crate::types::degradations::Axis;
use crate::types::text::escape_hidden;
use crate::types::{AxisLevel, Condition, EnhancerName, FrameId, RunGroup, Thumbnail, Variant};

/// The samples of one axis.
#[derive(Serialize)]
pub(crate) struct SamplePage {
    /// Name of the figure's file.
    #[serde(skip)]
    pub(crate) name: &'static str,
    levels: Vec<String>,
    rows: Vec<SampleRow>,
}

#[derive(Serialize)]
struct SampleRow {
    name: String,
    images: Vec<Option<SampleImage>>,
}

#[derive(Serialize)]
struct SampleImage {
    url: String,
    alt: String,
}

/// Maximum number of frames that are shown.
const MAX_FRAMES: usize = 3;

/// The first frames by level, with a row for each variant and enhancer: a page for each axis. Empty without thumbnails.
pub(crate) fn samples(thumbnails: &[Thumbnail]) -> Vec<SamplePage> {
    let axis = |thumbnail: &Thumbnail| thumbnail.condition.level().axis();
    Axis::present(|on| {
        thumbnails
            .iter()
            .any(|thumbnail| axis(thumbnail) == Some(on))
    })
    .into_iter()
    .filter_map(|on| {
        let all: Vec<&Thumbnail> = thumbnails
            .iter()
            .filter(|of| of.condition.level().belongs_to(on))
            .collect();
        axis_page(&all, on)
    })
    .collect()
}

/// The page of the thumbnails of one axis; `None` without any.
fn axis_page(thumbnails: &[&Thumbnail], axis: Axis) -> Option<SamplePage> {
    let mut frames: Vec<&FrameId> = thumbnails
        .iter()
        .map(|thumbnail| &thumbnail.frame)
        .collect();
    frames.sort_unstable();
    frames.dedup();
    let levels: BTreeSet<AxisLevel> = thumbnails.iter().map(|of| of.condition.level()).collect();
    let lines = lines(thumbnails);
    let mut rows = Vec::new();
    for frame in frames.into_iter().take(MAX_FRAMES) {
        for (variant, enhancer) in &lines {
            let is_shown = |condition: &Condition, at: AxisLevel| {
                condition.level() == at
                    && (condition.variant() == *variant && condition.enhancer.as_ref() == *enhancer
                        || at == AxisLevel::L0
                            && condition.enhancer.as_ref() == *enhancer
                            && RunGroup::overlap(condition.group.as_ref(), variant.group.as_ref()))
            };
            let images = levels.iter().map(|at| {
                let thumbnail = thumbnails
                    .iter()
                    .filter(|thumbnail| thumbnail.frame == *frame)
                    .find(|thumbnail| is_shown(&thumbnail.condition, *at))?;
                Some(SampleImage {
                    url: thumbnail.small.clone(),
                    alt: format!("{} at {}", frame, thumbnail.condition),
                })
            });
            rows.push(SampleRow {
                name: format!("{frame}, {}", light(variant, *enhancer)),
                images: images.collect(),
            });
        }
    }
    let level_names = levels.iter().map(|level| match *level {
        AxisLevel::PAIR => level.to_string(),
        _ => format!("{level}, {} {}", level.value(), axis.unit),
    });
    (!rows.is_empty()).then(|| SamplePage {
        name: match axis {
            Axis::MOTION => "blur_samples",
            _ => "samples",
        },
        levels: level_names.collect(),
        rows,
    })
}

/// The rows of a frame: each variant, raw and with each enhancer. The clean frames stand in the rows of the degraded ones; they have a
/// row of their own if there is no other, raw or with the same enhancer.
fn lines<'a>(thumbnails: &[&'a Thumbnail]) -> BTreeSet<(Variant, Option<&'a EnhancerName>)> {
    let all = thumbnails
        .iter()
        .map(|t| (t.condition.variant(), t.condition.enhancer.as_ref()));
    let (mut lines, clean): (BTreeSet<_>, BTreeSet<_>) =
        all.partition(|(variant, _)| variant.is_degraded());
    for (_, enhancer) in clean {
        if lines.iter().all(|(_, other)| *other != enhancer) {
            lines.insert((Variant::NONE, enhancer));
        }
    }
    lines
}

/// Width and height of an image in the figure, and width of the names and height of the levels, in pixels.
const CELL: [usize; 2] = [200, 150];
const HEAD: [usize; 2] = [180, 28];

/// The samples as one SVG, with the images embedded.
pub(crate) fn figure(samples: &SamplePage) -> String {
    let size = [
        HEAD[0] + samples.levels.len() * (CELL[0] + 4),
        HEAD[1] + samples.rows.len() * (CELL[1] + 4),
    ];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n",
        size[0], size[1]
    );
    for (index, level) in samples.levels.iter().enumerate() {
        let x = HEAD[0] + index * (CELL[0] + 4) + CELL[0] / 2;
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"18\" text-anchor=\"middle\">{level}</text>"
        );
    }
    for (index, row) in samples.rows.iter().enumerate() {
        let y = HEAD[1] + index * (CELL[1] + 4);
        for (line, part) in row.name.split(", ").enumerate() {
            let baseline = y + CELL[1] / 2 + line * 18;
            let part = escaped(part);
            let _ = writeln!(svg, "<text x=\"8\" y=\"{baseline}\">{part}</text>");
        }
        for (column, image) in row.images.iter().enumerate() {
            let x = HEAD[0] + column * (CELL[0] + 4);
            if let Some(image) = image {
                let _ = writeln!(
                    svg,
                    "<image x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" href=\"{}\"/>",
                    CELL[0], CELL[1], image.url
                );
            }
        }
    }
    svg + "</svg>\n"
}

/// Text with the special characters of XML escaped.
fn escaped(text: &str) -> String {
    escape_hidden(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Digest;

    /// The samples of thumbnails of one axis.
    fn only(thumbnails: &[Thumbnail]) -> SamplePage {
        let mut pages = samples(thumbnails);
        assert_eq!(pages.len(), 1);
        pages.remove(0)
    }

    fn thumbnail(condition: &str) -> Thumbnail {
        Thumbnail {
            frame: FrameId("a<b>&c".into()),
            condition: condition.parse().unwrap(),
            image: Digest::from_bytes(condition.as_bytes()),
            small: format!("data:{condition}"),
            crop: String::new(),
            stops: 0.0,
            size: None,
            objects: Vec::new(),
        }
    }

    #[test]
    fn each_axis_has_its_page() {
        let all = ["L0", "L3-auto", "T8.33-motion", "T33.33-motion"].map(thumbnail);
        let pages = samples(&all);
        let names: Vec<&str> = pages.iter().map(|page| page.name).collect();
        assert_eq!(names, ["samples", "blur_samples"]);
        assert_eq!(pages[0].levels, ["L0, 0 EV", "L3, 6 EV"]);
        assert_eq!(
            pages[1].levels,
            ["L0, 0 ms", "T8.33, 8.33 ms", "T33.33, 33.33 ms"]
        );
        assert!(pages[1].rows.len() == 1 && pages[1].rows[0].images.iter().all(Option::is_some));
        assert!(samples(&[]).is_empty());
    }

    #[test]
    fn each_row_has_its_images_and_names_are_escaped() {
        let thumbnails = ["L0", "L3-ev", "L3-noise", "L3-noise+lift"].map(thumbnail);
        let samples = only(&thumbnails);
        let urls = |row: &SampleRow| -> Vec<String> {
            row.images
                .iter()
                .map(|image| image.as_ref().map(|i| i.url.clone()))
                .map(Option::unwrap_or_default)
                .collect()
        };
        let rows: Vec<Vec<String>> = samples.rows.iter().map(urls).collect();
        assert_eq!(rows[0], ["data:L0", "data:L3-ev"]);
        assert_eq!(rows[1], ["data:L0", "data:L3-noise"]);
        assert_eq!(rows[2], ["", "data:L3-noise+lift"]);
        let enhanced = ["L0", "L0+lift", "L3-ev", "L3-noise", "L3-noise+lift"].map(thumbnail);
        let enhanced = only(&enhanced);
        let rows: Vec<Vec<String>> = enhanced.rows.iter().map(urls).collect();
        assert_eq!(rows[1], ["data:L0", "data:L3-noise"]);
        assert_eq!(rows[2], ["data:L0+lift", "data:L3-noise+lift"]);
        let clean = ["L0", "L0+lift", "L3-noise"].map(thumbnail);
        let clean = only(&clean);
        let rows: BTreeSet<Vec<String>> = clean.rows.iter().map(urls).collect();
        let expected = [["data:L0", "data:L3-noise"], ["data:L0+lift", ""]];
        assert_eq!(
            rows,
            expected.map(|row| row.map(str::to_owned).to_vec()).into()
        );
        let svg = figure(&samples);
        assert_eq!(svg.matches("<image").count(), 5);
        assert!(svg.contains("a&lt;b&gt;&amp;c") && !svg.contains("a<b>"));
    }
}
