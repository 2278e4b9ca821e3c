//! Files modelled on public bug reports: awkward, but readable.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use armature_formats::gltf::read_gltf_skeleton;
use armature_formats::model::Model;
use armature_formats::motion::read_bvh;
use armature_formats::skeleton::read_tgf;
use armature_formats::{FormatError, read_model};
use armature_test_support::{shared, shared_bytes};
use glam::Vec3;

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name} does not exist"))
}

fn case(name: &str) -> Option<Model> {
    let bytes = shared_bytes(&format!("cases/{name}"))?;
    Some(read_model(name, &bytes, &none).unwrap_or_else(|error| panic!("{error}")))
}

/// Lowest and highest coordinates.
fn bounds(model: &Model) -> (Vec3, Vec3) {
    let points = model.mesh.vertices.iter().map(|p| Vec3::from(p.map(|c| c as f32)));
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

#[test]
fn stretched_stl_and_obj_files_hold_a_cube() {
    for (name, notes) in [
        ("stl/s_ascii_bom.stl", 0),
        ("stl/s_ascii_lead.stl", 0),
        ("stl/s_ascii_noend.stl", 1),
        ("stl/s_ascii_ws.stl", 0),
        ("stl/s_trail.stl", 1),
        ("stl/t_colorline.stl", 1),
        ("stl/t_endname.stl", 0),
        ("stl/t_endsp.stl", 0),
        ("stl/t_junk.stl", 1),
        ("stl/t_normalless.stl", 0),
        ("stl/obj_named.stl", 1),
        ("obj/o_2face.obj", 1),
        ("obj/o_badvn.obj", 1),
        ("obj/o_badvt.obj", 1),
        ("obj/o_nolist.obj", 2),
    ] {
        let Some(model) = case(name) else { return };
        assert_eq!((model.mesh.vertices.len(), model.mesh.triangles.len()), (8, 12), "{name}");
        assert_eq!(bounds(&model), (Vec3::NEG_ONE, Vec3::ONE), "{name}");
        assert_eq!(model.warnings.len(), notes, "{name}: {:?}", model.warnings);
    }
}

#[test]
fn motions_with_a_slip_in_their_header_are_read() {
    let Some(base) = shared_bytes("cases/bvh/base.bvh") else { return };
    let base = read_bvh(&base).unwrap();
    assert_eq!((base.motion.frames.len(), base.warnings.len()), (30, 0));
    for name in ["minus1.bvh", "plus1.bvh", "ft0.bvh"] {
        let read = read_bvh(&shared_bytes(&format!("cases/bvh/{name}")).unwrap()).unwrap();
        assert_eq!(read.motion.frames, base.motion.frames, "{name}");
        assert_eq!(read.warnings.len(), 1, "{name}: {:?}", read.warnings);
        assert!((read.motion.frame_seconds - base.motion.frame_seconds).abs() < 1e-5, "{name}");
    }
}

#[test]
fn extensions_of_colours_do_not_keep_the_shape_away() {
    for (name, extension) in [
        ("glb/webp_req.glb", "EXT_texture_webp"),
        ("glb/rq_KHR_materials_clearcoat.glb", "KHR_materials_clearcoat"),
        ("glb/rq_KHR_texture_basisu.glb", "KHR_texture_basisu"),
    ] {
        let Some(model) = case(name) else { return };
        assert_eq!(model.rig.as_ref().unwrap().skeleton.len(), 4, "{name}");
        assert!(model.warnings[0].contains(extension), "{name}: {:?}", model.warnings);
    }
    let old = shared_bytes("cases/glb/gltf1.gltf").unwrap();
    let error = read_model("gltf1.gltf", &old, &none).unwrap_err();
    assert!(error.what.contains("this is glTF 1.0"), "{error}");
}

/// Where bones start, in model space.
fn heads(model: &Model) -> Vec<Vec3> {
    model.rig.as_ref().unwrap().skeleton.rest_segments().iter().map(|(head, _)| *head).collect()
}

#[test]
fn a_joint_that_nothing_follows_rests_at_its_node() {
    let Some(model) = case("glb/ibmzero.glb") else { return };
    let ups: Vec<f32> = heads(&model).iter().map(|head| head.y).collect();
    for (have, want) in ups.iter().zip([0.0, 0.5, 1.0, 1.5, 1.6]) {
        assert!((have - want).abs() < 1e-6, "{ups:?}");
    }
    assert_eq!(model.rig.as_ref().unwrap().skeleton.bones()[4].name, "extra");
    assert!(model.warnings.iter().any(|w| w.contains("extra")), "{:?}", model.warnings);
}

/// Bounds as Blender 5.0.1 shows the imported files, its axes exchanged for glTF's.
#[test]
fn proportions_and_morphs_are_as_blender_shows_them() {
    for (name, low, high, notes) in [
        ("glb/a_longer.glb", [-0.12, 0.0, -0.096], [0.24, 2.5, 0.163], 1),
        ("glb/a_bighead.glb", [-0.24, 0.0, -0.192], [0.48, 2.5, 0.326], 1),
        ("glb/scale0.glb", [-0.12, 0.0, -0.096], [0.24, 1.531, 0.163], 1),
        ("glb/morph.glb", [0.18, 0.0, -0.096], [0.42, 2.0, 0.096], 0),
        ("glb/morph_static.glb", [0.0, 0.0, 0.0], [1.0, 2.0, 0.0], 0),
    ] {
        let Some(model) = case(name) else { return };
        let (have_low, have_high) = bounds(&model);
        let off = have_low.distance(Vec3::from(low)).max(have_high.distance(Vec3::from(high)));
        assert!(off < 2e-3, "{name}: {have_low} {have_high}");
        assert_eq!(model.warnings.len(), notes, "{name}: {:?}", model.warnings);
    }
    let longer = case("glb/a_longer.glb").unwrap();
    let ups: Vec<f32> = heads(&longer).iter().map(|head| head.y).collect();
    assert!(ups.iter().zip([0.0, 0.5, 1.5, 2.0]).all(|(have, want)| (have - want).abs() < 1e-6), "{ups:?}");
    let big = case("glb/a_bighead.glb").unwrap().rig.unwrap().skeleton;
    assert!((big.bones()[3].rest.scale - Vec3::splat(2.0)).length() < 1e-5);
}

#[test]
fn skeletons_without_a_mesh_are_read() {
    for (name, clips) in [("skinnomesh.glb", 0), ("animnoskin.glb", 1)] {
        let Some(bytes) = shared_bytes(&format!("cases/glb/{name}")) else { return };
        let read = read_gltf_skeleton(name, &bytes, &none).unwrap_or_else(|error| panic!("{error}"));
        let names: Vec<&str> = read.skeleton.bones().iter().map(|b| b.name.as_str()).collect();
        assert_eq!(names, ["bone0", "bone1", "bone2", "bone3"], "{name}");
        assert_eq!((read.motions.len(), read.has_mesh, read.warnings.len()), (clips, false, 0), "{name}");
        assert!(read.skeleton.rest_segments()[3].0.distance(Vec3::new(0.0, 1.5, 0.0)) < 1e-6, "{name}");
    }
}

/// Files that cannot be read say what is wrong and what to do.
#[test]
fn every_case_is_read_or_refused_with_a_remedy() {
    let Some(cases) = shared("cases") else { return };
    let mut refused = Vec::new();
    let mut count = 0;
    for folder in ["bvh", "device", "glb", "mapping", "mesh", "obj", "stl", "tgf"] {
        for entry in std::fs::read_dir(cases.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let error: Option<FormatError> = match name.rsplit('.').next().unwrap() {
                "bvh" => read_bvh(&bytes).err(),
                "tgf" => read_tgf(&bytes).err(),
                // Other crates read these.
                "take" | "toml" => continue,
                "glb" if read_gltf_skeleton(name, &bytes, &none).is_ok_and(|read| !read.has_mesh) => None,
                _ => read_model(name, &bytes, &none).err(),
            };
            count += 1;
            if let Some(error) = error {
                assert!(!error.what.is_empty() && !error.remedy.is_empty(), "{name}: {error}");
                refused.push(name.to_owned());
            }
        }
    }
    assert!(count >= 55, "{count} cases");
    assert_eq!(refused, ["gltf1.gltf"]);
}
