//! Rasterization of polygons into label maps: [`draw`].

use ndarray::Array2;

/// A closed polygon and the value of the pixels inside. Corners are in pixels; (0, 0) is the centre of the first pixel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Polygon<T> {
    pub(super) corners: Vec<(f64, f64)>,
    pub(super) value: T,
}

impl<T> Polygon<T> {
    /// Twice the area in square pixels, by the shoelace formula.
    fn size(&self) -> f64 {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|((x, y), (u, v))| x * v - u * y).sum::<f64>().abs()
    }
}

/// Draws polygons, the largest first, so that a large object does not hide objects on it or in front of it. A pixel is
/// inside a polygon if its centre is, by the even-odd rule.
pub(super) fn draw<T: Copy + Default>(polygons: &[Polygon<T>], [width, height]: [usize; 2]) -> Array2<T> {
    let mut map = Array2::default((height, width));
    let mut order: Vec<&Polygon<T>> = polygons.iter().collect();
    order.sort_by(|a, b| b.size().total_cmp(&a.size()));
    for polygon in order {
        for y in 0..height {
            let mut row = map.row_mut(y);
            for pair in crossings(&polygon.corners, y as f64).chunks_exact(2) {
                let from = libm::ceil(pair[0]).max(0.0) as usize;
                let to = (libm::ceil(pair[1]).max(0.0) as usize).min(width);
                row.iter_mut().take(to).skip(from).for_each(|pixel| *pixel = polygon.value);
            }
        }
    }
    map
}

/// X coordinates where the edges of a polygon cross a row of pixels, from left to right.
fn crossings(corners: &[(f64, f64)], y: f64) -> Vec<f64> {
    let next = corners.iter().cycle().skip(1);
    let mut crossings: Vec<f64> = corners
        .iter()
        .zip(next)
        .filter(|((_, a), (_, b))| (*a <= y) != (*b <= y))
        .map(|((x, a), (u, b))| x + (y - a) / (b - a) * (u - x))
        .filter(|x| x.is_finite())
        .collect();
    crossings.sort_by(f64::total_cmp);
    crossings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(left: f64, side: f64, value: u8) -> Polygon<u8> {
        Polygon { corners: vec![(left, 0.0), (left + side, 0.0), (left + side, side), (left, side)], value }
    }

    #[test]
    fn small_polygons_are_drawn_over_large_ones() {
        let map = draw(&[square(1.0, 1.0, 7), square(0.0, 3.0, 5)], [4, 3]);
        assert_eq!(map.into_raw_vec_and_offset().0, [5, 7, 5, 0, 5, 5, 5, 0, 5, 5, 5, 0]);
    }

    #[test]
    fn unusual_polygons_do_not_fail() {
        for corners in [
            vec![],
            vec![(1.0, 1.0)],
            vec![(f64::NAN, 0.0), (3.0, 9.0), (1.0, 2.0)],
            vec![(-9.0, -9.0), (99.0, -9.0), (99.0, 99.0), (-9.0, 99.0)],
        ] {
            let map = draw(&[Polygon { corners: corners.clone(), value: 1_u8 }], [3, 2]);
            let whole = corners.len() == 4;
            assert_eq!(map.sum(), if whole { 6 } else { map.sum() });
        }
    }
}
