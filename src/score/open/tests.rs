//! Tests of the scores of open answers.

use super::*;

fn groups(episode: usize, category: &str) -> QuestionGroups {
    QuestionGroups { episode: format!("hm3d-v0/{episode:03}"), category: category.into(), split: "hm3d-v0".into() }
}

fn scored(level: &str, question: usize, outcome: AnswerOutcome) -> ScoredAnswer {
    ScoredAnswer { subject: ModelInCondition::new("m", Some(&level.parse().unwrap())), question, outcome, cut: false }
}

#[test]
fn marks_become_upstreams_score() {
    use AnswerOutcome::{Marked, Missing, Null, Unmarked};
    let questions: Vec<QuestionGroups> = (0..7).map(|i| groups(0, ["a", "b"][i % 2])).collect();
    let outcomes = [Marked(5), Marked(5), Marked(3), Marked(1), Null, Missing, Unmarked];
    let answers: Vec<ScoredAnswer> =
        outcomes.into_iter().enumerate().map(|(i, outcome)| scored("L0", i, outcome)).collect();
    let summary = open_summary(&answers, &questions);
    let all = summary.cell(&answers[0].subject, &Group::All).unwrap();
    let score = all.score.unwrap();
    assert!((score.value - 0.5).abs() < 1e-12 && score.n == 5);
    assert!(score.low < 0.5 && score.high > 0.5);
    assert_eq!((all.planned, all.null, all.missing, all.unmarked), (7, 1, 1, 1));
    assert_eq!((summary.unit, summary.clusters), ("question", 7));
    let names: Vec<&str> = summary.groups().iter().map(|group| group.name()).collect();
    assert_eq!(names, ["all", "a", "b"]);
}

#[test]
fn drops_are_of_unrounded_means_on_shared_questions() {
    use AnswerOutcome::{Marked, Missing};
    let questions: Vec<QuestionGroups> = (0..6).map(|i| groups(i / 2, "a")).collect();
    let marks = [("L0", [5, 4, 5, 4, 0, 5]), ("L2-noise", [4, 4, 3, 1, 1, 5]), ("L2-noise+ruas", [5, 4, 5, 1, 1, 5])];
    let mut answers = Vec::new();
    for (level, marks) in marks {
        for (question, mark) in marks.into_iter().enumerate() {
            let outcome = if mark == 0 { Missing } else { Marked(mark) };
            answers.push(scored(level, question, outcome));
        }
    }
    let summary = open_summary(&answers, &questions);
    let degraded = ModelInCondition::new("m", Some(&"L2-noise".parse().unwrap()));
    let drop = summary.change(&degraded, Baseline::Clean, &Group::All).unwrap();
    // (0.25 + 0 + 0.5 + 0.75 + 0) / 5, the fifth question being unanswered at L0.
    assert!((drop.difference.value + 0.3).abs() < 1e-12 && drop.difference.n == 5);
    assert!(drop.difference.low < -0.3 && drop.difference.high > -0.3);
    let enhanced = ModelInCondition::new("m", Some(&"L2-noise+ruas".parse().unwrap()));
    let gain = summary.change(&enhanced, Baseline::Raw, &Group::All).unwrap();
    assert!((gain.difference.value - 0.125).abs() < 1e-12);
    assert!(summary.change(&enhanced, Baseline::Clean, &Group::All).is_some());
    assert_eq!(summary.changes.len(), 3);
    assert_eq!((summary.unit, summary.clusters), ("episode", 3));
}
