//! Bounding boxes of the objects that a question is about: [`RunQuestion::outlines`], [`RunQuestion::object`].

use serde_json::Value;

use super::question::Family;
use super::run_question::RunQuestion;

/// A bounding box in pixels of a frame: left, top, right, bottom.
pub type PixelBox = [u32; 4];

impl RunQuestion {
    /// Bounding boxes of the objects in the question's evidence: all segments with the word asked about, or all
    /// candidates for the closest object. Empty for questions about the whole room or without evidence.
    #[must_use]
    pub fn outlines(&self) -> Vec<PixelBox> {
        let about = self.evidence.get("about").and_then(Value::as_str).filter(|about| !about.is_empty());
        self.evidence
            .get("segments")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter(|segment| match (&self.family, about) {
                (Family::Closest, _) => true,
                (_, about) => about.is_some() && segment.get("word").and_then(Value::as_str) == about,
            })
            .filter_map(|segment| pixel_box(segment.get("bbox")?))
            .collect()
    }

    /// The smallest box around all of [`Self::outlines`]; `None` if there are none.
    #[must_use]
    pub fn object(&self) -> Option<PixelBox> {
        self.outlines().into_iter().reduce(|one, other| {
            [one[0].min(other[0]), one[1].min(other[1]), one[2].max(other[2]), one[3].max(other[3])]
        })
    }
}

/// Parses a box of evidence; `None` if the value is not a box.
fn pixel_box(value: &Value) -> Option<PixelBox> {
    let numbers: Option<Vec<u32>> =
        value.as_array()?.iter().map(|number| u32::try_from(number.as_u64()?).ok()).collect();
    let pixels: PixelBox = numbers?.try_into().ok()?;
    (pixels[0] < pixels[2] && pixels[1] < pixels[3]).then_some(pixels)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn question(family: Family, evidence: Value) -> RunQuestion {
        let line =
            json!({"id": "q", "frame": "f", "family": "other", "question": "?", "choices": ["a", "b"], "answer": "a"});
        RunQuestion { family, evidence, ..serde_json::from_value(line).unwrap() }
    }

    #[test]
    fn the_thing_asked_about_has_a_box() {
        let segments = json!([
            {"word": "sink", "bbox": [10, 20, 30, 40]},
            {"word": "bed", "bbox": [0, 0, 5, 5]},
            {"word": "sink", "bbox": [50, 10, 60, 30]},
            {"word": "sink", "bbox": [9, 9, 9, 12]},
            {"word": "sink", "bbox": "everywhere"},
        ]);
        let sink = question(Family::Presence, json!({"about": "sink", "segments": segments}));
        assert_eq!(sink.outlines(), [[10, 20, 30, 40], [50, 10, 60, 30]]);
        assert_eq!(sink.object(), Some([10, 10, 60, 40]));
        let closest = question(Family::Closest, json!({"about": "", "segments": segments}));
        assert_eq!(closest.object(), Some([0, 0, 60, 40]));
        for whole in
            [json!({"about": "", "segments": segments}), json!({"about": "lamp", "segments": segments}), Value::Null]
        {
            assert_eq!(question(Family::RoomType, whole).object(), None);
        }
    }
}
