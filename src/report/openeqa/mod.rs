//! What a run of open questions leaves: [`products`], and the table at its end.

mod figure;
mod files;
mod latex;
mod page;
mod rows;
pub mod table;
mod upstream;

use crate::error::Result;
use crate::report::products::PAGE;
use crate::score::llm_match::Protocol;
use crate::score::open::{Group, OpenSummary, Outcome};
use crate::score::subject::Subject;
use crate::types::manifest::RunManifest;
use crate::types::{QuestionId, Thumbnail};

pub use files::json;

/// Everything that a run of open questions says.
#[derive(Debug, Clone, Copy)]
pub struct OpenReport<'a> {
    /// The scores.
    pub summary: &'a OpenSummary,
    /// The run.
    pub manifest: &'a RunManifest,
    /// Who marked the answers; `None` for nobody.
    pub judge: Option<&'a str>,
    /// How they were judged.
    pub protocol: Protocol,
    /// What the run is called: its folder.
    pub name: &'a str,
    /// The questions in the order of their file.
    pub questions: &'a [Asked<'a>],
    /// The answers, each to one of the questions.
    pub answers: &'a [Told],
    /// The small copies of images, by walk and condition.
    pub thumbnails: &'a [Thumbnail],
}

/// An open question.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// Its name.
    pub id: &'a QuestionId,
    /// The question in words.
    pub text: &'a str,
    /// The true answer.
    pub answer: &'a str,
    /// Other answers that are right, too.
    pub extra: Option<&'a [String]>,
    /// Its category.
    pub category: &'a str,
    /// Its walk.
    pub episode: &'a str,
}

/// One answer.
#[derive(Debug, Clone)]
pub struct Told {
    /// Whose.
    pub subject: Subject,
    /// The question's place.
    pub question: usize,
    /// In its own words; `None` where there is none.
    pub answer: Option<String>,
    /// What came of it.
    pub outcome: Outcome,
}

/// The files of a run by name: the numbers as CSV, the table as LaTeX, the figures as SVG, answers and marks as upstream's own
/// files, and the page.
///
/// # Errors
/// Where one cannot be made.
pub fn products(report: &OpenReport<'_>) -> Result<Vec<(String, Vec<u8>)>> {
    let mut made = vec![
        ("summary.csv".to_owned(), files::csv(report.summary)?),
        ("tables.tex".to_owned(), latex::table(report).into_bytes()),
    ];
    let figures = figure::figures(report)?;
    let page = page::page(report, &figures)?;
    made.extend(figures.into_iter().map(|figure| {
        let name = format!("figures/{}.svg", figure.name);
        (name, figure.svg.into_bytes())
    }));
    made.extend(upstream::files(report)?);
    made.push((PAGE.to_owned(), page.into_bytes()));
    Ok(made)
}

/// What the scores rest on, in lines.
#[must_use]
pub fn coverage(report: &OpenReport<'_>) -> Vec<String> {
    let cells = report.summary.cells.iter();
    let all = cells.filter(|cell| cell.group == Group::All);
    let (mut due, mut scored) = (0, 0);
    let (mut missing, mut unjudged, mut unmarked, mut null, mut cut) = (0, 0, 0, 0, 0);
    for cell in all {
        due += cell.due;
        scored += cell.score.map_or(0, |score| score.n);
        missing += cell.missing;
        unjudged += cell.unjudged;
        unmarked += cell.unmarked;
        null += cell.null;
        cut += cell.cut;
    }
    let mut lines = vec![format!("{scored} of {due} answers scored")];
    let mut say = |count: usize, what: &str| {
        if count > 0 {
            lines.push(format!("{count} {what}"));
        }
    };
    say(missing, "not answered: not scored");
    if report.judge.is_some() {
        say(unjudged, "not judged yet: not scored");
    }
    say(
        unmarked,
        "without a mark in the judge's reply: not scored (--protocol tolerant reads more, --judge-max-tokens gives it more room)",
    );
    say(
        null,
        "without an answer (none in a file, or no \"A:\" in the reply of a blind model): scored 0, unjudged",
    );
    say(
        cut,
        "cut after their last full stop before they were judged, as upstream does",
    );
    lines
}
