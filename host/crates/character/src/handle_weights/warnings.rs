//! Problems with handles and their shape, found in the weights, and how they are reported.

use armature_weights::WeightMatrix;

use super::domain::WeightDomain;
use super::settings::DomainKind;

/// A handle that moves no vertex by more than this fraction moves nothing.
const DUST: f64 = 1e-4;
/// Vertices with less than this fraction of the median vertex's mass are in slivers.
const SLIVER: f64 = 1e-3;
/// Handles that hold vertices farther away than this fraction of the shape's size are worth a warning.
const FAR: f64 = 0.01;
/// Most names listed in one sentence.
const MOST_NAMES: usize = 8;

/// The problems; handles by their index.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Drawbacks {
    /// Handles that are completely outside.
    outside: Vec<usize>,
    /// Handles that move nothing.
    pub(super) idle: Vec<usize>,
    /// Handles at the same place as an earlier one.
    coincident: Vec<(usize, usize)>,
    /// Handles that hold vertices beside them, with the distance as a fraction of the shape's size.
    beside: Vec<(usize, f64)>,
    /// The handle that each piece without one follows.
    followed: Vec<usize>,
    /// Handles whose weights are not as good as requested, and the largest error bound.
    unconverged: (usize, f64),
    degenerate: usize,
    /// Vertices in slivers.
    slivers: usize,
}

impl Drawbacks {
    pub(super) fn find(
        domain: &WeightDomain,
        weights: &WeightMatrix,
        unconverged: (usize, f64),
        unreached: &[Vec<usize>],
        followed: &[usize],
    ) -> Self {
        let idle = |handle: &usize| weights.column(*handle).all(|(_, weight)| weight <= DUST);
        let of_pieces = unreached.iter().zip(followed);
        // Points in no element are not pieces of the shape.
        let pieces = of_pieces.filter(|(piece, _)| piece.iter().any(|&vertex| domain.mass[vertex] > 0.0));
        Self {
            outside: domain.outside.clone(),
            idle: (0..weights.bones()).filter(idle).collect(),
            coincident: coincident(&domain.held),
            beside: beside(domain),
            followed: pieces.map(|(_, &handle)| handle).collect(),
            unconverged,
            degenerate: domain.degenerate,
            slivers: slivers(&domain.mass),
        }
    }
}

/// Handles that hold exactly what an earlier one holds.
fn coincident(held: &[Vec<usize>]) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..held.len()).filter(|&handle| !held[handle].is_empty()).collect();
    order.sort_by(|&a, &b| held[a].cmp(&held[b]).then(a.cmp(&b)));
    let mut pairs: Vec<(usize, usize)> =
        order.windows(2).filter(|pair| held[pair[0]] == held[pair[1]]).map(|pair| (pair[0], pair[1])).collect();
    pairs.sort_unstable();
    pairs
}

fn beside(domain: &WeightDomain) -> Vec<(usize, f64)> {
    let corner = |pick: fn(f64, f64) -> f64, k: usize| domain.vertices.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0);
    let size = (0..3).map(|k| (corner(f64::max, k) - corner(f64::min, k)).powi(2)).sum::<f64>().sqrt();
    // On a surface all bones are beside the vertices they hold, as they should be.
    let expected = if domain.kind == DomainKind::Surface { f64::INFINITY } else { FAR };
    let far = domain.snapped.iter().map(|&(handle, distance)| (handle, distance / size));
    far.filter(|(_, share)| *share > expected).collect()
}

fn slivers(mass: &[f64]) -> usize {
    let mut sorted: Vec<f64> = mass.iter().copied().filter(|m| *m > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    sorted.iter().take_while(|m| **m < SLIVER * median).count()
}

/// Sentences for the user.
pub(super) fn weight_warnings(drawbacks: &Drawbacks, names: &[String]) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut tell = |handles: &[usize], text: &str| {
        if !handles.is_empty() {
            warnings.push(format!("{text}: {}", listed(handles, names)));
        }
    };
    tell(&drawbacks.outside, "these bones are outside the shape");
    tell(&drawbacks.idle, "these bones move no part of the mesh");
    for &(first, second) in &drawbacks.coincident {
        tell(&[first, second], "these bones are at the same place and share its weights equally");
    }
    let beside: Vec<usize> = drawbacks.beside.iter().map(|(handle, _)| *handle).collect();
    let farthest = drawbacks.beside.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    let text = format!(
        "the volume has no vertices on these bones, so the nearest are used, up to {:.1} % of its size away",
        100.0 * farthest
    );
    tell(&beside, &text);
    if !drawbacks.followed.is_empty() {
        let mut leaders = drawbacks.followed.clone();
        leaders.sort_unstable();
        leaders.dedup();
        let pieces = drawbacks.followed.len();
        let text = if pieces == 1 {
            "a piece of the shape contains no bone and follows the nearest one rigidly".to_owned()
        } else {
            format!("{pieces} pieces of the shape contain no bone and follow the nearest one rigidly")
        };
        tell(&leaders, &text);
    }
    let mut count = |number: usize, one: &str, many: &str| match number {
        0 => {}
        1 => warnings.push(format!("1 {one}")),
        _ => warnings.push(format!("{number} {many}")),
    };
    count(
        drawbacks.degenerate,
        "element of the shape is flat and was ignored",
        "elements of the shape are flat and were ignored",
    );
    count(
        drawbacks.slivers,
        "vertex of the shape is in slivers, where solving takes more steps",
        "vertices of the shape are in slivers, where solving takes more steps",
    );
    if let (handles @ 1.., bound) = drawbacks.unconverged {
        let text = format!("the weights of {handles} bones are only within {bound:.1e} of the optimal ones");
        warnings.push(text);
    }
    warnings
}

fn listed(handles: &[usize], names: &[String]) -> String {
    let named: Vec<&str> = handles.iter().take(MOST_NAMES).map(|&handle| names[handle].as_str()).collect();
    let more = handles.len().saturating_sub(MOST_NAMES);
    let and_more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{and_more}", named.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_drawback_is_told_with_its_names() {
        let names: Vec<String> = (0..12).map(|k| format!("b{k}")).collect();
        let drawbacks = Drawbacks {
            outside: vec![2],
            idle: (0..10).collect(),
            coincident: coincident(&[vec![1, 2], vec![3], vec![1, 2], vec![], vec![]]),
            followed: vec![4, 4, 5],
            unconverged: (1, 0.01),
            slivers: slivers(&[1.0, 1.0, 1e-9, 0.0]),
            degenerate: 2,
            beside: vec![(3, 0.25)],
        };
        let told = weight_warnings(&drawbacks, &names).join("\n");
        for part in [
            "outside the shape: b2",
            "no part of the mesh: b0, b1, b2, b3, b4, b5, b6, b7 and 2 more",
            "share its weights equally: b0, b2",
            "25.0 % of its size away: b3",
            "3 pieces of the shape contain no bone and follow the nearest one rigidly: b4, b5",
            "2 elements of the shape are flat",
            "1 vertex of the shape is in slivers",
            "within 1.0e-2 of the optimal",
        ] {
            assert!(told.contains(part), "{part:?} is not in {told}");
        }
        assert!(weight_warnings(&Drawbacks::default(), &names).is_empty());
    }
}
