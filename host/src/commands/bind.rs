//! `armature bind`

use std::path::Path;

use armature_character::bind::{BindMethod, BindSettings};
use armature_character::handle_weights::{BiharmonicTier, DomainKind, WeightsOn};
use armature_character::{Character, MonotoneRecord, Provenance, SkinKind, SolvedRecord, WeightsRecord};
use armature_weights::WeightMatrix;

use super::rig::tell_doubts;
use super::weights::problem_words;
use crate::characters::{Given, LoadedCharacter, rigging};
use crate::cli::rig_args::TemplateArgs;
use crate::cli::weight_args::{BindArgs, Method};
use crate::failure::Failure;
use crate::files::inputs;
use crate::pictures::weights::{WeightPicture, handle_of, write_weight_picture};
use crate::terminal::{Bar, Talk, aside, counted, grouped, out};
use crate::{characters, pictures};

/// Binds a mesh to a skeleton and saves the character.
pub fn bind(args: &BindArgs, talk: Talk) -> Result<(), Failure> {
    if args.template.is_none() && args.how != TemplateArgs::default() {
        return Err(Failure::usage(
            "--up, --front and --no-symmetry say how a template is fitted",
            "leave them out, or give a --template",
        ));
    }
    if args.method == Method::Heat {
        args.release.refuse_for_heat()?;
    }
    if !args.skin.stretches() && (args.endpoints.is_some() || !args.twist_curve.is_empty()) {
        return Err(Failure::usage(
            format!("--endpoints and --twist-curve are for skins that stretch and twist, not for {}", args.skin),
            "add --skin stretch-twist, or leave them out",
        ));
    }
    args.order.refuse_unless(args.method == Method::Monotone)?;
    args.overwrite.check(&args.output)?;
    args.picture.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let mut model = inputs::model(&args.mesh)?;
    let mut filled = Vec::new();
    if args.fill_holes {
        if model.rig.is_some() && !args.replace_rig {
            return Err(Failure::usage(
                format!("{} keeps its own weights, and new surface would have none", args.mesh.display()),
                "add --replace-rig, or leave out --fill-holes",
            ));
        }
        (model, filled) = characters::filled::fill_before_binding(&model, &args.mesh, &mut bar.stages())?;
    }
    if args.smooth_weights.is_some() && (model.rig.is_none() || args.replace_rig) {
        return Err(Failure::usage(
            format!("{} brings no weights that are kept, and computed ones are smooth", args.mesh.display()),
            "leave out --smooth-weights",
        ));
    }
    let settings = BindSettings {
        replace_rig: args.replace_rig,
        max_influences: args.influences.unwrap_or(args.method.influences()),
        // Only what these change gets another place in the cache.
        limit_painted: args.influences.filter(|_| model.rig.is_some() && !args.replace_rig),
        bind_unbound: model.rig.as_ref().is_some_and(|rig| !rig.unbound.is_empty()),
        transfer: args.transfer.clone(),
        method: args.method.for_bind(args.order.order()),
        on: args.domain.volume_or_asked(),
        joint_release: args.release.share(),
        smooth_weights: args.smooth_weights,
        skin: args.skin,
        endpoints: args.endpoints,
        twist_curves: args.twist_curve.clone(),
        ..BindSettings::default()
    };
    let mut fit = None;
    let skeleton = match (&args.skeleton, &args.template) {
        (_, Some(template)) => {
            if model.rig.is_some() && !args.replace_rig {
                return Err(Failure::usage(
                    format!("{} has a skeleton of its own", args.mesh.display()),
                    "leave out --template, or add --replace-rig",
                ));
            }
            let found = rigging::fitted(&args.mesh, &model.mesh, template, &args.how.settings(), &mut bar.stages())?;
            Some(Given::Fitted(&fit.insert(found).skeleton))
        }
        (Some(path), None) => Some(Given::File(path)),
        (None, None) => None,
    };
    let added: &[u8] = if args.fill_holes { b"holes filled, version 1" } else { b"" };
    let bound =
        characters::bind_cached(model, added, &args.mesh, skeleton, &settings, !args.no_cache, &mut bar.stages())?;
    bar.finish();
    let character = bound.character;
    args.overwrite.write(&args.output, &armature_character::cache::to_bytes(&character))?;
    if !talk.quiet {
        fit.iter().for_each(tell_doubts);
        for warning in filled.iter().chain(&character.warnings) {
            aside!("note: {warning}");
        }
        let cache = if bound.from_cache { " (from the cache)" } else { "" };
        out!(
            "{}: {}, {}, {}; {}; {:.2} s{cache}",
            args.output.display(),
            counted(character.surface.mesh.vertices.len(), "vertex", "vertices"),
            counted(character.surface.mesh.triangles.len(), "triangle", "triangles"),
            counted(character.skeleton.len(), "bone", "bones"),
            how_made(&character.provenance) + &skin_words(&character),
            start.elapsed().as_secs_f64(),
        );
    }
    match &args.picture {
        Some(path) => draw(path, args, character, talk),
        None => Ok(()),
    }
}

/// What binding with these settings computes, in words.
pub(super) fn planned_words(settings: &BindSettings) -> String {
    let method = match settings.method {
        BindMethod::Biharmonic(_) => "bounded biharmonic weights",
        BindMethod::Monotone { .. } => "monotone weights",
        BindMethod::BoneHeat => return "bone heat weights on the surface".into(),
    };
    match settings.on {
        WeightsOn::Volume { vertices } => format!("{method} on a volume of about {} vertices", grouped(vertices)),
        WeightsOn::OwnElements => format!("{method} on the mesh's own elements"),
        WeightsOn::Surface => format!("{method} on the surface"),
    }
}

/// How weights were made, in words.
pub(super) fn how_made(provenance: &Provenance) -> String {
    match provenance.record() {
        None => "weights of the artist".to_owned(),
        Some(WeightsRecord::BoneHeat(heat)) => format!(
            "bone heat weights, residual {:.1e}, at most {:.3} of a weight dropped",
            heat.residual, heat.max_dropped
        ),
        Some(WeightsRecord::Biharmonic(record)) => {
            let tier = match record.tier {
                BiharmonicTier::Interactive => "",
                BiharmonicTier::Certified => "certified ",
            };
            solved_words(&format!("{tier}bounded biharmonic weights"), record)
        }
        Some(WeightsRecord::Monotone(MonotoneRecord { order, spurious, solved })) => {
            let extrema = match spurious {
                0 => "no spurious extrema".to_owned(),
                count => format!("{} made by scaling", counted(*count, "spurious extremum", "spurious extrema")),
            };
            format!("{}, {extrema}", solved_words(&format!("monotone weights of order {order}"), solved))
        }
    }
}

/// How the skin follows the bones, in words; empty for linear blending.
fn skin_words(character: &Character) -> String {
    match (character.skin, &character.surface.endpoints) {
        (SkinKind::Linear, None) => String::new(),
        (kind, None) => format!("; skin {kind}"),
        (kind, Some(endpoints)) => format!("; skin {kind}, endpoint weights by {}", endpoints.method),
    }
}

fn solved_words(method: &str, record: &SolvedRecord) -> String {
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
        "{method} on {domain} of {} vertices ({}), within {:.1e} of the optimal ones of this \
         problem{missed}, at most {:.3} of a weight dropped ({:.4} in the mean)",
        grouped(record.domain_vertices),
        problem_words(Some(record.joint_release), record.flat_elements),
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
        write_weight_picture(
            args.overwrite,
            path,
            &WeightPicture { mesh: &character.surface.mesh, weights: &weights, names: &names, of, extrema: &[] },
        )?
    } else {
        let (character, warnings) = LoadedCharacter::bound(&args.mesh.display().to_string(), character);
        warnings.iter().for_each(|w| aside!("note: {w}"));
        let Some(shape) = &character.shape else { return Ok(()) };
        pictures::write_picture(args.overwrite, path, &character, &shape.positions, shape.normals())?
    };
    if !talk.quiet {
        out!("{}: {by}", path.display());
    }
    Ok(())
}

/// A character's weights as a matrix, a column for each bone.
fn dense(character: &Character) -> Result<WeightMatrix, Failure> {
    let (vertices, bones) = (character.surface.mesh.vertices.len(), character.skeleton.len());
    let mut values = vec![0.0; vertices * bones];
    for vertex in 0..vertices {
        for (bone, weight) in character.surface.influences.of_vertex(vertex) {
            values[usize::from(bone) * vertices + vertex] += f64::from(weight);
        }
    }
    WeightMatrix::from_columns(vertices, bones, &values)
        .ok_or_else(|| Failure::not_converged("the weights form no matrix", "this is a defect; please report it"))
}
