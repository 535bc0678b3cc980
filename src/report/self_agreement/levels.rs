//! The table of agreement by level, with a row for each measure: [`levels`].

use std::collections::BTreeSet;

use super::measure::AGREEMENT;
use crate::text::ladder::{Ladder, Series, SeriesByLevel};
use crate::text::table::ColumnKind::{Accuracy, Text};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::{percent, with_interval};
use crate::types::{Axis, AxisLevel};
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use darkqa_score::comparisons::self_agreement::evidence::{MIN_DISTANCE, NoEvidence};
use darkqa_score::estimate::Estimate;

/// A measure of a series: a row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Measure {
    Agreement,
    Informative,
    Kappa,
    Evidence,
    Entropy,
    Unread,
    Refused,
    CannotTell,
}

impl Measure {
    const ALL: [Self; 8] = [
        Self::Agreement,
        Self::Informative,
        Self::Kappa,
        Self::Evidence,
        Self::Entropy,
        Self::Unread,
        Self::Refused,
        Self::CannotTell,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Agreement => "agreement",
            Self::Informative => "informative",
            Self::Kappa => "κ",
            Self::Evidence => "evidence kept",
            Self::Entropy => "entropy",
            Self::Unread => "not read",
            Self::Refused => "refused",
            Self::CannotTell => "cannot tell",
        }
    }

    /// The cell of the measure; at L0 what concerns L0 itself is that of the first replies there.
    fn cell(self, found: &SelfAgreement<'_>, cell: &AgreementCell) -> TableCell {
        let is_light = cell.role() == CellRole::Ceiling;
        let light = found.light_of(&cell.subject.model).filter(|_| is_light);
        let of_replies = |count: usize, all: usize| -> TableCell {
            let share = (all > 0).then(|| percent(count as f64 / all as f64));
            share.map(TableCell::Text).into()
        };
        match self {
            Self::Agreement => cell.agreement.into(),
            Self::Informative => share(cell.informative),
            Self::Kappa => decimals(cell.kappa.map(|kappa| kappa.value)),
            Self::Evidence => match cell.evidence {
                Some(Ok(kept)) => kept.into(),
                Some(Err(_)) => TableCell::Missing,
                None => TableCell::Blank,
            },
            Self::Entropy if is_light => decimals(cell.entropies[0]),
            Self::Entropy => decimals(cell.entropies[1]),
            Self::Unread => match light.and_then(|light| light.read) {
                Some(read) => TableCell::Text(percent(1.0 - read.value)),
                None => share(cell.unread),
            },
            Self::Refused => match light {
                Some(light) => of_replies(light.refused, light.replies()),
                None => of_replies(cell.refused, cell.replies()),
            },
            Self::CannotTell => match light {
                Some(light) => of_replies(light.cannot_tell, light.replies()),
                None => share(cell.cannot_tell),
            },
        }
    }

    /// Whether the row says something of a series: the informative questions only if there are others, refusals only if there are any,
    /// and a way out only if the questions have one.
    fn says_something(
        self,
        found: &SelfAgreement<'_>,
        cells: &SeriesByLevel<'_, AgreementCell>,
    ) -> bool {
        let mut cells = cells.values();
        match self {
            Self::Refused => cells.any(|cell| {
                let light = found.light_of(&cell.subject.model);
                cell.refused > 0 || light.is_some_and(|light| light.refused > 0)
            }),
            Self::CannotTell => cells.any(|cell| cell.cannot_tell.is_some()),
            Self::Informative => cells.next().is_some_and(|cell| {
                let (informative, all) = found.informative(&cell.subject.model);
                informative < all && informative > 0
            }),
            _ => true,
        }
    }
}

/// A number with two decimals.
fn decimals(value: Option<f64>) -> TableCell {
    let text = |value: f64| {
        let text = format!("{value:.2}");
        TableCell::Text(if text == "-0.00" {
            "0.00".to_owned()
        } else {
            text.replace('-', "−")
        })
    };
    value.map_or(TableCell::Missing, text)
}

fn share(share: Option<Estimate>) -> TableCell {
    share.map_or(TableCell::Missing, |share| {
        TableCell::Text(percent(share.value))
    })
}

/// A row: the model with the light, the measure, and a cell for each level.
struct MeasureRow {
    series: String,
    measure: Measure,
    cells: Vec<TableCell>,
}

/// The tables of each axis: agreement with what stands beside it, a block of rows for each model in each light.
pub(super) fn levels(found: &SelfAgreement<'_>) -> Vec<Table> {
    let mut ladder = Ladder::new(found.whole().map(|cell| (&cell.subject, cell))).with_clean();
    ladder.set = found.set.light;
    let ladders = ladder.by_axis();
    let last = ladders.len().saturating_sub(1);
    ladders
        .into_iter()
        .enumerate()
        .map(|(index, (axis, ladder))| {
            let mut table = axis_table(found, axis, &ladder);
            if index == last {
                table.notes = notes(found);
            }
            table
        })
        .collect()
}

fn axis_table(found: &SelfAgreement<'_>, axis: Axis, ladder: &Ladder<'_, AgreementCell>) -> Table {
    // L0 stands at the front even if nothing was asked again there.
    let mut levels: BTreeSet<AxisLevel> = ladder.levels.clone();
    levels.insert(AxisLevel::L0);
    let mut rows = Vec::new();
    for (series, cells) in &ladder.series {
        let measures = Measure::ALL
            .into_iter()
            .filter(|measure| measure.says_something(found, cells));
        let model = found.grid.listing.label(series.model);
        for measure in measures {
            let cell = |level: &AxisLevel| match cells.get(level) {
                Some(cell) => measure.cell(found, cell),
                None => TableCell::Blank,
            };
            rows.push(MeasureRow {
                series: format!("{model}, {}", ladder.light(series)),
                measure,
                cells: levels.iter().map(cell).collect(),
            });
        }
    }
    let by = if axis == Axis::LIGHT {
        "level".to_owned()
    } else {
        format!("{} of {}", axis.title, axis.cause)
    };
    let caption =
        format!("Agreement with its own answer at L0 by {by}, and the measures to read with it");
    let mut table = TableBuilder::new(AGREEMENT, rows)
        .page("agreement", &caption)
        .group(|row| Some(row.series.clone()))
        .column(Text, "terminal | page measure | latex Measure", |row| {
            row.measure.name()
        });
    let is_enhanced = |(series, cells): (&Series<'_>, &SeriesByLevel<'_, AgreementCell>)| {
        series.is_enhanced() && cells.contains_key(&AxisLevel::L0)
    };
    let (again, first) = if ladder.series.iter().any(is_enhanced) {
        (
            "",
            "L0: the same images asked again, the ceiling; in a row with an enhancer, these images enhanced",
        )
    } else {
        (
            " again",
            "L0 again: the same images asked again, the ceiling",
        )
    };
    for (index, level) in levels.iter().enumerate() {
        let again = if *level == AxisLevel::L0 { again } else { "" };
        let names = format!("terminal {level}{again} | page {level}{again} | latex {level}{again}");
        table = table.column(Accuracy, &*names, |row| row.cells[index].clone());
    }
    let mut table = table.build();
    table.heading = Some(format!(
        "Agreement with its own answer at L0 by {by}, in % (κ and entropy from 0 to 1); {first}; 95 %: how far the widest interval of the row reaches down and up"
    ));
    table.latex = Some(format!(
        "Agreement of each model with its own answer at L0 by {by} (strict parsing), not with the truth; intervals by {}.",
        found.unit
    ));
    table
}

/// Lines about each model: its answers at L0, the floor, and why no evidence is given.
pub(super) fn notes(found: &SelfAgreement<'_>) -> Vec<String> {
    let mut notes = Vec::new();
    for model in found.models() {
        if let Some(light) = found.light_of(model) {
            let read = light.read.map_or("no reply".to_owned(), |read| {
                format!("{} %", percent(read.value))
            });
            let (informative, all) = found.informative(model);
            notes.push(format!(
                "{model} at L0: an answer to {read} of {} questions; {informative} of {all} questions of the bank are informative",
                light.asked
            ));
        }
        let mut cells = found.whole().filter(|cell| cell.subject.model == model);
        let floor = cells.clone().find(|cell| cell.role() == CellRole::Floor);
        if let Some((cell, share)) = floor.and_then(|cell| Some((cell, cell.agreement?))) {
            let kappa = cell.kappa.map_or("not defined".to_owned(), |kappa| {
                format!("{:.2}", kappa.value).replace('-', "−")
            });
            let entropy = cell.entropies[1].map_or("–".to_owned(), |h| format!("{h:.2}"));
            notes.push(format!(
                "{model} without images, the floor: {}, κ {kappa}, entropy {entropy}",
                with_interval(share)
            ));
        }
        let reason = cells.find_map(|cell| cell.evidence?.err());
        notes.extend(
            reason.map(|reason| format!("{model}: evidence kept is not given: {}", why(reason))),
        );
    }
    notes
}

/// Why no share of evidence is given.
pub(super) fn why(reason: NoEvidence) -> String {
    match reason {
        NoEvidence::NotAgain => {
            "the images at L0 were not asked about again (--repeats)".to_owned()
        }
        NoEvidence::NotBlind => "it was not asked without images".to_owned(),
        NoEvidence::Close(distance) => format!(
            "the ceiling is {} points above the floor, and {} are needed",
            percent(distance).replace('-', "−"),
            percent(MIN_DISTANCE)
        ),
        NoEvidence::Unsure(low) => format!(
            "the ceiling may be no higher than the floor: the 95 % interval of their distance begins at {} points",
            percent(low).replace('-', "−")
        ),
    }
}
