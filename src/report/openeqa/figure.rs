//! Scores over darkness: [`figures`].

use super::OpenReport;
use super::rows::Rows;
use crate::error::Result;
use crate::report::chart::{Chart, Line, Look, Panel, Shape};
use crate::report::figures::Figure;
use crate::score::open::Group;

/// The scores by level, all questions together, and by category where there are several.
pub(super) fn figures(report: &OpenReport<'_>) -> Result<Vec<Figure>> {
    let rows = Rows::new(report.summary);
    if rows.levels.len() < 2 {
        return Ok(Vec::new());
    }
    let groups = report.summary.groups();
    let categories = groups
        .iter()
        .filter(|group| matches!(group, Group::Category(_)));
    let categories: Vec<Panel> = categories
        .map(|group| panel(report, &rows, group))
        .collect();
    let note = format!(
        "bands are 95 % intervals by {} ({} clusters)",
        report.summary.unit, report.summary.clusters
    );
    let charts = [
        (
            "scores",
            "Score by level. Broken lines: without images.",
            vec![panel(report, &rows, &Group::All)],
            1,
        ),
        ("categories", "Score by category.", categories, 3),
    ];
    let mut figures = Vec::new();
    for (name, caption, panels, columns) in charts {
        if panels.is_empty() {
            continue;
        }
        let chart = Chart {
            measure: "score in %",
            panels,
            columns,
            note: note.clone(),
        };
        figures.push(Figure {
            name,
            caption: caption.to_owned(),
            svg: chart.svg()?,
        });
    }
    Ok(figures)
}

fn panel(report: &OpenReport<'_>, rows: &Rows<'_>, group: &Group) -> Panel {
    let lines = rows.lines.keys().enumerate().map(|(place, line)| {
        let points = rows
            .levels
            .iter()
            .filter_map(|level| Some((*level, rows.cell(line, *level, group)?.score?)));
        Line {
            name: format!("{}, {}", line.model, line.light()),
            look: Look(place),
            shape: Shape::Curve(points.collect()),
        }
    });
    let blind = rows
        .blind
        .iter()
        .enumerate()
        .filter_map(|(place, subject)| {
            let score = report.summary.cell(subject, group)?.score?;
            Some(Line {
                name: format!("{} without images", subject.model),
                look: Look(rows.lines.len() + place),
                shape: Shape::Flat(score.value),
            })
        });
    let n = report.questions.len();
    let title = match group {
        Group::All => format!("all, n {n}"),
        part => {
            let own = report.questions.iter();
            let own = own
                .filter(|question| question.category == part.name())
                .count();
            format!("{}, n {own}", part.name())
        }
    };
    Panel {
        title,
        lines: lines.chain(blind).collect(),
    }
}
