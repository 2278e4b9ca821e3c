//! The extensions of VRM 0.x and 1.0.
//!
//! What names a node that is no bone, or a number that is missing or not finite, is left out or taken as the
//! specification's default: an avatar without some of its expressions is still an avatar.

use gltf_json::Value;

use super::container::Document;
use super::nodes::Nodes;
use super::skin::Rig;
use crate::model::{Avatar, Expression, HumanoidBone, SpringChain, SpringCollider, SpringJoint};

/// The version before 1.0.
pub(super) const OLD_VRM: &str = "0.x";

/// Where a morph target of the model came from.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetSource {
    pub(super) node: usize,
    pub(super) mesh: usize,
    /// Its number in the mesh.
    pub(super) index: usize,
}

/// The avatar in a file, if it is one.
pub(super) fn read_avatar(document: &Document, nodes: &Nodes, rig: &Rig, targets: &[TargetSource]) -> Option<Avatar> {
    let extensions = &document.root.extensions.as_ref()?.others;
    let reader = Reader { nodes, rig, targets };
    if let Some(vrm) = extensions.get("VRMC_vrm") {
        let springs = extensions.get("VRMC_springBone").map(|springs| reader.springs(springs)).unwrap_or_default();
        return Some(Avatar {
            version: "1.0".to_owned(),
            humanoid: reader.humanoid(vrm),
            expressions: reader.expressions(vrm),
            springs,
        });
    }
    let vrm = extensions.get("VRM")?;
    Some(Avatar {
        version: OLD_VRM.to_owned(),
        humanoid: reader.old_humanoid(vrm),
        expressions: reader.old_expressions(vrm),
        springs: reader.old_springs(vrm),
    })
}

struct Reader<'a> {
    nodes: &'a Nodes,
    rig: &'a Rig,
    targets: &'a [TargetSource],
}

impl Reader<'_> {
    fn bone(&self, node: &Value) -> Option<u32> {
        (*self.rig.bone_of_node.get(index(node)?)?).map(|bone| bone as u32)
    }

    fn humanoid(&self, vrm: &Value) -> Vec<HumanoidBone> {
        let bones = vrm["humanoid"]["humanBones"].as_object().into_iter().flatten();
        let bone = |(name, bone): (&String, &Value)| {
            Some(HumanoidBone { name: name.clone(), bone: self.bone(&bone["node"])? })
        };
        bones.filter_map(bone).collect()
    }

    fn old_humanoid(&self, vrm: &Value) -> Vec<HumanoidBone> {
        let bone = |bone: &Value| {
            Some(HumanoidBone { name: new_bone_name(bone["bone"].as_str()?), bone: self.bone(&bone["node"])? })
        };
        items(&vrm["humanoid"]["humanBones"]).filter_map(bone).collect()
    }

    fn expressions(&self, vrm: &Value) -> Vec<Expression> {
        let kinds = ["preset", "custom"].map(|kind| vrm["expressions"][kind].as_object());
        let expression = |(name, expression): (&String, &Value)| {
            let targets = items(&expression["morphTargetBinds"]).flat_map(|bind| {
                let (node, number) = (index(&bind["node"]), index(&bind["index"]));
                let same = move |source: &TargetSource| Some(source.node) == node && Some(source.index) == number;
                self.bound(same, float(&bind["weight"], 1.0))
            });
            Expression { name: name.clone(), targets: targets.collect() }
        };
        kinds.into_iter().flatten().flatten().map(expression).collect()
    }

    fn old_expressions(&self, vrm: &Value) -> Vec<Expression> {
        let expression = |group: &Value| {
            let preset = group["presetName"].as_str().filter(|name| !name.is_empty() && *name != "unknown");
            let name = preset.map(new_expression_name).or(group["name"].as_str()).unwrap_or_default();
            let targets = items(&group["binds"]).flat_map(|bind| {
                let (mesh, number) = (index(&bind["mesh"]), index(&bind["index"]));
                let same = move |source: &TargetSource| Some(source.mesh) == mesh && Some(source.index) == number;
                // In percent.
                self.bound(same, float(&bind["weight"], 100.0) / 100.0)
            });
            Expression { name: name.to_owned(), targets: targets.collect() }
        };
        items(&vrm["blendShapeMaster"]["blendShapeGroups"]).map(expression).collect()
    }

    /// All morph targets that came from one of the file's.
    fn bound(&self, same: impl Fn(&TargetSource) -> bool, weight: f32) -> Vec<(u32, f32)> {
        (0..).zip(self.targets).filter(|(_, source)| same(source)).map(|(target, _)| (target, weight)).collect()
    }

    fn springs(&self, extension: &Value) -> Vec<SpringChain> {
        let colliders: Vec<Option<SpringCollider>> =
            items(&extension["colliders"]).map(|collider| self.collider(collider)).collect();
        let groups: Vec<Vec<SpringCollider>> = items(&extension["colliderGroups"])
            .map(|group| {
                let numbers = items(&group["colliders"]).filter_map(index);
                numbers.filter_map(|number| *colliders.get(number)?).collect()
            })
            .collect();
        let joint = |joint: &Value| {
            Some(SpringJoint {
                bone: self.bone(&joint["node"])?,
                stiffness: float(&joint["stiffness"], 1.0),
                gravity: float(&joint["gravityPower"], 0.0),
                gravity_direction: array(&joint["gravityDir"], [0.0, -1.0, 0.0]),
                drag: float(&joint["dragForce"], 0.5),
                radius: float(&joint["hitRadius"], 0.0),
            })
        };
        let chain = |spring: &Value| SpringChain {
            name: spring["name"].as_str().unwrap_or_default().to_owned(),
            joints: items(&spring["joints"]).filter_map(joint).collect(),
            colliders: in_groups(&spring["colliderGroups"], &groups),
        };
        items(&extension["springs"]).map(chain).filter(|chain| !chain.joints.is_empty()).collect()
    }

    fn collider(&self, collider: &Value) -> Option<SpringCollider> {
        let bone = self.bone(&collider["node"])?;
        let shape = ["sphere", "capsule"].iter().find_map(|kind| collider["shape"].get(kind))?;
        Some(SpringCollider {
            bone,
            offset: array(&shape["offset"], [0.0; 3]),
            tail: shape.get("tail").map(|tail| array(tail, [0.0; 3])),
            radius: float(&shape["radius"], 0.0),
        })
    }

    /// Every path from the roots that are given to a tip is a chain.
    fn old_springs(&self, vrm: &Value) -> Vec<SpringChain> {
        let secondary = &vrm["secondaryAnimation"];
        let sphere = |bone: u32, collider: &Value| {
            // UniVRM wrote offsets, but not gravity, with z as it has it itself: the other way round.
            let [x, y, z] = old_vector(&collider["offset"], [0.0; 3]);
            SpringCollider { bone, offset: [x, y, 0.0 - z], tail: None, radius: float(&collider["radius"], 0.0) }
        };
        let groups: Vec<Vec<SpringCollider>> = items(&secondary["colliderGroups"])
            .map(|group| {
                let bone = self.bone(&group["node"]);
                let spheres = |bone| items(&group["colliders"]).map(move |collider| sphere(bone, collider)).collect();
                bone.map(spheres).unwrap_or_default()
            })
            .collect();
        let mut chains = Vec::new();
        for group in items(&secondary["boneGroups"]) {
            let joint = |bone: u32| SpringJoint {
                bone,
                // So it is spelt.
                stiffness: float(&group["stiffiness"], 1.0),
                gravity: float(&group["gravityPower"], 0.0),
                gravity_direction: old_vector(&group["gravityDir"], [0.0, -1.0, 0.0]),
                drag: float(&group["dragForce"], 0.4),
                radius: float(&group["hitRadius"], 0.0),
            };
            let name = group["comment"].as_str().unwrap_or_default();
            for root in items(&group["bones"]).filter_map(index).filter(|&node| node < self.nodes.parent.len()) {
                for path in self.paths_below(root) {
                    let joints: Vec<SpringJoint> = path.into_iter().map(joint).collect();
                    let colliders = in_groups(&group["colliderGroups"], &groups);
                    chains.push(SpringChain { name: name.to_owned(), joints, colliders });
                }
            }
        }
        chains.retain(|chain| !chain.joints.is_empty());
        chains
    }

    /// The bones from a node to each tip below it.
    fn paths_below(&self, root: usize) -> Vec<Vec<u32>> {
        let below = |node: usize| std::iter::successors(Some(node), |&n| self.nodes.parent[n]).any(|n| n == root);
        let mut is_tip = vec![false; self.nodes.parent.len()];
        self.rig.node_of_bone.iter().for_each(|&node| is_tip[node] = true);
        for &node in &self.rig.node_of_bone {
            if let Some(parent) = self.nodes.parent[node] {
                is_tip[parent] = false;
            }
        }
        let tips = self.rig.node_of_bone.iter().copied().filter(|&node| is_tip[node] && below(node));
        let path = |tip: usize| {
            let up = std::iter::successors(Some(tip), |&n| self.nodes.parent[n].filter(|_| n != root));
            let mut path: Vec<u32> =
                up.filter_map(|node| self.rig.bone_of_node[node]).map(|bone| bone as u32).collect();
            path.reverse();
            path
        };
        tips.map(path).collect()
    }
}

fn items(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|number| usize::try_from(number).ok())
}

fn float(value: &Value, default: f32) -> f32 {
    value.as_f64().map(|v| v as f32).filter(|v| v.is_finite()).unwrap_or(default)
}

fn array(value: &Value, default: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| float(&value[k], default[k]))
}

fn old_vector(value: &Value, default: [f32; 3]) -> [f32; 3] {
    ["x", "y", "z"].map(|axis| &value[axis]).iter().zip(default).map(|(v, d)| float(v, d)).collect::<Vec<_>>()[..]
        .try_into()
        .unwrap_or(default)
}

fn in_groups(numbers: &Value, groups: &[Vec<SpringCollider>]) -> Vec<SpringCollider> {
    items(numbers).filter_map(index).filter_map(|number| groups.get(number)).flatten().copied().collect()
}

/// The name in VRM 1.0 of a bone in VRM 0.x: only those of thumbs differ.
fn new_bone_name(old: &str) -> String {
    match old.split_once("Thumb") {
        Some((side, "Proximal")) => format!("{side}ThumbMetacarpal"),
        Some((side, "Intermediate")) => format!("{side}ThumbProximal"),
        _ => old.to_owned(),
    }
}

/// The name in VRM 1.0 of an expression in VRM 0.x.
fn new_expression_name(old: &str) -> &str {
    let names = [
        ("joy", "happy"),
        ("sorrow", "sad"),
        ("fun", "relaxed"),
        ("a", "aa"),
        ("i", "ih"),
        ("u", "ou"),
        ("e", "ee"),
        ("o", "oh"),
        ("blink_l", "blinkLeft"),
        ("blink_r", "blinkRight"),
        ("lookup", "lookUp"),
        ("lookdown", "lookDown"),
        ("lookleft", "lookLeft"),
        ("lookright", "lookRight"),
    ];
    names.iter().find(|(known, _)| *known == old).map_or(old, |(_, new)| new)
}
