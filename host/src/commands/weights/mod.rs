//! `armature weights`

mod report;

use std::ops::ControlFlow;
use std::path::Path;

use armature_character::handle_weights::{
    HandlePlace, HandleShape, HandleWeights, HandleWeightsSettings, Held, SpuriousExtrema, SpuriousExtremum, WeightsOn,
    handle_weights, surface_extrema,
};
use armature_formats::model::Model;
use armature_formats::tables::NumberTable;
use armature_weights::handles::HandleBoundary;
use armature_weights::heat::{BoneHeat, BoneHeatError, BoneHeatSettings, bone_heat};
use armature_weights::{BoneSegment, WeightMatrix};

pub(super) use self::report::problem_words;
use self::report::{say_heat, say_solved};
use crate::characters::{self, volumes::check_fit};
use crate::cli::weight_args::{HandleMethod, WeightsArgs};
use crate::failure::Failure;
use crate::files::tables::{read_table, table_writer};
use crate::files::{self, inputs};
use crate::pictures::function::Dot;
use crate::pictures::weights::{WeightPicture, handle_of, write_weight_picture};
use crate::terminal::{Bar, Talk, aside, out};

/// Computes the weights of handles, writes them, and reports their quality.
pub fn weights(args: &WeightsArgs, talk: Talk) -> Result<(), Failure> {
    let write = table_writer(&args.output, "weights")?;
    args.overwrite.check(&args.output)?;
    args.picture.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let model = inputs::model(&args.mesh)?;
    let held = OwnedHeld::read(args, &model, talk)?;
    let names = held.names();
    let of = args.picture_of.as_deref().map(|name| handle_of(name, &names)).transpose()?.flatten();
    let made = compute(args, &model, &held, &mut bar.stages())?;
    bar.finish();
    let weights = made.weights();
    let values = weights.to_columns().ok_or_else(|| {
        let (vertices, handles) = (weights.vertices(), weights.bones());
        Failure::input(
            format!("there is not enough memory for a table of {vertices} vertices by {handles} handles"),
            "give fewer handles, or bind the mesh, which keeps only the heaviest",
        )
    })?;
    args.overwrite
        .write(&args.output, &write(&NumberTable { rows: weights.vertices(), columns: weights.bones(), values }))?;
    let seconds = start.elapsed().as_secs_f64();
    match &made {
        Made::Solved(made) => say_solved(args, made, &names, talk, seconds),
        Made::Heat(made, spurious) => say_heat(args, (made, spurious), &names, talk, seconds),
    }
    if let Some(path) = &args.picture {
        let by = write_weight_picture(
            args.overwrite,
            path,
            &WeightPicture { mesh: &model.mesh, weights, names: &names, of, extrema: &made.dots(of) },
        )?;
        if !talk.quiet && !args.json {
            out!("{}: {by}", path.display());
        }
    }
    match made.shortfall() {
        None => Ok(()),
        Some(what) => Err(Failure::not_converged(
            format!("{}: {what}; the best found were written", args.mesh.display()),
            "the report says how far off they can be; repair slivers of the mesh, or give more distance to handles",
        )),
    }
}

/// What is held, as read from files.
enum OwnedHeld {
    Shapes { shapes: Vec<HandleShape>, cage: Vec<[usize; 2]> },
    Boundary(HandleBoundary),
}

impl OwnedHeld {
    fn read(args: &WeightsArgs, model: &Model, talk: Talk) -> Result<Self, Failure> {
        match (&args.boundary, &args.handles) {
            (Some(files), _) => match files.as_slice() {
                [fixed, given] => read_boundary(fixed, given, model).map(Self::Boundary),
                _ => Err(Failure::usage("--boundary takes two files", "give --boundary b.npy bc.npy")),
            },
            (None, Some(path)) => read_handles(path, model, talk),
            (None, None) => Err(Failure::usage("there are no handles", "give --handles HANDLES.tgf")),
        }
    }

    fn names(&self) -> Vec<String> {
        match self {
            Self::Shapes { shapes, .. } => shapes.iter().map(|shape| shape.name.clone()).collect(),
            Self::Boundary(boundary) => (1..=boundary.handles).map(|handle| format!("handle_{handle}")).collect(),
        }
    }
}

/// Points that no bone touches, then bones; and cage edges between points.
fn read_handles(path: &Path, model: &Model, talk: Talk) -> Result<OwnedHeld, Failure> {
    let file = path.display().to_string();
    if files::extension_of(path) != "tgf" {
        return Err(Failure::usage(format!("{file} is not a TGF file"), "handles are read from .tgf"));
    }
    let graph = armature_formats::skeleton::read_tgf(&files::read(path)?).map_err(|e| e.in_file(&file))?;
    if graph.unread_lines > 0 && !talk.quiet {
        aside!("note: {file}: everything after its second # is ignored; cages are given by their edges");
    }
    let bones: Vec<[[f64; 3]; 2]> = graph.edges.iter().map(|ends| ends.map(|point| graph.points[point])).collect();
    // A bone without length holds like a point, and a point may be anywhere.
    let is_short = |[head, tail]: &[[f64; 3]; 2]| glam::DVec3::from(*head) == glam::DVec3::from(*tail);
    let long: Vec<_> = bones.iter().copied().filter(|bone| !is_short(bone)).collect();
    check_fit(&file, &long, &model.mesh)?;
    let mut touched = vec![false; graph.points.len()];
    graph.edges.iter().flatten().for_each(|&point| touched[point] = true);
    let alone: Vec<usize> = (0..graph.points.len()).filter(|&point| !touched[point]).collect();
    let points = alone.iter().map(|&point| HandleShape {
        name: format!("point_{}", point + 1),
        place: HandlePlace::Point(graph.points[point]),
    });
    let bones = bones.iter().enumerate().map(|(edge, bone)| {
        let place = if is_short(bone) { HandlePlace::Point(bone[0]) } else { HandlePlace::Segments(vec![*bone]) };
        HandleShape { name: format!("bone_{}", edge + 1), place }
    });
    let handle_of = |point: usize| {
        alone.binary_search(&point).map_err(|_| {
            let what = format!("{file}: node {} belongs to a bone and to a cage", point + 1);
            Failure::input(what, "give the cage nodes of its own; a bone's ends move with it")
        })
    };
    let edge = |&[a, b]: &[usize; 2]| Ok([handle_of(a)?, handle_of(b)?]);
    let cage = graph.cage_edges.iter().map(edge).collect::<Result<_, Failure>>()?;
    Ok(OwnedHeld::Shapes { shapes: points.chain(bones).collect(), cage })
}

fn read_boundary(fixed_file: &Path, given_file: &Path, model: &Model) -> Result<HandleBoundary, Failure> {
    let bad = |path: &Path, what: String, remedy: &str| Failure::input(format!("{}: {what}", path.display()), remedy);
    let fixed = read_table(fixed_file)?;
    let count = model.mesh.vertices.len();
    let indices = fixed.indices().filter(|all| all.iter().all(|&vertex| vertex < count));
    let indices = indices.ok_or_else(|| {
        bad(
            fixed_file,
            format!("it does not hold vertices of the mesh, from 0 to {}", count.saturating_sub(1)),
            "save their indices, counted from 0",
        )
    })?;
    let given = read_table(given_file)?;
    if given.rows != indices.len() || given.columns == 0 {
        let what = format!("{} × {} weights for {} fixed vertices", given.rows, given.columns, indices.len());
        return Err(bad(given_file, what, "give a row for each fixed vertex and a column for each handle"));
    }
    Ok(HandleBoundary { fixed: indices, fixed_weights: given.values, handles: given.columns })
}

/// Weights by any method.
enum Made {
    Solved(Box<HandleWeights>),
    Heat(Box<BoneHeat>, SpuriousExtrema),
}

impl Made {
    fn weights(&self) -> &WeightMatrix {
        match self {
            Self::Solved(made) => &made.weights,
            Self::Heat(made, _) => &made.weights,
        }
    }

    /// Spurious extrema of the written weights of one handle, or of all.
    fn dots(&self, of: Option<usize>) -> Vec<Dot> {
        let spurious = match self {
            Self::Solved(made) => &made.spurious,
            Self::Heat(_, spurious) => spurious,
        };
        let shown = spurious.last().iter().enumerate().filter(|(handle, _)| of.is_none_or(|of| of == *handle));
        let dot = |one: &SpuriousExtremum| Dot { place: one.place, is_minimum: one.extremum.is_minimum };
        shown.flat_map(|(_, all)| all.iter().map(dot)).collect()
    }

    /// What did not become as accurate as requested; `None` if everything did.
    fn shortfall(&self) -> Option<String> {
        match self {
            Self::Solved(made) if !made.converged() => Some(if made.certificates.together() {
                "all handles solved together did not converge".to_owned()
            } else {
                format!("the weights of {} handles did not converge", made.unconverged())
            }),
            _ => None,
        }
    }
}

fn compute(
    args: &WeightsArgs,
    model: &Model,
    held: &OwnedHeld,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Made, Failure> {
    args.order.refuse_unless(matches!(args.method, HandleMethod::Monotone | HandleMethod::MonotoneExact))?;
    if args.method == HandleMethod::Heat {
        let made = compute_heat(args, model, held, progress)?;
        let spurious = surface_extrema(&model.mesh, &made.weights);
        let spurious = spurious.map_err(|e| Failure::input(format!("{}: {e}", args.mesh.display()), ""))?;
        return Ok(Made::Heat(Box::new(made), spurious));
    }
    let own = model.tetrahedra.is_some() || matches!(held, OwnedHeld::Boundary(_));
    let on = if own { args.domain.weights_on(WeightsOn::OwnElements) } else { args.domain.volume_or_asked() };
    let held = match held {
        OwnedHeld::Shapes { shapes, cage } => Held::Shapes { shapes, cage },
        OwnedHeld::Boundary(_) if on != WeightsOn::OwnElements => {
            return Err(Failure::usage(
                "--boundary fixes vertices of the mesh itself, so the mesh's own elements are used",
                "leave out --on and --vertices",
            ));
        }
        OwnedHeld::Boundary(boundary) => Held::Boundary(boundary),
    };
    let partition = args.method.partition(args.no_normalize);
    let joint_release = args.release.share();
    let method = args.method.of_order(args.order.order());
    let settings = HandleWeightsSettings { method, tier: args.method.tier(), on, partition, joint_release };
    let made = handle_weights(&model.mesh, model.tetrahedra.as_ref(), held, &settings, progress);
    made.map(|made| Made::Solved(Box::new(made))).map_err(|e| characters::weights_failure(&args.mesh, &e))
}

fn compute_heat(
    args: &WeightsArgs,
    model: &Model,
    held: &OwnedHeld,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<BoneHeat, Failure> {
    args.release.refuse_for_heat()?;
    let OwnedHeld::Shapes { shapes, cage } = held else {
        return Err(Failure::usage(
            "bone heat takes bones and points, no fixed vertices",
            "give --handles HANDLES.tgf",
        ));
    };
    if !cage.is_empty() {
        return Err(Failure::usage("bone heat takes bones and points, no cages", "leave out --method heat"));
    }
    let bone = |shape: &HandleShape| match &shape.place {
        HandlePlace::Segments(all) => all.iter().map(|&[head, tail]| BoneSegment { head, tail }).collect(),
        HandlePlace::Point(point) => vec![BoneSegment { head: *point, tail: *point }],
    };
    let bones: Vec<BoneSegment> = shapes.iter().flat_map(bone).collect();
    let made = bone_heat(&model.mesh, &bones, &BoneHeatSettings::default(), progress);
    made.map_err(|error| {
        let what = format!("{}: {error}", args.mesh.display());
        match error {
            BoneHeatError::Cancelled { .. } => Failure::usage(what, ""),
            BoneHeatError::Factorisation(_) | BoneHeatError::Inaccurate { .. } => Failure::not_converged(what, ""),
            _ => Failure::input(what, format!("`armature inspect {}` says more", args.mesh.display())),
        }
    })
}
