//! The Hessian of the Laplacian energy, `L M⁻¹ L` (thesis eq. 4.8), among the vertices that are free, in an
//! elimination order that keeps its Cholesky factor and those of all its submatrices sparse.

use armature_geometry::SparseMatrix;

use crate::cholesky::elimination_order;
use crate::{CholeskyError, SparseCholesky};

/// A symmetric matrix in compressed columns, both triangles, rows ascending.
#[derive(Debug, Default)]
pub(crate) struct Symmetric {
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

/// The place of a vertex that is no unknown.
const NONE: u32 = u32::MAX;

/// The quadratic energy `½ wᵀ A w - bᵀ w` of the unknowns; position `k` everywhere is the `k`-th to be eliminated.
#[derive(Debug)]
pub(crate) struct BiharmonicEnergy {
    /// Vertex of every unknown.
    pub(crate) unknowns: Vec<u32>,
    /// Position of every vertex's unknown, or [`NONE`].
    position: Vec<u32>,
    /// `A`: the Hessian's rows and columns of the unknowns.
    pub(crate) hessian: Symmetric,
    /// The Hessian's rows of the unknowns and columns of the fixed vertices: for each fixed vertex `(position, value)`.
    coupling: Vec<Vec<(u32, f64)>>,
    /// Cholesky factor of `A`.
    pub(crate) factor: SparseCholesky,
    /// Mass of every unknown.
    pub(crate) mass: Vec<f64>,
}

impl BiharmonicEnergy {
    /// `laplacian` and `mass` are checked already; `fixed[k]` is the k-th vertex with a given value, and vertices
    /// with `takes_part[v] == false` have neither a value nor a neighbour that has one.
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
        let order = {
            let (starts, rows, _) = natural.upper_of(|_| true, &mut vec![NONE; free.len()]);
            elimination_order(&starts, &rows)?
        };
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

    /// Positions that the `row`-th fixed vertex pulls at.
    pub(crate) fn pulled(&self, row: usize) -> impl Iterator<Item = u32> + '_ {
        self.coupling[row].iter().map(|&(position, _)| position)
    }

    /// Number of unknowns.
    pub(crate) fn len(&self) -> usize {
        self.unknowns.len()
    }

    /// `b` for the values given at the fixed vertices, `(row, value)`: at all unknowns, or at those in `places`
    /// (ascending), which have to hold all that is pulled at.
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

    /// Rows and columns of the vertices in `free`, whose places `position` tells.
    fn restricted(&self, free: &[u32], position: &[u32]) -> Symmetric {
        let mut scratch = Scratch::new(self.mass.len());
        let mut matrix = Symmetric { starts: vec![0], ..Symmetric::default() };
        for &vertex in free {
            self.column(vertex as usize, &mut scratch, |row, value| {
                if position[row] != NONE {
                    matrix.rows.push(position[row]);
                    matrix.values.push(value);
                }
            });
            matrix.starts.push(matrix.rows.len());
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

impl Symmetric {
    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// `A x` into `y`.
    pub(crate) fn multiply_into(&self, x: &[f64], y: &mut [f64]) {
        for (column, sum) in y.iter_mut().enumerate() {
            let range = self.starts[column]..self.starts[column + 1];
            let terms = self.rows[range.clone()].iter().zip(&self.values[range]);
            *sum = terms.map(|(&row, value)| value * x[row as usize]).sum();
        }
    }

    /// Rows and values of one column, rows ascending.
    pub(crate) fn column(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[column]..self.starts[column + 1];
        self.rows[range.clone()].iter().map(|&row| row as usize).zip(self.values[range].iter().copied())
    }

    /// `A x` into `y`, for an `x` that is zero outside `places`.
    pub(crate) fn multiply_columns(&self, places: &[u32], x: &[f64], y: &mut [f64]) {
        if 2 * places.len() > self.len() {
            return self.multiply_into(x, y);
        }
        y.fill(0.0);
        for &k in places {
            let value = x[k as usize];
            self.column(k as usize).for_each(|(row, entry)| y[row] += entry * value);
        }
    }

    /// Rows and columns at `places` (ascending), and which of those rows had no entries anywhere else.
    pub(crate) fn at(&self, places: &[u32]) -> (Self, Vec<bool>) {
        let mut place = vec![NONE; self.len()];
        places.iter().enumerate().for_each(|(here, &k)| place[k as usize] = here as u32);
        let mut matrix = Self { starts: vec![0], ..Self::default() };
        let mut whole = Vec::with_capacity(places.len());
        for &k in places {
            let before = matrix.rows.len();
            let range = self.starts[k as usize]..self.starts[k as usize + 1];
            for (row, value) in self.rows[range.clone()].iter().zip(&self.values[range.clone()]) {
                if place[*row as usize] != NONE {
                    matrix.rows.push(place[*row as usize]);
                    matrix.values.push(*value);
                }
            }
            whole.push(matrix.rows.len() - before == range.len());
            matrix.starts.push(matrix.rows.len());
        }
        (matrix, whole)
    }

    /// The main diagonal.
    pub(crate) fn diagonal(&self) -> Vec<f64> {
        let at = |column: usize| {
            let range = self.starts[column]..self.starts[column + 1];
            self.rows[range.clone()].binary_search(&(column as u32)).map_or(0.0, |k| self.values[range.start + k])
        };
        (0..self.len()).map(at).collect()
    }

    /// The upper triangle of the rows and columns with `keep`, renumbered without gaps; `place` is scratch space as
    /// long as the matrix has rows.
    fn upper_of(&self, keep: impl Fn(usize) -> bool, place: &mut [u32]) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        let mut count = 0;
        for column in 0..self.len() {
            if !keep(column) {
                place[column] = NONE;
                continue;
            }
            place[column] = count;
            count += 1;
            for k in self.starts[column]..self.starts[column + 1] {
                let row = self.rows[k] as usize;
                if row > column {
                    break;
                }
                if place[row] != NONE {
                    rows.push(place[row] as usize);
                    values.push(self.values[k]);
                }
            }
            starts.push(rows.len());
        }
        (starts, rows, values)
    }

    /// Cholesky factor of the rows and columns with `keep`, in the order they stand.
    pub(crate) fn factorise_kept(&self, keep: impl Fn(usize) -> bool) -> Result<SparseCholesky, CholeskyError> {
        let (starts, rows, values) = self.upper_of(keep, &mut vec![NONE; self.len()]);
        SparseCholesky::of_upper_in_order(&starts, &rows, &values)
    }

    /// Cholesky factor of `A + diag(shift)`; no shift at all is given by an empty slice.
    pub(crate) fn factorise_shifted(&self, shift: &[f64]) -> Result<SparseCholesky, CholeskyError> {
        let (starts, rows, mut values) = self.upper_of(|_| true, &mut vec![NONE; self.len()]);
        for (column, &shift) in shift.iter().enumerate() {
            // The diagonal is stored, and is the last of an upper triangle's column.
            values[starts[column + 1] - 1] += shift;
        }
        SparseCholesky::of_upper_in_order(&starts, &rows, &values)
    }

    /// `order[k]` becomes row and column `k`.
    fn permuted(&self, order: &[usize]) -> Self {
        let mut place = vec![0_u32; order.len()];
        order.iter().enumerate().for_each(|(k, &from)| place[from] = k as u32);
        let mut matrix = Self { starts: vec![0], ..Self::default() };
        let mut column: Vec<(u32, f64)> = Vec::new();
        for &from in order {
            let range = self.starts[from]..self.starts[from + 1];
            column.clear();
            column.extend(
                self.rows[range.clone()].iter().map(|&r| place[r as usize]).zip(self.values[range].iter().copied()),
            );
            column.sort_unstable_by_key(|&(row, _)| row);
            matrix.rows.extend(column.iter().map(|&(row, _)| row));
            matrix.values.extend(column.iter().map(|&(_, value)| value));
            matrix.starts.push(matrix.rows.len());
        }
        matrix
    }
}
