//! A region of a surface, ready to be dragged.

use std::collections::{BTreeMap, BTreeSet};

use armature_geometry::surface::{vertex_triangles, weld_vertices};
use armature_geometry::{MeshError, TriangleMesh};

use super::crease::{SharpCurve, cut};
use super::influences::Influences;
use crate::mixed::{Conditions, Elements, Energy, Fairing, FairingError, Settings, Values};

/// How a region gives way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegionSettings {
    /// [`Energy::Laplacian`]: tangents are continuous at the region's border; its gradient: curvature too.
    pub energy: Energy,
}

/// Why a region cannot be edited.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// The mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A vertex that does not exist.
    #[error("vertex {vertex} does not exist; the mesh has {count}")]
    NoSuchVertex {
        /// Zero-based.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
    /// A list of displacements does not fit the handles.
    #[error("{given} displacements are given for {wanted} handles")]
    WrongCount {
        /// How many were given.
        given: usize,
        /// How many handles there are.
        wanted: usize,
    },
    /// More handles than [`RegionEditor::with_influences`] takes.
    #[error("influences of {given} handles would need too much memory; at most {most} fit this region")]
    TooManyHandles {
        /// How many handles there are.
        given: usize,
        /// How many may be.
        most: usize,
    },
    /// A sharp curve with slopes is no curve, or meets another one.
    #[error("a sharp curve goes from vertex {} to vertex {}, which have no edge, or are one", .pair[0], .pair[1])]
    NotACurve {
        /// Two vertices that follow each other on it, or one that comes twice.
        pair: [u32; 2],
    },
    /// A sharp curve with slopes needs room for two sides.
    #[error("a sharp curve with slopes needs three vertices or more, all in the region or beside it; one has {given}")]
    ShortCurve {
        /// How many it has there.
        given: usize,
    },
    /// A sharp curve with slopes is not dragged as a whole.
    #[error("vertex {vertex} of a sharp curve with slopes is not dragged")]
    NotDragged {
        /// Zero-based.
        vertex: u32,
    },
    /// A vertex is dragged to two places.
    #[error("vertex {vertex} is dragged in two ways")]
    Contradiction {
        /// Zero-based.
        vertex: u32,
    },
    /// The region has no solution.
    #[error(transparent)]
    Fairing(#[from] FairingError),
}

/// A factorised region: [`RegionEditor::displacements`] answers again and again while handles are dragged.
#[derive(Debug)]
pub struct RegionEditor {
    fairing: Fairing,
    influences: Option<Influences>,
    /// Local vertex of each handle, which may repeat at seams.
    handles: Vec<u32>,
    /// The handles as they were given.
    given: Vec<u32>,
    /// Local vertices held: handles, what is around the region, and for copies along sharp curves what they copy.
    fixed: Vec<u32>,
    sharp: usize,
    /// Derivatives out of the region, along the sides of sharp curves.
    tangents: Vec<[[f64; 3]; 2]>,
    /// Local vertex of every vertex of the mesh near the region.
    local_of: Vec<(u32, u32)>,
}

/// Where a region goes.
#[derive(Clone, Debug, PartialEq)]
pub struct Moves {
    /// Vertices that move, and by how much.
    pub moves: Vec<(u32, [f64; 3])>,
    /// Of the linear system.
    pub residual: f64,
}

/// Influences take no more numbers than this, which is half a gigabyte.
const MOST_INFLUENCES: usize = 1 << 26;

fn differ(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(&b).any(|(x, y)| (x - y).abs() > 0.0)
}

impl RegionEditor {
    /// Takes the vertices of `region` as free, those of `handles` as dragged, everything else as held. Along `sharp` curves
    /// the displacement may have a crease. All are vertex indices of `mesh`; vertices at one place are one.
    pub fn precompute(
        mesh: &TriangleMesh,
        region: &[u32],
        handles: &[u32],
        sharp: &[SharpCurve],
        settings: &RegionSettings,
    ) -> Result<Self, EditError> {
        mesh.validate()?;
        let count = mesh.vertices.len();
        if let Some(&vertex) =
            region.iter().chain(handles).chain(sharp.iter().flat_map(|s| &s.vertices)).find(|&&v| v as usize >= count)
        {
            return Err(EditError::NoSuchVertex { vertex, count });
        }
        let weld = weld_vertices(&mesh.vertices, 0.0);
        let join = |list: &[u32]| -> BTreeSet<u32> { list.iter().map(|&v| weld.welded_of[v as usize]).collect() };
        let flat: Vec<u32> =
            sharp.iter().filter(|curve| curve.slopes.is_none()).flat_map(|c| c.vertices.iter().copied()).collect();
        let (mut free, dragged, creased) = (join(region), join(handles), join(&flat));
        dragged.iter().for_each(|v| {
            free.remove(v);
        });
        let mut triangles: Vec<[u32; 3]> =
            mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
        triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
        // What the equations of free vertices reach: one ring for each Laplacian after the first.
        let fans = vertex_triangles(weld.representative.len(), &triangles);
        let rings = if settings.energy == Energy::Laplacian { 2 } else { 3 };
        let mut reached: BTreeSet<u32> = free.iter().copied().collect();
        let mut near: BTreeSet<u32> = BTreeSet::new();
        for _ in 0..rings {
            near = reached.iter().flat_map(|&v| fans.of(v as usize).iter().copied()).collect();
            reached.extend(near.iter().flat_map(|&t| triangles[t as usize]));
        }
        let numbers: BTreeMap<u32, u32> = reached.iter().enumerate().map(|(k, &v)| (v, k as u32)).collect();
        let mut places: Vec<[f64; 3]> =
            reached.iter().map(|&v| mesh.vertices[weld.representative[v as usize] as usize]).collect();
        let mut domain: Vec<[u32; 3]> = near.iter().map(|&t| triangles[t as usize].map(|v| numbers[&v])).collect();
        let local = |v: u32| numbers.get(&weld.welded_of[v as usize]).copied();
        let mut conditions = Conditions::default();
        let (mut tangents, mut doubled) = (Vec::new(), Vec::new());
        for curve in sharp {
            let Some(slopes) = curve.slopes else { continue };
            let path: Vec<u32> = curve.vertices.iter().filter_map(|&v| local(v)).collect();
            if path.len() < 3 || path.len() < curve.vertices.len() {
                return Err(EditError::ShortCurve { given: path.len() });
            }
            if let Some(&vertex) = curve.vertices.iter().find(|&&v| !dragged.contains(&weld.welded_of[v as usize])) {
                return Err(EditError::NotDragged { vertex });
            }
            let of_mesh = |v: u32| weld.representative[reached.iter().nth(v as usize).map_or(0, |&w| w as usize)];
            let made = cut(&mut domain, places.len(), &path)
                .map_err(|pair| EditError::NotACurve { pair: pair.map(of_mesh) })?;
            places.extend(made.doubled.iter().map(|&v| places[v as usize]).collect::<Vec<_>>());
            doubled.extend(made.doubled);
            for (edges, slope) in made.sides.into_iter().zip(slopes) {
                // Out of each side is towards the curve.
                tangents.extend(edges.iter().map(|_| [slope.map(|x| -x); 2]));
                conditions.borders.extend(edges);
            }
        }
        let elements = Elements::of_positions(&places, &domain)?;
        let inside = |set: &BTreeSet<u32>| -> Vec<u32> { set.iter().filter_map(|v| numbers.get(v).copied()).collect() };
        let mut fixed = inside(&dragged);
        fixed.extend(reached.iter().filter(|&v| !free.contains(v) && !dragged.contains(v)).map(|v| numbers[v]));
        conditions.bent = creased.intersection(&dragged).filter_map(|v| numbers.get(v).copied()).collect();
        conditions.fixed.clone_from(&fixed);
        conditions.fixed.extend(reached.len() as u32..places.len() as u32);
        fixed.extend(doubled);
        let fairing = Fairing::precompute(&elements, &conditions, &Settings::new(settings.energy))?;
        Ok(Self {
            fairing,
            influences: None,
            // Handles that nothing free is near have no local vertex; they move alone.
            handles: handles.iter().map(|&v| local(v).unwrap_or(u32::MAX)).collect(),
            given: handles.to_vec(),
            sharp: conditions.bent.len(),
            fixed,
            tangents,
            local_of: (0..count as u32).filter_map(|v| Some((v, local(v)?))).collect(),
        })
    }

    /// Solves for the influence of each handle beforehand: displacements are then products instead of solutions, many times
    /// as fast. Takes about a third of a solution for each handle, and memory for a number for each handle and vertex.
    pub fn with_influences(mut self) -> Result<Self, EditError> {
        let mut columns = self.handles.clone();
        columns.retain(|&local| local != u32::MAX);
        columns.sort_unstable();
        columns.dedup();
        let most = MOST_INFLUENCES / self.fairing.vertex_count().max(1);
        if columns.len() > most {
            return Err(EditError::TooManyHandles { given: columns.len(), most });
        }
        if !columns.is_empty() {
            self.influences = Some(Influences::solve(&self.fairing, &self.fixed, self.sharp, &self.tangents, columns)?);
        }
        Ok(self)
    }

    /// Number of vertices solved for.
    pub fn free_count(&self) -> usize {
        self.fairing.free().len()
    }

    /// Displacements of all vertices that move. `dragged` holds that of each handle, in their order.
    pub fn displacements(&self, dragged: &[[f64; 3]]) -> Result<Moves, EditError> {
        if dragged.len() != self.handles.len() {
            return Err(EditError::WrongCount { given: dragged.len(), wanted: self.handles.len() });
        }
        let mut of_local: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
        let mut alone = Vec::new();
        for ((&local, &vertex), &by) in self.handles.iter().zip(&self.given).zip(dragged) {
            if local == u32::MAX {
                alone.push((vertex, by));
            } else if of_local.insert(local, by).is_some_and(|earlier| differ(earlier, by)) {
                return Err(EditError::Contradiction { vertex });
            }
        }
        let solution = if let Some(influences) = &self.influences {
            influences.sum(&of_local)
        } else {
            let by = |v: &u32| of_local.get(v).copied().unwrap_or_default();
            let fixed: Vec<[f64; 3]> = self.fixed.iter().map(by).collect();
            let laplacians = vec![[0.0; 3]; self.sharp];
            let tangents = &self.tangents;
            self.fairing.solve(&Values { fixed: &fixed, tangents, laplacians: &laplacians, source: &[] })?
        };
        let moved = self.local_of.iter().map(|&(vertex, local)| (vertex, solution.values[local as usize]));
        let mut all: Vec<(u32, [f64; 3])> = moved.filter(|(_, by)| differ(*by, [0.0; 3])).collect();
        all.extend(alone);
        Ok(Moves { moves: all, residual: solution.residual })
    }

    /// The mesh with its region dragged, and the residual of the system.
    pub fn edited(&self, mesh: &TriangleMesh, dragged: &[[f64; 3]]) -> Result<(TriangleMesh, f64), EditError> {
        let Moves { moves, residual } = self.displacements(dragged)?;
        let mut edited = mesh.clone();
        for (vertex, by) in moves {
            let place = &mut edited.vertices[vertex as usize];
            place.iter_mut().zip(by).for_each(|(x, step)| *x += step);
        }
        Ok((edited, residual))
    }
}
