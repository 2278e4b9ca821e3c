//! What `armature inspect` reports about a mesh: its faults, what is done about each, and the volume it encloses.

use std::path::Path;

use armature_character::bind::BindSettings;
use armature_fairing::holes::{Holes, find_holes};
use armature_formats::model::Model;
use armature_geometry::orientation::{OrientedPatches, PatchVerdict, flipped_components, orient_patches};
use armature_geometry::planar::plane_of;
use armature_geometry::surface::{Diagnosis, diagnose};
use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{MeshError, TriangleMesh};
use serde_json::{Value, json};

use super::Findings;
use super::recognised::recognised;
use crate::commands::bind::planned_words;
use crate::commands::surface::{hole_words, holes_json};
use crate::failure::Failure;
use crate::terminal::{counted, grouped};

/// Points at which the winding number is evaluated in each round, and the rounds: for a figure that fills a tenth of its
/// box the error is about a thousandth of the volume.
const SAMPLES: usize = 4000;
const ROUNDS: usize = 12;

pub(super) fn inspect_model(path: &Path, model: &Model) -> Result<Findings, Failure> {
    let unusable =
        |e: MeshError| Failure::input(format!("{}: {e}", path.display()), "repair the mesh and export it again");
    let look = Look::at(&model.mesh).map_err(unusable)?;
    let faults = faults(&look, model);
    let mut words = size_words(&look);
    words.extend(faults.iter().flat_map(Fault::words));
    words.extend(holes_words(&look.holes));
    words.push(format!("verdict: {}", verdict(&look)));
    if let Some(tetrahedra) = &model.tetrahedra {
        let inner = counted(look.diagnosis.isolated_vertices, "vertex", "vertices");
        words.push(format!("volume: {} tetrahedra, {inner} inside", grouped(tetrahedra.tetrahedra.len())));
    }
    words.extend(look_words(model));
    words.push(rig_words(model));
    if let Some(rig) = &model.rig {
        let names: Vec<&str> = rig.skeleton.bones().iter().map(|bone| bone.name.as_str()).collect();
        words.push(format!("bones: {}", names.join(", ")));
    }
    let recognised = model.rig.as_ref().map(|rig| recognised(&rig.skeleton));
    words.extend(recognised.iter().flat_map(|(words, _)| words.clone()));
    for (name, motion) in &model.motions {
        words.push(format!(
            "clip {name:?}: {}, {:.2} s",
            counted(motion.frames.len(), "frame", "frames"),
            motion.duration_seconds()
        ));
    }
    words.extend(model.warnings.iter().map(|w| format!("note: {w}")));
    let value = json!({
        "kind": "mesh", "flipped_components": look.flipped_components, "turned_triangles": look.oriented.turned.len(),
        "flat": look.flat, "diagnosis": diagnosis_json(&look.diagnosis),
        "volume": look.volume.map(|v| json!({
            "by_winding_number": v.volume, "standard_error": v.standard_error, "samples": SAMPLES * ROUNDS,
        })),
        "holes": holes_json(&look.holes)["holes"],
        "faults": faults.iter().map(Fault::to_json).collect::<Vec<_>>(), "verdict": verdict(&look),
        "tetrahedra": model.tetrahedra.as_ref().map(|t| t.tetrahedra.len()),
        "bones": model.rig.as_ref().map(|r| r.skeleton.len()), "recognised": recognised.map(|(_, value)| value),
        "clips": model.motions.iter().map(|(name, m)| json!({"name": name, "frames": m.frames.len()})).collect::<Vec<_>>(),
        "warnings": model.warnings,
    });
    Ok((words, value))
}

/// What was found.
struct Look {
    diagnosis: Diagnosis,
    flipped_components: usize,
    oriented: OrientedPatches,
    flat: bool,
    /// Of a mesh that is not flat.
    holes: Holes,
    /// `None` for a flat mesh.
    volume: Option<SampledVolume>,
}

impl Look {
    fn at(mesh: &TriangleMesh) -> Result<Self, MeshError> {
        let diagnosis = diagnose(mesh)?;
        let oriented = orient_patches(mesh)?;
        let flat = plane_of(mesh)?.is_some();
        let volume = if flat { None } else { Some(sampled_volume(&oriented.mesh, &diagnosis)?) };
        let flipped_components = flipped_components(mesh)?.flipped.len();
        let holes = if flat || diagnosis.boundary_edges == 0 { Holes::default() } else { find_holes(mesh)? };
        Ok(Self { diagnosis, flipped_components, oriented, flat, holes, volume })
    }

    fn one_sided(&self) -> usize {
        self.oriented.patches.iter().filter(|p| p.verdict == PatchVerdict::OneSided).count()
    }
}

/// The volume where the winding number is above a half.
#[derive(Clone, Copy, Debug)]
struct SampledVolume {
    volume: f64,
    standard_error: f64,
}

/// Asks at evenly spread points of the mesh's box. Each round is a part of one long sequence: how much the rounds differ
/// gives the error, somewhat too high.
fn sampled_volume(mesh: &TriangleMesh, d: &Diagnosis) -> Result<SampledVolume, MeshError> {
    // Steps of an additive recurrence with the plastic number fill a box evenly.
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];
    let winding = FastWindingNumber::precompute(mesh)?;
    let extent: [f64; 3] = std::array::from_fn(|k| d.high[k] - d.low[k]);
    let share = |round: usize| {
        let point = |i: usize| -> [f64; 3] {
            std::array::from_fn(|k| d.low[k] + (0.5 + STEPS[k] * i as f64).fract() * extent[k])
        };
        let points: Vec<[f64; 3]> = (round * SAMPLES..(round + 1) * SAMPLES).map(point).collect();
        winding.evaluate_many(&points).iter().filter(|&&w| w > 0.5).count() as f64 / SAMPLES as f64
    };
    let shares: Vec<f64> = (0..ROUNDS).map(share).collect();
    let rounds = ROUNDS as f64;
    let mean = shares.iter().sum::<f64>() / rounds;
    let variance = shares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (rounds - 1.0);
    let whole = extent[0] * extent[1] * extent[2];
    Ok(SampledVolume { volume: mean * whole, standard_error: (variance / rounds).sqrt() * whole })
}

/// One kind of fault, how many there are, and what `volume` does about it. `bind` computes its weights on a volume, so it
/// does the same.
struct Fault {
    key: &'static str,
    count: usize,
    name: [&'static str; 2],
    meaning: &'static str,
    remedy: &'static str,
}

impl Fault {
    fn words(&self) -> Vec<String> {
        let name = counted(self.count, self.name[0], self.name[1]);
        vec![format!("{name}: {}", self.meaning), format!("    → {}", self.remedy)]
    }

    fn to_json(&self) -> Value {
        json!({"fault": self.key, "count": self.count, "meaning": self.meaning, "remedy": self.remedy})
    }
}

/// The faults that are there.
fn faults(look: &Look, model: &Model) -> Vec<Fault> {
    let d = &look.diagnosis;
    let cutting = if d.self_intersections_complete {
        "pairs of triangles intersect"
    } else {
        "and more: the search stopped at its limit"
    };
    // The inner points of a volume belong to no triangle and are no fault.
    let isolated = if model.tetrahedra.is_some() { 0 } else { d.isolated_vertices };
    // A flat figure has a rim, and no volume is made of it.
    let (open, closed_by) = if look.flat {
        ("the rim of a flat figure", "taken as the outline")
    } else {
        ("the surface is open", "closed by the winding number: inside is where it is above a half")
    };
    let fault = |key, count, name, meaning, remedy| Fault { key, count, name, meaning, remedy };
    let all = [
        fault("boundary_edges", d.boundary_edges, ["boundary edge", "boundary edges"], open, closed_by),
        fault(
            "non_manifold_edges",
            d.non_manifold_edges,
            ["non-manifold edge", "non-manifold edges"],
            "more than two triangles meet there",
            "each patch that meets there keeps its own winding number",
        ),
        fault(
            "non_manifold_vertices",
            d.non_manifold_vertices,
            ["non-manifold vertex", "non-manifold vertices"],
            "separate fans of triangles touch at a point",
            "left as they are",
        ),
        fault(
            "turned_triangles",
            look.oriented.turned.len(),
            ["triangle is inside out", "triangles are inside out"],
            "they run clockwise seen from outside",
            "turned before anything else; the file is not changed",
        ),
        fault(
            "one_sided_patches",
            look.one_sided(),
            ["one-sided patch", "one-sided patches"],
            "going around it leads to the other side, as on a Möbius strip",
            "some of its edges stay inconsistent, and the winding number is uncertain there",
        ),
        fault(
            "self_intersections",
            d.self_intersections,
            ["self-intersection", "self-intersections"],
            cutting,
            "overlapping parts become one; some facets there cannot be kept",
        ),
        fault(
            "degenerate_triangles",
            d.degenerate_triangles,
            ["degenerate triangle", "degenerate triangles"],
            "without area",
            "ignored",
        ),
        fault(
            "duplicate_triangles",
            d.duplicate_triangles,
            ["duplicate triangle", "duplicate triangles"],
            "same three corners as another",
            "the second is ignored",
        ),
        fault(
            "duplicate_vertices",
            d.duplicate_vertices,
            ["duplicate vertex", "duplicate vertices"],
            "texture seams, or a soup of triangles",
            "merged while computing, kept for drawing",
        ),
        fault(
            "isolated_vertices",
            isolated,
            ["isolated vertex", "isolated vertices"],
            "in no triangle",
            "no part of the volume; their weights are those of the nearest place in it",
        ),
    ];
    all.into_iter().filter(|fault| fault.count > 0).collect()
}

/// The holes that `surface fill` and `bind --fill-holes` can close.
fn holes_words(holes: &Holes) -> Vec<String> {
    if holes.holes.is_empty() && holes.broken.is_empty() {
        return Vec::new();
    }
    let meant = holes.holes.iter().filter(|hole| hole.meant.is_some()).count();
    let open = if meant > 0 { format!(", of which {meant} may be meant") } else { String::new() };
    let mut words = vec![format!(
        "{}{open}: `armature surface fill` and `bind --fill-holes` close the others smoothly",
        counted(holes.holes.len(), "hole", "holes")
    )];
    words.extend(hole_words(holes).into_iter().map(|line| format!("    {line}")));
    words
}

fn size_words(look: &Look) -> Vec<String> {
    let d = &look.diagnosis;
    let size: Vec<String> = (0..3).map(|k| format!("{:.4}", d.high[k] - d.low[k])).collect();
    let counts = [
        counted(d.vertices, "vertex", "vertices"),
        counted(d.triangles, "triangle", "triangles"),
        counted(d.components, "component", "components"),
    ];
    let mut words = vec![counts.join(", "), format!("size {}, area {:.5}", size.join(" × "), d.area)];
    if let Some(SampledVolume { volume, standard_error }) = look.volume {
        words.push(format!("volume by winding number {volume:.5} ± {standard_error:.5} (sampled)"));
    }
    if d.closed && !look.flat {
        words.push(format!("signed volume {:.5} (overlaps count twice)", d.signed_volume));
    }
    if look.flipped_components > 0 {
        words.push(format!("{} of {} components are inside out as a whole", look.flipped_components, d.components));
    }
    words
}

/// One sentence for the whole.
fn verdict(look: &Look) -> String {
    let d = &look.diagnosis;
    if look.flat {
        return "a flat figure: bind and volume fill it with triangles".into();
    }
    if look.volume.is_some_and(|v| v.volume <= 0.0) {
        return "it encloses nothing: volume will refuse it, and bind needs --on surface".into();
    }
    let mut faults = Vec::new();
    for (is_there, word) in [
        (d.boundary_edges > 0, "open"),
        (d.non_manifold_edges + d.non_manifold_vertices > 0, "not a manifold"),
        (!look.oriented.turned.is_empty() && d.inconsistent_edges > 0, "not consistently oriented"),
        (d.self_intersections > 0, "self-intersecting"),
    ] {
        if is_there {
            faults.push(word);
        }
    }
    if !faults.is_empty() {
        let (last, first) = faults.split_last().unwrap_or((&"", &[]));
        let and = if first.is_empty() { String::new() } else { format!("{} and ", first.join(", ")) };
        format!("{and}{last}; bind and volume handle it as listed above")
    } else if d.closed && d.signed_volume < 0.0 {
        "closed, but inside out; bind and volume turn it".into()
    } else {
        "sound: closed, consistently oriented, no self-intersections".into()
    }
}

/// What it looks like and can express, where that is more than one mesh with one material.
fn look_words(model: &Model) -> Vec<String> {
    let mut words = Vec::new();
    if !model.parts.is_empty() {
        let parts = counted(model.parts.len(), "mesh part", "mesh parts");
        words.push(format!("{parts}, {}", counted(model.materials.len(), "material", "materials")));
    }
    let mut shapes: Vec<&str> = model.morph_targets.iter().map(|target| target.name.as_str()).collect();
    shapes.sort_unstable();
    shapes.dedup();
    if !shapes.is_empty() {
        words.push(format!("{}: {}", counted(shapes.len(), "blend shape", "blend shapes"), shapes.join(", ")));
    }
    if let Some(avatar) = &model.avatar {
        let expressions: Vec<&str> = avatar.expressions.iter().map(|expression| expression.name.as_str()).collect();
        words.push(format!(
            "VRM {}: {} of a person named, {} that swing",
            avatar.version,
            counted(avatar.humanoid.len(), "bone", "bones"),
            counted(avatar.springs.len(), "chain", "chains"),
        ));
        words.push(format!("expressions: {}", expressions.join(", ")));
    }
    words
}

fn rig_words(model: &Model) -> String {
    match &model.rig {
        Some(rig) => format!(
            "rig: {}, {} per vertex; bind keeps it unless --replace-rig is given",
            counted(rig.skeleton.len(), "bone", "bones"),
            counted(rig.influences.per_vertex(), "influence", "influences")
        ),
        None => format!(
            "no rig: bind needs --skeleton (TGF, BVH, FBX or glTF) and computes {}",
            planned_words(&BindSettings::default())
        ),
    }
}

fn diagnosis_json(d: &Diagnosis) -> Value {
    json!({
        "vertices": d.vertices, "triangles": d.triangles, "components": d.components,
        "duplicate_vertices": d.duplicate_vertices, "isolated_vertices": d.isolated_vertices,
        "degenerate_triangles": d.degenerate_triangles, "duplicate_triangles": d.duplicate_triangles,
        "boundary_edges": d.boundary_edges, "non_manifold_edges": d.non_manifold_edges,
        "inconsistent_edges": d.inconsistent_edges, "non_manifold_vertices": d.non_manifold_vertices,
        "self_intersections": d.self_intersections, "self_intersections_complete": d.self_intersections_complete,
        "euler_characteristic": d.euler_characteristic, "area": d.area, "signed_volume": d.signed_volume,
        "closed": d.closed, "low": d.low, "high": d.high,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box from the origin, with or without its lid.
    fn open_or_closed_box(size: [f64; 3], lid: bool) -> TriangleMesh {
        let vertices = (0..8_u32).map(|i| std::array::from_fn(|k| f64::from(i >> k & 1) * size[k])).collect();
        let quads = [[0, 2, 3, 1], [0, 1, 5, 4], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5], [2, 6, 7, 3]];
        let kept = quads.into_iter().take(if lid { 6 } else { 5 });
        TriangleMesh { vertices, triangles: kept.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect() }
    }

    fn model(mesh: TriangleMesh) -> Model {
        Model { mesh, ..Model::default() }
    }

    /// The keys of the faults and the verdict.
    fn told(mesh: TriangleMesh) -> (Vec<&'static str>, String) {
        let look = Look::at(&mesh).unwrap();
        let found = faults(&look, &model(mesh));
        (found.iter().map(|f| f.key).collect(), verdict(&look))
    }

    #[test]
    fn the_sampled_volume_is_right_within_its_error() {
        let mut ball = open_or_closed_box([1.0, 2.0, 3.0], true);
        // A second box far away, so that half of the box around both is empty.
        let count = ball.vertices.len() as u32;
        let other = open_or_closed_box([1.0, 2.0, 3.0], true);
        ball.vertices.extend(other.vertices.iter().map(|&[x, y, z]| [x + 2.0, y, z]));
        ball.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + count)));
        let look = Look::at(&ball).unwrap();
        let SampledVolume { volume, standard_error } = look.volume.unwrap();
        assert!((look.diagnosis.signed_volume - 12.0).abs() < 1e-12);
        assert!((volume - 12.0).abs() <= (5.0 * standard_error).max(0.01), "{volume} ± {standard_error}");
        assert!(standard_error < 0.02, "{standard_error}");
    }

    #[test]
    fn each_fault_is_reported_with_what_is_done_about_it() {
        let sound = open_or_closed_box([1.0; 3], true);
        assert_eq!(told(sound.clone()).0, [""; 0]);
        assert!(told(sound.clone()).1.starts_with("sound"));

        let mut turned = sound.clone();
        turned.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(
            told(turned.clone()),
            (vec!["turned_triangles"], "closed, but inside out; bind and volume turn it".into())
        );
        turned.triangles[..10].iter_mut().for_each(|t| t.swap(0, 1));
        let (keys, words) = told(turned.clone());
        assert_eq!(keys, ["turned_triangles"]);
        assert!(words.starts_with("not consistently oriented;"), "{words}");
        assert_eq!(Look::at(&turned).unwrap().oriented.turned, [10, 11]);

        let (keys, words) = told(open_or_closed_box([1.0; 3], false));
        assert_eq!(keys, ["boundary_edges"]);
        assert!(words.starts_with("open;"), "{words}");

        let mut messy = sound;
        messy.triangles.push(messy.triangles[0]);
        messy.triangles.push([0, 0, 5]);
        messy.vertices.push([0.5; 3]);
        let (keys, _) = told(messy);
        for key in ["duplicate_triangles", "degenerate_triangles", "isolated_vertices"] {
            assert!(keys.contains(&key), "{keys:?}");
        }
    }

    #[test]
    fn what_has_no_inside_is_said_to_have_none() {
        let mut sheet = open_or_closed_box([2.0, 1.0, 0.0], false);
        sheet.triangles.truncate(2);
        let (keys, words) = told(sheet.clone());
        assert!(keys.contains(&"boundary_edges") && words.starts_with("a flat figure"), "{keys:?} {words}");
        let look = Look::at(&sheet).unwrap();
        assert!(look.volume.is_none());
        // Bent, it is no longer flat and still holds nothing.
        sheet.vertices[3][2] = 0.1;
        assert!(told(sheet).1.starts_with("it encloses nothing"));
    }
}
