//! Bar charts of a set of questions, as SVG: [`figure`].

use crate::drawing::chart::counts::CountPanel;
use crate::drawing::paper::count_figure;
use crate::error::Result;
use crate::types::Family;
use darkqa_questions::summary::{ClassCoverage, QuestionSummary};

/// Bars with counts and shares: questions by family, frames by room, answers by family, and classes by questions, segments
/// and pixels.
///
/// # Errors
/// If the figure cannot be written.
pub(crate) fn figure(summary: &QuestionSummary) -> Result<String> {
    let classes = |title: &str, count: fn(&ClassCoverage) -> u64| {
        let counts = summary
            .classes
            .iter()
            .map(|(class, coverage)| (class.clone(), count(coverage)));
        CountPanel::from_counts(title, counts)
    };
    let families = summary.candidates.iter();
    let rooms = summary.rooms.iter();
    let mut panels = vec![
        CountPanel::from_counts(
            "Questions by family",
            families.map(|(family, candidates)| (family.to_string(), candidates.asked)),
        ),
        CountPanel::from_counts(
            "Frames by room",
            rooms.map(|(room, counts)| (room.clone(), counts.frames as u64)),
        ),
    ];
    for family in Family::PAPER {
        if let Some(answers) = summary.answers.get(&family) {
            panels.push(CountPanel::from_counts(
                &format!("Answers: {family}"),
                answers
                    .iter()
                    .map(|(word, count)| (word.clone(), *count as u64)),
            ));
        }
    }
    panels.extend([
        classes("Classes by questions about them", |coverage| {
            coverage.questions
        }),
        classes("Classes by segments", |coverage| coverage.segments),
        classes("Classes by pixels", |coverage| coverage.pixels),
    ]);
    count_figure(&panels)
}
