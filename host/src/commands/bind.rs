//! `armature bind`

use armature_character::{BindSettings, Provenance};

use crate::cli::args::BindArgs;
use crate::engine::actor::Actor;
use crate::failure::Failure;
use crate::talk::{Bar, Talk};
use crate::{characters, files, inputs, pictures};

/// Binds a mesh to a skeleton and saves the character.
pub fn bind(args: &BindArgs, talk: Talk) -> Result<(), Failure> {
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh");
    let model = inputs::model(&args.mesh)?;
    let settings =
        BindSettings { replace_rig: args.replace_rig, max_influences: args.influences, ..BindSettings::default() };
    let skeleton = args.skeleton.as_deref();
    let bound = characters::bind_cached(&model, &args.mesh, skeleton, &settings, !args.no_cache, &mut bar.binding())?;
    bar.finish();
    let character = bound.character;
    files::write(&args.output, &armature_character::to_bytes(&character))?;
    if !talk.quiet {
        for warning in &character.warnings {
            eprintln!("note: {warning}");
        }
        let weights = match character.provenance {
            Provenance::Artist => "weights of the artist".to_string(),
            Provenance::BoneHeat(heat) | Provenance::Generated(heat) => {
                format!(
                    "bone heat weights, residual {:.1e}, at most {:.3} of a weight dropped",
                    heat.residual, heat.max_dropped
                )
            }
        };
        let cache = if bound.from_cache { " (from the cache)" } else { "" };
        println!(
            "{}: {} vertices, {} triangles, {} bones; {weights}; {:.2} s{cache}",
            args.output.display(),
            character.mesh.vertices.len(),
            character.mesh.triangles.len(),
            character.skeleton.len(),
            start.elapsed().as_secs_f64(),
        );
    }
    if let Some(path) = &args.picture {
        let (actor, warning) = Actor::of_character(&args.mesh.display().to_string(), character);
        warning.iter().for_each(|w| eprintln!("note: {w}"));
        if let Some(shape) = &actor.shape {
            let by = pictures::write_picture(path, &actor, &shape.positions, &shape.normals)?;
            println!("{}: {by}", path.display());
        }
    }
    Ok(())
}
