//! What the reports have in common: the problem that was solved, and its spurious extrema.

use armature_character::handle_weights::{DomainKind, SpuriousExtrema};
use serde_json::{Value, json};

use crate::terminal::{counted, grouped};

/// Which extrema count as spurious where handles hold the shape, and where nothing is held.
pub(super) const HELD: &str = "spurious extrema, where no handle holds the shape";
pub(super) const OUTERMOST: &str = "spurious extrema, besides each handle's lowest and highest";

/// How many spurious extrema there are, before and after scaling, and how much they matter.
pub(super) fn extrema_words(which: &str, spurious: &SpuriousExtrema) -> String {
    let words = |(count, most): (usize, f64)| match count {
        0 => "none".to_owned(),
        _ => format!("{} (up to {most:.1e} from their saddles)", grouped(count)),
    };
    let before = words(SpuriousExtrema::total(&spurious.computed));
    match &spurious.scaled {
        None => format!("{which}: {before}"),
        Some(scaled) => format!("{which}: {before}; after scaling: {}", words(SpuriousExtrema::total(scaled))),
    }
}

pub(super) fn extrema_json(spurious: &SpuriousExtrema, names: &[String]) -> Value {
    let summary = |all: &[Vec<_>]| {
        let (count, largest_persistence) = SpuriousExtrema::total(all);
        json!({"count": count, "largest_persistence": largest_persistence})
    };
    let listed = spurious.last().iter().zip(names).flat_map(|(all, name)| {
        all.iter().map(move |one| {
            json!({
                "handle": name,
                "kind": if one.extremum.is_minimum { "minimum" } else { "maximum" },
                "place": one.place,
                "value": one.extremum.value,
                "persistence": one.extremum.persistence,
            })
        })
    });
    json!({
        "computed": summary(&spurious.computed),
        "scaled": spurious.scaled.as_deref().map(summary),
        "places": listed.collect::<Vec<_>>(),
    })
}

/// The problem that the weights are the optimum of: the fraction of their length over which bones are released near
/// shared joints (`None`: vertices are fixed), and how many flat elements are ignored (`None`: unknown).
pub(in crate::commands) fn problem_words(joint_release: Option<f64>, flat_elements: Option<usize>) -> String {
    let held = match joint_release {
        None => "vertices fixed as given".to_owned(),
        Some(0.0) => "bones hold to their ends".to_owned(),
        Some(share) => format!("bones are released over {share} of their length at shared joints"),
    };
    let flat = match flat_elements {
        None | Some(0) => String::new(),
        Some(count) => format!(", {} ignored", counted(count, "flat element", "flat elements")),
    };
    format!("{held}{flat}, barycentric masses")
}

pub(super) fn problem_json(joint_release: Option<f64>, flat_elements: usize) -> Value {
    json!({"joint_release": joint_release, "flat_elements_left_out": flat_elements, "masses": "barycentric"})
}

pub(super) fn domain_name(domain: DomainKind) -> &'static str {
    match domain {
        DomainKind::Volume => "a volume",
        DomainKind::Flat => "the flat figure",
        DomainKind::OwnTetrahedra => "its own tetrahedra",
        DomainKind::Surface => "the surface",
    }
}
