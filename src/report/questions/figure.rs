//! Bar charts of a set of questions, as SVG: [`figure`].

use std::collections::BTreeMap;

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::error::{Error, Result};
use crate::questions::summary::QuestionSummary;
use crate::types::Family;

/// Maximum number of bars in a panel.
const MAX_BARS: usize = 24;
/// Height of a bar with the space around it, in pixels.
const BAR_HEIGHT: i32 = 20;
/// Width of the figure in pixels.
const WIDTH: i32 = 1100;

/// A panel of named bars.
struct BarPanel {
    title: String,
    bars: Vec<(String, u64)>,
}

impl BarPanel {
    /// A panel with the largest bars first. If there are more than [`MAX_BARS`], the smallest share one bar.
    fn ranked(title: &str, counts: impl Iterator<Item = (String, u64)>) -> Self {
        let mut bars: Vec<(String, u64)> = counts.filter(|(_, count)| *count > 0).collect();
        bars.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        if bars.len() > MAX_BARS {
            let rest = bars.split_off(MAX_BARS - 1);
            bars.push((
                format!("{} others", rest.len()),
                rest.iter().map(|(_, count)| count).sum(),
            ));
        }
        Self {
            title: title.to_owned(),
            bars,
        }
    }

    /// Number of rows: the bars, or one row that says "none".
    fn rows(&self) -> i32 {
        i32::try_from(self.bars.len()).unwrap_or(i32::MAX).max(1)
    }

    fn height(&self) -> i32 {
        60 + BAR_HEIGHT * self.rows()
    }
}

/// Bars with counts and shares: questions by family, frames by room, answers by family, and classes by questions, segments
/// and pixels.
///
/// # Errors
/// If the figure cannot be drawn.
pub(crate) fn figure(summary: &QuestionSummary) -> Result<String> {
    let panels = panels(summary);
    // Two columns, each panel in the shorter one.
    let mut columns: [(i32, Vec<(i32, &BarPanel)>); 2] = [(0, Vec::new()), (0, Vec::new())];
    for panel in &panels {
        let column = usize::from(columns[1].0 < columns[0].0);
        let (height, list) = &mut columns[column];
        list.push((*height, panel));
        *height += panel.height();
    }
    let height = columns
        .iter()
        .map(|(height, _)| *height)
        .max()
        .unwrap_or(0)
        .max(BAR_HEIGHT);
    let mut svg = String::new();
    {
        let root =
            SVGBackend::with_string(&mut svg, (WIDTH as u32, height as u32)).into_drawing_area();
        draw(&root, &columns).map_err(|e| Error::data("figure", e))?;
    }
    Ok(svg)
}

fn panels(summary: &QuestionSummary) -> Vec<BarPanel> {
    let classes = |title: &str, count: fn(&crate::questions::summary::ClassCoverage) -> u64| {
        let counts = summary
            .classes
            .iter()
            .map(|(class, coverage)| (class.clone(), count(coverage)));
        BarPanel::ranked(title, counts)
    };
    let words = |counts: &BTreeMap<String, usize>| {
        let counts: Vec<(String, u64)> = counts
            .iter()
            .map(|(word, count)| (word.clone(), *count as u64))
            .collect();
        counts.into_iter()
    };
    let families = summary.candidates.iter();
    let mut panels = vec![
        BarPanel::ranked(
            "Questions by family",
            families.map(|(family, candidates)| (family.to_string(), candidates.asked)),
        ),
        BarPanel::ranked(
            "Frames by room",
            summary
                .rooms
                .iter()
                .map(|(room, counts)| (room.clone(), counts.frames as u64)),
        ),
    ];
    for family in Family::PAPER {
        if let Some(answers) = summary.answers.get(&family) {
            panels.push(BarPanel::ranked(
                &format!("Answers: {family}"),
                words(answers),
            ));
        }
    }
    panels.push(classes("Classes by questions about them", |coverage| {
        coverage.questions
    }));
    panels.push(classes("Classes by segments", |coverage| coverage.segments));
    panels.push(classes("Classes by pixels", |coverage| coverage.pixels));
    panels
}

type Area<'a, 'b> = DrawingArea<SVGBackend<'a>, Shift>;

fn draw(root: &Area<'_, '_>, columns: &[(i32, Vec<(i32, &BarPanel)>); 2]) -> Result<(), String> {
    root.fill(&WHITE).map_err(|e| e.to_string())?;
    let half = WIDTH / 2;
    for (column, (_, panels)) in (0..).zip(columns) {
        for (top, panel) in panels {
            bars(root, (column * half, *top), panel).map_err(|e| e.to_string())?;
        }
    }
    root.present().map_err(|e| e.to_string())
}

fn bars<'a>(
    root: &Area<'a, '_>,
    (left, top): (i32, i32),
    panel: &BarPanel,
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    const NAMES: i32 = 190;
    const LONGEST: f64 = 220.0;
    let total: u64 = panel.bars.iter().map(|(_, count)| count).sum();
    let highest = panel
        .bars
        .iter()
        .map(|(_, count)| *count)
        .max()
        .unwrap_or(1)
        .max(1);
    let title = ("sans-serif", 17).into_font();
    root.draw(&Text::new(
        panel.title.clone(),
        (left + 12, top + 14),
        title,
    ))?;
    let small = ("sans-serif", 13).into_font();
    for (i, (name, count)) in (0..).zip(&panel.bars) {
        let y = top + 40 + i * BAR_HEIGHT;
        let length = (*count as f64 / highest as f64 * LONGEST).round() as i32;
        let bar = [(left + NAMES, y), (left + NAMES + length.max(1), y + 14)];
        root.draw(&Rectangle::new(bar, RGBColor(70, 110, 160).filled()))?;
        root.draw(&Text::new(name.clone(), (left + 12, y + 1), small.clone()))?;
        let share = 100.0 * *count as f64 / total.max(1) as f64;
        let label = format!("{count} ({share:.1} %)");
        root.draw(&Text::new(
            label,
            (left + NAMES + length + 6, y + 1),
            small.clone(),
        ))?;
    }
    if panel.bars.is_empty() {
        root.draw(&Text::new("none", (left + 12, top + 41), small))?;
    }
    Ok(())
}
