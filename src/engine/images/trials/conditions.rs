//! The conditions in which frames are shown, in order: [`conditions`].

use crate::error::{Error, Result};
use crate::types::{Condition, Degradation, EnhancerName, PairDark, PhotoName, Treatment, TreatmentSet};
use darkqa_enhance::EnhancerArgs;
use darkqa_light::LightSettings;

/// All conditions in which a frame is shown: level by level, then its matches and photographs in the dark; each one
/// first raw, then with every enhancer. In this order a frame is degraded once for all enhancers.
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
        all.push(raw.clone());
        if is_enhanced {
            all.extend(enhancers.iter().map(|name| Condition { enhancer: Some(name.clone()), ..raw.clone() }));
        }
    }
    all
}

/// Checks that the named enhancers apply to some of the asked images, as far as the flags decide that.
///
/// # Errors
/// [`Error::Usage`], which suggests the value of `--llie-on` that would use them.
pub(crate) fn check_used(light: &LightSettings, args: &EnhancerArgs) -> Result<()> {
    let degradations = light.degradations();
    let Some(asked) = degradations
        .iter()
        .map(|degradation| TreatmentSet::only(degradation.as_ref().map(Degradation::kind)))
        .reduce(TreatmentSet::union)
    else {
        return Ok(());
    };
    let on = args.on();
    // Photographs in the dark are known only after the data are opened; `check_enhanced` checks them.
    let may_enhance_pairs = on.intersection(TreatmentSet::DARK).is_some() || !light.matches.is_empty();
    if args.is_empty() || may_enhance_pairs || asked.intersection(on).is_some() {
        return Ok(());
    }
    let problem = match asked.intersection(light.variants.into()) {
        None => "only L0 is asked; --llie-on l0 enhances the untouched images".to_owned(),
        Some(dark) => {
            format!("--llie-on {on} is not among the images asked; --llie-on {dark} is")
        }
    };
    Err(Error::usage("--llie", format_args!("the enhancer would never be used: {problem}")))
}

/// Checks that the named enhancers are used in the conditions of the opened data, which [`check_used`] does not know.
///
/// # Errors
/// [`Error::Usage`] if enhancers are named and no condition uses one.
pub(crate) fn check_enhanced(conditions: &[Condition], args: &EnhancerArgs) -> Result<()> {
    let is_used = conditions.iter().any(|condition| condition.enhancer.is_some());
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
        check_used(&LightSettings::resolve(&flags.light, SetLight::Lit).unwrap(), &flags.enhancers)
    }

    #[test]
    fn an_unused_enhancer_is_an_error() {
        for (words, remedy) in [
            ("--llie lift --levels L0", "only L0 is asked; --llie-on l0 enhances the untouched images"),
            ("--llie lift --levels L0 --llie-on both", "only L0 is asked; --llie-on l0 enhances the untouched images"),
            ("--llie lift --variant ev", "--llie-on noise is not among the images asked; --llie-on ev is"),
            ("--llie lift --levels L3 --llie-on l0", "--llie-on l0 is not among the images asked; --llie-on both is"),
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
