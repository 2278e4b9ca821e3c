//! `armature volume`

mod report;

use std::path::Path;

use armature_formats::mesh::{CellData, CellMesh, write_mesh, write_msh, write_vtu};
use armature_geometry::TriangleMesh;
use armature_geometry::orientation::orient_patches;
use armature_geometry::volume::{Resolution, VolumeConstraints, VolumeSettings};
use armature_geometry::winding::FastWindingNumber;

use self::report::{Told, flat_report, solid_report};
use crate::characters::volumes::{Handles, Made, make, make_failure};
use crate::cli::args::{VolumeArgs, VolumeRequirement};
use crate::cli::names::VOLUME_VERTICES;
use crate::failure::Failure;
use crate::files::{self, inputs};
use crate::pictures::slice::{Axis, Slice, SliceCells, SlicePlane, draw_slice};
use crate::terminal::{Bar, Talk, aside, counted, out};

/// Width and height of the slice's picture, pixels.
const SLICE_SIZE: [u32; 2] = [1280, 960];
/// Name of the cell data in the files.
const WINDING: &str = "winding number";

/// Makes the volume of a mesh, writes it, and reports its quality.
pub fn volume(args: &VolumeArgs, talk: Talk) -> Result<(), Failure> {
    let write = writer(&args.output)?;
    args.overwrite.check(&args.output)?;
    args.slice.as_deref().map_or(Ok(()), |path| args.overwrite.check(path))?;
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh");
    let model = inputs::model(&args.mesh)?;
    let handles = Handles::read(&model, args.skeleton.as_deref(), args.points.as_deref())?;
    let flat = armature_geometry::planar::plane_of(&model.mesh).is_ok_and(|plane| plane.is_some());
    if flat && !args.require.is_empty() {
        return Err(Failure::usage(
            format!("{} is flat, and --require is about volumes", args.mesh.display()),
            "leave --require out",
        ));
    }
    let resolution = match (args.conforming, args.vertices) {
        (false, Some(vertices)) => Resolution::Embedded { vertices },
        (false, None) if !flat => Resolution::Embedded { vertices: VOLUME_VERTICES },
        // The triangles of a flat figure have a good default size of their own.
        _ => Resolution::Conforming,
    };
    let mut progress = bar.stages();
    let asks = |what| args.require.contains(&what);
    let constraints =
        VolumeConstraints { facets: asks(VolumeRequirement::Facets), manifold: asks(VolumeRequirement::Manifold) };
    let settings = VolumeSettings { resolution, constraints, ..VolumeSettings::default() };
    let made = make(&model.mesh, &handles, &settings, &mut progress).map_err(|e| make_failure(&e, &args.mesh))?;
    drop(progress);
    bar.finish();
    let (cells, winding) = cells_of(&made);
    let data = [CellData { name: WINDING, values: winding }];
    let text = write(&cells, &data)?;
    args.overwrite.write(&args.output, text.as_bytes())?;
    let told = match &made {
        Made::Solid(volume) => solid_report(volume, &handles, resolution),
        Made::Flat(flat) => flat_report(flat, &handles),
    };
    say(args, &told, talk, start.elapsed().as_secs_f64());
    if let Some(path) = &args.slice {
        write_slice(path, args, &model.mesh, &made)?;
    }
    Ok(())
}

type Writer = fn(&CellMesh, &[CellData]) -> Result<String, Failure>;

/// The format by the file's extension, checked before the work is done.
fn writer(path: &Path) -> Result<Writer, Failure> {
    match files::extension_of(path).as_str() {
        "mesh" => Ok(|mesh, _| Ok(write_mesh(mesh))),
        "msh" => Ok(|mesh, data| write_msh(mesh, data).map_err(|e| defect(&e))),
        "vtu" => Ok(|mesh, data| write_vtu(mesh, data).map_err(|e| defect(&e))),
        _ => Err(Failure::usage(
            format!("{} is not a volume file", path.display()),
            "volumes are written as .mesh (Medit), .msh (Gmsh) and .vtu (VTK, ParaView)",
        )),
    }
}

fn defect(error: &armature_formats::mesh::CellDataLength) -> Failure {
    Failure::not_converged(error.to_string(), "this is a defect; please report it")
}

fn cells_of(made: &Made) -> (CellMesh<'_>, &[f64]) {
    match made {
        Made::Solid(volume) => (CellMesh::of_tetrahedra(&volume.mesh, &[]), &volume.winding),
        Made::Flat(flat) => (CellMesh::of_triangles(&flat.mesh), &flat.domain.winding),
    }
}

fn say(args: &VolumeArgs, told: &Told, talk: Talk, seconds: f64) {
    if args.json {
        let mut value = told.json.clone();
        value["file"] = args.output.display().to_string().into();
        value["seconds"] = seconds.into();
        value["warnings"] = told.warnings.clone().into();
        out!("{value}");
        return;
    }
    if talk.quiet {
        return;
    }
    out!("{}: {}; {seconds:.2} s", args.output.display(), told.summary);
    told.lines.iter().for_each(|line| out!("  {line}"));
    told.warnings.iter().for_each(|warning| aside!("note: {warning}"));
}

/// Cuts the volume and draws the slice.
fn write_slice(path: &Path, args: &VolumeArgs, mesh: &TriangleMesh, made: &Made) -> Result<(), Failure> {
    let unusable = |e: &dyn std::fmt::Display| Failure::input(format!("{}: {e}", args.mesh.display()), "");
    let (low, high) = mesh.bounds().ok_or_else(|| unusable(&"there is nothing to draw"))?;
    let axis = args.slice_axis.unwrap_or_else(|| Axis::across_shortest(low, high));
    let k = axis.index();
    let plane = SlicePlane { axis, position: low[k] + args.slice_at * (high[k] - low[k]) };
    let name = files::name_of(&args.mesh);
    let (title, cells, winding, surface) = match made {
        Made::Solid(volume) => {
            let oriented = orient_patches(mesh).map_err(|e| unusable(&e))?.mesh;
            let field = FastWindingNumber::precompute(&oriented).map_err(|e| unusable(&e))?;
            let count = counted(volume.mesh.tetrahedra.len(), "tetrahedron", "tetrahedra");
            (format!("{name}: {count}"), SliceCells::Tetrahedra(&volume.mesh), &volume.winding, Some((oriented, field)))
        }
        Made::Flat(flat) => {
            let count = counted(flat.mesh.triangles.len(), "triangle", "triangles");
            (format!("{name}: {count}"), SliceCells::Triangles(&flat.mesh), &flat.domain.winding, None)
        }
    };
    let surface = surface.as_ref().map(|(mesh, field)| (mesh, field));
    let picture =
        draw_slice(&Slice { cells, winding, surface, plane, title: &title }, SLICE_SIZE).map_err(|e| unusable(&e))?;
    let png = armature_render::encode_png(&picture)
        .map_err(|e| Failure::not_converged(format!("{}: {e}", path.display()), ""))?;
    args.overwrite.write(path, &png)?;
    if !args.json {
        out!("{}: slice at {} = {:.5}", path.display(), axis.name(), plane.position);
    }
    Ok(())
}
