//! Operators on real meshes against numbers that libigl computed.
//!
//! The tables were made once with libigl 2.6.3 in Python: for each mesh `L = igl.cotmatrix(V, F)`, its Frobenius norm
//! and `-fᵀLf` for `f = x·y + z² + x`; `M = igl.massmatrix(V, F, type)`, the sum of the barycentric one and the
//! Euclidean norms of both diagonals; and norm and energy of `igl.intrinsic_delaunay_cotmatrix(V, F)`.

mod support;

use armature_geometry::operators::{
    Lumping, SparseMatrix, cotangent_laplacian, cotangent_laplacian_tetrahedra, intrinsic_delaunay_laplacian,
    lumped_mass, lumped_mass_tetrahedra,
};

struct OfTriangles {
    file: &'static str,
    norm: f64,
    energy: f64,
    area: f64,
    barycentric: f64,
    voronoi: f64,
    /// Norm and energy of the intrinsic Delaunay Laplacian; closed meshes only, because libigl leaves obtuse angles at
    /// boundaries, where we double the mesh.
    intrinsic: Option<[f64; 2]>,
}

#[rustfmt::skip]
const TRIANGLES: [OfTriangles; 7] = [
    OfTriangles { file: "armadillo.obj", norm: 950.285_212_096_722_5, energy: 1.249_435_986_979_198_2, area: 1.657_156_276_825_639_2, barycentric: 0.009_417_091_607_764_935, voronoi: 0.009_139_103_795_816_443, intrinsic: Some([913.225_435_057_016_5, 1.248_889_019_662_927_4]) },
    OfTriangles { file: "elephant.obj", norm: 347.964_793_819_459_9, energy: 169_956_147.365_232_44, area: 31_570.701_395_575_063, barycentric: 479.329_155_100_909_3, voronoi: 470.572_329_958_997_4, intrinsic: Some([337.325_967_188_549_44, 169_940_143.215_557_43]) },
    OfTriangles { file: "arm.obj", norm: 526.963_881_759_410_7, energy: 1.608_354_733_906_993, area: 1.298_262_021_160_174_3, barycentric: 0.020_271_900_139_302_173, voronoi: 0.019_599_227_822_101_935, intrinsic: Some([481.248_207_775_235_5, 1.608_255_387_578_067_6]) },
    OfTriangles { file: "spot.obj", norm: 264.618_468_205_084_7, energy: 7.769_037_590_415_627_5, area: 5.709_518_785_165_158, barycentric: 0.125_259_919_494_496_8, voronoi: 0.124_527_406_886_243_2, intrinsic: Some([261.387_170_789_163, 7.768_535_655_818_262]) },
    OfTriangles { file: "cow.off", norm: 359.919_560_185_562_6, energy: 1.036_633_303_432_694_7, area: 1.089_454_374_637_299_8, barycentric: 0.029_183_259_215_505_92, voronoi: 0.029_119_334_129_256_155, intrinsic: Some([307.735_733_093_443_1, 1.034_397_663_960_423_3]) },
    OfTriangles { file: "woody.obj", norm: 103.128_314_019_670_5, energy: 6_058_100_796.893_036, area: 70_032.0, barycentric: 2_758.614_737_065_625_4, voronoi: 2_734.206_604_118_147, intrinsic: None },
    OfTriangles { file: "truck.obj", norm: 1_527.001_595_702_863_1, energy: 7.694_547_615_021_603_4, area: 7.116_489_740_447_639, barycentric: 0.399_991_166_653_576_2, voronoi: 0.393_300_803_611_826_8, intrinsic: None },
];

/// File, norm, energy, volume, norm of the barycentric mass.
const TETRAHEDRA: [(&str, [f64; 4]); 2] = [
    ("hand.mesh", [17.047_339_862_594_253, 0.121_400_745_868_522_5, 0.160_465_575_988_793, 0.004_228_799_361_785_247]),
    (
        "octopus-low.mesh",
        [7.925_165_516_686_079_5, 0.008_888_226_767_009_235, 0.009_135_547_847_518_2, 0.000_906_493_398_340_877_1],
    ),
];

fn near(what: &str, got: f64, expected: f64) {
    assert!((got - expected).abs() <= 1e-9 * expected.abs(), "{what}: {got} is not {expected}");
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn energy(laplacian: &SparseMatrix, vertices: &[[f64; 3]]) -> f64 {
    let f: Vec<f64> = vertices.iter().map(|[x, y, z]| x * y + z * z + x).collect();
    -f.iter().zip(laplacian.multiply(&f)).map(|(f, lf)| f * lf).sum::<f64>()
}

/// Symmetric bit for bit, finite, and constants in the null space.
fn check_invariants(what: &str, laplacian: &SparseMatrix) {
    assert_eq!(laplacian, &laplacian.transpose(), "{what}: not symmetric");
    assert!(laplacian.values().iter().all(|v| v.is_finite()), "{what}: not finite");
    let ones = laplacian.multiply(&vec![1.0; laplacian.rows()]);
    for (row, (sum, diagonal)) in ones.iter().zip(laplacian.diagonal()).enumerate() {
        assert!(sum.abs() <= 1e-12 * (1.0 + diagonal.abs()), "{what}: row {row} sums to {sum}");
    }
}

#[test]
fn triangle_operators_agree_on_every_shared_mesh() {
    for expected in &TRIANGLES {
        let Some(mesh) = support::shared_triangles(expected.file) else { continue };
        let laplacian = cotangent_laplacian(&mesh).unwrap();
        assert_eq!(laplacian.degenerate_elements, 0);
        check_invariants(expected.file, &laplacian.matrix);
        near(expected.file, norm(laplacian.matrix.values()), expected.norm);
        near(expected.file, energy(&laplacian.matrix, &mesh.vertices), expected.energy);
        let barycentric = lumped_mass(&mesh, Lumping::Barycentric).unwrap();
        let voronoi = lumped_mass(&mesh, Lumping::VoronoiHybrid).unwrap();
        near(expected.file, norm(&barycentric), expected.barycentric);
        near(expected.file, norm(&voronoi), expected.voronoi);
        near(expected.file, barycentric.iter().sum(), expected.area);
        near(expected.file, voronoi.iter().sum(), expected.area);
    }
}

#[test]
fn intrinsic_delaunay_agrees_on_closed_meshes_and_conducts_forward_on_all() {
    for expected in &TRIANGLES {
        let Some(mesh) = support::shared_triangles(expected.file) else { continue };
        let intrinsic = intrinsic_delaunay_laplacian(&mesh, Lumping::VoronoiHybrid).unwrap();
        check_invariants(expected.file, &intrinsic.matrix);
        assert_eq!((intrinsic.clamped_edges, intrinsic.omitted_triangles), (0, 0), "{}", expected.file);
        for column in 0..intrinsic.matrix.columns() {
            assert!(intrinsic.matrix.column(column).all(|(row, value)| row == column || value >= 0.0));
        }
        near(expected.file, intrinsic.mass.iter().sum(), expected.area);
        if let Some([norm_expected, energy_expected]) = expected.intrinsic {
            assert!(!intrinsic.doubled, "{}", expected.file);
            near(expected.file, norm(intrinsic.matrix.values()), norm_expected);
            near(expected.file, energy(&intrinsic.matrix, &mesh.vertices), energy_expected);
        }
    }
}

#[test]
fn tetrahedron_operators_agree_on_every_shared_mesh() {
    for (file, [norm_expected, energy_expected, volume, mass_expected]) in TETRAHEDRA {
        let Some(mesh) = support::shared_tetrahedra(file) else { continue };
        let laplacian = cotangent_laplacian_tetrahedra(&mesh).unwrap();
        assert_eq!(laplacian.degenerate_elements, 0);
        check_invariants(file, &laplacian.matrix);
        near(file, norm(laplacian.matrix.values()), norm_expected);
        near(file, energy(&laplacian.matrix, &mesh.vertices), energy_expected);
        let mass = lumped_mass_tetrahedra(&mesh, Lumping::Barycentric).unwrap();
        near(file, norm(&mass), mass_expected);
        near(file, mass.iter().sum(), volume);
        near(file, lumped_mass_tetrahedra(&mesh, Lumping::VoronoiHybrid).unwrap().iter().sum(), volume);
    }
}
