//! Ranks of the models in one table of the site: [`ranked_rows`].

use std::collections::BTreeMap;
use std::fmt::Write;

use super::choice_member::ChoiceMember;
use crate::report::joined::combine::clusters;
use crate::report::site::{ChoiceRow, GroupRows, Ranking};
use crate::types::text::plural;
use crate::types::{ChoiceDetail, ModelListing, RunQuestion, Trials};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{BestInTheDark, best_in_the_dark, rank_ranges};
use darkqa_score::grid::Grid;

/// The rows of runs that can be compared, in the order of their ranks. As in the report, models are ranked by mean
/// accuracy in the dark on the items that all of them answered at all levels. References get no rank.
pub(super) fn ranked_rows(members: Vec<ChoiceMember>) -> GroupRows {
    let names = distinct_names(&members);
    let (mut trials, mut questions, mut rows) = (Trials::default(), Vec::new(), Vec::new());
    for member in members {
        let name = |model: &str| names[&(member.run.page.clone(), model.to_owned())].clone();
        let is_named = |model: &str| names.contains_key(&(member.run.page.clone(), model.to_owned()));
        let mut own = member.trials;
        own.retain(|trial| is_named(trial.model()));
        own.rename(|model| is_named(model).then(|| name(model)));
        for trial in own.iter() {
            trials.copy(trial, 0);
        }
        rows.extend(member.rows.into_iter().map(|row| (name(&row.model), row)));
        questions.extend(member.questions);
    }
    let models = rows.iter().filter(|(_, row)| !row.is_reference()).count();
    let (best, unit) = best(&trials, &questions);
    // A single model needs no comparison with references.
    let best = best.filter(|_| models > 1);
    let ranks: BTreeMap<String, _> = best
        .iter()
        .flat_map(|best| best.models.iter().zip(rank_ranges(best)))
        .map(|(model, rank)| (model.model.clone(), rank))
        .collect();
    let mut rows: Vec<ChoiceRow> = rows
        .into_iter()
        .map(|(name, mut row)| {
            row.rank = ranks.get(&name).copied();
            row
        })
        .collect();
    rows.sort_by_key(ChoiceRow::sort_key);
    let words = words(best.as_ref(), models, &unit);
    GroupRows::Choices(rows, Ranking { words })
}

/// A distinct name of each model of each run, by page and model: followed by the page if another run has a model of
/// this name.
fn distinct_names(members: &[ChoiceMember]) -> BTreeMap<(String, String), String> {
    let mut times = BTreeMap::<&str, usize>::new();
    for row in members.iter().flat_map(|member| &member.rows) {
        *times.entry(&row.model).or_default() += 1;
    }
    members
        .iter()
        .flat_map(|member| &member.rows)
        .map(|row| {
            let name = match times[&*row.model] {
                1 => row.model.clone(),
                _ => format!("{} ({})", row.model, row.run.page),
            };
            ((row.run.page.clone(), row.model.clone()), name)
        })
        .collect()
}

/// The comparison of all models, and the unit treated as independent.
fn best(trials: &Trials<ChoiceDetail>, questions: &[RunQuestion]) -> (Option<BestInTheDark>, String) {
    let clusters = clusters(trials, questions);
    let grid = Grid::for_models(trials, &clusters, &ModelListing::default(), |_| true);
    (best_in_the_dark(&grid, ParsingMode::Strict), clusters.unit().to_string())
}

/// The paragraph about the basis of the ranks, or the reason why there are none.
fn words(best: Option<&BestInTheDark>, models: usize, unit: &str) -> String {
    let Some(best) = best else {
        return match models {
            0 => "No model is ranked: random and the observer stand for comparison.".to_owned(),
            1 => "One model: there is no other to rank it with.".to_owned(),
            _ => "The models are not ranked: no two of them answered the same questions at L0 and at a darker level."
                .to_owned(),
        };
    };
    let levels = best.levels.iter().map(ToString::to_string);
    let mut words = format!(
        "Ranks are by mean accuracy over the dark levels ({}), on the {} items that {} models answered at all levels \
         from L0 ({} {unit}s), corrected by Holm over {}.",
        levels.collect::<Vec<_>>().join(", "),
        best.items,
        match best.models.len() {
            2 => "both".to_owned(),
            models => format!("all {models}"),
        },
        best.clusters,
        match best.pairs.len() {
            1 => "1 pair".to_owned(),
            pairs => format!("all {pairs} pairs"),
        },
    );
    if best.dropped > 0 {
        let _ = write!(words, " {} more items are left out, because a model has no reply to them.", best.dropped);
    }
    if !best.without.is_empty() {
        let models = plural(best.without.len(), "model is", "models are");
        let _ = write!(words, " {models} not ranked: fewer answers at these levels.");
    }
    if !best.is_possible() {
        let _ = write!(words, " With so few {unit}s no model can be shown to be better than another.");
    }
    words
}
