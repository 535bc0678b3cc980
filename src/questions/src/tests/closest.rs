//! "Which object is closest to the camera?"

use super::*;

/// Why the question is rejected for a chair at 2 m and a table at 3 m, after a change.
fn two(change: impl FnOnce(&mut FrameStatistics)) -> Option<Reason> {
    let mut frame = frame(&[
        ("chair", "chair", 50_000),
        ("table", "table", 50_000),
        ("wall", "wall", 500_000),
    ]);
    frame.segments[0].depth = Some(depth_at(50_000, 2000));
    frame.segments[1].depth = Some(depth_at(50_000, 3000));
    change(&mut frame);
    candidate(&frame, &Family::Closest, "", "").err()
}

fn third(frame: &mut FrameStatistics, class: &str, area: u64, depth: Option<u32>) {
    let mut segment = frame.segments[0].clone();
    (segment.id, segment.class, segment.word) = (9, class.to_owned(), class.to_owned());
    (segment.area, segment.pure, segment.core) = (area, area, area);
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
    assert_eq!(two(|_| {}), None);
}

#[test]
fn the_gap_must_be_wide() {
    let gap = |depth| two(|frame| frame.segments[1].depth = Some(depth_at(50_000, depth)));
    assert_eq!((gap(2300), gap(2299)), (None, Some(Reason::Gap)));
    let far = |depth| {
        two(|frame| {
            frame.segments[0].depth = Some(depth_at(50_000, 5000));
            frame.segments[1].depth = Some(depth_at(50_000, depth));
        })
    };
    assert_eq!((far(5500), far(5499)), (None, Some(Reason::Gap)));
    let near = |p10| {
        two(|frame| {
            frame.segments[1].depth = Some(SegmentDepth {
                valid: 50_000,
                p10,
                median: 3000,
                p90: 3100,
            });
        })
    };
    assert_eq!((near(2050), near(2049)), (None, Some(Reason::Gap)));
    assert_eq!(near(1899), Some(Reason::Disputed));
}

#[test]
fn the_scope_decides_about_two_objects_of_one_class() {
    let same = |frame: &mut FrameStatistics| third(frame, "chair", 50_000, Some(2100));
    assert_eq!(two(same), Some(Reason::Gap));
    let classes = rules("gap_scope = \"instances\"", "gap_scope = \"classes\"");
    let mut frame = frame(&[("chair", "chair", 50_000), ("table", "table", 50_000)]);
    third(&mut frame, "chair", 50_000, Some(3100));
    assert_eq!(
        candidate(&frame, &Family::Closest, "", "").err(),
        Some(Reason::Gap)
    );
    assert_eq!(
        candidate_by(&frame, &Family::Closest, "", "", &classes)
            .unwrap()
            .answer(),
        "chair"
    );
}

#[test]
fn two_objects_must_be_eligible() {
    assert_eq!(
        two(|frame| drop(frame.segments.remove(1))),
        Some(Reason::Few)
    );
    for (class, word) in [
        ("picture", ""),
        ("mirror", ""),
        ("curtain", ""),
        ("towel", ""),
        ("tv_monitor", ""),
        ("sofa", "blanket"),
        ("clothes", ""),
    ] {
        let reason = two(|frame| {
            frame.segments[1].class = class.to_owned();
            frame.segments[1].word = word.to_owned();
        });
        assert_eq!(reason, Some(Reason::Few), "{class}");
    }
    assert_eq!(
        two(|frame| frame.segments[1].class = "chair".into()),
        Some(Reason::Few)
    );
    let small = |area| {
        two(|frame| {
            let segment = &mut frame.segments[1];
            (segment.area, segment.pure, segment.core) = (area, area, area);
            segment.depth = Some(depth_at(area, 3000));
        })
    };
    assert_eq!((small(5_000), small(4_999)), (None, Some(Reason::Few)));
    let valid = |valid| two(|frame| frame.segments[1].depth = Some(depth_at(valid, 3000)));
    assert_eq!((valid(25_000), valid(24_999)), (None, Some(Reason::Few)));
}

#[test]
fn depth_must_exist_and_be_plausible() {
    assert_eq!(two(|frame| frame.depth = None), Some(Reason::NoDepth));
    let median = |median| two(|frame| frame.depth.as_mut().unwrap().median = median);
    assert_eq!((median(300), median(299)), (None, Some(Reason::Scale)));
    assert_eq!(
        (median(15_000), median(15_001)),
        (None, Some(Reason::Scale))
    );
    let void = |lower_void| two(|frame| frame.lower_void = lower_void);
    assert_eq!((void(50_000), void(50_001)), (None, Some(Reason::Void)));
}

#[test]
fn objects_that_may_be_nearer_block_the_question() {
    let rival =
        |class: &'static str, area, depth| two(move |frame| third(frame, class, area, depth));
    for class in ["objects", "misc", "furniture", "clothes", "gym_equipment"] {
        assert_eq!(
            rival(class, 2_000, Some(2_999)),
            Some(Reason::Rival),
            "{class}"
        );
        assert_eq!(rival(class, 2_000, Some(3_000)), None, "{class}");
        assert_eq!(rival(class, 1_999, Some(2_999)), None, "{class}");
        assert_eq!(
            rival(class, 10_000, None),
            Some(Reason::Unmeasured),
            "{class}"
        );
        assert_eq!(rival(class, 9_999, None), None, "{class}");
    }
    for class in ["wall", "floor", "door", "picture", "curtain", "board_panel"] {
        assert_eq!(rival(class, 90_000, Some(1_000)), None, "{class}");
        assert_eq!(rival(class, 90_000, None), None, "{class}");
    }
    // Rivals: too small for an answer but near; a mixed segment of any class; far by the median but near by the 10 % quantile.
    assert_eq!(rival("sofa", 4_000, Some(1_000)), Some(Reason::Rival));
    let mixed = two(|frame| {
        third(frame, "wall", 90_000, Some(1_000));
        frame.segments.last_mut().unwrap().pure = 70_000;
    });
    assert_eq!(mixed, Some(Reason::Rival));
    let reaching = |p10| {
        two(|frame| {
            third(frame, "objects", 90_000, Some(4_000));
            frame.segments.last_mut().unwrap().depth = Some(SegmentDepth {
                valid: 90_000,
                p10,
                median: 4_000,
                p90: 5_000,
            });
        })
    };
    assert_eq!(
        (reaching(1_900), reaching(1_899)),
        (None, Some(Reason::Rival))
    );
    let loose = |class: &'static str, pixels| {
        two(move |frame| {
            frame.loose.insert(class.into(), pixels);
        })
    };
    assert_eq!(
        (loose("objects", 1_999), loose("objects", 2_000)),
        (None, Some(Reason::Rival))
    );
    assert_eq!(loose("wall", 500_000), None);
}
