//! The parts of a page that depend on what its report measures: [`PageParts`].

use super::head::PageHead;
use super::run_usage::PageInputs;
use crate::report::tables::Section;

/// The parts of a page that depend on what its report measures.
pub(crate) struct PageParts<'a> {
    /// CSS class of the body; pages without true answers have one.
    pub(crate) class: &'static str,
    /// Title of the document.
    pub(crate) title: String,
    /// Heading at the top.
    pub(crate) heading: String,
    /// First screen; `None` for a page without one.
    pub(crate) head: Option<PageHead>,
    /// Noun for families of questions.
    pub(crate) family: &'static str,
    /// Lines at the top about all numbers.
    pub(crate) intro: Vec<String>,
    /// Lines below the introduction about the items.
    pub(crate) notes: Vec<String>,
    pub(crate) sections: &'a [Section],
    /// Heading of the confusion matrix.
    pub(crate) answers_title: &'static str,
    /// Items and the replies to them as compressed JSON in base64.
    pub(crate) items: String,
}

impl<'a> PageParts<'a> {
    /// An empty page with the heading `WHO in the dark`, the number of runs if there are several, and sections.
    pub(crate) fn in_the_dark(who: &str, sections: &'a [Section], inputs: &PageInputs<'_>) -> Self {
        let (title, heading) = match &*inputs.runs {
            [one] => (format!("{who} in the dark · {}", one.name), format!("{who} in the dark")),
            several => {
                let heading = format!("{who} in the dark: {} runs compared", several.len());
                (heading.clone(), heading)
            }
        };
        Self {
            class: "",
            title,
            heading,
            head: None,
            family: "family",
            intro: Vec::new(),
            notes: Vec::new(),
            sections,
            answers_title: "",
            items: String::new(),
        }
    }
}
