//! A skeleton fitted into a human of about 50,000 triangles, beside the time of the volume that binding it needs.

use std::ops::ControlFlow;

use armature_character::bind::WEIGHT_VOLUME_VERTICES;
use armature_character::rigging::{RigSettings, Template, fit};
use armature_character::volume::make_volume;
use armature_geometry::simplify::simplify;
use armature_geometry::volume::{Resolution, VolumeInput, VolumeSettings};

use super::volume_growth::loop_subdivision;
use super::{Measurement, median, time_runs};
use crate::characters;
use crate::cli::args::BenchArgs;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &["rig/human", "rig/human-volume", "rig/human-ratio"];

const RUNS: usize = 3;
/// A closed surface has twice as many triangles.
const VERTICES: usize = 25_000;

pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
    let human = characters::find(characters::OWN[0], go_on)?.character;
    let Some(character) = human.character() else { return Ok(Vec::new()) };
    let defect = |error: &dyn std::fmt::Display| Failure::not_converged(format!("the benchmark failed: {error}"), "");
    let fine = loop_subdivision(&character.surface.mesh);
    let mesh = simplify(&fine, VERTICES, go_on).map_err(|e| defect(&e))?.mesh;
    let template = Template::human().map_err(|e| defect(&e))?;
    let mut fitted = Ok(());
    let rig = time_runs(RUNS, || {
        fitted = fit(&mesh, &template, &RigSettings::default(), &mut |_, _| ControlFlow::Continue(())).map(drop);
    });
    fitted.map_err(|e| defect(&e))?;
    let settings = VolumeSettings {
        resolution: Resolution::Embedded { vertices: WEIGHT_VOLUME_VERTICES },
        ..VolumeSettings::default()
    };
    let input = VolumeInput { surface: &mesh, segments: &[], points: &[] };
    let mut made = Ok(());
    let volume = time_runs(RUNS, || {
        made = make_volume(&input, &settings, &mut |_, _| ControlFlow::Continue(())).map(drop);
    });
    made.map_err(|e| defect(&e))?;
    let (rig, volume) = (median(&rig), median(&volume));
    Ok(vec![
        Measurement::new(NAMES[0], rig, "s", RUNS),
        Measurement::new(NAMES[1], volume, "s", RUNS),
        Measurement::new(NAMES[2], rig / volume, "of it", RUNS).at_most(1.0, "at most the volume's"),
    ])
}
