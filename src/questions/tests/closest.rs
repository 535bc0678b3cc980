//! Tests of "Which object is closest to the camera?"

use super::*;

/// Reason to reject the question about a chair at 2 m and a table at 3 m, after `change`; `None` if it is accepted.
fn rejection_after_change(change: impl FnOnce(&mut FrameStatistics)) -> Option<Reason> {
    let mut frame = frame(&[("chair", "chair", 50_000), ("table", "table", 50_000), ("wall", "wall", 500_000)]);
    frame.segments[0].depth = Some(depth_at(50_000, 2000));
    frame.segments[1].depth = Some(depth_at(50_000, 3000));
    change(&mut frame);
    candidate(&frame, &Family::Closest, "", "").err()
}

/// Adds a segment of `area` pixels at `depth` millimetres, without depth values if `None`.
fn add_third_segment(frame: &mut FrameStatistics, class: &str, area: u64, depth: Option<u32>) {
    let mut segment = frame.segments[0].clone();
    segment.id = 9;
    segment.class = class.to_owned();
    segment.word = class.to_owned();
    segment.area = area;
    segment.pure = area;
    segment.core = area;
    segment.depth = depth.map(|depth| depth_at(area, depth));
    frame.segments.push(segment);
}

#[test]
fn the_nearest_object_is_the_answer() {
    let mut frame = frame(&[
        ("chair", "chair", 50_000),
        ("table", "table", 50_000),
        ("sofa", "sofa", 50_000),
        ("bed", "bed", 50_000),
        ("sink", "sink", 50_000),
    ]);
    let question = candidate(&frame, &Family::Closest, "", "").unwrap();
    assert_eq!((question.answer(), question.choices.len()), ("chair", 4));
    assert!(!question.choices.contains(&"sink".to_owned()));
    assert_eq!(question.evidence["gap_mm"], 1000);
    frame.segments[4].depth = Some(depth_at(50_000, 1000));
    let question = candidate(&frame, &Family::Closest, "", "").unwrap();
    assert_eq!(question.answer(), "sink");
    assert_eq!(rejection_after_change(|_| {}), None);
}

#[test]
fn the_gap_must_be_wide() {
    for (nearest, depths) in [(2000, [2300, 2299]), (5000, [5500, 5499])] {
        let reasons = depths.map(|depth| {
            rejection_after_change(|frame| {
                frame.segments[0].depth = Some(depth_at(50_000, nearest));
                frame.segments[1].depth = Some(depth_at(50_000, depth));
            })
        });
        assert_eq!(reasons, [None, Some(Reason::Gap)], "{nearest}");
    }
    let reasons = [2050, 2049, 1899].map(|p10| {
        rejection_after_change(|frame| {
            frame.segments[1].depth = Some(SegmentDepth { valid: 50_000, p10, median: 3000, p90: 3100 });
        })
    });
    assert_eq!(reasons, [None, Some(Reason::Gap), Some(Reason::Disputed)]);
}

#[test]
fn gap_scope_counts_instances_or_classes() {
    assert_eq!(
        rejection_after_change(|frame| add_third_segment(frame, "chair", 50_000, Some(2100))),
        Some(Reason::Gap)
    );
    let class_rules = rules("gap_scope = \"instances\"", "gap_scope = \"classes\"");
    let mut frame = frame(&[("chair", "chair", 50_000), ("table", "table", 50_000)]);
    add_third_segment(&mut frame, "chair", 50_000, Some(3100));
    assert_eq!(candidate(&frame, &Family::Closest, "", "").err(), Some(Reason::Gap));
    assert_eq!(candidate_by(&frame, &Family::Closest, "", "", &class_rules).unwrap().answer(), "chair");
}

#[test]
fn two_objects_must_be_eligible() {
    assert_eq!(rejection_after_change(|frame| drop(frame.segments.remove(1))), Some(Reason::Few));
    for (class, word) in [
        ("picture", ""),
        ("mirror", ""),
        ("curtain", ""),
        ("towel", ""),
        ("tv_monitor", ""),
        ("sofa", "blanket"),
        ("clothes", ""),
    ] {
        let reason = rejection_after_change(|frame| {
            frame.segments[1].class = class.to_owned();
            frame.segments[1].word = word.to_owned();
        });
        assert_eq!(reason, Some(Reason::Few), "{class}");
    }
    assert_eq!(rejection_after_change(|frame| frame.segments[1].class = "chair".into()), Some(Reason::Few));
    let small = [5_000, 4_999].map(|area| {
        rejection_after_change(|frame| {
            let segment = &mut frame.segments[1];
            segment.area = area;
            segment.pure = area;
            segment.core = area;
            segment.depth = Some(depth_at(area, 3000));
        })
    });
    assert_eq!(small, [None, Some(Reason::Few)]);
    let unmeasured = [25_000, 24_999]
        .map(|valid| rejection_after_change(|frame| frame.segments[1].depth = Some(depth_at(valid, 3000))));
    assert_eq!(unmeasured, [None, Some(Reason::Few)]);
}

#[test]
fn depth_must_exist_and_be_plausible() {
    assert_eq!(rejection_after_change(|frame| frame.depth = None), Some(Reason::NoDepth));
    for medians in [[300, 299], [15_000, 15_001]] {
        let reasons =
            medians.map(|median| rejection_after_change(|frame| frame.depth.as_mut().unwrap().median = median));
        assert_eq!(reasons, [None, Some(Reason::Scale)], "{medians:?}");
    }
    let void = [50_000, 50_001].map(|void| rejection_after_change(|frame| frame.lower_void = void));
    assert_eq!(void, [None, Some(Reason::Void)]);
}

/// Reason to reject the question with a third segment in the frame; `None` if it is accepted.
fn rejection_with_third_segment(class: &str, area: u64, depth: Option<u32>) -> Option<Reason> {
    rejection_after_change(|frame| add_third_segment(frame, class, area, depth))
}

#[test]
fn objects_that_may_be_nearer_block_the_question() {
    for class in ["objects", "misc", "furniture", "clothes", "gym_equipment"] {
        assert_eq!(rejection_with_third_segment(class, 2_000, Some(2_999)), Some(Reason::Rival), "{class}");
        assert_eq!(rejection_with_third_segment(class, 2_000, Some(3_000)), None, "{class}");
        assert_eq!(rejection_with_third_segment(class, 1_999, Some(2_999)), None, "{class}");
        assert_eq!(rejection_with_third_segment(class, 10_000, None), Some(Reason::Unmeasured), "{class}");
        assert_eq!(rejection_with_third_segment(class, 9_999, None), None, "{class}");
    }
    for class in ["wall", "floor", "door", "picture", "curtain", "board_panel"] {
        assert_eq!(rejection_with_third_segment(class, 90_000, Some(1_000)), None, "{class}");
        assert_eq!(rejection_with_third_segment(class, 90_000, None), None, "{class}");
    }
    // A near object that is too small for an answer is a rival.
    assert_eq!(rejection_with_third_segment("sofa", 4_000, Some(1_000)), Some(Reason::Rival));
    // A near segment that is not pure is a rival, whatever its class.
    let mixed = rejection_after_change(|frame| {
        add_third_segment(frame, "wall", 90_000, Some(1_000));
        frame.segments.last_mut().unwrap().pure = 70_000;
    });
    assert_eq!(mixed, Some(Reason::Rival));
    // A segment that is far by the median is a rival if its 10 % quantile is near.
    let far_by_median = [1_900, 1_899].map(|p10| {
        rejection_after_change(|frame| {
            add_third_segment(frame, "objects", 90_000, Some(4_000));
            frame.segments.last_mut().unwrap().depth =
                Some(SegmentDepth { valid: 90_000, p10, median: 4_000, p90: 5_000 });
        })
    });
    assert_eq!(far_by_median, [None, Some(Reason::Rival)]);
    for (class, pixels, expected) in
        [("objects", 1_999, None), ("objects", 2_000, Some(Reason::Rival)), ("wall", 500_000, None)]
    {
        let reason = rejection_after_change(|frame| {
            frame.loose.insert(class.into(), pixels);
        });
        assert_eq!(reason, expected, "{class} {pixels}");
    }
}
