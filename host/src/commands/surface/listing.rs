//! Holes and what became of them, in words and as JSON.

use armature_fairing::holes::{FilledHole, HoleOutcome, Holes};
use serde_json::{Value, json};

use crate::terminal::counted;

/// No more holes, and no more broken rims, than this are listed one by one.
const MOST: usize = 40;

/// One line for each hole.
pub(crate) fn hole_words(holes: &Holes) -> Vec<String> {
    let mut words: Vec<String> = holes
        .holes
        .iter()
        .take(MOST)
        .enumerate()
        .map(|(index, hole)| {
            let [x, y, z] = hole.centre;
            let touches = match hole.touches.len() {
                0 => String::new(),
                count => format!(", touches another hole at {}", counted(count, "vertex", "vertices")),
            };
            let meant = hole.meant.map_or(String::new(), |meant| format!("; may be meant: {meant}"));
            format!(
                "hole {}: {}, {:.4} long, around {x:.4} {y:.4} {z:.4}{touches}{meant}",
                index + 1,
                counted(hole.rim.len(), "edge", "edges"),
                hole.length
            )
        })
        .collect();
    if holes.holes.len() > MOST {
        words.push(format!("and {} smaller holes", holes.holes.len() - MOST));
    }
    for rim in holes.broken.iter().take(MOST) {
        words.push(format!(
            "a rim of {} cannot be closed: it runs into an edge where three or more triangles meet, at vertex {}",
            counted(rim.vertices.len() - 1, "edge", "edges"),
            rim.vertices[rim.vertices.len() - 1]
        ));
    }
    if holes.broken.len() > MOST {
        words.push(format!("and {} more such rims", holes.broken.len() - MOST));
    }
    words
}

pub(crate) fn holes_json(holes: &Holes) -> Value {
    let hole = |(index, hole): (usize, &armature_fairing::holes::Hole)| {
        json!({
            "hole": index + 1, "edges": hole.rim.len(), "length": hole.length, "centre": hole.centre,
            "touches": hole.touches, "meant": hole.meant.map(|meant| meant.to_string()),
        })
    };
    json!({
        "holes": holes.holes.iter().enumerate().map(hole).collect::<Vec<_>>(),
        "broken_rims": holes.broken.iter().map(|rim| &rim.vertices).collect::<Vec<_>>(),
    })
}

pub(super) fn patch_words(patch: &FilledHole) -> String {
    let numbers: Vec<String> = patch.holes.iter().map(|hole| (hole + 1).to_string()).collect();
    let which =
        if numbers.len() == 1 { format!("hole {}", numbers[0]) } else { format!("holes {}", numbers.join(", ")) };
    let made = format!(
        "{}, {}, residual {:.1e}",
        counted(patch.triangles.len(), "triangle", "triangles"),
        counted(patch.rounds, "round", "rounds"),
        patch.residual
    );
    match &patch.outcome {
        HoleOutcome::Settled => format!("{which}: {made}"),
        HoleOutcome::RoundsEnded { last_move } => {
            format!("{which}: {made}; the surface still moved by {last_move:.2} of an edge in the last round")
        }
        HoleOutcome::RoundFailed(error) => {
            format!("{which}: {made}; the next round failed, look whether the surface is folded: {error}")
        }
        HoleOutcome::NoTriangles => format!("{which}: left open, no triangles fit between its edges"),
        HoleOutcome::Thrown => {
            format!("{which}: left open, the surface would go far beyond its rim; look for slivers there")
        }
        HoleOutcome::NotSolved(error) => format!("{which}: left open, {error}"),
    }
}

pub(super) fn patch_json(patch: &FilledHole) -> Value {
    let (state, last_move) = match &patch.outcome {
        HoleOutcome::Settled => ("settled".to_owned(), None),
        HoleOutcome::RoundsEnded { last_move } => ("rounds ended".to_owned(), Some(*last_move)),
        HoleOutcome::RoundFailed(error) => (format!("a round failed: {error}"), None),
        HoleOutcome::NoTriangles => ("left open: no triangles fit".to_owned(), None),
        HoleOutcome::Thrown => ("left open: far beyond its rim".to_owned(), None),
        HoleOutcome::NotSolved(error) => (format!("left open: {error}"), None),
    };
    json!({
        "holes": patch.holes.iter().map(|hole| hole + 1).collect::<Vec<_>>(), "vertices": patch.vertices.len(),
        "triangles": patch.triangles.len(), "rounds": patch.rounds, "residual": patch.residual, "outcome": state,
        "last_move": last_move,
    })
}
