//! A gap where bones meet, for weights to change in.

use glam::DVec3;

use super::boundary::{Handle, HandleKind};

/// The fraction of a bone's length near each of its joints that [`free_joints`] releases by default. With a fifth, the
/// weights of a hand on a volume of 5,000 vertices differed from those on twice as many by 0.006 in the mean; with
/// none, by 0.017. A quarter does as well, and where bones are sampled by halving, a vertex lies exactly where the gap
/// ends.
pub const FREE_NEAR_JOINTS: f64 = 0.25;

/// The largest fraction that makes sense: a bone between two joints then keeps nothing but its middle.
pub const MOST_FREE_NEAR_JOINTS: f64 = 0.5;

/// A vertex exactly where a gap ends stays held, whichever way it was rounded.
const ROUNDING: f64 = 1e-9;

/// Releases bones near the joints they share, over this fraction of their length; the joints themselves stay held. With
/// a fraction of 0 bones hold to their ends, as in the papers and in libigl.
///
/// Weights that jump from one to zero within one sample of a joint have an energy that grows without bound as samples
/// get denser (on a curve in space, functions of finite bending energy cannot jump), and so depend on where samples and
/// elements happen to lie. With a gap of fixed length the weights converge as the mesh is refined, and bends are
/// softer. Where no vertex lies at its end, the gap is up to one sample longer. A bone keeps at least one vertex of its
/// own if it has any. `vertices` are the mesh's n positions; handles that are not bones, and vertices that do not
/// exist, are left alone.
pub fn free_joints(vertices: &[[f64; 3]], handles: &mut [Handle], share: f64) {
    let mut holders = vec![0_u32; vertices.len()];
    for handle in handles.iter().filter(|handle| handle.kind == HandleKind::Bone) {
        let mut held = handle.vertices.clone();
        held.sort_unstable();
        held.dedup();
        held.iter().filter(|&&vertex| vertex < vertices.len()).for_each(|&vertex| holders[vertex] += 1);
    }
    for handle in handles.iter_mut().filter(|handle| handle.kind == HandleKind::Bone) {
        free_one(vertices, &holders, &mut handle.vertices, share);
    }
}

fn free_one(vertices: &[[f64; 3]], holders: &[u32], held: &mut Vec<usize>, share: f64) {
    let place = |vertex: usize| vertices.get(vertex).map(|&p| DVec3::from(p));
    let joints: Vec<DVec3> =
        held.iter().filter(|&&v| holders.get(v).is_some_and(|&n| n > 1)).filter_map(|&v| place(v)).collect();
    // A bone that is shared entirely has no joints.
    if joints.is_empty() || joints.len() == held.len() {
        return;
    }
    let length = |joint: &DVec3| held.iter().filter_map(|&v| place(v)).map(|p| p.distance(*joint)).fold(0.0, f64::max);
    let gap = |joint: &DVec3| share * (1.0 - ROUNDING) * length(joint);
    let gaps: Vec<(DVec3, f64)> = joints.iter().map(|joint| (*joint, gap(joint))).collect();
    // How far a vertex of the bone's own is from the gaps; negative within one.
    let clearance = |vertex: usize| {
        let at = place(vertex)?;
        Some(gaps.iter().map(|(joint, gap)| at.distance(*joint) - gap).fold(f64::INFINITY, f64::min))
    };
    let is_own = |vertex: &usize| holders.get(*vertex).is_some_and(|&n| n == 1);
    let own = held.iter().copied().filter(is_own);
    let clearest = own.filter_map(|v| clearance(v).map(|c| (c, v))).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, v)| v);
    held.retain(|v| !is_own(v) || Some(*v) == clearest || clearance(*v).is_none_or(|clear| clear >= 0.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Vec<[f64; 3]> {
        (0..21).map(|k| [f64::from(k), 0.0, 0.0]).collect()
    }

    fn bone(from: usize, to: usize) -> Handle {
        Handle { kind: HandleKind::Bone, vertices: (from..=to).collect() }
    }

    #[test]
    fn bones_let_go_where_they_meet() {
        let mut handles = [bone(0, 10), bone(10, 20), Handle { kind: HandleKind::Own, vertices: vec![3] }];
        free_joints(&line(), &mut handles, 0.25);
        assert_eq!(handles[0].vertices, [0, 1, 2, 3, 4, 5, 6, 7, 10], "the free end stays, and the joint");
        assert_eq!(handles[1].vertices, [10, 13, 14, 15, 16, 17, 18, 19, 20]);
        assert_eq!(handles[2].vertices, [3]);
    }

    #[test]
    fn no_bone_loses_everything() {
        let mut handles = [bone(0, 2), bone(2, 5), bone(5, 9), bone(5, 9), bone(20, 20)];
        handles[0].vertices.push(99);
        free_joints(&line(), &mut handles, 0.9);
        assert_eq!(handles[0].vertices, [0, 2, 99]);
        assert_eq!(handles[1].vertices.len(), 3, "two joints and the clearest: {:?}", handles[1].vertices);
        assert_eq!(handles[2], bone(5, 9), "two bones at one place share it all");
        assert_eq!(handles[4], bone(20, 20));
    }
}
