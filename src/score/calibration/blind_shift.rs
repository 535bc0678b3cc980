//! Effect of the image on the probabilities of a model: [`distances`] between the probabilities with and without the
//! image.

use super::confident_reply::usable_probabilities;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::View;

/// Returns, for each item, its cluster and the Jensen–Shannon distance, from 0 to 1, between the probabilities of a
/// subject and those of the same model without an image (the root of the divergence in bits: Endres and Schindelin
/// 2003, IEEE Trans. Inf. Theory 49:1858). Empty if the model was not asked without images.
pub(super) fn distances(grid: &Grid<'_>, subject: usize) -> Vec<(u32, f64)> {
    let with_image = &grid.subjects[subject];
    let blind = grid.find(&ModelInCondition::new(&with_image.model, None));
    let Some(blind) = blind.filter(|_| with_image.view == Some(View::Image)) else {
        return Vec::new();
    };
    grid.items
        .iter()
        .enumerate()
        .filter_map(|(index, item)| {
            let seen = usable_probabilities(grid.trial(subject, index))?;
            let unseen = usable_probabilities(grid.trial(blind, index))?;
            Some((item.cluster, distance(&seen.p, &unseen.p)))
        })
        .collect()
}

/// Jensen–Shannon distance of two distributions.
fn distance(one: &[f64], other: &[f64]) -> f64 {
    let divergence: f64 = one
        .iter()
        .zip(other)
        .map(|(&p, &q)| {
            let middle = f64::midpoint(p, q);
            let [a, b] = [p, q].map(|p| if p > 0.0 { p * libm::log2(p / middle) } else { 0.0 });
            f64::midpoint(a, b)
        })
        .sum();
    divergence.clamp(0.0, 1.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_follow_the_definition() {
        assert!(distance(&[0.2, 0.8], &[0.2, 0.8]) < 1e-9);
        assert!((distance(&[1.0, 0.0], &[0.0, 1.0]) - 1.0).abs() < 1e-12);
        // The divergence is (log₂ 4⁄3 + ½ log₂ 2⁄3 + ½) ⁄ 2 = 0.311278 bits.
        assert!((distance(&[1.0, 0.0], &[0.5, 0.5]) - 0.557_923_045_3).abs() < 1e-9);
        let (one, other) = ([0.7, 0.2, 0.1], [0.1, 0.1, 0.8]);
        assert!((distance(&one, &other) - distance(&other, &one)).abs() < 1e-15);
    }
}
