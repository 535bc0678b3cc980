//! The conditions in which frames are shown: [`conditions`].

use crate::enhance::EnhancerArgs;
use crate::error::{Error, Result};
use crate::synthesis::LightSettings;
use crate::types::{Condition, Degradation, Digest, EnhancerName, TreatmentSet};

/// Every condition in which a frame is shown, level by level: first raw, then with each enhancer. In this order a frame is degraded
/// once for all enhancers.
pub(crate) fn conditions(
    light: &LightSettings,
    on: TreatmentSet,
    enhancers: &[(EnhancerName, Digest)],
) -> Vec<Condition> {
    let mut all = Vec::new();
    for degradation in light.degradations() {
        let treatment = degradation.as_ref().map(Degradation::kind);
        let raw = Condition::raw(degradation);
        let enhanced = |(name, _): &(EnhancerName, Digest)| Condition {
            enhancer: Some(name.clone()),
            ..raw.clone()
        };
        let enhanced: Vec<Condition> = if on.includes(treatment) {
            enhancers.iter().map(enhanced).collect()
        } else {
            Vec::new()
        };
        all.push(raw);
        all.extend(enhanced);
    }
    all
}

/// Checks that enhancers, if any are named, work on some of the images that are asked about.
///
/// # Errors
/// [`Error::Usage`] with the value of `--llie-on` that would use them.
pub(crate) fn check_used(light: &LightSettings, args: &EnhancerArgs) -> Result<()> {
    let degradations = light.degradations();
    let treatments = degradations.iter().map(|degradation| {
        let kind = degradation.as_ref().map(Degradation::kind);
        TreatmentSet::only(kind)
    });
    let Some(asked) = treatments.reduce(TreatmentSet::or) else {
        return Ok(());
    };
    let on = args.llie_on;
    if args.llie.is_empty() || asked.and(on).is_some() {
        return Ok(());
    }
    let problem = match asked.and(light.variants.into()) {
        None => "only L0 is asked; --llie-on l0 enhances the untouched images".to_owned(),
        Some(dark) => {
            format!("--llie-on {on} is not among the images asked; --llie-on {dark} is")
        }
    };
    Err(Error::usage(
        "--llie",
        format_args!("the enhancer would never be used: {problem}"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::LightArgs;
    use clap::Parser;

    #[derive(Parser)]
    #[command(no_binary_name = true)]
    struct Flags {
        #[command(flatten)]
        light: LightArgs,
        #[command(flatten)]
        enhancers: EnhancerArgs,
    }

    fn check(words: &str) -> Result<()> {
        let flags = Flags::try_parse_from(words.split_whitespace()).unwrap();
        check_used(
            &LightSettings::resolve(&flags.light).unwrap(),
            &flags.enhancers,
        )
    }

    #[test]
    fn an_enhancer_that_no_condition_uses_is_an_error() {
        for (words, remedy) in [
            (
                "--llie lift --levels L0",
                "only L0 is asked; --llie-on l0 enhances the untouched images",
            ),
            (
                "--llie lift --levels L0 --llie-on both",
                "only L0 is asked; --llie-on l0 enhances the untouched images",
            ),
            (
                "--llie lift --variant ev",
                "--llie-on noise is not among the images asked; --llie-on ev is",
            ),
            (
                "--llie lift --levels L3 --llie-on l0",
                "--llie-on l0 is not among the images asked; --llie-on both is",
            ),
        ] {
            let error = check(words).unwrap_err().to_string();
            let expected = format!("the enhancer would never be used: {remedy}");
            assert!(error.contains(&expected), "{words}: {error}");
        }
        for words in [
            "",
            "--levels L0",
            "--llie lift",
            "--llie lift --levels L0 --llie-on l0",
            "--llie lift --levels L0 --llie-on all",
            "--llie lift --variant ev --llie-on both",
        ] {
            check(words).unwrap();
        }
    }
}
