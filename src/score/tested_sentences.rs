//! Multiple-testing correction of the tests behind the sentences of a report: [`Findings::correct_sentences`].
//!
//! Multiple-testing correction over a tree of tests: [`adjust_p_values`].
//!
//! The significance level of 5 % is divided between the branches in proportion to their weights. A test below another
//! one starts only after that one is rejected, and inherits its share. Single levels can therefore be tested after
//! their mean, one after the other, at no additional cost. When all tests of a branch are rejected, its share goes to
//! its sibling branches. If all tests are leaves of equal weight, this is Holm's procedure (Holm 1979, Scand. J. Stat.
//! 6:65); a single chain of tests is a fixed sequence.
//!
//! Shares never shrink while tests are rejected, and never add up to more than 1. The probability that any true
//! hypothesis is rejected is therefore at most 5 %, whichever others are false and however the tests depend on each
//! other (Goeman and Solari 2010, Ann. Stat. 38:3782, theorem 1; Goeman and Finos 2012, Stat. Appl. Genet. Mol. Biol.
//! 11(1):11, for trees; Bretz, Maurer, Brannath and Posch 2009, Stat. Med. 28:586, for weights that pass from test to
//! test).

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::answers::confusion::{AgainstClean, Confusion, FalseAnswer};
use super::calibration::MIN_CONFIDENT_REPLIES;
use super::choice::ParsingMode;
use super::cluster::MIN_CLUSTERS;
use super::comparisons::{ComparisonKind, PooledFinding, PooledKind};
use super::findings::Findings;
use super::grid::Grid;
use super::model_in_condition::{ModelInCondition, models_under_test};
use super::significance::ALPHA;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{EnhancerName, Variant};

/// A test, with the index of its finding if several exist.
#[derive(Debug, Clone, Copy)]
enum Test {
    /// One level, pooled over models.
    Pooled(usize),
    /// Mean of several levels, pooled over models.
    Averaged(usize),
    Comparison(usize),
    /// The leading model in the dark is the best.
    Best,
    /// The leading model in the dark is above what it reaches without seeing.
    Sees,
    /// The leader at the lighter levels and the leader in the dark differ at a level, by its index.
    Lead(usize),
    /// One family loses more than another.
    Families(usize),
    /// Answer collapse.
    Collapse(usize),
    /// Confidence exceeds accuracy.
    Overconfident(usize),
    /// Overconfidence is larger than at L0.
    Growth(usize),
    /// PSNR separates right from wrong answers.
    Fidelity,
}

/// Weight of each main question: the cost of darkness, the effect of each enhancer, the best model, and photographs in
/// the dark.
const MAIN: f64 = 1.0;

/// Weight of the noise tests, if the run has noise as well as the exposure drop.
const NOISE: f64 = 0.5;

/// Weight of all other questions together. They concern how accuracy is lost, not how much.
const FURTHER: f64 = 0.5;

/// Weight of a secondary variant relative to a main one (1). Sentences name it only if its result differs from that of
/// the main one.
const OTHER_VARIANT: f64 = 0.25;

type Tests = TestTree<Test>;

/// Contents of a run that determine how the significance level is divided between its tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunContents {
    pub models: usize,
    pub enhancers: usize,
    /// Number of variants of the last degradation kind: the noise profiles, if the run has noise.
    pub lights: usize,
    /// True if the run has noise as well as the exposure drop.
    pub has_noise: bool,
}

impl RunContents {
    /// Verdict level of the first test of an enhancer at the darker levels of one variant; without enhancers, of
    /// the first test of the cost of darkness. Later tests of the same question have this level or a larger one.
    #[must_use]
    pub fn first_significance_level(self) -> f64 {
        let rank = u32::from(self.models > 1);
        let main = MAIN * f64::from(1 + rank + self.enhancers as u32);
        let noise = if self.has_noise { NOISE } else { 0.0 };
        let share = ALPHA * MAIN / (main + noise + FURTHER) / self.lights.max(1) as f64;
        if self.enhancers > 0 {
            // An enhancer has a branch for the darker levels and one for the lighter ones.
            share / 2.0
        } else {
            share
        }
    }
}

impl Findings<'_> {
    /// Corrects the p-values of all tests behind sentences, separately for each parsing of the replies.
    pub(super) fn correct_sentences(&mut self) {
        let tree = report_tests(self);
        for mode in ParsingMode::ALL {
            for (test, corrected) in adjust_p_values(&tree, |test| test.p_values(self, mode).map_or(1.0, |(p, _)| p)) {
                if let Some((_, p_report)) = test.p_values(self, mode).filter(|_| test.is_in(mode)) {
                    *p_report = Some(corrected);
                }
            }
        }
        self.tests = tree.count();
        self.correct_comparisons_of_one_model();
    }

    /// Copies the corrected p-values of the pooled findings about a single model to the comparisons of the same two
    /// sides: a sentence about one is about the other.
    fn correct_comparisons_of_one_model(&mut self) {
        let mut corrected = HashMap::new();
        for finding in &self.pooled {
            let [model] = &finding.models[..] else {
                continue;
            };
            let kind = match finding.kind {
                PooledKind::Darkness => ComparisonKind::Level,
                PooledKind::Noise => ComparisonKind::Variant,
                PooledKind::Enhancer => ComparisonKind::Enhancer,
                PooledKind::Blind if finding.blind_models == [model.clone()] => ComparisonKind::Blind,
                PooledKind::EnhancerPair | PooledKind::Blind | PooledKind::Hallucination(_) => {
                    continue;
                }
            };
            if finding.family.is_none() {
                let sides = (kind, &**model, finding.level, &finding.variant, &finding.enhancer);
                let p = [finding.strict.tested.p_report, finding.lenient.tested.p_report];
                corrected.insert(sides, p);
            }
        }
        for comparison in &mut self.comparisons {
            let first = &comparison.first;
            let Some(level) = first.level else {
                continue;
            };
            let is_own = comparison.second.model == first.model && comparison.family.is_none();
            let sides = (comparison.kind, &*first.model, level, &first.variant, &first.enhancer);
            if let Some([strict, lenient]) = corrected.get(&sides).filter(|_| is_own) {
                comparison.strict.tested.p_report = *strict;
                comparison.lenient.tested.p_report = *lenient;
            }
        }
    }
}

/// Tree of all tests of a report. It depends on the questions asked, never on the answers.
fn report_tests(findings: &Findings<'_>) -> Tests {
    let sets = pooled_sets(findings);
    let enhancers: BTreeSet<&EnhancerName> = sets.iter().filter_map(|set| set.enhancer).collect();
    let best = findings.best.as_ref().filter(|best| best.is_possible()).map(|best| {
        let levels = 0..best.lighter.len() + best.levels.len();
        [
            TestTree::chain([Test::Best, Test::Sees].into_iter()),
            TestTree::group(levels.map(|level| TestTree::leaf(Test::Lead(level)))),
        ]
    });
    let fidelity = findings.fidelity.as_ref().filter(|fidelity| fidelity.within[0].is_some());
    let further = [
        kind_tests(findings, &sets, PooledKind::Blind),
        below_blind(findings),
        kind_tests(findings, &sets, PooledKind::Hallucination(FalseAnswer::No)),
        kind_tests(findings, &sets, PooledKind::Hallucination(FalseAnswer::Yes)),
        collapses(findings),
        confidence(findings),
        families(findings),
        TestTree::group(fidelity.map(|_| TestTree::leaf(Test::Fidelity))),
    ];
    let main = [kind_tests(findings, &sets, PooledKind::Darkness)]
        .into_iter()
        .chain(enhancers.into_iter().map(|name| {
            let own = sets.iter().filter(|set| set.enhancer == Some(name));
            TestTree::group(own.map(|set| set.tests(findings)))
        }))
        .chain([TestTree::group(best.into_iter().flatten())])
        .chain(photographs(findings));
    TestTree::group(main.map(|branch| branch.with_weight(MAIN)).chain([
        kind_tests(findings, &sets, PooledKind::Noise).with_weight(NOISE),
        TestTree::group(further).with_weight(FURTHER),
    ]))
}

/// Tests of the difference between two families, one per main variant.
fn families(findings: &Findings<'_>) -> Tests {
    let contrasts = findings.contrasts.iter().enumerate();
    let main = contrasts.filter(|(_, found)| is_main(&findings.grid, &found.variant));
    TestTree::group(main.map(|(index, _)| TestTree::leaf(Test::Families(index))))
}

/// Tests of the sets of one kind.
fn kind_tests(findings: &Findings<'_>, sets: &[PooledSet<'_>], kind: PooledKind) -> Tests {
    let own = sets.iter().filter(|set| set.kind == kind);
    TestTree::group(own.map(|set| set.tests(findings)))
}

/// True for a main variant: it has the last degradation kind of its root, or no kind. Sentences about all other
/// variants are limited to the cost of darkness.
fn is_main(grid: &Grid<'_>, variant: &Variant) -> bool {
    let root = variant.kind.map(Kind::root);
    let last = grid.variants().into_iter().map(|other| other.kind).filter(|kind| kind.map(Kind::root) == root).max();
    variant.kind.is_none() || last == Some(variant.kind)
}

/// Pooled findings of one kind, variant and enhancer.
struct PooledSet<'f> {
    kind: PooledKind,
    variant: &'f Variant,
    enhancer: Option<&'f EnhancerName>,
    /// Finding of each level with its index, in ascending order of levels.
    levels: Vec<(usize, &'f PooledFinding)>,
}

/// Sets of pooled findings that sentences report, if a verdict is possible at one of their levels.
fn pooled_sets<'f>(findings: &'f Findings<'_>) -> Vec<PooledSet<'f>> {
    let mut sets: Vec<PooledSet<'f>> = Vec::new();
    for (index, finding) in findings.pooled.iter().enumerate() {
        // No sentence is about two enhancers.
        if finding.family.as_ref() != finding.kind.only_family() || finding.kind == PooledKind::EnhancerPair {
            continue;
        }
        let (kind, variant, enhancer) = (finding.kind, &finding.variant, finding.enhancer.as_ref());
        let known = sets.iter_mut().find(|set| (set.kind, set.variant, set.enhancer) == (kind, variant, enhancer));
        match known {
            Some(set) => set.levels.push((index, finding)),
            None => sets.push(PooledSet { kind, variant, enhancer, levels: vec![(index, finding)] }),
        }
    }
    sets.retain(|set| {
        let mut levels = set.levels.iter();
        (set.kind == PooledKind::Darkness || is_main(&findings.grid, set.variant))
            && levels.any(|(_, finding)| finding.strict.tested.verdict.is_possible())
    });
    sets
}

impl PooledSet<'_> {
    /// Tree of the tests of the set. Single levels come after their mean: the severe ones from the darkest level, the
    /// mild ones from the brightest. If the effect grows with the level, all levels come after the means, from the
    /// darkest one.
    fn tests(&self, findings: &Findings<'_>) -> Tests {
        let weight = if is_main(&findings.grid, self.variant) { 1.0 } else { OTHER_VARIANT };
        let averaged: Vec<(usize, &PooledFinding)> = findings
            .averaged
            .iter()
            .enumerate()
            .filter(|(_, mean)| {
                mean.kind == self.kind && mean.variant == *self.variant && mean.enhancer.as_ref() == self.enhancer
            })
            .collect();
        if self.kind.grows_with_the_level() {
            let means = averaged.iter().map(|(index, _)| Test::Averaged(*index));
            let levels = self.levels.iter().map(|(index, _)| Test::Pooled(*index));
            return TestTree::chain(means.chain(levels.rev())).with_weight(weight);
        }
        let branches = [true, false].map(|is_severe| {
            let mean = averaged
                .iter()
                .find(|(_, mean)| mean.is_severe() == is_severe)
                .map(|(index, _)| Test::Averaged(*index));
            let mut levels: Vec<Test> = self
                .levels
                .iter()
                .filter(|(_, finding)| finding.is_severe() == is_severe)
                .map(|(index, _)| Test::Pooled(*index))
                .collect();
            if is_severe {
                levels.reverse();
            }
            match mean {
                Some(mean) => TestTree::chain([mean].into_iter().chain(levels)),
                None => TestTree::group(levels.into_iter().map(TestTree::leaf)),
            }
        });
        TestTree::group(branches).with_weight(weight)
    }
}

/// Comparisons of each family and model with the blind baseline, in order from the darkest level. If several models are
/// pooled, each is also compared over all families.
fn below_blind(findings: &Findings<'_>) -> Tests {
    let mut chains = BTreeMap::<_, Vec<Test>>::new();
    for (index, comparison) in findings.comparisons.iter().enumerate() {
        let (first, second) = (&comparison.first, &comparison.second);
        if findings.is_tested_against_blind(comparison)
            && is_main(&findings.grid, &first.variant)
            && comparison.strict.tested.verdict.is_possible()
        {
            let key = (&first.model, &second.model, &comparison.family, &first.variant);
            chains.entry(key).or_default().push(Test::Comparison(index));
        }
    }
    TestTree::group(chains.into_values().map(|tests| TestTree::chain(tests.into_iter().rev())))
}

/// Tests on dark photographs: the cost of darkness, the difference from synthetic images, and the effect of enhancers.
fn photographs(findings: &Findings<'_>) -> Vec<Tests> {
    let models = models_under_test(findings.grid.subjects.iter().map(|subject| &*subject.model));
    let kinds = [ComparisonKind::Level, ComparisonKind::RealSynthetic, ComparisonKind::RealEnhanced];
    kinds
        .map(|kind| {
            TestTree::group(
                findings
                    .comparisons
                    .iter()
                    .enumerate()
                    .filter(|(_, comparison)| {
                        let first = &comparison.first;
                        comparison.kind == kind
                            && comparison.family.is_none()
                            && first.variant.photograph().is_some()
                            && (first.enhancer.is_none() || kind == ComparisonKind::RealEnhanced)
                            && models.contains(&*first.model)
                            && comparison.strict.tested.verdict.is_possible()
                    })
                    .map(|(index, _)| TestTree::leaf(Test::Comparison(index))),
            )
        })
        .into()
}

/// Subjects with raw images at the darkest level of each main variant, limited to the models that findings are pooled
/// over.
fn darkest<'f>(findings: &'f Findings<'_>) -> Vec<&'f ModelInCondition> {
    let grid = &findings.grid;
    let raw: Vec<&ModelInCondition> = grid
        .subjects
        .iter()
        .filter(|subject| {
            subject.enhancer.is_none()
                && subject.variant.kind.is_some()
                && is_main(grid, &subject.variant)
                && findings.models_of(&subject.variant).contains(&&*subject.model)
        })
        .collect();
    raw.iter()
        .copied()
        .filter(|subject| {
            let darkest =
                raw.iter().filter(|other| other.variant == subject.variant).filter_map(|other| other.level).max();
            subject.level == darkest
        })
        .collect()
}

/// Tests of answer collapse, one per model and family.
fn collapses(findings: &Findings<'_>) -> Tests {
    let darkest = darkest(findings);
    TestTree::group(
        findings
            .confusions
            .iter()
            .enumerate()
            .filter(|(_, confusion)| darkest.contains(&&confusion.subject) && against_clean(confusion).is_some())
            .map(|(index, _)| TestTree::leaf(Test::Collapse(index))),
    )
}

/// Comparison of a subject's most common answer with L0, if one was computed.
fn against_clean(confusion: &Confusion) -> Option<&AgainstClean> {
    confusion.collapse.as_ref()?.clean.as_ref()
}

/// Tests of each model's confidence: overconfidence, then its growth since L0.
fn confidence(findings: &Findings<'_>) -> Tests {
    if findings.grid.clusters < MIN_CLUSTERS {
        return TestTree::group([]);
    }
    let darkest = darkest(findings);
    let tested = findings
        .calibrations
        .iter()
        .enumerate()
        .filter(|(_, row)| row.replies >= MIN_CONFIDENT_REPLIES && darkest.contains(&&row.subject));
    TestTree::group(tested.map(|(index, row)| {
        let grown = row.growth.map(|_| TestTree::leaf(Test::Growth(index)));
        TestTree::with_branches(Test::Overconfident(index), grown.into_iter().collect())
    }))
}

impl Test {
    /// p-value before correction in a parsing, and the place for the corrected one; `None` if the test was not computed.
    /// Confidence and fidelity exist only in strict parsing.
    fn p_values<'f>(self, findings: &'f mut Findings<'_>, mode: ParsingMode) -> Option<(f64, &'f mut Option<f64>)> {
        let best = mode.of([&mut findings.best, &mut findings.lenient_best]).as_mut();
        let tested = match self {
            Self::Pooled(index) => &mut findings.pooled[index].parsed_mut(mode).tested,
            Self::Averaged(index) => &mut findings.averaged[index].parsed_mut(mode).tested,
            Self::Comparison(index) => &mut findings.comparisons[index].parsed_mut(mode).tested,
            Self::Sees => &mut best?.gain.tested,
            Self::Lead(level) => &mut best?.crossing.as_mut()?.levels.get_mut(level)?.tested,
            Self::Families(index) => findings.contrasts[index].parsed_mut(mode),
            Self::Overconfident(index) => &mut findings.calibrations[index].overconfidence,
            Self::Growth(index) => findings.calibrations[index].growth.as_mut()?,
            // The largest p-value of the leader's pairs, that of an AUC, and that of the most common answer.
            Self::Best => {
                let best = best?;
                return Some((best.p_leader(), &mut best.p_report));
            }
            Self::Fidelity => {
                let fidelity = findings.fidelity.as_mut()?;
                return Some((fidelity.within[0]?.p, &mut fidelity.p_report));
            }
            Self::Collapse(index) => {
                let clean = findings.confusions[index].collapse.as_mut()?.clean.as_mut()?;
                return Some((clean.p(mode), &mut clean.parsed_mut(mode).tested.p_report));
            }
        };
        Some((tested.p, &mut tested.p_report))
    }

    /// True if the test exists in a parsing. The p-value of one that exists in the strict parsing alone counts in both.
    fn is_in(self, mode: ParsingMode) -> bool {
        mode == ParsingMode::Strict || !matches!(self, Self::Overconfident(_) | Self::Growth(_) | Self::Fidelity)
    }
}

/// A test and the branches that start after its rejection, or a group of branches that start together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TestTree<T> {
    /// The test; `None` for a group.
    test: Option<T>,
    /// Share of the level, relative to the weights of the sibling branches.
    weight: f64,
    branches: Vec<Self>,
}

impl<T> TestTree<T> {
    /// Creates a single test.
    pub(super) fn leaf(test: T) -> Self {
        Self::with_branches(test, Vec::new())
    }

    /// Creates a test with branches that start once it is rejected.
    pub(super) fn with_branches(test: T, branches: Vec<Self>) -> Self {
        Self { test: Some(test), weight: 1.0, branches }
    }

    /// Creates a group of branches that start together; branches without a test are left out.
    pub(super) fn group(branches: impl IntoIterator<Item = Self>) -> Self {
        Self { test: None, weight: 1.0, branches: branches.into_iter().filter(|branch| !branch.is_empty()).collect() }
    }

    /// Creates a chain of tests: each starts once the previous one is rejected.
    pub(super) fn chain(tests: impl DoubleEndedIterator<Item = T>) -> Self {
        tests
            .rev()
            .fold(None, |below, test| Some(Self::with_branches(test, below.into_iter().collect())))
            .unwrap_or_else(|| Self::group([]))
    }

    /// Returns the branch with this weight.
    pub(super) fn with_weight(self, weight: f64) -> Self {
        Self { weight, ..self }
    }

    /// True if there is no test.
    pub(super) fn is_empty(&self) -> bool {
        self.test.is_none() && self.branches.iter().all(Self::is_empty)
    }

    /// Number of tests.
    pub(super) fn count(&self) -> usize {
        let own = usize::from(self.test.is_some());
        own + self.branches.iter().map(Self::count).sum::<usize>()
    }
}

/// A branch of the tree during the procedure.
struct Branch<T> {
    /// Test with its p-value; `None` for a group.
    test: Option<(T, f64)>,
    /// Corrected p-value; `None` until the test is rejected.
    rejected: Option<f64>,
    weight: f64,
    branches: Vec<Self>,
    /// Number of tests that are not yet rejected, including those below.
    remaining: usize,
}

impl<T: Copy> Branch<T> {
    fn new(tree: &TestTree<T>, p: &mut impl FnMut(T) -> f64) -> Self {
        Self {
            test: tree.test.map(|test| (test, p(test))),
            rejected: None,
            weight: tree.weight,
            branches: tree.branches.iter().map(|branch| Self::new(branch, p)).collect(),
            remaining: tree.count(),
        }
    }

    /// Finds the started test with the smallest ratio of its p-value to its share of the level; `share` is the share of
    /// this branch. Returns the ratio and appends the indices of the branches that lead to the test to `path`.
    fn next(&self, share: f64, path: &mut Vec<usize>) -> Option<f64> {
        if let (Some((_, p)), None) = (self.test, self.rejected) {
            return Some(p / share);
        }
        let weights: f64 = self.unfinished().map(|(_, branch)| branch.weight).sum();
        let mut best: Option<(f64, Vec<usize>)> = None;
        for (index, branch) in self.unfinished() {
            let mut below = vec![index];
            if let Some(ratio) = branch.next(share * branch.weight / weights, &mut below)
                && best.as_ref().is_none_or(|(smallest, _)| ratio < *smallest)
            {
                best = Some((ratio, below));
            }
        }
        let (smallest, below) = best?;
        path.extend(below);
        Some(smallest)
    }

    /// Branches with tests that are not yet rejected, by index.
    fn unfinished(&self) -> impl Iterator<Item = (usize, &Self)> {
        self.branches.iter().enumerate().filter(|(_, branch)| branch.remaining > 0)
    }

    /// Rejects the test at the end of a path.
    fn reject(&mut self, path: &[usize], p: f64) {
        self.remaining -= 1;
        match path {
            [] => self.rejected = Some(p),
            [index, rest @ ..] => self.branches[*index].reject(rest, p),
        }
    }

    /// Collects the tests with their corrected p-values, each before the tests below it.
    fn collect_corrected(&self, corrected: &mut Vec<(T, f64)>) {
        if let Some((test, _)) = self.test {
            corrected.push((test, self.rejected.unwrap_or(1.0)));
        }
        for branch in &self.branches {
            branch.collect_corrected(corrected);
        }
    }
}

/// Returns all tests with their corrected p-values; `p` gives the p-value of a test. Tests with a corrected p-value
/// below 0.05 are rejected.
#[must_use]
pub(super) fn adjust_p_values<T: Copy>(tree: &TestTree<T>, mut p: impl FnMut(T) -> f64) -> Vec<(T, f64)> {
    let mut root = Branch::new(tree, &mut p);
    let mut highest = 0.0_f64;
    let mut path = Vec::new();
    while let Some(ratio) = root.next(1.0, &mut path) {
        highest = highest.max(ratio).min(1.0);
        root.reject(&path, highest);
        path.clear();
    }
    let mut corrected = Vec::new();
    root.collect_corrected(&mut corrected);
    corrected
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::significance::holm;

    /// Corrected p-values of tests, each represented by its p-value.
    fn corrected(tree: &TestTree<f64>) -> Vec<f64> {
        adjust_p_values(tree, |p| p).into_iter().map(|(_, p)| (p * 1e9).round() / 1e9).collect()
    }

    fn leaves(values: &[f64]) -> TestTree<f64> {
        TestTree::group(values.iter().copied().map(TestTree::leaf))
    }

    #[test]
    fn equal_leaves_follow_holms_procedure() {
        let values = [0.01, 0.04, 0.03, 0.005, 0.6, 0.0001, 0.03, 1.0];
        for (found, expected) in corrected(&leaves(&values)).iter().zip(holm(&values)) {
            assert!((found - expected).abs() < 1e-8);
        }
        assert_eq!(corrected(&leaves(&[])), Vec::<f64>::new());
    }

    #[test]
    fn a_chain_costs_its_first_test_and_stops_at_a_failure() {
        let chain = TestTree::chain([0.01, 0.02, 0.3, 0.001].into_iter());
        let found = corrected(&TestTree::group([chain, TestTree::leaf(0.5)]));
        // Each branch has half of the level until the other one is finished.
        assert_eq!(found, [0.02, 0.04, 0.6, 0.6, 0.6]);
    }

    #[test]
    fn branches_start_after_the_test_before_them_and_share_its_level() {
        let tree = TestTree::with_branches(0.04, vec![TestTree::leaf(0.02), TestTree::leaf(0.03)]);
        assert_eq!(corrected(&tree), [0.04, 0.04, 0.04]);
        let stopped = TestTree::with_branches(0.2, vec![TestTree::leaf(0.001)]);
        assert_eq!(corrected(&stopped), [0.2, 0.2]);
    }

    #[test]
    fn finished_branch_passes_its_share_to_siblings() {
        let found = corrected(&TestTree::group([leaves(&[0.001, 0.002]), TestTree::leaf(0.03)]));
        // 0.001 · 2 · 2, then 0.002 · 2, then 0.03 alone.
        assert_eq!(found, [0.004, 0.004, 0.03]);
    }

    #[test]
    fn weights_share_the_level() {
        let heavy = TestTree::leaf(0.03).with_weight(3.0);
        let found = corrected(&TestTree::group([heavy, TestTree::leaf(0.04), leaves(&[])]));
        assert_eq!(found, [0.04, 0.04]);
        let found = corrected(&TestTree::group([TestTree::leaf(0.01), TestTree::leaf(0.5).with_weight(3.0)]));
        assert_eq!(found, [0.04, 0.5]);
    }

    #[test]
    fn independent_null_tests_reject_any_in_five_percent() {
        use rand::rngs::StdRng;
        use rand::{RngExt as _, SeedableRng as _};
        let mut random = StdRng::seed_from_u64(7);
        let runs = 4000;
        let share = (0..runs)
            .filter(|_| {
                let p: [f64; 6] = std::array::from_fn(|_| random.random_range(0.0..1.0));
                let tree = TestTree::group([
                    TestTree::with_branches(p[0], vec![TestTree::chain([p[1], p[2]].into_iter())]),
                    TestTree::leaf(p[3]).with_weight(0.25),
                    TestTree::group([TestTree::leaf(p[4]), TestTree::leaf(p[5])]),
                ]);
                adjust_p_values(&tree, |p| p).iter().any(|(_, p)| *p < 0.05)
            })
            .count() as f64
            / f64::from(runs);
        assert!((0.035..0.055).contains(&share), "{share}");
    }
}
