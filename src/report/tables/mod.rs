//! The tables of an evaluation, one file a subject matter: [`tables`]; and the sections of its page.

mod agreement;
mod answers;
mod comparisons;
mod families;
mod flips;
mod health;
mod levels;
mod subjects;
mod summary;
mod thresholds;

use super::table::Kind::Text;
use super::table::{Cell, Layout, Table};
use super::words::{family, name};
use crate::score::findings::Findings;
use crate::score::subject::Subject;
use crate::types::{EnhancerName, Family, KindReading};

pub(super) use summary::{SUMMARY, reading};

/// Every table of an evaluation; the first is the summary.
#[must_use]
pub fn tables(findings: &Findings<'_>) -> Vec<Table> {
    [
        vec![summary::summary(&findings.summary)],
        vec![levels::levels(findings)],
        vec![subjects::subjects(&findings.summary)],
        thresholds::thresholds(findings),
        vec![families::families(findings)],
        comparisons::comparisons(findings),
        answers::answers(findings),
        vec![flips::flips(findings)],
        vec![agreement::agreement(&findings.agreements)],
        vec![health::health(&findings.health)],
    ]
    .concat()
}

/// A section of the page: its name in links, its title, what is said above it, and its figures.
pub(super) type Section = (
    &'static str,
    &'static str,
    &'static str,
    &'static [&'static str],
);

/// The sections of the page in order.
pub(super) const SECTIONS: [Section; 8] = [
    (
        "accuracy",
        "Accuracy in the dark",
        "",
        &["accuracy", "variants"],
    ),
    (
        "thresholds",
        "Darkness threshold",
        "The exposure drop at which a model has lost half of what it knows in the light: one number a model. The area is the \
         mean accuracy from L0 to the darkest level, over EV.",
        &["thresholds"],
    ),
    (
        "families",
        "Families of questions",
        "Underlined: below a model without images (its own, where it was asked so), where pictures in the dark do more harm than none.",
        &["families"],
    ),
    (
        ENHANCERS,
        "Enhancement",
        "Enhanced less raw, in percentage points. Rescued: wrong raw, right enhanced; harmed: the other way round.",
        &["enhancers"],
    ),
    (
        "answers",
        "Hallucination and collapse",
        "What is said when nothing is seen: objects that are not there, and one answer to everything.",
        &["hallucination", "collapse"],
    ),
    (
        "comparisons",
        "Comparisons",
        "Each paired by item, in percentage points.",
        &[],
    ),
    (
        "agreement",
        "Agreement between models",
        "The share of items with the same answer, and Cohen’s κ of being right (0: they err independently).",
        &[],
    ),
    (
        "health",
        "Parse health",
        "What became of the trials besides right and wrong, by the strict reading. Replies that cannot be read count as wrong; \
         failed trials do not count.",
        &[],
    ),
];

/// The section with pictures of the frames.
pub(super) const ENHANCERS: &str = "enhancers";

impl<T> Layout<T> {
    /// The columns that say whom a row is about.
    pub(in crate::report) fn subject(
        self,
        of: impl Fn(&T) -> &Subject,
        variant: impl Fn(&KindReading) -> String,
    ) -> Self {
        let said = |text: Option<String>| Cell::from(text);
        self.column(Text, "csv model", |row| of(row).model.clone())
            .column(Text, "csv view", |row| {
                said(of(row).view.map(|view| view.to_string()))
            })
            .column(Text, "csv level", |row| {
                said(of(row).level.map(|level| level.to_string()))
            })
            .column(Text, "csv variant", |row| variant(&of(row).variant))
            .column(Text, "csv enhancer", |row| {
                said(of(row).enhancer.as_ref().map(ToString::to_string))
            })
            .column(Text, "page subject", |row| name(of(row)))
    }

    /// The columns that say which line over the levels a row is about: its model, variant and enhancer.
    fn line(self, of: impl Fn(&T) -> (&str, &KindReading, Option<&EnhancerName>)) -> Self {
        self.column(Text, "csv model | terminal model | page model", |row| {
            of(row).0.to_owned()
        })
        .column(Text, "csv variant", |row| of(row).1.to_string())
        .column(Text, "csv enhancer", |row| {
            of(row).2.map(ToString::to_string)
        })
    }

    /// The columns of the family; `None` is all of them together.
    fn family(self, of: impl Fn(&T) -> Option<&Family>) -> Self {
        self.column(Text, "csv family", |row| {
            of(row).map_or(Family::TOTAL, Family::name).to_owned()
        })
        .column(Text, "page family", |row| family(of(row)).to_owned())
    }
}
