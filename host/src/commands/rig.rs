//! `armature rig`

use std::path::Path;

use armature_character::rigging::{Doubt, Fit};
use armature_formats::gltf::{GlbScene, write_glb};
use armature_formats::skeleton::write_tgf;
use armature_rig::Skeleton;
use serde_json::json;

use crate::characters::rigging::{as_bvh, fitted};
use crate::cli::rig_args::RigArgs;
use crate::failure::Failure;
use crate::files::{self, inputs};
use crate::pictures::rig::write_rig_picture;
use crate::terminal::{Bar, Talk, aside, counted, out};

/// Fits a template's skeleton into a mesh and writes it.
pub fn rig(args: &RigArgs, talk: Talk) -> Result<(), Failure> {
    let write = writer(&args.output)?;
    args.overwrite.check(&args.output)?;
    args.picture.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let model = inputs::model(&args.mesh)?;
    let fit = fitted(&args.mesh, &model.mesh, &args.template, &args.how.settings(), &mut bar.stages())?;
    bar.finish();
    args.overwrite.write(&args.output, &write(&fit.skeleton, &files::name_of(&args.mesh))?)?;
    let picture = args.picture.as_deref();
    let drawn = picture.map(|path| write_rig_picture(args.overwrite, path, &model.mesh, &fit)).transpose()?;
    if args.json {
        out!("{}", report(args, &fit, start.elapsed().as_secs_f64()));
        return Ok(());
    }
    if talk.quiet {
        return Ok(());
    }
    out!(
        "{}: {}; {:.2} s",
        args.output.display(),
        counted(fit.skeleton.len(), "bone", "bones"),
        start.elapsed().as_secs_f64()
    );
    if args.how.up.is_none() || args.how.front.is_none() {
        out!("  up is {}, it looks along {}", direction(fit.up), direction(fit.front));
    }
    for (bone, sure) in fit.skeleton.bones().iter().zip(&fit.certainty) {
        out!("  {:24} {:>3.0} % sure", bone.name, 100.0 * sure);
    }
    tell_doubts(&fit);
    if let (Some(path), Some(by)) = (picture, drawn) {
        out!("{}: {by}", path.display());
    }
    Ok(())
}

/// What could not be told, and what to do about it.
pub(super) fn tell_doubts(fit: &Fit) {
    const UNSURE: f64 = 0.5;
    for doubt in &fit.doubts {
        let remedy = match doubt {
            Doubt::FrontUnclear => " with --front",
            Doubt::UpUnclear => " with --up",
            _ => "",
        };
        aside!("note: {doubt}{remedy}");
    }
    let unsure = fit.skeleton.bones().iter().zip(&fit.certainty).filter(|(_, sure)| **sure < UNSURE);
    let unsure: Vec<&str> = unsure.map(|(bone, _)| bone.name.as_str()).collect();
    if !unsure.is_empty() {
        aside!("note: less than {:.0} % sure: {}; look at them in a picture", 100.0 * UNSURE, unsure.join(", "));
    }
}

fn direction(way: [f64; 3]) -> String {
    const ALONG: f64 = 0.999;
    let axes = ["+X", "+Y", "+Z", "-X", "-Y", "-Z"];
    let along = (0..6).find(|&k| if k < 3 { way[k] > ALONG } else { way[k - 3] < -ALONG });
    along.map_or_else(|| format!("({:.3}, {:.3}, {:.3})", way[0], way[1], way[2]), |k| axes[k].to_owned())
}

fn report(args: &RigArgs, fit: &Fit, seconds: f64) -> serde_json::Value {
    let bones = fit.skeleton.bones().iter().zip(fit.skeleton.rest_segments()).zip(&fit.certainty);
    let bones = bones.map(|((bone, (head, tail)), certainty)| {
        let parent = bone.parent.map(|parent| fit.skeleton.bones()[parent].name.as_str());
        json!({"name": bone.name, "parent": parent, "head": head.to_array(), "tail": tail.to_array(), "certainty": certainty})
    });
    json!({
        "file": args.output.display().to_string(), "template": args.template, "up": fit.up, "front": fit.front,
        "misfit": fit.misfit, "bones": bones.collect::<Vec<_>>(),
        "doubts": fit.doubts.iter().map(ToString::to_string).collect::<Vec<_>>(), "seconds": seconds,
    })
}

type Writer = fn(&Skeleton, &str) -> Result<Vec<u8>, Failure>;

/// The format by the file's extension, checked before the work is done.
fn writer(path: &Path) -> Result<Writer, Failure> {
    match files::extension_of(path).as_str() {
        "bvh" => Ok(|skeleton, _| Ok(as_bvh(skeleton)?.into_bytes())),
        "tgf" => Ok(|skeleton, _| Ok(write_tgf(skeleton).into_bytes())),
        "glb" => Ok(|skeleton, name| Ok(write_glb(&GlbScene { name, skeleton, mesh: None, clips: Vec::new() })?)),
        _ => Err(Failure::usage(
            format!("{} is no skeleton file", path.display()),
            "skeletons are written as .bvh, .glb and .tgf",
        )),
    }
}
