//! The lines above a report: what differs between its runs, and what is wrong with its numbers ([`alerts`]).

use std::collections::{BTreeMap, BTreeSet};

use super::combine::Combined;
use super::join::{Joined, JoinedRun};
use super::settings::{
    ENCODING, Setting, Settings, address, differing, is_of_people, light, listed, parameter_flags,
    some, without_repeated,
};
use crate::report::alert::{Alert, AlertKind, MAX_UNREAD};
use crate::score::cluster::MIN_SCENES;
use crate::score::findings::Findings;
use crate::types::manifest::{RunManifest, Status};
use crate::types::{Detail, QuestionId, RunQuestion, UnreadReason};

/// The flags that decide the orders in which choices are shown.
const ORDERS: [&str; 2] = ["--shuffle-options", "--circular"];

/// All alerts of a report on questions with choices, in the order of their kinds.
pub(super) fn alerts(combined: &Combined, findings: &Findings<'_>) -> Vec<Alert> {
    let mut alerts = of_runs(combined);
    alerts.extend(of_replies(findings));
    alerts.extend(of_people(combined));
    alerts.extend(of_repeats(combined));
    alerts.extend(of_items(findings));
    if findings.grid.clusters < MIN_SCENES {
        let (clusters, unit) = (findings.grid.clusters, findings.unit);
        let text = format!(
            "There are only {} ({MIN_SCENES} are needed): intervals and tests are rough.",
            counted(clusters, &unit.to_string())
        );
        alerts.push(Alert::new(AlertKind::Clusters, text));
    }
    alerts.sort_by_key(|alert| alert.kind);
    alerts
}

/// The alerts that follow from manifests and the questions asked, of runs of either kind.
pub(super) fn of_runs<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut alerts = of_progress(&joined.runs);
    alerts.extend(of_servers(joined));
    if joined.runs.len() > 1 {
        alerts.extend(of_settings(joined));
        alerts.extend(of_questions(joined));
    }
    alerts.sort_by_key(|alert| alert.kind);
    alerts
}

fn of_progress(runs: &[JoinedRun]) -> Vec<Alert> {
    let unfinished = runs
        .iter()
        .filter(|run| run.manifest.status != Status::Complete);
    let alerts = unfinished.map(|run| {
        let (status, counts) = (run.manifest.status, run.manifest.counts);
        // A run that is merged of some of its parts has answers to all of their trials.
        let rest = if counts.answered < counts.trials {
            " The same command asks the rest."
        } else {
            ""
        };
        let text = format!(
            "{}: {status}: {} of {} trials answered, {} failed.{rest}",
            run.name, counts.answered, counts.trials, counts.failed
        );
        Alert::new(AlertKind::NotComplete, text)
    });
    alerts.collect()
}

/// What differs between the settings in the manifests.
fn of_settings<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let names = names(&joined.runs);
    let manifests: Vec<&RunManifest> = joined.runs.iter().map(|run| &run.manifest).collect();
    let of = |read: &dyn Fn(&RunManifest) -> Settings| {
        let settings = manifests.iter().map(|run| Some(read(run)));
        differing(&settings.collect::<Vec<_>>())
    };
    let flags = |flags: &'static [&'static str]| of(&move |run| some(run, flags));
    let (constraints, parameters): (Vec<Setting>, Vec<Setting>) = {
        let settings = manifests.iter().map(|run| parameter_flags(run));
        let all = differing(&settings.collect::<Vec<_>>());
        all.into_iter()
            .partition(|setting| setting.flag == "--constrain")
    };
    let version = of(&|run| Settings::from([("the version".to_owned(), run.version.clone())]));
    let judged = of(&|run| super::settings::noted(run, &["--judge", "--protocol"]));
    let rows = [
        (AlertKind::Data, "The data differ", flags(&["--data"])),
        (
            AlertKind::Questions,
            "The orders of choices differ",
            flags(&ORDERS),
        ),
        (
            AlertKind::Images,
            "The size or encoding of images differs",
            flags(&ENCODING),
        ),
        (
            AlertKind::Prompts,
            "The prompts differ",
            flags(&["--prompts"]),
        ),
        (
            AlertKind::Parameters,
            "The parameters of models differ",
            parameters,
        ),
        (
            AlertKind::Constrain,
            "Replies are constrained differently",
            constraints,
        ),
        (AlertKind::Scoring, "The scoring differs", judged),
        (
            AlertKind::Version,
            "The versions of this program differ",
            version,
        ),
    ];
    let mut alerts: Vec<Alert> = rows
        .into_iter()
        .filter(|(_, _, settings)| !settings.is_empty())
        .map(|(kind, what, settings)| Alert::new(kind, sentence(what, &settings, &names)))
        .collect();
    let light = without_repeated(of(&|run| light(run, &manifests)));
    alerts.extend(of_light(joined, &light, &names));
    alerts
}

/// The settings of the light that differ, and the conditions that are kept apart for it.
fn of_light<D: Detail>(joined: &Joined<D>, light: &[Setting], names: &[String]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    let mut sentences = Vec::new();
    if !light.is_empty() {
        sentences.push(sentence("The light differs", light, names));
    }
    let mut by_groups = BTreeMap::<_, (Vec<String>, usize, usize)>::new();
    for split in &joined.lights.split {
        let (curves, shared, differing) = by_groups.entry(&split.groups).or_default();
        curves.push(split.curve.name());
        *shared += split.shared;
        *differing += split.differing;
    }
    for (groups, (curves, shared, differing)) in by_groups {
        let groups: Vec<String> = groups.iter().map(|name| format!("@{name}")).collect();
        let why = match shared {
            0 => "no image is shared, and the settings differ".to_owned(),
            _ => format!("{differing} of {shared} shared images differ"),
        };
        let stand = if curves.len() == 1 { "stands" } else { "stand" };
        let curves = listed(&curves);
        sentences.push(format!(
            "{curves} {stand} apart as {}: {why}.",
            listed(&groups)
        ));
    }
    if !sentences.is_empty() {
        alerts.push(Alert::new(AlertKind::Light, sentences.join(" ")));
    }
    if !joined.lights.undigested.is_empty() {
        let runs: Vec<&String> = joined
            .lights
            .undigested
            .iter()
            .map(|run| &names[*run])
            .collect();
        let text = format!(
            "The records of {} hold no digests of images: the settings in the manifests decide what was shown.",
            listed(&runs)
        );
        alerts.push(Alert::new(AlertKind::Light, text));
    }
    alerts
}

/// What differs between the questions of the runs, and between the files that they are about.
fn of_questions<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut asked = Vec::<BTreeMap<&QuestionId, Option<&RunQuestion>>>::new();
    for run in &joined.runs {
        let records = run.records.iter().map(|place| &joined.records[*place]);
        let mut ids: BTreeMap<&QuestionId, Option<&RunQuestion>> =
            records.map(|record| (&record.question, None)).collect();
        for question in &run.questions {
            if let Some(place) = ids.get_mut(&question.id) {
                *place = Some(question);
            }
        }
        asked.push(ids);
    }
    let mut alerts = Vec::new();
    let shared = asked[0]
        .keys()
        .filter(|id| asked.iter().all(|ids| ids.contains_key(*id)));
    let shared: Vec<&&QuestionId> = shared.collect();
    if asked.iter().any(|ids| ids.len() != shared.len()) {
        let counts = joined.runs.iter().zip(&asked);
        let counts: Vec<String> = counts
            .map(|(run, ids)| format!("{} of {}", ids.len(), run.name))
            .collect();
        let text = format!(
            "The questions differ: {} share {}.",
            listed(&counts),
            counted(shared.len(), "question")
        );
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    let differ = |differs: &dyn Fn(&RunQuestion, &RunQuestion) -> bool| {
        let shared = shared.iter().filter(|id| {
            let known: Vec<&RunQuestion> = asked.iter().filter_map(|ids| ids[**id]).collect();
            known.iter().skip(1).any(|other| differs(known[0], other))
        });
        shared.count()
    };
    let words = differ(&|one, other| one.text != other.text);
    if words > 0 {
        let text = format!("The words of {} differ.", counted(words, "shared question"));
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    let files = differ(&|one, other| one.image.zip(other.image).is_some_and(|(a, b)| a != b));
    if files > 0 {
        let text = format!(
            "The frames of {} are other files under the same names.",
            counted(files, "shared question")
        );
        alerts.push(Alert::new(AlertKind::Data, text));
    }
    alerts
}

/// The names that servers gave for a model, and the addresses, if there are several.
fn of_servers<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let names = names(&joined.runs);
    let mut served = BTreeMap::<&str, BTreeMap<usize, BTreeSet<&str>>>::new();
    for (index, run) in joined
        .runs
        .iter()
        .enumerate()
        .filter(|(_, run)| !is_of_people(&run.manifest))
    {
        for place in &run.records {
            let record = &joined.records[*place];
            if let Some(name) = &record.served_model {
                let runs = served
                    .entry(joined.models.asked(&record.model))
                    .or_default();
                runs.entry(index).or_default().insert(name);
            }
        }
    }
    let mut alerts = Vec::new();
    for (model, runs) in &served {
        let distinct: BTreeSet<&&str> = runs.values().flatten().collect();
        if distinct.len() > 1 {
            let runs: Vec<String> = runs
                .iter()
                .map(|(run, served)| {
                    let served: Vec<&str> = served.iter().copied().collect();
                    format!("{} in {}", listed(&served), names[*run])
                })
                .collect();
            let text = format!("{model} was served as {}.", listed(&runs));
            alerts.push(Alert::new(AlertKind::Served, text));
        }
    }
    let models = joined
        .runs
        .iter()
        .filter_map(|run| run.manifest.columns.get("model"));
    let models: BTreeSet<&String> = models.flat_map(BTreeMap::keys).collect();
    for model in models {
        let addresses = joined.runs.iter().map(|run| {
            let address = address(&run.manifest, model)?;
            Some(Settings::from([("--base-url".to_owned(), address)]))
        });
        let differing = differing(&addresses.collect::<Vec<_>>());
        if !differing.is_empty() {
            let what = format!("{model} was asked at several addresses");
            alerts.push(Alert::new(
                AlertKind::Served,
                sentence(&what, &differing, &names),
            ));
        }
    }
    alerts
}

/// Replies that could not be read, and trials without a reply.
fn of_replies(findings: &Findings<'_>) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, [usize; 3]>::new();
    for health in &findings.health {
        let [replies, unread, failed] = counts.entry(&health.subject.model).or_default();
        *replies += health.replies;
        *unread += health.replies - health.read;
        *failed += health.failures();
    }
    let mut alerts = Vec::new();
    for (model, [replies, unread, failed]) in counts {
        if unread as f64 > MAX_UNREAD * replies as f64 {
            let share = 100.0 * unread as f64 / replies as f64;
            let text = format!(
                "{unread} of {replies} replies of {model} ({share:.1} %) could not be read, and count as wrong."
            );
            alerts.push(Alert::new(AlertKind::Unread, text));
        }
        if failed > 0 {
            let (trials, are) = (
                counted(failed, "trial"),
                if failed == 1 { "is" } else { "are" },
            );
            let text = format!("{trials} of {model} failed and {are} not scored.");
            alerts.push(Alert::new(AlertKind::Failed, text));
        }
    }
    alerts
}

/// Answers of people that are no choice of their question.
fn of_people(combined: &Combined) -> Vec<Alert> {
    let people = combined
        .runs
        .iter()
        .filter(|run| is_of_people(&run.manifest));
    let alerts = people.filter_map(|run| {
        let records = run.records.iter().map(|place| &combined.records[*place]);
        let unread = records.filter_map(|record| record.detail.strict?.why);
        let count = unread.filter(|why| *why != UnreadReason::Empty).count();
        let text = format!(
            "{} of {} of people are no choice of their question, and count as wrong.",
            count,
            counted(run.records.len(), "answer")
        );
        (count > 0).then(|| Alert::new(AlertKind::NoChoice, text))
    });
    alerts.collect()
}

/// Runs that asked the same questions a different number of times.
fn of_repeats(combined: &Combined) -> Option<Alert> {
    let people = |run: &&JoinedRun| !is_of_people(&run.manifest);
    let times = combined.runs.iter().filter(people).map(|run| {
        let records = run.records.iter().map(|place| &combined.records[*place]);
        (
            &run.name,
            records
                .map(|record| record.detail.repeat + 1)
                .max()
                .unwrap_or(1),
        )
    });
    let times: Vec<(&String, u32)> = times.collect();
    let differs = times
        .iter()
        .any(|(_, times_here)| *times_here != times[0].1);
    differs.then(|| {
        let times: Vec<String> = times
            .iter()
            .map(|(run, times)| format!("{times} in {run}"))
            .collect();
        let text = format!(
            "Questions were asked a different number of times: --repeats is {}.",
            listed(&times)
        );
        Alert::new(AlertKind::Questions, text)
    })
}

/// Models that did not answer the same questions.
fn of_items(findings: &Findings<'_>) -> Vec<Alert> {
    let Some(common) = &findings.common else {
        return Vec::new();
    };
    let short = common
        .asked
        .iter()
        .filter(|asked| asked.questions < common.questions);
    let short: Vec<String> = short
        .enumerate()
        .map(|(place, asked)| {
            let blind = if asked.is_blind {
                " without images"
            } else {
                ""
            };
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
        listed(&short),
        common.shared_questions
    );
    vec![Alert::new(AlertKind::Items, text)]
}

fn names(runs: &[JoinedRun]) -> Vec<String> {
    runs.iter().map(|run| run.name.clone()).collect()
}

fn sentence(what: &str, settings: &[Setting], names: &[String]) -> String {
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| setting.words(names))
        .collect();
    format!("{what}: {}.", settings.join("; "))
}

/// A number of things: `1 trial`, `2 trials`.
fn counted(number: usize, noun: &str) -> String {
    let ending = if number == 1 { "" } else { "s" };
    format!("{number} {noun}{ending}")
}
