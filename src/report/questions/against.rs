//! Comparison of two sets of frames by the quartiles of their appearance: [`AppearanceComparison`].

use serde::Serialize;

use crate::report::text::table::ColumnKind::Text;
use crate::report::text::table::TableBuilder;
use crate::report::text::terminal;
use darkqa_questions::appearance::{FrameAppearance, MIN_EDGE_GRADIENT};
use darkqa_questions::colors::{Color, NONE};

/// Measures of appearance of two sets of frames.
#[derive(Debug, Serialize)]
pub(crate) struct AppearanceComparison {
    /// Name and number of frames of each set.
    sets: [(String, usize); 2],
    rows: Vec<MeasureRow>,
}

/// One measure of both sets.
#[derive(Debug, Serialize)]
struct MeasureRow {
    measure: String,
    /// Quartiles of each set (25 %, 50 % and 75 %) over the frames that have the measure; `None` without such frames.
    quartiles: [Option<[f64; 3]>; 2],
    /// Number of decimals in the table.
    #[serde(skip)]
    decimals: usize,
}

impl MeasureRow {
    fn new(
        sets: [&[FrameAppearance]; 2],
        measure: &str,
        decimals: usize,
        value: impl Fn(&FrameAppearance) -> Option<f64>,
    ) -> Self {
        Self {
            measure: measure.to_owned(),
            quartiles: sets.map(|frames| quartiles(frames.iter().filter_map(&value).collect())),
            decimals,
        }
    }

    /// Median and quartiles of the first (0) or the other (1) set.
    fn text(&self, set: usize) -> String {
        match self.quartiles[set] {
            Some(quartiles) => {
                let [low, middle, high] = quartiles.map(|value| format!("{value:.*}", self.decimals));
                format!("{middle} ({low} to {high})")
            }
            None => "–".to_owned(),
        }
    }

    /// Position of the first set's median relative to the quartiles of the other set.
    fn median_position(&self) -> &'static str {
        match self.quartiles {
            [Some([_, middle, _]), Some([low, _, _])] if middle < low => "below",
            [Some([_, middle, _]), Some([_, _, high])] if middle > high => "above",
            [Some(_), Some(_)] => "within",
            _ => "–",
        }
    }
}

/// Nearest-rank quartiles; `None` without numbers.
fn quartiles(mut numbers: Vec<f64>) -> Option<[f64; 3]> {
    numbers.sort_by(f64::total_cmp);
    let count = numbers.len();
    (count > 0).then(|| [1, 2, 3].map(|quarter| numbers[(count * quarter).div_ceil(4) - 1]))
}

impl AppearanceComparison {
    /// Compares two sets of frames, each with its name.
    #[must_use]
    pub(crate) fn new(sets: [(&str, &[FrameAppearance]); 2]) -> Self {
        let looks = sets.map(|(_, looks)| looks);
        let mut rows = vec![
            MeasureRow::new(looks, "mean linear light, EV of white", 2, |look| Some(look.light_ev)),
            MeasureRow::new(looks, "pixels at edges, %", 1, |look| Some(100.0 * look.edges)),
            MeasureRow::new(looks, "segments", 0, |look| look.segments.map(|n| n as f64)),
            MeasureRow::new(looks, "depth, median, m", 2, |look| look.depth.map(|[_, m, _]| m)),
            MeasureRow::new(looks, "depth, 90 % less 10 %, m", 2, |look| look.depth.map(|[near, _, far]| far - near)),
        ];
        rows.extend(Color::ALL.iter().enumerate().map(|(place, color)| {
            let measure = format!("{} pixels, %", color.name());
            MeasureRow::new(looks, &measure, 1, |look| Some(100.0 * look.colors[place]))
        }));
        rows.push(MeasureRow::new(looks, "pixels of no colour's name, %", 1, |look| Some(100.0 * look.colors[NONE])));
        Self { sets: sets.map(|(name, looks)| (name.to_owned(), looks.len())), rows }
    }

    /// Formats the table for the terminal.
    #[must_use]
    pub(crate) fn table(&self) -> String {
        let [first, other] = [0, 1].map(|set| {
            let (name, frames) = &self.sets[set];
            format!("terminal {name} ({frames})").replace(", ", " ")
        });
        let table = TableBuilder::new("against", &self.rows)
            .column(Text, "terminal by frame", |row| row.measure.clone())
            .column(Text, &*first, |row| row.text(0))
            .column(Text, &*other, |row| row.text(1))
            .column(Text, "terminal median is", |row| row.median_position())
            .build();
        format!(
            "{}medians (quartiles); edges: {MIN_EDGE_GRADIENT} codes of luma per pixel, images of 480 rows at most; colours of pixels are named by the table of the rules\n",
            terminal::table(&[table])
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(light_ev: f64, segments: Option<usize>) -> FrameAppearance {
        FrameAppearance { light_ev, edges: 0.25, colors: [0.0; 12], segments, depth: None }
    }

    #[test]
    fn quartiles_are_nearest_ranks() {
        // Ranks 1, 2 and 3 of four numbers.
        let numbers = vec![-1.0, -2.0, -3.0, -4.0];
        assert_eq!(quartiles(numbers), Some([-4.0, -3.0, -2.0]));
        assert!(quartiles(Vec::new()).is_none());
    }

    #[test]
    fn medians_are_compared_with_quartiles() {
        let dark: Vec<FrameAppearance> = (1..=4).map(|ev| look(-f64::from(ev), Some(9))).collect();
        let bright = vec![look(-0.5, None)];
        for (first, other, expected) in [
            (&dark, &dark, ["within", "within", "–"]),
            (&dark, &bright, ["below", "–", "–"]),
            (&bright, &dark, ["above", "–", "–"]),
        ] {
            let comparison = AppearanceComparison::new([("a", first), ("b", other)]);
            let positions = [0, 2, 3].map(|row: usize| comparison.rows[row].median_position());
            assert_eq!(positions, expected);
        }
    }
}
