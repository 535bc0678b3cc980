//! One correction over all tests that a report's sentences rest on: [`adjusted`].
//!
//! The tests are a tree. The level of 5 % is shared by the branches in proportion to their weights. A test that depends on another one
//! starts only after that one is rejected, and takes over its share: so a finding about several levels together costs nothing more if the
//! single levels are tested below it, each after the one before. When all tests of a branch are rejected, its share goes to the
//! branches beside it. Where all tests are leaves of one weight, this is Holm's procedure (Holm 1979, Scand. J. Stat. 6:65); a single
//! branch of tests below each other is a fixed sequence.
//!
//! Shares never shrink while tests are rejected and never add up to more than 1. Therefore the probability that any true hypothesis is
//! rejected is at most 5 %, whichever others are false and however the tests depend on each other (Goeman and Solari 2010, Ann. Stat.
//! 38:3782, theorem 1; Goeman and Finos 2012, Stat. Appl. Genet. Mol. Biol. 11(1):11, for trees; Bretz, Maurer, Brannath and Posch 2009,
//! Stat. Med. 28:586, for weights that pass from test to test).

/// A test with the tests that start after it, or a group of tests that start together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TestTree<T> {
    /// The test before the others; `None` for a group.
    test: Option<T>,
    /// Share of the level beside the other branches, in any unit.
    weight: f64,
    branches: Vec<Self>,
}

impl<T> TestTree<T> {
    /// A test alone.
    pub(super) fn leaf(test: T) -> Self {
        Self::before(test, Vec::new())
    }

    /// A test, and the branches that start once it is rejected.
    pub(super) fn before(test: T, branches: Vec<Self>) -> Self {
        Self {
            test: Some(test),
            weight: 1.0,
            branches,
        }
    }

    /// Branches that start together. Those without a test are left out.
    pub(super) fn group(branches: impl IntoIterator<Item = Self>) -> Self {
        let branches = branches.into_iter().filter(|branch| !branch.is_empty());
        Self {
            test: None,
            weight: 1.0,
            branches: branches.collect(),
        }
    }

    /// A chain of tests: each starts once the one before is rejected.
    pub(super) fn chain(tests: impl DoubleEndedIterator<Item = T>) -> Self {
        let below = tests.rev().fold(None, |below, test| {
            Some(Self::before(test, below.into_iter().collect()))
        });
        below.unwrap_or_else(|| Self::group([]))
    }

    /// The same branch with this weight.
    pub(super) fn weighing(self, weight: f64) -> Self {
        Self { weight, ..self }
    }

    /// True without any test.
    pub(super) fn is_empty(&self) -> bool {
        self.test.is_none() && self.branches.iter().all(Self::is_empty)
    }

    /// Number of tests.
    pub(super) fn count(&self) -> usize {
        let own = usize::from(self.test.is_some());
        own + self.branches.iter().map(Self::count).sum::<usize>()
    }
}

/// A branch while tests are rejected.
struct Branch<T> {
    /// The test with its p-value; `None` for a group.
    test: Option<(T, f64)>,
    /// p-value after correction; `None` until the test is rejected.
    rejected: Option<f64>,
    weight: f64,
    branches: Vec<Self>,
    /// Number of tests that are not rejected, with those below.
    remaining: usize,
}

impl<T: Copy> Branch<T> {
    fn new(tree: &TestTree<T>, p: &impl Fn(T) -> f64) -> Self {
        Self {
            test: tree.test.map(|test| (test, p(test))),
            rejected: None,
            weight: tree.weight,
            branches: tree
                .branches
                .iter()
                .map(|branch| Self::new(branch, p))
                .collect(),
            remaining: tree.count(),
        }
    }

    /// The test that has started, with a share of the level of `share` for this branch, and has the smallest p-value over its own
    /// share: that ratio, and the places of the branches on the way to it.
    fn next(&self, share: f64, way: &mut Vec<usize>) -> Option<f64> {
        if let (Some((_, p)), None) = (self.test, self.rejected) {
            return Some(p / share);
        }
        let weights: f64 = self.open().map(|(_, branch)| branch.weight).sum();
        let mut best: Option<(f64, Vec<usize>)> = None;
        for (place, branch) in self.open() {
            let mut below = vec![place];
            let found = branch.next(share * branch.weight / weights, &mut below);
            if let Some(found) = found
                && best.as_ref().is_none_or(|(least, _)| found < *least)
            {
                best = Some((found, below));
            }
        }
        let (least, below) = best?;
        way.extend(below);
        Some(least)
    }

    /// The branches with tests that are not rejected.
    fn open(&self) -> impl Iterator<Item = (usize, &Self)> {
        self.branches
            .iter()
            .enumerate()
            .filter(|(_, branch)| branch.remaining > 0)
    }

    /// Rejects the test at the end of a way.
    fn reject(&mut self, way: &[usize], p: f64) {
        self.remaining -= 1;
        match way {
            [] => self.rejected = Some(p),
            [place, rest @ ..] => self.branches[*place].reject(rest, p),
        }
    }

    /// The tests with their p-values after correction, those before others first.
    fn corrected(&self, corrected: &mut Vec<(T, f64)>) {
        if let Some((test, _)) = self.test {
            corrected.push((test, self.rejected.unwrap_or(1.0)));
        }
        for branch in &self.branches {
            branch.corrected(corrected);
        }
    }
}

/// All tests with their p-values after correction, by their p-values before. Those below 0.05 are the rejected ones.
#[must_use]
pub(super) fn adjusted<T: Copy>(tree: &TestTree<T>, p: impl Fn(T) -> f64) -> Vec<(T, f64)> {
    let mut root = Branch::new(tree, &p);
    let mut highest = 0.0_f64;
    let mut way = Vec::new();
    while let Some(value) = root.next(1.0, &mut way) {
        highest = highest.max(value).min(1.0);
        root.reject(&way, highest);
        way.clear();
    }
    let mut corrected = Vec::new();
    root.corrected(&mut corrected);
    corrected
}

#[cfg(test)]
mod tests {
    use super::super::significance::holm;
    use super::*;

    /// The p-values after correction of tests that are their own p-values.
    fn corrected(tree: &TestTree<f64>) -> Vec<f64> {
        adjusted(tree, |p| p)
            .into_iter()
            .map(|(_, p)| (p * 1e9).round() / 1e9)
            .collect()
    }

    fn leaves(values: &[f64]) -> TestTree<f64> {
        TestTree::group(values.iter().copied().map(TestTree::leaf))
    }

    #[test]
    fn leaves_of_one_weight_are_holms_procedure() {
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
        let tree = TestTree::before(0.04, vec![TestTree::leaf(0.02), TestTree::leaf(0.03)]);
        assert_eq!(corrected(&tree), [0.04, 0.04, 0.04]);
        let stopped = TestTree::before(0.2, vec![TestTree::leaf(0.001)]);
        assert_eq!(corrected(&stopped), [0.2, 0.2]);
    }

    #[test]
    fn a_finished_branch_leaves_its_share_to_those_beside_it() {
        let found = corrected(&TestTree::group([
            leaves(&[0.001, 0.002]),
            TestTree::leaf(0.03),
        ]));
        // 0.001 · 2 · 2, then 0.002 · 2, then 0.03 alone.
        assert_eq!(found, [0.004, 0.004, 0.03]);
    }

    #[test]
    fn weights_share_the_level() {
        let heavy = TestTree::leaf(0.03).weighing(3.0);
        let found = corrected(&TestTree::group([heavy, TestTree::leaf(0.04), leaves(&[])]));
        assert_eq!(found, [0.04, 0.04]);
        let found = corrected(&TestTree::group([
            TestTree::leaf(0.01),
            TestTree::leaf(0.5).weighing(3.0),
        ]));
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
                let mut p = || random.random_range(0.0..1.0);
                let set = TestTree::before(p(), vec![TestTree::chain([p(), p()].into_iter())]);
                let tree = TestTree::group([
                    set,
                    TestTree::leaf(p()).weighing(0.25),
                    TestTree::group([TestTree::leaf(p()), TestTree::leaf(p())]),
                ]);
                adjusted(&tree, |p| p).iter().any(|(_, p)| *p < 0.05)
            })
            .count() as f64
            / f64::from(runs);
        assert!((0.035..0.055).contains(&share), "{share}");
    }
}
