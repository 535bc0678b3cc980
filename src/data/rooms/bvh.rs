//! Intersection of rays with triangles: [`Bvh`], a tree of boxes (bounding volume hierarchy).
//!
//! A node has four boxes and a leaf four triangles, which are tested at once (Wald, Benthin and Boulos, 2008). The tree
//! is a binary tree without every second level. Boxes are visited in the order of that binary tree, because the order
//! decides between equally near triangles.

use glam::{Vec3, Vec4};

/// A ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// Width of the ray per metre of its length.
    pub(super) spread: f32,
    /// 1 / direction, for box tests.
    inverse: Vec3,
}

impl Ray {
    /// Returns the ray with this width per metre of its length.
    pub(super) fn with_spread(self, spread: f32) -> Self {
        Self { spread, ..self }
    }

    pub(super) fn new(origin: Vec3, direction: Vec3) -> Self {
        // No component is 0, so that 0 × ∞ cannot occur: its result differs between machines.
        let inverse = direction.to_array().map(|value| 1.0 / if value.abs() < 1e-9 { 1e-9 } else { value });
        Self { origin, direction, spread: LIGHT_SPREAD, inverse: Vec3::from(inverse) }
    }
}

/// Width per metre of a ray that samples light (chosen). Such rays resolve no details.
const LIGHT_SPREAD: f32 = 0.06;

/// The point where a ray hits a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Distance along the ray in metres.
    pub(super) distance: f32,
    /// Index of the triangle.
    pub(super) face: usize,
    /// Barycentric weights of the second and the third corner.
    pub(super) weights: [f32; 2],
}

/// A triangle, as a corner and two edges.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    corner: Vec3,
    edges: [Vec3; 2],
    face: u32,
    /// True if light passes through the triangle.
    passes_light: bool,
}

/// Four boxes with their contents.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// Lowest coordinates of the boxes, by axis.
    low: [Vec4; 3],
    /// Highest coordinates of the boxes, by axis.
    high: [Vec4; 3],
    children: [Child; BOXES],
    /// Axes of the three splits: between the first two and the last two boxes, within the first two, and within the
    /// last two.
    axes: [u8; 3],
}

/// Up to four triangles, with their coordinates by axis. A triangle that is not there has no area.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    corner: [Vec4; 3],
    edges: [[Vec4; 3]; 2],
    faces: [u32; LEAF_SIZE],
    /// A bit for each triangle through which no light passes.
    casts_shadow: u32,
}

/// Content of a box.
#[derive(Debug, Clone, Copy)]
enum Child {
    /// Index of the node.
    Node(u32),
    /// Index of the leaf.
    Leaf(u32),
}

/// A tree of boxes over all triangles of a scene.
#[derive(Debug)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

/// Maximum number of triangles in a leaf (chosen).
const LEAF_SIZE: usize = 4;
/// Number of boxes of a node.
const BOXES: usize = 4;
/// Size of the stack of boxes to visit, with three boxes on each level. The trees of rooms have fewer levels.
const STACK_SIZE: usize = 64;
/// Number of bins along an axis for splitting a node (chosen).
const BINS: usize = 12;

/// A triangle with its bounding box, for building the tree.
#[derive(Debug, Clone, Copy)]
struct BuildItem {
    triangle: Triangle,
    low: Vec3,
    high: Vec3,
    center: Vec3,
}

impl Bvh {
    /// Builds the tree over triangles. The `bool` is true if light passes through the triangle.
    pub(super) fn new(faces: impl Iterator<Item = ([Vec3; 3], bool)>) -> Self {
        let mut items: Vec<BuildItem> = faces
            .enumerate()
            .map(|(face, ([a, b, c], passes_light))| {
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                BuildItem {
                    triangle: Triangle { corner: a, edges: [b - a, c - a], face: face as u32, passes_light },
                    low,
                    high,
                    center: (low + high) * 0.5,
                }
            })
            .collect();
        let mut tree = Self { nodes: Vec::with_capacity(items.len()), leaves: Vec::with_capacity(items.len()) };
        tree.build(&mut items);
        tree
    }

    /// Adds a node over items, and all nodes below it. Returns its index.
    fn build(&mut self, items: &mut [BuildItem]) -> u32 {
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        let mut axes = [0; 3];
        for (half, items) in split_in_two(items, &mut axes[0]).into_iter().enumerate() {
            for (part, items) in split_in_two(items, &mut axes[half + 1]).into_iter().enumerate() {
                if !items.is_empty() {
                    let (low, high) = bounds(items);
                    let child = self.child(items);
                    self.nodes[index].set(half * 2 + part, [low, high], child);
                }
            }
        }
        self.nodes[index].axes = axes;
        index as u32
    }

    /// Adds the triangles or the node of a box.
    fn child(&mut self, items: &mut [BuildItem]) -> Child {
        if items.len() > LEAF_SIZE {
            return Child::Node(self.build(items));
        }
        self.leaves.push(Leaf::new(items));
        Child::Leaf(self.leaves.len() as u32 - 1)
    }

    /// Returns the first triangle that a ray hits within a distance.
    pub(super) fn closest_hit(&self, ray: &Ray, max_distance: f32) -> Option<Hit> {
        let tester = RayTester::new(ray);
        let mut found: Option<Hit> = None;
        let mut distance = max_distance;
        let mut stack = [(0.0, Child::ROOT); STACK_SIZE];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (near, child) = stack[count];
            if near > distance {
                continue;
            }
            let node = match child {
                Child::Node(index) => &self.nodes[index as usize],
                Child::Leaf(index) => {
                    let leaf = &self.leaves[index as usize];
                    if let Some(hit) = tester.hits(leaf, distance).nearest(leaf) {
                        distance = hit.distance;
                        found = Some(hit);
                    }
                    continue;
                }
            };
            let (near, hit) = tester.boxes(node, distance);
            if hit == 0 {
                continue;
            }
            // The farthest box first: the top of the stack is visited next.
            for slot in tester.far_to_near(node) {
                if hit >> slot & 1 == 1 {
                    stack[count] = (near[slot], node.children[slot]);
                    count += 1;
                }
            }
        }
        found
    }

    /// True if a ray hits anything that casts a shadow within a distance.
    pub(super) fn is_occluded(&self, ray: &Ray, max_distance: f32) -> bool {
        let tester = RayTester::new(ray);
        let mut stack = [0; STACK_SIZE];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let node = &self.nodes[stack[count] as usize];
            let (_, hit) = tester.boxes(node, max_distance);
            for (slot, child) in node.children.iter().enumerate() {
                if hit >> slot & 1 == 0 {
                    continue;
                }
                match *child {
                    Child::Node(index) => {
                        stack[count] = index;
                        count += 1;
                    }
                    Child::Leaf(index) => {
                        let leaf = &self.leaves[index as usize];
                        if tester.hits(leaf, max_distance).mask & leaf.casts_shadow != 0 {
                            return true;
                        }
                    }
                }
            }
        }
        false
    }
}

#[cfg(test)]
impl Bvh {
    /// Number of levels.
    pub(super) fn depth(&self) -> usize {
        // A node comes after its parent.
        let mut depths = vec![1; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate() {
            for child in &node.children {
                if let Child::Node(child) = child
                    && *child as usize > index
                {
                    depths[*child as usize] = depths[index] + 1;
                }
            }
        }
        depths.into_iter().max().unwrap_or(0)
    }

    /// Maximum number of levels for which the stack is large enough.
    pub(super) const MAX_DEPTH: usize = (STACK_SIZE - 1) / (BOXES - 1);
}

impl Child {
    const ROOT: Self = Self::Node(0);
}

impl Leaf {
    fn new(items: &[BuildItem]) -> Self {
        let lanes = |coordinate: &dyn Fn(&Triangle) -> f32| {
            let mut lanes = Vec4::ZERO;
            for (lane, item) in items.iter().enumerate() {
                lanes[lane] = coordinate(&item.triangle);
            }
            lanes
        };
        let mut faces = [0; LEAF_SIZE];
        let mut casts_shadow = 0;
        for (lane, BuildItem { triangle, .. }) in items.iter().enumerate() {
            faces[lane] = triangle.face;
            casts_shadow |= u32::from(!triangle.passes_light) << lane;
        }
        Self {
            corner: [0, 1, 2].map(|axis| lanes(&|triangle| triangle.corner[axis])),
            edges: [0, 1].map(|edge| [0, 1, 2].map(|axis| lanes(&|triangle| triangle.edges[edge][axis]))),
            faces,
            casts_shadow,
        }
    }
}

/// Where a ray hits the triangles of a leaf.
struct LeafHits {
    /// A bit for each triangle that is hit.
    mask: u32,
    distances: Vec4,
    /// Barycentric weights of the second and the third corners.
    weights: [Vec4; 2],
}

impl LeafHits {
    /// The nearest hit; of equally near ones, that of the first triangle.
    fn nearest(&self, leaf: &Leaf) -> Option<Hit> {
        let distances = self.distances.to_array();
        let hit = (0..LEAF_SIZE).filter(|lane| self.mask >> lane & 1 == 1);
        let lane = hit.reduce(|first, next| if distances[next] < distances[first] { next } else { first })?;
        Some(Hit {
            distance: distances[lane],
            face: leaf.faces[lane] as usize,
            weights: self.weights.map(|weights| weights[lane]),
        })
    }
}

/// A ray, prepared for testing four boxes or four triangles at once.
struct RayTester {
    origin: [Vec4; 3],
    direction: [Vec4; 3],
    inverse: [Vec4; 3],
    /// A bit for each axis along which the ray runs backwards.
    backwards: u8,
}

impl RayTester {
    fn new(ray: &Ray) -> Self {
        let [x, y, z] = [0, 1, 2].map(|axis| u8::from(ray.inverse[axis] < 0.0) << axis);
        Self {
            origin: ray.origin.to_array().map(Vec4::splat),
            direction: ray.direction.to_array().map(Vec4::splat),
            inverse: ray.inverse.to_array().map(Vec4::splat),
            backwards: x | y | z,
        }
    }

    /// Returns where the ray hits the triangles of a leaf within a distance, from either side (Möller and Trumbore,
    /// 1997).
    fn hits(&self, leaf: &Leaf, distance: f32) -> LeafHits {
        let [first, second] = &leaf.edges;
        let p = cross(&self.direction, second);
        let determinant = dot(first, &p);
        let inverse = Vec4::ONE / determinant;
        let t = [0, 1, 2].map(|axis| self.origin[axis] - leaf.corner[axis]);
        let u = dot(&t, &p) * inverse;
        let q = cross(&t, first);
        let v = dot(&self.direction, &q) * inverse;
        let distances = dot(second, &q) * inverse;
        let is_flat = determinant.abs().cmplt(Vec4::splat(1e-12));
        let is_beside = v.cmplt(Vec4::ZERO) | (u + v).cmpgt(Vec4::ONE);
        let is_within = u.cmpge(Vec4::ZERO) & u.cmple(Vec4::ONE);
        let is_near = distances.cmpgt(Vec4::splat(1e-5)) & distances.cmplt(Vec4::splat(distance));
        let hit = is_within & is_near & !(is_flat | is_beside);
        LeafHits { mask: hit.bitmask(), distances, weights: [u, v] }
    }

    /// Returns the distances to the boxes, and a bit for each box that the ray hits within a distance (Kay and Kajiya,
    /// SIGGRAPH 1986).
    fn boxes(&self, node: &Node, distance: f32) -> ([f32; BOXES], u32) {
        let (mut near, mut far) = (Vec4::ZERO, Vec4::splat(distance));
        for axis in 0..3 {
            let a = (node.low[axis] - self.origin[axis]) * self.inverse[axis];
            let b = (node.high[axis] - self.origin[axis]) * self.inverse[axis];
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near.to_array(), near.cmple(far).bitmask())
    }

    /// Returns the boxes of a node from the farthest to the nearest, by the axes of its splits.
    fn far_to_near(&self, node: &Node) -> [usize; BOXES] {
        let [both, first, last] = node.axes.map(|axis| usize::from(self.backwards >> axis & 1));
        let [first, last] = [[1 - first, first], [3 - last, 2 + last]];
        let [[a, b], [c, d]] = if both == 0 { [last, first] } else { [first, last] };
        [a, b, c, d]
    }
}

impl Node {
    /// A node of four boxes that no ray hits.
    const EMPTY: Self =
        Self { low: [Vec4::MAX; 3], high: [Vec4::MAX; 3], children: [Child::ROOT; BOXES], axes: [0; 3] };

    /// Sets one of the boxes.
    fn set(&mut self, slot: usize, [low, high]: [Vec3; 2], child: Child) {
        for axis in 0..3 {
            self.low[axis][slot] = low[axis];
            self.high[axis][slot] = high[axis];
        }
        self.children[slot] = child;
    }
}

/// Cross products, with the operations of `Vec3::cross`.
fn cross(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

/// Dot products, with the operations of `Vec3::dot`.
fn dot(a: &[Vec4; 3], b: &[Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn bounds(items: &[BuildItem]) -> (Vec3, Vec3) {
    items.iter().fold((Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)), |(low, high), item| {
        (low.min(item.low), high.max(item.high))
    })
}

/// Splits items into two parts and sets the axis of the split. All are in the first part if they fit into a leaf.
fn split_in_two<'a>(items: &'a mut [BuildItem], axis: &mut u8) -> [&'a mut [BuildItem]; 2] {
    let mut count = items.len();
    if count > LEAF_SIZE {
        let (split_axis, first_count) = partition_by_cost(items);
        (*axis, count) = (split_axis as u8, first_count);
    }
    items.split_at_mut(count).into()
}

/// Half of the surface area of a box; 0 for an empty one.
fn half_area(low: Vec3, high: Vec3) -> f32 {
    let size = (high - low).max(Vec3::ZERO);
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// Bounds and number of items.
#[derive(Debug, Clone, Copy)]
struct SplitBin {
    low: Vec3,
    high: Vec3,
    count: usize,
}

impl SplitBin {
    const EMPTY: Self = Self { low: Vec3::MAX, high: Vec3::MIN, count: 0 };

    fn merge(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high), count: self.count + other.count }
    }

    /// Expected cost of testing a ray against all items, up to a factor.
    fn cost(self) -> f32 {
        half_area(self.low, self.high) * self.count as f32
    }
}

/// Partitions items at the split with the lowest cost for rays (binned surface area heuristic; Wald, 2007). Returns the
/// axis and the number of items in the first part.
fn partition_by_cost(items: &mut [BuildItem]) -> (usize, usize) {
    let (low, high) = items.iter().fold((Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)), |(low, high), item| {
        (low.min(item.center), high.max(item.center))
    });
    let size = high - low;
    let bin = |item: &BuildItem, axis: usize| {
        let share = (item.center[axis] - low[axis]) / size[axis];
        ((share * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|axis| size[*axis] > 1e-6) {
        let mut bins = [SplitBin::EMPTY; BINS];
        for item in items.iter() {
            let bin = &mut bins[bin(item, axis)];
            *bin = bin.merge(SplitBin { low: item.low, high: item.high, count: 1 });
        }
        // Bin i of `right` merges the bins from i on.
        let mut right = bins;
        for index in (0..BINS - 1).rev() {
            right[index] = right[index].merge(right[index + 1]);
        }
        let mut left = SplitBin::EMPTY;
        for index in 1..BINS {
            left = left.merge(bins[index - 1]);
            let cost = left.cost() + right[index].cost();
            if left.count > 0 && right[index].count > 0 && best.is_none_or(|(lowest, ..)| cost < lowest) {
                best = Some((cost, axis, index));
            }
        }
    }
    let Some((_, axis, index)) = best else {
        // All items are at the same point.
        return (0, items.len() / 2);
    };
    // The order within each part is kept, so that the tree depends only on the scene.
    let (mut first, second): (Vec<_>, Vec<_>) = items.iter().partition(|item| bin(item, axis) < index);
    let count = first.len();
    first.extend(second);
    items.copy_from_slice(&first);
    (axis, count)
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::super::seeded_rng::SeededRng;
    use super::*;

    impl Triangle {
        /// The same as [`RayTester::hits`], for one triangle.
        fn intersect(&self, ray: &Ray, max_distance: f32) -> Option<(f32, [f32; 2])> {
            let [first, second] = self.edges;
            let p = ray.direction.cross(second);
            let determinant = first.dot(p);
            if determinant.abs() < 1e-12 {
                return None;
            }
            let inverse = 1.0 / determinant;
            let t = ray.origin - self.corner;
            let u = t.dot(p) * inverse;
            if !(0.0..=1.0).contains(&u) {
                return None;
            }
            let q = t.cross(first);
            let v = ray.direction.dot(q) * inverse;
            if v < 0.0 || u + v > 1.0 {
                return None;
            }
            let distance = second.dot(q) * inverse;
            (distance > 1e-5 && distance < max_distance).then_some((distance, [u, v]))
        }
    }

    #[test]
    fn tree_agrees_with_exhaustive_search() {
        let mut rng = SeededRng::new(3, &["bvh"]);
        let mut point = |size: f32| vec3(rng.between(-size, size), rng.between(-size, size), rng.between(-size, size));
        let faces: Vec<[Vec3; 3]> = (0..400)
            .map(|_| {
                let corner = point(4.0);
                [corner, corner + point(0.8), corner + point(0.8)]
            })
            .collect();
        let tree = Bvh::new(faces.iter().map(|face| (*face, false)));
        let mut hit_count = 0;
        for _ in 0..2000 {
            let ray = Ray::new(point(6.0), point(1.0).normalize());
            let nearest = faces
                .iter()
                .enumerate()
                .filter_map(|(face, [a, b, c])| {
                    let triangle =
                        Triangle { corner: *a, edges: [*b - *a, *c - *a], face: face as u32, passes_light: false };
                    triangle.intersect(&ray, 5.0).map(|(distance, weights)| (distance, face, weights))
                })
                .min_by(|(a, ..), (b, ..)| a.total_cmp(b));
            let hit = tree.closest_hit(&ray, 5.0);
            assert_eq!(hit.map(|hit| (hit.distance, hit.face, hit.weights)), nearest);
            assert_eq!(tree.is_occluded(&ray, 5.0), nearest.is_some());
            hit_count += usize::from(nearest.is_some());
        }
        assert!((100..1900).contains(&hit_count), "{hit_count}");
    }

    #[test]
    fn identical_faces_that_pass_light_are_hit_but_cast_no_shadow() {
        let wall = [vec3(-1.0, -1.0, 1.0), vec3(3.0, -1.0, 1.0), vec3(-1.0, 3.0, 1.0)];
        let tree = Bvh::new((0..300).map(|_| (wall, true)));
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        assert!(!tree.is_occluded(&ray, 9.0) && tree.closest_hit(&ray, 9.0).is_some());
    }
}
