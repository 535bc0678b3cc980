//! The sections of the page before the items: [`sections`].

use serde::Serialize;

use super::tables;
use crate::report::figures::Figure;
use crate::report::samples::{Samples, samples};
use crate::score::comparison::Kind;
use crate::score::findings::Findings;
use crate::types::Thumbnail;

/// One section.
#[derive(Serialize)]
pub(super) struct Section {
    id: &'static str,
    title: &'static str,
    note: String,
    figures: Vec<Drawing>,
    samples: Option<Samples>,
    tables: Vec<tables::Table>,
}

#[derive(Serialize)]
struct Drawing {
    caption: String,
    svg: String,
}

/// All sections that the records have something for.
pub(super) fn sections(
    findings: &Findings<'_>,
    figures: &[Figure],
    thumbnails: &[Thumbnail],
) -> Vec<Section> {
    let take = |names: &[&str]| -> Vec<Drawing> {
        let named = figures.iter().filter(|figure| names.contains(&figure.name));
        let drawings = named.map(|figure| Drawing {
            caption: figure.caption.clone(),
            svg: figure.svg.clone(),
        });
        drawings.collect()
    };
    let section = |id, title, note: &str, figures, tables| Section {
        id,
        title,
        note: note.to_owned(),
        figures,
        samples: None,
        tables,
    };
    let mut sections = vec![
        section(
            "accuracy",
            "Accuracy in the dark",
            "",
            take(&["accuracy", "variants"]),
            tables::accuracy(findings),
        ),
        section(
            "thresholds",
            "Darkness threshold",
            "The exposure drop at which a model has lost half of what it knows in the light: one number a model. The area is the \
             mean accuracy from L0 to the darkest level, over EV.",
            take(&["thresholds"]),
            tables::thresholds(findings),
        ),
        section(
            "families",
            "Families of questions",
            "Underlined: below a model without images (its own, where it was asked so), where pictures in the dark do more harm than none.",
            take(&["families"]),
            vec![tables::families(findings)],
        ),
        Section {
            samples: samples(thumbnails),
            ..section(
                "enhancers",
                "Enhancement",
                "Enhanced less raw, in percentage points. Rescued: wrong raw, right enhanced; harmed: the other way round.",
                take(&["enhancers"]),
                tables::compared(findings, &[Kind::Enhancer]),
            )
        },
        section(
            "answers",
            "Hallucination and collapse",
            "What is said when nothing is seen: objects that are not there, and one answer to everything.",
            take(&["hallucination", "collapse"]),
            vec![tables::collapse(findings)],
        ),
        section(
            "comparisons",
            "Comparisons",
            "Each paired by item, in percentage points.",
            Vec::new(),
            tables::compared(
                findings,
                &[Kind::Level, Kind::Variant, Kind::Model, Kind::Blind],
            ),
        ),
        section(
            "agreement",
            "Agreement between models",
            "The share of items with the same answer, and Cohen’s κ of being right (0: they err independently).",
            Vec::new(),
            vec![tables::agreement(findings)],
        ),
        section(
            "health",
            "Parse health",
            "What became of the trials besides right and wrong, by the strict reading. Replies that cannot be read count as wrong; \
             failed trials do not count.",
            Vec::new(),
            vec![tables::health(findings)],
        ),
    ];
    for section in &mut sections {
        section.tables.retain(|table| !table.rows.is_empty());
    }
    sections.retain(|section| {
        !section.tables.is_empty() || !section.figures.is_empty() || section.samples.is_some()
    });
    sections
}
