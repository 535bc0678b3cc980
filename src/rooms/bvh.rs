//! Where a ray meets a scene: [`Bvh`], a binary tree of boxes over triangles.

use glam::{Vec3, Vec3A};

/// A half-line; `start` and `invert`, one over its direction, are for meeting boxes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) from: Vec3,
    pub(super) along: Vec3,
    start: Vec3A,
    invert: Vec3A,
}

impl Ray {
    pub(super) fn new(from: Vec3, along: Vec3) -> Self {
        // No part of a direction is 0, so that nothing below is 0 × ∞, of which machines differ in what they make.
        let part = |value: f32| 1.0 / if value.abs() < 1e-9 { 1e-9 } else { value };
        Self {
            from,
            along,
            start: from.into(),
            invert: Vec3A::new(part(along.x), part(along.y), part(along.z)),
        }
    }
}

/// Where a ray meets a triangle: how far along, which, and how near to its second and third corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    pub(super) far: f32,
    pub(super) face: usize,
    pub(super) weights: [f32; 2],
}

/// A triangle as a corner and two edges, and whether light passes it.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    corner: Vec3,
    edges: [Vec3; 2],
    face: u32,
    clear: bool,
}

/// A box; an inner node has its second child at `next` and the first beside itself, a leaf has `count` triangles from `next`.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: Vec3A,
    high: Vec3A,
    next: u32,
    count: u32,
    axis: usize,
}

/// The tree.
#[derive(Debug)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// A leaf has at most so many triangles where they can be parted.
const FEW: usize = 4;
/// Places at which a node may be cut.
const BINS: usize = 12;

struct BuildItem {
    leaf: Leaf,
    low: Vec3,
    high: Vec3,
    middle: Vec3,
}

impl Bvh {
    /// The tree over triangles, each with whether light passes it.
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
        let place = self.nodes.len();
        self.nodes.push(Node {
            low: low.into(),
            high: high.into(),
            next: self.leaves.len() as u32,
            count: items.len() as u32,
            axis: 0,
        });
        if items.len() <= FEW {
            self.leaves.extend(items.iter().map(|item| item.leaf));
            return;
        }
        let (axis, middle) = cut(items);
        let (first, second) = items.split_at_mut(middle);
        self.build(first);
        let next = self.nodes.len() as u32;
        self.build(second);
        let node = &mut self.nodes[place];
        (node.next, node.count, node.axis) = (next, 0, axis);
    }

    /// The first triangle that a ray meets before a distance.
    pub(super) fn first(&self, ray: &Ray, before: f32) -> Option<Hit> {
        let mut found: Option<Hit> = None;
        let mut far = before;
        self.visit(ray, &mut far, |leaf, far| {
            if let Some((at, weights)) = leaf.meet(ray, *far) {
                *far = at;
                found = Some(Hit {
                    far: at,
                    face: leaf.face as usize,
                    weights,
                });
            }
            false
        });
        found
    }

    /// Whether anything that casts a shadow lies on a ray before a distance.
    pub(super) fn blocked(&self, ray: &Ray, before: f32) -> bool {
        let (mut blocked, mut far) = (false, before);
        self.visit(ray, &mut far, |leaf, far| {
            blocked = !leaf.clear && leaf.meet(ray, *far).is_some();
            blocked
        });
        blocked
    }

    /// Visits the triangles whose boxes a ray meets, near ones first, until one says that it is enough.
    fn visit(&self, ray: &Ray, far: &mut f32, mut enough: impl FnMut(&Leaf, &mut f32) -> bool) {
        let mut stack = [0_u32; 64];
        let (mut depth, mut at) = (0, 0_usize);
        loop {
            let node = &self.nodes[at];
            if node.meets(ray, *far) {
                if node.count > 0 {
                    let from = node.next as usize;
                    for leaf in &self.leaves[from..from + node.count as usize] {
                        if enough(leaf, far) {
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
    /// Whether a ray meets the box before a distance (Kay and Kajiya, SIGGRAPH 1986).
    fn meets(&self, ray: &Ray, far: f32) -> bool {
        let (a, b) = (
            (self.low - ray.start) * ray.invert,
            (self.high - ray.start) * ray.invert,
        );
        let (near, out) = (a.min(b), a.max(b));
        near.max_element().max(0.0) <= out.min_element().min(far)
    }
}

impl Leaf {
    /// Where a ray meets the triangle, from either side (Möller and Trumbore, 1997).
    fn meet(&self, ray: &Ray, before: f32) -> Option<(f32, [f32; 2])> {
        let [first, second] = self.edges;
        let p = ray.along.cross(second);
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
        let v = ray.along.dot(q) * invert;
        if v < 0.0 || u + v > 1.0 {
            return None;
        }
        let far = second.dot(q) * invert;
        (far > 1e-5 && far < before).then_some((far, [u, v]))
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

/// Parts items where rays will have the least to do (the surface area heuristic in bins; Wald, 2007): the axis, and how many
/// come first.
fn cut(items: &mut [BuildItem]) -> (usize, usize) {
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
        for place in 1..BINS {
            let ((left, some), (right, others)) = (sum(&bins[..place]), sum(&bins[place..]));
            if some > 0 && others > 0 && best.is_none_or(|(least, ..)| left + right < least) {
                best = Some((left + right, axis, place));
            }
        }
    }
    let Some((_, axis, place)) = best else {
        // All of them lie at one place.
        return (0, items.len() / 2);
    };
    // A stable order, so that the tree is a function of the scene.
    items.sort_by_key(|item| bin(item, axis) >= place);
    let first = items.iter().filter(|item| bin(item, axis) < place).count();
    (axis, first)
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::super::dice::Dice;
    use super::*;

    #[test]
    fn the_tree_finds_what_a_search_through_all_finds() {
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
        let mut met = 0;
        for _ in 0..2000 {
            let ray = Ray::new(point(6.0), point(1.0).normalize());
            let all = tree.leaves.iter().filter_map(|leaf| leaf.meet(&ray, 5.0));
            let nearest = all.map(|(far, _)| far).reduce(f32::min);
            assert_eq!(tree.first(&ray, 5.0).map(|hit| hit.far), nearest);
            assert_eq!(tree.blocked(&ray, 5.0), nearest.is_some());
            met += usize::from(nearest.is_some());
        }
        assert!((100..1900).contains(&met), "{met}");
    }

    #[test]
    fn light_passes_what_is_clear_and_many_faces_at_one_place_do_no_harm() {
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
