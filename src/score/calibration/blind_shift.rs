//! What the pixels contribute: the distance of probabilities with an image from those without, [`mean`].

use super::confident_reply::usable;
use crate::score::estimate::Estimate;
use crate::score::grid::Grid;
use crate::score::subject::Subject;
use crate::types::View;

/// The mean over the items of the Jensen–Shannon distance, 0 to 1, between the probabilities of a subject and those of the same model
/// without an image (the root of the divergence in bits: Endres and Schindelin 2003, IEEE Trans. Inf. Theory 49:1858). `None` if there
/// are none of the latter.
pub(super) fn mean(grid: &Grid<'_>, subject: usize) -> Option<Estimate> {
    let seeing = &grid.subjects[subject];
    if seeing.view != Some(View::Image) {
        return None;
    }
    let blind = grid.find(&Subject::new(&seeing.model, None))?;
    let mut sums = vec![(0.0, 0.0); grid.clusters];
    let mut n = 0;
    for (index, item) in grid.items.iter().enumerate() {
        let pair = [subject, blind].map(|subject| usable(grid.record(subject, index)));
        if let [Some(seen), Some(unseen)] = pair {
            let (sum, count) = &mut sums[item.cluster as usize];
            *sum += distance(&seen.p, &unseen.p);
            *count += 1.0;
            n += 1;
        }
    }
    sums.retain(|(_, count)| *count > 0.0);
    Estimate::scored(&sums, 1.0, n)
}

/// The Jensen–Shannon distance of two distributions.
fn distance(one: &[f64], other: &[f64]) -> f64 {
    let part = |p: f64, middle: f64| {
        if p > 0.0 {
            p * libm::log2(p / middle)
        } else {
            0.0
        }
    };
    let pairs = one.iter().zip(other);
    let divergence: f64 = pairs
        .map(|(&p, &q)| {
            let middle = f64::midpoint(p, q);
            f64::midpoint(part(p, middle), part(q, middle))
        })
        .sum();
    divergence.clamp(0.0, 1.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_definition() {
        assert!(distance(&[0.2, 0.8], &[0.2, 0.8]) < 1e-9);
        assert!((distance(&[1.0, 0.0], &[0.0, 1.0]) - 1.0).abs() < 1e-12);
        // The divergence is (log₂ 4⁄3 + ½ log₂ 2⁄3 + ½) ⁄ 2 = 0.311278 bits.
        assert!((distance(&[1.0, 0.0], &[0.5, 0.5]) - 0.557_923_045_3).abs() < 1e-9);
        let (one, other) = ([0.7, 0.2, 0.1], [0.1, 0.1, 0.8]);
        assert!((distance(&one, &other) - distance(&other, &one)).abs() < 1e-15);
    }
}
