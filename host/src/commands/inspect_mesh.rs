//! What `armature inspect` says about a mesh: its faults, the volume it encloses, and what will be done about each.

use std::path::Path;

use armature_formats::Model;
use armature_geometry::{
    Diagnosis, FastWindingNumber, MeshError, OrientedPatches, PatchVerdict, TriangleMesh, diagnose, flipped_components,
    orient_patches, plane_of,
};
use serde_json::{Value, json};

use super::inspect::Findings;
use crate::failure::Failure;
use crate::inputs;
use crate::words::{counted, grouped};

/// Points at which the winding number is asked in each round, and the rounds: for a figure that fills a tenth of its box
/// the error is about a thousandth of the volume.
const SAMPLES: usize = 4000;
const ROUNDS: usize = 12;

pub(super) fn inspect_model(path: &Path) -> Result<Findings, Failure> {
    let model = inputs::model(path)?;
    let unusable =
        |e: MeshError| Failure::input(format!("{}: {e}", path.display()), "repair the mesh and export it again");
    let look = Look::at(&model.mesh).map_err(unusable)?;
    let faults = faults(&look, &model);
    let mut words = size_words(&look);
    words.extend(faults.iter().flat_map(|fault| fault.words(&model)));
    words.push(format!("verdict: {}", verdict(&look)));
    if let Some(tetrahedra) = &model.tetrahedra {
        let inner = counted(look.diagnosis.isolated_vertices, "vertex", "vertices");
        words.push(format!("brings a volume: {} tetrahedra, {inner} inside", grouped(tetrahedra.tetrahedra.len())));
    }
    words.push(rig_words(&model));
    for (name, motion) in &model.motions {
        words.push(format!("clip {name:?}: {} frames, {:.2} s", motion.frames.len(), motion.duration_seconds()));
    }
    words.extend(model.warnings.iter().map(|w| format!("note: {w}")));
    let value = json!({
        "kind": "mesh", "flipped_components": look.flipped_components, "turned_triangles": look.oriented.turned.len(),
        "flat": look.flat, "diagnosis": diagnosis_json(&look.diagnosis),
        "volume": look.volume.map(|v| json!({
            "by_winding_number": v.volume, "standard_error": v.standard_error, "samples": SAMPLES * ROUNDS,
        })),
        "faults": faults.iter().map(Fault::to_json).collect::<Vec<_>>(), "verdict": verdict(&look),
        "tetrahedra": model.tetrahedra.as_ref().map(|t| t.tetrahedra.len()),
        "bones": model.rig.as_ref().map(|r| r.skeleton.len()),
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
        Ok(Self { diagnosis, flipped_components, oriented, flat, volume })
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
/// tells the error, somewhat too high.
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

/// One kind of fault, how often it is there, and what the commands do about it.
struct Fault {
    key: &'static str,
    count: usize,
    name: [&'static str; 2],
    meaning: &'static str,
    bind: &'static str,
    volume: &'static str,
}

impl Fault {
    fn words(&self, model: &Model) -> Vec<String> {
        let mut words = vec![format!("{}: {}", counted(self.count, self.name[0], self.name[1]), self.meaning)];
        if model.rig.is_none() {
            words.push(format!("    bind    {}", self.bind));
        }
        words.push(format!("    volume  {}", self.volume));
        words
    }

    fn to_json(&self) -> Value {
        json!({
            "fault": self.key, "count": self.count, "meaning": self.meaning, "bind": self.bind, "volume": self.volume,
        })
    }
}

/// The faults that are there. What `bind` does is what bone heat does, on the surface.
fn faults(look: &Look, model: &Model) -> Vec<Fault> {
    let d = &look.diagnosis;
    let cutting = if d.self_intersections_complete {
        "pairs of triangles cut each other"
    } else {
        "and more: the search was given up"
    };
    // The inner points of a volume belong to no triangle and are no fault.
    let isolated = if model.tetrahedra.is_some() { 0 } else { d.isolated_vertices };
    // A flat figure has a rim, and no volume is made of it.
    let (open, closed_by) = if look.flat {
        ("the rim of a flat figure", "takes it as the outline")
    } else {
        ("the surface is open", "closed by the winding number: inside is where it is above a half")
    };
    let fault = |key, count, name, meaning, bind, volume| Fault { key, count, name, meaning, bind, volume };
    let all = [
        fault(
            "boundary_edges",
            d.boundary_edges,
            ["boundary edge", "boundary edges"],
            open,
            "heat flows along the surface and around holes; nothing is closed",
            closed_by,
        ),
        fault(
            "non_manifold_edges",
            d.non_manifold_edges,
            ["non-manifold edge", "non-manifold edges"],
            "more than two triangles meet there",
            "heat flows through all of them",
            "each patch that meets there counts with its own winding number",
        ),
        fault(
            "non_manifold_vertices",
            d.non_manifold_vertices,
            ["non-manifold vertex", "non-manifold vertices"],
            "separate fans of triangles touch in a point",
            "heat flows through the point",
            "stays as it is",
        ),
        fault(
            "turned_triangles",
            look.oriented.turned.len(),
            ["triangle is inside out", "triangles are inside out"],
            "they run clockwise seen from outside",
            "a piece that is inside out as a whole is recognised; where sides disagree, bones are looked for on both",
            "turned round before anything else; the file is not changed",
        ),
        fault(
            "one_sided_patches",
            look.one_sided(),
            ["one-sided patch", "one-sided patches"],
            "going round it leads to the other side, as on a Möbius strip",
            "bones are looked for on both sides",
            "some of its edges stay inconsistent, and the winding number is vague there",
        ),
        fault(
            "self_intersections",
            d.self_intersections,
            ["self-intersection", "self-intersections"],
            cutting,
            "a wall hides the bones behind it, also where it cuts through a limb",
            "where parts overlap they become one; not every facet there can be kept",
        ),
        fault(
            "degenerate_triangles",
            d.degenerate_triangles,
            ["degenerate triangle", "degenerate triangles"],
            "without area",
            "left out where two corners are one place, else taken as very thin",
            "left out",
        ),
        fault(
            "duplicate_triangles",
            d.duplicate_triangles,
            ["duplicate triangle", "duplicate triangles"],
            "on the same three places as another",
            "the second is left out",
            "the second is left out",
        ),
        fault(
            "duplicate_vertices",
            d.duplicate_vertices,
            ["duplicate vertex", "duplicate vertices"],
            "seams of textures, or a soup of triangles",
            "joined for the weights, kept for drawing",
            "joined",
        ),
        fault(
            "isolated_vertices",
            isolated,
            ["isolated vertex", "isolated vertices"],
            "in no triangle",
            "left out",
            "left out",
        ),
    ];
    all.into_iter().filter(|fault| fault.count > 0).collect()
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
        words.push(format!("signed volume {:.5} (what overlaps counts twice)", d.signed_volume));
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
        return "a flat figure: bind works on it, and volume makes a flat domain of triangles".into();
    }
    if look.volume.is_some_and(|v| v.volume <= 0.0) {
        return "it encloses nothing that the winding number could tell: bind works on its surface, volume will refuse it"
            .into();
    }
    let mut faults = Vec::new();
    for (is_there, word) in [
        (d.boundary_edges > 0, "open"),
        (d.non_manifold_edges + d.non_manifold_vertices > 0, "not a manifold"),
        (!look.oriented.turned.is_empty() && d.inconsistent_edges > 0, "not consistently oriented"),
        (d.self_intersections > 0, "cut by itself"),
    ] {
        if is_there {
            faults.push(word);
        }
    }
    if !faults.is_empty() {
        let (last, first) = faults.split_last().unwrap_or((&"", &[]));
        let and = if first.is_empty() { String::new() } else { format!("{} and ", first.join(", ")) };
        format!("{and}{last}; bind and volume work on it all the same, as said above")
    } else if d.closed && d.signed_volume < 0.0 {
        "closed, but inside out; bind and volume recognise that".into()
    } else {
        "sound: closed, consistently oriented, nothing cuts itself".into()
    }
}

fn rig_words(model: &Model) -> String {
    match &model.rig {
        Some(rig) => format!(
            "brings a rig: {} bones, {} influences a vertex; bind keeps it unless told --replace-rig",
            rig.skeleton.len(),
            rig.influences.per_vertex()
        ),
        None => "brings no rig: bind needs --skeleton (TGF, BVH or glTF) and computes bone heat weights on the surface"
            .into(),
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
    fn each_fault_is_told_with_what_is_done_about_it() {
        let sound = open_or_closed_box([1.0; 3], true);
        assert_eq!(told(sound.clone()).0, [""; 0]);
        assert!(told(sound.clone()).1.starts_with("sound"));

        let mut turned = sound.clone();
        turned.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(
            told(turned.clone()),
            (vec!["turned_triangles"], "closed, but inside out; bind and volume recognise that".into())
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
