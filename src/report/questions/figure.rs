//! Bar charts of a set of questions, as SVG: [`figure`].

use crate::error::Result;
use crate::report::charts::chart::counts::CountPanel;
use crate::report::charts::paper::count_figure;
use crate::types::Family;
use darkqa_questions::summary::{ClassCoverage, QuestionSummary};

/// Draws bar charts with counts and shares: questions by family, frames by room, answers by family, and classes by
/// questions, segments and pixels.
///
/// # Errors
/// If the figure cannot be drawn.
pub(crate) fn figure(summary: &QuestionSummary) -> Result<String> {
    let questions = summary.candidates.iter().map(|(family, candidates)| (family.to_string(), candidates.asked));
    let rooms = summary.rooms.iter().map(|(room, counts)| (room.clone(), counts.frames as u64));
    let mut panels = vec![
        CountPanel::from_counts("Questions by family", questions),
        CountPanel::from_counts("Frames by room", rooms),
    ];
    for family in Family::PAPER {
        if let Some(answers) = summary.answers.get(&family) {
            panels.push(CountPanel::from_counts(
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
    count_figure(&panels)
}

/// Panel of a count for each class of objects.
fn class_panel(summary: &QuestionSummary, title: &str, count: fn(&ClassCoverage) -> u64) -> CountPanel {
    let counts = summary.classes.iter().map(|(class, coverage)| (class.clone(), count(coverage)));
    CountPanel::from_counts(title, counts)
}
