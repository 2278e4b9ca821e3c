//! The text file of `armature surface edit`.

use std::path::Path;

use armature_fairing::edit::{RegionSettings, SharpCurve, near_vertices, vertices_within};
use armature_fairing::mixed::Energy;
use armature_geometry::TriangleMesh;
use glam::DVec3;

use crate::failure::Failure;
use crate::files::places;

/// What is asked for, as vertices of a mesh.
#[derive(Debug, PartialEq)]
pub(super) struct Edit {
    pub(super) settings: RegionSettings,
    pub(super) region: Vec<u32>,
    pub(super) handles: Vec<u32>,
    pub(super) sharp: Vec<SharpCurve>,
    /// One for each handle.
    pub(super) dragged: Vec<[f64; 3]>,
}

/// One line.
enum Condition {
    Smooth(Energy),
    Within(f64),
    Region { centre: DVec3, radius: f64 },
    Drag { vertices: Vec<u32>, by: [f64; 3] },
    Sharp { curve: SharpCurve, by: [f64; 3] },
}

/// Reads conditions for `mesh`.
pub(super) fn read_conditions(path: &Path, text: &str, mesh: &TriangleMesh) -> Result<Edit, Failure> {
    let wrong = |line: usize, what: String| {
        Failure::input(
            format!("{}, line {}: {what}", path.display(), line + 1),
            "`armature surface edit --help` lists the conditions",
        )
    };
    let mut edit = Edit {
        settings: RegionSettings { energy: Energy::LaplacianGradient },
        region: Vec::new(),
        handles: Vec::new(),
        sharp: Vec::new(),
        dragged: Vec::new(),
    };
    let mut within = None;
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        match parse(line, mesh).map_err(|what| wrong(number, what))? {
            Condition::Smooth(energy) => edit.settings.energy = energy,
            Condition::Within(reach) => within = Some(reach),
            Condition::Region { centre, radius } => edit.region.extend(
                (0..mesh.vertices.len() as u32)
                    .filter(|&v| DVec3::from(mesh.vertices[v as usize]).distance(centre) <= radius),
            ),
            Condition::Drag { vertices, by } => {
                edit.dragged.extend(vertices.iter().map(|_| by));
                edit.handles.extend(vertices);
            }
            Condition::Sharp { curve, by } => {
                edit.dragged.extend(curve.vertices.iter().map(|_| by));
                edit.handles.extend(&curve.vertices);
                edit.sharp.push(curve);
            }
        }
    }
    let file = |what: &str, remedy: &str| Failure::input(format!("{}: {what}", path.display()), remedy);
    if edit.handles.is_empty() {
        return Err(file("nothing is dragged", "add a line such as: drag 0 1.6 0.2 by 0 0 0.3"));
    }
    if let Some(reach) = within {
        edit.region.extend(vertices_within(mesh, &edit.handles, reach));
    }
    edit.region.sort_unstable();
    edit.region.dedup();
    if edit.region.is_empty() {
        return Err(file("no vertex may give way", "add a line such as: within 0.3"));
    }
    Ok(edit)
}

fn parse(line: &str, mesh: &TriangleMesh) -> Result<Condition, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let rest = &words[1..];
    match words[0] {
        "smooth" => match rest {
            ["tangent"] => Ok(Condition::Smooth(Energy::Laplacian)),
            ["curvature"] => Ok(Condition::Smooth(Energy::LaplacianGradient)),
            _ => Err("smooth is followed by tangent or curvature".into()),
        },
        "within" => match places::numbers(rest)?.as_slice() {
            &[reach] if reach > 0.0 => Ok(Condition::Within(reach)),
            _ => Err("within is followed by one length above 0".into()),
        },
        "region" => places::ball(rest).map(|(centre, radius)| Condition::Region { centre, radius }),
        "drag" => {
            let (what, by) = moved(rest)?;
            let vertices = match what {
                ["vertex", vertex] => vec![vertex_of(vertex, mesh)?],
                point => nearest(point, mesh)?,
            };
            Ok(Condition::Drag { vertices, by })
        }
        "hold" => Ok(Condition::Drag { vertices: nearest(rest, mesh)?, by: [0.0; 3] }),
        "curve" => {
            let (vertices, by) = curve(rest, mesh)?;
            Ok(Condition::Drag { vertices, by })
        }
        "sharp" => {
            let at = rest.iter().position(|&word| word == "slopes").unwrap_or(rest.len());
            let (vertices, by) = curve(&rest[..at], mesh)?;
            let slopes = rest.get(at + 1..).map(slopes).transpose()?;
            Ok(Condition::Sharp { curve: SharpCurve { vertices, slopes }, by })
        }
        other => Err(format!("{other:?} is no condition")),
    }
}

/// Vertices along a curve, and how they move.
fn curve(words: &[&str], mesh: &TriangleMesh) -> Result<(Vec<u32>, [f64; 3]), String> {
    let (what, by) = moved(words)?;
    let vertices: Vec<u32> = what.iter().map(|word| vertex_of(word, mesh)).collect::<Result<_, _>>()?;
    if vertices.is_empty() {
        return Err("a curve is vertices, the word by, and a vector".into());
    }
    Ok((vertices, by))
}

/// Two vectors.
fn slopes(words: &[&str]) -> Result<[[f64; 3]; 2], String> {
    match places::numbers(words)?.as_slice() {
        &[a, b, c, d, e, f] => Ok([[a, b, c], [d, e, f]]),
        _ => Err("slopes is followed by six numbers: a vector for the left side and one for the right".into()),
    }
}

/// What comes before `by`, and the vector after it.
fn moved<'a, 'b>(words: &'a [&'b str]) -> Result<(&'a [&'b str], [f64; 3]), String> {
    let at = words.iter().position(|&word| word == "by").ok_or("the word by is missing, followed by a vector")?;
    let by = places::numbers(&words[at + 1..])?;
    let by = by.try_into().map_err(|_| "by is followed by three numbers".to_owned())?;
    Ok((&words[..at], by))
}

fn vertex_of(word: &str, mesh: &TriangleMesh) -> Result<u32, String> {
    places::vertex(word, mesh.vertices.len()).map(|vertex| vertex as u32)
}

fn nearest(words: &[&str], mesh: &TriangleMesh) -> Result<Vec<u32>, String> {
    near_vertices(mesh, &[places::point(words)?]).ok_or_else(|| "the mesh has no triangles".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Edit, Failure> {
        let mesh = TriangleMesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0, 9.0, 9.0]],
            triangles: vec![[0, 1, 2]],
        };
        read_conditions(Path::new("c.txt"), text, &mesh)
    }

    #[test]
    fn conditions_become_vertices() {
        let edit =
            read("# a nose\nsmooth tangent\nwithin 1.2\ndrag 0.9 0 0 by 0 0 1 # up\nhold 9 9 8\nsharp 2 by 0 0 2\n")
                .unwrap();
        assert_eq!(edit.handles, [1, 1, 2]);
        assert_eq!(edit.dragged, [[0.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, 2.0]]);
        assert_eq!((edit.region, edit.sharp), (vec![0, 1, 2], vec![SharpCurve { vertices: vec![2], slopes: None }]));
        assert_eq!(edit.settings.energy, Energy::Laplacian);
        let ball = read("region 0 0 0 0.5\ndrag vertex 1 by 1 0 0").unwrap();
        assert_eq!((ball.region, ball.settings.energy), (vec![0], Energy::LaplacianGradient));
    }

    #[test]
    fn mistakes_are_named_by_their_line() {
        for (text, word) in [
            ("drag 0 0 0 by 1 0", "line 1: by is followed by three numbers"),
            ("\npull 1", "line 2: \"pull\" is no condition"),
            ("drag 0 0 nan by 0 0 0", "is not a number"),
            ("drag vertex 4 by 0 0 0", "numbered from 0 to 3"),
            ("curve by 0 0 0", "a curve is vertices"),
            ("sharp 0 1 by 0 0 0 slopes 1 2 3", "six numbers"),
            ("within -1", "above 0"),
            ("region 1 2 3", "radius"),
            ("smooth butter", "tangent or curvature"),
            ("drag 0 0 0", "the word by is missing"),
            ("within 1", "nothing is dragged"),
            ("drag vertex 0 by 0 0 1", "no vertex may give way"),
        ] {
            let failure = read(text).unwrap_err();
            assert!(failure.what.contains(word), "{text}: {}", failure.what);
        }
    }
}
