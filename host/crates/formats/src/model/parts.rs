//! The meshes that a surface consists of, and their morph targets.

use std::ops::Range;

/// A piece of a surface that is drawn with one material: a mesh of the file, or the part of one with that material.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshPart {
    /// Its name in the file; may be empty.
    pub name: String,
    /// Its drawn vertices.
    pub vertices: Range<u32>,
    /// Its triangles, over those vertices alone.
    pub triangles: Range<u32>,
    /// Zero-based material; `None` where the file gives none.
    pub material: Option<u32>,
    /// Zero-based [`Skin`](super::Skin) of the rig; `None`: bound in the skeleton's rest pose.
    pub skin: Option<u32>,
}

/// A shape that a part of a surface can be blended towards (a blend shape).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Its name; targets of different parts with the same name are one control.
    pub name: String,
    /// Zero-based part that it belongs to.
    pub part: u32,
    /// Its weight unless something sets another. The surface as it is stored has it at this weight: a weight `w` adds
    /// `(w − default_weight)` times the offsets.
    pub default_weight: f32,
    /// What weight 1 adds to the positions of the part's drawn vertices (model space).
    pub positions: Vec<[f32; 3]>,
    /// What weight 1 adds to their normals; empty if the file gives none.
    pub normals: Vec<[f32; 3]>,
}

/// Why parts or morph targets do not fit a surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PartError {
    /// The parts do not cover the vertices and triangles of the surface one after the other.
    #[error("mesh part {part} does not start where the one before it ends, or the parts do not cover the surface")]
    NotInOrder {
        /// Zero-based part; the number of parts where vertices or triangles are left over.
        part: usize,
    },
    /// A triangle uses vertices of another part.
    #[error("triangle {triangle} of mesh part {part} uses a vertex of another part")]
    Crosses {
        /// Zero-based part.
        part: usize,
        /// Zero-based triangle of the surface.
        triangle: usize,
    },
    /// A material or skin does not exist.
    #[error("mesh part {part} uses {what} {number}, but there are only {count}")]
    OutOfRange {
        /// Zero-based part.
        part: usize,
        /// `material` or `skin`.
        what: &'static str,
        /// Zero-based number.
        number: u32,
        /// How many there are.
        count: usize,
    },
    /// A morph target names a part that does not exist, or its offsets are not one per vertex, or not finite.
    #[error("morph target {target} does not fit its mesh part")]
    Morph {
        /// Zero-based target.
        target: usize,
    },
}

/// Checks that `parts` cover a surface of `vertices` drawn vertices and these triangles in order, that their materials
/// and skins exist (`[materials, skins]`: how many there are), and that the morph targets fit them.
pub fn check_parts(
    parts: &[MeshPart],
    targets: &[MorphTarget],
    vertices: usize,
    triangles: &[[u32; 3]],
    [materials, skins]: [usize; 2],
) -> Result<(), PartError> {
    let (mut next_vertex, mut next_triangle) = (0, 0);
    for (part, found) in parts.iter().enumerate() {
        let in_order = found.vertices.start == next_vertex
            && found.triangles.start == next_triangle
            && found.vertices.end >= next_vertex
            && found.triangles.end >= next_triangle
            && found.vertices.end as usize <= vertices
            && found.triangles.end as usize <= triangles.len();
        if !in_order {
            return Err(PartError::NotInOrder { part });
        }
        (next_vertex, next_triangle) = (found.vertices.end, found.triangles.end);
        let own = found.triangles.start as usize..found.triangles.end as usize;
        let crosses = |triangle: &[u32; 3]| !triangle.iter().all(|corner| found.vertices.contains(corner));
        if let Some(at) = triangles[own.clone()].iter().position(crosses) {
            return Err(PartError::Crosses { part, triangle: own.start + at });
        }
        for (what, number, count) in [("material", found.material, materials), ("skin", found.skin, skins)] {
            if let Some(number) = number.filter(|&number| number as usize >= count) {
                return Err(PartError::OutOfRange { part, what, number, count });
            }
        }
    }
    if next_vertex as usize != vertices || next_triangle as usize != triangles.len() {
        return Err(PartError::NotInOrder { part: parts.len() });
    }
    let fits = |target: &MorphTarget| {
        let Some(part) = parts.get(target.part as usize) else { return false };
        let numbers = target.positions.iter().chain(&target.normals).flatten();
        target.positions.len() == part.vertices.len()
            && (target.normals.is_empty() || target.normals.len() == part.vertices.len())
            && target.default_weight.is_finite()
            && numbers.into_iter().all(|number| number.is_finite())
    };
    match targets.iter().position(|target| !fits(target)) {
        Some(target) => Err(PartError::Morph { target }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(vertices: Range<u32>, triangles: Range<u32>) -> MeshPart {
        MeshPart { vertices, triangles, ..MeshPart::default() }
    }

    const TRIANGLES: [[u32; 3]; 3] = [[0, 1, 2], [3, 4, 5], [5, 4, 3]];

    #[test]
    fn parts_cover_the_surface_in_order() {
        let check = |parts: &[MeshPart], targets: &[MorphTarget]| check_parts(parts, targets, 6, &TRIANGLES, [1, 0]);
        let (first, second) = (part(0..3, 0..1), part(3..6, 1..3));
        let smile = MorphTarget { part: 1, positions: vec![[1.0, 0.0, 0.0]; 3], ..MorphTarget::default() };
        let both = [first.clone(), second.clone()];
        assert_eq!(check(&both, std::slice::from_ref(&smile)), Ok(()));
        assert_eq!(check(&both[..1], &[]), Err(PartError::NotInOrder { part: 1 }));
        assert_eq!(check(&[second.clone(), first.clone()], &[]), Err(PartError::NotInOrder { part: 0 }));
        let crossing = [part(0..3, 0..2), part(3..6, 2..3)];
        assert_eq!(check(&crossing, &[]), Err(PartError::Crosses { part: 0, triangle: 1 }));
        let painted = [first.clone(), MeshPart { material: Some(1), ..second.clone() }];
        let missing = PartError::OutOfRange { part: 1, what: "material", number: 1, count: 1 };
        assert_eq!(check(&painted, &[]), Err(missing));
        let bound = [MeshPart { skin: Some(0), ..first }, second];
        assert!(matches!(check(&bound, &[]), Err(PartError::OutOfRange { what: "skin", .. })));
        for wrong in [
            MorphTarget { part: 2, ..smile.clone() },
            MorphTarget { positions: vec![[0.0; 3]; 2], ..smile.clone() },
            MorphTarget { normals: vec![[0.0; 3]; 2], ..smile.clone() },
            MorphTarget { default_weight: f32::NAN, ..smile },
        ] {
            assert_eq!(check(&both, &[wrong]), Err(PartError::Morph { target: 0 }));
        }
    }

    #[test]
    fn hostile_ranges_do_no_harm() {
        #[expect(clippy::reversed_empty_ranges, reason = "a range that runs backwards is what is tested")]
        let backwards = [part(0..6, 3..1)];
        assert!(check_parts(&backwards, &[], 6, &TRIANGLES, [0, 0]).is_err());
        assert!(check_parts(&[part(0..u32::MAX, 0..3)], &[], 6, &TRIANGLES, [0, 0]).is_err());
    }
}
