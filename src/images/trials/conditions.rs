//! The conditions in which frames are shown: [`conditions`].

use crate::error::{Error, Result};
use crate::types::{
    Condition, Degradation, EnhancerName, PairDark, PhotoName, Treatment, TreatmentSet,
};
use darkqa_enhance::EnhancerArgs;
use darkqa_light::LightSettings;

/// Every condition in which a frame is shown, level by level, then in the darkness of its photographs: first raw, then with each
/// enhancer. In this order a frame is degraded once for all enhancers.
pub(crate) fn conditions(
    light: &LightSettings,
    photographs: &[PhotoName],
    on: TreatmentSet,
    enhancers: &[EnhancerName],
) -> Vec<Condition> {
    let mut all = Vec::new();
    let degradations = light.degradations().into_iter().map(Treatment::from);
    let photographs = photographs.iter().cloned().map(PairDark::Photograph);
    let pairs = light.matches.iter().cloned().chain(photographs);
    for treatment in degradations.chain(pairs.map(Treatment::Paired)) {
        let is_enhanced = on.includes(&treatment);
        let raw = Condition::raw(treatment);
        let enhanced = |name: &EnhancerName| Condition {
            enhancer: Some(name.clone()),
            ..raw.clone()
        };
        let enhanced: Vec<Condition> = if is_enhanced {
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
    let Some(asked) = treatments.reduce(TreatmentSet::union) else {
        return Ok(());
    };
    let on = args.on();
    // Whether there are photographs in the dark is known when the data are open.
    let may_be = on.intersection(TreatmentSet::DARK).is_some() || !light.matches.is_empty();
    if args.is_empty() || may_be || asked.intersection(on).is_some() {
        return Ok(());
    }
    let problem = match asked.intersection(light.variants.into()) {
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

/// Checks against the conditions of open data what [`check_used`] leaves open.
///
/// # Errors
/// [`Error::Usage`] if enhancers are named and no condition has one.
pub(crate) fn check_enhanced(conditions: &[Condition], args: &EnhancerArgs) -> Result<()> {
    let is_used = conditions
        .iter()
        .any(|condition| condition.enhancer.is_some());
    if args.is_empty() || is_used || conditions.is_empty() {
        return Ok(());
    }
    let problem = format_args!(
        "the enhancer would never be used: --llie-on {} is not among the images asked; the data have no photographs in the dark",
        args.on()
    );
    Err(Error::usage("--llie", problem))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::SetLight;
    use clap::Parser;
    use darkqa_light::LightArgs;

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
            &LightSettings::resolve(&flags.light, SetLight::Lit).unwrap(),
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
