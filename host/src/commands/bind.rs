//! `armature bind`

use std::path::Path;

use armature_character::{
    BiharmonicRecord, BiharmonicTier, BindSettings, Character, DomainKind, Provenance, WeightsRecord,
};
use armature_weights::WeightMatrix;

use crate::cli::weight_args::BindArgs;
use crate::engine::actor::Actor;
use crate::failure::Failure;
use crate::talk::{Bar, Talk};
use crate::weight_picture::{WeightPicture, handle_of, write_weight_picture};
use crate::words::{counted, grouped};
use crate::{characters, files, inputs, pictures};

/// Binds a mesh to a skeleton and saves the character.
pub fn bind(args: &BindArgs, talk: Talk) -> Result<(), Failure> {
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let model = inputs::model(&args.mesh)?;
    let settings = BindSettings {
        replace_rig: args.replace_rig,
        max_influences: args.influences.unwrap_or(args.method.influences()),
        method: args.method.for_bind(),
        on: args.domain.volume_or_asked(),
        ..BindSettings::default()
    };
    let skeleton = args.skeleton.as_deref();
    let bound = characters::bind_cached(model, &args.mesh, skeleton, &settings, !args.no_cache, &mut bar.binding())?;
    bar.finish();
    let character = bound.character;
    files::write(&args.output, &armature_character::to_bytes(&character))?;
    if !talk.quiet {
        for warning in &character.warnings {
            eprintln!("note: {warning}");
        }
        let cache = if bound.from_cache { " (from the cache)" } else { "" };
        println!(
            "{}: {} vertices, {} triangles, {} bones; {}; {:.2} s{cache}",
            args.output.display(),
            character.mesh.vertices.len(),
            character.mesh.triangles.len(),
            character.skeleton.len(),
            how_made(&character.provenance),
            start.elapsed().as_secs_f64(),
        );
    }
    match &args.picture {
        Some(path) => draw(path, args, character, talk),
        None => Ok(()),
    }
}

/// How weights came about, in words.
pub(super) fn how_made(provenance: &Provenance) -> String {
    match provenance.record() {
        None => "weights of the artist".to_owned(),
        Some(WeightsRecord::BoneHeat(heat)) => format!(
            "bone heat weights, residual {:.1e}, at most {:.3} of a weight dropped",
            heat.residual, heat.max_dropped
        ),
        Some(WeightsRecord::Biharmonic(record)) => biharmonic_words(record),
    }
}

fn biharmonic_words(record: &BiharmonicRecord) -> String {
    let tier = match record.tier {
        BiharmonicTier::Interactive => "",
        BiharmonicTier::Certified => "certified ",
    };
    let domain = match record.domain {
        DomainKind::Volume => "a volume",
        DomainKind::Flat => "the flat figure",
        DomainKind::OwnTetrahedra => "its own tetrahedra",
        DomainKind::Surface => "the surface",
    };
    let missed = match record.unconverged {
        0 => String::new(),
        bones => format!(", NOT CONVERGED for {}", counted(bones, "bone", "bones")),
    };
    format!(
        "{tier}bounded biharmonic weights on {domain} of {} vertices, within {:.1e} of the optimal ones{missed}, \
         at most {:.3} of a weight dropped ({:.4} in the mean)",
        grouped(record.domain_vertices),
        record.error_bound,
        record.max_dropped,
        record.mean_dropped
    )
}

fn draw(path: &Path, args: &BindArgs, character: Character, talk: Talk) -> Result<(), Failure> {
    let by = if let Some(name) = &args.picture_of {
        let names: Vec<String> = character.skeleton.bones().iter().map(|bone| bone.name.clone()).collect();
        let of = handle_of(name, &names)?;
        let weights = dense(&character)?;
        write_weight_picture(path, &WeightPicture { mesh: &character.mesh, weights: &weights, names: &names, of })?
    } else {
        let (actor, warning) = Actor::of_character(&args.mesh.display().to_string(), character);
        warning.iter().for_each(|w| eprintln!("note: {w}"));
        let Some(shape) = &actor.shape else { return Ok(()) };
        pictures::write_picture(path, &actor, &shape.positions, &shape.normals)?
    };
    if !talk.quiet {
        println!("{}: {by}", path.display());
    }
    Ok(())
}

/// A character's weights as a matrix, a column for each bone.
fn dense(character: &Character) -> Result<WeightMatrix, Failure> {
    let (vertices, bones) = (character.mesh.vertices.len(), character.skeleton.len());
    let mut values = vec![0.0; vertices * bones];
    for vertex in 0..vertices {
        for (bone, weight) in character.influences.of_vertex(vertex) {
            values[usize::from(bone) * vertices + vertex] += f64::from(weight);
        }
    }
    WeightMatrix::from_columns(vertices, bones, &values)
        .ok_or_else(|| Failure::not_converged("the weights make no matrix", "this is a defect; please report it"))
}
