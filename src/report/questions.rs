//! Reports on a set of questions: statistics as a table, as files and as a figure, checks by people, and comparison
//! with another set.
//!
//! Comparison of two sets of frames by the quartiles of their appearance: [`AppearanceComparison`].
//!
//! Report on questions that people checked, as text and as JSON: [`text`], [`checks_json()`].
//!
//! Bar charts of a set of questions, as SVG: [`figure`].
//!
//! HTML page on which a person checks each question: [`page`].

use std::fmt::{Display, Write as _};

use serde::Serialize;
use serde_json::{Value, json};

use super::template::allow_script;
use crate::charts::chart::Panel;
use crate::charts::paper::count_figure;
use crate::text::table as files;
use crate::text::table::ColumnKind::{Count, Text};
use crate::text::table::TableBuilder;
use crate::text::terminal::{self, to_script_json};
use crate::text::words::with_interval;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::questions::FAMILIES;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Digest, Evidence, Family};
use darkqa_questions::GeneratedQuestion;
use darkqa_questions::appearance::{FrameAppearance, MIN_EDGE_GRADIENT};
use darkqa_questions::colors::{Color, NONE};
use darkqa_questions::summary::{Baselines, CandidateCounts, ClassCoverage, QuestionSummary};
use darkqa_score::answers::record::{Checks, agreements, shares};
use darkqa_score::estimate::Estimate;

/// Maximum number of reasons in a row of the table.
const MAX_REASONS: usize = 3;

/// Table for the terminal: questions by family, with the scores of answering without images and the number of valid
/// candidates.
#[must_use]
pub fn table(summary: &QuestionSummary) -> String {
    let families = FAMILIES.iter().filter_map(|row| Some((row.name, Some(summary.candidates.get(&row.family)?))));
    let total = summary.baselines.get(Family::TOTAL);
    let rows = families.chain(total.map(|_| (Family::TOTAL, None)));
    let table = TableBuilder::new("questions", rows)
        .column(Text, "terminal family", |(family, _)| *family)
        .column(Count, "terminal questions", |(_, candidates)| {
            candidates.map_or(summary.questions, |counts| counts.asked as usize)
        })
        .column(Count, "terminal chance %", |(family, _)| baseline_text(summary, family, |base| base.chance))
        .column(Count, "terminal majority %", |(family, _)| baseline_text(summary, family, |base| base.majority as f64))
        .column(Count, "terminal prior %", |(family, _)| baseline_text(summary, family, |base| base.prior))
        .column(Count, "terminal candidates that hold", |(_, candidates)| {
            candidates.map_or(String::new(), |counts| counts.viable.to_string())
        })
        .column(Text, "terminal why others do not", |(_, candidates)| candidates.map_or(String::new(), reasons))
        .build();
    let notes: String = notes(summary).into_iter().map(|note| note + "\n").collect();
    terminal::table(&[table]) + &notes
}

/// Score of a way to answer without images, in percent. `right` reads the expected number of right answers.
fn baseline_text(summary: &QuestionSummary, family: &str, right: fn(&Baselines) -> f64) -> String {
    let baselines = summary.baselines.get(family).filter(|baselines| baselines.questions > 0);
    baselines
        .map_or("–".to_owned(), |baselines| format!("{:.1}", 100.0 * right(baselines) / baselines.questions as f64))
}

/// Most frequent reasons for rejected candidates, with counts.
fn reasons(candidates: &CandidateCounts) -> String {
    let mut rejected: Vec<(String, u64)> =
        candidates.rejections.iter().map(|(reason, count)| (variant_words(reason), *count)).collect();
    rejected.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    let reasons: Vec<String> =
        rejected.iter().take(MAX_REASONS).map(|(reason, count)| format!("{reason} {count}")).collect();
    reasons.join(", ")
}

/// Notes below the table.
fn notes(summary: &QuestionSummary) -> Vec<String> {
    let mut notes = vec![format!(
        "{} about {} of {}; prior: the commonest answer to the same words in other scenes",
        counted(summary.questions, "question"),
        counted(summary.frames, "frame"),
        counted(summary.scenes, "scene")
    )];
    let candidates = summary.candidates.values();
    let unbalanced: u64 = candidates.clone().map(|counts| counts.unbalanced).sum();
    let rejected: u64 = candidates.map(|counts| counts.rejected).sum();
    if unbalanced > 0 {
        notes.push(format!("{unbalanced} more were left out to even out the answers (--balance {})", summary.balance));
    }
    if rejected > 0 {
        notes.push(format!("{rejected} more were rejected by a person"));
    }
    let [both, same] = summary.room_agreement;
    if both > 0 {
        notes.push(format!("rooms: {same} of {both} that are both seen and stated agree"));
    }
    if summary.dark > 0 {
        notes.push(format!("too dark to ask about: {}", counted(summary.dark, "frame")));
    }
    if summary.failed > 0 {
        notes.push(format!("no questions, because measuring failed: {}", counted(summary.failed, "frame")));
    }
    if !summary.unknown.is_empty() {
        let ids: Vec<String> = summary.unknown.keys().take(8).map(u16::to_string).collect();
        notes.push(format!(
            "{} not in classes.json and read as unlabelled, for example {} (--strict makes this an error)",
            counted(summary.unknown.len(), "number"),
            ids.join(", ")
        ));
    }
    notes
}

/// Serialized name of an enum variant, with spaces for underscores.
fn variant_words<T: serde::Serialize>(value: &T) -> String {
    let json = serde_json::to_value(value).unwrap_or_default();
    json.as_str().unwrap_or_default().replace('_', " ")
}

/// Content of the JSON file: the summary, checks by people, and a comparison with another set.
#[derive(Serialize)]
struct SummaryFile<'a> {
    #[serde(flatten)]
    summary: &'a QuestionSummary,
    #[serde(skip_serializing_if = "Option::is_none")]
    checks: Option<serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<&'a AppearanceComparison>,
}

/// Serializes the summary as JSON, with the checks by people and a comparison with another set, if there are any.
///
/// # Errors
/// If the statistics cannot be serialized.
pub fn json(summary: &QuestionSummary, checks: &Checks, against: Option<&AppearanceComparison>) -> Result<String> {
    let file = SummaryFile { summary, checks: (!checks.is_empty()).then(|| checks_json(checks)), against };
    serde_json::to_string_pretty(&file).map(|text| text + "\n").map_err(|e| Error::data("statistics", e))
}

/// Writes all counts as CSV with the columns `table, row, column, count`.
///
/// # Errors
/// If the statistics cannot be written.
pub fn csv(summary: &QuestionSummary) -> Result<Vec<u8>> {
    let mut rows: Vec<[String; 4]> = Vec::new();
    let mut row = |table: &str, row: &dyn Display, column: &str, count: &dyn Display| {
        rows.push([table, &row.to_string(), column, &count.to_string()].map(str::to_owned));
    };
    for (name, count) in [
        ("scenes", summary.scenes),
        ("frames", summary.frames),
        ("failed", summary.failed),
        ("dark", summary.dark),
        ("questions", summary.questions),
        ("repeats", summary.repeats),
    ] {
        row("all", &name, "", &count);
    }
    for (family, candidates) in &summary.candidates {
        let name = family.name();
        row("candidates", &name, "viable", &candidates.viable);
        row("candidates", &name, "asked", &candidates.asked);
        row("candidates", &name, "not_chosen", &candidates.not_chosen);
        row("candidates", &name, "rejected", &candidates.rejected);
        row("candidates", &name, "unbalanced", &candidates.unbalanced);
        for (reason, count) in &candidates.rejections {
            row("fallen", &name, &variant_words(reason), count);
        }
    }
    for (questions, frames) in &summary.per_frame {
        row("per_frame", questions, "frames", frames);
    }
    for (family, answers) in &summary.answers {
        for (answer, count) in answers {
            row("answers", &family.name(), answer, count);
        }
    }
    for (words, count) in &summary.texts {
        row("texts", words, "", count);
    }
    for (choices, count) in &summary.choices {
        row("choices", choices, "questions", count);
    }
    for (family, subjects) in &summary.polarity {
        for (about, [yes, no]) in subjects {
            row(family.name(), about, "yes", yes);
            row(family.name(), about, "no", no);
        }
    }
    for (class, coverage) in &summary.classes {
        row("classes", class, "pixels", &coverage.pixels);
        row("classes", class, "segments", &coverage.segments);
        row("classes", class, "frames", &coverage.frames);
        row("classes", class, "questions", &coverage.questions);
    }
    for (room, counts) in &summary.rooms {
        row("rooms", room, "frames", &counts.frames);
        row("rooms", room, "questions", &counts.questions);
    }
    for (gap, count) in &summary.gaps {
        row("gaps_mm", gap, "questions", count);
    }
    for (family, base) in &summary.baselines {
        row("baselines", family, "questions", &base.questions);
        row("baselines", family, "chance", &base.chance);
        row("baselines", family, "majority", &base.majority);
        row("baselines", family, "prior", &base.prior);
    }
    let table = TableBuilder::new("statistics", rows)
        .column(Text, "csv table", |[table, ..]| table.clone())
        .column(Text, "csv row", |[_, row, ..]| row.clone())
        .column(Text, "csv column", |[.., column, _]| column.clone())
        .column(Count, "csv count", |[.., count]| count.clone())
        .build();
    files::csv(&[table])
}

/// Measures of appearance of two sets of frames.
#[derive(Debug, Serialize)]
pub struct AppearanceComparison {
    /// Name and number of frames of each set.
    sets: [(String, usize); 2],
    rows: Vec<MeasureRow>,
}

/// One measure of both sets.
#[derive(Debug, Serialize)]
struct MeasureRow {
    measure: String,
    /// Quartiles of each set (25 %, 50 % and 75 %) over the frames that have the measure; `None` without such frames.
    quartiles: [Option<[f64; 3]>; 2],
    /// Number of decimals in the table.
    #[serde(skip)]
    decimals: usize,
}

impl MeasureRow {
    fn new(
        sets: [&[FrameAppearance]; 2],
        measure: &str,
        decimals: usize,
        value: impl Fn(&FrameAppearance) -> Option<f64>,
    ) -> Self {
        Self {
            measure: measure.to_owned(),
            quartiles: sets.map(|frames| quartiles(frames.iter().filter_map(&value).collect())),
            decimals,
        }
    }

    /// Median and quartiles of the first (0) or the other (1) set.
    fn text(&self, set: usize) -> String {
        match self.quartiles[set] {
            Some(quartiles) => {
                let [low, middle, high] = quartiles.map(|value| format!("{value:.*}", self.decimals));
                format!("{middle} ({low} to {high})")
            }
            None => "–".to_owned(),
        }
    }

    /// Position of the first set's median relative to the quartiles of the other set.
    fn median_position(&self) -> &'static str {
        match self.quartiles {
            [Some([_, middle, _]), Some([low, _, _])] if middle < low => "below",
            [Some([_, middle, _]), Some([_, _, high])] if middle > high => "above",
            [Some(_), Some(_)] => "within",
            _ => "–",
        }
    }
}

/// Nearest-rank quartiles; `None` without numbers.
fn quartiles(mut numbers: Vec<f64>) -> Option<[f64; 3]> {
    numbers.sort_by(f64::total_cmp);
    let count = numbers.len();
    (count > 0).then(|| [1, 2, 3].map(|quarter| numbers[(count * quarter).div_ceil(4) - 1]))
}

impl AppearanceComparison {
    /// Compares two sets of frames, each with its name.
    #[must_use]
    pub fn new(sets: [(&str, &[FrameAppearance]); 2]) -> Self {
        let looks = sets.map(|(_, looks)| looks);
        let mut rows = vec![
            MeasureRow::new(looks, "mean linear light, EV of white", 2, |look| Some(look.light_ev)),
            MeasureRow::new(looks, "pixels at edges, %", 1, |look| Some(100.0 * look.edges)),
            MeasureRow::new(looks, "segments", 0, |look| look.segments.map(|n| n as f64)),
            MeasureRow::new(looks, "depth, median, m", 2, |look| look.depth.map(|[_, m, _]| m)),
            MeasureRow::new(looks, "depth, 90 % less 10 %, m", 2, |look| look.depth.map(|[near, _, far]| far - near)),
        ];
        rows.extend(Color::ALL.iter().enumerate().map(|(place, color)| {
            let measure = format!("{} pixels, %", color.name());
            MeasureRow::new(looks, &measure, 1, |look| Some(100.0 * look.colors[place]))
        }));
        rows.push(MeasureRow::new(looks, "pixels of no colour's name, %", 1, |look| Some(100.0 * look.colors[NONE])));
        Self { sets: sets.map(|(name, looks)| (name.to_owned(), looks.len())), rows }
    }

    /// Formats the table for the terminal.
    #[must_use]
    pub fn table(&self) -> String {
        let [first, other] = [0, 1].map(|set| {
            let (name, frames) = &self.sets[set];
            format!("terminal {name} ({frames})").replace(", ", " ")
        });
        let table = TableBuilder::new("against", &self.rows)
            .column(Text, "terminal by frame", |row| row.measure.clone())
            .column(Text, &*first, |row| row.text(0))
            .column(Text, &*other, |row| row.text(1))
            .column(Text, "terminal median is", |row| row.median_position())
            .build();
        format!(
            "{}medians (quartiles); edges: {MIN_EDGE_GRADIENT} codes of luma per pixel, images of 480 rows at most; colours of pixels are named by the table of the rules\n",
            terminal::table(&[table])
        )
    }
}

/// Table of wrong and ambiguous questions by person and family, with a line on the agreement of each two people; empty
/// without checks.
#[must_use]
pub fn text(checks: &Checks) -> String {
    if checks.is_empty() {
        return String::new();
    }
    let table = TableBuilder::new("checks", shares(checks))
        .column(Text, "terminal checked by", |share| share.person.clone())
        .column(Text, "terminal family", |share| {
            let name = share.family.as_ref().map_or(Family::TOTAL, Family::name);
            name.to_owned()
        })
        .column(Count, "terminal questions", |share| share.wrong.n)
        .column(Text, "terminal wrong % [95 %]", |share| with_interval(share.wrong))
        .column(Text, "terminal ambiguous % [95 %]", |share| with_interval(share.ambiguous))
        .build();
    let mut text = terminal::table(&[table]);
    for pair in agreements(checks) {
        let [first, second] = &pair.people;
        let kappa = match (pair.kappa, pair.interval) {
            (Some(kappa), Some([low, high])) => format!("{kappa:.2} [{low:.2}, {high:.2}]"),
            (Some(kappa), None) => {
                format!("{kappa:.2}, without an interval, because they vary in too few scenes")
            }
            (None, _) => "undefined, because one of them found all questions right, or none".to_owned(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{first} and {second} found the same of {} % of {} questions; Cohen's κ of finding a question right: {kappa}",
            with_interval(pair.same),
            pair.same.n
        );
    }
    text
}

/// Value and interval as JSON, without the sample size.
fn estimate_json(estimate: Estimate) -> Value {
    json!({"value": estimate.value, "low": estimate.low, "high": estimate.high})
}

/// Shares by person and family, and agreements, as JSON.
#[must_use]
fn checks_json(checks: &Checks) -> Value {
    let shares: Vec<Value> = shares(checks)
        .into_iter()
        .map(|share| {
            json!({
                "person": share.person,
                "family": share.family.as_ref().map_or(Family::TOTAL, Family::name),
                "questions": share.wrong.n,
                "wrong": estimate_json(share.wrong),
                "ambiguous": estimate_json(share.ambiguous),
            })
        })
        .collect();
    let agreements: Vec<Value> = agreements(checks)
        .into_iter()
        .map(|pair| {
            json!({
                "people": pair.people,
                "questions": pair.same.n,
                "same": estimate_json(pair.same),
                "kappa": pair.kappa,
                "kappa_interval": pair.interval,
            })
        })
        .collect();
    json!({"shares": shares, "agreements": agreements})
}

/// Draws bar charts with counts and shares: questions by family, frames by room, answers by family, and classes by
/// questions, segments and pixels.
///
/// # Errors
/// If the figure cannot be drawn.
pub fn figure(summary: &QuestionSummary) -> Result<String> {
    let questions = summary.candidates.iter().map(|(family, candidates)| (family.to_string(), candidates.asked));
    let rooms = summary.rooms.iter().map(|(room, counts)| (room.clone(), counts.frames as u64));
    let mut panels =
        vec![Panel::from_counts("Questions by family", questions), Panel::from_counts("Frames by room", rooms)];
    for family in Family::by_rule() {
        if let Some(answers) = summary.answers.get(&family) {
            panels.push(Panel::from_counts(
                &format!("Answers: {family}"),
                answers.iter().map(|(word, count)| (word.clone(), *count as u64)),
            ));
        }
    }
    panels.extend([
        class_panel(summary, "Classes by questions about them", |coverage| coverage.questions),
        class_panel(summary, "Classes by segments", |coverage| coverage.segments),
        class_panel(summary, "Classes by pixels", |coverage| coverage.pixels),
    ]);
    count_figure(panels)
}

/// Panel of a count for each class of objects.
fn class_panel(summary: &QuestionSummary, title: &str, count: fn(&ClassCoverage) -> u64) -> Panel {
    let counts = summary.classes.iter().map(|(class, coverage)| (class.clone(), count(coverage)));
    Panel::from_counts(title, counts)
}

/// Template of the page.
const PAGE: &str = include_str!("questions/review.html");

/// Text in the template that the questions replace.
const PLACEHOLDER: &str = "/*QUESTIONS*/null";

/// Question on the page.
#[derive(Debug, Serialize)]
pub struct ReviewItem<'a> {
    id: &'a str,
    frame: &'a str,
    family: &'a str,
    question: &'a str,
    choices: &'a [String],
    answer: &'a str,
    evidence: &'a Evidence,
    /// Path of the image relative to the page.
    image: String,
    /// Size of the image in pixels: width, height.
    size: [usize; 2],
}

impl<'a> ReviewItem<'a> {
    /// Item for a question about the image at path `image`, whose `size` is width and height in pixels.
    #[must_use]
    pub fn new(generated: &'a GeneratedQuestion, image: String, size: [usize; 2]) -> Self {
        let question = &generated.question;
        Self {
            id: &question.id.0,
            frame: &question.frame.0,
            family: question.family.name(),
            question: &question.text,
            choices: question.choices.texts(),
            answer: generated.answer(),
            evidence: &question.evidence,
            image,
            size,
        }
    }
}

/// Data of the page's script.
#[derive(Serialize)]
struct ReviewPage<'a> {
    /// Digest of the question ids. The browser keeps a person's results under it and the person's name until they are
    /// saved.
    set: Digest,
    items: &'a [ReviewItem<'a>],
}

/// Renders the page as one HTML file.
///
/// The page shows each question with its image and asks for the person's own answer. Only then does it show the
/// generated answer with its evidence, so that the answer does not influence the person. It saves lines of JSON under
/// the person's name.
///
/// # Errors
/// If the questions cannot be serialized.
pub fn page(items: &[ReviewItem<'_>]) -> Result<String> {
    let set = Digest::from_parts(items.iter().map(|item| item.id.as_bytes()));
    let page = PAGE.replacen(PLACEHOLDER, &to_script_json(&ReviewPage { set, items })?, 1);
    Ok(allow_script(&page))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use darkqa_base::types::{Choices, Family, FrameId, Question, QuestionId};

    fn look(light_ev: f64, segments: Option<usize>) -> FrameAppearance {
        FrameAppearance { light_ev, edges: 0.25, colors: [0.0; 12], segments, depth: None }
    }

    #[test]
    fn quartiles_are_nearest_ranks() {
        // Ranks 1, 2 and 3 of four numbers.
        let numbers = vec![-1.0, -2.0, -3.0, -4.0];
        assert_eq!(quartiles(numbers), Some([-4.0, -3.0, -2.0]));
        assert!(quartiles(Vec::new()).is_none());
    }

    #[test]
    fn medians_are_compared_with_quartiles() {
        let dark: Vec<FrameAppearance> = (1..=4).map(|ev| look(-f64::from(ev), Some(9))).collect();
        let bright = vec![look(-0.5, None)];
        for (first, other, expected) in [
            (&dark, &dark, ["within", "within", "–"]),
            (&dark, &bright, ["below", "–", "–"]),
            (&bright, &dark, ["above", "–", "–"]),
        ] {
            let comparison = AppearanceComparison::new([("a", first), ("b", other)]);
            let positions = [0, 2, 3].map(|row: usize| comparison.rows[row].median_position());
            assert_eq!(positions, expected);
        }
    }

    #[test]
    fn question_texts_cannot_end_the_script() {
        let choices = ["</script><b>", "no"].map(str::to_owned).to_vec();
        let question = Question {
            id: QuestionId("a".into()),
            frame: FrameId("<!--".into()),
            family: Family::Presence,
            text: "\u{2028}</SCRIPT>".into(),
            choices: Choices::new(choices, 0).unwrap(),
            group: None,
            evidence: json!({ "segments": [] }).into(),
        };
        let generated = GeneratedQuestion { question, about: String::new(), scene: String::new() };
        let page = page(&[ReviewItem::new(&generated, "a.png".into(), [4, 3])]).unwrap();
        assert!(!page.contains(PLACEHOLDER));
        assert_eq!(page.to_lowercase().matches("</script").count(), 1);
        assert!(!page.contains("<!--"));
    }
}
