//! One frame through the levels with the models' answers on it: [`Strip`].

use std::collections::{BTreeSet, HashSet};

use serde::Serialize;

use super::inputs::PageInputs;
use crate::error::Result;
use crate::text::words::light;
use crate::types::{Axis, AxisLevel, EnhancerName, FrameId, Thumbnail, Variant};
use darkqa_score::choice::ReadingMode;
use darkqa_score::grid::{Grid, TrialResult};
use darkqa_score::model_in_condition::{ModelInCondition, pooled_models};

/// Most models whose answers stand on an image, and most rows; chosen for one screen.
const MAX_MODELS: usize = 3;
const MAX_ROWS: usize = 4;

/// One frame at each level, raw and enhanced, with each model's answer to one question.
#[derive(Serialize)]
pub(super) struct Strip {
    question: String,
    /// The true choice; empty if nobody knows it.
    truth: String,
    levels: Vec<String>,
    rows: Vec<StripRow>,
}

#[derive(Serialize)]
struct StripRow {
    name: String,
    cells: Vec<Option<StripCell>>,
}

#[derive(Serialize)]
struct StripCell {
    url: String,
    alt: String,
    answers: Vec<Answer>,
}

/// A model's answer in one condition.
#[derive(Serialize)]
struct Answer {
    class: &'static str,
    sign: char,
    /// The chosen text, or that no choice could be read; before it the model's name if there are several.
    text: String,
}

/// One row of images: a variant, raw or with an enhancer.
struct Row<'a> {
    variant: Variant,
    enhancer: Option<&'a EnhancerName>,
}

impl Strip {
    /// The strip of the first frame with thumbnails and of that of its questions whose answers change most between L0 and the other
    /// images; `None` without thumbnails in several lights.
    ///
    /// # Errors
    /// If the question cannot be read.
    pub(super) fn new(grid: &Grid<'_>, inputs: &PageInputs<'_>) -> Result<Option<Self>> {
        let thumbnails: Vec<&Thumbnail> = inputs
            .thumbnails
            .iter()
            .filter(|thumbnail| thumbnail.condition.level().is_shown_on(Axis::LIGHT))
            .collect();
        let Some(frame) = thumbnails.iter().map(|thumbnail| &thumbnail.frame).min() else {
            return Ok(None);
        };
        let levels: BTreeSet<AxisLevel> = thumbnails
            .iter()
            .map(|thumbnail| thumbnail.condition.level())
            .collect();
        let rows = rows(grid, &thumbnails);
        let models = models(grid);
        let changes = |item: usize| {
            rows.iter()
                .flat_map(|row| levels.iter().map(move |level| (row, *level)))
                .filter(|(row, level)| {
                    models.iter().any(|model| {
                        row.seen(grid, model, item, *level).is_right() == Some(false)
                            && row.seen(grid, model, item, AxisLevel::L0).is_right() == Some(true)
                    })
                })
                .count()
        };
        let items = grid.items.iter().enumerate();
        // Of equal ones the first.
        let Some(item) = items
            .filter(|(_, item)| *item.asked.frame == *frame)
            .map(|(place, _)| place)
            .rev()
            .max_by_key(|place| changes(*place))
        else {
            return Ok(None);
        };
        if rows.is_empty() || levels.len() < 2 {
            return Ok(None);
        }
        let asked = grid.items[item].asked;
        let wanted = HashSet::from([&*asked.question]);
        let question = (inputs.questions)(&wanted)?
            .remove(&*asked.question)
            .map(|question| question.text);
        let truth = asked.truth.and_then(|truth| asked.choices.get(truth));
        Ok(Some(Self {
            question: question.unwrap_or_else(|| asked.question.to_string()),
            truth: truth.cloned().unwrap_or_default(),
            rows: rows
                .iter()
                .map(|row| row.filled(grid, &models, item, frame, &thumbnails, &levels))
                .collect(),
            levels: levels.iter().map(AxisLevel::to_string).collect(),
        }))
    }
}

impl<'a> Row<'a> {
    /// An item as a model saw it at a level of this row.
    fn seen(
        &'a self,
        grid: &'a Grid<'a>,
        model: &'a str,
        item: usize,
        level: AxisLevel,
    ) -> Seen<'a> {
        Seen {
            grid,
            model,
            item,
            level,
            row: self,
        }
    }

    /// The row with its images and the answers to an item.
    fn filled(
        &self,
        grid: &Grid<'_>,
        models: &[&str],
        item: usize,
        frame: &FrameId,
        thumbnails: &[&Thumbnail],
        levels: &BTreeSet<AxisLevel>,
    ) -> StripRow {
        let cells = levels.iter().map(|level| {
            let thumbnail = thumbnails
                .iter()
                .find(|thumbnail| thumbnail.frame == *frame && self.shows(thumbnail, *level))?;
            let answers: Vec<Answer> = models
                .iter()
                .filter_map(|model| {
                    let seen = self.seen(grid, model, item, *level);
                    seen.answer(models.len() > 1)
                })
                .collect();
            let texts: Vec<String> = answers
                .iter()
                .map(|answer| format!("{} {}", answer.sign, answer.text))
                .collect();
            Some(StripCell {
                url: thumbnail.small.clone(),
                alt: format!("{frame} at {}: {}", thumbnail.condition, texts.join(", ")),
                answers,
            })
        });
        StripRow {
            name: light(&self.variant, self.enhancer),
            cells: cells.collect(),
        }
    }

    /// Whether a thumbnail is of this row at a level. The clean frame begins each row of raw images.
    fn shows(&self, thumbnail: &Thumbnail, level: AxisLevel) -> bool {
        let condition = &thumbnail.condition;
        condition.level() == level
            && condition.enhancer.as_ref() == self.enhancer
            && (condition.kind_reading() == self.variant || level == AxisLevel::L0)
    }
}

/// The rows: the exposure drop or another variant beside the main one, the main one, and the main one with each enhancer.
fn rows<'a>(grid: &Grid<'_>, thumbnails: &[&'a Thumbnail]) -> Vec<Row<'a>> {
    let Some(main) = grid.main_variant() else {
        return Vec::new();
    };
    let shown: BTreeSet<(Variant, Option<&EnhancerName>)> = thumbnails
        .iter()
        .map(|thumbnail| {
            let condition = &thumbnail.condition;
            (condition.kind_reading(), condition.enhancer.as_ref())
        })
        .filter(|(variant, _)| variant.is_degraded())
        .collect();
    let beside = shown
        .iter()
        .find(|(variant, enhancer)| *variant != main && enhancer.is_none());
    let of_main = shown.iter().filter(|(variant, _)| *variant == main);
    beside
        .into_iter()
        .chain(of_main)
        .take(MAX_ROWS)
        .map(|(variant, enhancer)| Row {
            variant: variant.clone(),
            enhancer: *enhancer,
        })
        .collect()
}

/// The first models that saw images.
fn models<'a>(grid: &'a Grid<'_>) -> Vec<&'a str> {
    let mut seeing: Vec<&str> = grid
        .subjects
        .iter()
        .filter(|subject| subject.level.is_some())
        .map(|subject| &*subject.model)
        .collect();
    seeing.dedup();
    let pooled = pooled_models(seeing.iter().copied());
    seeing.retain(|model| pooled.contains(model));
    seeing.truncate(MAX_MODELS);
    seeing
}

/// An item as a model saw it: at a level of a row.
#[derive(Clone, Copy)]
struct Seen<'a> {
    grid: &'a Grid<'a>,
    model: &'a str,
    item: usize,
    level: AxisLevel,
    row: &'a Row<'a>,
}

impl Seen<'_> {
    /// The result, with an enhancer of the row or without; `None` if the grid has no such subject.
    fn result(self, enhancer: Option<&EnhancerName>) -> Option<TrialResult> {
        let subject =
            ModelInCondition::with_images(self.model, self.level, &self.row.variant, enhancer);
        Some(
            self.grid
                .result(self.grid.find_up_to_group(&subject)?, self.item),
        )
    }

    /// Whether the strict parsing of the reply is right, that at L0 without an enhancer; `None` without a reply or a true choice.
    fn is_right(self) -> Option<bool> {
        let enhancer = self.row.enhancer.filter(|_| self.level != AxisLevel::L0);
        let reading = self.result(enhancer)?.reading(ReadingMode::Strict)?;
        let item = &self.grid.items[self.item];
        item.asked.truth?;
        Some(item.is_right(reading))
    }

    /// The answer, with the model's name or without; `None` if the item was not asked.
    fn answer(self, is_named: bool) -> Option<Answer> {
        let result = self.result(self.row.enhancer)?;
        if !result.is_asked() {
            return None;
        }
        let item = &self.grid.items[self.item];
        let (class, sign, text) = match result.reading(ReadingMode::Strict) {
            None => ("none", '–', "no reply"),
            Some(None) => ("none", '?', "not readable"),
            Some(Some(chosen)) => {
                let text = item.asked.choices.get(usize::from(chosen));
                let text = text.map_or("", String::as_str);
                match item.asked.truth {
                    None => ("none", '·', text),
                    Some(_) if item.is_right(Some(chosen)) => ("right", '✓', text),
                    Some(_) => ("wrong", '✗', text),
                }
            }
        };
        Some(Answer {
            class,
            sign,
            text: if is_named {
                format!("{}: {text}", self.model)
            } else {
                text.to_owned()
            },
        })
    }
}
