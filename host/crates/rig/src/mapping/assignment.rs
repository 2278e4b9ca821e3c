//! The cheapest way to give every row its own column (the Hungarian method).

/// The column of every row, such that the sum of `costs[row][column]` is smallest. Needs at least as many columns as
/// rows and finite costs; O(rows² · columns). Ties go to the lower column.
///
/// Shortest augmenting paths with potentials: Kuhn 1955, Munkres 1957, in the form of Jonker and Volgenant 1987.
pub(super) fn assign(costs: &[Vec<f64>]) -> Vec<usize> {
    let rows = costs.len();
    let columns = costs.first().map_or(0, Vec::len);
    debug_assert!(columns >= rows && costs.iter().all(|row| row.len() == columns));
    // Row and column 0 are the sentinel from which each augmenting path starts.
    let mut row_potential = vec![0.0; rows + 1];
    let mut column_potential = vec![0.0; columns + 1];
    let mut row_of_column = vec![0_usize; columns + 1];
    for row in 1..=rows {
        row_of_column[0] = row;
        let mut came_from = vec![0_usize; columns + 1];
        let mut slack = vec![f64::INFINITY; columns + 1];
        let mut done = vec![false; columns + 1];
        let mut column = 0;
        loop {
            done[column] = true;
            let at = row_of_column[column];
            let mut next = 0;
            let mut least = f64::INFINITY;
            for candidate in (1..=columns).filter(|&c| !done[c]) {
                let reduced = costs[at - 1][candidate - 1] - row_potential[at] - column_potential[candidate];
                if reduced < slack[candidate] {
                    slack[candidate] = reduced;
                    came_from[candidate] = column;
                }
                if slack[candidate] < least {
                    least = slack[candidate];
                    next = candidate;
                }
            }
            for c in 0..=columns {
                if done[c] {
                    row_potential[row_of_column[c]] += least;
                    column_potential[c] -= least;
                } else {
                    slack[c] -= least;
                }
            }
            column = next;
            if row_of_column[column] == 0 {
                break;
            }
        }
        while column != 0 {
            let before = came_from[column];
            row_of_column[column] = row_of_column[before];
            column = before;
        }
    }
    let mut column_of_row = vec![0; rows];
    for (column, &row) in row_of_column.iter().enumerate().skip(1).filter(|(_, row)| **row != 0) {
        column_of_row[row - 1] = column - 1;
    }
    column_of_row
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cheapest_by_trying_all(costs: &[Vec<f64>], row: usize, used: &mut Vec<bool>) -> f64 {
        if row == costs.len() {
            return 0.0;
        }
        let mut best = f64::INFINITY;
        for column in 0..costs[row].len() {
            if !used[column] {
                used[column] = true;
                best = best.min(costs[row][column] + cheapest_by_trying_all(costs, row + 1, used));
                used[column] = false;
            }
        }
        best
    }

    #[test]
    fn nothing_to_assign() {
        assert!(assign(&[]).is_empty());
    }

    proptest! {
        #[test]
        fn as_cheap_as_trying_all(rows in 1_usize..5, extra in 0_usize..3, seed in prop::collection::vec(-9_i8..9, 35)) {
            let columns = rows + extra;
            let costs: Vec<Vec<f64>> =
                (0..rows).map(|r| (0..columns).map(|c| f64::from(seed[r * columns + c])).collect()).collect();
            let columns_of_rows = assign(&costs);
            let mut sorted = columns_of_rows.clone();
            sorted.sort_unstable();
            sorted.dedup();
            prop_assert_eq!(sorted.len(), rows, "each row has a column of its own");
            let total: f64 = columns_of_rows.iter().enumerate().map(|(row, &column)| costs[row][column]).sum();
            prop_assert_eq!(total, cheapest_by_trying_all(&costs, 0, &mut vec![false; columns]));
        }
    }
}
