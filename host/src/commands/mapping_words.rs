//! What a mapping says of joints that turn several bones or blend shapes, and what swings, in sentences.

use armature_rig::{Dynamics, Mapping, Sharing};

use crate::terminal::counted;

/// One sentence for each joint that turns several bones, and for each shape that a joint drives.
pub(super) fn mapping_words(mapping: &Mapping) -> Vec<String> {
    let shared = mapping.shared.iter().map(|joint| {
        let bones: Vec<String> = match joint.sharing {
            Sharing::Chain => {
                joint.bones.iter().map(|(bone, share)| format!("{bone} {:.0} %", 100.0 * share)).collect()
            }
            Sharing::Curl => joint.bones.iter().map(|(bone, share)| format!("{bone} {share:.2} times")).collect(),
        };
        let how = match joint.sharing {
            Sharing::Chain => "is shared",
            Sharing::Curl => "curls",
        };
        format!("joint {} {how}: {}", joint.part, bones.join(", "))
    });
    let shapes = mapping.shapes.iter().map(|drive| {
        let ([from, to], [low, high]) = (drive.degrees, drive.weights);
        let (shape, part, axis) = (&drive.shape, drive.part, drive.axis);
        format!("joint {part} blends {shape:?}: {axis} from {from}° to {to}° is a weight of {low} to {high}")
    });
    shared.chain(shapes).collect()
}

/// How many bones swing, and the wind.
pub(super) fn dynamics_words(dynamics: &Dynamics) -> String {
    let bones = dynamics.chains.iter().map(|chain| chain.bones.len()).sum();
    let chains = counted(dynamics.chains.len(), "chain", "chains");
    let verb = if bones == 1 { "swings" } else { "swing" };
    let still = format!("{} in {chains} {verb}", counted(bones, "bone", "bones"));
    let [x, y, z] = dynamics.wind.to_array();
    if dynamics.wind == glam::Vec3::ZERO { still } else { format!("{still} in a wind of ({x}, {y}, {z})") }
}

#[cfg(test)]
mod tests {
    use armature_rig::{DriveAxis, PartUid, ShapeDrive, SharedJoint};

    use super::*;

    #[test]
    fn shares_curls_and_shapes_are_told() {
        let joint = |sharing, bones: &[(&str, f64)]| SharedJoint {
            part: PartUid([0xab; 12]),
            sharing,
            bones: bones.iter().map(|(bone, share)| ((*bone).to_owned(), *share)).collect(),
        };
        let jaw = ShapeDrive {
            shape: "jaw".into(),
            part: PartUid([0xab; 12]),
            axis: DriveAxis::Bend,
            degrees: [0.0, 25.0],
            weights: [0.0, 1.0],
        };
        let shared = vec![joint(Sharing::Chain, &[("a", 0.25), ("b", 0.75)]), joint(Sharing::Curl, &[("c", 1.1)])];
        let words = mapping_words(&Mapping { shared, shapes: vec![jaw], ..Mapping::default() });
        assert_eq!(words.len(), 3);
        assert!(words[0].ends_with("is shared: a 25 %, b 75 %"), "{words:?}");
        assert!(words[1].ends_with("curls: c 1.10 times"), "{words:?}");
        assert!(words[2].ends_with("blends \"jaw\": bend from 0° to 25° is a weight of 0 to 1"), "{words:?}");
    }
}
