//! A site about many runs: [`site`]. Each run has the page of its report, and rows in a table with the runs that it can
//! be compared with.

mod choice_member;
mod group_key;
mod ranking;

use std::collections::BTreeSet;

use super::alerts::alerts;
use super::combine::{Combined, combine};
use super::enhancers;
use super::open;
use super::own_answers;
use super::whole_report::without_hidden_models;
use crate::error::{Error, Result};
use crate::report::choice_report::ChoiceReport;
use crate::report::products::{PAGE, products};
use crate::report::site::{GroupRows, OpenRow, RunLink, Site, SiteGroup, choice_rows, open_rows};
use crate::runs::stored::{AnyRun, StoredRun};
use crate::types::manifests::RunManifest;
use crate::types::{ChoiceDetail, OpenDetail, Trials, Truths, Variant};

use choice_member::ChoiceMember;
use group_key::{GroupKey, group_members};
use ranking::ranked_rows;

/// A run of open questions, with its rows.
struct OpenMember {
    key: GroupKey,
    rows: Vec<OpenRow>,
}

/// Makes the site of runs, in their order.
///
/// # Errors
/// If a run has no records or a record is broken.
pub(crate) fn site(runs: Vec<AnyRun>) -> Result<Site> {
    let mut site = Site { groups: Vec::new(), others: Vec::new(), pages: Vec::new() };
    let (mut choices, mut open) = (Vec::new(), Vec::new());
    let mut pages = BTreeSet::new();
    for run in runs {
        match run {
            AnyRun::Choice(run) => {
                let link = link(&run.name(), &run.manifest, &mut pages);
                choices.extend(add_choices(run, link, &mut site)?);
            }
            AnyRun::Open(run) => {
                let link = link(&run.name(), &run.manifest, &mut pages);
                open.push(add_open(run, link, &mut site)?);
            }
        }
    }
    let groups = group_members(choices, |member| &member.key);
    add_groups(&mut site, groups, |member| &member.key, ranked_rows);
    let groups = group_members(open, |member| &member.key);
    add_groups(
        &mut site,
        groups,
        |member| &member.key,
        |members| {
            let rows = members.into_iter().flat_map(|member| member.rows);
            GroupRows::Open(rows.collect())
        },
    );
    Ok(site)
}

/// Adds groups of one kind, each with its differences from the first.
fn add_groups<M>(
    site: &mut Site,
    groups: Vec<Vec<M>>,
    key: impl Fn(&M) -> &GroupKey,
    rows: impl Fn(Vec<M>) -> GroupRows,
) {
    let first_number = site.groups.len() + 1;
    let first = groups.first().and_then(|members| members.first());
    let heads: Vec<_> = groups
        .iter()
        .filter_map(|members| {
            let own = key(members.first()?);
            let differs = first.map(|first| own.difference(key(first), first_number));
            Some((own.title.clone(), own.digests.clone(), own.shared.clone(), differs))
        })
        .collect();
    for (index, (members, (title, digests, shared, differs))) in groups.into_iter().zip(heads).enumerate() {
        site.groups.push(SiteGroup {
            title,
            digests,
            shared,
            differs: differs.filter(|_| index > 0),
            rows: rows(members),
        });
    }
}

/// Adds the page of a run. Returns `None` for a run without rows, and then adds it to the other runs with the reason.
fn add_choices(run: StoredRun<ChoiceDetail>, link: RunLink, site: &mut Site) -> Result<Option<ChoiceMember>> {
    let combined = combine(vec![without_hidden_models(run)?])?;
    if combined.truths() == Truths::Unknown {
        let page = page_of(own_answers::whole_report(&combined)?.files)?;
        let why = "nobody knows the true answers to its questions";
        site.others.push((link.clone(), why.to_owned()));
        site.pages.push((link, page));
        return Ok(None);
    }
    let findings = combined.findings();
    let report =
        ChoiceReport::new(&findings, alerts(&combined, &findings)).with_enhancers(&enhancers::rows(&combined.runs));
    let page = page_of(products(&report, &combined.page_inputs())?)?;
    let variant = findings.shown().grid.main_variant();
    let variant = variant.unwrap_or(Variant::NONE);
    let rows = choice_rows(findings.shown(), &variant, &link);
    if rows.is_empty() {
        let why = "no model was shown an image";
        site.others.push((link.clone(), why.to_owned()));
        site.pages.push((link, page));
        return Ok(None);
    }
    let key = GroupKey::from_choices(&combined, &variant)?;
    drop(report);
    drop(findings);
    site.pages.push((link.clone(), page));
    Ok(Some(ChoiceMember {
        key,
        rows,
        trials: compared_trials(&combined, &variant),
        questions: combined.questions,
        run: link,
    }))
}

/// The trials by which models are compared: raw images at L0 and in the main variant.
fn compared_trials(combined: &Combined, variant: &Variant) -> Trials<ChoiceDetail> {
    let trials = combined.trials.iter().filter(|trial| {
        trial.condition().is_some_and(|condition| {
            let own = condition.variant();
            condition.enhancer.is_none() && (own.is_untouched() || own == *variant)
        })
    });
    let mut compared = Trials::default();
    for trial in trials {
        compared.copy(trial, 0);
    }
    compared
}

fn add_open(run: StoredRun<OpenDetail>, link: RunLink, site: &mut Site) -> Result<OpenMember> {
    let run = without_hidden_models(run)?;
    let key = GroupKey::from_open(&run)?;
    let scores = open::Scores::new(open::combine(vec![run])?)?;
    let rows = open_rows(scores.summary(), &link);
    site.pages.push((link, page_of(scores.products()?)?));
    Ok(OpenMember { key, rows })
}

/// The page among the files of a report.
fn page_of(files: Vec<(String, Vec<u8>)>) -> Result<Vec<u8>> {
    files
        .into_iter()
        .find(|(name, _)| name == PAGE)
        .map(|(_, page)| page)
        .ok_or_else(|| Error::data(PAGE, "the report of the run has no page"))
}

/// The link to the page of a run. The file is named after the run, with characters that are safe in URLs, and numbered
/// if the name is already in `taken`.
fn link(name: &str, manifest: &RunManifest, taken: &mut BTreeSet<String>) -> RunLink {
    let stem: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect();
    let stem = stem.trim_start_matches('.');
    let stem = if stem.is_empty() { "run" } else { stem };
    let mut page = format!("{stem}.html");
    let mut number = 2;
    while !taken.insert(page.to_lowercase()) {
        page = format!("{stem}-{number}.html");
        number += 1;
    }
    let day = manifest.updated.split('T').next().unwrap_or_default();
    RunLink { name: name.to_owned(), page, date: day.to_owned(), version: manifest.version.clone() }
}
