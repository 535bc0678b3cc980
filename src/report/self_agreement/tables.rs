//! Tables of a report on questions without true answers: [`tables`].
//!
//! Tables of agreement by level, with a row for each measure: [`levels`].
//!
//! Texts on the measure of a report without true answers: [`AGREEMENT`], [`HOW_TO_READ`].

use std::collections::BTreeSet;

use crate::tables::{
    agreement_comparisons, commonest_answers, counted_answers, health, in_lux, missing_threshold_reason,
};
use crate::text::ladder::{Ladder, SeriesByLevel};
use crate::text::table::ColumnKind::{self, Accuracy, Count, Number, Percent, Ratio, Share, Text};
use crate::text::table::{SUMMARY, Table, TableBuilder, TableCell, TableFormat};
use crate::text::words::{light, percent, with_interval};
use darkqa_base::types::text::counted;
use darkqa_base::types::{Axis, AxisLevel};
use darkqa_score::answers::confusion::{Confusion, Hallucination};
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use darkqa_score::comparisons::self_agreement::evidence::{MIN_DISTANCE, NoEvidence, NoHalf};
use darkqa_score::comparisons::self_agreement::light::LightReplies;
use darkqa_score::comparisons::self_agreement::models_in_light::ModelsInLight;
use darkqa_score::estimate::Estimate;

/// Name of the table of all agreements.
pub(super) const OWN_ANSWERS: &str = "own_answers";

/// All tables; the first is the summary.
pub(super) fn tables(found: &SelfAgreement<'_>) -> Vec<Table> {
    let mut tables = vec![summary(found)];
    tables.extend(levels(found));
    tables.push(own_answers(found));
    tables.push(models_in_light(&found.between));
    tables.push(thresholds(found));
    tables.push(questions(found));
    tables.extend(agreement_comparisons(&found.comparisons, found.unit, AGREEMENT));
    tables.extend([
        presence_changes(&found.hallucinations),
        most_frequent_answers(&found.confusions),
        confusion_with_l0(&found.confusions),
        health(&found.health),
    ]);
    tables
}

/// Summary with the columns that all reports have, and the name of the measure in the last column. The number of right
/// replies is empty, because the true answers are unknown.
pub(super) fn summary(found: &SelfAgreement<'_>) -> Table {
    let builder = TableBuilder::new(SUMMARY, &found.cells)
        .subject(|cell| &cell.subject, |variant| variant.word().into_owned())
        .family(|cell| cell.family.as_ref())
        .column(Text, "csv mode", |cell| cell.mode.name())
        .column(Count, "csv n", |cell| cell.replies())
        .column(Count, "csv right", |_| None::<usize>)
        .column(Count, "csv unparsed", |cell| unread(cell))
        .column(Count, "csv failed", |cell| cell.failed)
        .column(Share, "csv value low high", |cell| cell.agreement)
        .column(Text, "csv reading", |cell| TableCell::profile(&cell.subject))
        .model_facts(&found.grid.listing, |cell| &cell.subject);
    let has_groups = found.cells.iter().any(|cell| cell.subject.run_group().is_some());
    let builder = if has_groups { builder.column(Text, "csv light", |cell| cell.subject.run_group()) } else { builder };
    builder.column(Text, "csv measure", |_| AGREEMENT).build()
}

/// Number of replies that could not be parsed.
fn unread(cell: &AgreementCell) -> usize {
    cell.unread.map_or(0, |share| (share.value * share.n as f64).round() as usize)
}

/// Role of a cell as files name it.
fn role(cell: &AgreementCell) -> &'static str {
    match cell.role() {
        CellRole::Floor => "floor",
        CellRole::Ceiling => "ceiling",
        CellRole::Other => "",
    }
}

/// Answers at L0 of the model of a cell, by the same way of parsing; `None` for one family, because they are counted
/// over all.
fn answers_at_l0<'a>(found: &'a SelfAgreement<'_>, cell: &AgreementCell) -> Option<&'a LightReplies> {
    found
        .light
        .iter()
        .filter(|_| cell.family.is_none())
        .find(|light| light.model == cell.subject.model && light.mode == cell.mode)
}

/// Table of all agreements with the measures that are needed to interpret them.
fn own_answers(found: &SelfAgreement<'_>) -> Table {
    TableBuilder::new(OWN_ANSWERS, &found.cells)
        .subject(|cell| &cell.subject, ToString::to_string)
        .family(|cell| cell.family.as_ref())
        .column(Text, "csv mode", |cell| cell.mode.name())
        .column(Text, "csv role", |cell| role(cell))
        .column(Share, "csv agreement low high n", |cell| cell.agreement)
        .column(Share, "csv informative informative_low informative_high informative_n", |cell| cell.informative)
        .column(Ratio, "csv kappa kappa_low kappa_high", |cell| cell.kappa)
        .column(Number, "csv entropy_light", |cell| cell.entropies[0])
        .column(Number, "csv entropy", |cell| cell.entropies[1])
        .column(Share, "csv evidence evidence_low evidence_high", |cell| cell.evidence.and_then(Result::ok))
        .column(Text, "csv no_evidence", |cell| cell.evidence.and_then(Result::err).map(no_evidence_reason))
        .column(Share, "csv unread unread_low unread_high", |cell| cell.unread)
        .column(Count, "csv refused", |cell| cell.refused)
        .column(Count, "csv failed", |cell| cell.failed)
        .column(Share, "csv cannot_tell cannot_tell_low cannot_tell_high", |cell| cell.cannot_tell)
        .column(Count, "csv asked_light", |cell| answers_at_l0(found, cell).map(|light| light.asked))
        .column(Number, "csv read_light", |cell| {
            answers_at_l0(found, cell).and_then(|light| light.read).map(|read| read.value)
        })
        .column(Count, "csv refused_light", |cell| answers_at_l0(found, cell).map(|light| light.refused))
        .build()
}

/// Table of the agreement of each two models at L0.
fn models_in_light(pairs: &[ModelsInLight]) -> Table {
    let mut table = TableBuilder::new("models_in_light", pairs)
        .page("models", "Two models at L0: each against the other, not against the truth")
        .column(Text, "csv model | terminal model | page model", |pair| pair.first.clone())
        .column(Text, "csv against | terminal and | page and", |pair| pair.second.clone())
        .column(
            Share,
            "csv same_answer same_low same_high n | terminal same answer at L0 in % | page same answer in % [95 %]",
            |pair| pair.same,
        )
        .column(Ratio, "csv kappa kappa_low kappa_high | terminal κ | page κ [95 %]", |pair| pair.kappa)
        .column(Count, "page n", |pair| pair.same.n)
        .build();
    if !pairs.is_empty() {
        table.heading = Some("Two models at L0: each has its own answers as reference, so that their agreements can be compared only as far as these".to_owned());
    }
    table
}

/// Text for the reason why the exposure drop at which half of the evidence is lost is unknown.
fn no_half_reason(reason: &NoHalf) -> String {
    match reason {
        NoHalf::NoEvidence(reason) => no_evidence_reason(*reason),
        NoHalf::Curve(reason) => missing_threshold_reason(reason).replace("chance", "the floor"),
    }
}

/// Table of the exposure drops at which models keep half of their evidence.
fn thresholds(found: &SelfAgreement<'_>) -> Table {
    let columns = "csv threshold low high | terminal half kept down to, interval | page half kept down to [95 %]";
    let builder = TableBuilder::new("evidence_thresholds", &found.curves)
        .page("thresholds", "Where half of the evidence is lost")
        .column(Text, "csv model | terminal model | page model", |curve| curve.model.clone())
        .column(Text, "csv variant", |curve| curve.variant.to_string())
        .column(Text, "csv enhancer", |curve| curve.enhancer.as_ref().map(ToString::to_string))
        .column(Text, "terminal light | page light", |curve| light(&curve.variant, curve.enhancer.as_ref()))
        .column(Number, "csv darkest", |curve| curve.darkest.value())
        .column(ColumnKind::Threshold, columns, |curve| match &curve.threshold {
            Ok(threshold) => TableCell::Threshold(*threshold, curve.darkest.value()),
            Err(reason) => TableCell::Unknown(no_half_reason(reason)),
        });
    let lux = found.set.lux.filter(|_| found.curves.iter().all(|curve| curve.darkest.axis() == Some(Axis::LIGHT)));
    let mut table =
        in_lux(builder, lux, |curve| Some((curve.threshold.as_ref().ok().copied()?, curve.darkest.value())))
            .column(Text, "csv unit | terminal unit | page unit", |curve| curve.darkest.axis().map(|axis| axis.unit))
            .column(Text, "csv reason", |curve| curve.threshold.as_ref().err().map(no_half_reason))
            .build();
    if !found.curves.is_empty() {
        table.heading = Some(format!("Where half of the evidence is lost, with 95 % intervals by {}", found.unit));
    }
    table
}

/// Table of the questions, with the answers at L0.
fn questions(found: &SelfAgreement<'_>) -> Table {
    let mut table = TableBuilder::new("own_questions", &found.questions)
        .page("questions", "Answers at L0, by question of the bank")
        .column(Text, "csv model | terminal model | page model", |question| question.model.clone())
        .column(Text, "csv question | page id", |question| question.bank_id.clone())
        .column(Text, "csv family", |question| question.family.name().to_owned())
        .column(Text, "csv text | terminal question | page question", |question| question.text.clone())
        .column(Count, "csv images | terminal images | page images", |question| question.images)
        .column(Text, "csv top_answer | terminal commonest | page commonest answer", |question| question.top.clone())
        .column(Percent, "csv top_share | terminal in % | page in %", |question| question.top_share)
        .column(Number, "csv entropy | page entropy", |question| question.entropy)
        .column(Text, "csv informative", |question| question.is_informative().to_string())
        .column(Text, "terminal | page", |question| if question.is_informative() { "" } else { "not informative" })
        .build();
    table.is_folded = true;
    let count = found.questions.iter().filter(|question| !question.is_informative()).count();
    if count > 0 {
        table.heading = Some(format!(
            "{} without information, because one answer is given about 95 % of the images or more",
            counted(count, "question")
        ));
        for (row, question) in table.rows.iter_mut().zip(&found.questions) {
            if question.is_informative() {
                row.hidden_in.push(TableFormat::Terminal);
            }
        }
    }
    table
}

/// Table of the rates of “yes” to questions answered “no” at L0, and the reverse.
fn presence_changes(rates: &[Hallucination]) -> Table {
    TableBuilder::new("presence_changes", rates)
        .page("answers", "Questions about presence: yes where L0 says no, and the other way round")
        .subject(|rates| &rates.subject, ToString::to_string)
        .column(Share, "csv yes_for_no yes_low yes_high yes_n | page yes where L0 says no, in % [95 %]", |rates| {
            rates.false_positive
        })
        .column(Share, "csv no_for_yes no_low no_high no_n | page no where L0 says yes, in % [95 %]", |rates| {
            rates.false_negative
        })
        .build()
}

/// Table of the answer given most often, with its share at L0.
fn most_frequent_answers(confusions: &[Confusion]) -> Table {
    let caption = "The answer given most often, and how often it is the answer at L0";
    let mut table = commonest_answers("commonest_answers", caption, confusions)
        .column(Percent, "csv light_share | page at L0 in %", |(_, c)| c.truth)
        .column(Number, "csv entropy_bits | page entropy in bits", |(_, c)| c.entropy)
        .column(Number, "csv light_entropy_bits | page at L0", |(_, c)| c.true_entropy)
        .column(Count, "csv n | page n", |(_, c)| c.share.n)
        .build();
    table.is_folded = true;
    table
}

/// Confusion matrix of the answers at L0 and in each other condition.
fn confusion_with_l0(confusions: &[Confusion]) -> Table {
    counted_answers("answers_against_light", "csv at_l0", confusions)
}

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
struct AgreementRow {
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
            rows.push(AgreementRow {
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
fn no_evidence_reason(reason: NoEvidence) -> String {
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

/// Name of the measure in files.
pub(super) const AGREEMENT: &str = "agreement";

/// Remark below all sentences, on how to interpret agreement.
pub(super) const HOW_TO_READ: &str = "Agreement is with the model's own answer at L0, whether that is true or not; whatever the truth is, the share of right answers falls by at most one minus the agreement. It says little alone: read it between the floor (no image) and the ceiling (the same image asked again), beside κ and the entropy of the answers. Signs and p are corrected over all tests behind these sentences; an interval is of one test, 95 %.";
