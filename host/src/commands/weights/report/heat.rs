//! The report on bone heat weights.

use armature_character::handle_weights::SpuriousExtrema;
use armature_weights::heat::BoneHeat;
use serde_json::json;

use super::words::{OUTERMOST, extrema_json, extrema_words};
use crate::cli::weight_args::WeightsArgs;
use crate::terminal::{Talk, aside, counted, out};

/// Bone heat weights.
pub(in crate::commands::weights) fn say_heat(
    args: &WeightsArgs,
    (made, spurious): (&BoneHeat, &SpuriousExtrema),
    names: &[String],
    talk: Talk,
    seconds: f64,
) {
    let cold: Vec<&str> = made.report.cold_bones.iter().map(|&bone| names[bone].as_str()).collect();
    if args.json {
        let value = json!({
            "file": args.output.display().to_string(),
            "method": "bone heat",
            "vertices": made.weights.vertices(),
            "handles": names.iter().map(|name| json!({"name": name})).collect::<Vec<_>>(),
            "residual": made.residual,
            "cold": cold,
            "spurious_extrema": extrema_json(spurious, names),
            "seconds": seconds,
        });
        out!("{value}");
        return;
    }
    if talk.quiet {
        return;
    }
    out!(
        "{}: {} of {} by bone heat, residual {:.1e}; {seconds:.2} s",
        args.output.display(),
        counted(made.weights.bones(), "handle", "handles"),
        counted(made.weights.vertices(), "vertex", "vertices"),
        made.residual,
    );
    out!("  {}", extrema_words(OUTERMOST, spurious));
    if !cold.is_empty() {
        aside!("note: these handles move no part of the mesh: {}", cold.join(", "));
    }
}
