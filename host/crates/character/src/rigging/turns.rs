//! How a template may stand in a mesh: which way is up, which way is front, and how symmetric the mesh is to that.

use glam::{DMat3, DQuat, DVec3};

use super::error::RigError;
use super::interior::Interior;
use super::settings::RigSettings;

/// Planes of symmetry are looked for at this many angles about each vertical.
const ANGLES: usize = 36;
/// A plane between the axes must fit better than those of the axes by this.
const CLEARLY: f64 = 0.04;
/// Cosine of an angle below which two directions count as one line.
const SAME_LINE: f64 = 0.999;

/// Turns `mesh_from_template` and the symmetry of the mesh between left and right, 0 to 1; the usual one first.
pub(super) fn turns(interior: &Interior, settings: &RigSettings) -> Result<Vec<(DMat3, f64)>, RigError> {
    let unit = |way: Option<[f64; 3]>| way.and_then(|way| DVec3::from(way).try_normalize());
    let (up, front) = (unit(settings.up), unit(settings.front));
    if let (Some(up), Some(front)) = (up, front)
        && up.dot(front).abs() > SAME_LINE
    {
        return Err(RigError::FrontAlongUp);
    }
    let axes = [DVec3::Y, DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::NEG_Y];
    let ups: Vec<DVec3> = match (up, front) {
        (Some(up), _) => vec![up],
        (None, Some(front)) => across(front),
        (None, None) => axes.to_vec(),
    };
    let middle = interior.centroid();
    let mut turns: Vec<(DMat3, f64)> = Vec::new();
    for up in ups {
        let mut fronts = front.map_or_else(|| across(up), |front| vec![front]);
        if front.is_none() {
            fronts.extend(plane_between(interior, middle, up, &fronts).into_iter().flatten());
        }
        for front in fronts {
            let front = (front - front.dot(up) * up).normalize_or_zero();
            let left = up.cross(front);
            if left.length_squared() > 0.5 {
                turns.push((DMat3::from_cols(left, up, front), 0.0));
            }
        }
    }
    let mut known: Vec<(DVec3, f64)> = Vec::new();
    for (turn, symmetry) in &mut turns {
        let same = known.iter().find(|(normal, _)| normal.dot(turn.x_axis).abs() > SAME_LINE).map(|found| found.1);
        *symmetry = same.unwrap_or_else(|| interior.symmetry(middle, turn.x_axis, 1));
        known.push((turn.x_axis, *symmetry));
    }
    Ok(turns)
}

/// Four directions across `axis`, the usual front (or up) first if it is one of them.
fn across(axis: DVec3) -> Vec<DVec3> {
    let usual = [DVec3::Z, DVec3::Y, DVec3::X].into_iter().find(|way| way.dot(axis).abs() < 0.7).unwrap_or(DVec3::X);
    let first = (usual - usual.dot(axis) * axis).normalize_or_zero();
    let second = axis.cross(first);
    vec![first, -first, second, -second]
}

/// The two fronts along a vertical plane of symmetry that is not one of the `fronts`' own.
fn plane_between(interior: &Interior, middle: DVec3, up: DVec3, fronts: &[DVec3]) -> Option<[DVec3; 2]> {
    const EVERY: usize = 7;
    let first = *fronts.first()?;
    let symmetry = |angle: f64| {
        let front = DQuat::from_axis_angle(up, angle) * first;
        interior.symmetry(middle, up.cross(front), EVERY)
    };
    let step = std::f64::consts::PI / ANGLES as f64;
    let of_axes = symmetry(0.0).max(symmetry(std::f64::consts::FRAC_PI_2));
    let angles = (1..ANGLES).map(|k| k as f64 * step);
    let (mut angle, mut best) = angles.map(|angle| (angle, symmetry(angle))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    for fine in [0.4, -0.4, 0.2, -0.2, 0.1, -0.1] {
        let tried = symmetry(angle + fine * step);
        if tried > best {
            (angle, best) = (angle + fine * step, tried);
        }
    }
    let front = DQuat::from_axis_angle(up, angle) * first;
    (best > of_axes + CLEARLY).then_some([front, -front])
}
