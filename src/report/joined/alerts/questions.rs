//! Alerts about questions that differ between runs or models: [`question_alerts`], [`repeat_alert`],
//! [`item_alerts`]; and about their true answers: [`balance_alert`].

use std::collections::{BTreeMap, BTreeSet, HashSet};

use crate::report::joined::combine::Combined;
use crate::report::joined::join::Joined;
use crate::report::joined::settings::{has_human_answers, joined_with_and};
use crate::report::text::alert::{Alert, AlertKind};
use crate::report::text::words::family as family_name;
use crate::types::text::{counted, excerpt};
use crate::types::{QuestionId, RunQuestion, TrialRef, View};
use darkqa_score::answers::record::Detail;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::is_control;

/// Alerts about differences between the questions of the runs, and between their image files.
pub(super) fn question_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut asked = Vec::<BTreeMap<&QuestionId, Option<&RunQuestion>>>::new();
    for run in &joined.runs {
        // A control gets its own choice of frames, and in a shard other frames than the models.
        let ids: HashSet<&QuestionId> =
            joined.trials_of(run).filter(|trial| !is_control(trial.model())).map(TrialRef::question).collect();
        let mut ids: BTreeMap<&QuestionId, Option<&RunQuestion>> = ids.into_iter().map(|id| (id, None)).collect();
        for question in &run.questions {
            if let Some(place) = ids.get_mut(&question.id) {
                *place = Some(question);
            }
        }
        asked.push(ids);
    }
    let mut alerts = Vec::new();
    let shared: Vec<&&QuestionId> =
        asked[0].keys().filter(|id| asked.iter().all(|ids| ids.contains_key(*id))).collect();
    if asked.iter().any(|ids| ids.len() != shared.len()) {
        let counts: Vec<String> =
            joined.runs.iter().zip(&asked).map(|(run, ids)| format!("{} of {}", ids.len(), run.name)).collect();
        let text =
            format!("The questions differ: {} share {}.", joined_with_and(&counts), counted(shared.len(), "question"));
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    // Each question is compared with the same one in the first run that has it.
    let mut firsts = BTreeMap::<&QuestionId, &RunQuestion>::new();
    let mut pairs = Vec::<(&QuestionId, &RunQuestion, &RunQuestion)>::new();
    for (id, question) in asked.iter().flatten() {
        if let Some(question) = question {
            match firsts.get(id) {
                Some(first) => pairs.push((id, first, question)),
                None => {
                    firsts.insert(id, question);
                }
            }
        }
    }
    let count = |differs: &dyn Fn(&RunQuestion, &RunQuestion) -> bool| {
        let ids: BTreeSet<&QuestionId> =
            pairs.iter().filter(|(_, one, other)| differs(one, other)).map(|(id, ..)| *id).collect();
        ids.len()
    };
    let words = count(&|one, other| one.text != other.text);
    if words > 0 {
        let text = format!("The words of {} differ.", counted(words, "shared question"));
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    let files = count(&|one, other| one.image.zip(other.image).is_some_and(|(a, b)| a != b));
    if files > 0 {
        let text = format!("The frames of {} are other files under the same names.", counted(files, "shared question"));
        alerts.push(Alert::new(AlertKind::Data, text));
    }
    let groups = count(&|one, other| {
        let groups = one.group.as_ref().zip(other.group.as_ref());
        groups.is_some_and(|(group, other)| group != other)
    });
    if groups > 0 {
        let text = format!(
            "The groups of {} differ; those of the first run by name count.",
            counted(groups, "shared question")
        );
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    alerts
}

/// The alert about runs that asked the same questions a different number of times.
pub(super) fn repeat_alert(combined: &Combined) -> Option<Alert> {
    let times: Vec<(&String, u32)> = combined
        .runs
        .iter()
        .filter(|run| !has_human_answers(&run.manifest))
        .map(|run| {
            let times = combined.trials_of(run).map(|trial| trial.repeat().saturating_add(1)).max();
            (&run.name, times.unwrap_or(1))
        })
        .collect();
    let differs = times.iter().any(|(_, times_here)| *times_here != times[0].1);
    differs.then(|| {
        let times: Vec<String> = times.iter().map(|(run, times)| format!("{times} in {run}")).collect();
        let text =
            format!("Questions were asked a different number of times: --repeats is {}.", joined_with_and(&times));
        Alert::new(AlertKind::Questions, text)
    })
}

/// The alert about families of which one answer is true so often that a constant reply scores well.
pub(super) fn balance_alert(findings: &Findings<'_>) -> Option<Alert> {
    let has_blind = findings.grid.subjects.iter().any(|subject| subject.view == Some(View::Blind));
    let remedy =
        if has_blind { "Compare with the accuracy without images" } else { "Ask without images too (--blind)" };
    let families: Vec<String> = findings
        .summary
        .unbalanced
        .iter()
        .map(|one| {
            format!(
                "“{}” is true of {} of {} questions about {}",
                excerpt(&one.answer, 60),
                one.count,
                one.questions,
                family_name(Some(&one.family))
            )
        })
        .collect();
    let text = format!(
        "One answer to everything scores well: {}. {remedy}, and read the balanced accuracy.",
        families.join(", ")
    );
    (!families.is_empty()).then(|| Alert::new(AlertKind::Answers, text))
}

/// The alert about models that did not answer the same questions.
pub(super) fn item_alerts(findings: &Findings<'_>) -> Vec<Alert> {
    let Some(common) = &findings.common else {
        return Vec::new();
    };
    let short: Vec<String> = common
        .asked
        .iter()
        .filter(|asked| asked.questions < common.questions)
        .enumerate()
        .map(|(place, asked)| {
            let blind = if asked.is_blind { " without images" } else { "" };
            let of = match place {
                0 => format!(" of {} questions", common.questions),
                _ => String::new(),
            };
            format!("{}{blind} was asked {}{of}", asked.model, asked.questions)
        })
        .collect();
    if short.is_empty() {
        return Vec::new();
    }
    let text = format!(
        "Models were asked different questions: {}. Compare by the {} shared: the second table has them, --common leaves out all others.",
        joined_with_and(&short),
        common.shared_questions
    );
    vec![Alert::new(AlertKind::Items, text)]
}
