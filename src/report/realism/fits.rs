//! The table and the file of fitted gains: [`table`], [`by_pair`] and [`csv()`].

use crate::error::Result;
use crate::text::csv;
use crate::text::table::ColumnKind::{Number, Text};
use crate::text::table::TableBuilder;
use crate::text::terminal;
use darkqa_score::photographs::realism::gain::{FitOutcome, PairFit, PooledGain, ProfileFit};
use darkqa_score::photographs::realism::mean::Mean;

/// The definition of a picture's gain, printed beside every gain.
pub(crate) const AS_SAVED: &str =
    "as saved; a smaller K than the sensor's means that noise was averaged away";

/// The table of the gains over pairs, a row for each noise profile.
pub(super) fn table(fits: &[ProfileFit]) -> String {
    let range = |gains: &PooledGain| {
        let [low, high] = gains.range.map(number);
        format!("{low} to {high}")
    };
    let table = TableBuilder::new("fits", fits)
        .column(Text, "terminal", |fit| fit.profile.to_string())
        .column(Text, "terminal K", |fit| {
            fit.pooled.as_ref().map(|gains| mean(fit, gains, 1.0))
        })
        .column(Text, "terminal rK", |fit| {
            let product = mean(fit, fit.pooled.as_ref()?, fit.ratio?);
            Some(format!("{product} at r {}", number(fit.ratio?)))
        })
        .column(Text, "terminal 10–90 %", |fit| {
            fit.pooled.as_ref().map(range)
        })
        .column(Text, "terminal pairs fitted", |fit| {
            let fitted = fit.pooled.as_ref().map_or(0, |gains| gains.n);
            format!("{fitted} of {}", fit.pairs.len())
        })
        .build();
    format!(
        "System gain K by the spread of smooth blocks, {AS_SAVED}\n{}",
        terminal::table(&[table])
    )
}

/// The geometric mean of a multiple of K with its interval; the values alone where there are too few for it.
fn mean(fit: &ProfileFit, gains: &PooledGain, factor: f64) -> String {
    let number = |gain: f64| number(factor * gain);
    if let Some(Mean {
        value,
        interval: Some(ends),
        ..
    }) = &gains.mean
    {
        let [low, high] = ends.map(&number);
        return format!("{} ({low} to {high})", number(*value));
    }
    fit.pairs
        .iter()
        .filter_map(|pair| pair.fit.fitted())
        .map(number)
        .collect::<Vec<_>>()
        .join(", ")
}

/// A line of text for each pair and each noise profile.
pub(super) fn by_pair(fits: &[ProfileFit]) -> impl Iterator<Item = String> {
    fits.iter()
        .flat_map(|fit| fit.pairs.iter().map(|pair| line(fit, pair)))
}

fn line(fit: &ProfileFit, PairFit { pair, fit: found }: &PairFit) -> String {
    let gain = found.gain.map(|gain| match fit.ratio {
        Some(ratio) => format!(
            "rK {} (K {} at r {})",
            number(ratio * gain),
            number(gain),
            number(ratio)
        ),
        None => format!("K {}", number(gain)),
    });
    let misfit = found.misfit.map(|misfit| format!("misfit {misfit:.2}"));
    let outcome = found.outcome != FitOutcome::Fitted;
    let outcome = outcome.then(|| found.outcome.to_string());
    let parts: Vec<String> = [gain, misfit, outcome].into_iter().flatten().collect();
    format!("{pair}, {}: {}", fit.profile, parts.join(", "))
}

/// A number with three significant digits.
fn number(value: f64) -> String {
    let digits = 2 - libm::log10(value.abs().max(1e-9)).floor() as i32;
    let text = format!("{value:.*}", digits.clamp(0, 9) as usize);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// CSV file with a row for each pair and each noise profile.
pub(crate) fn csv(fits: &[ProfileFit]) -> Result<Vec<u8>> {
    let rows = fits
        .iter()
        .flat_map(|fit| fit.pairs.iter().map(move |pair| (fit, pair)));
    let table = TableBuilder::new("fits", rows)
        .column(Text, "csv pair", |(_, pair)| pair.pair.clone())
        .column(Text, "csv reading", |(fit, _)| fit.profile.to_string())
        .column(Number, "csv gain", |(_, pair)| pair.fit.gain)
        .column(Number, "csv ratio", |(fit, _)| fit.ratio)
        .column(Number, "csv ratio_gain", |(fit, pair)| {
            Some(fit.ratio? * pair.fit.gain?)
        })
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
        for (value, text) in [
            (0.044_712, "0.0447"),
            (0.2, "0.2"),
            (8.942, "8.94"),
            (200.0, "200"),
            (1234.5, "1234"),
            (30.0, "30"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
