//! Files read in memory.

use std::any::Any;
use std::ops::ControlFlow;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use armature_character::bind::{BindSettings, bind};
use armature_formats::fbx::read_fbx_skeleton;
use armature_formats::gltf::read_gltf_skeleton;
use armature_formats::motion::{read_bvh, write_bvh};
use armature_formats::settings::{read_calibration, read_mapping, write_calibration, write_mapping};
use armature_formats::skeleton::{read_tgf, skeleton_from_graph};
use armature_formats::tables::{read_dmat, read_npy};
use armature_formats::{FormatError, read_model};

use crate::common::Place;
use crate::damage::Damaged;
use crate::samples::Companions;

/// A reader that works on a small file for this long hangs.
const LIMIT: Duration = Duration::from_mins(2);

/// Reads a file by its name, and writes again what can be written, as the program would. `companions` are the files it
/// may refer to.
pub(crate) fn read(name: &str, bytes: &[u8], companions: &Companions) -> Result<(), String> {
    let check = |error: FormatError| {
        assert!(!error.what.is_empty() && !error.remedy.is_empty(), "{error}");
        error.to_string()
    };
    match name.rsplit('.').next().unwrap_or_default() {
        "bvh" => read_bvh(bytes).map(|read| drop(write_bvh(&read.motion))).map_err(check),
        "tgf" => read_tgf(bytes).map(|graph| drop(skeleton_from_graph(&graph, None))).map_err(check),
        "npy" => read_npy(bytes).map(|table| drop(table.indices())).map_err(check),
        "dmat" => read_dmat(bytes).map(|table| drop(table.indices())).map_err(check),
        "toml" if name.contains("mapping") => read_mapping(bytes).map(|m| drop(write_mapping(&m))).map_err(check),
        "toml" => read_calibration(bytes).map(|c| drop(write_calibration(&c))).map_err(check),
        "edit" => String::from_utf8(bytes.to_vec())
            .map_err(|error| error.to_string())
            .and_then(|text| armature_take::EditList::read(&text).map(drop).map_err(|error| error.to_string())),
        "take" => armature_take::Take::read(bytes).map(drop).map_err(|error| error.to_string()),
        "armature" => armature_character::cache::from_bytes(bytes).map(drop).map_err(|error| error.to_string()),
        extension => {
            let resolver = |name: &str| companions.get(name).cloned().ok_or_else(|| format!("there is no {name}"));
            let bones = match extension {
                "glb" | "gltf" | "vrm" => Some(read_gltf_skeleton(name, bytes, &resolver)),
                "fbx" => Some(read_fbx_skeleton(name, bytes)),
                _ => None,
            };
            let model = match (read_model(name, bytes, &resolver), bones) {
                (Ok(model), _) => model,
                // Bones without a mesh.
                (Err(_), Some(Ok(bones))) if !bones.has_mesh => return Ok(()),
                (Err(error), _) => return Err(check(error)),
            };
            assert_eq!(model.mesh.validate(), Ok(()));
            assert_eq!(model.drawn_triangles().len(), model.mesh.triangles.len());
            let _ = model.split_at_seams();
            if model.rig.is_some() {
                // Limits, and weights for what has none.
                let settings = BindSettings { bind_unbound: true, limit_painted: Some(2), ..BindSettings::default() };
                bind(model, None, &settings, &mut |_, _| ControlFlow::Continue(()))
                    .map(drop)
                    .map_err(|error| error.to_string())?;
            }
            Ok(())
        }
    }
}

/// Reads on a thread of its own, with a limit; a panic or a hang fails the test and keeps the file.
pub(crate) fn read_in_time(
    place: &Place,
    seed: u64,
    file: &Damaged,
    companions: &Arc<Companions>,
) -> Result<(), String> {
    let (send, receive) = mpsc::channel();
    let (name, bytes, companions) = (file.name.clone(), file.bytes.clone(), companions.clone());
    let reader = std::thread::spawn(move || {
        let outcome = read(&name, &bytes, &companions);
        // Fails if the limit has passed.
        let _ = send.send(outcome);
    });
    match receive.recv_timeout(LIMIT) {
        Ok(outcome) => outcome,
        Err(mpsc::RecvTimeoutError::Timeout) => failed(place, seed, file, &format!("it is still read after {LIMIT:?}")),
        Err(mpsc::RecvTimeoutError::Disconnected) => {
            let panic = reader.join().err();
            failed(place, seed, file, &format!("the reader panicked: {}", panic.as_deref().map_or("", message)))
        }
    }
}

fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no text")
}

/// Fails the test with everything that is needed to see it again.
pub(crate) fn failed(place: &Place, seed: u64, file: &Damaged, what: &str) -> ! {
    let kept = place.write(&format!("failed-{seed}-{}", file.name), &file.bytes);
    panic!("seed {seed}, {} ({}): {what}\nthe file is kept as {}", file.name, file.done, kept.display());
}
