//! The built-in data: four small painted rooms with questions whose answers hold by construction.
//!
//! They let a newcomer see the whole program work without data of their own. They are no benchmark: a painted room is
//! far simpler than a photographed one.

use std::collections::BTreeMap;

use super::{Dataset, Source};
use crate::error::Result;
use crate::types::{Choices, Family, FrameId, Question, QuestionId, Rgb};

/// Width of a room's image in pixels.
const WIDTH: usize = 320;
/// Height of a room's image in pixels.
const HEIGHT: usize = 240;
/// The row at which the floor begins.
const FLOOR: usize = 150;

/// A box of one colour that stands or hangs in a room.
#[derive(Debug)]
struct Thing {
    name: &'static str,
    color: &'static str,
    rgb: [u8; 3],
    /// Left, top, width, height in pixels.
    area: [usize; 4],
}

/// One room: later things stand before earlier ones, and the last is the closest.
#[derive(Debug)]
struct Plan {
    name: &'static str,
    activity: &'static str,
    wall: [u8; 3],
    floor: [u8; 3],
    things: &'static [Thing],
}

const fn thing(name: &'static str, color: &'static str, rgb: [u8; 3], area: [usize; 4]) -> Thing {
    Thing {
        name,
        color,
        rgb,
        area,
    }
}

static PLANS: [Plan; 4] = [
    Plan {
        name: "bedroom",
        activity: "sleep",
        wall: [214, 205, 188],
        floor: [134, 98, 66],
        things: &[
            thing("lamp", "yellow", [236, 208, 74], [24, 84, 26, 70]),
            thing("cabinet", "brown", [112, 70, 40], [246, 76, 62, 92]),
            thing("bed", "blue", [52, 84, 168], [70, 130, 170, 86]),
        ],
    },
    Plan {
        name: "living room",
        activity: "relax on a sofa",
        wall: [196, 206, 210],
        floor: [120, 112, 104],
        things: &[
            thing("curtain", "white", [238, 238, 234], [14, 20, 58, 132]),
            thing("sofa", "red", [182, 44, 40], [96, 110, 176, 74]),
            thing("table", "brown", [104, 66, 38], [130, 192, 110, 40]),
        ],
    },
    Plan {
        name: "kitchen",
        activity: "cook a meal",
        wall: [226, 222, 206],
        floor: [150, 150, 146],
        things: &[
            thing("shelf", "white", [240, 240, 238], [20, 24, 140, 24]),
            thing("counter", "grey", [128, 128, 128], [10, 104, 210, 60]),
            thing("chair", "green", [52, 136, 64], [232, 140, 62, 92]),
        ],
    },
    Plan {
        name: "bathroom",
        activity: "take a shower",
        wall: [190, 214, 220],
        floor: [206, 206, 200],
        things: &[
            thing("towel", "orange", [230, 130, 36], [258, 56, 36, 70]),
            thing("bathtub", "white", [242, 242, 240], [20, 128, 190, 60]),
            thing("stool", "black", [24, 24, 26], [226, 168, 52, 60]),
        ],
    },
];

const COLORS: [&str; 11] = [
    "black", "white", "grey", "red", "orange", "yellow", "green", "blue", "purple", "pink", "brown",
];
const TYPES: [&str; 6] = [
    "bedroom",
    "bathroom",
    "kitchen",
    "living room",
    "dining room",
    "office",
];

/// One built-in room, by its place in the list.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room(usize);

impl Room {
    /// The room as an image, by integer arithmetic alone.
    pub(super) fn paint(self) -> Result<Rgb> {
        let plan = &PLANS[self.0];
        let mut samples = Vec::with_capacity(WIDTH * HEIGHT * 3);
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let (rgb, light) = plan.surface(x, y);
                samples
                    .extend(rgb.map(|channel| (usize::from(channel) * light / 256).min(255) as u8));
            }
        }
        Rgb::new(HEIGHT, WIDTH, samples)
    }
}

impl Plan {
    /// The colour at a pixel, and the light on it in 256ths.
    fn surface(&self, x: usize, y: usize) -> ([u8; 3], usize) {
        let covering = self.things.iter().rev().find(|thing| {
            let [left, top, width, height] = thing.area;
            (left..left + width).contains(&x) && (top..top + height).contains(&y)
        });
        match covering {
            Some(Thing {
                rgb,
                area: [left, top, width, height],
                ..
            }) => {
                let edge = (x - left)
                    .min(left + width - 1 - x)
                    .min(y - top)
                    .min(top + height - 1 - y);
                (
                    *rgb,
                    if edge < 3 {
                        176
                    } else {
                        262 - 40 * (y - top) / height
                    },
                )
            }
            None if y < FLOOR => (self.wall, 200 + 56 * x / WIDTH),
            None => (
                self.floor,
                if (x + 2 * (y - FLOOR)) % 40 < 2 {
                    190
                } else {
                    216 + 40 * (y - FLOOR) / (HEIGHT - FLOOR)
                },
            ),
        }
    }

    fn id(&self) -> FrameId {
        FrameId(self.name.replace(' ', "-"))
    }

    fn question(
        &self,
        family: Family,
        text: String,
        choices: &[&str],
        answer: &str,
    ) -> Result<Question> {
        let truth = choices
            .iter()
            .position(|choice| *choice == answer)
            .unwrap_or(choices.len());
        let id = QuestionId(format!("{}/{family}", self.id()));
        let choices = Choices::new(
            choices.iter().map(|&choice| choice.to_owned()).collect(),
            truth,
        )?;
        Ok(Question {
            id,
            frame: self.id(),
            family,
            text,
            choices,
            evidence: serde_json::Value::Null,
        })
    }

    fn questions(&self, index: usize) -> Result<Vec<Question>> {
        let names: Vec<&str> = self.things.iter().map(|thing| thing.name).collect();
        let [.., colored, closest] = self.things else {
            return Ok(Vec::new());
        };
        // Every other room is asked for something that stands in another room.
        let other = &PLANS[(index + 1) % PLANS.len()];
        let (sought, there, activity, suits) = if index.is_multiple_of(2) {
            (names[0], "yes", other.activity, "no")
        } else {
            (other.things[0].name, "no", self.activity, "yes")
        };
        Ok(vec![
            self.question(
                Family::RoomType,
                "What type of room is this?".to_owned(),
                &TYPES,
                self.name,
            )?,
            self.question(
                Family::Affordance,
                format!("I want to {activity}, is this room suitable for this?"),
                &["yes", "no"],
                suits,
            )?,
            self.question(
                Family::Presence,
                format!("Is there a {sought} in the image?"),
                &["yes", "no"],
                there,
            )?,
            self.question(
                Family::Color,
                format!("What color is the {} in the image?", colored.name),
                &COLORS,
                colored.color,
            )?,
            self.question(
                Family::Closest,
                "Which object is closest to the camera?".to_owned(),
                &names,
                closest.name,
            )?,
        ])
    }
}

pub(super) fn open() -> Result<Dataset> {
    let sources = PLANS
        .iter()
        .enumerate()
        .map(|(i, plan)| (plan.id(), Source::Room(Room(i))))
        .collect::<BTreeMap<_, _>>();
    let mut questions = Vec::new();
    for (i, plan) in PLANS.iter().enumerate() {
        questions.extend(plan.questions(i)?);
    }
    Ok(Dataset::new("rooms".to_owned(), sources, questions))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_room_has_five_questions_that_hold() {
        let rooms = open().unwrap();
        assert_eq!((rooms.sources.len(), rooms.questions.len()), (4, 20));
        for plan in &PLANS {
            for question in rooms
                .questions
                .iter()
                .filter(|q| q.frame == plan.id() && q.family == Family::Presence)
            {
                let stands = plan
                    .things
                    .iter()
                    .any(|thing| question.text.contains(thing.name));
                assert_eq!(
                    question.choices.texts()[question.choices.truth()],
                    if stands { "yes" } else { "no" }
                );
            }
        }
    }

    #[test]
    fn things_show_the_colour_they_are_said_to_have() {
        for (i, plan) in PLANS.iter().enumerate() {
            let image = Room(i).paint().unwrap();
            let thing = plan.things.last().unwrap();
            let [left, top, width, height] = thing.area;
            let at = ((top + height / 2) * WIDTH + left + width / 2) * 3;
            for (seen, said) in image.samples()[at..at + 3].iter().zip(thing.rgb) {
                assert!(seen.abs_diff(said) < 24, "{}: {seen} {said}", thing.name);
            }
        }
    }
}
