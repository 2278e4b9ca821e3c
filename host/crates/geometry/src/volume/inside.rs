//! Which tetrahedra are inside.

use std::ops::ControlFlow;

use super::closed_winding::closed_winding;
use super::elements::Elements;
use super::error::VolumeError;
use super::input::VolumeSettings;
use super::peel::{longest_edge_of, peel};
use super::strays::{Needed, drop_strays};
use super::tessellate::Tessellation;
use crate::segmentation::{
    ConstraintInput, ConstraintSettings, ElementWindingSettings, Label, connect_vertices, element_winding, graph_cut,
    make_manifold, satisfy_facets,
};
use crate::surface::connected_components;
use crate::winding::FastWindingNumber;

/// Around an open surface the winding number is smooth and nowhere an integer, and the barycentre is good enough. Only
/// where it jumps across a facet that is not on the surface, because a facet is missing, does an element need more points.
const RULE: ElementWindingSettings = ElementWindingSettings { from_integer: 0.5, from_neighbour: 0.1, refinements: 0 };

/// An inside of no more than this share of the convex hull is due to rounding.
const NOTHING: f64 = 1e-9;
/// The multiple of its longest edge cubed that is added to the volume of an element that is to join bones.
const SLENDER: f64 = 0.01;

/// Mean winding numbers and labels of elements.
pub(super) struct Inside {
    pub(super) winding: Vec<f64>,
    pub(super) labels: Vec<bool>,
}

/// Labels from the winding number and the graph cut, then whatever else must be inside: connected bones, and with
/// `every_vertex` an element at each vertex of the shell.
pub(super) fn find_inside(
    whole: &mut Tessellation,
    field: &FastWindingNumber,
    every_vertex: bool,
    settings: &VolumeSettings,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Inside, VolumeError> {
    let closed = closed_winding(
        &mut whole.bulk.triangulation,
        &whole.constraints,
        &whole.elements,
        &whole.triangles,
        &whole.constraint_of,
        &|p| field.evaluate(p),
    );
    whole.report.closed = closed.as_ref().is_some_and(|known| known.iter().all(Option::is_some));
    let elements = &whole.elements;
    let known = closed.unwrap_or_else(|| vec![None; elements.tetrahedra.len()]);
    let winding = completed(elements, known, field, &mut |done| progress(0.5 * done))?;
    let mut told = |_: &str, done| progress(0.5 + 0.4 * done);
    let cut = graph_cut(&winding, &elements.neighbours, &elements.areas, &settings.segmentation, &mut told)?;
    let mut labels = cut.inside;
    let needed = Needed::of(whole, every_vertex);
    whole.report.flat_elements_left_out = peel(elements, &needed.either(), &mut labels);
    if every_vertex {
        whole.report.elements_for_vertices = hold_vertices(whole, &winding, &mut labels);
    }
    let strays = drop_strays(&whole.elements, &needed, &mut labels);
    whole.report.pieces_left_out = strays.left_out;
    whole.report.elements_for_vertices += strays.bridges;
    let elements = &whole.elements;
    let volume_inside: f64 = elements.volumes.iter().zip(&labels).filter(|(_, inside)| **inside).map(|(v, _)| v).sum();
    if volume_inside <= NOTHING * elements.volumes.iter().sum::<f64>() {
        return Err(VolumeError::Empty);
    }
    let mut told = |done| progress(0.9 + 0.02 * done);
    if settings.constraints.facets {
        labels = constrain(whole, &winding, &labels, None, settings, &mut told)?;
    }
    let mut told = |done| progress(0.92 + 0.05 * done);
    labels = connect(whole, &winding, &labels, &mut told)?;
    if settings.constraints.manifold {
        let kept = labels.clone();
        let mut told = |done| progress(0.97 + 0.03 * done);
        labels = constrain(whole, &winding, &kept, Some(&kept), settings, &mut told)?;
    }
    whole.report.winding_error = winding_error(&whole.elements.volumes, &winding, &labels);
    Ok(Inside { winding, labels })
}

/// The winding number of all elements, integrated over those where it is not known.
fn completed(
    elements: &Elements,
    known: Vec<Option<f64>>,
    field: &FastWindingNumber,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<f64>, VolumeError> {
    let unknown: Vec<usize> = (0..known.len()).filter(|&element| known[element].is_none()).collect();
    let mut winding: Vec<f64> = known.into_iter().map(|w| w.unwrap_or(0.0)).collect();
    if unknown.is_empty() {
        return Ok(winding);
    }
    let mut index_of = vec![u32::MAX; winding.len()];
    unknown.iter().enumerate().for_each(|(index, &element)| index_of[element] = index as u32);
    let tetrahedra: Vec<[u32; 4]> = unknown.iter().map(|&element| elements.tetrahedra[element]).collect();
    let open = elements.open_neighbours();
    let among = |n: u32| index_of.get(n as usize).copied().unwrap_or(u32::MAX);
    let neighbours: Vec<[u32; 4]> = unknown.iter().map(|&element| open[element].map(among)).collect();
    let (vertices, evaluate) = (&elements.vertices, |p| field.evaluate(p));
    let found =
        element_winding(vertices, &tetrahedra, &neighbours, &evaluate, &RULE, &mut |_, done| progress(done))?.means;
    unknown.into_iter().zip(found).for_each(|(element, mean)| winding[element] = mean);
    Ok(winding)
}

/// At each vertex of the shell without an inside element, makes the one with the largest winding number inside; returns
/// how many.
fn hold_vertices(whole: &Tessellation, winding: &[f64], labels: &mut [bool]) -> usize {
    let elements = &whole.elements;
    let mut best: Vec<Option<usize>> = vec![None; elements.vertices.len()];
    for (element, corners) in elements.tetrahedra.iter().enumerate() {
        for &corner in corners {
            let known = &mut best[corner as usize];
            let rank = |e: usize| (labels[e], winding[e]);
            let is_better =
                known.is_none_or(|k| rank(element).partial_cmp(&rank(k)).is_some_and(std::cmp::Ordering::is_gt));
            if is_better {
                *known = Some(element);
            }
        }
    }
    let mut added = 0;
    for vertex in whole.shell.iter().flatten() {
        if let Some(element) = best[*vertex as usize]
            && !labels[element]
        {
            labels[element] = true;
            added += 1;
        }
    }
    added
}

/// Labels for which connected bones are in one piece, and every point handle belongs to an inside element.
fn connect(
    whole: &mut Tessellation,
    winding: &[f64],
    labels: &[bool],
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<bool>, VolumeError> {
    let elements = &whole.elements;
    let mut groups = bone_groups(&whole.segments);
    groups.extend(whole.points.iter().map(|&point| vec![point]));
    let (tetrahedra, neighbours) = (&elements.tetrahedra, &elements.neighbours);
    // With their volume as cost, flat elements would make the cheapest chains.
    let bulk = |element: usize| elements.volumes[element] + SLENDER * longest_edge_of(elements, element).powi(3);
    let measures: Vec<f64> = (0..tetrahedra.len()).map(bulk).collect();
    let connected =
        connect_vertices(tetrahedra, neighbours, winding, &measures, labels, &groups, &mut |_, done| progress(done))?;
    whole.report.elements_for_bones = connected.added.iter().map(|chain| chain.elements.len()).sum();
    Ok(connected.inside)
}

/// Labels for which the recovered facets have an inside element; or, if `kept` elements stay inside, those of a
/// manifold boundary.
fn constrain(
    whole: &mut Tessellation,
    winding: &[f64],
    labels: &[bool],
    kept: Option<&[bool]>,
    settings: &VolumeSettings,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<bool>, VolumeError> {
    let elements = &whole.elements;
    let forced: Vec<Label> =
        (0..labels.len()).map(|e| if kept.is_some_and(|k| k[e]) { Label::Inside } else { Label::Free }).collect();
    let facets = if settings.constraints.facets { elements.locked_facets() } else { Vec::new() };
    let input = ConstraintInput {
        winding,
        neighbours: &elements.neighbours,
        facet_sizes: &elements.areas,
        inside: labels,
        forced: &forced,
        facets: &facets,
    };
    let how = ConstraintSettings { segmentation: settings.segmentation, ..ConstraintSettings::default() };
    let found = match kept {
        None => satisfy_facets(&input, &how, &mut |_, done| progress(done))?,
        Some(_) => make_manifold(&input, &elements.tetrahedra, &how, &mut |_, done| progress(done))?,
    };
    whole.report.elements_for_constraints += found.added;
    whole.report.constraints_unsatisfied = found.unsatisfied.len();
    Ok(found.inside)
}

/// `∫ u dV` (thesis equation 8.9) over the volume inside.
fn winding_error(volumes: &[f64], winding: &[f64], labels: &[bool]) -> f64 {
    let (mut inside, mut wrong) = (0.0, 0.0);
    for ((volume, w), &label) in volumes.iter().zip(winding).zip(labels) {
        inside += if label { *volume } else { 0.0 };
        wrong += volume * if label { (1.0 - w).max(0.0) } else { w.max(0.0) };
    }
    if inside > 0.0 { wrong / inside } else { 0.0 }
}

/// The vertices of bones connected through shared ends.
pub(super) fn bone_groups(runs: &[Vec<u32>]) -> Vec<Vec<u32>> {
    let mut numbers: Vec<u32> = runs.iter().flatten().copied().collect();
    numbers.sort_unstable();
    numbers.dedup();
    let index = |v: &u32| numbers.binary_search(v).unwrap_or(0) as u32;
    let steps = runs.iter().flat_map(|run| {
        let first = run.first().map(index);
        run.iter().filter_map(move |v| first.map(|first| (first, v)))
    });
    let joined: Vec<[u32; 3]> = steps.map(|(first, v)| [first, index(v), index(v)]).collect();
    let components = connected_components(numbers.len(), &joined);
    let mut groups = vec![Vec::new(); components.count];
    for (at, &vertex) in numbers.iter().enumerate() {
        groups[components.of_vertex[at] as usize].push(vertex);
    }
    groups
}
