//! Synthetic images for trials of a model: [`texture`].

use std::ops::RangeInclusive;

use darkqa_base::types::Rgb;

/// Ranges of codes of the trial images: as dark as an underexposed photograph, the whole range, and nearly black for
/// models whose gates saturate on brighter images. Code 0 is left out, because some models divide by it.
pub(crate) const CODES: [RangeInclusive<u8>; 3] = [4..=40, 4..=251, 1..=12];

/// An image of pseudorandom samples within a range of codes; deterministic.
pub(crate) fn texture([height, width]: [usize; 2], codes: &RangeInclusive<u8>) -> Rgb {
    let mut image = Rgb::black(height, width);
    let span = u32::from(codes.end() - codes.start()) + 1;
    let mut state = 1_u32;
    for sample in image.samples_mut() {
        // A linear congruential generator (Numerical Recipes, section 7.1).
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *sample = codes.start() + ((state >> 16) % span) as u8;
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_are_deterministic_and_within_the_range() {
        let image = texture([40, 60], &CODES[0]);
        assert_eq!(image, texture([40, 60], &CODES[0]));
        let codes = image.samples();
        assert_eq!((codes.iter().min(), codes.iter().max()), (Some(&4), Some(&40)));
    }
}
