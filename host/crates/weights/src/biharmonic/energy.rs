//! The Hessian of the Laplacian energy, `L M⁻¹ L` (thesis eq. 4.8), restricted to the free vertices, in an elimination
//! order that keeps its Cholesky factor and those of all its submatrices sparse.

use armature_geometry::operators::SparseMatrix;

use crate::sparse::cholesky::{CholeskyError, SparseCholesky};
use crate::sparse::symmetric::Symmetric;

/// The place of a vertex that is not an unknown.
const NONE: u32 = u32::MAX;

/// The quadratic energy `½ wᵀ A w - bᵀ w` of the unknowns; position `k` always means the `k`-th to be eliminated.
#[derive(Debug)]
pub(crate) struct BiharmonicEnergy {
    /// Vertex of every unknown.
    pub(crate) unknowns: Vec<u32>,
    /// Position of every vertex's unknown, or [`NONE`].
    position: Vec<u32>,
    /// `A`: the Hessian's rows and columns of the unknowns.
    pub(crate) hessian: Symmetric,
    /// The Hessian at rows of unknowns and columns of fixed vertices: for each fixed vertex `(position, value)`.
    coupling: Vec<Vec<(u32, f64)>>,
    /// Cholesky factor of `A`.
    pub(crate) factor: SparseCholesky,
    /// Mass of every unknown.
    pub(crate) mass: Vec<f64>,
}

impl BiharmonicEnergy {
    /// `laplacian` and `mass` have been checked; `fixed[k]` is the k-th vertex with a given value, and vertices with
    /// `takes_part[v] == false` have neither a value nor a neighbour that has one.
    pub(crate) fn new(
        laplacian: &SparseMatrix,
        mass: &[f64],
        shape_preservation: Option<&SparseMatrix>,
        fixed: &[usize],
        takes_part: &[bool],
    ) -> Result<Self, CholeskyError> {
        let n = mass.len();
        let mut is_fixed = vec![false; n];
        fixed.iter().for_each(|&vertex| is_fixed[vertex] = true);
        let free: Vec<u32> = (0..n as u32).filter(|&v| takes_part[v as usize] && !is_fixed[v as usize]).collect();
        let squared = SquaredLaplacian { laplacian, mass, shape_preservation };
        let mut position = vec![NONE; n];
        free.iter().enumerate().for_each(|(k, &v)| position[v as usize] = k as u32);
        let natural = squared.restricted(&free, &position);
        let order = natural.elimination_order()?;
        let unknowns: Vec<u32> = order.iter().map(|&k| free[k]).collect();
        let hessian = natural.permuted(&order);
        unknowns.iter().enumerate().for_each(|(k, &v)| position[v as usize] = k as u32);
        let coupling = squared.columns(fixed, &position);
        let factor = hessian.factorise_shifted(&[])?;
        let mass = unknowns.iter().map(|&v| mass[v as usize]).collect();
        Ok(Self { unknowns, position, hessian, coupling, factor, mass })
    }

    /// Position of a vertex's unknown; fixed vertices have none.
    pub(crate) fn position(&self, vertex: usize) -> Option<u32> {
        (self.position[vertex] != NONE).then_some(self.position[vertex])
    }

    /// Positions of the unknowns that the `row`-th fixed vertex acts on.
    pub(crate) fn pulled(&self, row: usize) -> impl Iterator<Item = u32> + '_ {
        self.coupling[row].iter().map(|&(position, _)| position)
    }

    /// Number of unknowns.
    pub(crate) fn len(&self) -> usize {
        self.unknowns.len()
    }

    /// `b` for the values given at the fixed vertices, `(row, value)`: at all unknowns, or at those in `places`
    /// (ascending), which must include every unknown acted on.
    pub(crate) fn right_hand_side(&self, given: &[(usize, f64)], places: Option<&[u32]>) -> Vec<f64> {
        let mut right = vec![0.0; places.map_or(self.len(), <[u32]>::len)];
        for &(row, value) in given {
            for &(k, entry) in &self.coupling[row] {
                if let Ok(here) = places.map_or(Ok(k as usize), |places| places.binary_search(&k)) {
                    right[here] -= entry * value;
                }
            }
        }
        right
    }
}

/// `L M⁻¹ L + K`, column by column.
struct SquaredLaplacian<'a> {
    laplacian: &'a SparseMatrix,
    mass: &'a [f64],
    shape_preservation: Option<&'a SparseMatrix>,
}

impl SquaredLaplacian<'_> {
    /// Calls `put(row, value)` for the entries of one column, rows ascending.
    fn column(&self, column: usize, scratch: &mut Scratch, mut put: impl FnMut(usize, f64)) {
        let Scratch { sums, last_column, touched } = scratch;
        touched.clear();
        let mut add = |row: usize, value: f64| {
            if last_column[row] != column {
                last_column[row] = column;
                sums[row] = 0.0;
                touched.push(row);
            }
            sums[row] += value;
        };
        for (middle, value) in self.laplacian.column(column) {
            let scaled = value / self.mass[middle];
            self.laplacian.column(middle).for_each(|(row, entry)| add(row, entry * scaled));
        }
        if let Some(extra) = self.shape_preservation {
            extra.column(column).for_each(|(row, value)| add(row, value));
        }
        touched.sort_unstable();
        touched.iter().for_each(|&row| put(row, sums[row]));
    }

    /// Rows and columns of the vertices in `free`; `position` gives their places.
    fn restricted(&self, free: &[u32], position: &[u32]) -> Symmetric {
        let mut scratch = Scratch::new(self.mass.len());
        let mut matrix = Symmetric::new();
        for &vertex in free {
            self.column(vertex as usize, &mut scratch, |row, value| {
                if position[row] != NONE {
                    matrix.push(position[row], value);
                }
            });
            matrix.end_column();
        }
        matrix
    }

    fn columns(&self, of: &[usize], position: &[u32]) -> Vec<Vec<(u32, f64)>> {
        let mut scratch = Scratch::new(self.mass.len());
        let one = |&vertex: &usize| {
            let mut column = Vec::new();
            self.column(vertex, &mut scratch, |row, value| {
                if position[row] != NONE {
                    column.push((position[row], value));
                }
            });
            column
        };
        of.iter().map(one).collect()
    }
}

struct Scratch {
    sums: Vec<f64>,
    last_column: Vec<usize>,
    touched: Vec<usize>,
}

impl Scratch {
    fn new(n: usize) -> Self {
        Self { sums: vec![0.0; n], last_column: vec![usize::MAX; n], touched: Vec::new() }
    }
}
