//! Answers from visible evidence alone: [`Observation::answer`].

use super::question_topic::{QuestionTopic, ThingWord};
use super::{ColorPosterior, Observation};
use crate::colors::{Color, Palette};
use crate::room::classify;
use crate::rule_context::YES_NO;
use crate::rules::{ClassFlag, Rules};
use crate::statistics::Segment;
use darkqa_ground::types::Question;

impl Observation {
    /// The answer to a question, as an index of its choices. `None` if nothing that is seen bears on it, or if the question is
    /// not one of the rulebook (see [`is_in_rulebook`](super::is_in_rulebook)).
    #[must_use]
    pub fn answer(&self, question: &Question, rules: &Rules, palette: &Palette) -> Option<usize> {
        let answer = match QuestionTopic::from_question(question, rules.book())? {
            QuestionTopic::Room => self.room(rules),
            QuestionTopic::Activity(activity) => self.affordance(activity, rules),
            QuestionTopic::Presence(thing) => self.presence(&thing, rules),
            QuestionTopic::Color(thing) => self.color(&thing, question, rules, palette),
            QuestionTopic::Closest => self.closest(question, rules),
        }?;
        question
            .choices
            .texts()
            .iter()
            .position(|text| *text == answer)
    }

    /// The room type by the seen segments. If the rulebook gives none, the type with the highest score, if it is alone with it.
    fn room(&self, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let signs = classify(&self.statistics, book);
        signs.room.ok().or_else(|| {
            let highest = signs.scores.values().max()?;
            let mut first = signs.scores.iter().filter(|(_, score)| *score == highest);
            let (room, _) = first.next()?;
            let is_alone = first.next().is_none();
            (is_alone && book.room.order.contains(room)).then(|| room.clone())
        })
    }

    /// Yes if the things that the activity needs are seen. Else by the type of room, if there is one.
    fn affordance(&self, activity: usize, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let activity = book.activity.get(activity)?;
        let enabled = activity.enablers.iter().any(|tokens| {
            tokens
                .iter()
                .all(|token| self.statistics.has_token(token, book))
        });
        let yes = enabled || activity.rooms.contains(&self.room(rules)?);
        Some(yes_no(yes))
    }

    /// Yes if the thing is seen. No if at least half of the area of all things is seen, and the thing is not among it: without
    /// this, a black image would be answered with no.
    fn presence(&self, thing: &ThingWord, rules: &Rules) -> Option<String> {
        let is_seen = self
            .statistics
            .segments
            .iter()
            .any(|segment| thing.calls(segment, rules.book()));
        (is_seen || self.sees_half(rules)).then(|| yes_no(is_seen))
    }

    /// Whether at least half of the area of the frame's things is seen; of all segments, if there is no thing.
    fn sees_half(&self, rules: &Rules) -> bool {
        let book = rules.book();
        let is_thing = |segment: &&Segment| !book.has_flag(&segment.class, ClassFlag::Structural);
        let has_things = self.frame.segments.iter().any(|segment| is_thing(&segment));
        let area = |segments: &[Segment]| -> u64 {
            segments
                .iter()
                .filter(|segment| !has_things || is_thing(segment))
                .map(|segment| segment.area)
                .sum()
        };
        let (seen, all) = (area(&self.statistics.segments), area(&self.frame.segments));
        all > 0 && 2 * seen >= all
    }

    /// The colour of the largest segment that is called so, if that one is seen, among the colours offered.
    fn color(
        &self,
        thing: &ThingWord,
        question: &Question,
        rules: &Rules,
        palette: &Palette,
    ) -> Option<String> {
        let largest = self
            .frame
            .segments
            .iter()
            .filter(|segment| thing.calls(segment, rules.book()))
            .max_by_key(|segment| (segment.area, std::cmp::Reverse(segment.id)))?;
        let shade: &ColorPosterior = self.colors.get(&largest.id)?.as_ref()?;
        let texts = question.choices.texts();
        let offered: Vec<Color> = Color::ALL
            .into_iter()
            .filter(|color| texts.iter().any(|text| text == color.name()))
            .collect();
        let color = shade.name(palette, &offered)?;
        Some(color.name().to_owned())
    }

    /// The nearest of the offered things that are seen, if at least two of the classes offered are: nearness is a comparison.
    fn closest(&self, question: &Question, rules: &Rules) -> Option<String> {
        let book = rules.book();
        let texts = question.choices.texts();
        let measured: Vec<_> = self
            .statistics
            .segments
            .iter()
            .filter(|segment| {
                let word = segment.question_word(book);
                book.has_flag(&segment.class, ClassFlag::Asked)
                    && texts.iter().any(|text| Some(&**text) == word)
            })
            .filter_map(|segment| Some((segment.reliable_depth(book)?, segment)))
            .collect();
        let (_, nearest) = measured
            .iter()
            .min_by_key(|(depth, _)| (depth.median, depth.p10))?;
        let has_two = measured
            .iter()
            .any(|(_, segment)| segment.class != nearest.class);
        has_two.then(|| nearest.question_word(book).map(str::to_owned))?
    }
}

fn yes_no(yes: bool) -> String {
    YES_NO[usize::from(!yes)].to_owned()
}
