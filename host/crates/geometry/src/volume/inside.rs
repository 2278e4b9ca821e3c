//! Which tetrahedra are inside.

use std::ops::ControlFlow;

use super::closed_winding::closed_winding;
use super::peel::{longest_edge, peel};
use super::tessellate::Tessellation;
use super::{VolumeError, VolumeSettings};
use crate::{
    ConstraintInput, ConstraintSettings, ElementWindingSettings, FastWindingNumber, Label, connect_vertices,
    connected_components, element_winding, graph_cut, make_manifold, satisfy_facets,
};

/// Around an open surface the winding number is nowhere an integer, but smooth, and the barycentre is good enough; only
/// where it changes over a facet that is not of the surface, a facet is missing, and the element takes more points.
const RULE: ElementWindingSettings = ElementWindingSettings { from_integer: 0.5, from_neighbour: 0.1, refinements: 0 };

/// An inside with no more than this share of the convex hull is rounding.
const NOTHING: f64 = 1e-9;
/// What the cube of its longest edge adds to the volume of an element that is to join bones.
const SLENDER: f64 = 0.01;

/// Mean winding numbers and labels of elements.
pub(super) struct Inside {
    pub(super) winding: Vec<f64>,
    pub(super) labels: Vec<bool>,
}

/// Labels by the winding number, the graph cut, and then what has to be inside besides: bones that hang together,
/// and with `every_vertex` an element at each vertex of the shell.
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
    );
    whole.report.closed = closed.is_some();
    let elements = &whole.elements;
    let winding = if let Some(winding) = closed {
        winding
    } else {
        let mut told = |done| progress(0.5 * done);
        let evaluate = |p| field.evaluate(p);
        let (vertices, open) = (&elements.vertices, elements.open_neighbours());
        element_winding(vertices, &elements.tetrahedra, &open, &evaluate, &RULE, &mut told)?.means
    };
    let mut told = |done| progress(0.5 + 0.4 * done);
    let cut = graph_cut(&winding, &elements.neighbours, &elements.areas, &settings.segmentation, &mut told)?;
    let mut labels = cut.inside;
    whole.report.flat_elements_left_out = peel(elements, &mut labels);
    if every_vertex {
        whole.report.elements_for_vertices = hold_vertices(whole, &winding, &mut labels);
    }
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

/// Puts the element with the largest winding number at each vertex of the shell that has none inside there; how many.
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

/// Labels with which bones that hang together lie in one piece, and every point handle belongs to an element inside.
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
    // By their volume flat elements would make the cheapest chains.
    let bulk = |element: usize| elements.volumes[element] + SLENDER * longest_edge(elements, element).powi(3);
    let measures: Vec<f64> = (0..tetrahedra.len()).map(bulk).collect();
    let connected = connect_vertices(tetrahedra, neighbours, winding, &measures, labels, &groups, progress)?;
    whole.report.elements_for_bones = connected.added.iter().map(|chain| chain.elements.len()).sum();
    Ok(connected.inside)
}

/// Labels with which the recovered facets have an element inside; or, where `kept` elements stay inside, those of a
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
        None => satisfy_facets(&input, &how, progress)?,
        Some(_) => make_manifold(&input, &elements.tetrahedra, &how, progress)?,
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

/// The vertices of bones that hang together through shared ends.
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
