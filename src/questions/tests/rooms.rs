//! The classification of rooms.

use super::*;

#[test]
fn each_room_is_classified_by_its_signs() {
    for (segments, expected) in [
        (vec![("bed", "bed", 15_000)], "bedroom"),
        (vec![("toilet", "toilet", 3_000)], "bathroom"),
        (vec![("bathtub", "bath", 3_000)], "bathroom"),
        (vec![("shower", "shower wall", 3_000)], "bathroom"),
        (vec![("curtain", "shower curtain", 9_000), ("sink", "sink", 9_000)], "bathroom"),
        (vec![("appliances", "stove", 9_000)], "kitchen"),
        (vec![("cabinet", "Kitchen  Cabinet", 9_000)], "kitchen"),
        (vec![("appliances", "", 9_000), ("counter", "", 9_000)], "kitchen"),
        (vec![("appliances", "fridge", 9_000), ("counter", "counter", 9_000)], "kitchen"),
        (vec![("sofa", "couch", 15_000)], "living room"),
        (vec![("table", "coffee table", 9_000), ("tv_monitor", "tv", 9_000)], "living room"),
        (vec![("table", "dining table", 9_000)], "dining room"),
        (
            vec![("chair", "dining chair", 9_000), ("chair", "dining chair", 9_000), ("lighting", "chandelier", 9_000)],
            "dining room",
        ),
        (
            vec![
                ("table", "table", 9_000),
                ("chair", "chair", 9_000),
                ("chair", "chair", 9_000),
                ("chair", "chair", 9_000),
                ("chair", "chair", 9_000),
            ],
            "dining room",
        ),
        (vec![("table", "desk", 9_000), ("chair", "office chair", 9_000)], "office"),
    ] {
        assert_eq!(room(&segments), Ok(expected.to_owned()), "{segments:?}");
    }
}

#[test]
fn weak_or_small_signs_give_no_room() {
    for (segments, reason) in [
        (vec![("wall", "wall", 900_000)], NoRoom::NoSigns),
        (vec![("bed", "bed", 14_999)], NoRoom::NoSigns),
        (vec![("bed", "dog bed", 90_000)], NoRoom::NoSigns),
        (vec![("toilet", "toilet", 2_999)], NoRoom::NoSigns),
        (vec![("toilet", "toilet/otherroom", 90_000)], NoRoom::NoSigns),
        (vec![("table", "desk", 90_000)], NoRoom::Weak),
        (vec![("chest_of_drawers", "nightstand", 9_000), ("chest_of_drawers", "chest", 9_000)], NoRoom::Weak),
        (vec![("appliances", "washing machine", 90_000)], NoRoom::NotAsked),
        (vec![("gym_equipment", "treadmill", 90_000)], NoRoom::NotAsked),
    ] {
        assert_eq!(room(&segments), Err(reason), "{segments:?}");
    }
}

#[test]
fn a_clue_counts_once() {
    let two = signs(&[("toilet", "toilet", 9_000), ("toilet", "toilet", 9_000)]);
    assert_eq!(two.scores["bathroom"], 4);
    assert_eq!(two.segments["bathroom"], [1, 2]);
}

#[test]
fn a_classroom_is_not_a_dining_room() {
    let mut segments = vec![("table", "table", 9_000)];
    segments.extend([("chair", "chair", 9_000); 4]);
    for blocker in [
        ("board_panel", "whiteboard", 1),
        ("sofa", "sofa", 1),
        ("bed", "bed", 1),
        ("table", "desk", 1),
        ("objects", "computer", 1),
    ] {
        let with = [segments.clone(), vec![blocker]].concat();
        assert!(room(&with).is_err(), "{blocker:?}");
    }
    // Two tables or only three chairs are not enough.
    assert!(room(&[segments.clone(), vec![("table", "table", 9_000)]].concat()).is_err());
    assert_eq!(room(&segments[..4]), Err(NoRoom::Weak));
}

#[test]
fn only_the_rules_of_contests_decide_them() {
    let (bed, sofa) = (("bed", "bed", 200_000), ("sofa", "sofa", 100_000));
    assert_eq!(room(&[bed, sofa]), Ok("bedroom".into()));
    assert_eq!(room(&[("bed", "bed", 199_999), sofa]), Err(NoRoom::Contested));
    assert_eq!(room(&[bed, ("table", "desk", 9_000), ("chair", "office chair", 9_000)]), Ok("bedroom".into()));
    let washer = ("appliances", "washing machine", 9_000);
    assert_eq!(room(&[washer, ("toilet", "toilet", 9_000)]), Ok("bathroom".into()));
    assert_eq!(room(&[washer, ("appliances", "stove", 9_000)]), Ok("kitchen".into()));
    // Open-plan rooms have no type.
    let kitchen = ("cabinet", "kitchen cabinet", 9_000);
    assert_eq!(room(&[kitchen, sofa]), Err(NoRoom::Contested));
    assert_eq!(room(&[("table", "dining table", 9_000), sofa]), Err(NoRoom::Contested));
    assert_eq!(room(&[kitchen, ("table", "dining table", 9_000)]), Err(NoRoom::Contested));
    // The second room type is weak, but its score is too close.
    let near = [("table", "dining table", 9_000), ("chair", "dining chair", 9_000), ("chair", "dining chair", 9_000)];
    assert_eq!(room(&near), Ok("dining room".into()));
    assert_eq!(room(&[("table", "dining table", 9_000), ("table", "desk", 9_000)]), Err(NoRoom::Contested));
    // Three rivals have no winner.
    assert_eq!(room(&[bed, kitchen, ("toilet", "toilet", 9_000)]), Err(NoRoom::Contested));
}

#[test]
fn an_office_beats_a_living_room_without_a_sofa() {
    let living = [("table", "coffee table", 9_000), ("fireplace", "fireplace", 9_000)];
    let office = [("table", "desk", 9_000), ("chair", "office chair", 9_000), ("objects", "computer", 9_000)];
    assert_eq!(room(&[&living[..], &office].concat()), Ok("office".into()));
    assert_eq!(room(&[&living[..], &office, &[("sofa", "sofa", 1)]].concat()), Err(NoRoom::Contested));
    assert_eq!(room(&[&living[..], &office[..2]].concat()), Err(NoRoom::Contested));
}

#[test]
fn a_room_behind_a_door_does_not_count() {
    for (area, depth, expected) in [
        (100_000, Some(3000), Ok("kitchen".into())),
        (100_001, Some(3000), Err(NoRoom::Contested)),
        (100_000, Some(2999), Err(NoRoom::Contested)),
        (100_000, None, Err(NoRoom::Contested)),
    ] {
        let mut frame = frame(&[("cabinet", "kitchen cabinet", 400_000), ("toilet", "toilet", area)]);
        frame.segments[0].depth = Some(depth_at(400_000, 2000));
        frame.segments[1].depth = depth.map(|depth| depth_at(area, depth));
        let room = classify(&frame, Rules::built_in().unwrap().book()).room;
        assert_eq!(room, expected, "{area} {depth:?}");
    }
}
