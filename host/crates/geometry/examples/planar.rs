//! Fills a flat mesh with triangles and writes them as a picture:
//! `cargo run --release -p armature-geometry --example planar -- MESH [LARGEST_EDGE] > picture.svg`.
//!
//! MESH is an OBJ or OFF file. Triangles are coloured by winding number; the outline's own vertices are dots.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use armature_geometry::planar::{PlanarDomain, PlanarInput, PlanarSettings, PlanarShape, planar_domain, plane_of};

#[path = "../tests/support/mod.rs"]
mod support;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().ok_or("which mesh? name an OBJ or OFF file")?;
    let mesh = support::read_triangles(Path::new(&name));
    let settings = PlanarSettings {
        largest_edge: arguments.next().map(|edge| edge.parse()).transpose()?,
        ..PlanarSettings::default()
    };
    let flat = plane_of(&mesh)?.ok_or("the mesh is not flat")?.flatten(&mesh);
    let shape = PlanarShape::Mesh { vertices: &flat.vertices, triangles: &flat.triangles };
    let input = PlanarInput { shape, bones: &[], points: &[] };
    let start = Instant::now();
    let domain = planar_domain(&input, &settings, &mut |_, _| ControlFlow::Continue(()))?;
    eprintln!("{name}: {} vertices, {} triangles", flat.vertices.len(), flat.triangles.len());
    let (vertices, triangles) = (domain.vertices.len(), domain.triangles.len());
    eprintln!("{vertices} vertices, {triangles} triangles in {:.3} s", start.elapsed().as_secs_f64());
    eprintln!("{:#?}", domain.report);
    print!("{}", picture(&domain));
    Ok(())
}

fn picture(domain: &PlanarDomain) -> String {
    let none = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let (low, high) =
        domain.vertices.iter().fold(none, |(l, h), p| ([0, 1].map(|k| p[k].min(l[k])), [0, 1].map(|k| p[k].max(h[k]))));
    let scale = 1000.0 / (high[0] - low[0]).max(high[1] - low[1]);
    let at = |v: u32| {
        let [x, y] = domain.vertices[v as usize];
        format!("{:.2},{:.2}", 5.0 + scale * (x - low[0]), 5.0 + scale * (high[1] - y))
    };
    let mut lines = vec![
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="1010" height="1010">"#.to_string(),
        r#"<rect width="1010" height="1010" fill="white"/>"#.to_string(),
    ];
    for (corners, winding) in domain.triangles.iter().zip(&domain.winding) {
        let colour = if *winding > 1.5 { "#f0a060" } else { "#a0c8f0" };
        let points = corners.map(at).join(" ");
        lines.push(format!(r##"<polygon points="{points}" fill="{colour}" stroke="#203040" stroke-width="0.4"/>"##));
    }
    for &v in &domain.input_vertices {
        let place = at(v);
        let (x, y) = place.split_once(',').unwrap_or_default();
        lines.push(format!(r##"<circle cx="{x}" cy="{y}" r="1.2" fill="#c02020"/>"##));
    }
    lines.push("</svg>\n".to_string());
    lines.join("\n")
}
