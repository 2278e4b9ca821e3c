//! Weights as a user computes them: files that other programs read, reports, pictures, errors that help.

use crate::common::{Place, TUBE_TGF, tube_obj};
use armature_character::handle_weights::DomainKind;
use armature_character::{Provenance, WeightsRecord};
use armature_formats::tables::{NumberTable, read_dmat, read_npy, write_npy};
use armature_test_support::shared;
use armature_weights::biharmonic::BiharmonicSettings;
use serde_json::Value;

/// The tube, its two bones, and a point at its upper end.
fn tube(name: &str) -> Place {
    let place = Place::new(name);
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place.write("point.tgf", TUBE_TGF.replacen("#\n", "4 0.1 1.9 0\n#\n", 1));
    place
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

#[test]
fn weights_are_written_for_other_programs_with_a_report_and_a_picture() {
    let place = tube("weights");
    let usual = ["weights", "tube.obj", "--handles", "point.tgf", "--vertices", "600"];
    let more = ["--output", "w.npy", "--json", "--picture", "w.png", "--picture-of", "bone_2"];
    let told = json(&place.done(&[&usual[..], &more].concat()).out);
    let names: Vec<&str> = told["handles"].as_array().unwrap().iter().map(|h| h["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["point_4", "bone_1", "bone_2"]);
    for handle in told["handles"].as_array().unwrap() {
        assert_eq!(handle["outcome"], "converged");
        assert!(handle["energy"].as_f64().unwrap() > 0.0 && handle["error_bound"].as_f64().unwrap() <= 2e-3);
        assert!(handle["largest_bound_violation"].as_f64().unwrap() <= 0.0);
    }
    assert_eq!((&told["domain"], &told["unconverged"]), (&"a volume".into(), &0.into()));
    assert!(place.read("w.png").starts_with(b"\x89PNG"));
    let table = read_npy(&place.read("w.npy")).unwrap();
    assert_eq!((table.rows, table.columns), (17 * 12 + 2, 3));
    for row in 0..table.rows {
        let all: Vec<f64> = (0..3).map(|column| table.values[column * table.rows + row]).collect();
        assert!(
            (all.iter().sum::<f64>() - 1.0).abs() < 1e-12 && all.iter().all(|w| (0.0..=1.0).contains(w)),
            "{all:?}"
        );
    }
    // The same as text, and told in words; other pictures.
    let words = place.done(&[&usual[..], &["-o", "w.dmat", "--picture", "all.png"]].concat());
    assert!(
        words.out.contains("bone_1") && words.out.contains("converged") && words.out.contains("all.png"),
        "{words:?}"
    );
    assert_eq!(read_dmat(&place.read("w.dmat")).unwrap(), table);
    // All handles together sum to one without being scaled.
    let exact = ["--method", "bbw-exact", "--json", "-o", "exact.npy"];
    let told = json(&place.done(&[&usual[..], &exact].concat()).out);
    assert_eq!((&told["together"]["outcome"], &told["normalised"]), (&"converged".into(), &false.into()));
    assert!(told["together"]["largest_sum_error"].as_f64().unwrap() < 1e-12);
    let exact = read_npy(&place.read("exact.npy")).unwrap();
    let apart = exact.values.iter().zip(&table.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart > 1e-4 && apart < 0.3, "{apart}");
    // Not normalised the sums are something else; on the surface alone, and by heat, so are the weights.
    for more in [&["--no-normalize"][..], &["--on", "surface"], &["--method", "heat"], &["--method", "bbw-certified"]] {
        let plain = ["weights", "tube.obj", "--handles", "point.tgf", "-o", "other.npy", "--force", "--quiet"];
        let volume: &[&str] = if more[0] == "--no-normalize" || more[1] == "bbw-certified" { &usual[4..] } else { &[] };
        assert_eq!(place.done(&[&plain[..], more, volume].concat()).out, "");
        let other = read_npy(&place.read("other.npy")).unwrap();
        assert!(other.rows == table.rows && other.columns == 3 && other != table, "{more:?}");
    }
}

#[test]
fn tetrahedra_that_come_with_a_mesh_are_used() {
    let place = tube("weights-own");
    place.done(&["volume", "tube.obj", "--skeleton", "bones.tgf", "--vertices", "500", "-o", "tube.mesh"]);
    let told = json(&place.done(&["weights", "tube.mesh", "--handles", "bones.tgf", "--json"]).out);
    assert_eq!(told["domain"], "its own tetrahedra");
    assert_eq!(told["domain_vertices"], told["vertices"]);
    let table = read_npy(&place.read("weights.npy")).unwrap();
    assert_eq!((Value::from(table.rows), table.columns), (told["vertices"].clone(), 2));
    // The same boundary values by number.
    let fixed: Vec<usize> =
        (0..table.rows).filter(|&r| table.values[r] >= 1.0 || table.values[table.rows + r] >= 1.0).collect();
    let given = [0, 1].map(|c| fixed.iter().map(|&r| table.values[c * table.rows + r]).collect::<Vec<f64>>()).concat();
    let rows = fixed.len();
    let indices = NumberTable { rows, columns: 1, values: fixed.iter().map(|&v| v as f64).collect() };
    place.write("b.npy", write_npy(&indices));
    place.write("bc.npy", write_npy(&NumberTable { rows, columns: 2, values: given.clone() }));
    let told =
        json(&place.done(&["weights", "tube.mesh", "--boundary", "b.npy", "bc.npy", "--json", "-o", "b.dmat"]).out);
    assert_eq!(told["handles"][1]["name"], "handle_2");
    assert_eq!(read_dmat(&place.read("b.dmat")).unwrap().columns, 2);
    // What does not fit is named.
    place.write("short.npy", write_npy(&NumberTable { rows: 1, columns: 2, values: vec![1.0, 0.0] }));
    place.write("far.npy", write_npy(&NumberTable { rows, columns: 1, values: vec![1e6; rows] }));
    place.write("high.npy", write_npy(&NumberTable { rows, columns: 2, values: vec![1.5; 2 * rows] }));
    let fails = |code, culprit: &str, b: &str, bc: &str| {
        place.fails(code, culprit, &["weights", "tube.mesh", "--boundary", b, bc, "-o", "never.npy"]);
    };
    fails(3, "short.npy", "b.npy", "short.npy");
    fails(3, "far.npy", "far.npy", "bc.npy");
    fails(3, "between 0 and 1", "b.npy", "high.npy");
    fails(3, "bones.tgf", "bones.tgf", "bc.npy");
    fails(3, "none.npy", "none.npy", "bc.npy");
    assert!(!place.path("never.npy").exists());
}

#[test]
fn what_cannot_be_done_is_said_with_its_code() {
    let place = tube("weights-bad");
    place.write("far.tgf", "1 900 0.05 0\n2 900 1 0\n#\n1 2\n");
    place.write("same.tgf", "1 0 0.05 0\n2 0 1 0\n3 0 0.05 0\n4 0 1 0\n5 0 1.5 0\n#\n1 2\n3 4\n2 5\n");
    place.write("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n");
    place.fails(2, "--handles", &["weights", "tube.obj"]);
    place.fails(2, "out.txt", &["weights", "tube.obj", "--handles", "bones.tgf", "-o", "out.txt"]);
    place.fails(
        2,
        "wing",
        &["weights", "tube.obj", "--handles", "bones.tgf", "--picture", "p.png", "--picture-of", "wing"],
    );
    place.fails(2, "tube.obj", &["weights", "tube.obj", "--handles", "tube.obj"]);
    place.fails(3, "none.tgf", &["weights", "tube.obj", "--handles", "none.tgf"]);
    place.fails(3, "none.obj", &["weights", "none.obj", "--handles", "bones.tgf"]);
    let odd = ["--vertices", "600", "-o", "odd.npy", "--force"];
    let same = place.done(&[&["weights", "tube.obj", "--handles", "same.tgf"][..], &odd].concat());
    assert!(same.err.contains("are at the same place and share its weights equally: bone_1, bone_2"), "{same:?}");
    let far = place.run(&[&["weights", "tube.obj", "--handles", "far.tgf"][..], &odd].concat());
    assert!(far.code == 3 || far.err.contains("outside the shape"), "{far:?}");
    // Bones in another unit, as `bind` says it.
    place.write("cm.tgf", "1 0 5 0\n2 0 100 0\n3 0 195 0\n#\n1 2\n2 3\n");
    for method in ["bbw", "heat"] {
        let cm = ["weights", "tube.obj", "--handles", "cm.tgf", "--method", method, "-o", "never.npy"];
        let misfit = place.fails(3, "cm.tgf does not fit the mesh", &cm);
        assert!(misfit.err.contains("times as large; scale one of them") && !place.path("never.npy").exists());
    }
    // A sheet that is flat is a flat figure.
    place.write("edge.tgf", "1 0.1 0.1 0\n2 0.4 0.3 0\n#\n1 2\n");
    let flat = json(&place.done(&["weights", "sheet.obj", "--handles", "edge.tgf", "--json", "-o", "flat.npy"]).out);
    assert_eq!(flat["vertices"], 4);
}

#[test]
fn the_reference_for_the_hand_is_reproduced() {
    let Some(hand) = shared("hand.mesh") else { return };
    let reference = |name: &str| hand.with_file_name("../reference").join(name);
    let place = Place::new("weights-hand");
    let [b, bc] = ["hand-bbw-b.npy", "hand-bbw-bc.npy"].map(|name| reference(name).to_str().unwrap().to_owned());
    let usual = ["weights", hand.to_str().unwrap(), "--boundary", &b, &bc, "--no-normalize", "--json", "-o", "w.npy"];
    let told = json(&place.done(&usual).out);
    let bound = told["error_bound"].as_f64().unwrap();
    assert!(bound <= 2e-3 && told["warnings"][0].as_str().unwrap().contains("slivers"), "{told}");
    let [made, expected] = [place.read("w.npy"), std::fs::read(reference("hand-bbw-w.npy")).unwrap()];
    let [made, expected] = [made, expected].map(|bytes| read_npy(&bytes).unwrap());
    assert_eq!((made.rows, made.columns), (expected.rows, expected.columns));
    let apart = made.values.iter().zip(&expected.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // The certificate says the truth; the reference itself is good to about 4e-5.
    assert!(apart <= bound + 1e-4, "{apart} with a bound of {bound}");
}

#[test]
fn bones_that_hold_to_their_ends_have_libigls_boundary_conditions() {
    let (Some(mesh), Some(bones)) = (shared("hand.mesh"), shared("hand.tgf")) else { return };
    let [b, bc] = ["hand-bbw-b.npy", "hand-bbw-bc.npy"].map(|name| mesh.with_file_name("../reference").join(name));
    let place = Place::new("weights-release");
    let [mesh, bones, given, values] = [&mesh, &bones, &b, &bc].map(|file| file.to_str().unwrap());
    let usual = ["weights", mesh, "--no-normalize", "--json", "-o", "w.npy", "--force"];
    let weights = |more: &[&str]| {
        let told = json(&place.done(&[&usual[..], more].concat()).out);
        (told["problem"].clone(), read_npy(&place.read("w.npy")).unwrap())
    };
    let (problem, held) = weights(&["--handles", bones, "--joint-release", "0"]);
    assert_eq!(
        problem,
        serde_json::json!({"joint_release": 0.0, "flat_elements_left_out": 0, "masses": "barycentric"})
    );
    let [fixed, expected] = [&b, &bc].map(|file| read_npy(&std::fs::read(file).unwrap()).unwrap());
    // Bones 14 and 15 meet at this vertex and share it, as all bones that meet do. libigl's rounding takes it to lie
    // beyond the end of one of them.
    let (missed, sharing) = (4799, [13, 14]);
    for (row, vertex) in fixed.indices().unwrap().into_iter().enumerate() {
        for handle in 0..expected.columns {
            let [made, wanted] = [&held, &expected].map(|t| t.values.chunks(t.rows).nth(handle).unwrap());
            let wanted = if vertex == missed && sharing.contains(&handle) { 0.5 } else { wanted[row] };
            assert!((made[vertex] - wanted).abs() < 1e-15, "vertex {vertex}, handle {handle}");
        }
    }
    // Nothing else is fixed: the same weights come of libigl's boundary itself.
    let (problem, fixed) = weights(&["--boundary", given, values]);
    assert_eq!(problem["joint_release"], Value::Null);
    // One problem, its fixed vertices in another order: each solution is this near to the optimum.
    let both = 2.0 * BiharmonicSettings::interactive().error_bound;
    for handle in (0..expected.columns).filter(|handle| !sharing.contains(handle)) {
        let [ours, given] = [&held, &fixed].map(|t| t.values.chunks(t.rows).nth(handle).unwrap());
        let apart = ours.iter().zip(given).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart <= both, "handle {handle}: {apart:e}");
    }
    // Without the option bones let go near their joints, and say so.
    let (problem, released) = weights(&["--handles", bones]);
    assert!(problem["joint_release"] == 0.25 && released != held, "{problem}");
    // Nonsense, and where it has no meaning.
    let with = |more: &[&'static str]| [&["weights", mesh, "--handles", bones][..], more].concat();
    place.fails(2, "0.5", &with(&["--joint-release", "0.6"]));
    place.fails(2, "--joint-release", &with(&["--joint-release", "0", "--method", "heat"]));
    let boundary = ["weights", mesh, "--boundary", given, values, "--joint-release", "0"];
    place.fails(2, "--joint-release", &boundary);
}

#[test]
fn the_elephant_is_bound() {
    let (Some(mesh), Some(bones)) = (shared("elephant.obj"), shared("elephant.tgf")) else { return };
    let place = Place::new("bind-elephant");
    let usual = ["bind", mesh.to_str().unwrap(), "-s", bones.to_str().unwrap(), "--vertices", "2500"];
    let ran =
        place.done(&[&usual[..], &["-o", "elephant.armature", "--picture", "e.png", "--picture-of", "all"]].concat());
    assert!(ran.out.contains("bounded biharmonic weights on a volume"), "{ran:?}");
    assert!(ran.out.contains("bones are released over 0.25 of their length at shared joints"), "{ran:?}");
    assert!(place.read("e.png").starts_with(b"\x89PNG"));
    let elephant = armature_character::cache::from_bytes(&place.read("elephant.armature")).unwrap();
    let Provenance::Computed(WeightsRecord::Biharmonic(record)) = elephant.provenance else { panic!("not so") };
    assert!(record.domain == DomainKind::Volume && record.unconverged == 0 && record.error_bound <= 2e-3, "{record:?}");
    // Its arms stretch out to both sides and follow arm bones alone.
    for (vertex, p) in
        elephant.surface.mesh.vertices.iter().enumerate().filter(|(_, p)| p[0].abs() > 30.0 && p[1] < 60.0)
    {
        let arm = if p[0] > 0.0 { 7..=10 } else { 11..=14 };
        let own: f32 = elephant
            .surface
            .influences
            .of_vertex(vertex)
            .filter(|(bone, _)| {
                let name = &elephant.skeleton.bones()[usize::from(*bone)].name;
                arm.clone().any(|k| *name == format!("bone_{k}"))
            })
            .map(|(_, weight)| weight)
            .sum();
        assert!(own > 0.9, "{p:?} follows its arm by {own}");
    }
}

/// The tube's tetrahedra, squashed to this part of their breadth.
fn squashed(place: &Place, share: f64) -> String {
    place.done(&["volume", "tube.obj", "--skeleton", "bones.tgf", "--vertices", "300", "-o", "tube.mesh"]);
    let text = String::from_utf8(place.read("tube.mesh")).unwrap();
    let mut left = 0;
    let line = |line: &str| -> String {
        let mut words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        if left > 0 && words.len() == 4 {
            left -= 1;
            words[0] = (words[0].parse::<f64>().unwrap() * share).to_string();
        }
        if line.trim() == "Vertices" {
            left = usize::MAX;
        } else if left == usize::MAX {
            left = words[0].parse().unwrap();
        }
        words.join(" ")
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn weights_that_do_not_converge_have_their_code_and_are_written_as_they_are() {
    let place = tube("weights-slivers");
    place.write("slivers.mesh", squashed(&place, 1e-3));
    let exact = ["weights", "slivers.mesh", "--handles", "bones.tgf", "--method", "bbw-exact", "-o", "w.npy"];
    let ran = place.fails(5, "all handles solved together did not converge", &exact);
    assert!(ran.out.contains("limit reached"), "{ran:?}");
    let table = read_npy(&place.read("w.npy")).unwrap();
    assert!(table.columns == 2 && table.values.iter().all(|w| (0.0..=1.0).contains(w)));
}

#[test]
fn cages_are_read_from_their_edges() {
    let place = tube("weights-cages");
    let cage = "1 0 0.1 0\n2 0 0.9 0\n3 0 1.4 0\n4 0 1.9 0\n#\n1 2 0 0 1\n3 4 1 0 0\n1 2 0 1 0\n";
    place.write("cage.tgf", cage);
    place.write("faces.tgf", format!("{cage}#\n1 2 3\n"));
    place.write("joint.tgf", cage.replacen("1 2 0 0 1", "1 3 0 0 1", 1));
    place.write("loop.tgf", cage.replacen("1 2 0 0 1", "1 1 0 0 1", 1));
    let with = |handles| ["weights", "tube.obj", "--vertices", "600", "--handles", handles];
    let told = json(&place.done(&[&with("cage.tgf")[..], &["--json", "-o", "w.npy"]].concat()).out);
    let names: Vec<&str> = told["handles"].as_array().unwrap().iter().map(|h| h["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["point_1", "point_2", "bone_1"]);
    let apart = |path: &str| {
        let [a, b] = ["w.npy", path].map(|file| read_npy(&place.read(file)).unwrap().values);
        a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    place.write("points.tgf", cage.replacen("1 2 0 0 1", "", 1));
    place.done(&[&with("points.tgf")[..], &["-o", "points.npy"]].concat());
    assert!(apart("points.npy") > 0.02, "an edge changes the weights");
    let ran = place.done(&[&with("faces.tgf")[..], &["-o", "faces.npy"]].concat());
    assert!(ran.err.contains("everything after its second # is ignored") && apart("faces.npy") < 1e-12, "{ran:?}");
    place.fails(3, "node 3 belongs to a bone and to a cage", &with("joint.tgf"));
    place.fails(3, "edge 1 of the cage does not join two", &with("loop.tgf"));
    place.fails(2, "no cages", &[&with("cage.tgf")[..], &["--method", "heat"]].concat());
}

/// A bone that the mesh does not reach, as of a weapon, is named, weighs nothing, and disturbs no other bone.
#[test]
fn a_bone_away_from_the_mesh_is_named_and_weighs_nothing() {
    let place = Place::new("weights-away");
    let file = |name: &str| Some(shared(name)?.display().to_string());
    let meshes = [
        ("cow_horn", "cow.off", None),
        ("ball_weapon", "cases/device/cube.off", Some("bone_4")),
        ("cube_bone_above", "cases/device/cube.off", Some("bone_3")),
        ("far_point", "cases/device/cube.off", None),
    ];
    for (name, mesh, away) in &meshes {
        let (Some(mesh), Some(handles)) = (file(mesh), file(&format!("cases/tgf/{name}.tgf"))) else { return };
        let output = format!("{name}.npy");
        let told = place.done(&["weights", &mesh, "--handles", &handles, "--vertices", "600", "--json", "-o", &output]);
        println!("{name}: {}", json(&told.out)["warnings"]);
        let table = read_npy(&place.read(&output)).unwrap();
        assert!(table.values.iter().all(|w| (0.0..=1.0 + 1e-12).contains(w)), "{name}");
        if let Some(away) = away {
            let report = json(&told.out);
            let warned = report["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains(away));
            assert!(warned, "{name}: {}", report["warnings"]);
            let column = report["handles"].as_array().unwrap().iter().position(|h| h["name"] == *away).unwrap();
            assert!(table.values[column * table.rows..][..table.rows].iter().all(|w| *w <= 1e-4), "{name}");
        }
    }
}
