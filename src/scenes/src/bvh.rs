//! Intersection of rays with triangles: [`Bvh`], a tree of boxes (bounding volume hierarchy).
//!
//! A node has four boxes, which are tested at once (Wald, Benthin and Boulos, 2008). It is a binary tree without every second level,
//! and visits boxes in the order of that tree, because the order decides between equally near triangles.

use std::ops::Range;

use glam::{Vec3, Vec4, vec3};

/// A ray. `invert` is 1 / direction, which box tests need.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) from: Vec3,
    pub(super) direction: Vec3,
    /// The width of the ray per metre of its length.
    pub(super) spread: f32,
    invert: Vec3,
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
            invert: vec3(part(direction.x), part(direction.y), part(direction.z)),
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

/// Four boxes with their contents.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// The lowest coordinates of the boxes by axis.
    low: [Vec4; 3],
    /// The highest coordinates of the boxes by axis.
    high: [Vec4; 3],
    children: [Child; BOXES],
    /// The axes of three splits: between the first two boxes and the last two, within the first two, and within the last two.
    axes: [u8; 3],
}

/// The content of a box: `count` triangles from `place` on, or, if `count` is 0, the node at `place`.
#[derive(Debug, Clone, Copy)]
struct Child {
    place: u32,
    count: u32,
}

/// A tree of boxes over all triangles of a scene.
#[derive(Debug)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// The maximum number of triangles in a leaf (chosen).
const LEAF_SIZE: usize = 4;
/// The number of boxes of a node.
const BOXES: usize = 4;
/// The maximum number of boxes that wait for a visit: three on each level. The trees of rooms have fewer levels.
const WAITING: usize = 64;
/// The number of bins along an axis for splitting a node (chosen).
const BINS: usize = 12;

#[derive(Debug, Clone, Copy)]
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

    /// Adds a node over items, and all nodes below it. Returns its place.
    fn build(&mut self, items: &mut [BuildItem]) -> u32 {
        let place = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        let mut axes = [0; 3];
        for (half, items) in halves(items, &mut axes[0]).into_iter().enumerate() {
            for (part, items) in halves(items, &mut axes[half + 1]).into_iter().enumerate() {
                if !items.is_empty() {
                    let (low, high) = bounds(items);
                    let child = self.child(items);
                    self.nodes[place].set(half * 2 + part, [low, high], child);
                }
            }
        }
        self.nodes[place].axes = axes;
        place as u32
    }

    /// Adds the triangles or the nodes of a box.
    fn child(&mut self, items: &mut [BuildItem]) -> Child {
        if items.len() > LEAF_SIZE {
            let place = self.build(items);
            return Child { place, count: 0 };
        }
        let place = self.leaves.len() as u32;
        self.leaves.extend(items.iter().map(|item| item.leaf));
        Child {
            place,
            count: items.len() as u32,
        }
    }

    /// The first triangle that a ray hits within a distance.
    pub(super) fn first(&self, ray: &Ray, max_distance: f32) -> Option<Hit> {
        let tester = BoxTester::new(ray);
        let mut found: Option<Hit> = None;
        let mut distance = max_distance;
        let mut waiting = [(0.0, Child::ROOT); WAITING];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (near, child) = waiting[count];
            if near > distance {
                continue;
            }
            let Some(place) = child.node() else {
                for leaf in &self.leaves[child.leaves()] {
                    if let Some((at, weights)) = leaf.hit_by(ray, distance) {
                        distance = at;
                        found = Some(Hit {
                            distance: at,
                            face: leaf.face as usize,
                            weights,
                        });
                    }
                }
                continue;
            };
            let node = &self.nodes[place];
            let (near, hit) = tester.test(node, distance);
            if hit == 0 {
                continue;
            }
            // The farthest box first, because the last one that waits is visited next.
            for slot in tester.far_to_near(node) {
                if hit >> slot & 1 == 1 {
                    waiting[count] = (near[slot], node.children[slot]);
                    count += 1;
                }
            }
        }
        found
    }

    /// Whether a ray hits anything that casts a shadow within a distance.
    pub(super) fn blocked(&self, ray: &Ray, max_distance: f32) -> bool {
        let tester = BoxTester::new(ray);
        let mut waiting = [0; WAITING];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let node = &self.nodes[waiting[count]];
            let (_, hit) = tester.test(node, max_distance);
            for (slot, child) in node.children.iter().enumerate() {
                if hit >> slot & 1 == 0 {
                    continue;
                }
                if let Some(place) = child.node() {
                    waiting[count] = place;
                    count += 1;
                } else if self.leaves[child.leaves()]
                    .iter()
                    .any(|leaf| !leaf.clear && leaf.hit_by(ray, max_distance).is_some())
                {
                    return true;
                }
            }
        }
        false
    }
}

#[cfg(test)]
impl Bvh {
    /// The number of levels.
    pub(super) fn depth(&self) -> usize {
        // A node stands behind its parent.
        let mut depths = vec![1; self.nodes.len()];
        for place in 0..self.nodes.len() {
            for child in self.nodes[place]
                .children
                .iter()
                .filter_map(|child| child.node())
                .filter(|child| *child > place)
            {
                depths[child] = depths[place] + 1;
            }
        }
        depths.into_iter().max().unwrap_or(0)
    }

    /// The maximum number of levels that can be visited.
    pub(super) const MAX_DEPTH: usize = (WAITING - 1) / (BOXES - 1);
}

impl Child {
    const ROOT: Self = Self { place: 0, count: 0 };

    /// The place of the node; `None` if there are triangles.
    fn node(self) -> Option<usize> {
        (self.count == 0).then_some(self.place as usize)
    }

    /// The places of the triangles.
    fn leaves(self) -> Range<usize> {
        let from = self.place as usize;
        from..from + self.count as usize
    }
}

/// A ray in the form that the test of four boxes needs.
struct BoxTester {
    start: [Vec4; 3],
    invert: [Vec4; 3],
    /// A bit for each axis along which the ray runs backwards.
    backwards: u8,
}

impl BoxTester {
    fn new(ray: &Ray) -> Self {
        let backwards = |axis: usize| u8::from(ray.invert[axis] < 0.0) << axis;
        Self {
            start: ray.from.to_array().map(Vec4::splat),
            invert: ray.invert.to_array().map(Vec4::splat),
            backwards: backwards(0) | backwards(1) | backwards(2),
        }
    }

    /// The distances to the boxes, and a bit for each that the ray hits within a distance (Kay and Kajiya, SIGGRAPH 1986).
    fn test(&self, node: &Node, distance: f32) -> ([f32; BOXES], u32) {
        let (mut near, mut out) = (Vec4::ZERO, Vec4::splat(distance));
        for axis in 0..3 {
            let a = (node.low[axis] - self.start[axis]) * self.invert[axis];
            let b = (node.high[axis] - self.start[axis]) * self.invert[axis];
            near = near.max(a.min(b));
            out = out.min(a.max(b));
        }
        (near.to_array(), near.cmple(out).bitmask())
    }

    /// The boxes of a node from the farthest to the nearest, by the axes of its splits.
    fn far_to_near(&self, node: &Node) -> [usize; BOXES] {
        let [both, first, last] = node
            .axes
            .map(|axis| usize::from(self.backwards >> axis & 1));
        let [first, last] = [[1 - first, first], [3 - last, 2 + last]];
        let [[a, b], [c, d]] = if both == 0 {
            [last, first]
        } else {
            [first, last]
        };
        [a, b, c, d]
    }
}

impl Node {
    /// Four points that no ray reaches.
    const EMPTY: Self = Self {
        low: [Vec4::MAX; 3],
        high: [Vec4::MAX; 3],
        children: [Child { place: 0, count: 0 }; BOXES],
        axes: [0; 3],
    };

    /// Puts a box into the node.
    fn set(&mut self, slot: usize, [low, high]: [Vec3; 2], child: Child) {
        for axis in 0..3 {
            self.low[axis][slot] = low[axis];
            self.high[axis][slot] = high[axis];
        }
        self.children[slot] = child;
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

/// Splits items into two parts and sets the axis of the split. All are in the first part if they fit into a leaf.
fn halves<'a>(items: &'a mut [BuildItem], axis: &mut u8) -> [&'a mut [BuildItem]; 2] {
    let mut count = items.len();
    if count > LEAF_SIZE {
        let split = split(items);
        (*axis, count) = (split.0 as u8, split.1);
    }
    items.split_at_mut(count).into()
}

fn area(low: Vec3, high: Vec3) -> f32 {
    let size = (high - low).max(Vec3::ZERO);
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// The bounds and the number of some items.
#[derive(Debug, Clone, Copy)]
struct Bin {
    low: Vec3,
    high: Vec3,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self {
        low: Vec3::MAX,
        high: Vec3::MIN,
        count: 0,
    };

    fn joined(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            count: self.count + other.count,
        }
    }

    /// The cost of a ray that visits all items.
    fn cost(self) -> f32 {
        area(self.low, self.high) * self.count as f32
    }
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
        let mut bins = [Bin::EMPTY; BINS];
        for item in items.iter() {
            let bin = &mut bins[bin(item, axis)];
            *bin = bin.joined(Bin {
                low: item.low,
                high: item.high,
                count: 1,
            });
        }
        // All bins from each one on.
        let mut right = bins;
        for index in (0..BINS - 1).rev() {
            right[index] = right[index].joined(right[index + 1]);
        }
        let mut left = Bin::EMPTY;
        for index in 1..BINS {
            left = left.joined(bins[index - 1]);
            let cost = left.cost() + right[index].cost();
            if left.count > 0
                && right[index].count > 0
                && best.is_none_or(|(lowest, ..)| cost < lowest)
            {
                best = Some((cost, axis, index));
            }
        }
    }
    let Some((_, axis, index)) = best else {
        // All items are at the same point.
        return (0, items.len() / 2);
    };
    // The order within a part stays, so that the tree depends only on the scene.
    let (mut first, second): (Vec<_>, Vec<_>) =
        items.iter().partition(|item| bin(item, axis) < index);
    let count = first.len();
    first.extend(second);
    items.copy_from_slice(&first);
    (axis, count)
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
            let nearest = tree
                .leaves
                .iter()
                .filter_map(|leaf| leaf.hit_by(&ray, 5.0))
                .map(|(distance, _)| distance)
                .reduce(f32::min);
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
