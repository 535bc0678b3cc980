//! Tables of a report on questions without true answers: [`tables`].

use super::levels::{levels, no_evidence_reason};
use super::measure::AGREEMENT;
use crate::report::tables::{
    agreement_comparisons, commonest_answers, counted_answers, health, missing_threshold_reason, reading,
};
use crate::report::text::table::ColumnKind::{self, Count, Number, Percent, Ratio, Share, Text};
use crate::report::text::table::SUMMARY;
use crate::report::text::table::{Table, TableBuilder, TableCell, TableFormat};
use crate::report::text::words::light;
use crate::types::RunGroup;
use crate::types::text::counted;
use darkqa_score::answers::confusion::{Confusion, Hallucination};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use darkqa_score::comparisons::self_agreement::evidence::NoHalf;
use darkqa_score::comparisons::self_agreement::light::LightReplies;
use darkqa_score::comparisons::self_agreement::models_in_light::ModelsInLight;

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
        .column(Text, "csv mode", |cell| mode(cell.mode))
        .column(Count, "csv n", |cell| cell.replies())
        .column(Count, "csv right", |_| None::<usize>)
        .column(Count, "csv unparsed", |cell| unread(cell))
        .column(Count, "csv failed", |cell| cell.failed)
        .column(Share, "csv value low high", |cell| cell.agreement)
        .column(Text, "csv reading", |cell| reading(&cell.subject))
        .model_facts(&found.grid.listing, |cell| &cell.subject);
    let has_groups = found.cells.iter().any(|cell| run_group(cell).is_some());
    let builder = if has_groups { builder.column(Text, "csv light", |cell| run_group(cell)) } else { builder };
    builder.column(Text, "csv measure", |_| AGREEMENT).build()
}

fn mode(mode: ParsingMode) -> &'static str {
    match mode {
        ParsingMode::Strict => "strict",
        ParsingMode::Lenient => "lenient",
    }
}

/// Name of a cell's run group; `None` if it has none.
fn run_group(cell: &AgreementCell) -> Option<&str> {
    cell.subject.variant.group.as_ref().map(RunGroup::name)
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
        .column(Text, "csv mode", |cell| mode(cell.mode))
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
    let mut table = TableBuilder::new("evidence_thresholds", &found.curves)
        .page("thresholds", "Where half of the evidence is lost")
        .column(Text, "csv model | terminal model | page model", |curve| curve.model.clone())
        .column(Text, "csv variant", |curve| curve.variant.to_string())
        .column(Text, "csv enhancer", |curve| curve.enhancer.as_ref().map(ToString::to_string))
        .column(Text, "terminal light | page light", |curve| light(&curve.variant, curve.enhancer.as_ref()))
        .column(Number, "csv darkest", |curve| curve.darkest.value())
        .column(ColumnKind::Threshold, columns, |curve| match &curve.threshold {
            Ok(threshold) => TableCell::Threshold(*threshold, curve.darkest.value()),
            Err(reason) => TableCell::Unknown(no_half_reason(reason)),
        })
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
