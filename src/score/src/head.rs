//! One correction over all tests that a report's sentences rest on: [`adjusted`].
//!
//! A report asks several questions at once: what darkness costs, what noise adds, what each enhancer does, and others. Each has a
//! [`QuestionTests`]. The level of 5 % is shared equally by the questions, and the share of a question equally by its chains of tests. A
//! chain is tested in a fixed order, the next test only after the one before is rejected; so it costs no more than its first test. When
//! all tests of a chain are rejected, its share goes to the other chains of its question, and that of a finished question to the other
//! questions. Where each chain has one test and there is one question, this is Holm's procedure (Holm 1979, Scand. J. Stat. 6:65).
//!
//! Shares never shrink while tests are rejected and never add up to more than 1. Therefore the probability that any true hypothesis is
//! rejected is at most 5 %, whichever others are false and however the tests depend on each other (Bretz, Maurer, Brannath and Posch
//! 2009, Stat. Med. 28:586; Goeman and Solari 2010, Ann. Stat. 38:3782, theorem 1).

/// The p-values of one question: chains, each in its order.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct QuestionTests {
    pub(super) chains: Vec<Vec<f64>>,
}

impl QuestionTests {
    /// Tests in no order: a chain for each.
    pub(super) fn unordered(values: impl IntoIterator<Item = f64>) -> Self {
        let chains = values.into_iter().map(|value| vec![value]);
        Self {
            chains: chains.collect(),
        }
    }
}

/// The chains of a question while tests are rejected.
struct Progress<'q> {
    chains: &'q [Vec<f64>],
    /// Number of rejected tests of each chain.
    rejected: Vec<usize>,
}

impl Progress<'_> {
    /// The unfinished chains, each with the p-value of its next test.
    fn next_tests(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let chains = self.chains.iter().zip(&self.rejected).enumerate();
        chains.filter_map(|(chain, (values, rejected))| Some((chain, *values.get(*rejected)?)))
    }
}

/// The adjusted p-values of all tests, in the order of questions, chains and tests. Those below 0.05 are the rejected ones.
#[must_use]
pub(super) fn adjusted(questions: &[QuestionTests]) -> Vec<QuestionTests> {
    let mut all: Vec<Progress<'_>> = questions
        .iter()
        .map(|question| Progress {
            chains: &question.chains,
            rejected: vec![0; question.chains.len()],
        })
        .collect();
    let mut adjusted = questions.to_vec();
    let mut highest = 0.0_f64;
    loop {
        let unfinished = all
            .iter()
            .filter(|question| question.next_tests().next().is_some());
        let questions = unfinished.count() as f64;
        let candidates = all.iter().enumerate().flat_map(|(number, question)| {
            let tests = question.next_tests();
            let chains = tests.clone().count() as f64;
            tests.map(move |(chain, value)| (number, chain, value * chains * questions))
        });
        let Some((question, chain, value)) = candidates.min_by(|a, b| a.2.total_cmp(&b.2)) else {
            return adjusted;
        };
        highest = highest.max(value).min(1.0);
        let place = &mut all[question].rejected[chain];
        adjusted[question].chains[chain][*place] = highest;
        *place += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::significance::holm;
    use super::*;

    #[test]
    fn one_question_without_an_order_is_holms_procedure() {
        let values = [0.01, 0.04, 0.03, 0.005, 0.6, 0.0001, 0.03, 1.0];
        let found = adjusted(&[QuestionTests::unordered(values)]);
        let found: Vec<f64> = found[0].chains.iter().flatten().copied().collect();
        for (found, expected) in found.iter().zip(holm(&values)) {
            assert!((found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_chain_costs_its_first_test_and_stops_at_a_failure() {
        let chain = QuestionTests {
            chains: vec![vec![0.01, 0.02, 0.3, 0.001]],
        };
        let other = QuestionTests::unordered([0.5]);
        let found = adjusted(&[chain.clone(), other]);
        // Two questions: each has half of the level.
        let [first, second, third, fourth] = found[0].chains[0][..] else {
            panic!("{found:?}");
        };
        assert!((first - 0.02).abs() < 1e-12 && (second - 0.04).abs() < 1e-12);
        assert!((third - 0.6).abs() < 1e-12 && (fourth - 0.6).abs() < 1e-12);
        assert!((found[1].chains[0][0] - 0.6).abs() < 1e-12);
        assert_eq!(adjusted(&[]), []);
    }

    #[test]
    fn a_finished_question_leaves_its_share_to_the_others() {
        let found = adjusted(&[
            QuestionTests::unordered([0.001, 0.002]),
            QuestionTests::unordered([0.03]),
        ]);
        // 0.001 · 2 · 2, then 0.002 · 2, then 0.03 alone.
        assert_eq!(found[0].chains, [[0.004], [0.004]]);
        assert_eq!(found[1].chains, [[0.03]]);
    }
}
