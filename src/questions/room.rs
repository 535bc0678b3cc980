//! Room type of a frame, `ClassifyRoom` of the paper's Algorithm 1: [`classify`].
//!
//! Colours of objects in all views of a scene: [`Views`].

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::colors::{Color, Palette};
use super::rules::{Clue, Contest, RuleBook, Sign};
use super::statistics::{FrameStatistics, Segment, WordSource};

/// Evidence in a frame for each room type, and the resulting room type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoomSigns {
    /// Score of each room type: the sum of the weights of its clues. Room types without a clue are left out.
    pub scores: BTreeMap<String, u32>,
    /// Numbers of the segments that are evidence for each room type.
    pub segments: BTreeMap<String, Vec<u32>>,
    /// Room type, or the reason why the frame has none.
    pub room: Result<String, NoRoom>,
    /// Winning room type, even if questions do not ask about it.
    pub winner: Option<String>,
}

/// Reason why a frame has no room type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoRoom {
    /// No clue of the rulebook matches.
    NoSigns,
    /// The highest score is too low.
    Weak,
    /// Two or more room types have similar scores, and none wins.
    Contested,
    /// Questions do not ask about the winning type.
    NotAsked,
}

/// Source of a frame's room type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum RoomSource {
    /// The objects visible in the frame, as in the paper.
    #[default]
    Signature,
    /// The room that the data set states.
    Stated,
}

/// Classifies the room of a frame by the objects visible in it.
///
/// Each clue of the rulebook counts once. The room type with the highest score wins if the score is high enough and it
/// has no rival. If it has a single rival, a contest of the rulebook decides between the two. Without a decision, one
/// wins if the segments of the other are small and far behind, because that room is seen through a door.
#[must_use]
pub fn classify(statistics: &FrameStatistics, book: &RuleBook) -> RoomSigns {
    let evidence = Evidence::new(statistics, book);
    let mut scores = BTreeMap::new();
    let mut segments: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    for clue in &book.clue {
        if let Some(matched) = evidence.matching_segments(clue) {
            *scores.entry(clue.room.clone()).or_insert(0) += clue.weight;
            let list = segments.entry(clue.room.clone()).or_default();
            list.extend(matched.iter().map(|segment| segment.id));
            list.sort_unstable();
            list.dedup();
        }
    }
    let winner = find_winner(&evidence, &scores, &segments);
    let room =
        winner.clone().and_then(|room| if book.room.order.contains(&room) { Ok(room) } else { Err(NoRoom::NotAsked) });
    RoomSigns { scores, segments, room, winner: winner.ok() }
}

/// Segments that are evidence, by token.
struct Evidence<'a> {
    statistics: &'a FrameStatistics,
    book: &'a RuleBook,
    tokens: BTreeMap<&'a str, Vec<&'a Segment>>,
}

impl<'a> Evidence<'a> {
    fn new(statistics: &'a FrameStatistics, book: &'a RuleBook) -> Self {
        let mut tokens: BTreeMap<&str, Vec<&Segment>> = BTreeMap::new();
        for segment in statistics.evidence(book) {
            tokens.entry(segment.token(book)).or_default().push(segment);
        }
        Self { statistics, book, tokens }
    }

    /// Segments that match a clue; `None` if it does not match.
    fn matching_segments(&self, clue: &Clue) -> Option<Vec<&'a Segment>> {
        if clue.unseen.iter().any(|token| self.statistics.has_token(token, self.book)) {
            return None;
        }
        let mut matched = Vec::new();
        for sign in &clue.seen {
            matched.extend(self.segments_of_sign(sign)?);
        }
        Some(matched)
    }

    /// Segments that match a sign of a clue; `None` if their number is out of its range.
    fn segments_of_sign(&self, sign: &Sign) -> Option<Vec<&'a Segment>> {
        let segments = self.tokens.get(sign.token.as_str())?;
        let large: Vec<&Segment> =
            segments.iter().filter(|segment| self.statistics.area_ppm(segment) >= sign.area_ppm).copied().collect();
        let in_range = large.len() >= sign.least && sign.most.is_none_or(|most| large.len() <= most);
        in_range.then_some(large)
    }

    /// Total area of the segments of a token, in pixels.
    fn area(&self, token: &str) -> u64 {
        self.tokens.get(token).into_iter().flatten().map(|segment| segment.area).sum()
    }

    /// True if the winner of a contest, with this score, meets its conditions.
    fn wins(&self, contest: &Contest, score: u32) -> bool {
        let is_larger =
            contest.tokens.as_ref().is_none_or(|[own, other]| self.area(own) >= contest.area_ratio * self.area(other));
        score >= contest.least_score
            && is_larger
            && !contest.unseen.iter().any(|token| self.statistics.has_token(token, self.book))
    }

    /// True if the second room is seen through a door: its segments are small and all far behind the first's.
    fn is_behind(&self, first: &[u32], second: &[u32]) -> bool {
        let rule = &self.book.doorway;
        let lists =
            [first, second].map(|ids| self.statistics.segments.iter().filter(|segment| ids.contains(&segment.id)));
        let [first_area, second_area]: [u64; 2] = lists.clone().map(|list| list.map(|segment| segment.area).sum());
        let [near, far]: [Option<Vec<u64>>; 2] =
            lists.map(|list| list.map(|segment| Some(segment.reliable_depth(self.book)?.median.into())).collect());
        let near = near.and_then(|depths| depths.into_iter().max());
        let far = far.and_then(|depths| depths.into_iter().min());
        let (Some(near), Some(far)) = (near, far) else {
            return false;
        };
        first_area >= rule.area_ratio * second_area && far * 1_000_000 >= near * rule.depth_ratio_ppm
    }
}

/// Determines the winning room type from the scores and the segments of all room types.
fn find_winner(
    evidence: &Evidence<'_>,
    scores: &BTreeMap<String, u32>,
    segments: &BTreeMap<String, Vec<u32>>,
) -> Result<String, NoRoom> {
    let rule = &evidence.book.room;
    let mut ranked: Vec<(&String, u32)> = scores.iter().map(|(room, score)| (room, *score)).collect();
    ranked.sort_by_key(|(room, score)| {
        let position = rule.order.iter().position(|other| other == *room);
        let position = position.unwrap_or(usize::MAX);
        (std::cmp::Reverse(*score), position, *room)
    });
    let Some(&(first, score)) = ranked.first() else {
        return Err(NoRoom::NoSigns);
    };
    if score < rule.least_score {
        return Err(NoRoom::Weak);
    }
    let rivals: Vec<(&String, u32)> = ranked[1..]
        .iter()
        .copied()
        .filter(|(_, other)| *other >= rule.least_score || score - other < rule.least_lead)
        .collect();
    let [(second, other)] = rivals[..] else {
        return if rivals.is_empty() { Ok(first.clone()) } else { Err(NoRoom::Contested) };
    };
    for contest in &evidence.book.contest {
        let pair = [(first, second, score), (second, first, other)];
        for (winner, loser, score) in pair {
            let applies = contest.winner == *winner && contest.loser == *loser;
            if applies && score >= rule.least_score && evidence.wins(contest, score) {
                return Ok(winner.clone());
            }
        }
    }
    let [first_ids, second_ids] = [first, second].map(|room| segments.get(room).map_or(&[][..], Vec::as_slice));
    if evidence.is_behind(first_ids, second_ids) {
        Ok(first.clone())
    } else if score == other && evidence.is_behind(second_ids, first_ids) {
        Ok(second.clone())
    } else {
        Err(NoRoom::Contested)
    }
}

/// Colours of each object in all frames that show at least `color.view_px` core pixels, by scene, segment id and word.
/// A colour is `None` if the palette has no name for it.
///
/// Only segments with names are matched across frames: their ids are the same in all frames of a scene. A connected
/// component has a different id in each frame.
#[derive(Debug, Default)]
pub struct Views(BTreeMap<(String, u32, String), BTreeSet<Option<Color>>>);

impl Views {
    /// Collects the colour of the median of each named segment in these frames.
    pub fn new(frames: &[FrameStatistics], palette: &Palette, book: &RuleBook) -> Self {
        let mut views = Self::default();
        for frame in frames {
            for segment in frame
                .segments
                .iter()
                .filter(|segment| segment.source == WordSource::Name)
                .filter(|segment| segment.core >= book.color.view_px)
            {
                let colors = views.0.entry(Self::key(frame, segment)).or_default();
                colors.insert(palette.color(segment.median));
            }
        }
        views
    }

    fn key(frame: &FrameStatistics, segment: &Segment) -> (String, u32, String) {
        (frame.scene.clone(), segment.id, segment.word.clone())
    }

    /// True if any view of a named object has a colour other than `color`; `None` counts as another colour. False for
    /// segments without names.
    pub fn has_other_color(&self, frame: &FrameStatistics, segment: &Segment, color: Color) -> bool {
        let colors = self.0.get(&Self::key(frame, segment));
        segment.source == WordSource::Name
            && colors.is_some_and(|colors| colors.iter().any(|other| *other != Some(color)))
    }
}
