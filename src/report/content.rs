//! The content of a report, whatever it measures: [`Report`], its [`Measure`], and the parts of its page that depend on
//! the measure ([`PageParts`]).

use crate::charts::chart::Figure;
use crate::json::SummaryRuns;
use crate::page::{PageHead, PageInputs};
use crate::sentences::Sentence;
use crate::tables::{EnhancerRow, Section, enhancers};
use crate::text::alert::Alert;
use crate::text::table::Table;
use crate::text::words::ProfileNames;
use darkqa_base::error::Result;
use darkqa_runs::outcome::ReportLength;
use darkqa_score::comparisons::PooledFinding;
use darkqa_score::findings::Findings;

/// What a report measures: accuracy, agreement of each model with its own answers at L0, or marks of a judge. All else
/// in a report is the same for each measure.
pub trait Measure {
    /// Figures of the page.
    fn figures(&self) -> Result<Vec<Figure>>;

    /// The parts of the page that depend on the measure.
    fn page_parts<'p>(&'p self, report: &'p Report<'_>, inputs: &'p PageInputs<'_>) -> Result<PageParts<'p>>;

    /// Serializes the head of `summary.json` and the tables below it.
    fn json(&self, report: &Report<'_>, runs: SummaryRuns<'_>, length: ReportLength) -> Result<String>;

    /// The table by level, and the lines below it, for a short text.
    fn short_tables(&self, report: &Report<'_>) -> String;

    /// The tables of a short Markdown report.
    fn short_markdown_tables<'t>(&self, tables: &'t [Table]) -> Vec<&'t Table>;

    /// Noise profiles of the noisy images.
    fn profiles(&self) -> ProfileNames;

    /// False for a measure without statistical tests, whose report has no findings.
    fn has_findings(&self) -> bool {
        true
    }

    /// Title of the file with the tables as LaTeX.
    fn latex_title(&self) -> &'static str {
        "Findings and tables"
    }

    /// Further files, by name.
    fn files(&self) -> Result<Vec<(String, Vec<u8>)>> {
        Ok(Vec::new())
    }

    /// Effects of the enhancers on what is measured; empty for a measure that does not test them.
    fn enhancer_effects(&self) -> Vec<&PooledFinding> {
        Vec::new()
    }

    /// Findings whose items are listed by first failing level in a file of their own, which can be large.
    fn first_failures(&self) -> Option<&Findings<'_>> {
        None
    }
}

/// Results of one or more runs as sentences and tables.
pub struct Report<'a> {
    pub measure: Box<dyn Measure + 'a>,
    /// Numbers of models, questions and replies, one fact each.
    pub facts: Vec<String>,
    /// Warnings and notes at the top of the report.
    pub alerts: Vec<Alert>,
    /// Findings as sentences.
    pub sentences: Vec<Sentence>,
    /// Remark below the findings.
    pub how_to_read: String,
    /// All tables; the first is the summary.
    pub tables: Vec<Table>,
}

impl Report<'_> {
    /// Adds the tables of enhancer use.
    #[must_use]
    pub fn with_enhancers(mut self, rows: &[EnhancerRow]) -> Self {
        let table = enhancers(rows, &self.measure.enhancer_effects());
        self.tables.extend(table);
        self
    }

    /// The line with the numbers of models, questions and replies.
    pub fn head(&self) -> String {
        self.facts.join(" · ")
    }
}

/// The parts of a page that depend on what its report measures.
pub struct PageParts<'a> {
    /// CSS class of the body; pages without true answers have one.
    pub class: &'static str,
    /// Title of the document.
    pub title: String,
    /// Heading at the top.
    pub heading: String,
    /// First screen; `None` for a page without one.
    pub head: Option<PageHead>,
    /// Noun for families of questions.
    pub family: &'static str,
    /// Lines at the top about all numbers.
    pub intro: Vec<String>,
    /// Lines below the introduction about the items.
    pub notes: Vec<String>,
    pub sections: &'a [Section],
    /// Heading of the confusion matrix.
    pub answers_title: &'static str,
    /// Items and the replies to them as compressed JSON in base64.
    pub items: String,
}

impl<'a> PageParts<'a> {
    /// An empty page with the heading `WHO in the dark`, the number of runs if there are several, and sections.
    pub fn in_the_dark(who: &str, sections: &'a [Section], inputs: &PageInputs<'_>) -> Self {
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
