//! Functions with controlled extrema: against analytic solutions, an interior point method, and bounded weights.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::operators::{
    Lumping, SparseMatrix, cotangent_laplacian, cotangent_laplacian_tetrahedra, lumped_mass, lumped_mass_tetrahedra,
};
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use armature_weights::biharmonic::{
    BiharmonicProblem, BiharmonicSettings, ExactPartitionSettings, bounded_biharmonic_weights, exact_partition_weights,
};
use armature_weights::extrema::{ExtremaError, Neighbours, local_extrema};
use armature_weights::finish::normalise;
use armature_weights::handles::HandleBoundary;
use armature_weights::monotone::{
    ConicOutcome, ConicProblem, Data, Keep, MonotoneError, MonotoneFunction, MonotoneOutcome, MonotoneProblem,
    MonotoneSettings, PrescribedFunction, Role, ValueSource, interior_point, least_squares_form, monotone_functions,
    monotone_interpolation, monotone_partition, monotone_weights, smooth_keeping,
};
use armature_weights::quadratic::{LinearConditions, QuadraticProblem, QuadraticSettings, constrained_minimum};
use support::{flat_shape, nearest, solid_shape};

struct Shape {
    vertices: Vec<[f64; 3]>,
    neighbours: Neighbours,
    laplacian: SparseMatrix,
    mass: Vec<f64>,
}

impl Shape {
    fn flat(mesh: &TriangleMesh) -> Self {
        Self {
            neighbours: Neighbours::of_elements(mesh.vertices.len(), &mesh.triangles).unwrap(),
            laplacian: cotangent_laplacian(mesh).unwrap().matrix,
            mass: lumped_mass(mesh, Lumping::Barycentric).unwrap(),
            vertices: mesh.vertices.clone(),
        }
    }

    fn solid(mesh: &TetrahedralMesh) -> Self {
        Self {
            neighbours: Neighbours::of_elements(mesh.vertices.len(), &mesh.tetrahedra).unwrap(),
            laplacian: cotangent_laplacian_tetrahedra(mesh).unwrap().matrix,
            mass: lumped_mass_tetrahedra(mesh, Lumping::Barycentric).unwrap(),
            vertices: mesh.vertices.clone(),
        }
    }

    fn problem(&self, order: usize) -> MonotoneProblem<'_> {
        let Self { neighbours, laplacian, mass, .. } = self;
        MonotoneProblem { neighbours, laplacian, mass, order, blend: None, data: None }
    }

    /// Point handles at these places.
    fn held(&self, places: &[[f64; 3]]) -> HandleBoundary {
        let mut fixed: Vec<usize> = places.iter().map(|&place| nearest(&self.vertices, place)).collect();
        let own = fixed.clone();
        fixed.sort_unstable();
        let column = |handle: usize| fixed.iter().map(move |&v| (v, handle)).collect::<Vec<_>>();
        let one =
            |handle| column(handle).into_iter().map(|(v, h)| f64::from(u8::from(own[h] == v))).collect::<Vec<_>>();
        let fixed_weights = (0..own.len()).flat_map(one).collect();
        HandleBoundary { fixed, fixed_weights, handles: own.len() }
    }
}

fn on(_: &'static str, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn solve(
    problem: &MonotoneProblem<'_>,
    fixed: &[usize],
    values: &[f64],
    settings: &MonotoneSettings,
) -> Result<MonotoneFunction, MonotoneError> {
    let prescribed = PrescribedFunction::between_extremes(values);
    monotone_functions(problem, fixed, &[prescribed], settings, &mut on).map(|mut all| all.remove(0))
}

/// A bar with a long rod across: the "propeller worm" of the paper's figure 7.
fn propeller(h: f64) -> (Shape, Vec<[f64; 3]>) {
    let bar = |y: f64| (2.0..3.0).contains(&y);
    let mesh = flat_shape(h, [4.0, 5.0], |x, y| bar(y) || (2.9..3.25).contains(&x));
    (Shape::flat(&mesh), vec![[0.3, 2.5, 0.0], [1.7, 2.5, 0.0], [3.7, 2.5, 0.0]])
}

/// A trunk with two bent arms.
fn cactus(h: f64) -> (Shape, Vec<[f64; 3]>) {
    let within = |v: f64, from: f64, to: f64| (from..to).contains(&v);
    let inside = |x: f64, y: f64| {
        within(x, 1.5, 2.5)
            || (within(x, 0.0, 1.5) && within(y, 1.0, 1.5))
            || (within(x, 0.0, 0.5) && within(y, 1.0, 4.0))
            || (within(x, 2.5, 4.0) && within(y, 1.5, 2.0))
            || (within(x, 3.5, 4.0) && within(y, 1.5, 4.5))
    };
    let mesh = flat_shape(h, [4.0, 5.0], inside);
    (Shape::flat(&mesh), vec![[2.0, 0.3, 0.0], [2.0, 2.5, 0.0], [2.0, 4.7, 0.0]])
}

/// A solid body with a tail.
fn tailed(h: f64) -> (Shape, Vec<[f64; 3]>) {
    let inside = |[x, y, z]: [f64; 3]| x < 2.4 || ((0.4..1.0).contains(&y) && (0.0..0.6).contains(&z));
    let mesh = solid_shape(h, [5.6, 1.4, 1.0], inside);
    (Shape::solid(&mesh), vec![[0.4, 0.6, 0.4], [1.2, 0.6, 0.4], [2.0, 0.6, 0.4]])
}

/// A solid pipe that ends in a bell.
fn horn(h: f64) -> (Shape, Vec<[f64; 3]>) {
    let inside = |[x, y, z]: [f64; 3]| {
        let radius = if x < 3.6 { 0.45 } else { 1.1 };
        (y - 1.2).hypot(z - 1.2) < radius
    };
    let mesh = solid_shape(h, [4.8, 2.4, 2.4], inside);
    (Shape::solid(&mesh), vec![[0.2, 1.2, 1.2], [1.2, 1.2, 1.2], [2.2, 1.2, 1.2]])
}

/// A name, a shape, and the places of its handles.
type Named = (&'static str, (Shape, Vec<[f64; 3]>));

fn shapes() -> [Named; 4] {
    [("propeller", propeller(1.0 / 12.0)), ("cactus", cactus(0.1)), ("tail", tailed(0.2)), ("horn", horn(0.2))]
}

#[test]
fn appendages_of_bounded_weights_have_extrema_and_those_of_monotone_ones_none() {
    let mut without = Vec::new();
    for (name, (shape, places)) in shapes() {
        let held = shape.held(&places);
        let bounded = BiharmonicProblem::new(&shape.laplacian, &shape.mass, &held);
        let bounded = bounded_biharmonic_weights(&bounded, &BiharmonicSettings::certified(), &mut on).unwrap();
        let settings = MonotoneSettings { convexifications: 3, ..MonotoneSettings::certified() };
        let monotone = monotone_weights(&shape.problem(2), &held, &settings, &mut on).unwrap();
        let mut spurious = 0;
        for handle in 0..held.handles {
            let count = |values: &[f64]| local_extrema(&shape.neighbours, values).unwrap().besides(&held.fixed).count();
            spurious += count(&bounded.weights.bone(handle));
            let report = &monotone.reports[handle];
            println!("{name} {handle}: bounded {} {report:?}", bounded.reports[handle].energy);
            assert_eq!(count(&monotone.weights.bone(handle)), 0, "{name} {handle}");
            assert_eq!(report.spurious, 0, "{name} {report:?}");
            assert!(report.error_bound < 2e-3, "{name} {report:?}");
            assert!(report.slack >= 0.0 && report.margin > 0.0, "{name} {report:?}");
            assert!(report.energies.windows(2).all(|pair| pair[1] <= pair[0]), "{name} {report:?}");
            let below = bounded.reports[handle].energy - report.energy;
            assert!(below <= bounded.reports[handle].gap, "{name} {handle}: {below} below the bounded ones");
        }
        let mut weights = monotone.weights.clone();
        normalise(&mut weights);
        let after: usize = (0..held.handles)
            .map(|h| local_extrema(&shape.neighbours, &weights.bone(h)).unwrap().besides(&held.fixed).count())
            .sum();
        println!(
            "{name}: {} vertices, {spurious} spurious extrema of bounded weights, {after} after normalising",
            shape.mass.len()
        );
        if spurious == 0 {
            without.push(name);
        }
    }
    assert!(without.is_empty(), "{without:?}: bounded weights have no extrema of their own");
}

#[test]
fn handles_solved_together_sum_to_one_and_have_no_extrema_of_their_own() {
    for (name, (shape, places)) in shapes() {
        let held = shape.held(&places);
        // Of order three on the flat shapes only, to save time.
        let orders = if shape.vertices.iter().all(|vertex| vertex[2] == 0.0) { 2..=3 } else { 2..=2 };
        for order in orders {
            let problem = shape.problem(order);
            let settings = MonotoneSettings::default();
            let made = monotone_partition(&problem, &held, &settings, &mut on).unwrap();
            let report = &made.report;
            println!("{name}, order {order}: {report:?}");
            assert_eq!(report.outcome, MonotoneOutcome::Converged, "{name} {report:?}");
            assert!(report.slack >= 0.0 && report.margin > 0.0 && report.largest_sum_error < 1e-15, "{report:?}");
            let spurious = |weights: &WeightMatrix| {
                let count =
                    |h| local_extrema(&shape.neighbours, &weights.bone(h)).unwrap().besides(&held.fixed).count();
                (0..held.handles).map(count).sum::<usize>()
            };
            assert_eq!((spurious(&made.weights), report.spurious), (0, 0), "{name}");
            let mut scaled = monotone_weights(&problem, &held, &settings, &mut on).unwrap();
            let alone: f64 = scaled.reports.iter().map(|report| report.energy - report.gap).sum();
            assert!(report.energy >= alone, "{name}: {} and {alone} alone", report.energy);
            normalise(&mut scaled.weights);
            println!("  {} alone, with {} spurious extrema after scaling", alone, spurious(&scaled.weights));
            if order == 2 {
                let bounded = BiharmonicProblem::new(&shape.laplacian, &shape.mass, &held);
                let bounded = exact_partition_weights(&bounded, &ExactPartitionSettings::default(), &mut on).unwrap();
                let (energy, gap) = (bounded.report.energy, bounded.report.gap);
                println!("  bounded, together: {energy} within {gap}, {} extrema", spurious(&bounded.weights));
                assert!(report.energy >= energy - gap, "{name}: {} below {energy}", report.energy);
            }
        }
    }
}

#[test]
fn too_many_handles_are_not_solved_together() {
    let shape = Shape::flat(&flat_shape(0.02, [1.0, 1.0], |_, _| true));
    let places: Vec<[f64; 3]> = (0..20).map(|k| [0.05 * f64::from(k), 0.5, 0.0]).collect();
    let refused = monotone_partition(&shape.problem(2), &shape.held(&places), &MonotoneSettings::default(), &mut on);
    let error = refused.unwrap_err();
    assert!(matches!(error, MonotoneError::TooManyTogether { handles: 20, .. }), "{error}");
}

/// The same problem in conic form.
fn conic<const N: usize>(
    shape: &Shape,
    elements: &[[u32; N]],
    order: usize,
    (fixed, values): (&[usize], &[f64]),
    like: &MonotoneFunction,
) -> (f64, Vec<f64>) {
    let (mut root, rows) = least_squares_form(&shape.vertices, elements, &shape.laplacian, &shape.mass, order);
    // It comes closest where the energy is about a tenth.
    let scale = 0.3 * like.report.energy.sqrt().recip();
    root.iter_mut().for_each(|(_, _, value)| *value *= scale);
    let rising = like.rising.iter().map(|edge| edge.map(|vertex| vertex as usize)).collect();
    let fixed = fixed.iter().copied().zip(values.iter().copied()).collect();
    let count = shape.mass.len();
    let problem = ConicProblem { count, root, rows, linear: Vec::new(), fixed, rising, margin: like.report.margin };
    let solved = interior_point(&problem).unwrap();
    let fallen = like.rising.iter().map(|&[a, b]| solved.values[a as usize] - solved.values[b as usize]);
    let fallen = fallen.fold(f64::NEG_INFINITY, f64::max) + like.report.margin;
    let missed = problem.fixed.iter().map(|&(place, value)| (solved.values[place] - value).abs()).fold(0.0, f64::max);
    println!(
        "order {order}: {:?} in {} iterations, missed by {missed:e} and {fallen:e}",
        solved.outcome, solved.iterations
    );
    assert!(matches!(solved.outcome, ConicOutcome::Converged | ConicOutcome::AlmostConverged), "{solved:?}");
    (solved.energy / (scale * scale), solved.values)
}

/// The same problem as a quadratic energy under general linear conditions.
fn by_linear_conditions<const N: usize>(
    shape: &Shape,
    elements: &[[u32; N]],
    order: usize,
    (fixed, values): (&[usize], &[f64]),
    like: &MonotoneFunction,
) -> Vec<f64> {
    let (root, rows) = least_squares_form(&shape.vertices, elements, &shape.laplacian, &shape.mass, order);
    let n = shape.mass.len();
    let mut by_row = vec![Vec::new(); rows];
    root.into_iter().for_each(|(row, column, value)| by_row[row].push((column as u32, value)));
    let squares = by_row.iter().flat_map(|row| row.iter().flat_map(|a| row.iter().map(|b| (a.0, b.0, a.1 * b.1))));
    let matrix = |rows: usize, entries: Vec<_>| SparseMatrix::from_triplets(rows, n, &entries).unwrap();
    let given = fixed.iter().enumerate().map(|(row, &vertex)| (row as u32, vertex as u32, 1.0));
    let rises = like.rising.iter().enumerate();
    let rises = rises.flat_map(|(row, &[low, high])| [(row as u32, low, 1.0), (row as u32, high, -1.0)]);
    let problem = QuadraticProblem {
        quadratic: matrix(n, squares.collect()),
        linear: vec![0.0; n],
        constant: 0.0,
        equalities: LinearConditions { matrix: matrix(fixed.len(), given.collect()), bounds: values.to_vec() },
        inequalities: LinearConditions {
            matrix: matrix(like.rising.len(), rises.collect()),
            bounds: vec![-like.report.margin; like.rising.len()],
        },
    };
    let settings = QuadraticSettings { relative_gap: 1e-13, ..QuadraticSettings::default() };
    constrained_minimum(&problem, &settings, &mut on).unwrap().values
}

#[test]
fn agrees_with_the_conic_form_in_all_orders() {
    for (h, order) in [(0.5, 2), (0.5, 3), (0.5, 4), (0.25, 2), (0.25, 3), (0.25, 4)] {
        let mesh = flat_shape(h, [4.0, 3.0], |x, y| (1.0..2.0).contains(&y) || (2.5..3.0).contains(&x));
        let shape = Shape::flat(&mesh);
        let fixed = [[0.25, 1.5, 0.0], [1.75, 1.5, 0.0], [3.75, 1.5, 0.0], [1.0, 1.5, 0.0]]
            .map(|p| nearest(&shape.vertices, p));
        let values = [0.0, 1.0, 0.0, 0.5];
        let settings = MonotoneSettings { error_bound: 1e-7, relative_gap: 1e-12, ..MonotoneSettings::certified() };
        let ours = solve(&shape.problem(order), &fixed, &values, &settings).unwrap();
        let (energy, theirs) = conic(&shape, &mesh.triangles, order, (&fixed, &values), &ours);
        let apart = ours.values.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("order {order}: {} and {energy}, {apart:e} apart, {:?}", ours.report.energy, ours.report);
        assert_eq!(ours.report.spurious, 0);
        assert!((ours.report.energy / energy - 1.0).abs() < 1e-6, "order {order}");
        // Clarabel misses its conditions a little: where it finds less energy than there can be, it is the less exact one.
        let is_less_exact = energy < ours.report.energy - ours.report.gap;
        assert!(apart < if is_less_exact { 5e-6 } else { 1e-6 }, "order {order}: {apart}");
        let third = by_linear_conditions(&shape, &mesh.triangles, order, (&fixed, &values), &ours);
        let apart = ours.values.iter().zip(&third).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("order {order}: {apart:e} from the general solver");
        assert!(apart < 1e-6, "order {order}: {apart} from the general solver");
    }
}

#[test]
fn strips_converge_to_the_analytic_solutions() {
    // Their odd derivatives up to the third, or fifth, are zero at the ends.
    let exact: [fn(f64) -> f64; 3] = [
        |x| x * x * (3.0 - 2.0 * x),
        |x| 0.5 * x * x * (5.0 - 5.0 * x * x + 2.0 * x * x * x),
        |x| x * x * (42.0 - x * x * (35.0 - x * x * (14.0 - 4.0 * x))) / 17.0,
    ];
    for (order, exact) in (2..).zip(exact) {
        let mut before = f64::INFINITY;
        for cells in [8, 16, 32] {
            let h = 1.0 / f64::from(cells);
            let mesh = flat_shape(h, [1.0, 3.0 * h], |_, _| true);
            // Barycentric masses differ from vertex to vertex on this pattern, and the third derivative sees that.
            let mass = lumped_mass(&mesh, Lumping::VoronoiHybrid).unwrap();
            let shape = Shape { mass, ..Shape::flat(&mesh) };
            let ends: Vec<usize> = (0..shape.mass.len())
                .filter(|&v| shape.vertices[v][0] < 0.5 * h || shape.vertices[v][0] > 1.0 - 0.5 * h)
                .collect();
            let values: Vec<f64> = ends.iter().map(|&v| shape.vertices[v][0].round()).collect();
            let made = solve(&shape.problem(order), &ends, &values, &MonotoneSettings::certified()).unwrap();
            let off = |v: usize| (made.values[v] - exact(shape.vertices[v][0])).abs();
            let worst = (0..shape.mass.len()).map(off).fold(0.0, f64::max);
            println!("order {order}, {cells} cells: {worst:e} {:?}", made.report.outcome);
            assert!(worst < 0.6 * before, "order {order}, {cells} cells: {worst} after {before}");
            before = worst;
        }
        assert!(before < 0.02, "order {order}: {before}");
    }
}

#[test]
fn noisy_data_keep_exactly_the_chosen_extrema() {
    let disc = flat_shape(0.05, [2.0, 2.0], |x, y| (x - 1.0).hypot(y - 1.0) < 1.0);
    let shape = Shape::flat(&disc);
    let noise =
        |k: usize| (((k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / f64::from(1 << 24)) - 0.5;
    let hill = |[x, y, _]: [f64; 3], at: [f64; 2], size: f64| {
        size * (-12.0 * ((x - at[0]).powi(2) + (y - at[1]).powi(2))).exp()
    };
    let clean = |v: [f64; 3]| hill(v, [0.6, 0.8], 1.0) + hill(v, [1.5, 1.2], 0.7) - hill(v, [0.9, 1.5], 0.8);
    let data: Vec<f64> = shape.vertices.iter().enumerate().map(|(k, &v)| clean(v) + 0.15 * noise(k)).collect();
    let data = Data { values: &data, fidelity: 2e4 };
    let settings = MonotoneSettings::default();
    let made = smooth_keeping(&shape.problem(2), data, Keep::Persistence(0.4), &settings, &mut on).unwrap();
    println!("{} of {}: {:?}", made.kept.len(), made.before, made.function.report);
    let found = local_extrema(&shape.neighbours, &made.function.values).unwrap();
    let (minima, maxima): (Vec<_>, Vec<_>) = made.kept.iter().copied().partition(|one| one.is_minimum);
    assert_eq!((found.minima.len(), found.maxima.len()), (minima.len(), maxima.len()));
    assert!(made.before > 100 && maxima.len() == 2, "{} {}", made.before, maxima.len());
    for kept in &made.kept {
        assert!(made.function.values[kept.vertex] - kept.value == 0.0, "stays where and what it is");
    }
    let rms = |values: &[f64]| {
        let squares = shape.vertices.iter().zip(values).map(|(&v, value)| (value - clean(v)).powi(2)).sum::<f64>();
        (squares / values.len() as f64).sqrt()
    };
    assert!(rms(&made.function.values) < 0.6 * rms(data.values), "{} {}", rms(&made.function.values), rms(data.values));
    let nothing = smooth_keeping(&shape.problem(2), data, Keep::Persistence(9.0), &settings, &mut on);
    assert!(matches!(nothing, Err(MonotoneError::NothingKept { most }) if most > 1.0), "{nothing:?}");
}

#[test]
fn values_spread_within_their_range_and_two_without_extrema_of_their_own() {
    let (shape, places) = propeller(0.125);
    let at: Vec<usize> = places.iter().map(|&place| nearest(&shape.vertices, place)).collect();
    let source = |vertex: usize, value: &[f64]| ValueSource { vertices: vec![vertex], value: value.to_vec() };
    let settings = MonotoneSettings::default();
    for order in 2..=4 {
        let problem = shape.problem(order);
        let two = [source(at[0], &[10.0, -1.0]), source(at[2], &[20.0, -1.5])];
        let made = monotone_interpolation(&problem, &two, &settings, &mut on).unwrap();
        assert_eq!((made.reports.len(), made.columns.len(), &made.unreached[..]), (1, 2, &[][..]));
        assert!(made.spurious.iter().all(Vec::is_empty), "order {order}: {:?}", made.spurious);
        assert!(made.columns[0].iter().all(|value| (10.0..=20.0).contains(value)));
        assert!((made.columns[1][at[2]] + 1.5).abs() < 1e-15 && (made.columns[1][at[0]] + 1.0).abs() < 1e-15);
        let three = [source(at[0], &[1.0]), source(at[1], &[5.0]), source(at[2], &[2.0])];
        let made = monotone_interpolation(&problem, &three, &settings, &mut on).unwrap();
        assert_eq!(made.reports.len(), 3);
        assert!(made.columns[0].iter().all(|value| (1.0..=5.0).contains(value)));
    }
    let problem = shape.problem(2);
    let one = monotone_interpolation(&problem, &[source(at[0], &[3.0])], &settings, &mut on).unwrap();
    assert!(one.columns[0].iter().all(|value| (value - 3.0).abs() < 1e-12));
    let twice = [source(at[0], &[3.0]), source(at[0], &[4.0])];
    let twice = monotone_interpolation(&problem, &twice, &settings, &mut on);
    assert_eq!(twice.map(|_| ()), Err(MonotoneError::FixedTwice { vertex: at[0] }));
    let mixed = [source(at[0], &[3.0]), source(at[1], &[4.0, 5.0])];
    let mixed = monotone_interpolation(&problem, &mixed, &settings, &mut on);
    assert!(matches!(mixed, Err(MonotoneError::Size { given: 2, wanted: 1, .. })), "{mixed:?}");
}

#[test]
fn what_cannot_be_is_named() {
    let (shape, _) = propeller(0.25);
    let problem = shape.problem(2);
    let settings = MonotoneSettings::default();
    let [a, b] = [[0.25, 2.5, 0.0], [3.75, 2.5, 0.0]].map(|place| nearest(&shape.vertices, place));
    let roles = |values: &[f64], roles: &[Role]| {
        let prescribed = PrescribedFunction { values: values.to_vec(), roles: roles.to_vec() };
        monotone_functions(&problem, &[a, b], &[prescribed], &settings, &mut on).map(|_| ())
    };
    let contradiction = roles(&[1.0, 0.0], &[Role::Minimum, Role::Maximum]);
    assert!(
        matches!(contradiction, Err(MonotoneError::Contradiction { below, .. }) if below == a),
        "{contradiction:?}"
    );
    let lacking = roles(&[0.0, 1.0], &[Role::Between, Role::Maximum]);
    assert!(
        matches!(lacking, Err(MonotoneError::Extrema(ExtremaError::Lacking { lacking: "minimum", .. }))),
        "{lacking:?}"
    );
    assert!(matches!(roles(&[f64::NAN, 1.0], &[Role::Minimum; 2]), Err(MonotoneError::BadNumber { .. })));
    let nan = vec![f64::NAN; shape.mass.len()];
    let with = MonotoneProblem { data: Some(Data { values: &nan, fidelity: 1.0 }), ..problem };
    assert!(matches!(solve(&with, &[a, b], &[0.0, 1.0], &settings), Err(MonotoneError::BadNumber { .. })));
    assert!(matches!(solve(&shape.problem(5), &[a, b], &[0.0, 1.0], &settings), Err(MonotoneError::BadNumber { .. })));
    let twice = solve(&problem, &[a, a], &[0.0, 1.0], &settings);
    assert_eq!(twice, Err(MonotoneError::FixedTwice { vertex: a }));
    let stopped = monotone_functions(
        &problem,
        &[a, b],
        &[PrescribedFunction::between_extremes(&[0.0, 1.0])],
        &settings,
        &mut |_, done| if done > 0.1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) },
    );
    assert!(matches!(stopped, Err(MonotoneError::Cancelled { .. })), "{stopped:?}");
}

/// A sphere: an octahedron, every triangle divided into four this many times.
fn sphere(times: usize) -> TriangleMesh {
    let vertices =
        vec![[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mut mesh = TriangleMesh { vertices, triangles };
    for _ in 0..times {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in std::mem::take(&mut mesh.triangles) {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let [p, q] = [a, b].map(|v| mesh.vertices[v as usize]);
                    let sum: [f64; 3] = std::array::from_fn(|k| p[k] + q[k]);
                    let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                    mesh.vertices.push(sum.map(|x| x / length));
                    mesh.vertices.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        mesh.triangles = finer;
    }
    mesh
}

#[test]
fn a_noisy_closed_surface_keeps_as_many_extrema_as_were_asked_for() {
    let shape = Shape::flat(&sphere(4));
    let noise =
        |k: usize| (((k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / f64::from(1 << 24)) - 0.5;
    // Four hills and as many valleys around the equator, none at the poles.
    let clean = |[x, y, z]: [f64; 3]| (1.0 - z * z) * (4.0 * y.atan2(x)).sin() + 0.2 * x;
    let data: Vec<f64> = shape.vertices.iter().enumerate().map(|(k, &v)| clean(v) + 0.3 * noise(k)).collect();
    let data = Data { values: &data, fidelity: 1e4 };
    for (count, order) in [(8, 2), (5, 2), (2, 2), (6, 3)] {
        let made =
            smooth_keeping(&shape.problem(order), data, Keep::Most(count), &MonotoneSettings::default(), &mut on)
                .unwrap();
        let found = local_extrema(&shape.neighbours, &made.function.values).unwrap();
        println!("{count} of {}, order {order}: {:?}", made.before, made.function.report);
        assert_eq!((made.kept.len(), found.count()), (count, count));
        assert_eq!(made.function.report.spurious, 0);
        let kept: Vec<usize> = made.kept.iter().map(|one| one.vertex).collect();
        assert_eq!(found.besides(&kept).count(), 0, "exactly the kept ones");
        assert!(made.function.report.slack >= 0.0, "{:?}", made.function.report);
    }
    let one = smooth_keeping(&shape.problem(2), data, Keep::Most(1), &MonotoneSettings::default(), &mut on);
    assert!(matches!(one, Err(MonotoneError::BadNumber { .. })), "{one:?}");
}
