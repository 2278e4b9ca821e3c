//! The picture of a slice through a volume, coloured by winding number.

mod colors;
mod cut;
mod draw;
mod field;
mod frame;
mod legend;

use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_render::Picture;

pub use cut::{Axis, CutCell, SlicePlane};
pub use draw::SliceError;

/// What is shown.
#[derive(Clone, Copy, Debug)]
pub enum SliceCells<'a> {
    /// A volume, cut by the plane.
    Tetrahedra(&'a TetrahedralMesh),
    /// A flat domain, shown as it is.
    Triangles(&'a TriangleMesh),
}

/// A slice through cells and, behind it, the winding number around a surface.
#[derive(Clone, Copy, Debug)]
pub struct Slice<'a> {
    /// What is cut.
    pub cells: SliceCells<'a>,
    /// The winding number of every cell.
    pub winding: &'a [f64],
    /// The surface that the cells were made from; its cut is drawn as a dark line, and its field faintly behind. `None`
    /// if it is flat: then its cut and its field are meaningless.
    pub surface: Option<(&'a TriangleMesh, &'a FastWindingNumber)>,
    /// Where it is cut.
    pub plane: SlicePlane,
    /// A line above the picture.
    pub title: &'a str,
}

/// Draws a slice, `size` pixels across and down.
pub fn draw_slice(slice: &Slice, size: [u32; 2]) -> Result<Picture, SliceError> {
    let count = match slice.cells {
        SliceCells::Tetrahedra(mesh) => mesh.tetrahedra.len(),
        SliceCells::Triangles(mesh) => mesh.triangles.len(),
    };
    if slice.winding.len() != count {
        return Err(SliceError::WindingLength { numbers: slice.winding.len(), cells: count });
    }
    let cells = match slice.cells {
        SliceCells::Tetrahedra(mesh) => cut::cut_tetrahedra(mesh, slice.winding, &slice.plane),
        SliceCells::Triangles(mesh) => cut::flat_triangles(mesh, slice.winding, &slice.plane),
    };
    let lines = slice.surface.map(|(mesh, _)| cut::cut_surface(mesh, &slice.plane)).unwrap_or_default();
    draw::draw(slice, &cells, &lines, size)
}

/// The box that a slice is fitted to, which does not move with the plane.
fn bounds(slice: &Slice) -> Option<([f64; 3], [f64; 3])> {
    let cells = match slice.cells {
        SliceCells::Tetrahedra(mesh) => mesh.bounds(),
        SliceCells::Triangles(mesh) => mesh.bounds(),
    };
    let surface = slice.surface.and_then(|(mesh, _)| mesh.bounds());
    let boxes = cells.into_iter().chain(surface);
    boxes.reduce(|(low, high), (l, h)| {
        (std::array::from_fn(|k| low[k].min(l[k])), std::array::from_fn(|k| high[k].max(h[k])))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of side 2 in five tetrahedra, its surface, and the field of the surface without its lid (+Y).
    fn cube() -> (TetrahedralMesh, TriangleMesh) {
        let vertices: Vec<[f64; 3]> =
            (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|bit| f64::from(2 * bit))).collect();
        let tetrahedra = vec![[0, 1, 2, 4], [3, 2, 1, 7], [5, 1, 4, 7], [6, 2, 7, 4], [1, 2, 4, 7]];
        let quads = [[0, 2, 3, 1], [0, 1, 5, 4], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        (TetrahedralMesh { vertices: vertices.clone(), tetrahedra }, TriangleMesh { vertices, triangles })
    }

    fn pixel(picture: &Picture, x: u32, y: u32) -> [u8; 3] {
        let at = 4 * (y * picture.width + x) as usize;
        [picture.rgba[at], picture.rgba[at + 1], picture.rgba[at + 2]]
    }

    #[test]
    fn inside_is_warm_and_the_open_side_fades() {
        let (volume, surface) = cube();
        let fast = FastWindingNumber::precompute(&surface).unwrap();
        let plane = SlicePlane { axis: Axis::Z, position: 0.9 };
        let slice = Slice {
            cells: SliceCells::Tetrahedra(&volume),
            winding: &[1.0; 5],
            surface: Some((&surface, &fast)),
            plane,
            title: "cube",
        };
        let picture = draw_slice(&slice, [640, 480]).unwrap();
        assert_eq!((picture.width, picture.height, picture.rgba.len()), (640, 480, 4 * 640 * 480));
        let warm = |[r, g, b]: [u8; 3]| i32::from(r) - i32::from(b) > 100 && r > g;
        let count = |share: fn([u8; 3]) -> bool| {
            (0..480).flat_map(|y| (0..500).map(move |x| (x, y))).filter(|&(x, y)| share(pixel(&picture, x, y))).count()
        };
        // The square of two by two units, fitted to the plot's height with its margins.
        let side = 480.0 * (960.0 - 72.0 - 84.0) / 960.0 / 1.14;
        let inside = count(|p| i32::from(p[0]) - i32::from(p[2]) > 100) as f64;
        assert!((inside / (side * side) - 1.0).abs() < 0.03, "{inside} pixels of {}", side * side);
        assert!(warm(pixel(&picture, 250, 260)), "{:?}", pixel(&picture, 250, 260));
        // Above the missing lid the field is between outside and inside; below the floor it is outside.
        let [above, below] = [pixel(&picture, 281, 45), pixel(&picture, 281, 432)];
        assert!(above[0] > above[2] + 4 && below[0].abs_diff(below[2]) < 9, "{above:?} {below:?}");
        // The same every time.
        assert!(draw_slice(&slice, [640, 480]).unwrap() == picture);
    }

    #[test]
    fn what_cannot_be_drawn_is_said() {
        fn slice<'a>(cells: SliceCells<'a>, winding: &'a [f64], plane: SlicePlane) -> Slice<'a> {
            Slice { cells, winding, surface: None, plane, title: "" }
        }
        let (volume, _) = cube();
        let plane = SlicePlane { axis: Axis::X, position: 0.5 };
        let empty = TetrahedralMesh::default();
        let of = SliceCells::Tetrahedra(&volume);
        let draw = |slice: Slice| draw_slice(&slice, [300, 300]);
        assert!(draw(slice(of, &[1.0; 5], plane)).is_ok());
        let error = draw(slice(of, &[1.0; 4], plane)).unwrap_err();
        assert_eq!(error, SliceError::WindingLength { numbers: 4, cells: 5 });
        assert_eq!(draw(slice(SliceCells::Tetrahedra(&empty), &[], plane)).unwrap_err(), SliceError::Empty);
        let nowhere = SlicePlane { position: f64::NAN, ..plane };
        assert_eq!(draw(slice(of, &[1.0; 5], nowhere)).unwrap_err(), SliceError::NotFinite);
        let error = draw_slice(&slice(of, &[1.0; 5], plane), [0, 9999]).unwrap_err();
        assert_eq!(error, SliceError::Size { width: 0, height: 9999 });
        // Far away and tiny, huge, or flat: still a picture.
        for (scale, offset) in [(1e-9, 1e3), (1e59, 0.0), (0.0, 1.0)] {
            let vertices = volume.vertices.iter().map(|p| p.map(|c| scale * c + offset)).collect();
            let other = TetrahedralMesh { vertices, tetrahedra: volume.tetrahedra.clone() };
            let plane = SlicePlane { axis: Axis::Y, position: scale * 0.7 + offset };
            let drawn = draw(slice(SliceCells::Tetrahedra(&other), &[1.0; 5], plane));
            assert!(drawn.is_ok() || drawn == Err(SliceError::NotFinite), "{scale}, {offset}");
        }
    }

    #[test]
    fn a_flat_domain_is_shown_whole() {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] };
        let plane = SlicePlane { axis: Axis::Z, position: 0.0 };
        let slice =
            Slice { cells: SliceCells::Triangles(&mesh), winding: &[1.0, 2.0], surface: None, plane, title: "flat" };
        let picture = draw_slice(&slice, [300, 300]).unwrap();
        // The upper left triangle is wound around twice.
        let [twice, once] = [pixel(&picture, 100, 100), pixel(&picture, 170, 190)];
        assert!(twice[1] < 0x60 && once[1] > 0x80, "{twice:?} {once:?}");
    }
}
