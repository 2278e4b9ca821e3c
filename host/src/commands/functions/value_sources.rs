//! The text file of `armature interpolate`.

use std::path::Path;

use armature_weights::FunctionDomain;
use armature_weights::monotone::ValueSource;
use glam::DVec3;

use crate::failure::Failure;
use crate::files::places;

const HELP: &str = "`armature interpolate --help` lists what a line may be";

/// Reads values for the vertices of a domain.
pub(super) fn read_value_sources(
    path: &Path,
    bytes: &[u8],
    domain: &FunctionDomain,
) -> Result<Vec<ValueSource>, Failure> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| Failure::input(format!("{} is not a text file", path.display()), HELP))?;
    let mut sources: Vec<ValueSource> = Vec::new();
    // The value that a vertex was given, and by which line.
    let mut owner: Vec<Option<(usize, Vec<f64>)>> = vec![None; domain.vertices.len()];
    for (index, line) in text.lines().enumerate() {
        let wrong = |what: String| Failure::input(format!("{}, line {}: {what}", path.display(), index + 1), HELP);
        let line = without_comment(line).trim();
        if line.is_empty() {
            continue;
        }
        let source = parse(line, domain).map_err(wrong)?;
        if let Some(first) = sources.first().filter(|first| first.value.len() != source.value.len()) {
            return Err(wrong(format!("{} numbers, but the first line has {}", source.value.len(), first.value.len())));
        }
        for &vertex in &source.vertices {
            match &owner[vertex] {
                Some((line, value)) if *value != source.value => {
                    return Err(wrong(format!("vertex {vertex} has another value by line {}", line + 1)));
                }
                _ => owner[vertex] = Some((index, source.value.clone())),
            }
        }
        sources.push(source);
    }
    if sources.is_empty() {
        return Err(Failure::input(format!("{}: no value is given", path.display()), HELP));
    }
    Ok(sources)
}

/// A `#` starts a comment, except in a colour, which it begins without a blank before its digits.
fn without_comment(line: &str) -> &str {
    let is_color =
        |at: usize| line[at + 1..].starts_with(|c: char| c.is_ascii_hexdigit()) && line[..at].trim_end().ends_with('=');
    let comment = line.char_indices().find(|&(at, c)| c == '#' && !is_color(at));
    comment.map_or(line, |(at, _)| &line[..at])
}

fn parse(line: &str, domain: &FunctionDomain) -> Result<ValueSource, String> {
    let (place, value) = line.split_once('=').ok_or("the sign = is missing, followed by a value")?;
    let words: Vec<&str> = place.split_whitespace().collect();
    let (kind, rest) = words.split_first().ok_or("the place before = is missing")?;
    let of_shape = |vertex: usize| domain.mass[vertex] > 0.0;
    let vertices = match *kind {
        "point" => {
            let point = DVec3::from(places::point(rest)?);
            let distance = |v: usize| DVec3::from(domain.vertices[v]).distance_squared(point);
            let nearest = (0..domain.vertices.len()).filter(|&v| of_shape(v));
            let nearest = nearest.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            vec![nearest.ok_or("the mesh has no elements")?]
        }
        "vertex" if rest.len() == 1 => vec![vertex_of(rest[0], domain)?],
        "vertex" => return Err("vertex is followed by one number".into()),
        "curve" if !rest.is_empty() => rest.iter().map(|word| vertex_of(word, domain)).collect::<Result<_, _>>()?,
        "curve" => return Err("curve is followed by vertices".into()),
        "region" => {
            let (centre, radius) = places::ball(rest)?;
            let inside = |&v: &usize| of_shape(v) && DVec3::from(domain.vertices[v]).distance(centre) <= radius;
            let inside: Vec<usize> = (0..domain.vertices.len()).filter(inside).collect();
            if inside.is_empty() {
                return Err("no vertex of the mesh is in the region".into());
            }
            inside
        }
        other => return Err(format!("{other:?} is no kind of place")),
    };
    Ok(ValueSource { vertices, value: value_of(value.trim())? })
}

fn value_of(text: &str) -> Result<Vec<f64>, String> {
    if let Some(digits) = text.strip_prefix('#') {
        let channel = |at: usize| digits.get(at..at + 2).and_then(|pair| u8::from_str_radix(pair, 16).ok());
        return match [0, 2, 4].map(channel) {
            [Some(red), Some(green), Some(blue)] if digits.len() == 6 && !digits.contains(['+', '-']) => {
                Ok([red, green, blue].map(|byte| f64::from(byte) / 255.0).to_vec())
            }
            _ => Err(format!("{text:?} is no colour: six hexadecimal digits after #")),
        };
    }
    let value = places::numbers(&text.split_whitespace().collect::<Vec<_>>())?;
    if value.is_empty() { Err("the value after = is missing".into()) } else { Ok(value) }
}

/// A vertex of the mesh, as one of the domain.
fn vertex_of(word: &str, domain: &FunctionDomain) -> Result<usize, String> {
    places::vertex(word, domain.vertex_of.len()).map(|vertex| domain.vertex_of[vertex] as usize)
}

#[cfg(test)]
mod tests {
    use armature_geometry::TriangleMesh;

    use super::*;

    fn read(text: &str) -> Result<Vec<ValueSource>, Failure> {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [9.0, 9.0, 9.0]];
        let mesh = TriangleMesh { vertices, triangles: vec![[0, 1, 2]] };
        read_value_sources(Path::new("v.txt"), text.as_bytes(), &FunctionDomain::of_triangles(&mesh).unwrap())
    }

    #[test]
    fn places_become_vertices() {
        let read = read("# colours\npoint 2 0 0 = #ff0080 # red\nvertex 3 = #ff0080\ncurve 0 2 = 0 1 0.5\n").unwrap();
        let colour = vec![1.0, 0.0, 128.0 / 255.0];
        let source =
            |vertices: &[usize], value: &[f64]| ValueSource { vertices: vertices.to_vec(), value: value.to_vec() };
        assert_eq!(read, [source(&[1], &colour), source(&[1], &colour), source(&[0, 2], &[0.0, 1.0, 0.5])]);
        let ball = self::read("region 0 0 0 0.5 = 7").unwrap();
        assert_eq!(ball, [source(&[0], &[7.0])]);
    }

    #[test]
    fn mistakes_are_named_by_their_line() {
        for (text, word) in [
            ("", "no value is given"),
            ("point 0 0 = 1", "line 1: a point has three coordinates"),
            ("\npull 1 = 2", "line 2: \"pull\" is no kind of place"),
            ("vertex 9 = 1", "numbered from 0 to 4"),
            ("vertex 0 1 = 1", "one number"),
            ("vertex 0 = nan", "is not a number"),
            ("vertex 0 =", "value after = is missing"),
            ("vertex 0 = #12", "no colour"),
            ("vertex 0", "the sign = is missing"),
            ("region 5 5 5 0.1 = 1", "no vertex of the mesh"),
            ("curve = 1", "followed by vertices"),
            ("vertex 0 = 1\nvertex 1 = 1 2", "line 2: 2 numbers, but the first line has 1"),
            ("vertex 1 = 1\nvertex 3 = 2", "line 2: vertex 1 has another value by line 1"),
        ] {
            let failure = read(text).unwrap_err();
            assert!(failure.what.contains(word), "{text}: {}", failure.what);
        }
    }
}
