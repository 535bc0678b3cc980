//! ClassifyRoom of the paper's Algorithm 1: what type of room a frame shows, [`classify`].

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::rules::{Clue, Contest, RuleBook, Sign};
use super::statistics::{FrameStatistics, Segment};

/// What a frame says of its room.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoomSigns {
    /// The scores of all rooms that anything speaks for.
    pub scores: BTreeMap<String, u32>,
    /// The segments that speak for each, by number.
    pub segments: BTreeMap<String, Vec<u32>>,
    /// The room, or why there is none.
    pub room: Result<String, NoRoom>,
}

/// Why a frame has no room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoRoom {
    /// Nothing speaks for any.
    NoSigns,
    /// What speaks for the first is too little.
    Weak,
    /// Two contend, and neither wins.
    Contested,
    /// The room is none that questions ask about.
    NotAsked,
}

/// Who says what room it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum RoomSource {
    /// What is seen of it, as in the paper.
    #[default]
    Signature,
    /// A person, in the data set.
    Stated,
}

/// Classifies the room of a frame by what is seen in it.
///
/// Each clue of the rulebook counts once. The first room by score wins where it has enough and no other contends; of two
/// that contend, one wins by one of the rulebook's contests, or where the other is small and far behind: a room seen through
/// a door.
#[must_use]
pub(crate) fn classify(statistics: &FrameStatistics, book: &RuleBook) -> RoomSigns {
    let signs = Signs::of(statistics, book);
    let mut scores = BTreeMap::new();
    let mut segments: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    for clue in &book.clue {
        if let Some(seen) = signs.holds(clue) {
            *scores.entry(clue.room.clone()).or_insert(0) += clue.weight;
            let list = segments.entry(clue.room.clone()).or_default();
            list.extend(seen.iter().map(|segment| segment.id));
            list.sort_unstable();
            list.dedup();
        }
    }
    let room = winner(&signs, &scores, &segments).and_then(|room| {
        if book.room.order.contains(&room) {
            Ok(room)
        } else {
            Err(NoRoom::NotAsked)
        }
    });
    RoomSigns {
        scores,
        segments,
        room,
    }
}

/// What is seen, by token.
struct Signs<'a> {
    statistics: &'a FrameStatistics,
    book: &'a RuleBook,
    tokens: BTreeMap<&'a str, Vec<&'a Segment>>,
}

impl<'a> Signs<'a> {
    fn of(statistics: &'a FrameStatistics, book: &'a RuleBook) -> Self {
        let mut tokens: BTreeMap<&str, Vec<&Segment>> = BTreeMap::new();
        for segment in statistics.evidence(book) {
            tokens.entry(segment.token(book)).or_default().push(segment);
        }
        Self {
            statistics,
            book,
            tokens,
        }
    }

    /// The segments by which a clue holds.
    fn holds(&self, clue: &Clue) -> Option<Vec<&'a Segment>> {
        if clue
            .unseen
            .iter()
            .any(|token| self.statistics.shows(token, self.book))
        {
            return None;
        }
        let mut seen = Vec::new();
        for sign in &clue.seen {
            seen.extend(self.seen(sign)?);
        }
        Some(seen)
    }

    fn seen(&self, sign: &Sign) -> Option<Vec<&'a Segment>> {
        let segments = self.tokens.get(sign.token.as_str())?;
        let large = segments
            .iter()
            .filter(|segment| self.statistics.area(segment) >= sign.area_ppm);
        let large: Vec<&Segment> = large.copied().collect();
        let many = large.len() >= sign.least && sign.most.is_none_or(|most| large.len() <= most);
        many.then_some(large)
    }

    fn area(&self, token: &str) -> u64 {
        let segments = self.tokens.get(token).into_iter().flatten();
        segments.map(|segment| segment.area).sum()
    }

    fn wins(&self, contest: &Contest, score: u32) -> bool {
        let larger = contest
            .tokens
            .as_ref()
            .is_none_or(|[own, other]| self.area(own) >= contest.area_ratio * self.area(other));
        score >= contest.least_score
            && larger
            && !contest
                .unseen
                .iter()
                .any(|token| self.statistics.shows(token, self.book))
    }

    /// Whether the second room is seen through a door: all of it small and far behind the first.
    fn behind(&self, first: &[u32], second: &[u32]) -> bool {
        let rule = &self.book.doorway;
        let of = |ids: &[u32]| -> Vec<&Segment> {
            let segments = self.statistics.segments.iter();
            segments
                .filter(|segment| ids.contains(&segment.id))
                .collect()
        };
        let (first, second) = (of(first), of(second));
        let area = |list: &[&Segment]| -> u64 { list.iter().map(|segment| segment.area).sum() };
        let medians = |list: &[&Segment]| -> Option<Vec<u64>> {
            let medians = list
                .iter()
                .map(|segment| Some(segment.measured(self.book)?.median.into()));
            medians.collect()
        };
        let (Some(near), Some(far)) = (medians(&first), medians(&second)) else {
            return false;
        };
        let (Some(near), Some(far)) = (near.into_iter().max(), far.into_iter().min()) else {
            return false;
        };
        area(&first) >= rule.area_ratio * area(&second)
            && far * 1_000_000 >= near * rule.depth_ratio_ppm
    }
}

fn winner(
    signs: &Signs<'_>,
    scores: &BTreeMap<String, u32>,
    segments: &BTreeMap<String, Vec<u32>>,
) -> Result<String, NoRoom> {
    let rule = &signs.book.room;
    let place = |room: &str| {
        rule.order
            .iter()
            .position(|other| other == room)
            .unwrap_or(usize::MAX)
    };
    let mut ranked: Vec<(&String, u32)> =
        scores.iter().map(|(room, score)| (room, *score)).collect();
    ranked.sort_by_key(|(room, score)| (std::cmp::Reverse(*score), place(room), *room));
    let Some(&(first, score)) = ranked.first() else {
        return Err(NoRoom::NoSigns);
    };
    if score < rule.least_score {
        return Err(NoRoom::Weak);
    }
    let contends = |other: u32| other >= rule.least_score || score - other < rule.least_lead;
    let rivals: Vec<(&String, u32)> = ranked[1..]
        .iter()
        .copied()
        .filter(|(_, other)| contends(*other))
        .collect();
    let [(second, other)] = rivals[..] else {
        return if rivals.is_empty() {
            Ok(first.clone())
        } else {
            Err(NoRoom::Contested)
        };
    };
    for contest in &signs.book.contest {
        let pair = [(first, second, score), (second, first, other)];
        for (winner, loser, score) in pair {
            let theirs = contest.winner == *winner && contest.loser == *loser;
            if theirs && score >= rule.least_score && signs.wins(contest, score) {
                return Ok(winner.clone());
            }
        }
    }
    let own = |room: &str| segments.get(room).map_or(&[][..], Vec::as_slice);
    if signs.behind(own(first), own(second)) {
        Ok(first.clone())
    } else if score == other && signs.behind(own(second), own(first)) {
        Ok(second.clone())
    } else {
        Err(NoRoom::Contested)
    }
}
