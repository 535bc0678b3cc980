//! Runs that show different images under one name of a condition are kept apart: [`Lights`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::settings::{self, some};
use crate::runs::stored::StoredRun;
use crate::types::degradations::Kind;
use crate::types::manifests::RunManifest;
use crate::types::{Condition, Digest, EnhancerName, RunGroup, TrialRef, Variant};
use darkqa_score::answers::record::Detail;
use darkqa_score::subject::is_control;

/// The conditions of one curve: a kind of degradation in a noise profile, raw or with an enhancer, at all levels.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct LightCurve {
    pub(super) variant: Variant,
    pub(super) enhancer: Option<EnhancerName>,
}

impl LightCurve {
    fn new(condition: &Condition) -> Self {
        Self {
            variant: condition.kind_reading(),
            enhancer: condition.enhancer.clone(),
        }
    }

    /// The curves with which the conditions of this one are compared: L0, raw images, and the kind that this one extends.
    fn bases(&self) -> Vec<Self> {
        let raw = |variant| Self {
            variant,
            enhancer: None,
        };
        let base = self.variant.kind.and_then(Kind::base);
        let base = base.map(|kind| Variant {
            kind: Some(kind),
            ..Variant::NONE
        });
        let variants = [Some(Variant::NONE), base, Some(self.variant.clone())];
        variants
            .into_iter()
            .flatten()
            .map(raw)
            .filter(|base| base != self)
            .collect()
    }

    /// The name of the curve without levels, as `noise+lift`; `L0` for untouched frames.
    pub(super) fn name(&self) -> String {
        let kind = if self.variant.is_untouched() {
            "L0".to_owned()
        } else {
            self.variant.kind_and_reading()
        };
        match &self.enhancer {
            None => kind,
            Some(name) => format!("{kind}+{name}"),
        }
    }
}

/// How the images of two runs agree on one curve.
#[derive(Debug, Clone, Copy, Default)]
struct ImageAgreement {
    /// Number of images of which both runs hold the digest.
    shared: usize,
    /// Number of those that differ.
    differing: usize,
}

/// A curve whose images differ between runs.
#[derive(Debug, Clone)]
pub(super) struct SplitCurve {
    pub(super) curve: LightCurve,
    /// The names of the groups, without repetition.
    pub(super) groups: BTreeSet<String>,
    /// Number of images of which two runs hold the digest, and of those that differ; both 0 if only the manifests differ.
    pub(super) shared: usize,
    pub(super) differing: usize,
}

/// The runs that show the same images, for each curve.
///
/// Two runs show the same if the digests of all images agree that both have sent. If they share none, their manifests decide.
#[derive(Debug, Default)]
pub(super) struct Lights {
    /// The group of each run, for the curves whose images differ.
    groups: HashMap<(LightCurve, usize), RunGroup>,
    /// The curves whose images differ.
    pub(super) split: Vec<SplitCurve>,
    /// The runs with images whose records hold no digest of them.
    pub(super) undigested: Vec<usize>,
}

impl Lights {
    /// The groups of runs; `names` are those of the runs, and `order` their numbers in the order of their names.
    pub(super) fn new<D: Detail>(runs: &[StoredRun<D>], names: &[String], order: &[usize]) -> Self {
        if runs.len() < 2 {
            return Self::default();
        }
        let seen = Seen::new(runs);
        let manifests: Vec<&RunManifest> = runs.iter().map(|run| &run.manifest).collect();
        let partitions = seen.partitions(&manifests, order);
        let mut lights = Self {
            undigested: seen.undigested.clone(),
            ..Self::default()
        };
        for (curve, groups) in &partitions {
            let bases = curve.bases();
            let bases: Vec<_> = bases
                .iter()
                .filter_map(|base| partitions.get(base))
                .filter(|base| base.len() > 1)
                .collect();
            if groups.len() < 2 && bases.is_empty() {
                continue;
            }
            let mut parted = BTreeSet::new();
            for group in groups {
                for part in parted_by(group, &bases) {
                    let name = &names[part[0]];
                    parted.insert(name.clone());
                    let group = RunGroup::new(name, &part);
                    let own = part
                        .iter()
                        .map(|run| (((*curve).clone(), *run), group.clone()));
                    lights.groups.extend(own);
                }
            }
            if groups.len() > 1 {
                let agreement = seen.between(curve, groups);
                lights.split.push(SplitCurve {
                    curve: (*curve).clone(),
                    groups: parted,
                    shared: agreement.shared,
                    differing: agreement.differing,
                });
            }
        }
        lights
    }

    /// Whether no curve is split.
    pub(super) fn is_one(&self) -> bool {
        self.groups.is_empty()
    }

    /// Names the group of a run in a condition, if the images of its curve differ.
    pub(super) fn mark(&self, condition: &mut Condition, run: usize) {
        if !self.is_one() {
            condition.group = self.groups.get(&(LightCurve::new(condition), run)).cloned();
        }
    }
}

/// A group of runs, parted by the groups of the curves with which it is compared.
fn parted_by(group: &[usize], bases: &[&Vec<Vec<usize>>]) -> Vec<Vec<usize>> {
    let place = |run: usize| -> Vec<Option<usize>> {
        bases
            .iter()
            .map(|groups| groups.iter().position(|group| group.contains(&run)))
            .collect()
    };
    let mut parts: Vec<(Vec<Option<usize>>, Vec<usize>)> = Vec::new();
    for run in group {
        let place = place(*run);
        match parts.iter_mut().find(|(known, _)| *known == place) {
            Some((_, part)) => part.push(*run),
            None => parts.push((place, vec![*run])),
        }
    }
    parts.into_iter().map(|(_, part)| part).collect()
}

/// The agreement of runs on their images, by curve.
struct Seen {
    /// The runs that have each curve.
    curves: BTreeMap<LightCurve, BTreeSet<usize>>,
    /// The agreement of each pair of runs that share images of a curve.
    pairs: HashMap<(LightCurve, usize, usize), ImageAgreement>,
    undigested: Vec<usize>,
}

/// Groups of runs that show the same images, by curve.
type Partitions<'a> = BTreeMap<&'a LightCurve, Vec<Vec<usize>>>;

impl Seen {
    /// The groups of runs that agree on each curve.
    fn partitions(&self, manifests: &[&RunManifest], order: &[usize]) -> Partitions<'_> {
        self.curves
            .iter()
            .map(|(curve, having)| {
                let agree = |one: usize, other: usize| {
                    let pair = (curve.clone(), one.min(other), one.max(other));
                    match self.pairs.get(&pair) {
                        Some(agreement) => agreement.differing == 0,
                        None => same_by_manifest(curve, manifests[one], manifests[other]),
                    }
                };
                let mut groups: Vec<Vec<usize>> = Vec::new();
                for run in order.iter().copied().filter(|run| having.contains(run)) {
                    let mut known = groups.iter_mut();
                    match known.find(|group| group.iter().all(|other| agree(run, *other))) {
                        Some(group) => group.push(run),
                        None => groups.push(vec![run]),
                    }
                }
                (curve, groups)
            })
            .collect()
    }

    /// The images of a curve that runs of different groups share.
    fn between(&self, curve: &LightCurve, groups: &[Vec<usize>]) -> ImageAgreement {
        let place = |run: usize| groups.iter().position(|group| group.contains(&run));
        let mut all = ImageAgreement::default();
        for ((of, one, other), agreement) in &self.pairs {
            if of == curve && place(*one) != place(*other) {
                all.shared += agreement.shared;
                all.differing += agreement.differing;
            }
        }
        all
    }

    fn new<D: Detail>(runs: &[StoredRun<D>]) -> Self {
        let mut curves = HashMap::<&Condition, BTreeSet<usize>>::new();
        let mut images = HashMap::<(&Condition, &str), Vec<(usize, Digest)>>::new();
        let mut undigested = Vec::new();
        for (index, run) in runs.iter().enumerate() {
            let (mut with, mut without) = (false, false);
            for (condition, source, digest) in run.trials.iter().filter_map(image) {
                curves.entry(condition).or_default().insert(index);
                with |= digest.is_some();
                without |= digest.is_none();
                if let Some(digest) = digest {
                    let image = images.entry((condition, source)).or_default();
                    if image.last().is_none_or(|(last, _)| *last != index) {
                        image.push((index, digest));
                    }
                }
            }
            if without && !with {
                undigested.push(index);
            }
        }
        let mut pairs = HashMap::<(&Condition, usize, usize), ImageAgreement>::new();
        for ((condition, _), digests) in images {
            for (place, (one, digest)) in digests.iter().enumerate() {
                for (other, other_digest) in &digests[place + 1..] {
                    let pair = pairs.entry((condition, *one, *other)).or_default();
                    pair.shared += 1;
                    pair.differing += usize::from(digest != other_digest);
                }
            }
        }
        let mut seen = Self {
            curves: BTreeMap::new(),
            pairs: HashMap::new(),
            undigested,
        };
        for (condition, runs) in curves {
            seen.curves
                .entry(LightCurve::new(condition))
                .or_default()
                .extend(runs);
        }
        for ((condition, one, other), found) in pairs {
            let pair = seen
                .pairs
                .entry((LightCurve::new(condition), one, other))
                .or_default();
            pair.shared += found.shared;
            pair.differing += found.differing;
        }
        seen
    }
}

/// The condition, the frame or walk, and the digest of the images of a trial; `None` if the model saw none or the trial failed. A
/// control of the observer is shown a changed image, which reveals nothing about the light.
fn image<D: Detail>(trial: TrialRef<'_, D>) -> Option<(&Condition, &str, Option<Digest>)> {
    let is_image = !trial.failed() && !is_control(trial.model());
    let condition = trial.condition().filter(|_| is_image)?;
    Some((condition, trial.source(), trial.sent()))
}

/// Whether two runs show the same images on a curve, by their manifests.
fn same_by_manifest(curve: &LightCurve, one: &RunManifest, other: &RunManifest) -> bool {
    let runs = [one, other];
    let own = |run: &RunManifest| {
        let mut all = some(run, &settings::ENCODING);
        let kind = curve.variant.synthetic_kind();
        if kind.is_some() || curve.enhancer.is_some() {
            all.extend(settings::pixels(run));
        }
        if kind == Some(Kind::Exposure) {
            all.remove("--seed");
        }
        if let Some(kind) = kind {
            all.extend(settings::variant(run, kind));
        }
        if kind.is_some_and(Kind::has_readings) {
            all.extend(settings::noise(run, &runs));
        }
        if curve.enhancer.is_some() {
            all.extend(settings::enhancers(run));
        }
        Some(all)
    };
    settings::differing(&runs.map(own)).is_empty()
}
