//! Trivial graph format: the joints and bones of a skeleton, written by hand, by libigl's tools or by us.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use armature_rig::Skeleton;

use crate::FormatError;
use crate::text::{count, decode, numbered_lines, numbers, quoted};

/// Points and the edges between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TgfGraph {
    /// Positions, in the order of the file.
    pub points: Vec<[f64; 3]>,
    /// Bones: pairs of zero-based point indices, in the order of the file.
    pub edges: Vec<[usize; 2]>,
    /// Edges of a cage, open or closed: pairs as above.
    pub cage_edges: Vec<[usize; 2]>,
    /// Pseudo-edges between points: how points that move turn each other.
    pub pseudo_edges: Vec<[usize; 2]>,
    /// Lines after a second `#`, which are not read: libigl's tools write faces of cages there.
    pub unread_lines: usize,
}

/// Reads `index x y z …` lines, a line `#`, then `from to [bone pseudo cage]` lines. The last three are 1 or 0, as in
/// libigl's files, and give the type of the edge: a bone (also the default without them); part of a cage; or a
/// pseudo-edge, which rotates handles when they are moved. Further columns are ignored. An index
/// may be any whole number, as long as no two points share it. The error does not name the file: see
/// [`FormatError::in_file`].
///
/// ```
/// let graph = armature_formats::skeleton::read_tgf(b"1 0 0 0\n2 0 1 0\n#\n1 2\n")?;
/// assert_eq!(graph.points[1], [0.0, 1.0, 0.0]);
/// assert_eq!(graph.edges, [[0, 1]]);
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn read_tgf(bytes: &[u8]) -> Result<TgfGraph, FormatError> {
    let text = decode(bytes);
    let mut graph = TgfGraph::default();
    let mut point_of_label: BTreeMap<usize, usize> = BTreeMap::new();
    let mut section = 0;
    let mut last_line = 1;
    for (line, content) in numbered_lines(&text) {
        let mut words = content.split_whitespace();
        let Some(first) = words.next() else { continue };
        last_line = line;
        if first.starts_with('#') {
            section += 1;
            continue;
        }
        match section {
            0 => {
                let label = count("", line, first)?;
                let point = numbers("", line, &mut words, "a joint")?;
                if point_of_label.insert(label, graph.points.len()).is_some() {
                    let what = format!("the joint number {label} occurs twice");
                    return Err(FormatError::line("", line, what, "Give every joint its own number"));
                }
                graph.points.push(point);
            }
            1 => {
                let end = |word: Option<&str>| -> Result<usize, FormatError> {
                    let word = word.ok_or_else(|| {
                        FormatError::line("", line, "an edge needs two joints", "Write the numbers of both its joints")
                    })?;
                    let label = count("", line, word)?;
                    point_of_label.get(&label).copied().ok_or_else(|| {
                        let what = format!("there is no joint {}", quoted(word));
                        FormatError::line("", line, what, "Edges name joints by the numbers above the # line")
                    })
                };
                let ends = [end(Some(first))?, end(words.next())?];
                let [bone, pseudo, cage] = [(); 3].map(|()| words.next() == Some("1"));
                match (bone, pseudo, cage) {
                    (false, _, true) => graph.cage_edges.push(ends),
                    (false, true, false) => graph.pseudo_edges.push(ends),
                    _ => graph.edges.push(ends),
                }
            }
            _ => graph.unread_lines += 1,
        }
    }
    if graph.points.is_empty() {
        let remedy = "Joints are lines \"number x y z\" above a line \"#\"; choose a TGF file";
        return Err(FormatError::line("", last_line, "the graph has no joints", remedy));
    }
    if section == 0 {
        let what = "the line \"#\" between joints and edges is missing";
        return Err(FormatError::line("", last_line, what, "The file may be cut off; export it again"));
    }
    Ok(graph)
}

/// Writes a skeleton's rest pose: its [joints](Skeleton::rest_joints), and an edge to each from that of the bone it hangs
/// on. The format has no names.
///
/// ```
/// use armature_formats::skeleton::{read_tgf, write_tgf};
/// use armature_rig::{Bone, Skeleton, Transform};
///
/// let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
/// let text = write_tgf(&Skeleton::new(vec![bone]).unwrap());
/// assert_eq!(read_tgf(text.as_bytes())?.points, [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn write_tgf(skeleton: &Skeleton) -> String {
    let joints = skeleton.rest_joints();
    let mut text = String::new();
    for (index, (at, _)) in joints.iter().enumerate() {
        let _ = writeln!(text, "{} {} {} {}", index + 1, at.x, at.y, at.z);
    }
    text.push_str("#\n");
    for (index, (_, parent)) in joints.iter().enumerate() {
        if let Some(parent) = parent {
            let _ = writeln!(text, "{} {}", parent + 1, index + 1);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;

    #[test]
    fn tabs_and_junk_columns() {
        let graph =
            read_tgf(b"  7\t1 2 3 nan 1e+999 x\r\n\r\n 2 -1 0.5 1e-3\r\n#\r\n2 7 1 0 0\r\n#\r\n7 7\r\n").unwrap();
        assert_eq!(graph.points, [[1.0, 2.0, 3.0], [-1.0, 0.5, 1e-3]]);
        assert_eq!((graph.edges, graph.cage_edges, graph.unread_lines), (vec![[1, 0]], vec![], 1));
    }

    #[test]
    fn edges_are_bones_unless_they_say_otherwise() {
        let text = "1 0 0 0\n2 1 0 0\n3 2 0 0\n#\n1 2\n2 3 1 0 0\n1 3 0 0 1\n2 1 0 1 0\n3 1 0 0 0\n3 2 1 0 1\n";
        let graph = read_tgf(text.as_bytes()).unwrap();
        assert_eq!(graph.edges, [[0, 1], [1, 2], [2, 0], [2, 1]]);
        assert_eq!((graph.cage_edges, graph.pseudo_edges), (vec![[0, 2]], vec![[1, 0]]));
    }

    #[test]
    fn faults_name_their_line() {
        for (text, line) in [
            ("", 1),
            ("1 0 0 0\n2 0 0 nan\n#\n", 2),
            ("1 0 0 0\n1 0 0 0\n#\n", 2),
            ("1 0 0\n#\n", 1),
            ("1 0 0 0\n\n2 1 1 1\n", 3),
            ("1 0 0 0\n#\n1 2\n", 3),
            ("1 0 0 0\n#\n1\n", 3),
            ("1 0 0 0\n#\n1 -1\n", 3),
            ("x 0 0 0\n#\n", 1),
        ] {
            assert_eq!(read_tgf(text.as_bytes()).unwrap_err().place, Place::Line(line), "{text:?}");
        }
    }
}
