//! A skeleton from a graph of joints and edges.

use armature_rig::{Bone, Skeleton, Transform};
use glam::{DVec3, Vec3};

use super::tgf::TgfGraph;
use crate::text::names::UniqueNames;

/// A skeleton that remembers the graph it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphSkeleton {
    /// One bone per edge, called `bone_1`, `bone_2`, … by the edge's place in the graph, and hubs called `root`.
    pub skeleton: Skeleton,
    /// The zero-based edge of every bone; `None` for a hub.
    pub edge_of_bone: Vec<Option<usize>>,
    /// The bone of every edge.
    pub bone_of_edge: Vec<usize>,
    /// Points that no bone touches.
    pub unused_points: Vec<usize>,
}

/// Why a graph cannot become a skeleton.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GraphError {
    /// There is no edge.
    #[error("the graph has no edges, so there are no bones. Add a line \"from to\" for every bone.")]
    NoEdges,
    /// An edge refers to a point that does not exist.
    #[error("edge {edge} refers to joint {point}, but there are only {point_count}. Correct the edge.", edge = .edge + 1, point = .point + 1)]
    PointOutOfRange {
        /// Zero-based edge.
        edge: usize,
        /// The offending zero-based point.
        point: usize,
        /// How many points there are.
        point_count: usize,
    },
    /// An edge joins a point with itself, repeats another edge or closes a loop.
    #[error(
        "edge {edge}, between joints {from} and {to}, closes a loop; a skeleton is a tree. Remove the edge.",
        edge = .edge + 1, from = .from + 1, to = .to + 1
    )]
    Loop {
        /// Zero-based edge.
        edge: usize,
        /// Zero-based point.
        from: usize,
        /// Zero-based point.
        to: usize,
    },
    /// A position is too large for single precision, or there are too many bones.
    #[error("the skeleton cannot be used: {0}. Scale or simplify the graph.")]
    Unusable(#[from] armature_rig::SkeletonError),
    /// The requested root has no edge.
    #[error("joint {root} cannot be the root: no edge touches it. Choose another joint.", root = .root + 1)]
    BadRoot {
        /// Zero-based point.
        root: usize,
    },
}

/// Makes a bone of every edge except those of cages, directed away from the root, with identity rest rotation and its
/// head where its parent ends. The root is the point `root`, or the first point that an edge touches; if several edges
/// meet there, they become children of a hub bone `root` without length. Every further connected part of the graph
/// becomes another root, starting at its own first point. Children follow the order of the edges.
///
/// ```
/// use armature_formats::skeleton::{TgfGraph, skeleton_from_graph};
///
/// let points = vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.5, 0.0]];
/// let graph = TgfGraph { points, edges: vec![[0, 1], [1, 2]], ..TgfGraph::default() };
/// let made = skeleton_from_graph(&graph, None)?;
/// assert_eq!(made.skeleton.bones()[1].name, "bone_2");
/// assert_eq!(made.skeleton.bones()[1].parent, Some(0));
/// # Ok::<(), armature_formats::skeleton::GraphError>(())
/// ```
pub fn skeleton_from_graph(graph: &TgfGraph, root: Option<usize>) -> Result<GraphSkeleton, GraphError> {
    let touching = edges_of_points(graph)?;
    if graph.edges.is_empty() {
        return Err(GraphError::NoEdges);
    }
    if let Some(root) = root.filter(|&r| touching.get(r).is_none_or(Vec::is_empty)) {
        return Err(GraphError::BadRoot { root });
    }
    let mut build = Build {
        graph,
        touching: &touching,
        bones: Vec::new(),
        edge_of_bone: Vec::new(),
        bone_of_edge: vec![None; graph.edges.len()],
        reached: vec![false; graph.points.len()],
        names: UniqueNames::default(),
    };
    let starts = root.into_iter().chain(0..graph.points.len());
    for start in starts {
        if !build.reached[start] && !touching[start].is_empty() {
            build.component(start)?;
        }
    }
    let unused_points = (0..graph.points.len()).filter(|&p| touching[p].is_empty()).collect();
    Ok(GraphSkeleton {
        skeleton: Skeleton::new(build.bones)?,
        edge_of_bone: build.edge_of_bone,
        // Every edge touches a point of some component, so none is missed.
        bone_of_edge: build.bone_of_edge.into_iter().flatten().collect(),
        unused_points,
    })
}

/// How the names of bones begin that stand for points of a graph.
pub const POINT_PREFIX: &str = "point_";

impl GraphSkeleton {
    /// With a bone without length for every point that no bone touches, called `point_1`, `point_2`, … by its place in the
    /// graph: a root of its own, which a character's pose moves apart from the others. Points of cages are among them.
    pub fn with_points(self, graph: &TgfGraph) -> Result<Skeleton, GraphError> {
        let mut names = UniqueNames::default();
        let mut bones: Vec<Bone> = self.skeleton.bones().to_vec();
        bones.iter().for_each(|bone| _ = names.give(&bone.name, "bone"));
        for &point in &self.unused_points {
            let name = names.give(&format!("{POINT_PREFIX}{}", point + 1), "point");
            let rest = at(DVec3::from(graph.points[point]));
            bones.push(Bone { name, parent: None, rest, tail: Vec3::ZERO });
        }
        Ok(Skeleton::new(bones)?)
    }
}

fn edges_of_points(graph: &TgfGraph) -> Result<Vec<Vec<usize>>, GraphError> {
    let mut touching = vec![Vec::new(); graph.points.len()];
    for (edge, ends) in graph.edges.iter().enumerate() {
        for &point in ends {
            let list: &mut Vec<usize> = touching.get_mut(point).ok_or(GraphError::PointOutOfRange {
                edge,
                point,
                point_count: graph.points.len(),
            })?;
            list.push(edge);
        }
    }
    Ok(touching)
}

/// A point that has been reached, with the bone that ends there.
#[derive(Clone, Copy)]
struct Reached {
    point: usize,
    bone: Option<usize>,
    /// The point where that bone starts.
    bone_head: usize,
}

struct Build<'g> {
    graph: &'g TgfGraph,
    touching: &'g [Vec<usize>],
    bones: Vec<Bone>,
    edge_of_bone: Vec<Option<usize>>,
    bone_of_edge: Vec<Option<usize>>,
    reached: Vec<bool>,
    names: UniqueNames,
}

impl Build<'_> {
    fn point(&self, point: usize) -> DVec3 {
        DVec3::from(self.graph.points[point])
    }

    fn push(&mut self, bone: Bone, edge: Option<usize>) -> usize {
        self.bones.push(bone);
        self.edge_of_bone.push(edge);
        self.bones.len() - 1
    }

    /// Queues the edges that leave a point, with the first to be taken next.
    fn wait(&self, waiting: &mut Vec<(usize, Reached)>, from: Reached) {
        let leaving = self.touching[from.point].iter().rev().filter(|&&edge| self.bone_of_edge[edge].is_none());
        waiting.extend(leaving.map(|&edge| (edge, from)));
    }

    /// Walks one connected part from its root, depth first.
    fn component(&mut self, start: usize) -> Result<(), GraphError> {
        self.reached[start] = true;
        let mut parent = None;
        if self.touching[start].len() > 1 {
            let name = self.names.give("root", "root");
            let rest = at(self.point(start));
            parent = Some(self.push(Bone { name, parent: None, rest, tail: Vec3::ZERO }, None));
        }
        let mut waiting = Vec::new();
        self.wait(&mut waiting, Reached { point: start, bone: parent, bone_head: start });
        while let Some((edge, from)) = waiting.pop() {
            let ends = self.graph.edges[edge];
            let to = if ends[0] == from.point { ends[1] } else { ends[0] };
            if self.reached[to] {
                return Err(GraphError::Loop { edge, from: ends[0], to: ends[1] });
            }
            self.reached[to] = true;
            let head = self.point(from.point);
            let origin = from.bone.map_or(DVec3::ZERO, |_| self.point(from.bone_head));
            let name = self.names.give(&format!("bone_{}", edge + 1), "bone");
            let tail = (self.point(to) - head).as_vec3();
            let bone = self.push(Bone { name, parent: from.bone, rest: at(head - origin), tail }, Some(edge));
            self.bone_of_edge[edge] = Some(bone);
            self.wait(&mut waiting, Reached { point: to, bone: Some(bone), bone_head: from.point });
        }
        Ok(())
    }
}

fn at(translation: DVec3) -> Transform {
    Transform { translation: translation.as_vec3(), ..Transform::IDENTITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(points: usize, edges: &[[usize; 2]]) -> TgfGraph {
        let points = (0..points).map(|i| [i as f64, (i * i) as f64, -0.5 * i as f64]).collect();
        TgfGraph { points, edges: edges.to_vec(), ..TgfGraph::default() }
    }

    #[test]
    fn every_edge_is_a_bone_between_its_points() {
        let graph = graph(7, &[[2, 1], [0, 1], [1, 3], [4, 3], [5, 0]]);
        for root in [None, Some(1), Some(4)] {
            let made = skeleton_from_graph(&graph, root).unwrap();
            assert_eq!(made.unused_points, [6]);
            let all = made.clone().with_points(&graph).unwrap();
            let point = &all.bones()[made.skeleton.len()];
            assert_eq!((point.name.as_str(), point.parent, point.tail), ("point_7", None, Vec3::ZERO));
            assert_eq!(point.rest.translation, DVec3::from(graph.points[6]).as_vec3());
            assert_eq!(all.bones()[..made.skeleton.len()], *made.skeleton.bones());
            let segments = made.skeleton.rest_segments();
            for (edge, &bone) in made.bone_of_edge.iter().enumerate() {
                assert_eq!(made.edge_of_bone[bone], Some(edge));
                assert_eq!(made.skeleton.bones()[bone].name, format!("bone_{}", edge + 1));
                let mut ends = graph.edges[edge].map(|p| DVec3::from(graph.points[p]).as_vec3());
                if segments[bone].0.distance(ends[0]) > 1e-4 {
                    ends.reverse();
                }
                assert!(segments[bone].0.distance(ends[0]) < 1e-4 && segments[bone].1.distance(ends[1]) < 1e-4);
                if let Some(parent) = made.skeleton.bones()[bone].parent {
                    assert!(segments[parent].1.distance(segments[bone].0) < 1e-4);
                }
            }
            let hubs = usize::from(root != Some(4));
            assert_eq!(made.skeleton.len(), 5 + hubs);
            assert_eq!(made.skeleton.find("root").is_some(), hubs == 1);
        }
    }

    #[test]
    fn parts_become_roots() {
        let made = skeleton_from_graph(&graph(6, &[[0, 1], [3, 4], [3, 5]]), None).unwrap();
        let names: Vec<&str> = made.skeleton.bones().iter().map(|b| b.name.as_str()).collect();
        assert_eq!(names, ["bone_1", "root", "bone_2", "bone_3"]);
        assert_eq!(made.skeleton.bones().iter().filter(|b| b.parent.is_none()).count(), 2);
    }

    #[test]
    fn nonsense_is_named() {
        let fails = |points, edges: &[[usize; 2]], root| skeleton_from_graph(&graph(points, edges), root).unwrap_err();
        assert_eq!(fails(3, &[], None), GraphError::NoEdges);
        assert!(matches!(fails(3, &[[0, 1], [1, 2], [2, 0]], None), GraphError::Loop { .. }));
        assert!(matches!(fails(3, &[[0, 1], [1, 0]], None), GraphError::Loop { .. }));
        assert!(matches!(fails(3, &[[1, 1]], None), GraphError::Loop { edge: 0, .. }));
        assert!(matches!(fails(2, &[[0, 2]], None), GraphError::PointOutOfRange { edge: 0, point: 2, .. }));
        assert_eq!(fails(3, &[[0, 1]], Some(2)), GraphError::BadRoot { root: 2 });
        assert_eq!(fails(3, &[[0, 1]], Some(9)), GraphError::BadRoot { root: 9 });
    }
}
