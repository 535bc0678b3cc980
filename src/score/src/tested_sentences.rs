//! The tests that the sentences of a report rest on, corrected together: [`Findings::correct_sentences`].

use std::collections::BTreeMap;

use super::best::BestInTheDark;
use super::calibration::LEAST_CONFIDENT_REPLIES;
use super::choice::ReadingMode;
use super::cluster::MIN_SCENES;
use super::comparison::{Comparison, ComparisonKind};
use super::confusion::{AgainstClean, Confusion};
use super::findings::Findings;
use super::grid::Grid;
use super::head::{QuestionTests, adjusted};
use super::pooled::{PooledFinding, pool};
use super::pooled_kind::PooledKind;
use super::subject::{Subject, judged};
use darkqa_ground::types::degradation::Kind;
use darkqa_ground::types::{AxisLevel, KindReading};

/// A test, by its place in the findings.
#[derive(Debug, Clone, Copy)]
enum Test {
    Pooled(usize),
    Comparison(usize),
    /// The leader in the dark is the best.
    Best,
    /// The order of two models changes with the level.
    Crossing,
    Collapse(usize),
    /// Confidence above accuracy.
    Overconfident(usize),
    /// Further above than at L0.
    Grown(usize),
    /// PSNR tells right from wrong answers.
    Fidelity,
}

/// The tests of a question, in chains as in [`QuestionTests`].
type Question = Vec<Vec<Test>>;

impl Findings<'_> {
    /// Corrects all tests that sentences rest on, in each parsing for itself.
    pub(super) fn correct_sentences(&mut self) {
        let questions = questions(self);
        for mode in ReadingMode::ALL {
            let values = questions.iter().map(|question| QuestionTests {
                chains: question
                    .iter()
                    .map(|chain| chain.iter().map(|test| test.p(self, mode)).collect())
                    .collect(),
            });
            let corrected = adjusted(&values.collect::<Vec<_>>());
            let corrected = corrected
                .iter()
                .flat_map(|question| question.chains.iter().flatten());
            let tests = questions.iter().flatten().flatten();
            for (test, p) in tests.zip(corrected) {
                test.set(self, mode, *p);
            }
        }
        self.tests = questions.iter().flatten().map(Vec::len).sum();
    }
}

/// The questions of a report. Which tests they have depends on what was asked, never on the answers.
fn questions(findings: &Findings<'_>) -> Vec<Question> {
    let mut questions = pooled(findings);
    questions.push(below_blind(findings));
    questions.extend(photographs(findings));
    if findings
        .best
        .as_ref()
        .is_some_and(BestInTheDark::is_possible)
    {
        questions.push(vec![vec![Test::Best], vec![Test::Crossing]]);
    }
    questions.push(collapses(findings));
    questions.push(confidence(findings));
    if findings
        .fidelity
        .as_ref()
        .is_some_and(|found| found.within[0].is_some())
    {
        questions.push(vec![vec![Test::Fidelity]]);
    }
    questions.retain(|question| !question.is_empty());
    questions
}

/// Whether sentences are about raw or enhanced images of a variant: those of the last kind of each root. The others have sentences about
/// darkness alone.
fn is_main(grid: &Grid<'_>, variant: &KindReading) -> bool {
    let root = variant.kind.map(Kind::root);
    let kinds = grid.variants().into_iter().map(|other| other.kind);
    let last = kinds.filter(|kind| kind.map(Kind::root) == root).max();
    variant.kind.is_none() || last == Some(variant.kind)
}

/// A question for each set of pooled findings in which a verdict is possible.
fn pooled(findings: &Findings<'_>) -> Vec<Question> {
    let all: Vec<(usize, &PooledFinding)> = findings.pooled.iter().enumerate().collect();
    let is_one_set = |a: &(usize, &PooledFinding), b: &(usize, &PooledFinding)| {
        let set = |of: &PooledFinding| {
            (
                of.kind,
                of.variant.clone(),
                of.enhancer.clone(),
                of.family.clone(),
            )
        };
        set(a.1) == set(b.1)
    };
    let sets = all.chunk_by(is_one_set).filter(|set| {
        let first = set[0].1;
        first.family.as_ref() == first.kind.only_family()
            && (first.kind == PooledKind::Darkness || is_main(&findings.grid, &first.variant))
            && set
                .iter()
                .any(|(_, finding)| finding.strict.verdict.is_possible())
    });
    let questions = sets.map(|set| {
        let tests = set.iter().map(|(index, _)| Test::Pooled(*index));
        by_level(set[0].1.kind.grows_with_the_level(), tests.collect())
    });
    questions.collect()
}

/// Tests of levels in ascending order: one chain from the darkest on, or a chain for each.
fn by_level(is_ordered: bool, mut tests: Vec<Test>) -> Question {
    if is_ordered {
        tests.reverse();
        vec![tests]
    } else {
        tests.into_iter().map(|test| vec![test]).collect()
    }
}

/// Each family of each model against the words alone, from the darkest level on.
fn below_blind(findings: &Findings<'_>) -> Question {
    let models = pool(&findings.grid);
    let mut chains = BTreeMap::<_, Vec<Test>>::new();
    for (index, comparison) in findings.comparisons.iter().enumerate() {
        let (first, second) = (&comparison.first, &comparison.second);
        if comparison.kind == ComparisonKind::Blind
            && comparison.family.is_some()
            && first.enhancer.is_none()
            && first.variant.kind.is_some()
            && is_main(&findings.grid, &first.variant)
            && models.contains(&&*first.model)
            && comparison.strict.significance.is_possible()
        {
            let chain = (
                &first.model,
                &second.model,
                &comparison.family,
                &first.variant,
            );
            chains
                .entry(chain)
                .or_default()
                .push(Test::Comparison(index));
        }
    }
    let chains = chains.into_values().flat_map(|tests| by_level(true, tests));
    chains.collect()
}

/// What photographs in the dark cost, whether synthetic images stand for them, and what enhancers do to them.
fn photographs(findings: &Findings<'_>) -> Vec<Question> {
    let models = judged(findings.grid.subjects.iter().map(|subject| &*subject.model));
    let kinds = [
        ComparisonKind::Level,
        ComparisonKind::RealSynthetic,
        ComparisonKind::RealEnhanced,
    ];
    let questions = kinds.map(|kind| {
        let is_stated = |comparison: &Comparison| {
            comparison.kind == kind
                && comparison.family.is_none()
                && comparison.first.variant.photograph().is_some()
                && (comparison.first.enhancer.is_none() || kind == ComparisonKind::RealEnhanced)
                && models.contains(&*comparison.first.model)
                && comparison.strict.significance.is_possible()
        };
        let comparisons = findings.comparisons.iter().enumerate();
        let stated = comparisons.filter(|(_, comparison)| is_stated(comparison));
        stated
            .map(|(index, _)| vec![Test::Comparison(index)])
            .collect()
    });
    questions.into()
}

/// The subjects of raw images at the darkest level of each main variant, of the models over which findings are pooled.
fn darkest<'f>(findings: &'f Findings<'_>) -> Vec<&'f Subject> {
    let grid = &findings.grid;
    let models = pool(grid);
    let raw = grid.subjects.iter().filter(|subject| {
        subject.enhancer.is_none()
            && subject.variant.kind.is_some()
            && is_main(grid, &subject.variant)
            && models.contains(&&*subject.model)
    });
    let raw: Vec<&Subject> = raw.collect();
    let level = |variant: &KindReading| -> Option<AxisLevel> {
        let own = raw.iter().filter(|subject| subject.variant == *variant);
        own.filter_map(|subject| subject.level).max()
    };
    let darkest = raw.iter().copied();
    darkest
        .filter(|subject| subject.level == level(&subject.variant))
        .collect()
}

/// Answer collapse of each model in each family.
fn collapses(findings: &Findings<'_>) -> Question {
    let darkest = darkest(findings);
    let confusions = findings.confusions.iter().enumerate();
    let tested = confusions.filter(|(_, confusion)| {
        darkest.contains(&&confusion.subject) && against_clean(confusion).is_some()
    });
    tested
        .map(|(index, _)| vec![Test::Collapse(index)])
        .collect()
}

/// The commonest answer of a subject against that at L0.
fn against_clean(confusion: &Confusion) -> Option<&AgainstClean> {
    confusion.collapse.as_ref()?.clean.as_ref()
}

/// The confidence of each model: above its accuracy, then further above than at L0.
fn confidence(findings: &Findings<'_>) -> Question {
    if findings.grid.clusters < MIN_SCENES {
        return Vec::new();
    }
    let darkest = darkest(findings);
    let calibrations = findings.calibrations.iter().enumerate();
    let tested = calibrations.filter(|(_, row)| {
        row.replies >= LEAST_CONFIDENT_REPLIES && darkest.contains(&&row.subject)
    });
    let chains = tested.map(|(index, row)| {
        let grown = row.growth.map(|_| Test::Grown(index));
        std::iter::once(Test::Overconfident(index))
            .chain(grown)
            .collect()
    });
    chains.collect()
}

impl Test {
    /// p-value before correction, in a parsing. Confidence and fidelity are computed in the strict one alone.
    fn p(self, findings: &Findings<'_>, mode: ReadingMode) -> f64 {
        let best = match mode {
            ReadingMode::Strict => findings.best.as_ref(),
            ReadingMode::Lenient => findings.lenient_best.as_ref(),
        };
        let found = match self {
            Self::Pooled(index) => Some(findings.pooled[index].parsed(mode).p),
            Self::Comparison(index) => Some(findings.comparisons[index].parsed(mode).paired.p),
            Self::Best => best.map(BestInTheDark::p_leader),
            Self::Crossing => best.and_then(|best| Some(best.crossing.as_ref()?.p)),
            Self::Collapse(index) => {
                against_clean(&findings.confusions[index]).map(|clean| clean.p(mode))
            }
            Self::Overconfident(index) => Some(findings.calibrations[index].overconfidence.p),
            Self::Grown(index) => findings.calibrations[index].growth.map(|growth| growth.p),
            Self::Fidelity => findings
                .fidelity
                .as_ref()
                .and_then(|found| Some(found.within[0]?.p)),
        };
        found.unwrap_or(1.0)
    }

    /// Stores the p-value after correction.
    fn set(self, findings: &mut Findings<'_>, mode: ReadingMode, p: f64) {
        let p = Some(p);
        let best = match mode {
            ReadingMode::Strict => findings.best.as_mut(),
            ReadingMode::Lenient => findings.lenient_best.as_mut(),
        };
        match self {
            Self::Pooled(index) => {
                let finding = &mut findings.pooled[index];
                match mode {
                    ReadingMode::Strict => finding.strict.p_report = p,
                    ReadingMode::Lenient => finding.lenient.p_report = p,
                }
            }
            Self::Comparison(index) => {
                let comparison = &mut findings.comparisons[index];
                match mode {
                    ReadingMode::Strict => comparison.strict.p_report = p,
                    ReadingMode::Lenient => comparison.lenient.p_report = p,
                }
            }
            Self::Best => {
                if let Some(best) = best {
                    best.p_report = p;
                }
            }
            Self::Crossing => {
                if let Some(crossing) = best.and_then(|best| best.crossing.as_mut()) {
                    crossing.p_report = p;
                }
            }
            Self::Collapse(index) => {
                let found = &mut findings.confusions[index].collapse;
                if let Some(clean) = found.as_mut().and_then(|found| found.clean.as_mut()) {
                    clean.p_report[mode as usize] = p;
                }
            }
            // The same in both parsings.
            Self::Overconfident(_) | Self::Grown(_) | Self::Fidelity
                if mode == ReadingMode::Lenient => {}
            Self::Overconfident(index) => findings.calibrations[index].overconfidence.p_report = p,
            Self::Grown(index) => {
                if let Some(growth) = findings.calibrations[index].growth.as_mut() {
                    growth.p_report = p;
                }
            }
            Self::Fidelity => {
                if let Some(found) = findings.fidelity.as_mut() {
                    found.p_report = p;
                }
            }
        }
    }
}
