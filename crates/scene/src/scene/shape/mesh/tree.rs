//! A tree of boxes over the triangles of a mesh, four boxes to a node, in single precision.
//!
//! ```text
//!   obvhs ─► two boxes to a node ─► four: a node takes the children of its largest child until it is full
//! ```
//!
//! Four boxes are met at once, and a node is two lines of the cache: with two to a node and more bytes to a box, a ray
//! waits for memory twice as often.

use std::ops::Range;

use glam::{Vec3A, Vec4};
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams};
use smallvec::SmallVec;

/// Up to four boxes and what is in them.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Node {
    /// Where boxes begin along x, y and z, and where they end. One that is missing begins at infinity and ends before.
    sides: [Vec4; 6],
    /// First triangle of each box in the tree's order; of a box of boxes the number of its node.
    first: [u32; 4],
    /// Triangles of each box; none in a box of boxes.
    triangles: [u32; 4],
}

const EMPTY: Node = Node {
    sides: [
        Vec4::INFINITY,
        Vec4::INFINITY,
        Vec4::INFINITY,
        Vec4::NEG_INFINITY,
        Vec4::NEG_INFINITY,
        Vec4::NEG_INFINITY,
    ],
    first: [0; 4],
    triangles: [0; 4],
};

/// Boxes within boxes.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
}

/// What a tree is grown over.
pub(super) struct Bounds(pub Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

/// A box on a ray's way.
#[derive(Debug, Clone, Copy)]
struct Ahead {
    first: u32,
    triangles: u32,
    /// Where the ray enters.
    range: f32,
}

impl Tree {
    /// Over triangles with these bounds, and the order in which it keeps them.
    pub(super) fn build(bounds: &[Bounds]) -> (Self, Vec<u32>) {
        let params = BvhBuildParams::fast_build();
        let narrow = build_bvh2(bounds, params, &mut std::time::Duration::default());
        let mut nodes = vec![EMPTY];
        let mut open = vec![(0, 0)];
        while let Some((from, to)) = open.pop() {
            for (slot, number) in children(&narrow, from).into_iter().enumerate() {
                let child = &narrow.nodes[number as usize];
                let Aabb { min, max } = *child.aabb();
                for axis in 0..3 {
                    nodes[to].sides[axis][slot] = min[axis];
                    nodes[to].sides[axis + 3][slot] = max[axis];
                }
                nodes[to].triangles[slot] = child.prim_count;
                nodes[to].first[slot] = child.first_index;
                if !child.is_leaf() {
                    nodes[to].first[slot] = nodes.len() as u32;
                    open.push((number, nodes.len()));
                    nodes.push(EMPTY);
                }
            }
        }
        nodes.shrink_to_fit();
        (Tree { nodes }, narrow.primitive_indices)
    }

    /// Follows a ray from box to box, nearest first as far as boxes lie apart. `meet` gets the places of triangles whose box it enters, and
    /// says beyond which range nothing counts any more.
    #[inline]
    pub(super) fn follow(
        &self,
        origin: Vec3A,
        direction: Vec3A,
        mut meet: impl FnMut(Range<usize>) -> f32,
    ) {
        // Parallel to a side, a ray is in the box or passes it far away; so is one over a number that is almost none.
        let over = |along: f32| {
            1.0 / if along.abs() < 1e-9 {
                1e-9f32.copysign(along)
            } else {
                along
            }
        };
        let over = direction.to_array().map(over);
        let axes: [_; 3] = std::array::from_fn(|axis| {
            let (near, far) = if over[axis] < 0.0 {
                (axis + 3, axis)
            } else {
                (axis, axis + 3)
            };
            (
                near,
                far,
                Vec4::splat(origin[axis]),
                Vec4::splat(over[axis]),
            )
        });
        let mut limit = f32::INFINITY;
        let mut ahead: SmallVec<[Ahead; 64]> = SmallVec::new();
        let mut here = Ahead {
            first: 0,
            triangles: 0,
            range: 0.0,
        };
        loop {
            if here.triangles > 0 {
                let first = here.first as usize;
                limit = limit.min(meet(first..first + here.triangles as usize));
            } else {
                let node = &self.nodes[here.first as usize];
                let (mut enter, mut leave) = (Vec4::ZERO, Vec4::splat(limit));
                for (near, far, origin, over) in axes {
                    enter = enter.max((node.sides[near] - origin) * over);
                    leave = leave.min((node.sides[far] - origin) * over);
                }
                let (mut met, ranges) = (enter.cmple(leave).bitmask(), enter.to_array());
                let others = ahead.len();
                while met != 0 {
                    let slot = met.trailing_zeros() as usize;
                    met &= met - 1;
                    let range = ranges[slot];
                    let mut place = ahead.len();
                    let found = Ahead {
                        first: node.first[slot],
                        triangles: node.triangles[slot],
                        range,
                    };
                    ahead.push(found);
                    // The nearest is the last.
                    while place > others && ahead[place - 1].range < range {
                        ahead[place] = ahead[place - 1];
                        place -= 1;
                    }
                    ahead[place] = found;
                }
            }
            here = loop {
                match ahead.pop() {
                    None => return,
                    Some(next) if next.range <= limit => break next,
                    Some(_) => {}
                }
            };
        }
    }
}

/// Up to four nodes that together are what `node` and those under it are, none of them twice.
fn children(tree: &Bvh2, node: u32) -> SmallVec<[u32; 4]> {
    let bvh_node = |node: u32| &tree.nodes[node as usize];
    let mut all: SmallVec<[u32; 4]> = SmallVec::from_slice(&[node]);
    while all.len() < 4 {
        let open = (0..all.len()).filter(|&at| !bvh_node(all[at]).is_leaf());
        let size = |at: usize| bvh_node(all[at]).aabb().half_area();
        let Some(largest) = open.max_by(|&a, &b| size(a).total_cmp(&size(b))) else {
            break;
        };
        let first = bvh_node(all[largest]).first_index;
        all[largest] = first;
        all.push(first + 1);
    }
    all
}
