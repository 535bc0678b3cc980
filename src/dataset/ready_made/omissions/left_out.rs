//! Rows that cannot be asked, by the reason: [`Omissions`].

use std::collections::BTreeMap;

use super::skip_bad::SkipBad;
use crate::dataset::ready_made::settings::{SetArgs, SeveralImages};

/// Why a row cannot be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::dataset::ready_made) enum OmissionReason {
    SeveralImages,
    NoImage,
    Open,
    SeveralTruths,
    Bad,
    /// A copy of a question in another order of its options, which a preset leaves out.
    Rotation,
}

impl OmissionReason {
    /// The name in the manifest and in messages.
    pub(in crate::dataset::ready_made) fn name(self) -> &'static str {
        match self {
            Self::SeveralImages => "several images",
            Self::NoImage => "no image",
            Self::Open => "no options",
            Self::SeveralTruths => "several truths",
            Self::Bad => "bad rows",
            Self::Rotation => "rotated copies",
        }
    }

    /// The flag that leaves such rows out.
    fn flag(self) -> &'static str {
        match self {
            Self::SeveralImages => "--multi-image skip",
            Self::NoImage => "--skip no-image",
            Self::Open => "--skip open",
            Self::SeveralTruths => "--skip several",
            Self::Bad | Self::Rotation => "--skip bad",
        }
    }

    fn is_left_out(self, args: &SetArgs) -> bool {
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

/// The rows that are not asked: how many, and the place and problem of the first.
#[derive(Debug, Default)]
pub(in crate::dataset::ready_made) struct Omissions {
    counts: BTreeMap<OmissionReason, (usize, String)>,
}

impl Omissions {
    /// Adds a row with its problem.
    pub(in crate::dataset::ready_made) fn add(
        &mut self,
        why: OmissionReason,
        problem: impl FnOnce() -> String,
    ) {
        let entry = self.counts.entry(why).or_insert_with(|| (0, problem()));
        entry.0 += 1;
    }

    /// How many rows are left out, by the reason.
    pub(in crate::dataset::ready_made) fn counts(
        &self,
    ) -> impl Iterator<Item = (OmissionReason, usize)> {
        self.counts.iter().map(|(why, (count, _))| (*why, *count))
    }

    /// The number of broken rows, and the problem of the first; `None` if there are none.
    pub(in crate::dataset::ready_made) fn bad(&self) -> Option<(usize, &str)> {
        let (count, first) = self.counts.get(&OmissionReason::Bad)?;
        Some((*count, first))
    }

    /// Checks that the user allows all of it.
    ///
    /// # Errors
    /// One line for each reason that no flag allows: the count, the first row, and the flag.
    pub(in crate::dataset::ready_made) fn check(
        &self,
        rows: usize,
        args: &SetArgs,
    ) -> Result<(), String> {
        let mut problems = Vec::new();
        for (why, (count, first)) in &self.counts {
            let (why, head) = (*why, format!("{count} of {rows} rows"));
            let head = match why {
                OmissionReason::SeveralImages => format!("{head} show {first}"),
                OmissionReason::NoImage => format!("no image in {head}"),
                OmissionReason::Open => {
                    format!("no options in {head}, where the answer is e.g. {first}")
                }
                OmissionReason::SeveralTruths => {
                    format!("{head} have several true options, e.g. {first}")
                }
                OmissionReason::Bad | OmissionReason::Rotation => {
                    format!("{head} are broken; the first: {first}")
                }
            };
            let skip = args.bad.filter(|_| why == OmissionReason::Bad);
            if let Some(Err(problem)) = skip.map(|skip| skip.check(*count, rows, "rows", first)) {
                problems.push(problem);
            } else if !why.is_left_out(args) {
                let verb = match count {
                    1 => "leaves it out",
                    _ => "leaves them out",
                };
                let flag = match why {
                    OmissionReason::Bad => SkipBad::allowing(*count, rows).flag(),
                    why => why.flag().to_owned(),
                };
                let other = match why {
                    OmissionReason::SeveralImages => {
                        ", --multi-image send shows all of them in one request"
                    }
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
    use crate::dataset::ready_made::settings::LeaveOut;

    #[test]
    fn nothing_is_left_out_without_a_word_of_the_user() {
        let mut left = Omissions::default();
        assert!(left.check(40, &SetArgs::default()).is_ok());
        left.add(OmissionReason::NoImage, String::new);
        left.add(OmissionReason::SeveralImages, || "2 images".into());
        left.add(OmissionReason::SeveralImages, || "3 images".into());
        let problem = left.check(40, &SetArgs::default()).unwrap_err();
        assert!(problem.contains("2 of 40 rows show 2 images; --multi-image skip leaves them out, --multi-image send shows all of them in one request\n no image in 1 of 40 rows; --skip no-image leaves it out"), "{problem}");
        let args = SetArgs {
            no_image: Some(LeaveOut::Skip),
            multi_image: Some(SeveralImages::Skip),
            ..SetArgs::default()
        };
        assert!(left.check(40, &args).is_ok());
        assert_eq!(left.counts().map(|(_, count)| count).sum::<usize>(), 3);
    }

    #[test]
    fn many_bad_rows_are_never_left_out() {
        let args = SetArgs {
            bad: Some(SkipBad::default()),
            ..SetArgs::default()
        };
        let mut left = Omissions::default();
        left.add(OmissionReason::Bad, || "a.csv, line 3: empty".into());
        assert!(left.check(20, &args).is_ok());
        let problem = left.check(19, &args).unwrap_err();
        assert!(
            problem.contains("line 3: empty; --skip bad leaves out at most 5 %"),
            "{problem}"
        );
    }
}
