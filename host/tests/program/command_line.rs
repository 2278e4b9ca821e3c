//! What scripts rely on: exit codes, files where they were asked for, output that can be parsed, errors that help.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

use crate::common::{Place, SMALL_BVH, TUBE_TGF, tube_obj};
use armature_character::{Character, Provenance, WeightsRecord};
use armature_formats::gltf::{GlbMesh, GlbScene, write_glb};
use armature_formats::model::Material;
use armature_geometry::Influences;
use armature_test_support::shared;
use firmware_protocol::{FrameBuffer, Hello, PROTOCOL_MAJOR, PartUid};
use serde_json::Value;

#[test]
fn wrong_usage_is_2() {
    let place = Place::new("usage");
    let help = place.done(&["--help"]);
    for word in ["demo", "inspect", "bind", "replay", "export", "bench", "Exit codes", "4 device trouble"] {
        assert!(help.out.contains(word), "{word}: {}", help.out);
    }
    assert!(place.done(&["--version"]).out.starts_with("armature "));
    for subcommand in
        ["demo", "devices", "inspect", "bind", "volume", "run", "replay", "export", "bench", "sim", "window"]
    {
        assert!(place.done(&[subcommand, "--help"]).out.contains("Usage"), "{subcommand}");
    }
    let virtually = ["run", "--virtual-clock", "--seconds", "0.1"];
    for (culprit, arguments) in [
        ("dance", vec!["dance"]),
        ("--loud", vec!["--loud"]),
        ("<FILE>", vec!["inspect"]),
        ("-3", vec!["run", "--seconds=-3"]),
        ("nan", vec!["run", "--seconds", "nan"]),
        ("0", vec!["run", "--rate", "0"]),
        ("fbx", vec!["volume", "mesh.obj", "-o", "a.fbx"]),
        ("7", vec!["volume", "mesh.obj", "--vertices", "7"]),
        ("--vertices", vec!["volume", "mesh.obj", "--vertices", "700", "--conforming"]),
        ("--slice", vec!["volume", "mesh.obj", "--slice-axis", "x"]),
        ("1.5", vec!["volume", "mesh.obj", "--slice", "a.png", "--slice-at", "1.5"]),
        ("99", vec!["bind", "mesh.obj", "--influences", "99"]),
        ("usb:7", [&virtually[..], &["--device", "usb:7"]].concat()),
        ("horse", [&virtually[..], &["--device", "sim:horse"]].concat()),
        ("horse", [&virtually[..], &["--character", "horse"]].concat()),
        ("--virtual-clock", vec!["run", "--virtual-clock", "--device", "tcp:localhost:1", "--seconds", "1"]),
        ("--virtual-clock", vec!["run", "--virtual-clock"]),
        ("tango", [&virtually[..], &["--motion", "tango"]].concat()),
        ("tail", [&virtually[..], &["--pull", "tail@1"]].concat()),
        ("soon", [&virtually[..], &["--burst", "soon"]].concat()),
        ("nothing/like/this", vec!["bench", "nothing/like/this"]),
        ("usd", vec!["export", "a.take", "--to", "a.usd"]),
    ] {
        place.fails(2, culprit, &arguments);
    }
}

#[test]
fn a_take_is_never_written_over() {
    let place = Place::new("never-over");
    let live = place.fails(2, "nothing", &["run", "--device", "sim:nothing", "--seconds", "1"]);
    assert_eq!(live.err.matches("error:").count(), 1, "{live:?}");
    assert!(live.err.contains("there is no puppet called \"nothing\"") && live.err.contains("human8"), "{live:?}");
    let run = ["run", "--device", "sim:hand", "--character", "hand", "--virtual-clock", "--seconds", "0.2"];
    let record = [&run[..], &["--record", "hand.take"]].concat();
    place.done(&record);
    let before = place.read("hand.take");
    place.fails(2, "hand.take", &record);
    assert!(place.read("hand.take") == before, "the old take is as it was");
    let replayed = place.done(&["replay", "hand.take"]);
    assert!(replayed.out.contains("all the same to the last bit"), "{replayed:?}");
    // The same command gives the same bytes.
    place.done(&[&run[..], &["--record", "again.take"]].concat());
    assert!(place.read("again.take") == before);
}

/// A device on a TCP port that does one thing to whoever connects, until that one goes.
fn serve(act: impl Fn(&mut TcpStream) -> std::io::Result<()> + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            // The end of the connection is the end of the act.
            let _ = act(&mut stream);
        }
    });
    address
}

fn silent(stream: &mut TcpStream) -> std::io::Result<()> {
    let mut heard = [0; 1024];
    while stream.read(&mut heard)? > 0 {}
    Ok(())
}

fn garbage(stream: &mut TcpStream) -> std::io::Result<()> {
    let mut state = 1_u32;
    loop {
        let noise: Vec<u8> = (0..500)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            })
            .collect();
        stream.write_all(&noise)?;
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
}

/// A device of the future: it says hello whenever it hears something.
fn other_major(stream: &mut TcpStream) -> std::io::Result<()> {
    let hello = Hello {
        protocol_major: PROTOCOL_MAJOR + 1,
        protocol_minor: 0,
        features: 0,
        firmware: [9, 0, 0],
        uid: PartUid([7; 12]),
        max_rate_millihertz: 100_000,
        name: "A puppet of the future",
    };
    let mut wire = FrameBuffer::new();
    let mut heard = [0; 1024];
    while stream.read(&mut heard)? > 0 {
        stream.write_all(wire.encode(&hello).expect("a hello fits a frame"))?;
    }
    Ok(())
}

fn hang_up(stream: &mut TcpStream) -> std::io::Result<()> {
    stream.shutdown(std::net::Shutdown::Both)
}

#[test]
fn device_trouble_is_4_and_has_a_name() {
    let place = Place::new("device-trouble");
    let vacant = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let cases = [
        ("there is no port", "serial:/dev/no-such-port".to_string()),
        ("no-such-port", "serial:no-such-port@115200".to_string()),
        ("cannot be reached", format!("tcp:{vacant}")),
        ("has sent nothing", serve(silent)),
        ("none of them made sense", serve(garbage)),
        ("speaks protocol", serve(other_major)),
        ("is gone", serve(hang_up)),
    ];
    for (words, device) in cases {
        let arguments = ["run", "--device", &device, "--character", "hand", "--seconds", "1", "--record", "no.take"];
        let ran = place.fails(4, words, &arguments);
        println!("{device}: {}", ran.err.trim());
        let error = ran.err.split("error: ").nth(1).unwrap();
        let at = device.split_once(':').unwrap().1.split('@').next().unwrap();
        assert!(error.contains(at), "with two puppets, which one is it? {ran:?}");
        assert!(!place.path("no.take").exists(), "no take of a performance that never was");
    }
    // A file is not a serial port.
    place.write("port.txt", "not a port");
    place.fails(4, "port.txt", &["run", "--device", "serial:port.txt", "--character", "hand", "--seconds", "1"]);
}

#[test]
fn the_demo_goes_the_whole_way() {
    let place = Place::new("demo");
    let ran = place.done(&["demo", "--seconds", "1", "--output", "here"]);
    for word in ["puppet", "stream", "losses", "latency", "p99", "take", "replay", "export", "picture"] {
        assert!(ran.out.contains(word), "{word}: {}", ran.out);
    }
    assert!(ran.out.contains("0 samples lost, 0 frames with a wrong checksum"), "{}", ran.out);
    for (name, magic) in [
        ("demo.take", &b"\x8aTAKE"[..]),
        ("demo.glb", &b"glTF"[..]),
        ("demo.bvh", &b"HIERARCHY"[..]),
        ("demo.png", &b"\x89PNG"[..]),
    ] {
        assert!(place.read(&format!("here/{name}")).starts_with(magic), "{name}");
    }
    let inspected = place.done(&["inspect", "here/demo.take", "--json"]);
    let value: Value = serde_json::from_str(&inspected.out).unwrap();
    assert_eq!((&value["whole"], &value["lost_samples"]), (&Value::Bool(true), &0.into()));
    assert!(value["samples"].as_u64().unwrap() >= 190, "{value}");
    // Quiet means quiet, and an earlier demo is replaced where that is asked for.
    let quiet = place.done(&["demo", "--seconds", "0.2", "--output", "here", "--force", "--quiet"]);
    assert_eq!(quiet.out, "");
}

#[test]
fn benchmarks_have_names_and_lines_that_parse() {
    let place = Place::new("bench");
    let list = place.done(&["bench", "--list"]);
    let names: Vec<&str> = list.out.lines().collect();
    assert!(names.contains(&"protocol/decode"), "{names:?}");
    assert!(names.iter().all(|name| name.contains('/') && !name.contains(' ')), "{names:?}");
    let ran = place.done(&["bench", "protocol", "--json"]);
    let lines: Vec<Value> = ran.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let measured: Vec<&str> = lines.iter().map(|line| line["name"].as_str().unwrap()).collect();
    let expected: Vec<&str> = names.iter().copied().filter(|name| name.contains("protocol")).collect();
    assert_eq!(measured, expected);
    for line in &lines {
        assert!(line["value"].as_f64().is_some_and(|v| v.is_finite() && v > 0.0), "{line}");
        assert!(line["unit"].is_string() && line["runs"].as_u64() >= Some(1), "{line}");
    }
}

#[test]
fn inspect_gives_one_json_object() {
    let place = Place::new("inspect");
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place.write("walk.bvh", SMALL_BVH);
    place.done(&["bind", "tube.obj", "--skeleton", "bones.tgf", "--output", "tube.armature"]);
    let run = ["run", "--device", "sim:walk.bvh", "--character", "walk.bvh", "--virtual-clock", "--seconds", "0.5"];
    place.done(&[&run[..], &["--record", "walk.take"]].concat());
    for (file, kind) in [
        ("tube.obj", "mesh"),
        ("bones.tgf", "skeleton"),
        ("walk.bvh", "motion"),
        ("tube.armature", "character"),
        ("walk.take", "take"),
    ] {
        let ran = place.done(&["inspect", file, "--json"]);
        let value: Value = serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{file}: {e}: {}", ran.out));
        assert_eq!(value["kind"], kind, "{value}");
        assert!(place.done(&["inspect", file]).out.starts_with(file));
    }
    let value: Value = serde_json::from_str(&place.done(&["inspect", "tube.obj", "--json"]).out).unwrap();
    assert_eq!(value["diagnosis"]["closed"], true, "{value}");
    assert_eq!(value["diagnosis"]["vertices"], 206, "{value}");
}

fn character(place: &Place, name: &str) -> Character {
    armature_character::cache::from_bytes(&place.read(name)).unwrap()
}

#[test]
fn binding_again_comes_from_the_cache() {
    let place = Place::new("bind");
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    let bind = |output: &str, more: &[&str]| {
        let usual = ["bind", "tube.obj", "--skeleton", "bones.tgf", "--vertices", "600", "--output", output];
        place.done(&[&usual[..], more].concat())
    };
    let first = bind("first.armature", &[]);
    assert!(
        first.out.contains("; bounded biharmonic weights on a volume") && !first.out.contains("cache"),
        "{first:?}"
    );
    assert!(place.path("armature/characters").is_dir(), "the cache is where XDG_CACHE_HOME says");
    let second = bind("second.armature", &[]);
    assert!(second.out.contains("(from the cache)"), "{second:?}");
    let third = bind("third.armature", &["--no-cache"]);
    assert!(!third.out.contains("cache"), "{third:?}");
    assert!(place.read("first.armature") == place.read("second.armature"));
    assert!(place.read("first.armature") == place.read("third.armature"), "and binding is the same every time");
    // Other settings are other work, and a damaged entry is as good as none.
    assert!(!bind("fourth.armature", &["--influences", "1"]).out.contains("cache"));
    for entry in std::fs::read_dir(place.path("armature/characters")).unwrap() {
        std::fs::write(entry.unwrap().path(), "rubbish").unwrap();
    }
    let fifth = bind("fifth.armature", &[]);
    assert!(!fifth.out.contains("cache") && fifth.err.contains("is remade"), "and it is said: {fifth:?}");
    assert!(place.read("first.armature") == place.read("fifth.armature"));
    let heat = bind("heat.armature", &["--method", "heat"]);
    assert!(heat.out.contains("; bone heat weights") && !heat.out.contains("cache"), "{heat:?}");
    // The weights do what they should: the lower end follows the lower bone.
    let tube = character(&place, "first.armature");
    let Provenance::Computed(WeightsRecord::Biharmonic(record)) = tube.provenance else { panic!("{tube:?}") };
    assert!(record.unconverged == 0 && record.error_bound <= 2e-3, "{record:?}");
    for (vertex, point) in tube.surface.mesh.vertices.iter().enumerate() {
        let (bone, weight) = tube.surface.influences.of_vertex(vertex).next().unwrap();
        assert!((point[1] - 1.0).abs() < 0.3 || (usize::from(bone) == usize::from(point[1] > 1.0) && weight > 0.6));
    }
    place.fails(3, "tube.obj", &["bind", "tube.obj"]);
    place.fails(3, "none.tgf", &["bind", "tube.obj", "--skeleton", "none.tgf"]);
}

#[test]
fn a_rig_that_comes_with_the_model_is_kept() {
    let place = Place::new("rigged");
    place.write("tube.obj", tube_obj());
    place.write("bones.tgf", TUBE_TGF);
    place.done(&["bind", "tube.obj", "--skeleton", "bones.tgf", "--method", "heat", "--output", "heat.armature"]);
    let heat = character(&place, "heat.armature");
    // Weights that no method would give: an artist's.
    let count = heat.surface.mesh.vertices.len();
    let weights = (0..count).flat_map(|v| if v % 3 == 0 { [0.75, 0.25] } else { [0.625, 0.375] }).collect();
    let bones = (0..count).flat_map(|v| if v % 2 == 0 { [0, 1] } else { [1, 0] }).collect();
    let painted = Influences::new(2, bones, weights, heat.skeleton.len()).unwrap();
    let mesh = GlbMesh {
        mesh: &heat.surface.mesh,
        split: None,
        normals: Some(&heat.surface.normals),
        texture_coordinates: None,
        vertex_colors: None,
        influences: Some(&painted),
        parts: &[],
        morph_targets: &[],
        skins: &[],
        materials: &[Material { base_color: Some([0.5, 0.25, 0.125, 1.0]), ..Material::default() }],
    };
    let scene = GlbScene { name: "tube", skeleton: &heat.skeleton, mesh: Some(mesh), clips: Vec::new() };
    place.write("painted.glb", write_glb(&scene).unwrap());

    let kept = place.done(&["bind", "painted.glb", "--output", "kept.armature"]);
    assert!(kept.out.contains("weights of the artist"), "{kept:?}");
    let kept = character(&place, "kept.armature");
    assert_eq!(kept.provenance, Provenance::Artist);
    assert_eq!(kept.surface.mesh.vertices.len(), count);
    // The file may number the vertices otherwise; their places tell which is which.
    // Plus zero, so that -0 and 0 are one place.
    let bits = |points: Vec<[f32; 3]>| points.into_iter().map(|p| p.map(|c| (c + 0.0).to_bits())).collect::<Vec<_>>();
    let painted_at = bits(heat.rest_positions());
    for (vertex, place) in bits(kept.rest_positions()).iter().enumerate() {
        let painted_vertex = painted_at.iter().position(|p| p == place).unwrap();
        let (kept, painted) = (kept.surface.influences.of_vertex(vertex), painted.of_vertex(painted_vertex));
        assert!(kept.eq(painted), "vertex {vertex}, painted as {painted_vertex}");
    }
    let replace = ["bind", "painted.glb", "--replace-rig", "--method", "heat", "--output", "replaced.armature"];
    let replaced = place.done(&replace);
    assert!(replaced.out.contains("bone heat weights"), "{replaced:?}");
    assert_ne!(character(&place, "replaced.armature").surface.influences, painted);
}

#[test]
fn the_fox_keeps_its_rig() {
    let Some(fox) = shared("Fox.glb") else { return };
    let place = Place::new("fox");
    let ran = place.done(&["bind", fox.to_str().unwrap(), "--output", "fox.armature"]);
    assert!(ran.out.contains("weights of the artist") && ran.out.contains("24 bones"), "{ran:?}");
    let fox = character(&place, "fox.armature");
    assert!(fox.materials[0].base_color_map.is_some() && fox.surface.texture_coordinates.is_some());
}

#[test]
fn the_rules_for_usb_are_printed_for_a_pipe() {
    let place = Place::new("udev-rules");
    let printed = place.done(&["devices", "--udev-rules"]);
    assert_eq!(printed.out, armature_device::UDEV_RULES);
    assert!(printed.out.lines().any(|line| line.contains("ff4101") && line.ends_with("TAG+=\"uaccess\"")));
}

#[test]
fn a_hint_never_recommends_what_was_just_typed() {
    let place = Place::new("hints");
    // A chain of 150 bones: one more than a sample has sensors for.
    let joints = |n: usize| -> String {
        let joint = |k| format!("JOINT j{k} {{ OFFSET 0 1 0 CHANNELS 3 Zrotation Xrotation Yrotation\n");
        let open: Vec<String> = (1..n).map(joint).collect();
        let open = open.concat();
        let motion = ["0"; 3].join(" ") + &" 0 0 0".repeat(n);
        let channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation";
        let end = "End Site { OFFSET 0 1 0 }";
        format!(
            "HIERARCHY\nROOT j0 {{ OFFSET 0 0 0 {channels}\n{open}{end}{}\nMOTION\nFrames: 1\nFrame Time: 0.1\n{motion}\n",
            "}".repeat(n)
        )
    };
    place.write("long.bvh", joints(150));
    let run = ["run", "--virtual-clock", "--seconds", "0.2", "--character", "hand"];
    let long = place.fails(3, "448", &[&run[..], &["--device", "sim:long.bvh"]].concat());
    assert!(!long.err.contains("--device sim:FILE.bvh") && long.err.contains("remove some bones"), "{long:?}");
    place.write("other.bvh", joints(3));
    let other = place.fails(
        3,
        "none of the 3 bones",
        &[&run[..], &["--device", "sim:human", "--motion", "other.bvh"]].concat(),
    );
    assert!(other.err.contains("--device sim:FILE.bvh"), "{other:?}");
    let arm = place.fails(2, "so101-leader", &[&run[..], &["--device", "sim:so101-leader"]].concat());
    assert!(arm.err.contains("leave out --virtual-clock"), "{arm:?}");
}
