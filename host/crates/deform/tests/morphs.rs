//! Morph targets before skinning: the formula, the rest shape bit for bit, and what does not fit.

use armature_deform::skin::{
    BoneBlend, BoneSegment, DualQuaternionSkin, LinearBlendSkin, MorphOffsets, Morphs, SkinError, StretchTwist,
    StretchTwistSkin,
};
use armature_geometry::Influences;
use glam::{Affine3A, Quat, Vec3};

const COUNT: usize = 37;

/// First vertex, offsets of positions and normals, weight at rest.
type Target = (usize, Vec<[f32; 3]>, Vec<[f32; 3]>, f32);

struct Face {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    targets: Vec<Target>,
}

fn face() -> Face {
    let mut state = 1_u32;
    let mut any = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    let mut some = |count: usize| -> Vec<[f32; 3]> { (0..count).map(|_| [any(), any(), any()]).collect() };
    let (positions, normals) = (some(COUNT), some(COUNT));
    let mut sparse = some(20);
    sparse.iter_mut().step_by(2).for_each(|offset| *offset = [0.0; 3]);
    let targets = vec![(3, some(20), some(20), 0.0), (10, some(27), Vec::new(), 0.25), (17, sparse, Vec::new(), 0.0)];
    Face { positions, normals, targets }
}

impl Face {
    fn offsets(&self) -> Vec<MorphOffsets<'_>> {
        let mut offsets = Vec::new();
        for (first_vertex, positions, normals, rest_weight) in &self.targets {
            let (first_vertex, rest_weight) = (*first_vertex, *rest_weight);
            offsets.push(MorphOffsets { first_vertex, positions, normals, rest_weight });
        }
        offsets
    }

    /// By the formula, in double precision.
    fn blended(&self, weights: &[f32]) -> Vec<[f64; 3]> {
        let mut out: Vec<[f64; 3]> = self.positions.iter().map(|p| p.map(f64::from)).collect();
        for ((first, positions, _, rest), weight) in self.targets.iter().zip(weights) {
            for (k, offset) in positions.iter().enumerate() {
                for c in 0..3 {
                    out[first + k][c] += (f64::from(*weight) - f64::from(*rest)) * f64::from(offset[c]);
                }
            }
        }
        out
    }
}

#[test]
fn shapes_are_blended_before_bones_move_them() {
    let face = face();
    let mut morphs = Morphs::precompute(&face.positions, &face.normals, &face.offsets()).unwrap();
    let influences = Influences::new(2, [0, 1].repeat(COUNT), [0.25, 0.75].repeat(COUNT), 2).unwrap();
    let rest = [Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X)];
    let moved = rest.map(|frame| Affine3A::from_translation(Vec3::Y) * frame);
    let mut linear = LinearBlendSkin::precompute(&face.positions, &face.normals, &influences, &rest).unwrap();
    let mut dual = DualQuaternionSkin::precompute(&face.positions, &face.normals, &influences, &rest).unwrap();
    let segments = rest.map(|frame| BoneSegment { start: frame.translation.into(), end: Vec3::Z });
    let (ends, blend) = (vec![0.5; 2 * COUNT], BoneBlend::Linear);
    let mut stretched =
        StretchTwistSkin::precompute(&face.positions, &face.normals, &influences, &ends, &segments, blend).unwrap();
    // Twice as long: at the middle of a bone, half of its length is added along it.
    let pose = segments.map(|segment| StretchTwist {
        start: segment.start + Vec3::Y,
        turn: Quat::IDENTITY,
        stretch: 2.0,
        twist: [0.0; 2],
    });
    let longer: Vec3 = segments.iter().zip([0.25, 0.75]).map(|(s, w)| (s.end - s.start) * (0.5 * w)).sum();
    let plain = {
        let mut posed = (face.positions.clone(), face.normals.clone());
        linear.solve(&moved, &mut posed.0, &mut posed.1).unwrap();
        posed
    };
    assert!(!morphs.solve(&[0.0, 0.25, 0.0]).unwrap(), "that is the rest shape");
    for weights in [[1.0, 0.25, 0.0], [0.5, -0.5, 2.0], [0.0, 0.0, 1.0]] {
        assert!(morphs.solve(&weights).unwrap());
        linear.set_rest(&morphs).unwrap();
        dual.set_rest(&morphs).unwrap();
        stretched.set_rest(&morphs).unwrap();
        let expected = face.blended(&weights);
        let mut posed = (face.positions.clone(), face.normals.clone());
        linear.solve(&moved, &mut posed.0, &mut posed.1).unwrap();
        let mut by_dual = posed.clone();
        dual.solve(&moved, &mut by_dual.0, &mut by_dual.1).unwrap();
        let mut by_stretch = posed.clone();
        stretched.solve(&pose, &mut by_stretch.0, &mut by_stretch.1).unwrap();
        for vertex in 0..COUNT {
            let back = Vec3::from(by_stretch.0[vertex]) - longer;
            assert!(back.distance(posed.0[vertex].into()) < 2e-6, "vertex {vertex}");
            for (c, up) in [0.0, 1.0, 0.0].into_iter().enumerate() {
                for got in [posed.0[vertex][c], by_dual.0[vertex][c]] {
                    assert!((f64::from(got) - expected[vertex][c] - up).abs() < 2e-6, "vertex {vertex}");
                }
            }
            assert!((Vec3::from(posed.1[vertex]).length() - 1.0).abs() < 1e-5);
        }
        // Only the first target turns normals.
        let turns = weights[0] != 0.0;
        let bits = |normal: [f32; 3]| normal.map(f32::to_bits);
        assert_eq!(bits(posed.1[5]) != bits(plain.1[5]), turns);
        assert_eq!(bits(posed.1[30]), bits(plain.1[30]));
    }
    assert!(morphs.solve(&[0.0, 0.25, 0.0]).unwrap());
    linear.set_rest(&morphs).unwrap();
    let mut posed = (face.positions.clone(), face.normals.clone());
    linear.solve(&moved, &mut posed.0, &mut posed.1).unwrap();
    assert_eq!(posed, plain, "the rest shape comes back to the last bit");
    let touched: Vec<usize> = morphs.moved().map(|(vertex, ..)| vertex).collect();
    assert_eq!(touched, (3..COUNT).collect::<Vec<_>>());
}

#[test]
fn nonsense_is_named() {
    let face = face();
    let new = |offsets: &[MorphOffsets]| Morphs::precompute(&face.positions, &face.normals, offsets).map(|_| ());
    let one = face.offsets()[0];
    for (wrong, what) in [
        (MorphOffsets { first_vertex: 18, ..one }, "vertices"),
        (MorphOffsets { first_vertex: usize::MAX, ..one }, "vertices"),
        (MorphOffsets { normals: &[[0.0; 3]], ..one }, "normals of a morph target"),
    ] {
        assert!(matches!(new(&[wrong]), Err(SkinError::Length { what: named, .. }) if named == what));
    }
    let nan = [[f32::NAN; 3]];
    let nan = MorphOffsets { first_vertex: 7, positions: &nan, normals: &[], rest_weight: 0.0 };
    assert_eq!(new(&[nan]), Err(SkinError::VertexNotFinite { vertex: 7 }));
    assert_eq!(
        new(&[one, MorphOffsets { rest_weight: f32::NAN, ..one }]),
        Err(SkinError::WeightNotFinite { target: 1 })
    );
    let mut morphs = Morphs::precompute(&face.positions, &face.normals, &face.offsets()).unwrap();
    assert_eq!(morphs.solve(&[0.0, f32::INFINITY, 0.0]), Err(SkinError::WeightNotFinite { target: 1 }));
    assert!(matches!(morphs.solve(&[0.0]), Err(SkinError::Length { .. })));
    morphs.solve(&[f32::MAX, f32::MIN, f32::MAX]).unwrap();
    assert!(morphs.moved().all(|(_, p, n)| p.iter().chain(&n).all(|c| c.is_finite())));
}
