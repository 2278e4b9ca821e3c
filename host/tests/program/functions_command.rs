//! Functions with controlled extrema as a user makes them: monotone weights, smoothed data, spread colours.

use std::fmt::Write as _;

use crate::common::{Place, TUBE_TGF, tube_obj};
use armature_character::{Provenance, WeightsRecord};
use armature_formats::tables::{NumberTable, read_npy, write_npy};
use armature_geometry::TriangleMesh;
use armature_test_support::shared;
use armature_weights::FunctionDomain;
use armature_weights::extrema::local_extrema;
use serde_json::Value;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

/// A bar with a long rod across it, flat, in squares of a tenth.
fn propeller() -> TriangleMesh {
    let inside = |x: u32, y: u32| (20..30).contains(&y) || (29..33).contains(&x);
    let mut mesh = TriangleMesh::default();
    let mut number = std::collections::BTreeMap::new();
    for (x, y) in (0..50).flat_map(|y| (0..40).map(move |x| (x, y))).filter(|&(x, y)| inside(x, y)) {
        let mut at = |x: u32, y: u32| {
            *number.entry((x, y)).or_insert_with(|| {
                mesh.vertices.push([0.1 * f64::from(x), 0.1 * f64::from(y), 0.0]);
                mesh.vertices.len() as u32 - 1
            })
        };
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        mesh.triangles.extend(if (x + y) % 2 == 0 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
    }
    mesh
}

fn obj(mesh: &TriangleMesh) -> String {
    let mut text = String::new();
    mesh.vertices.iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
    mesh.triangles.iter().for_each(|t| writeln!(text, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1).unwrap());
    text
}

#[test]
fn extrema_of_weights_are_counted_and_monotone_ones_have_none() {
    let place = Place::new("functions-weights");
    place.write("propeller.obj", obj(&propeller()));
    place.write("points.tgf", "1 0.3 2.5 0\n2 1.7 2.5 0\n3 3.7 2.5 0\n#\n");
    let usual = ["weights", "propeller.obj", "--handles", "points.tgf", "--on", "surface", "--force", "--json"];
    let told = |more: &[&str]| json(&place.done(&[&usual[..], more].concat()).out)["spurious_extrema"].clone();
    let bounded = told(&["--method", "bbw-certified", "--picture", "bounded.png", "--picture-of", "point_1"]);
    let count = |told: &Value, when: &str| told[when]["count"].as_u64().unwrap();
    assert!(count(&bounded, "computed") > 0 && bounded["computed"]["largest_persistence"].as_f64().unwrap() > 1e-3);
    let places = bounded["places"].as_array().unwrap();
    assert_eq!(places.len() as u64, count(&bounded, "scaled"));
    let far = |one: &Value| (one["place"][1].as_f64().unwrap() - 2.5).abs() > 0.5;
    assert!(places.iter().any(far), "in the rod: {places:?}");
    for order in ["2", "3"] {
        let monotone = told(&["--method", "monotone", "--order", order, "--picture", "monotone.png"]);
        assert_eq!(count(&monotone, "computed"), 0, "{monotone}");
        let alone = told(&["--method", "monotone", "--order", order, "--no-normalize"]);
        assert_eq!((count(&alone, "computed"), &alone["scaled"]), (0, &Value::Null), "{alone}");
    }
    let together = told(&["--method", "monotone-exact"]);
    assert_eq!((count(&together, "computed"), &together["scaled"]), (0, &Value::Null), "{together}");
    let heat = told(&["--method", "heat"]);
    assert!(heat["computed"]["count"].is_u64() && heat["scaled"].is_null(), "{heat}");
    let words = place.done(&["weights", "propeller.obj", "--handles", "points.tgf", "--on", "surface", "-o", "w.npy"]);
    assert!(words.out.contains("spurious extrema, where no handle holds the shape: "), "{words:?}");
    let words = [&usual[..6], &["--method", "monotone-exact", "--force"]].concat();
    let words = place.done(&words[..]);
    assert!(words.out.contains("all handles together: converged after "), "{words:?}");
    place.fails(2, "--order", &["weights", "propeller.obj", "--handles", "points.tgf", "--order", "3", "-o", "n.npy"]);
}

#[test]
fn a_mesh_is_bound_by_monotone_weights_once() {
    let place = Place::new("functions-bind");
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    let usual = ["bind", "tube.obj", "-s", "bones.tgf", "--vertices", "500", "--method", "monotone"];
    let bind = |more: &[&str]| place.done(&[&usual[..], more].concat());
    let first = bind(&["-o", "first.armature"]);
    assert!(first.out.contains("monotone weights of order 2 on a volume of"), "{first:?}");
    let again = bind(&["-o", "again.armature"]);
    assert!(again.out.contains("(from the cache)"), "{again:?}");
    assert_eq!(place.read("first.armature"), place.read("again.armature"));
    let third = bind(&["-o", "third.armature", "--order", "3"]);
    assert!(third.out.contains("monotone weights of order 3") && !third.out.contains("cache"), "{third:?}");
    let tube = armature_character::cache::from_bytes(&place.read("first.armature")).unwrap();
    let Provenance::Computed(WeightsRecord::Monotone(record)) = tube.provenance else { panic!("{tube:?}") };
    assert!(record.solved.unconverged == 0 && record.solved.error_bound <= 2e-3, "{record:?}");
    for (vertex, point) in tube.surface.mesh.vertices.iter().enumerate() {
        let (bone, weight) = tube.surface.influences.of_vertex(vertex).next().unwrap();
        assert!((point[1] - 1.0).abs() < 0.3 || (usize::from(bone) == usize::from(point[1] > 1.0) && weight > 0.6));
    }
    place.fails(2, "--order", &["bind", "tube.obj", "-s", "bones.tgf", "--order", "3"]);
}

/// Between -1 and 1, without a pattern.
fn noise(k: usize) -> f64 {
    ((k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / f64::from(1 << 23) - 1.0
}

#[test]
fn noise_goes_and_exactly_the_chosen_extrema_stay() {
    let place = Place::new("functions-smooth");
    let mesh = propeller();
    place.write("shape.obj", obj(&mesh));
    let n = mesh.vertices.len();
    let wave = |[x, y, _]: [f64; 3]| (2.0 * x).sin() + 0.3 * y;
    let values: Vec<f64> = mesh.vertices.iter().enumerate().map(|(k, &v)| wave(v) + 0.1 * noise(k)).collect();
    let table = |values: Vec<f64>| write_npy(&NumberTable { rows: values.len(), columns: 1, values });
    place.write("data.npy", table(values.clone()));
    let usual = ["smooth", "shape.obj", "--data", "data.npy", "--force"];
    let domain = FunctionDomain::of_triangles(&mesh).unwrap();
    for (keep, expected) in
        [(&["--keep", "4"][..], Some(4)), (&["--persistence", "0.5"][..], None), (&["--keep", "2"][..], Some(2))]
    {
        let told = json(&place.done(&[&usual[..], keep, &["--json", "--picture", "s.png"]].concat()).out);
        let column = &told["columns"][0];
        let kept = column["kept"].as_array().unwrap().len();
        assert!(expected.is_none_or(|count| count == kept) && kept >= 2, "{told}");
        assert!(column["extrema_before"].as_u64().unwrap() > 20 && column["outcome"] == "converged", "{told}");
        assert_eq!(column["spurious_extrema"], 0);
        let energies: Vec<f64> = column["energies"].as_array().unwrap().iter().map(|e| e.as_f64().unwrap()).collect();
        assert!(energies.windows(2).all(|pair| pair[1] <= pair[0]), "{energies:?}");
        let smoothed = read_npy(&place.read("smoothed.npy")).unwrap();
        assert_eq!((smoothed.rows, smoothed.columns), (n, 1));
        assert_eq!(local_extrema(&domain.neighbours, &smoothed.values).unwrap().count(), kept);
        assert!(place.read("s.png").starts_with(b"\x89PNG"));
    }
    let words = place.done(&[&usual[..], &["--keep", "3", "-o", "words.npy"]].concat());
    assert!(words.out.contains("minima kept") && words.out.contains("converged"), "{words:?}");
    // Distances along the shape from the bar's end: longest at a tip of the rod, and without other extrema.
    let far = place.done(&["smooth", "shape.obj", "--geodesic", "0", "--keep", "2", "-o", "far.npy", "--json"]);
    let far = json(&far.out);
    let kept = far["columns"][0]["kept"].as_array().unwrap();
    let straight = |one: &Value| one["place"][0].as_f64().unwrap().hypot(one["place"][1].as_f64().unwrap());
    assert!(
        kept.iter().any(|one| one["kind"] == "maximum" && one["value"].as_f64().unwrap() >= straight(one)),
        "{far}"
    );
    place.fails(3, "--geodesic names", &["smooth", "shape.obj", "--geodesic", "99999", "--keep", "2", "-o", "n.npy"]);
    // Bad input.
    let mut nan = values.clone();
    nan[7] = f64::NAN;
    place.write("nan.npy", table(nan));
    place.write("short.npy", table(values[1..].to_vec()));
    place.write("data.txt", "1 2 3");
    let with = |data: &'static str, more: &[&'static str]| {
        [&["smooth", "shape.obj", "-o", "never.npy", "--data", data][..], more].concat()
    };
    place.fails(3, "row 8, column 1 holds NaN", &with("nan.npy", &["--keep", "3"]));
    place.fails(3, "short.npy", &with("short.npy", &["--keep", "3"]));
    place.fails(3, "data.txt", &with("data.txt", &["--keep", "3"]));
    place.fails(3, "the most persistent", &with("data.npy", &["--persistence", "100"]));
    place.fails(3, "at least 2", &with("data.npy", &["--keep", "1"]));
    place.fails(2, "--keep", &with("data.npy", &[]));
    place.fails(2, "column 3", &with("data.npy", &["--keep", "3", "--picture", "p.png", "--picture-of", "3"]));
    place.fails(2, "is not a data file", &["smooth", "shape.obj", "--data", "data.npy", "--keep", "3", "-o", "x.txt"]);
    assert!(!place.path("never.npy").exists());
}

#[test]
fn colours_spread_and_stay_between_the_given_ones() {
    let place = Place::new("functions-interpolate");
    let mesh = propeller();
    place.write("shape.obj", obj(&mesh));
    place.write("colours.txt", "point 0 2.5 0 = #ff0000\nregion 4 2.5 0 0.3 = 0 0 1 # blue\npoint 3.1 0 0 = 1 1 0\n");
    let told = ["interpolate", "shape.obj", "colours.txt", "-o", "c.npy", "--picture", "c.png", "--json"];
    let told = json(&place.done(&told).out);
    assert_eq!((told["functions"].as_array().unwrap().len(), &told["unreached_vertices"]), (3, &0.into()), "{told}");
    let table = read_npy(&place.read("c.npy")).unwrap();
    assert_eq!((table.rows, table.columns), (mesh.vertices.len(), 3));
    assert!(table.values.iter().all(|value| (0.0..=1.0).contains(value)));
    let at = |x: f64, y: f64| {
        let near = |p: &[f64; 3]| (p[0] - x).hypot(p[1] - y) < 1e-9;
        let row = mesh.vertices.iter().position(near).unwrap();
        [0, 1, 2].map(|column| table.values[column * table.rows + row])
    };
    assert_eq!([at(0.0, 2.5), at(4.0, 2.5), at(3.1, 0.0)], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]]);
    // The arm without a colour of its own is of nearly one colour: nothing fades and comes back.
    let (near, tip) = (at(3.1, 3.5), at(3.1, 5.0));
    assert!(near.iter().zip(tip).all(|(a, b)| (a - b).abs() < 0.05), "{near:?} {tip:?}");
    place.write("heights.txt", "point 0 2.5 0 = 10\npoint 4 2.5 0 = 20\n");
    let words = place.done(&["interpolate", "shape.obj", "heights.txt", "--order", "3", "--picture", "h.png"]);
    assert!(words.out.contains("spurious extrema of the result, away from what is given: 0"), "{words:?}");
    place.write("bad.txt", "point 0 2.5 0 = 10\npint 4 2.5 0 = 20\n");
    place.fails(3, "bad.txt, line 2", &["interpolate", "shape.obj", "bad.txt", "-o", "n.npy"]);
    place.write("one.txt", "vertex 0 = 3");
    let constant = place.done(&["interpolate", "shape.obj", "one.txt", "-o", "one.npy"]);
    assert!(
        read_npy(&place.read("one.npy")).unwrap().values.iter().all(|value| (value - 3.0).abs() < 1e-12),
        "{constant:?}"
    );
}

#[test]
fn painted_weights_are_smoothed_if_asked_for() {
    let Some(fox) = shared("Fox.glb") else { return };
    let place = Place::new("functions-fox");
    let fox = fox.to_str().unwrap();
    place.done(&["bind", fox, "-o", "kept.armature"]);
    let ran = place.done(&["bind", fox, "--smooth-weights", "-o", "smooth.armature"]);
    assert!(ran.err.contains("minima and maxima stay") && ran.out.contains("weights of the artist"), "{ran:?}");
    let [kept, smooth] = ["kept.armature", "smooth.armature"]
        .map(|file| armature_character::cache::from_bytes(&place.read(file)).unwrap().surface.influences.clone());
    assert_eq!(kept.vertex_count(), smooth.vertex_count());
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place.fails(
        2,
        "--smooth-weights",
        &["bind", "tube.obj", "-s", "bones.tgf", "--smooth-weights", "-o", "n.armature"],
    );
}
