//! Tests of the sentences about photographs in the dark, on synthetic records.

use super::records::{of_kind, scripted};
use crate::sentences::sentences;
use darkqa_base::types::PhotoName;
use darkqa_score::cluster::FrameTies;
use darkqa_score::findings::Findings;
use darkqa_score::photographs::PairDarkness;

#[test]
fn unconfirmed_effects_on_photographs_are_stated() {
    let conditions = [("L0", 100), ("dark", 95), ("dark+lift", 100)];
    let trials = scripted("m", &conditions).into_iter().collect();
    let mut findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    findings.pairs = vec![PairDarkness {
        name: PhotoName::new("dark").unwrap(),
        frames: 60,
        unknown: 0,
        ev: [3.6; 3],
        synthesis: 4.1,
        stated: 60,
        is_lower_bound: false,
        brighter: 0,
        mean_and_median: None,
    }];
    let said = sentences(&findings);
    for (kind, text) in [
        (
            "real darkness",
            "· Photographed in the dark (dark, 3.6 EV), accuracy of m is 5.0 points lower than in the light, unconfirmed after",
        ),
        ("real enhanced", "· lift with dark: accuracy of m 5.0 points higher, unconfirmed after"),
    ] {
        let of_kind = of_kind(&said, kind);
        assert!(of_kind[0].starts_with(text), "{of_kind:?}");
    }
}
