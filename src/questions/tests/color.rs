//! "What color is the sofa in the image?"

use super::*;

fn sofa(change: impl FnOnce(&mut FrameStatistics)) -> Option<Reason> {
    let mut frame = frame(&[("wall", "wall", 500_000), ("sofa", "sofa", 100_000)]);
    change(&mut frame);
    candidate(&frame, &Family::Color, "sofa", "").err()
}

/// A sofa with shares of brown, of red and without a name, in thousandths; the rest is blue.
fn shares(brown: u64, red: u64, none: u64) -> Option<Reason> {
    sofa(|frame| {
        let sofa = &mut frame.segments[1];
        sofa.colors = [0; NONE + 1];
        sofa.colors[Color::Brown as usize] = brown * 100;
        sofa.colors[Color::Red as usize] = red * 100;
        sofa.colors[NONE] = none * 100;
        sofa.colors[Color::Blue as usize] = 100_000 - (brown + red + none) * 100;
    })
}

#[test]
fn one_colour_must_dominate() {
    let frame = frame(&[("sofa", "sofa", 100_000)]);
    let question = candidate(&frame, &Family::Color, "sofa", "").unwrap();
    assert_eq!((question.answer(), question.choices.len()), ("brown", 11));
    assert_eq!(question.text, "What color is the sofa in the image?");
    assert_eq!(shares(600, 300, 0), None);
    assert_eq!(shares(599, 201, 0), Some(Reason::Motley));
    assert_eq!(shares(660, 330, 0), None);
    assert_eq!(shares(660, 331, 0), Some(Reason::Motley));
    assert_eq!(shares(650, 0, 299), None);
    assert_eq!(shares(650, 0, 300), Some(Reason::Nameless));
    assert_eq!(shares(300, 0, 600), Some(Reason::Nameless));
    let median = sofa(|frame| frame.segments[1].median = [200, 30, 30]);
    assert_eq!(median, Some(Reason::Motley));
}

#[test]
fn things_are_called_by_their_own_words() {
    for (class, word, text) in [
        ("cushion", "pillow", "What color is the pillow in the image?"),
        ("table", "desk", "What color is the desk in the image?"),
        ("curtain", "curtains", "What color are the curtains in the image?"),
        ("blinds", "window blinds", "What color are the blinds in the image?"),
    ] {
        let frame = frame(&[(class, word, 100_000)]);
        let question = candidate(&frame, &Family::Color, class, "").unwrap();
        assert_eq!(question.text, text);
    }
    let coarse = sofa(|frame| frame.segments[1].source = WordSource::Coarse);
    assert_eq!(coarse, Some(Reason::Wordless));
}

#[test]
fn the_object_must_be_unique_and_large_enough() {
    let with_second = [999, 1_000].map(|area| {
        let frame = frame(&[("sofa", "sofa", 100_000), ("sofa", "sofa", area)]);
        candidate(&frame, &Family::Color, "sofa", "").err()
    });
    assert_eq!(with_second, [None, Some(Reason::NotUnique)]);
    let loose = [999, 1_000].map(|pixels| {
        sofa(|frame| {
            frame.loose.insert("sofa".into(), pixels);
        })
    });
    assert_eq!(loose, [None, Some(Reason::NotUnique)]);
    let small = [10_000, 9_999].map(|area| {
        let frame = frame(&[("sofa", "sofa", area)]);
        candidate(&frame, &Family::Color, "sofa", "").err()
    });
    assert_eq!(small, [None, Some(Reason::Small)]);
    let small_core = [2_000, 1_999].map(|core| {
        sofa(|frame| {
            frame.segments[1].core = core;
            frame.segments[1].colors = [0; NONE + 1];
            frame.segments[1].colors[Color::Brown as usize] = core;
        })
    });
    assert_eq!(small_core, [None, Some(Reason::Small)]);
    for class in ["mirror", "window", "tv_monitor", "picture", "plant", "lighting", "shower", "fireplace"] {
        let results = run_rules(&[frame(&[(class, "", 100_000)])], |_| {}, &Rules::built_in().unwrap());
        let colors = results.generated.asked.iter().filter(|asked| asked.question.family == Family::Color);
        assert_eq!(colors.count(), 0, "{class}");
    }
}

#[test]
fn over_exposed_and_crushed_pixels_block_the_question() {
    let pixels = [40_000, 40_001];
    let bright = pixels.map(|bright| sofa(|frame| frame.segments[1].bright = bright));
    assert_eq!(bright, [None, Some(Reason::Bright)]);
    let crushed = pixels.map(|crushed| sofa(|frame| frame.segments[1].crushed = crushed));
    assert_eq!(crushed, [None, Some(Reason::Crushed)]);
    for (color, median) in [(Color::White, [250; 3]), (Color::Black, [2; 3])] {
        let reason = sofa(|frame| {
            let sofa = &mut frame.segments[1];
            sofa.colors = [0; NONE + 1];
            sofa.colors[color as usize] = 100_000;
            sofa.median = median;
            match color {
                Color::White => sofa.bright = 100_000,
                _ => sofa.crushed = 100_000,
            }
        });
        assert_eq!(reason, None, "{color:?}");
    }
}

/// A sofa of one sRGB code in all pixels, in light of a frame and around it.
fn lit(color: Color, code: [u8; 3], light: [u8; 3], around: Option<u8>) -> Option<Reason> {
    sofa(|frame| {
        frame.light = light;
        let sofa = &mut frame.segments[1];
        sofa.colors = [0; NONE + 1];
        sofa.colors[color as usize] = 100_000;
        (sofa.median, sofa.around) = (code, around);
    })
}

#[test]
fn a_colour_must_be_the_same_relative_to_the_light() {
    for (light, around, expected) in [
        (250, Some(245), None),
        // If nothing in the frame, or nothing near, is brighter, it may be white in shade.
        (135, Some(245), Some(Reason::Lit)),
        (250, Some(135), Some(Reason::Lit)),
        // Without surfaces around it, only the light of the frame counts.
        (250, None, None),
    ] {
        let reason = lit(Color::Grey, [128; 3], [light; 3], around);
        assert_eq!(reason, expected, "{light} {around:?}");
    }
    // Under warm light, a grey thing that looks brown is not asked about; nor is a brown one that looks orange in
    // sunshine.
    let brown = [150, 108, 66];
    assert_eq!(lit(Color::Brown, brown, [250; 3], Some(240)), None);
    assert_eq!(lit(Color::Brown, brown, [190, 137, 84], None), Some(Reason::Lit));
    // Pink in shade looks red.
    let red = [190, 110, 126];
    assert_eq!(lit(Color::Red, red, [250; 3], Some(250)), None);
    assert_eq!(lit(Color::Red, red, [250; 3], Some(210)), Some(Reason::Lit));
    // White stays white however dark its surroundings are.
    assert_eq!(lit(Color::White, [240; 3], [250; 3], Some(90)), None);
}

/// A frame with a sofa whose core has this colour and number of pixels.
fn view(scene: &str, index: u32, median: [u8; 3], core: u64, source: WordSource) -> FrameStatistics {
    let mut view = frame(&[("wall", "wall", 500_000), ("sofa", "sofa", 100_000)]);
    (view.frame, view.scene) = (FrameId(format!("{scene}/{index}")), scene.into());
    let sofa = &mut view.segments[1];
    (sofa.source, sofa.median, sofa.core) = (source, median, core);
    view
}

#[test]
fn two_views_of_a_thing_must_show_the_same_colour() {
    let (brown, white) = ([110, 70, 40], [250; 3]);
    let named = WordSource::Name;
    let disagreed = Some(Reason::Disagreed);
    for (scene, color, core, source, expected) in [
        ("a", brown, 100_000, named, None),
        ("a", white, 100_000, named, disagreed),
        // Too few pixels, another scene, and numbers without names are no evidence.
        ("a", white, 499, named, None),
        ("a", white, 500, named, disagreed),
        ("b", white, 100_000, named, None),
        ("a", white, 100_000, WordSource::Label, None),
    ] {
        let frames = [view("a", 0, brown, 100_000, named), view(scene, 1, color, core, source)];
        let results = run_rules(&frames, |_| {}, &Rules::built_in().unwrap());
        let reason = results.candidates.into_iter().find_map(|result| match result {
            RuleResult::Viable(found) if found.family == Family::Color => Some(None),
            RuleResult::Rejected(found) if found.family == Family::Color => Some(Some(found.reason)),
            _ => None,
        });
        assert_eq!(reason, Some(expected), "{scene} {color:?} {core} {source:?}");
    }
}

#[test]
fn other_choices_can_be_offered() {
    let frame = frame(&[("sofa", "sofa", 100_000)]);
    let eight = rules("candidates = \"all11\"", "candidates = \"fixed8\"");
    let question = candidate_by(&frame, &Family::Color, "sofa", "", &eight).unwrap();
    assert_eq!((question.choices.len(), question.answer()), (8, "brown"));
    let without = rules("\"blue\", \"brown\"]\nneighbours", "\"blue\"]\nneighbours");
    let text = include_str!("../rules.toml").replacen("\"blue\", \"brown\"]\nneighbours", "\"blue\"]\nneighbours", 1);
    let seven = Rules::parse(&text.replacen("\"all11\"", "\"fixed8\"", 1)).unwrap();
    assert_ne!(without.digest(), seven.digest());
    let rejection = candidate_by(&frame, &Family::Color, "sofa", "", &seven);
    assert_eq!(rejection.err(), Some(Reason::NotOffered));
    let five = rules("candidates = \"all11\"", "candidates = \"k5\"");
    let question = candidate_by(&frame, &Family::Color, "sofa", "", &five).unwrap();
    assert_eq!((question.choices.len(), question.answer()), (5, "brown"));
    for near in ["black", "red", "orange"] {
        assert!(!question.choices.iter().any(|choice| choice == near), "{near}");
    }
}
