//! Table and file of the gains fitted to real images: [`table`], [`pair_lines`] and [`csv()`].

use crate::error::Result;
use crate::report::text::csv;
use crate::report::text::table::ColumnKind::{Number, Text};
use crate::report::text::table::TableBuilder;
use crate::report::text::terminal;
use darkqa_score::photographs::realism::gain::{FitOutcome, PairFit, PooledGain, ProfileFit};
use darkqa_score::photographs::realism::mean::Mean;

/// Remark on the gain of a saved image, printed with every gain.
pub(crate) const AS_SAVED: &str = "as saved; a smaller K than the sensor's means that noise was averaged away";

/// Table of the gains over pairs, with a row for each noise profile.
pub(super) fn table(fits: &[ProfileFit]) -> String {
    let table = TableBuilder::new("fits", fits)
        .column(Text, "terminal", |fit| fit.profile.to_string())
        .column(Text, "terminal K", |fit| fit.pooled.as_ref().map(|gains| mean_text(fit, gains, 1.0)))
        .column(Text, "terminal rK", |fit| {
            let product = mean_text(fit, fit.pooled.as_ref()?, fit.ratio?);
            Some(format!("{product} at r {}", number(fit.ratio?)))
        })
        .column(Text, "terminal 10–90 %", |fit| {
            let [low, high] = fit.pooled.as_ref()?.range.map(number);
            Some(format!("{low} to {high}"))
        })
        .column(Text, "terminal pairs fitted", |fit| {
            let fitted = fit.pooled.as_ref().map_or(0, |gains| gains.n);
            format!("{fitted} of {}", fit.pairs.len())
        })
        .build();
    format!("System gain K by the spread of smooth blocks, {AS_SAVED}\n{}", terminal::table(&[table]))
}

/// Geometric mean of K times a factor, with its interval; a list of all values if they are too few for an interval.
fn mean_text(fit: &ProfileFit, gains: &PooledGain, factor: f64) -> String {
    if let Some(Mean { value, interval: Some([low, high]), .. }) = gains.mean {
        let [value, low, high] = [value, low, high].map(|gain| number(factor * gain));
        return format!("{value} ({low} to {high})");
    }
    fit.pairs
        .iter()
        .filter_map(|pair| pair.fit.fitted())
        .map(|gain| number(factor * gain))
        .collect::<Vec<_>>()
        .join(", ")
}

/// One line of text for each pair and each noise profile.
pub(super) fn pair_lines(fits: &[ProfileFit]) -> impl Iterator<Item = String> {
    fits.iter().flat_map(|fit| fit.pairs.iter().map(|pair| pair_line(fit, pair)))
}

fn pair_line(fit: &ProfileFit, PairFit { pair, fit: result }: &PairFit) -> String {
    let gain = result.gain.map(|gain| match fit.ratio {
        Some(ratio) => format!("rK {} (K {} at r {})", number(ratio * gain), number(gain), number(ratio)),
        None => format!("K {}", number(gain)),
    });
    let misfit = result.misfit.map(|misfit| format!("misfit {misfit:.2}"));
    let outcome = (result.outcome != FitOutcome::Fitted).then(|| result.outcome.to_string());
    let parts: Vec<String> = [gain, misfit, outcome].into_iter().flatten().collect();
    format!("{pair}, {}: {}", fit.profile, parts.join(", "))
}

/// Formats a number with three significant digits.
fn number(value: f64) -> String {
    let digits = 2 - libm::log10(value.abs().max(1e-9)).floor() as i32;
    let text = format!("{value:.*}", digits.clamp(0, 9) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// CSV file with a row for each pair and each noise profile.
pub(crate) fn csv(fits: &[ProfileFit]) -> Result<Vec<u8>> {
    let rows = fits.iter().flat_map(|fit| fit.pairs.iter().map(move |pair| (fit, pair)));
    let table = TableBuilder::new("fits", rows)
        .column(Text, "csv pair", |(_, pair)| pair.pair.clone())
        .column(Text, "csv reading", |(fit, _)| fit.profile.to_string())
        .column(Number, "csv gain", |(_, pair)| pair.fit.gain)
        .column(Number, "csv ratio", |(fit, _)| fit.ratio)
        .column(Number, "csv ratio_gain", |(fit, pair)| Some(fit.ratio? * pair.fit.gain?))
        .column(Number, "csv misfit", |(_, pair)| pair.fit.misfit)
        .column(Text, "csv outcome", |(_, pair)| pair.fit.outcome.word())
        .build();
    csv::csv(&[table])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in
            [(0.044_712, "0.0447"), (0.2, "0.2"), (8.942, "8.94"), (200.0, "200"), (1234.5, "1234"), (30.0, "30")]
        {
            assert_eq!(number(value), text);
        }
    }
}
