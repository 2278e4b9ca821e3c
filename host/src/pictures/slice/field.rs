//! The winding number of a surface at the pixels of a slice.

use armature_geometry::winding::FastWindingNumber;

/// Side of the squares whose corners are evaluated first.
const SQUARE: usize = 8;
/// If the corners of a square differ by no more than this, the values between them are interpolated: the field is
/// smooth away from the surface and jumps by one at it.
const SMOOTH: f64 = 0.08;

/// The winding number at every pixel centre for which `needed` holds, rows from the top; undefined elsewhere.
/// `place_of(column, row)` is the point in space of a (possibly fractional) pixel position.
pub(super) fn field(
    winding: &FastWindingNumber,
    size: [usize; 2],
    needed: &[bool],
    place_of: impl Fn(f64, f64) -> [f64; 3],
) -> Vec<f32> {
    let [width, height] = size;
    let squares = [width.div_ceil(SQUARE), height.div_ceil(SQUARE)];
    let across = squares[0] + 1;
    let nodes = (0..across * (squares[1] + 1))
        .map(|i| place_of((i % across * SQUARE) as f64 + 0.5, (i / across * SQUARE) as f64 + 0.5));
    let at_nodes = winding.evaluate_many(&nodes.collect::<Vec<_>>());
    let mut values = vec![0.0_f32; width * height];
    let mut left = Vec::new();
    for (row, column) in (0..squares[1]).flat_map(|row| (0..squares[0]).map(move |column| (row, column))) {
        let node = |down: usize, right: usize| at_nodes[(row + down) * across + column + right];
        let corners = [node(0, 0), node(0, 1), node(1, 0), node(1, 1)];
        let (low, high) = corners.iter().fold((f64::MAX, f64::MIN), |(l, h), &c| (l.min(c), h.max(c)));
        for (y, x) in (0..SQUARE).flat_map(|y| (0..SQUARE).map(move |x| (y, x))) {
            let (py, px) = (row * SQUARE + y, column * SQUARE + x);
            if py >= height || px >= width || !needed[py * width + px] {
                continue;
            }
            if high - low <= SMOOTH {
                let (u, v) = (x as f64 / SQUARE as f64, y as f64 / SQUARE as f64);
                let upper = corners[0] + u * (corners[1] - corners[0]);
                let lower = corners[2] + u * (corners[3] - corners[2]);
                values[py * width + px] = (upper + v * (lower - upper)) as f32;
            } else {
                left.push(py * width + px);
            }
        }
    }
    let places: Vec<[f64; 3]> =
        left.iter().map(|&i| place_of((i % width) as f64 + 0.5, (i / width) as f64 + 0.5)).collect();
    for (index, value) in left.into_iter().zip(winding.evaluate_many(&places)) {
        values[index] = value as f32;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use armature_geometry::TriangleMesh;

    /// Interpolated values agree with computed ones.
    #[test]
    fn skipped_pixels_are_as_good_as_computed_ones() {
        // An open box: the lid is missing.
        let vertices = (0..8).map(|i| [f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
        let quads = [[0, 2, 3, 1], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let winding = FastWindingNumber::precompute(&TriangleMesh { vertices, triangles }).unwrap();
        let size = [120, 90];
        let place = |x: f64, y: f64| [x / 60.0 - 0.5, 0.5, 1.5 - y / 60.0];
        let values = field(&winding, size, &vec![true; size[0] * size[1]], place);
        for (i, &value) in values.iter().enumerate() {
            let exact = winding.evaluate(place((i % size[0]) as f64 + 0.5, (i / size[0]) as f64 + 0.5));
            assert!((f64::from(value) - exact).abs() < 0.02, "pixel {i}: {value}, not {exact}");
        }
        assert!(values.iter().any(|&v| v > 0.9) && values.iter().any(|&v| v < 0.1));
    }
}
