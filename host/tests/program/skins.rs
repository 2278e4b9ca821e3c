//! How a skin follows the bones: chosen when a character is bound, for a run, and in pictures; what exports say of it.

use armature_character::cache::from_bytes;
use armature_character::{EndpointMethod, SkinKind};
use armature_formats::gltf::{GlbScene, write_glb};

use crate::common::Place;

#[test]
fn a_skin_is_chosen_kept_and_shown() {
    let place = Place::new("skins");
    let hand = armature_character::own::hand().unwrap();
    let scene = GlbScene { name: "hand", skeleton: &hand.skeleton, mesh: Some(hand.glb_mesh()), clips: Vec::new() };
    place.write("hand.glb", write_glb(&scene).unwrap());

    let bind = ["bind", "hand.glb", "--skin", "stretch-twist-dqs", "--endpoints", "heat", "-o", "twist.armature"];
    let said = place.done(&[&bind[..], &["--twist-curve", "LeftHand:0.5=0.2"]].concat());
    assert!(said.out.contains("skin stretch-twist-dqs, endpoint weights by heat"), "{said:?}");
    let bound = from_bytes(&place.read("twist.armature")).unwrap();
    let endpoints = bound.surface.endpoints.as_ref().unwrap();
    assert_eq!((bound.skin, endpoints.method), (SkinKind::StretchTwistDualQuaternion, EndpointMethod::BoneHeat));
    assert!(place.done(&["inspect", "twist.armature"]).out.contains("skin stretch-twist-dqs"));

    let run = ["run", "--device", "sim:hand", "--character", "twist.armature", "--record", "hand.take"];
    place.done(&[&run[..], &["--virtual-clock", "--seconds", "0.5"]].concat());
    let said = place.done(&["export", "hand.take", "--to", "hand.glb", "--force"]);
    assert!(said.err.contains("blend it linearly"), "{said:?}");
    let said = place.done(&["export", "hand.take", "--to", "hand.bvh"]);
    assert!(!said.err.contains("linearly"), "{said:?}");

    // The bones do the same whatever the skin does.
    let other = ["--character", "twist.armature", "--skin", "lbs", "--record", "other.take"];
    place.done(&[&["run", "--device", "sim:hand", "--virtual-clock", "--seconds", "0.5"][..], &other].concat());
    assert_eq!(place.read("hand.take"), place.read("other.take"));

    let picture = |to: &str, skin: &[&str]| {
        place.done(&[&["replay", "hand.take", "--at", "0.4", "--picture", to][..], skin].concat());
        place.read(to)
    };
    let own = picture("own.png", &[]);
    assert_eq!(own, picture("same.png", &["--skin", "stretch-twist-dqs"]));
    assert_ne!(own, picture("lbs.png", &["--skin", "lbs"]));

    place.write("bones.tgf", b"1 0 0 0\n2 0 1 0\n#\n1 2\n");
    let run = ["run", "--device", "sim:hand", "--virtual-clock", "--seconds", "0.2"];
    for (arguments, said) in [
        (vec!["bind", "hand.glb", "--endpoints", "heat", "-o", "x.armature"], "add --skin stretch-twist"),
        (vec!["bind", "hand.glb", "--skin", "rubber", "-o", "x.armature"], "choose one of lbs, dqs"),
        (
            vec!["bind", "hand.glb", "--skin", "stretch-twist", "--twist-curve", "knee:0.5=0.2", "-o", "x.armature"],
            "no bone \"knee\"",
        ),
        (vec!["replay", "hand.take", "--skin", "lbs"], "--skin is for the picture"),
        ([&run[..], &["--character", "bones.tgf", "--skin", "dqs"]].concat(), "no mesh"),
    ] {
        let refused = place.run(&arguments);
        assert!(refused.code != 0 && refused.err.contains(said), "{refused:?}");
    }
    let old = [&run[..], &["--character", "hand.glb", "--skin", "stretch-twist"]].concat();
    let said = place.done(&old);
    assert!(said.err.contains("`armature bind --skin stretch-twist` computes them"), "{said:?}");
}
