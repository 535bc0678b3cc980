//! Tests of the sentence about the best model in the dark, on synthetic records.

use super::records::{SEEING, of_kind, scripted, sentences_about, wordy};

#[test]
fn format_changes_do_not_decide_the_best_model() {
    let mut records = [scripted("a", &SEEING), scripted("b", &SEEING)].concat();
    let split = records.len() / 2;
    wordy(&mut records[split..], "L5-noise");
    let best = of_kind(&sentences_about(&records), "best");
    assert!(best[0].starts_with("· a has the highest mean accuracy"), "{best:?}");
    assert!(best[0].contains("detected in the strict parsing alone"), "{best:?}");
}

#[test]
fn equal_leaders_share_the_highest_accuracy() {
    let first = scripted("first", &SEEING);
    let second = scripted("second", &SEEING);
    let worse = scripted("worse", &[("L0", 90), ("L3-noise", 10), ("L5-noise", 10)]);
    let best = of_kind(&sentences_about(&[worse, first, second].concat()), "best");
    assert!(best[0].starts_with("· first and second share the highest mean accuracy in the dark ("), "{best:?}");
    assert!(best[0].contains("; 0.0 ["), "{best:?}");
}

#[test]
fn best_model_is_chosen_at_dark_levels() {
    let bright = scripted("bright", &at_noise_levels([99, 97, 97, 45, 35, 35]));
    let steady = scripted("steady", &at_noise_levels([62, 58, 59, 61, 50, 51]));
    let two = [bright.clone(), steady.clone()].concat();
    let best = of_kind(&sentences_about(&two), "best");
    assert!(best[0].starts_with("· bright is better at L0–L2, steady at L3–L5. (steady over L3–L5: "), "{best:?}");
    // A third model that is worse everywhere changes nothing.
    let third = scripted("third", &at_noise_levels([40, 40, 40, 34, 30, 28]));
    let best = of_kind(&sentences_about(&[two, third].concat()), "best");
    assert!(best[0].starts_with("· bright is better at L0–L2, steady at L3–L5. ("), "{best:?}");
    // Levels without a detected difference are not attributed to a model.
    let bright = scripted("bright", &at_noise_levels([99, 61, 60, 60, 60, 10]));
    let even = scripted("even", &at_noise_levels([50, 60, 60, 60, 60, 70]));
    let best = of_kind(&sentences_about(&[bright, even].concat()), "best");
    assert!(best[0].starts_with("· bright is better at L0, even at L5; not told apart at L1–L4. ("), "{best:?}");
    // Without a change of order the best at L3 to L5 is named, not the best of all levels.
    let even = scripted("even", &at_noise_levels([62, 62, 62, 30, 25, 25]));
    let best = of_kind(&sentences_about(&[steady, even].concat()), "best");
    assert!(best[0].starts_with("+ steady sees best in the dark (L3–L5). ("), "{best:?}");
}

#[test]
fn change_of_leader_is_detected_in_both_parsings() {
    let bright = scripted("bright", &at_noise_levels([99, 97, 97, 45, 35, 35]));
    let steady = scripted("steady", &at_noise_levels([62, 58, 59, 61, 50, 51]));
    let mut wordy_model = scripted("wordy", &at_noise_levels([40, 40, 40, 61, 50, 51]));
    for condition in ["L3-noise", "L4-noise", "L5-noise"] {
        wordy(&mut wordy_model, condition);
    }
    let best = of_kind(&sentences_about(&[bright, steady, wordy_model].concat()), "best");
    assert!(best[0].starts_with("· bright is better at L0–L2, steady at L3–L5. ("), "{best:?}");
    assert!(!best[0].contains("strict parsing alone"), "{best:?}");
}

#[test]
fn model_that_answers_as_without_images_does_not_see() {
    let mut levels = vec![("blind", 60)];
    levels.extend(at_noise_levels([90, 60, 60, 60, 60, 60]));
    let blind = scripted("blind", &levels);
    let worse = scripted("worse", &at_noise_levels([90, 30, 30, 10, 10, 10]));
    let best = of_kind(&sentences_about(&[blind, worse].concat()), "best");
    assert!(
        best[0].starts_with(
            "· blind has the highest mean accuracy in the dark (L3–L5), but was not detected to be above its own replies without images. ("
        ),
        "{best:?}"
    );
    assert!(
        best[0].contains("; 0.0 [") && best[0].contains("] against its own replies without images, p = 1.000;"),
        "{best:?}"
    );
}

/// L0 to L5 with noise, each with a percentage of right replies.
fn at_noise_levels(percents: [usize; 6]) -> Vec<(&'static str, usize)> {
    ["L0", "L1-noise", "L2-noise", "L3-noise", "L4-noise", "L5-noise"].into_iter().zip(percents).collect()
}
