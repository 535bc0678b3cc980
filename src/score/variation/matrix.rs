//! Inversion of small matrices that may be singular: [`invert`].

/// Inverts a square matrix on its diagonal (the sweep operator: Goodnight 1979, Am. Stat. 33:149).
///
/// A row whose pivot falls below `least` times its diagonal entry depends on earlier rows: it is left out, with 0 in its
/// row and column of the inverse. Returns the inverse, and for each row whether it was kept.
pub(super) fn invert(mut matrix: Vec<Vec<f64>>, least: f64) -> (Vec<Vec<f64>>, Vec<bool>) {
    let size = matrix.len();
    let diagonal: Vec<f64> = (0..size).map(|row| matrix[row][row]).collect();
    let mut is_kept = vec![false; size];
    for row in 0..size {
        let pivot = matrix[row][row];
        if pivot <= least * diagonal[row] {
            continue;
        }
        is_kept[row] = true;
        let scaled: Vec<f64> = matrix[row].iter().map(|entry| entry / pivot).collect();
        for (other, entries) in matrix.iter_mut().enumerate() {
            if other == row {
                continue;
            }
            let factor = entries[row];
            for (entry, scaled) in entries.iter_mut().zip(&scaled) {
                *entry -= factor * scaled;
            }
            entries[row] = -factor / pivot;
        }
        matrix[row] = scaled;
        matrix[row][row] = 1.0 / pivot;
    }
    for (row, entries) in matrix.iter_mut().enumerate() {
        for (column, entry) in entries.iter_mut().enumerate() {
            if !is_kept[row] || !is_kept[column] {
                *entry = 0.0;
            }
        }
    }
    (matrix, is_kept)
}

/// The product of a matrix and a vector.
pub(super) fn product(matrix: &[Vec<f64>], vector: &[f64]) -> Vec<f64> {
    matrix.iter().map(|row| row.iter().zip(vector).map(|(entry, number)| entry * number).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_is_that_of_the_kept_rows() {
        // The third row is the sum of the others.
        let matrix = vec![vec![2.0, 1.0, 3.0], vec![1.0, 3.0, 4.0], vec![3.0, 4.0, 7.0]];
        let (inverse, is_kept) = invert(matrix, 1e-9);
        assert_eq!(is_kept, [true, true, false]);
        let expected = [[0.6, -0.2, 0.0], [-0.2, 0.4, 0.0], [0.0, 0.0, 0.0]];
        for (row, expected) in inverse.iter().zip(expected) {
            assert!(row.iter().zip(expected).all(|(entry, expected)| (entry - expected).abs() < 1e-12), "{inverse:?}");
        }
        assert_eq!(product(&[vec![1.0, 2.0], vec![3.0, 4.0]], &[1.0, 10.0]), [21.0, 43.0]);
    }
}
