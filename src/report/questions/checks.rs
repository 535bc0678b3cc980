//! Report on questions that people checked, as text and as JSON: [`text`], [`json()`].

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::report::text::table::ColumnKind::{Count, Text};
use crate::report::text::table::TableBuilder;
use crate::report::text::terminal;
use crate::report::text::words::with_interval;
use crate::types::Family;
use darkqa_score::answers::checks::{Checks, agreements, shares};
use darkqa_score::estimate::Estimate;

/// Table of wrong and ambiguous questions by person and family, with a line on the agreement of each two people; empty
/// without checks.
#[must_use]
pub(crate) fn text(checks: &Checks) -> String {
    if checks.is_empty() {
        return String::new();
    }
    let table = TableBuilder::new("checks", shares(checks))
        .column(Text, "terminal checked by", |share| share.person.clone())
        .column(Text, "terminal family", |share| {
            let name = share.family.as_ref().map_or(Family::TOTAL, Family::name);
            name.to_owned()
        })
        .column(Count, "terminal questions", |share| share.wrong.n)
        .column(Text, "terminal wrong % [95 %]", |share| with_interval(share.wrong))
        .column(Text, "terminal ambiguous % [95 %]", |share| with_interval(share.ambiguous))
        .build();
    let mut text = terminal::table(&[table]);
    for pair in agreements(checks) {
        let [first, second] = &pair.people;
        let kappa = match (pair.kappa, pair.interval) {
            (Some(kappa), Some([low, high])) => format!("{kappa:.2} [{low:.2}, {high:.2}]"),
            (Some(kappa), None) => {
                format!("{kappa:.2}, without an interval, because they vary in too few scenes")
            }
            (None, _) => "undefined, because one of them found all questions right, or none".to_owned(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{first} and {second} found the same of {} % of {} questions; Cohen's κ of finding a question right: {kappa}",
            with_interval(pair.same),
            pair.same.n
        );
    }
    text
}

/// Value and interval as JSON, without the sample size.
fn estimate_json(estimate: Estimate) -> Value {
    json!({"value": estimate.value, "low": estimate.low, "high": estimate.high})
}

/// Shares by person and family, and agreements, as JSON.
#[must_use]
pub(crate) fn json(checks: &Checks) -> Value {
    let shares: Vec<Value> = shares(checks)
        .into_iter()
        .map(|share| {
            json!({
                "person": share.person,
                "family": share.family.as_ref().map_or(Family::TOTAL, Family::name),
                "questions": share.wrong.n,
                "wrong": estimate_json(share.wrong),
                "ambiguous": estimate_json(share.ambiguous),
            })
        })
        .collect();
    let agreements: Vec<Value> = agreements(checks)
        .into_iter()
        .map(|pair| {
            json!({
                "people": pair.people,
                "questions": pair.same.n,
                "same": estimate_json(pair.same),
                "kappa": pair.kappa,
                "kappa_interval": pair.interval,
            })
        })
        .collect();
    json!({"shares": shares, "agreements": agreements})
}
