//! Sections of the page of an evaluation: [`SECTIONS`].
//!
//! Table of the accuracy of each model in each condition, with intervals and counts.
//!
//! Notes below tables on the training data of enhancers: [`with_training`].

use super::calibration::CONFIDENCE;
use super::variation::VARIATION;
use crate::text::table::ColumnKind::{Count, Percent, Share, Text};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::{names_enhancer, percent};
use darkqa_base::types::ModelListing;
use darkqa_score::accuracies::AccuracySummary;
use darkqa_score::choice::ParsingMode;

/// Section of the page: id, title, text below the title, and names of its figures.
pub type Section = (&'static str, &'static str, &'static str, &'static [&'static str]);

/// All sections of the page in order.
pub const SECTIONS: [Section; 16] = [
    (
        BASELINE,
        "Against the baseline",
        "New less old for each model and condition, paired by item, on the items and images that both have. Replies, failures and \
         costs are of all trials.",
        &[],
    ),
    (ACCURACY, "Accuracy in the dark", "", &["accuracy", "variants", "photographed"]),
    (
        "thresholds",
        "Darkness threshold",
        "The exposure drop at which a model has lost half of what it knows in the light: one number a model. The area is the \
         mean accuracy from L0 to the darkest level, over EV.",
        &["thresholds", "blur_thresholds"],
    ),
    (
        "readings",
        "Does each finding hold under every noise profile?",
        "The paper’s noise can be read in several ways, the noise profiles. Each finding is computed under every profile on the same items, \
         at L1–L5. It holds where an effect on its side is detected after Holm’s correction over all claims, models and profiles, has the \
         opposite where one on the other side is detected, and is open otherwise; the profiles contradict each other only if both are \
         detected. The curves under each profile are in the figures of accuracy.",
        &[],
    ),
    (
        "observer",
        "Known-signal observer",
        "Which answers one could still read from the pixels who is given the untouched frame, and must only confirm each thing piece by \
         piece. It is no model, no bound for models, and no part of any ranking. A lower line after an enhancer says that less of the \
         outlines agrees with a tone curve in smooth light, not that evidence was destroyed. A thing is seen if at least half of its outline is \
         confirmed, and detected if its whole outline, taken together, stands out of the noise. The control is the same observer with the image of \
         another scene: its score must be that of chance.",
        &[],
    ),
    (
        "families",
        "Families of questions",
        "Underlined: detected to be less often right than a model without images (its own, if it was asked so).",
        &["families"],
    ),
    (
        "groups",
        "Whole groups right",
        "The benchmark’s strict score: a group is right if all its questions are right, every time they were asked. It counts if every \
         question that the set holds of it has a reply; groups that share frames are one cluster. Chance is the mean over groups of \
         the product of 1 / number of choices.",
        &[],
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
        REAL,
        "Photographed in the dark",
        "Photographs of the same scenes in the dark, beside synthetic images that are as dark, and enhanced. How dark they are is log₂ of the \
         ratio of mean linear luminances, frame by frame, or what the data state. The row of images as dark as real says whether \
         synthetic darkness stands for real darkness: the difference, the share of the same answers, and κ of being right.",
        &["real"],
    ),
    (
        CONFIDENCE,
        "Confidence",
        "How likely the model held its answer, and how often it was right; replies with reasoning before the answer are left out. \
         Overconfidence is confidence less accuracy, in points. The calibration error is their root mean square distance over bins of \
         equal count, less what chance alone makes of it; it needs 100 replies. Brier skill is 0 for a model that holds all choices equally \
         likely, and 1 at best. AUROC is the share of pairs of a right and a wrong reply in which the right one is more confident. Risk \
         is the share of wrong replies among all, and among the 80 and 50 % with the most confidence. The blind shift is the distance to \
         the probabilities without an image, 0 to 1: what the pixels still contribute.",
        &["confidence", "reliability"],
    ),
    (
        COMPARISONS,
        "Comparisons",
        "Each paired by item, in percentage points; tested by swapping whole clusters, and corrected by Holm over the comparisons of one kind and model.",
        &[],
    ),
    (
        VARIATION,
        "Wordings, orders and draws",
        "How much of it is the darkness, and how much the wording of the prompt, the order of the choices or the draw of the noise? The standard deviation \
         that each source adds to a reply (0 or 1), in % of accuracy, by a crossed random-effects decomposition; two or three wordings say \
         little about all others, and their intervals show it. The intervals of the differences hold for other scenes, wordings, orders and draws.",
        &["variation"],
    ),
    (
        "fidelity",
        "Fidelity",
        "Does a better picture mean better answers? PSNR and SSIM of each image against its clean frame, in the size sent. The AUC \
         is the share of pairs of a right and a wrong answer, of the same model, family and condition, in which the image of the \
         right one has the higher value; 0.5 is chance.",
        &["fidelity"],
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
        "What became of the trials besides right and wrong, by the strict parsing. Replies that cannot be read count as wrong; \
         failed trials do not count.",
        &[],
    ),
];

/// Id of the section on differences from a baseline, and name of its table.
pub const BASELINE: &str = "baseline";

/// Id of the section on photographs in the dark.
pub(super) const REAL: &str = "real";

/// Id of the section on paired differences.
pub(super) const COMPARISONS: &str = "comparisons";

/// Id of the section on accuracy, which also has the sample images if no enhancer ran.
pub const ACCURACY: &str = "accuracy";

/// Id of the section on enhancers, which also has the sample images.
pub const ENHANCERS: &str = "enhancers";

pub(super) fn subjects(summary: &AccuracySummary) -> Table {
    let builder = TableBuilder::new("subjects", summary.family_cells(None, ParsingMode::Strict))
        .page(ACCURACY, "Accuracy of every subject, all families together")
        .column(Text, "page model", |cell| cell.subject.model.clone())
        .column(Text, "page condition", |cell| match cell.subject.view {
            None => "guessing".to_owned(),
            Some(_) => cell.subject.condition(),
        })
        .column(Share, "page accuracy in % [95 %]", |cell| match (cell.subject.view, cell.accuracy) {
            (None, Some(chance)) => TableCell::Guess(chance),
            (_, accuracy) => TableCell::from(accuracy),
        })
        .column(Percent, "page lenient", |cell| summary.cell(&cell.subject, None, ParsingMode::Lenient)?.accuracy)
        .column(Count, "page n", |cell| cell.replies())
        .column(Count, "page not readable", |cell| cell.unparsed)
        .column(Count, "page failed", |cell| cell.failed);
    let has_bounds = summary.cells.iter().any(|cell| cell.bounds().is_some());
    let builder = if has_bounds {
        builder.column(Text, "page if failed are wrong–right", |cell| {
            let [wrong, right] = cell.bounds()?.map(percent);
            Some(format!("{wrong}–{right}"))
        })
    } else {
        builder
    };
    let mut table = builder.build();
    table.is_folded = true;
    table
}

/// Adds a note on the training data of an enhancer, if known, to each table that has its results.
pub fn with_training(mut tables: Vec<Table>, listing: &ModelListing) -> Vec<Table> {
    for (enhancer, training) in listing.trainings() {
        for table in tables.iter_mut().filter(|table| has_results(table, enhancer)) {
            let line = format!("{enhancer}: {training}");
            table.foot = Some(match table.foot.take() {
                Some(foot) => format!("{foot}; {line}"),
                None => line,
            });
        }
    }
    tables
}

/// True if a row of the table is about an enhancer.
fn has_results(table: &Table, enhancer: &str) -> bool {
    table.rows.iter().any(|row| {
        row.cells
            .iter()
            .filter_map(|cell| match cell {
                TableCell::Text(text) => Some(&**text),
                _ => None,
            })
            .chain(row.group.as_deref())
            .any(|text| names_enhancer(text, enhancer))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::table::ColumnKind::Text;
    use crate::text::table::TableBuilder;

    fn table(condition: &'static str) -> Table {
        TableBuilder::new("levels", [condition])
            .page("accuracy", "Accuracy")
            .column(Text, "page condition", |row| (*row).to_owned())
            .build()
    }

    #[test]
    fn only_tables_with_results_have_a_training_note() {
        let mut listing = ModelListing::default();
        listing.add_training("lift", "drawn rooms".to_owned());
        let tables = ["L3-noise+lift", "with noise + lift", "lift-2", "raw"].map(table);
        let tables = with_training(tables.to_vec(), &listing);
        let feet: Vec<Option<&str>> = tables.iter().map(|table| table.foot.as_deref()).collect();
        let line = Some("lift: trained on drawn rooms");
        assert_eq!(feet, [line, line, None, None]);
    }
}
