//! Between the file's corners or vertices and our welded geometry with its drawn vertices.

use std::collections::HashMap;
use std::hash::Hash;

use super::contents::Split;

/// No texture coordinate or normal at a corner.
pub(crate) const NONE: u32 = u32::MAX;

/// A triangle corner as in OBJ: indices of a position, a texture coordinate and a normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Corner {
    pub(crate) vertex: u32,
    pub(crate) texture: u32,
    pub(crate) normal: u32,
}

/// Attributes of the drawn vertices, and the drawn vertices themselves if they are not just the mesh's.
#[derive(Debug, Default)]
pub(crate) struct Drawn {
    pub(crate) split: Option<Split>,
    pub(crate) texture_coordinates: Option<Vec<[f32; 2]>>,
    pub(crate) normals: Option<Vec<[f32; 3]>>,
}

/// Makes drawn vertices from corners: those that agree in position index and in the values of their texture coordinate
/// and normal share one, numbered by first appearance. If no vertex needs two, there is no split. Corners without an
/// attribute that others have get zero texture coordinates and the normal +Y.
pub(crate) fn draw_corners(
    vertex_count: usize,
    triangles: &[[Corner; 3]],
    texture_coordinates: &[[f32; 2]],
    normals: &[[f32; 3]],
) -> Drawn {
    let corners = || triangles.iter().flatten();
    let has_texture = corners().any(|c| c.texture != NONE);
    let has_normals = corners().any(|c| c.normal != NONE);
    if !has_texture && !has_normals {
        return Drawn::default();
    }
    let texture_of = |c: &Corner| texture_coordinates.get(c.texture as usize).copied().unwrap_or_default();
    let normal_of = |c: &Corner| normals.get(c.normal as usize).copied().unwrap_or([0.0, 1.0, 0.0]);
    let mut numbers = HashMap::new();
    let mut firsts: Vec<Corner> = Vec::new();
    let drawn: Vec<u32> = corners()
        .map(|c| {
            let key = (c.vertex, texture_of(c).map(f32::to_bits), normal_of(c).map(f32::to_bits));
            *numbers.entry(key).or_insert_with(|| {
                firsts.push(*c);
                firsts.len() as u32 - 1
            })
        })
        .collect();

    let mut times_drawn = vec![0_u32; vertex_count];
    for c in &firsts {
        times_drawn[c.vertex as usize] += 1;
    }
    if times_drawn.iter().all(|&times| times <= 1) {
        let mut textures = vec![[0.0; 2]; vertex_count];
        let mut directions = vec![[0.0, 1.0, 0.0]; vertex_count];
        for c in &firsts {
            textures[c.vertex as usize] = texture_of(c);
            directions[c.vertex as usize] = normal_of(c);
        }
        return Drawn {
            split: None,
            texture_coordinates: has_texture.then_some(textures),
            normals: has_normals.then_some(directions),
        };
    }
    let split = Split {
        mesh_vertex: firsts.iter().map(|c| c.vertex).collect(),
        triangles: drawn.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    };
    Drawn {
        split: Some(split),
        texture_coordinates: has_texture.then(|| firsts.iter().map(texture_of).collect()),
        normals: has_normals.then(|| firsts.iter().map(normal_of).collect()),
    }
}

/// Joins vertices with equal keys: `(first vertex of every group, group of every vertex)`, groups in order of first
/// appearance.
pub(crate) fn weld<K: Hash + Eq>(keys: impl Iterator<Item = K>) -> (Vec<u32>, Vec<u32>) {
    let mut numbers = HashMap::new();
    let mut firsts = Vec::new();
    let groups = keys
        .enumerate()
        .map(|(vertex, key)| {
            *numbers.entry(key).or_insert_with(|| {
                firsts.push(vertex as u32);
                firsts.len() as u32 - 1
            })
        })
        .collect();
    (firsts, groups)
}

/// A position as a key: equal numbers have equal keys (including zero and minus zero).
pub(crate) fn position_key(position: [f64; 3]) -> [u64; 3] {
    position.map(|c| (c + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(vertex: u32, texture: u32) -> Corner {
        Corner { vertex, texture, normal: NONE }
    }

    #[test]
    fn a_seam_splits_only_its_own_vertices() {
        let textures = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.5]];
        let smooth = [[corner(0, 0), corner(1, 1), corner(2, 2)], [corner(2, 2), corner(1, 1), corner(3, 3)]];
        let drawn = draw_corners(5, &smooth, &textures, &[]);
        assert_eq!(drawn.split, None);
        assert_eq!(drawn.texture_coordinates.unwrap()[..4], textures);
        let seam = [[corner(0, 0), corner(1, 1), corner(2, 2)], [corner(2, 0), corner(1, 1), corner(3, 3)]];
        let drawn = draw_corners(5, &seam, &textures, &[]);
        let split = drawn.split.unwrap();
        assert_eq!(split.mesh_vertex, [0, 1, 2, 2, 3]);
        assert_eq!(split.triangles, [[0, 1, 2], [3, 1, 4]]);
        assert_eq!(drawn.texture_coordinates.unwrap()[3], textures[0]);
        assert_eq!(drawn.normals, None);
    }

    #[test]
    fn welding_keeps_the_order() {
        let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-0.0, 0.0, 1.0]];
        assert_eq!(weld(positions.into_iter().map(position_key)), (vec![0, 1], vec![0, 1, 0]));
    }
}
