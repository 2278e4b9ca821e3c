//! Labels for elements that respect the winding number and are coherent (thesis 8.5.1).

use super::energy::{Energy, OUTSIDE, SegmentationSettings};
use super::error::SegmentationError;
use super::max_flow::{FlowGraph, max_flow};
use crate::progress::{Progress, stage};
/// Capacities are rounded to integers as fine as possible with their sum below this.
const LARGEST_TOTAL: f64 = (1_u64 << 59) as f64;

/// What is known about an element before the cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Label {
    /// The cut decides.
    #[default]
    Free,
    /// Inside whatever the winding number says.
    Inside,
    /// Outside whatever the winding number says.
    Outside,
}

/// Labels with the lowest possible energy, to within rounding.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// For each element, whether it is inside; of several best segmentations, the one with the most elements inside.
    pub inside: Vec<bool>,
    /// Its energy, equation 8.8.
    pub energy: f64,
    /// No labels that respect the forced ones have lower energy than this: proven by the maximum flow, minus the
    /// possible rounding error of capacities.
    pub lower_bound: f64,
    /// How many labels differ from the winding number's own, which is inside from ½ up.
    pub changed_by_neighbours: usize,
}

/// Segments elements by minimising the energy of thesis equations 8.8 to 8.10, found as a minimum cut.
///
/// `winding`: n integral means of the winding number; `neighbours`: n×K, the element across each facet, `u32::MAX`
/// beyond the hull, where everything is outside; `facet_sizes`: n×K lengths (K = 3, triangles) or areas (K = 4,
/// tetrahedra) of those facets, in any unit.
///
/// The thesis's data term has no unit but its facets do, so its γ depends on the unit and on how fine the elements are.
/// Here a facet's size is divided by the mean facet size of its two elements: the labels are the same in every unit,
/// and coarse elements around a model do not outvote the fine ones of its fingers. Each element's facets then sum to at
/// most 2K, and if every winding number is an integer, thresholding is provably the best segmentation for every γ <
/// exp(1/(2σ²))/(2K): the smoothness cannot eat thin parts of a clean mesh. The exponent is Boykov and Funka-Lea's,
/// -|Δw|²/(2σ²).
///
/// The same input gives the same labels. `progress` receives the fraction of the flow found; see [`Progress`].
pub fn graph_cut<const K: usize>(
    winding: &[f64],
    neighbours: &[[u32; K]],
    facet_sizes: &[[f64; K]],
    settings: &SegmentationSettings,
    progress: Progress<'_>,
) -> Result<Segmentation, SegmentationError> {
    let forced = vec![Label::Free; neighbours.len()];
    graph_cut_with_forced_labels(winding, neighbours, facet_sizes, &forced, settings, progress)
}

/// [`graph_cut`] among the labels that respect `forced`, one for each of the n elements.
pub fn graph_cut_with_forced_labels<const K: usize>(
    winding: &[f64],
    neighbours: &[[u32; K]],
    facet_sizes: &[[f64; K]],
    forced: &[Label],
    settings: &SegmentationSettings,
    progress: Progress<'_>,
) -> Result<Segmentation, SegmentationError> {
    let energy = Energy::new(winding, neighbours, facet_sizes, settings)?;
    if forced.len() != winding.len() {
        return Err(SegmentationError::WrongLength {
            what: "forced labels",
            found: forced.len(),
            elements: winding.len(),
        });
    }
    let mut report = stage(progress, "telling inside from outside");
    if report(0.0).is_break() {
        return Err(SegmentationError::Cancelled);
    }
    let (graph, scale) = flow_graph(&energy, forced);
    let cut = max_flow(&graph, &mut report).ok_or(SegmentationError::Cancelled)?;
    let total = energy.of(&cut.source_side);
    // Each term is off by at most half a unit, in the labels found and in any better ones.
    let terms = winding.len() * (1 + K);
    let slack = (terms as f64 + (cut.cut - cut.flow) as f64) / scale + terms as f64 * f64::EPSILON * total;
    let changed = winding.iter().zip(&cut.source_side).filter(|&(&w, &inside)| (w >= 0.5) != inside).count();
    Ok(Segmentation {
        inside: cut.source_side,
        energy: total,
        lower_bound: total - slack,
        changed_by_neighbours: changed,
    })
}

/// The energy as capacities, and the units of capacity per unit of energy (Kolmogorov and Zabih 2004).
fn flow_graph<'a, const K: usize>(energy: &'a Energy<K>, forced: &[Label]) -> (FlowGraph<'a, K>, f64) {
    let count = forced.len();
    let at_hull = |element: usize, facet: usize| energy.neighbours[element][facet] == OUTSIDE;
    let all: f64 = energy.smoothness.iter().flatten().sum();
    let scale = LARGEST_TOTAL / (4.0 * all).max(1.0);
    let units = |value: f64| (value * scale).round() as i64;
    let capacities: Vec<[i64; K]> = (0..count)
        .map(|t| std::array::from_fn(|k| if at_hull(t, k) { 0 } else { units(energy.smoothness[t][k]) }))
        .collect();
    let terminal = |element: usize| {
        let to_hull: f64 = (0..K).filter(|&k| at_hull(element, k)).map(|k| energy.smoothness[element][k]).sum();
        // An element that prefers a label by more than all its neighbours can outweigh has that label in the best
        // segmentation: a larger capacity would change nothing.
        let enough = capacities[element].iter().sum::<i64>() + 1;
        match forced[element] {
            Label::Free => units(energy.preference(element) - to_hull).clamp(-enough, enough),
            Label::Inside => enough,
            Label::Outside => -enough,
        }
    };
    let terminals = (0..count).map(terminal).collect();
    (FlowGraph { heads: energy.neighbours, twins: &energy.twins, capacities, terminals }, scale)
}
