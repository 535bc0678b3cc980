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
    fn new(tree: &TestTree<T>, p: &impl Fn(T) -> f64) -> Self {
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
pub(super) fn adjust_p_values<T: Copy>(tree: &TestTree<T>, p: impl Fn(T) -> f64) -> Vec<(T, f64)> {
    let mut root = Branch::new(tree, &p);
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
    use super::super::significance::holm;
    use super::*;

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
