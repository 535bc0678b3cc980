//! "What type of room is this?"

use super::*;

fn ask(frame: &FrameStatistics) -> Result<String, Reason> {
    candidate(frame, &Family::RoomType, "", "").map(|question| question.answer().to_owned())
}

#[test]
fn it_is_asked_if_enough_is_visible() {
    let mut bedroom = frame(&BEDROOM);
    assert_eq!(ask(&bedroom), Ok("bedroom".into()));
    bedroom.void = 400_000;
    assert_eq!(ask(&bedroom), Ok("bedroom".into()));
    bedroom.void = 400_001;
    assert_eq!(ask(&bedroom), Err(Reason::Unlabelled));
    assert_eq!(ask(&frame(&[("wall", "wall", 900_000)])), Err(Reason::NoRoom));
    // A single asked segment must be large.
    assert_eq!(ask(&frame(&[("toilet", "toilet", 50_000)])), Ok("bathroom".into()));
    assert_eq!(ask(&frame(&[("toilet", "toilet", 49_999)])), Err(Reason::Bare));
    let two = frame(&[("toilet", "toilet", 9_000), ("towel", "towel", 9_000)]);
    assert_eq!(ask(&two), Ok("bathroom".into()));
}

#[test]
fn a_stated_room_is_used_on_request() {
    let mut frame = frame(&[("toilet", "toilet", 50_000)]);
    frame.room = Some("living_room".into());
    let rules = Rules::built_in().unwrap();
    for (source, expected) in [(RoomSource::Signature, "bathroom"), (RoomSource::Stated, "living room")] {
        let results = run_rules(std::slice::from_ref(&frame), |request| request.room_source = source, &rules);
        let asked = results.generated.asked.iter().find(|asked| asked.question.family == Family::RoomType);
        assert_eq!(asked.unwrap().answer(), expected);
    }
}
