//! Rows that cannot be asked, by reason: [`Omissions`].

use std::collections::BTreeMap;

use super::skip_bad::SkipBad;
use crate::ready_made::settings::{SetArgs, SeveralImages};

/// Reason why a row is not asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum RowOmission {
    SeveralImages,
    NoImage,
    /// The question has no options.
    Open,
    SeveralTruths,
    /// The row is broken.
    Bad,
    /// A copy of another question with its options in another order, left out by a preset.
    Rotation,
}

impl RowOmission {
    /// Name in the manifest and in messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::SeveralImages => "several images",
            Self::NoImage => "no image",
            Self::Open => "no options",
            Self::SeveralTruths => "several truths",
            Self::Bad => "bad rows",
            Self::Rotation => "rotated copies",
        }
    }

    /// Flag that leaves such rows out.
    fn flag(self) -> &'static str {
        match self {
            Self::SeveralImages => "--multi-image skip",
            Self::NoImage => "--skip no-image",
            Self::Open => "--skip open",
            Self::SeveralTruths => "--skip several",
            Self::Bad | Self::Rotation => "--skip bad",
        }
    }

    /// True if the user allows to leave out such rows.
    fn is_allowed(self, args: &SetArgs) -> bool {
        match self {
            Self::SeveralImages => args.multi_image == Some(SeveralImages::Skip),
            Self::NoImage => args.no_image.is_some(),
            Self::Open => args.open.is_some(),
            Self::SeveralTruths => args.several.is_some(),
            Self::Bad => args.bad.is_some(),
            Self::Rotation => true,
        }
    }
}

/// Number of rows that are not asked, with a description of the first, by reason.
#[derive(Debug, Default)]
pub(crate) struct Omissions {
    counts: BTreeMap<RowOmission, (usize, String)>,
}

impl Omissions {
    /// Adds a row with its problem.
    pub(crate) fn add(&mut self, reason: RowOmission, problem: impl FnOnce() -> String) {
        let (count, _) = self.counts.entry(reason).or_insert_with(|| (0, problem()));
        *count += 1;
    }

    /// Number of rows left out, by reason.
    pub(crate) fn counts(&self) -> impl Iterator<Item = (RowOmission, usize)> {
        self.counts.iter().map(|(reason, (count, _))| (*reason, *count))
    }

    /// Number of broken rows, and the problem of the first; `None` if there are none.
    pub(crate) fn bad(&self) -> Option<(usize, &str)> {
        let (count, first) = self.counts.get(&RowOmission::Bad)?;
        Some((*count, first))
    }

    /// Checks that the user allows all omissions; `rows` is the number of rows of the set.
    ///
    /// # Errors
    /// One line for each reason that is not allowed, with the number of rows, the first row, and the flag that allows
    /// it.
    pub(crate) fn check(&self, rows: usize, args: &SetArgs) -> Result<(), String> {
        let mut problems = Vec::new();
        for (&reason, (count, first)) in &self.counts {
            let head = format!("{count} of {rows} rows");
            let head = match reason {
                RowOmission::SeveralImages => format!("{head} show {first}"),
                RowOmission::NoImage => format!("no image in {head}"),
                RowOmission::Open => {
                    format!("no options in {head}, where the answer is e.g. {first}")
                }
                RowOmission::SeveralTruths => {
                    format!("{head} have several true options, e.g. {first}")
                }
                RowOmission::Bad | RowOmission::Rotation => {
                    format!("{head} are broken; the first: {first}")
                }
            };
            let skip = args.bad.filter(|_| reason == RowOmission::Bad);
            if let Some(Err(problem)) = skip.map(|skip| skip.check(*count, rows, "rows", first)) {
                problems.push(problem);
            } else if !reason.is_allowed(args) {
                let verb = match count {
                    1 => "leaves it out",
                    _ => "leaves them out",
                };
                let flag = match reason {
                    RowOmission::Bad => SkipBad::allowing(*count, rows).flag(),
                    reason => reason.flag().to_owned(),
                };
                let other = match reason {
                    RowOmission::SeveralImages => ", --multi-image send shows all of them in one request",
                    _ => "",
                };
                problems.push(format!("{head}; {flag} {verb}{other}"));
            }
        }
        if problems.is_empty() {
            return Ok(());
        }
        Err(problems.join("\n "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ready_made::settings::LeaveOut;

    #[test]
    fn rows_are_left_out_only_with_flags() {
        let mut left = Omissions::default();
        assert!(left.check(40, &SetArgs::default()).is_ok());
        left.add(RowOmission::NoImage, String::new);
        left.add(RowOmission::SeveralImages, || "2 images".into());
        left.add(RowOmission::SeveralImages, || "3 images".into());
        let problem = left.check(40, &SetArgs::default()).unwrap_err();
        assert!(problem.contains("2 of 40 rows show 2 images; --multi-image skip leaves them out, --multi-image send shows all of them in one request\n no image in 1 of 40 rows; --skip no-image leaves it out"), "{problem}");
        let args =
            SetArgs { no_image: Some(LeaveOut::Skip), multi_image: Some(SeveralImages::Skip), ..SetArgs::default() };
        assert!(left.check(40, &args).is_ok());
        assert_eq!(left.counts().map(|(_, count)| count).sum::<usize>(), 3);
    }

    #[test]
    fn too_many_bad_rows_are_an_error() {
        let args = SetArgs { bad: Some(SkipBad::default()), ..SetArgs::default() };
        let mut left = Omissions::default();
        left.add(RowOmission::Bad, || "a.csv, line 3: empty".into());
        assert!(left.check(20, &args).is_ok());
        let problem = left.check(19, &args).unwrap_err();
        assert!(problem.contains("line 3: empty; --skip bad leaves out at most 5 %"), "{problem}");
    }
}
