//! Intersection of rays with triangles: [`Bvh`], a binary tree of boxes (bounding volume hierarchy).

use glam::{Vec3, Vec3A};

/// A ray. `start` and `invert` (1 / direction) repeat it in the form that box tests need.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) from: Vec3,
    pub(super) direction: Vec3,
    /// The width of the ray per metre of its length.
    pub(super) spread: f32,
    start: Vec3A,
    invert: Vec3A,
}

impl Ray {
    /// The ray with this width per metre of its length.
    pub(super) fn wide(self, spread: f32) -> Self {
        Self { spread, ..self }
    }

    pub(super) fn new(from: Vec3, direction: Vec3) -> Self {
        // No component is 0, so that 0 × ∞ cannot occur: its result differs between machines.
        let part = |value: f32| 1.0 / if value.abs() < 1e-9 { 1e-9 } else { value };
        Self {
            from,
            direction,
            spread: COARSE,
            start: from.into(),
            invert: Vec3A::new(part(direction.x), part(direction.y), part(direction.z)),
        }
    }
}

/// The width per metre of a ray that looks for light, which sees no details (chosen).
const COARSE: f32 = 0.06;

/// The point where a ray hits a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// The distance along the ray in metres.
    pub(super) distance: f32,
    /// The index of the triangle.
    pub(super) face: usize,
    /// The barycentric weights of the second and the third corner.
    pub(super) weights: [f32; 2],
}

/// A triangle as a corner and two edges; `clear` if light passes through it.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    corner: Vec3,
    edges: [Vec3; 2],
    face: u32,
    clear: bool,
}

/// A box. The first child of an inner node follows it and the second is at `next`. A leaf has `count` triangles from `next`.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: Vec3A,
    high: Vec3A,
    next: u32,
    count: u32,
    axis: usize,
}

/// A tree of boxes over all triangles of a scene.
#[derive(Debug)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// The maximum number of triangles in a leaf (chosen).
const LEAF_SIZE: usize = 4;
/// The number of bins along an axis for splitting a node (chosen).
const BINS: usize = 12;

struct BuildItem {
    leaf: Leaf,
    low: Vec3,
    high: Vec3,
    middle: Vec3,
}

impl Bvh {
    /// The tree over triangles. The `bool` is `true` if light passes through the triangle.
    pub(super) fn new(faces: impl Iterator<Item = ([Vec3; 3], bool)>) -> Self {
        let mut items: Vec<BuildItem> = faces
            .enumerate()
            .map(|(face, ([a, b, c], clear))| {
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                BuildItem {
                    leaf: Leaf {
                        corner: a,
                        edges: [b - a, c - a],
                        face: face as u32,
                        clear,
                    },
                    low,
                    high,
                    middle: (low + high) * 0.5,
                }
            })
            .collect();
        let mut tree = Self {
            nodes: Vec::with_capacity(items.len()),
            leaves: Vec::with_capacity(items.len()),
        };
        tree.build(&mut items);
        tree
    }

    fn build(&mut self, items: &mut [BuildItem]) {
        let (low, high) = bounds(items);
        let index = self.nodes.len();
        self.nodes.push(Node {
            low: low.into(),
            high: high.into(),
            next: self.leaves.len() as u32,
            count: items.len() as u32,
            axis: 0,
        });
        if items.len() <= LEAF_SIZE {
            self.leaves.extend(items.iter().map(|item| item.leaf));
            return;
        }
        let (axis, middle) = split(items);
        let (first, second) = items.split_at_mut(middle);
        self.build(first);
        let next = self.nodes.len() as u32;
        self.build(second);
        let node = &mut self.nodes[index];
        (node.next, node.count, node.axis) = (next, 0, axis);
    }

    /// The first triangle that a ray hits within a distance.
    pub(super) fn first(&self, ray: &Ray, max_distance: f32) -> Option<Hit> {
        let mut found: Option<Hit> = None;
        let mut distance = max_distance;
        self.visit(ray, &mut distance, |leaf, distance| {
            if let Some((at, weights)) = leaf.hit_by(ray, *distance) {
                *distance = at;
                found = Some(Hit {
                    distance: at,
                    face: leaf.face as usize,
                    weights,
                });
            }
            false
        });
        found
    }

    /// Whether a ray hits anything that casts a shadow within a distance.
    pub(super) fn blocked(&self, ray: &Ray, max_distance: f32) -> bool {
        let (mut blocked, mut distance) = (false, max_distance);
        self.visit(ray, &mut distance, |leaf, distance| {
            blocked = !leaf.clear && leaf.hit_by(ray, *distance).is_some();
            blocked
        });
        blocked
    }

    /// Visits the triangles in the boxes that a ray hits, near boxes first, until `stop` returns `true`.
    fn visit(&self, ray: &Ray, distance: &mut f32, mut stop: impl FnMut(&Leaf, &mut f32) -> bool) {
        let mut stack = [0_u32; 64];
        let (mut depth, mut at) = (0, 0_usize);
        loop {
            let node = &self.nodes[at];
            if node.hits(ray, *distance) {
                if node.count > 0 {
                    let from = node.next as usize;
                    for leaf in &self.leaves[from..from + node.count as usize] {
                        if stop(leaf, distance) {
                            return;
                        }
                    }
                } else {
                    let (near, other) = if ray.invert[node.axis] < 0.0 {
                        (node.next as usize, at as u32 + 1)
                    } else {
                        (at + 1, node.next)
                    };
                    stack[depth] = other;
                    depth += 1;
                    at = near;
                    continue;
                }
            }
            if depth == 0 {
                return;
            }
            depth -= 1;
            at = stack[depth] as usize;
        }
    }
}

impl Node {
    /// Whether a ray hits the box within a distance (Kay and Kajiya, SIGGRAPH 1986).
    fn hits(&self, ray: &Ray, distance: f32) -> bool {
        let (a, b) = (
            (self.low - ray.start) * ray.invert,
            (self.high - ray.start) * ray.invert,
        );
        let (near, out) = (a.min(b), a.max(b));
        near.max_element().max(0.0) <= out.min_element().min(distance)
    }
}

impl Leaf {
    /// The distance and weights where a ray hits the triangle, from either side (Möller and Trumbore, 1997).
    fn hit_by(&self, ray: &Ray, max_distance: f32) -> Option<(f32, [f32; 2])> {
        let [first, second] = self.edges;
        let p = ray.direction.cross(second);
        let determinant = first.dot(p);
        if determinant.abs() < 1e-12 {
            return None;
        }
        let invert = 1.0 / determinant;
        let t = ray.from - self.corner;
        let u = t.dot(p) * invert;
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let q = t.cross(first);
        let v = ray.direction.dot(q) * invert;
        if v < 0.0 || u + v > 1.0 {
            return None;
        }
        let distance = second.dot(q) * invert;
        (distance > 1e-5 && distance < max_distance).then_some((distance, [u, v]))
    }
}

fn bounds(items: &[BuildItem]) -> (Vec3, Vec3) {
    items.iter().fold(
        (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)),
        |(low, high), item| (low.min(item.low), high.max(item.high)),
    )
}

fn area(low: Vec3, high: Vec3) -> f32 {
    let size = (high - low).max(Vec3::ZERO);
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// Sorts items for the split with the lowest cost for rays (binned surface area heuristic; Wald, 2007). Returns the axis and
/// the number of items in the first part.
fn split(items: &mut [BuildItem]) -> (usize, usize) {
    let (low, high) = items.iter().fold(
        (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)),
        |(low, high), item| (low.min(item.middle), high.max(item.middle)),
    );
    let size = high - low;
    let bin = |item: &BuildItem, axis: usize| {
        let share = (item.middle[axis] - low[axis]) / size[axis];
        ((share * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|axis| size[*axis] > 1e-6) {
        let mut bins = [(Vec3::splat(f32::MAX), Vec3::splat(f32::MIN), 0_usize); BINS];
        for item in items.iter() {
            let (low, high, count) = &mut bins[bin(item, axis)];
            (*low, *high, *count) = (low.min(item.low), high.max(item.high), *count + 1);
        }
        let sum = |bins: &[(Vec3, Vec3, usize)]| {
            let start = (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN), 0);
            let (low, high, count) = bins.iter().fold(start, |(low, high, count), bin| {
                (low.min(bin.0), high.max(bin.1), count + bin.2)
            });
            (area(low, high) * count as f32, count)
        };
        for index in 1..BINS {
            let ((left, left_count), (right, right_count)) =
                (sum(&bins[..index]), sum(&bins[index..]));
            if left_count > 0
                && right_count > 0
                && best.is_none_or(|(lowest, ..)| left + right < lowest)
            {
                best = Some((left + right, axis, index));
            }
        }
    }
    let Some((_, axis, index)) = best else {
        // All items are at the same point.
        return (0, items.len() / 2);
    };
    // The sort is stable, so that the tree depends only on the scene.
    items.sort_by_key(|item| bin(item, axis) >= index);
    let first = items.iter().filter(|item| bin(item, axis) < index).count();
    (axis, first)
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::super::dice::Dice;
    use super::*;

    #[test]
    fn the_tree_finds_what_a_search_through_all_triangles_finds() {
        let mut dice = Dice::new(3, &["bvh"]);
        let mut point = |size: f32| {
            vec3(
                dice.between(-size, size),
                dice.between(-size, size),
                dice.between(-size, size),
            )
        };
        let faces: Vec<[Vec3; 3]> = (0..400)
            .map(|_| {
                let at = point(4.0);
                [at, at + point(0.8), at + point(0.8)]
            })
            .collect();
        let tree = Bvh::new(faces.iter().map(|face| (*face, false)));
        let mut hit_count = 0;
        for _ in 0..2000 {
            let ray = Ray::new(point(6.0), point(1.0).normalize());
            let all = tree.leaves.iter().filter_map(|leaf| leaf.hit_by(&ray, 5.0));
            let nearest = all.map(|(distance, _)| distance).reduce(f32::min);
            assert_eq!(tree.first(&ray, 5.0).map(|hit| hit.distance), nearest);
            assert_eq!(tree.blocked(&ray, 5.0), nearest.is_some());
            hit_count += usize::from(nearest.is_some());
        }
        assert!((100..1900).contains(&hit_count), "{hit_count}");
    }

    #[test]
    fn light_passes_clear_faces_and_many_faces_at_one_place_do_no_harm() {
        let wall = [
            vec3(-1.0, -1.0, 1.0),
            vec3(3.0, -1.0, 1.0),
            vec3(-1.0, 3.0, 1.0),
        ];
        let tree = Bvh::new((0..300).map(|_| (wall, true)));
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        assert!(!tree.blocked(&ray, 9.0) && tree.first(&ray, 9.0).is_some());
    }
}
