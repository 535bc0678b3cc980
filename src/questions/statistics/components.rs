//! Connected components of equal label: [`components`].

use super::erosion::runs;

/// A run of one label in a row.
struct LabelRun {
    left: usize,
    right: usize,
    label: u32,
}

/// Returns the component of each pixel. Pixels with equal labels that touch by edges or corners form one component;
/// components are numbered row by row from 1. `to_label` gives the label of a value; pixels with label 0 belong to no
/// component and get 0.
pub(super) fn components<T: Copy + PartialEq>(
    values: &[T],
    [width, height]: [usize; 2],
    to_label: impl Fn(T) -> u32,
) -> Vec<u32> {
    let mut parents: Vec<u32> = Vec::new();
    let mut rows: Vec<Vec<(LabelRun, u32)>> = Vec::with_capacity(height);
    for y in 0..height {
        let row = &values[y * width..][..width];
        let mut found: Vec<(LabelRun, u32)> = Vec::new();
        let above: &[(LabelRun, u32)] = rows.last().map_or(&[], |above| above);
        // The runs of both rows are sorted from left to right. Runs above that end before this one begins are no longer
        // needed.
        let mut first = 0;
        for (left, right) in runs(row) {
            let label = to_label(row[left]);
            if label == 0 {
                continue;
            }
            while above.get(first).is_some_and(|(run, _)| run.right < left) {
                first += 1;
            }
            let mut joined = None;
            for (run, node) in above[first..].iter().take_while(|(run, _)| run.left <= right) {
                if run.label != label {
                    continue;
                }
                joined = Some(match joined {
                    None => *node,
                    Some(other) => join(&mut parents, other, *node),
                });
            }
            let node = joined.unwrap_or_else(|| {
                parents.push(parents.len() as u32);
                parents.len() as u32 - 1
            });
            found.push((LabelRun { left, right, label }, node));
        }
        rows.push(found);
    }
    number_components(&rows, &mut parents, [width, height])
}

/// Joins the trees of two nodes and returns their common root, the older of the two roots.
fn join(parents: &mut [u32], a: u32, b: u32) -> u32 {
    let (a, b) = (root(parents, a), root(parents, b));
    let (old, new) = (a.min(b), a.max(b));
    parents[new as usize] = old;
    old
}

/// Returns the root of a node and shortens the path to it.
fn root(parents: &mut [u32], mut node: u32) -> u32 {
    while parents[node as usize] != node {
        parents[node as usize] = parents[parents[node as usize] as usize];
        node = parents[node as usize];
    }
    node
}

/// Numbers the components row by row from 1 and returns the number of each pixel.
fn number_components(rows: &[Vec<(LabelRun, u32)>], parents: &mut [u32], [width, height]: [usize; 2]) -> Vec<u32> {
    let mut numbers = vec![0; parents.len()];
    let mut next = 1;
    let mut pieces = vec![0; width * height];
    for (y, row) in rows.iter().enumerate() {
        for (run, node) in row {
            let root = root(parents, *node) as usize;
            if numbers[root] == 0 {
                numbers[root] = next;
                next += 1;
            }
            pieces[y * width + run.left..y * width + run.right].fill(numbers[root]);
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn reference(labels: &[u32], [width, height]: [usize; 2]) -> Vec<u32> {
        let mut pieces = vec![0; labels.len()];
        let mut next = 0;
        for start in 0..labels.len() {
            if labels[start] == 0 || pieces[start] != 0 {
                continue;
            }
            next += 1;
            let mut open = vec![start];
            pieces[start] = next;
            while let Some(i) = open.pop() {
                let (x, y) = (i % width, i / width);
                for j in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                    for k in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                        let neighbour = j * width + k;
                        if labels[neighbour] == labels[start] && pieces[neighbour] == 0 {
                            pieces[neighbour] = next;
                            open.push(neighbour);
                        }
                    }
                }
            }
        }
        pieces
    }

    proptest! {
        #[test]
        fn components_match_flood_fill(
            (width, height, labels) in (1..12_usize, 1..12_usize).prop_flat_map(|(width, height)| {
                (Just(width), Just(height), prop::collection::vec(0..3_u32, width * height))
            }),
        ) {
            prop_assert_eq!(components(&labels, [width, height], |label| label), reference(&labels, [width, height]));
        }
    }
}
