//! Points inside a mesh on a regular grid, how deep each is, and the ways between them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use armature_geometry::TriangleMesh;
use armature_geometry::search::TriangleHierarchy;
use armature_geometry::winding::FastWindingNumber;
use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::error::RigError;
use super::pieces::bridges;

/// About how many points are inside: fingers of a hand and shins of a human get a few across.
const POINTS: f64 = 24_000.0;
/// Points of the first look, which only measures the volume.
const FIRST_LOOK: f64 = 40_000.0;
/// Grid points at most, whatever share of its box the mesh fills.
const MOST_CELLS: f64 = 900_000.0;
/// Fewer points are no shape.
const LEAST_POINTS: usize = 60;
/// A way through points of half the depth is this many times as long, to the power of two.
const CENTRING: f64 = 2.0;

/// Marks a grid point that is outside.
const OUTSIDE: u32 = u32::MAX;

/// What the length of a way is measured by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Measure {
    /// Its length.
    Length,
    /// Its length, where the middle of a limb is shorter than its skin.
    Centred,
}

/// Grid points inside a mesh and the ways between neighbours.
pub(super) struct Interior {
    /// Distance of neighbours along an axis.
    pub(super) step: f64,
    /// Positions.
    pub(super) points: Vec<DVec3>,
    /// Distance from the surface.
    pub(super) depth: Vec<f64>,
    origin: DVec3,
    size: IVec3,
    index: Vec<u32>,
    first: Vec<u32>,
    links: Vec<u32>,
}

/// The shortest ways from one or more points.
pub(super) struct Ways {
    /// Length of the way; infinite where there is none.
    pub(super) length: Vec<f64>,
    before: Vec<u32>,
}

impl Interior {
    /// Samples the inside of a mesh that lies in the unit box.
    pub(super) fn sample(mesh: &TriangleMesh) -> Result<Self, RigError> {
        let winding = FastWindingNumber::precompute(mesh)?;
        let (low, high) = bounds(mesh);
        let extent = high - low;
        let whole = extent.x * extent.y * extent.z;
        let coarse = Grid::covering(low, high, (whole / FIRST_LOOK).cbrt());
        let inside = coarse.inside(&winding).iter().filter(|&&is| is).count();
        // A figure so thin that the first look misses it gets the finest grid.
        let volume = (inside as f64 * coarse.step.powi(3)).max(whole * 0.002);
        let step = (volume / POINTS).cbrt().max((whole / MOST_CELLS).cbrt());
        let grid = Grid::covering(low, high, step);
        let is_inside = grid.inside(&winding);
        let mut index = vec![OUTSIDE; is_inside.len()];
        let mut points = Vec::new();
        for (cell, _) in is_inside.iter().enumerate().filter(|(_, is)| **is) {
            index[cell] = points.len() as u32;
            points.push(grid.point(cell));
        }
        if points.len() < LEAST_POINTS {
            return Err(RigError::NoInside { found: points.len(), sampled: is_inside.len(), least: LEAST_POINTS });
        }
        let surface = TriangleHierarchy::new(&outer(mesh, &winding, 0.5 * grid.step))?;
        let depth_at =
            |p: &DVec3| surface.closest_point(p.to_array()).map_or(0.0, |closest| closest.distance_squared.sqrt());
        let depth = points.par_iter().map(depth_at).collect();
        let mut interior = Self {
            step,
            points,
            depth,
            origin: grid.origin,
            size: grid.size,
            index,
            first: Vec::new(),
            links: Vec::new(),
        };
        interior.link();
        Ok(interior)
    }

    fn link(&mut self) {
        let around: Vec<IVec3> = (0..27)
            .map(|k| IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1))
            .filter(|offset| *offset != IVec3::ZERO)
            .collect();
        let mut neighbours: Vec<Vec<u32>> = self
            .points
            .iter()
            .map(|&point| {
                let cell = self.cell_of(point);
                around.iter().filter_map(|&offset| self.in_cell(cell + offset)).map(|other| other as u32).collect()
            })
            .collect();
        for [a, b] in bridges(&self.points, &neighbours, 12.0 * self.step) {
            neighbours[a].push(b as u32);
            neighbours[b].push(a as u32);
        }
        self.first = Vec::with_capacity(neighbours.len() + 1);
        self.first.push(0);
        for list in &neighbours {
            self.links.extend_from_slice(list);
            self.first.push(self.links.len() as u32);
        }
    }

    fn cell_of(&self, point: DVec3) -> IVec3 {
        ((point - self.origin) / self.step).round().as_ivec3()
    }

    fn in_cell(&self, cell: IVec3) -> Option<usize> {
        if cell.cmplt(IVec3::ZERO).any() || cell.cmpge(self.size).any() {
            return None;
        }
        let cell = (cell.z * self.size.y + cell.y) * self.size.x + cell.x;
        Some(self.index[cell as usize]).filter(|&index| index != OUTSIDE).map(|index| index as usize)
    }

    /// The grid point nearest to `point`, if it is inside.
    pub(super) fn at(&self, point: DVec3) -> Option<usize> {
        self.in_cell(self.cell_of(point))
    }

    /// The inner grid point nearest to `point`.
    pub(super) fn nearest(&self, point: DVec3) -> usize {
        let away = |index: usize| self.points[index].distance_squared(point);
        self.at(point)
            .unwrap_or_else(|| (0..self.points.len()).min_by(|&a, &b| away(a).total_cmp(&away(b))).unwrap_or_default())
    }

    /// Neighbours of an inner point.
    pub(super) fn neighbours(&self, point: usize) -> impl Iterator<Item = usize> + '_ {
        let range = self.first[point] as usize..self.first[point + 1] as usize;
        self.links[range].iter().map(|&other| other as usize)
    }

    /// Shortest ways from `from` to all points (Dijkstra).
    pub(super) fn ways(&self, from: usize, measure: Measure) -> Ways {
        let mut ways =
            Ways { length: vec![f64::INFINITY; self.points.len()], before: vec![OUTSIDE; self.points.len()] };
        ways.length[from] = 0.0;
        // Lengths are not negative, so their bits have the same order.
        let mut heap = BinaryHeap::from([Reverse((0_u64, from as u32))]);
        while let Some(Reverse((bits, point))) = heap.pop() {
            let (length, point) = (f64::from_bits(bits), point as usize);
            if length > ways.length[point] {
                continue;
            }
            for other in self.neighbours(point) {
                let mut way = self.points[point].distance(self.points[other]);
                if measure == Measure::Centred {
                    let depth = 0.5 * (self.depth[point] + self.depth[other]) + 0.3 * self.step;
                    way *= (self.step / depth).powf(CENTRING);
                }
                if length + way < ways.length[other] {
                    ways.length[other] = length + way;
                    ways.before[other] = point as u32;
                    heap.push(Reverse(((length + way).to_bits(), other as u32)));
                }
            }
        }
        ways
    }

    /// How much of the inside is inside again when it is mirrored in the plane through `on` with this unit normal: 0 to 1.
    /// Looks at one point of `every`.
    pub(super) fn symmetry(&self, on: DVec3, normal: DVec3, every: usize) -> f64 {
        let mirrored = |p: DVec3| p - 2.0 * (p - on).dot(normal) * normal;
        // A point at the skin may fall just outside although the shape is symmetric.
        let is_near = |p: DVec3| {
            let cell = self.cell_of(p);
            [IVec3::ZERO, IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z]
                .into_iter()
                .any(|offset| self.in_cell(cell + offset).is_some())
        };
        let few: Vec<DVec3> = self.points.iter().copied().step_by(every.max(1)).collect();
        let both = few.par_iter().filter(|&&p| is_near(mirrored(p))).count();
        both as f64 / few.len() as f64
    }

    /// The mean of the points.
    pub(super) fn centroid(&self) -> DVec3 {
        self.points.iter().sum::<DVec3>() / self.points.len() as f64
    }
}

impl Ways {
    /// The points of the way, from its beginning to `to`.
    pub(super) fn way_to(&self, to: usize) -> Vec<usize> {
        let next = |&point: &usize| Some(self.before[point]).filter(|&p| p != OUTSIDE).map(|p| p as usize);
        let mut points: Vec<usize> = std::iter::successors(Some(to), next).collect();
        points.reverse();
        points
    }
}

struct Grid {
    origin: DVec3,
    step: f64,
    size: IVec3,
}

impl Grid {
    fn covering(low: DVec3, high: DVec3, step: f64) -> Self {
        let size = ((high - low) / step).ceil().as_ivec3() + 1;
        // Centred, so that the grid of a symmetric mesh is symmetric.
        let spare = (size - 1).as_dvec3() * step - (high - low);
        Self { origin: low - 0.5 * spare, step, size }
    }

    fn point(&self, cell: usize) -> DVec3 {
        let (cell, size) = (cell as i32, self.size);
        let at = IVec3::new(cell % size.x, cell / size.x % size.y, cell / (size.x * size.y));
        self.origin + at.as_dvec3() * self.step
    }

    fn inside(&self, winding: &FastWindingNumber) -> Vec<bool> {
        let cells = (self.size.x * self.size.y * self.size.z) as usize;
        let points: Vec<[f64; 3]> = (0..cells).map(|cell| self.point(cell).to_array()).collect();
        // A mesh that is inside out has an inside as well.
        winding.evaluate_many(&points).into_iter().map(|number| number.abs() > 0.5).collect()
    }
}

/// The triangles that have an outside: what is in a body, eyes or a shirt below a jacket, has no say in its depth.
fn outer(mesh: &TriangleMesh, winding: &FastWindingNumber, away: f64) -> TriangleMesh {
    let sides = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| DVec3::from(mesh.vertices[v as usize]));
        let (middle, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize_or_zero());
        [middle + away * normal, middle - away * normal].map(|p| p.to_array())
    };
    let sides: Vec<[f64; 3]> = mesh.triangles.iter().flat_map(sides).collect();
    let numbers = winding.evaluate_many(&sides);
    let is_outer = |pair: &[f64]| pair.iter().any(|number| number.abs() <= 0.5);
    let triangles = mesh.triangles.iter().zip(numbers.chunks_exact(2)).filter(|(_, pair)| is_outer(pair));
    let triangles: Vec<[u32; 3]> = triangles.map(|(triangle, _)| *triangle).collect();
    if triangles.is_empty() { mesh.clone() } else { TriangleMesh { vertices: mesh.vertices.clone(), triangles } }
}

/// The box around a mesh.
pub(super) fn bounds(mesh: &TriangleMesh) -> (DVec3, DVec3) {
    let used = mesh.triangles.iter().flatten().map(|&v| DVec3::from(mesh.vertices[v as usize]));
    used.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}
