//! Pictures of weights on a mesh: of one handle with lines of equal weight, or of all handles in colours.

use std::path::Path;

use armature_geometry::TriangleMesh;
use armature_weights::WeightMatrix;

use super::function::{Dot, FunctionPicture, Shown, write_function_pictures};
use super::scene::DrawnBy;
use crate::failure::Failure;
use crate::files::Overwrite;

/// Weights to show.
#[derive(Clone, Copy, Debug)]
pub struct WeightPicture<'a> {
    /// The surface; vertices in no triangle do not matter.
    pub mesh: &'a TriangleMesh,
    /// Vertices × handles.
    pub weights: &'a WeightMatrix,
    /// The handles' names.
    pub names: &'a [String],
    /// The handle to show; `None` for all.
    pub of: Option<usize>,
    /// Extrema to mark.
    pub extrema: &'a [Dot],
}

/// Draws weights on their mesh and writes a PNG.
pub fn write_weight_picture(overwrite: Overwrite, path: &Path, picture: &WeightPicture) -> Result<DrawnBy, Failure> {
    let WeightPicture { mesh, weights, names, of, extrema } = *picture;
    let (values, colors);
    let (shown, title, legend) = if let Some(handle) = of {
        values = weights.bone(handle);
        (Shown::Values { values: &values, range: [0.0, 1.0] }, names[handle].as_str(), Vec::new())
    } else {
        colors = blended(weights);
        let swatch = |handle: usize| handle_color(handle).map(|c| (255.0 * c).round() as u8);
        let legend = names.iter().enumerate().map(|(handle, name)| (swatch(handle), name.clone())).collect();
        (Shown::Colors(&colors), "", legend)
    };
    write_function_pictures(overwrite, path, &[FunctionPicture { mesh, shown, title, legend: &legend, extrema }], 1)
}

/// The colour of a handle: hues by the golden ratio, so that neighbours differ, in three strengths.
fn handle_color(handle: usize) -> [f64; 3] {
    let hue = (0.04 + 0.618_033_988_749_895 * handle as f64).fract() * 6.0;
    let (strong, light) = [(0.72, 0.95), (0.5, 0.98), (0.85, 0.72)][handle % 3];
    // From hue, saturation and value.
    [5.0, 3.0, 1.0].map(|offset: f64| {
        let place = (offset + hue) % 6.0;
        light * (1.0 - strong * place.min(4.0 - place).clamp(0.0, 1.0))
    })
}

/// Every vertex in its handles' colours, mixed by weight.
fn blended(weights: &WeightMatrix) -> Vec<[f32; 3]> {
    let mut colors = vec![[0.0_f64; 3]; weights.vertices()];
    for handle in 0..weights.bones() {
        let own = handle_color(handle);
        for (vertex, weight) in weights.column(handle) {
            (0..3).for_each(|k| colors[vertex][k] += weight * own[k]);
        }
    }
    colors.iter().map(|color| color.map(|c| c.clamp(0.0, 1.0) as f32)).collect()
}

/// Finds a handle by name; `None` stands for `all`.
pub fn handle_of(name: &str, names: &[String]) -> Result<Option<usize>, Failure> {
    if let Some(handle) = names.iter().position(|other| other == name) {
        return Ok(Some(handle));
    }
    if name == "all" {
        return Ok(None);
    }
    let some: Vec<&str> = names.iter().take(8).map(String::as_str).collect();
    let dots = if names.len() > some.len() { ", …" } else { "" };
    Err(Failure::usage(format!("there is no {name:?}"), format!("choose all, {}{dots}", some.join(", "))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_have_colours_of_their_own_and_blend_by_weight() {
        for first in 0..24 {
            for second in 0..first {
                let apart =
                    (0..3).map(|k| (handle_color(first)[k] - handle_color(second)[k]).abs()).fold(0.0, f64::max);
                assert!(apart > 0.03, "{first} and {second} look alike");
            }
        }
        let weights = WeightMatrix::from_columns(2, 2, &[1.0, 0.5, 0.0, 0.5]).unwrap();
        let colors = blended(&weights);
        for k in 0..3 {
            assert!((f64::from(colors[0][k]) - handle_color(0)[k]).abs() < 1e-6);
            let mean = f64::midpoint(handle_color(0)[k], handle_color(1)[k]);
            assert!((f64::from(colors[1][k]) - mean).abs() < 1e-6);
        }
    }

    #[test]
    fn a_picture_is_of_one_or_of_all_and_nonsense_is_named() {
        let names = ["head".to_string(), "tail".to_string()];
        assert_eq!(handle_of("tail", &names).unwrap(), Some(1));
        assert_eq!(handle_of("all", &names).unwrap(), None);
        assert!(handle_of("wing", &names).unwrap_err().to_string().contains("choose all, head, tail"));
    }
}
