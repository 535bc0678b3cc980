//! Groups runs by their images, to split conditions whose images differ between runs: [`ImageGroups`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::settings::{self, differing_settings, identity_fields};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{Condition, Digest, EnhancerName, RunGroup, TrialRef, Variant};
use darkqa_runs::stored::StoredRun;
use darkqa_score::answers::record::Detail;
use darkqa_score::model_in_condition::is_control;

/// The conditions of one curve: a variant with or without an enhancer, at all levels.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct LightCurve {
    pub(super) variant: Variant,
    pub(super) enhancer: Option<EnhancerName>,
}

impl LightCurve {
    fn new(condition: &Condition) -> Self {
        Self { variant: condition.variant(), enhancer: condition.enhancer.clone() }
    }

    /// The raw curves that this one is compared with: L0, the degradation kind that this kind extends, and the same
    /// variant without the enhancer.
    fn bases(&self) -> Vec<Self> {
        let base = self.variant.kind.and_then(Kind::base);
        let base = base.map(|kind| Variant { kind: Some(kind), ..Variant::NONE });
        [Some(Variant::NONE), base, Some(self.variant.clone())]
            .into_iter()
            .flatten()
            .map(|variant| Self { variant, enhancer: None })
            .filter(|base| base != self)
            .collect()
    }

    /// Name of the curve without levels, for example `noise+lift`; `L0` for untouched frames.
    pub(super) fn name(&self) -> String {
        let kind = if self.variant.is_untouched() { "L0".to_owned() } else { self.variant.kind_and_profile() };
        match &self.enhancer {
            None => kind,
            Some(name) => format!("{kind}+{name}"),
        }
    }
}

/// Agreement of the images of two runs on one curve.
#[derive(Debug, Clone, Copy, Default)]
struct ImageAgreement {
    /// Number of images with a digest in both runs.
    shared: usize,
    /// Number of shared images whose digests differ.
    differing: usize,
}

/// A curve whose images differ between runs.
#[derive(Debug, Clone)]
pub(super) struct SplitCurve {
    pub(super) curve: LightCurve,
    /// Distinct names of the groups.
    pub(super) groups: BTreeSet<String>,
    /// Number of images with a digest in two runs of different groups; 0 if only the manifests differ.
    pub(super) shared: usize,
    /// Number of shared images whose digests differ.
    pub(super) differing: usize,
}

/// Groups of runs with the same images, for each curve.
///
/// Two runs have the same images if the digests of all images that both sent are equal. If they share none, or the forms
/// of their PNG files differ, their manifests decide.
#[derive(Debug, Default)]
pub(super) struct ImageGroups {
    /// The group of each run, for the curves that are split.
    groups: HashMap<(LightCurve, usize), RunGroup>,
    /// The curves whose images differ.
    pub(super) split_curves: Vec<SplitCurve>,
    /// The runs with images whose records have no digests of them.
    pub(super) undigested: Vec<usize>,
}

impl ImageGroups {
    /// Groups runs by their images. `names` are the names of the runs, and `order` their indices in the order of the
    /// names.
    pub(super) fn new<D: Detail>(runs: &[StoredRun<D>], names: &[String], order: &[usize]) -> Self {
        if runs.len() < 2 {
            return Self::default();
        }
        let comparison = CurveAgreement::new(runs);
        let manifests: Vec<&RunManifest> = runs.iter().map(|run| &run.manifest).collect();
        let partitions = comparison.partitions(&manifests, order);
        let mut found = Self { undigested: comparison.undigested.clone(), ..Self::default() };
        for (curve, groups) in &partitions {
            let bases: Vec<_> =
                curve.bases().iter().filter_map(|base| partitions.get(base)).filter(|base| base.len() > 1).collect();
            if groups.len() < 2 && bases.is_empty() {
                continue;
            }
            let mut group_names = BTreeSet::new();
            for group in groups {
                for subgroup in split_by(group, &bases) {
                    let name = &names[subgroup[0]];
                    group_names.insert(name.clone());
                    let group = RunGroup::new(name, &subgroup);
                    for run in subgroup {
                        found.groups.insert(((*curve).clone(), run), group.clone());
                    }
                }
            }
            if groups.len() > 1 {
                let agreement = comparison.between(curve, groups);
                found.split_curves.push(SplitCurve {
                    curve: (*curve).clone(),
                    groups: group_names,
                    shared: agreement.shared,
                    differing: agreement.differing,
                });
            }
        }
        found
    }

    /// True if any curve is split.
    pub(super) fn is_split(&self) -> bool {
        !self.groups.is_empty()
    }

    /// Sets the group of a condition of a run, if the images of its curve differ.
    pub(super) fn mark(&self, condition: &mut Condition, run: usize) {
        if self.is_split() {
            condition.group = self.groups.get(&(LightCurve::new(condition), run)).cloned();
        }
    }
}

/// Splits a group of runs so that the runs of each subgroup are in the same group on every base curve.
fn split_by(group: &[usize], bases: &[&Vec<Vec<usize>>]) -> Vec<Vec<usize>> {
    let mut subgroups: Vec<(Vec<Option<usize>>, Vec<usize>)> = Vec::new();
    for run in group {
        let base_groups: Vec<Option<usize>> =
            bases.iter().map(|groups| groups.iter().position(|group| group.contains(run))).collect();
        match subgroups.iter_mut().find(|(known, _)| *known == base_groups) {
            Some((_, subgroup)) => subgroup.push(*run),
            None => subgroups.push((base_groups, vec![*run])),
        }
    }
    subgroups.into_iter().map(|(_, subgroup)| subgroup).collect()
}

/// Pairwise agreement of the images of runs, by curve.
struct CurveAgreement {
    /// The runs that have each curve.
    curves: BTreeMap<LightCurve, BTreeSet<usize>>,
    /// The agreement of each pair of runs that share images of a curve.
    pairs: HashMap<(LightCurve, usize, usize), ImageAgreement>,
    undigested: Vec<usize>,
}

/// Groups of runs with the same images, by curve.
type Partitions<'a> = BTreeMap<&'a LightCurve, Vec<Vec<usize>>>;

impl CurveAgreement {
    /// The groups of runs whose images agree, for each curve. `order` is the order in which runs are added to groups.
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
                    let group = groups.iter_mut().find(|group| group.iter().all(|other| agree(run, *other)));
                    match group {
                        Some(group) => group.push(run),
                        None => groups.push(vec![run]),
                    }
                }
                (curve, groups)
            })
            .collect()
    }

    /// The agreement on images of a curve, summed over pairs of runs in different groups.
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
                    if !runs[*one].manifest.has_same_image_bytes(&runs[*other].manifest) {
                        continue;
                    }
                    let pair = pairs.entry((condition, *one, *other)).or_default();
                    pair.shared += 1;
                    pair.differing += usize::from(digest != other_digest);
                }
            }
        }
        let mut seen = Self { curves: BTreeMap::new(), pairs: HashMap::new(), undigested };
        for (condition, runs) in curves {
            seen.curves.entry(LightCurve::new(condition)).or_default().extend(runs);
        }
        for ((condition, one, other), found) in pairs {
            let pair = seen.pairs.entry((LightCurve::new(condition), one, other)).or_default();
            pair.shared += found.shared;
            pair.differing += found.differing;
        }
        seen
    }
}

/// The condition, the frame or walk, and the image digest of a trial. `None` if the trial had no image or failed, or if
/// the model is a control of the observer, which gets a changed image.
fn image<D: Detail>(trial: TrialRef<'_, D>) -> Option<(&Condition, &str, Option<Digest>)> {
    let is_image = !trial.failed() && !is_control(trial.model());
    let condition = trial.condition().filter(|_| is_image)?;
    Some((condition, trial.source(), trial.sent_digest()))
}

/// True if the settings that decide images are the same in two runs.
pub(super) fn has_same_image_settings(one: &RunManifest, other: &RunManifest) -> bool {
    differing_settings(&[one, other].map(|run| {
        let mut all = identity_fields(run, &settings::ENCODING);
        all.extend(settings::pixel_settings(run));
        Some(all)
    }))
    .is_empty()
}

/// True if two runs have the same images on a curve according to their manifests.
fn same_by_manifest(curve: &LightCurve, one: &RunManifest, other: &RunManifest) -> bool {
    let runs = [one, other];
    differing_settings(&runs.map(|run| {
        let mut all = identity_fields(run, &settings::ENCODING);
        let kind = curve.variant.synthetic_kind();
        if kind.is_some() || curve.enhancer.is_some() {
            all.extend(settings::pixel_settings(run));
        }
        if kind == Some(Kind::Exposure) {
            all.remove("--seed");
        }
        if let Some(kind) = kind {
            all.extend(settings::variant_settings(run, kind));
        }
        if kind.is_some_and(Kind::has_profiles) {
            all.extend(settings::noise_settings(run, &runs));
        }
        if curve.enhancer.is_some() {
            all.extend(settings::enhancer_settings(run));
        }
        Some(all)
    }))
    .is_empty()
}
