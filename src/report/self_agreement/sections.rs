//! Sections of the page on questions without true answers: [`SECTIONS`].

use crate::report::tables::{ENHANCERS, Section};

/// All sections of the page in order.
pub(super) const SECTIONS: [Section; 8] = [
    (
        "agreement",
        "Agreement with its own answer at L0",
        "The share of questions that a model answers as it does at L0, of those to which its answer at L0 could be read. Under L0 stands \
         the ceiling: the same image asked again. The floor is the same model without an image. Evidence kept is the share of the way \
         from the floor to the ceiling. κ takes off what equal habits give, question by question. Entropy is 0 if a question gets one \
         answer about all images, and 1 if all its answers are equally frequent: a model that answers no to everything agrees with \
         itself, and its entropy is 0.",
        &["agreement", "evidence"],
    ),
    (
        "thresholds",
        "Darkness threshold",
        "The exposure drop at which a model keeps half of its evidence: half-way from the ceiling to the floor.",
        &[],
    ),
    (
        "questions",
        "The questions",
        "What each model answers at L0. A question with one answer about 95 % of the images or more is not informative: agreement is \
         given with and without such questions.",
        &[],
    ),
    (
        "models",
        "The models at L0",
        "How far two models agree with each other at L0. Each is compared with itself, so that their agreements can be compared only as far as that.",
        &[],
    ),
    (
        ENHANCERS,
        "Images and enhancement",
        "Enhanced less raw, in percentage points of agreement. At L0 an enhancer is compared with the same image asked again: less \
         agreement there is harm, unless the photographs were taken in the dark.",
        &[],
    ),
    ("answers", "What changes in the dark", "Answers against those at L0, not against the truth.", &[]),
    ("comparisons", "Comparisons", "Each paired by item, in percentage points of agreement.", &[]),
    (
        "health",
        "Parse health",
        "What became of the trials, by the strict parsing. A reply that cannot be read does not agree; failed trials do not count.",
        &[],
    ),
];
