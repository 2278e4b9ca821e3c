//! What is held, and how: region, curve and point conditions are all made of the same three lists (thesis 3.3.2).

use std::collections::HashMap;

use super::elements::Elements;
use super::error::FairingError;

/// Where conditions hold. Their values come with each solve.
///
/// - **Region** (systems 3.11, 3.16): `fixed` holds the region; the domain reaches at least two rings of vertices into it
///   for the Laplacian energy, three for its gradient. Where it is cut off, give the surface's own derivative along
///   `borders`, so that nothing is felt of the cut.
/// - **Curve** (3.13, 3.18): the domain ends at the curve; its vertices are `fixed`, its edges are `borders` with a tangent,
///   and for the gradient of the Laplacian its vertices are `bent` too.
/// - **Point**: a vertex in `fixed`, inside the domain.
/// - **Free** borders: those that nothing is said about. Their derivative is zero, as it is natural to the energy.
/// - **Sharp** curves inside the domain: `fixed` and `bent`, with a Laplacian of zero. The two sides then meet there without
///   knowing of each other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Conditions {
    /// Vertices with a given value.
    pub fixed: Vec<u32>,
    /// Edges at the domain's border with a given derivative along the outward conormal.
    pub borders: Vec<[u32; 2]>,
    /// Vertices of `fixed` with a given Laplacian.
    pub bent: Vec<u32>,
}

/// The values of [`Conditions`], in the same order, for functions with `C` components.
#[derive(Clone, Copy, Debug)]
pub struct Values<'a, const C: usize> {
    /// u at each of [`Conditions::fixed`].
    pub fixed: &'a [[f64; C]],
    /// ∂u/∂n at both ends of each of [`Conditions::borders`]; n points out of the domain.
    pub tangents: &'a [[[f64; C]; 2]],
    /// Δu at each of [`Conditions::bent`].
    pub laplacians: &'a [[f64; C]],
    /// g of `Δᵏu = g` at every vertex; empty for none.
    pub source: &'a [[f64; C]],
}

/// What a vertex is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Unknown, and which.
    Free(u32),
    /// Given, or placed by tangents.
    Held,
}

/// An edge of the border that has a tangent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Border {
    /// As the triangle runs along it.
    pub(super) ends: [u32; 2],
    /// Whether the condition names its ends the other way around.
    pub(super) turned: bool,
    pub(super) length: f64,
    pub(super) triangle: u32,
}

/// Conditions that fit a domain.
#[derive(Debug)]
pub(super) struct Checked {
    /// Whether a vertex is fixed.
    pub(super) fixed: Vec<bool>,
    /// Whether a vertex has a given Laplacian.
    pub(super) bent: Vec<bool>,
    pub(super) borders: Vec<Border>,
}

pub(super) fn check(elements: &Elements, conditions: &Conditions) -> Result<Checked, FairingError> {
    let count = elements.vertex_count();
    let mut fixed = vec![false; count];
    let exists = |vertex: u32| {
        if (vertex as usize) < count { Ok(vertex as usize) } else { Err(FairingError::NoSuchVertex { vertex, count }) }
    };
    for &vertex in &conditions.fixed {
        if std::mem::replace(&mut fixed[exists(vertex)?], true) {
            return Err(FairingError::Twice { vertex });
        }
    }
    let mut bent = vec![false; count];
    for &vertex in &conditions.bent {
        if !fixed[exists(vertex)?] {
            return Err(FairingError::BentButFree { vertex });
        }
        if std::mem::replace(&mut bent[vertex as usize], true) {
            return Err(FairingError::Twice { vertex });
        }
    }
    let sides = Sides::of(elements.triangles());
    let border = |&edge: &[u32; 2]| {
        edge.iter().try_for_each(|&v| exists(v).map(|_| ()))?;
        let [a, b] = edge;
        let (there, back) = (sides.at(a, b), sides.at(b, a));
        let (ends, turned, (triangle, corner)) = match (there, back) {
            (Some(side), None) => ([a, b], false, side),
            (None, Some(side)) => ([b, a], true, side),
            _ => return Err(FairingError::NotABorder { edge }),
        };
        let length = elements.lengths()[triangle as usize][corner as usize];
        Ok(Border { ends, turned, length, triangle })
    };
    let borders: Vec<Border> = conditions.borders.iter().map(border).collect::<Result<_, _>>()?;
    let mut seen: Vec<[u32; 2]> = borders.iter().map(|b| b.ends).collect();
    seen.sort_unstable();
    if let Some(pair) = seen.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(FairingError::Twice { vertex: pair[0][0] });
    }
    Ok(Checked { fixed, bent, borders })
}

/// Which triangle runs along an edge in a direction, and the corner opposite.
#[derive(Debug)]
pub(super) struct Sides(HashMap<[u32; 2], (u32, u8)>);

impl Sides {
    pub(super) fn of(triangles: &[[u32; 3]]) -> Self {
        let mut sides = HashMap::with_capacity(3 * triangles.len());
        for (index, &[a, b, c]) in triangles.iter().enumerate() {
            for (from, to, corner) in [(b, c, 0), (c, a, 1), (a, b, 2)] {
                // Where two triangles run the same way, the first counts.
                sides.entry([from, to]).or_insert((index as u32, corner));
            }
        }
        Self(sides)
    }

    pub(super) fn at(&self, from: u32, to: u32) -> Option<(u32, u8)> {
        self.0.get(&[from, to]).copied()
    }
}

/// Checks that values fit conditions.
pub(super) fn check_values<const C: usize>(
    elements: &Elements,
    conditions: &Conditions,
    values: &Values<'_, C>,
) -> Result<(), FairingError> {
    let counts = [
        ("values of fixed vertices", values.fixed.len(), conditions.fixed.len()),
        ("tangents", values.tangents.len(), conditions.borders.len()),
        ("Laplacians", values.laplacians.len(), conditions.bent.len()),
    ];
    if let Some(&(what, given, wanted)) = counts.iter().find(|(_, given, wanted)| given != wanted) {
        return Err(FairingError::WrongCount { what, given, wanted });
    }
    if !values.source.is_empty() && values.source.len() != elements.vertex_count() {
        let (given, wanted) = (values.source.len(), elements.vertex_count());
        return Err(FairingError::WrongCount { what: "values of the right-hand side", given, wanted });
    }
    let finite = |list: &[[f64; C]]| list.iter().flatten().all(|x| x.is_finite());
    let tangents = values.tangents.iter().all(|ends| finite(ends));
    let lists = [
        ("values of fixed vertices", finite(values.fixed)),
        ("tangents", tangents),
        ("Laplacians", finite(values.laplacians)),
        ("values of the right-hand side", finite(values.source)),
    ];
    match lists.iter().find(|(_, is_finite)| !is_finite) {
        Some(&(what, _)) => Err(FairingError::NotFinite { what }),
        None => Ok(()),
    }
}
