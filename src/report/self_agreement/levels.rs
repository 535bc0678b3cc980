//! Tables of agreement by level, with a row for each measure: [`levels`].

use std::collections::BTreeSet;

use super::measure::AGREEMENT;
use crate::report::text::ladder::{Ladder, SeriesByLevel};
use crate::report::text::table::ColumnKind::{Accuracy, Text};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::{percent, with_interval};
use crate::types::{Axis, AxisLevel};
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use darkqa_score::comparisons::self_agreement::evidence::{MIN_DISTANCE, NoEvidence};
use darkqa_score::estimate::Estimate;

/// Measure of a series; each has a row of the table.
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

    /// Table cell of the measure. At L0, entropy and unusable replies are of the first replies, agreement is of the
    /// repeated ones.
    fn cell(self, found: &SelfAgreement<'_>, cell: &AgreementCell) -> TableCell {
        let is_light = cell.role() == CellRole::Ceiling;
        let light = found.light_of(&cell.subject.model).filter(|_| is_light);
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
                Some(light) => share_of_replies(light.refused, light.replies()),
                None => share_of_replies(cell.refused, cell.replies()),
            },
            Self::CannotTell => match light {
                Some(light) => share_of_replies(light.cannot_tell, light.replies()),
                None => share(cell.cannot_tell),
            },
        }
    }

    /// True if the measure is meaningful for a series: informative questions only if some questions are not
    /// informative, refusals only if they occur, and "cannot tell" only if the questions have this choice.
    fn applies_to(self, found: &SelfAgreement<'_>, cells: &SeriesByLevel<'_, AgreementCell>) -> bool {
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

/// Number with two decimals.
fn decimals(value: Option<f64>) -> TableCell {
    let Some(value) = value else {
        return TableCell::Missing;
    };
    let text = format!("{value:.2}");
    TableCell::Text(if text == "-0.00" { "0.00".to_owned() } else { text.replace('-', "−") })
}

/// Share of some replies in percent; missing without replies.
fn share_of_replies(count: usize, replies: usize) -> TableCell {
    (replies > 0).then(|| TableCell::Text(percent(count as f64 / replies as f64))).into()
}

fn share(share: Option<Estimate>) -> TableCell {
    share.map_or(TableCell::Missing, |share| TableCell::Text(percent(share.value)))
}

/// Row of the table.
struct MeasureRow {
    /// Model and condition.
    series: String,
    measure: Measure,
    /// One cell for each level.
    cells: Vec<TableCell>,
}

/// One table for each axis, with a block of rows for each model in each variant.
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
    // L0 has a column even if it was not asked a second time.
    let mut levels: BTreeSet<AxisLevel> = ladder.levels.clone();
    levels.insert(AxisLevel::L0);
    let mut rows = Vec::new();
    for (series, cells) in &ladder.series {
        let model = found.grid.listing.label(series.model);
        for measure in Measure::ALL {
            if !measure.applies_to(found, cells) {
                continue;
            }
            rows.push(MeasureRow {
                series: format!("{model}, {}", ladder.light(series)),
                measure,
                cells: levels
                    .iter()
                    .map(|level| match cells.get(level) {
                        Some(cell) => measure.cell(found, cell),
                        None => TableCell::Blank,
                    })
                    .collect(),
            });
        }
    }
    let by = if axis == Axis::LIGHT { "level".to_owned() } else { format!("{} of {}", axis.title, axis.cause) };
    let caption = format!("Agreement with its own answer at L0 by {by}, and the measures to read with it");
    let mut table = TableBuilder::new(AGREEMENT, rows)
        .page("agreement", &caption)
        .group(|row| Some(row.series.clone()))
        .column(Text, "terminal | page measure | latex Measure", |row| row.measure.name());
    let has_enhanced_clean =
        ladder.series.iter().any(|(series, cells)| series.is_enhanced() && cells.contains_key(&AxisLevel::L0));
    let (again, first) = if has_enhanced_clean {
        ("", "L0: the same images asked again, the ceiling; in a row with an enhancer, these images enhanced")
    } else {
        (" again", "L0 again: the same images asked again, the ceiling")
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

/// Notes on each model: its answers at L0, its floor, and the reason if the evidence kept is unknown.
pub(super) fn notes(found: &SelfAgreement<'_>) -> Vec<String> {
    let mut notes = Vec::new();
    for model in found.models() {
        if let Some(light) = found.light_of(model) {
            let read = light.read.map_or("no reply".to_owned(), |read| format!("{} %", percent(read.value)));
            let (informative, all) = found.informative(model);
            notes.push(format!(
                "{model} at L0: an answer to {read} of {} questions; {informative} of {all} questions of the bank are informative",
                light.asked
            ));
        }
        let mut cells = found.whole().filter(|cell| cell.subject.model == model);
        let floor = cells.clone().find(|cell| cell.role() == CellRole::Floor);
        if let Some((cell, share)) = floor.and_then(|cell| Some((cell, cell.agreement?))) {
            let kappa =
                cell.kappa.map_or("not defined".to_owned(), |kappa| format!("{:.2}", kappa.value).replace('-', "−"));
            let entropy = cell.entropies[1].map_or("–".to_owned(), |h| format!("{h:.2}"));
            notes.push(format!(
                "{model} without images, the floor: {}, κ {kappa}, entropy {entropy}",
                with_interval(share)
            ));
        }
        let reason = cells.find_map(|cell| cell.evidence?.err());
        notes.extend(
            reason.map(|reason| format!("{model}: evidence kept is not given: {}", no_evidence_reason(reason))),
        );
    }
    notes
}

/// Text for the reason why the evidence kept is unknown.
pub(super) fn no_evidence_reason(reason: NoEvidence) -> String {
    match reason {
        NoEvidence::NotAgain => "the images at L0 were not asked about again (--repeats)".to_owned(),
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
