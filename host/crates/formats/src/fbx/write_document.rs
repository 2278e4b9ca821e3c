//! The nodes of an FBX file, and their binary form.

use std::collections::BTreeMap;
use std::io::Cursor;

use fbxcel::low::FbxVersion;
use fbxcel::low::v7400::ArrayAttributeEncoding;
use fbxcel::writer::v7400::binary::{AttributesWriter, Error, FbxFooter, Writer};

use crate::FormatError;
use crate::gltf::scene::bad;

/// The file's creation time, identifier and footer belong together: readers may check that they do, so all three are
/// the ones that other exporters use for a file without a date.
const CREATION_TIME: &str = "1970-01-01 10:00:00:000";
const FILE_ID: [u8; 16] =
    [0x28, 0xb3, 0x2a, 0xeb, 0xb6, 0x24, 0xcc, 0xc2, 0xbf, 0xc8, 0xb0, 0x2a, 0xa9, 0x2b, 0xfc, 0xf1];
const FOOTER_ID: [u8; 16] =
    [0xfa, 0xbc, 0xab, 0x09, 0xd0, 0xc8, 0xd4, 0x66, 0xb1, 0x76, 0xfb, 0x83, 0x1c, 0xf7, 0x26, 0x7e];
/// Between a name and its class.
const SEPARATOR: &str = "\0\u{1}";
/// Arrays of at least this many numbers are compressed.
const COMPRESSED_FROM: usize = 128;
/// Numbers of objects start here; 0 is the scene.
const FIRST_ID: i64 = 1_000_000;

pub(super) type Id = i64;

/// The scene itself, which objects without a parent are connected to.
pub(super) const SCENE: Id = 0;

/// An attribute of a node.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Flag(bool),
    Int(i32),
    Long(i64),
    Real(f64),
    Text(String),
    Bytes(Vec<u8>),
    Ints(Vec<i32>),
    Longs(Vec<i64>),
    Floats(Vec<f32>),
    Reals(Vec<f64>),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<i32> for Value {
    fn from(number: i32) -> Self {
        Self::Int(number)
    }
}

impl From<i64> for Value {
    fn from(number: i64) -> Self {
        Self::Long(number)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Real(number)
    }
}

/// A node with its attributes and the nodes in it.
#[derive(Clone, Debug)]
pub(super) struct Node {
    name: &'static str,
    values: Vec<Value>,
    children: Vec<Node>,
}

impl Node {
    pub(super) fn new(name: &'static str, values: Vec<Value>) -> Self {
        Self { name, values, children: Vec::new() }
    }

    /// A node with one attribute.
    pub(super) fn of(name: &'static str, value: impl Into<Value>) -> Self {
        Self::new(name, vec![value.into()])
    }

    pub(super) fn with(name: &'static str, values: Vec<Value>, children: Vec<Self>) -> Self {
        Self { name, values, children }
    }
}

/// A property: name, type, label, flags, values.
pub(super) fn property(name: &str, [kind, label, flags]: [&str; 3], values: Vec<Value>) -> Node {
    let mut all: Vec<Value> = vec![name.into(), kind.into(), label.into(), flags.into()];
    all.extend(values);
    Node::new("P", all)
}

/// A property of three numbers, of the type that it is named after or another.
pub(super) fn vector_property(name: &str, kinds: [&str; 3], [x, y, z]: [f64; 3]) -> Node {
    property(name, kinds, vec![x.into(), y.into(), z.into()])
}

pub(super) fn number_property(name: &str, value: f64) -> Node {
    property(name, ["Number", "", "A"], vec![value.into()])
}

pub(super) fn time_property(name: &str, ticks: i64) -> Node {
    property(name, ["KTime", "Time", ""], vec![ticks.into()])
}

pub(super) fn text_property(name: &str, value: &str) -> Node {
    property(name, ["KString", "", ""], vec![value.into()])
}

pub(super) fn enum_property(name: &str, value: i32) -> Node {
    property(name, ["enum", "", ""], vec![value.into()])
}

pub(super) fn properties(children: Vec<Node>) -> Node {
    Node::with("Properties70", Vec::new(), children)
}

/// Objects and what connects them.
pub(super) struct Document {
    objects: Vec<Node>,
    connections: Vec<Node>,
    next: Id,
}

impl Document {
    pub(super) fn new() -> Self {
        Self { objects: Vec::new(), connections: Vec::new(), next: FIRST_ID }
    }

    /// The number of the next object.
    pub(super) fn reserve(&mut self) -> Id {
        self.next += 1;
        self.next - 1
    }

    /// Adds an object: the node's name, `[name, class]`, and its kind.
    pub(super) fn add(&mut self, node: &'static str, name: [&str; 2], kind: &str, children: Vec<Node>) -> Id {
        let id = self.reserve();
        self.add_reserved(id, node, name, kind, children);
        id
    }

    pub(super) fn add_reserved(
        &mut self,
        id: Id,
        node: &'static str,
        name: [&str; 2],
        kind: &str,
        children: Vec<Node>,
    ) {
        let values = vec![id.into(), Value::Text(object_name(name)), kind.into()];
        self.objects.push(Node::with(node, values, children));
    }

    /// Makes an object part of another.
    pub(super) fn connect(&mut self, child: Id, parent: Id) {
        self.connections.push(Node::new("C", vec!["OO".into(), child.into(), parent.into()]));
    }

    /// Makes an object the value of a property.
    pub(super) fn connect_property(&mut self, child: Id, parent: Id, property: &str) {
        let values = vec!["OP".into(), child.into(), parent.into(), property.into()];
        self.connections.push(Node::new("C", values));
    }

    /// The whole file: `settings` are the scene's properties, `takes` the animations' names and times.
    pub(super) fn finish(self, settings: Vec<Node>, takes: Vec<Node>, current: &str) -> Result<Vec<u8>, FormatError> {
        let creator = concat!("Armature ", env!("CARGO_PKG_VERSION"));
        let mut counts: BTreeMap<&'static str, i32> = BTreeMap::from([("GlobalSettings", 1)]);
        for object in &self.objects {
            *counts.entry(object.name).or_default() += 1;
        }
        let total = counts.values().sum::<i32>();
        let kinds = counts
            .iter()
            .map(|(name, count)| Node::with("ObjectType", vec![(*name).into()], vec![Node::of("Count", *count)]));
        let mut definitions = vec![Node::of("Version", 100), Node::of("Count", total)];
        definitions.extend(kinds);
        let header = vec![
            Node::of("FBXHeaderVersion", 1003),
            Node::of("FBXVersion", 7400),
            Node::of("EncryptionType", 0),
            Node::of("Creator", creator),
        ];
        let document = Node::with(
            "Document",
            vec![FIRST_ID.wrapping_sub(1).into(), "Scene".into(), "Scene".into()],
            vec![properties(vec![text_property("ActiveAnimStackName", current)]), Node::of("RootNode", SCENE)],
        );
        let mut all_takes = vec![Node::of("Current", current)];
        all_takes.extend(takes);
        let nodes = [
            Node::with("FBXHeaderExtension", Vec::new(), header),
            Node::of("FileId", Value::Bytes(FILE_ID.to_vec())),
            Node::of("CreationTime", CREATION_TIME),
            Node::of("Creator", creator),
            Node::with("GlobalSettings", Vec::new(), vec![Node::of("Version", 1000), properties(settings)]),
            Node::with("Documents", Vec::new(), vec![Node::of("Count", 1), document]),
            Node::new("References", Vec::new()),
            Node::with("Definitions", Vec::new(), definitions),
            Node::with("Objects", Vec::new(), self.objects),
            Node::with("Connections", Vec::new(), self.connections),
            Node::with("Takes", Vec::new(), all_takes),
        ];
        write(&nodes).map_err(|error| bad(error.to_string(), "Export fewer meshes or shorter clips"))
    }
}

/// The name of an object with its class. A NUL would end it.
pub(super) fn object_name([name, class]: [&str; 2]) -> String {
    format!("{}{SEPARATOR}{class}", name.replace('\0', "_"))
}

fn write(nodes: &[Node]) -> Result<Vec<u8>, Error> {
    let mut writer = Writer::new(Cursor::new(Vec::new()), FbxVersion::V7_4)?;
    for node in nodes {
        write_node(&mut writer, node)?;
    }
    let footer = FbxFooter { unknown1: Some(&FOOTER_ID), ..FbxFooter::default() };
    Ok(writer.finalize(&footer)?.into_inner())
}

/// Nodes lie at most five deep.
fn write_node(writer: &mut Writer<Cursor<Vec<u8>>>, node: &Node) -> Result<(), Error> {
    let mut attributes = writer.new_node(node.name)?;
    for value in &node.values {
        write_value(&mut attributes, value)?;
    }
    for child in &node.children {
        write_node(writer, child)?;
    }
    writer.close_node()
}

fn write_value(to: &mut AttributesWriter<Cursor<Vec<u8>>>, value: &Value) -> Result<(), Error> {
    let packed = |count: usize| (count >= COMPRESSED_FROM).then_some(ArrayAttributeEncoding::Zlib);
    match value {
        Value::Flag(flag) => to.append_bool(*flag),
        Value::Int(number) => to.append_i32(*number),
        Value::Long(number) => to.append_i64(*number),
        Value::Real(number) => to.append_f64(*number),
        Value::Text(text) => to.append_string_direct(text),
        Value::Bytes(bytes) => to.append_binary_direct(bytes),
        Value::Ints(all) => to.append_arr_i32_from_iter(packed(all.len()), all.iter().copied()),
        Value::Longs(all) => to.append_arr_i64_from_iter(packed(all.len()), all.iter().copied()),
        Value::Floats(all) => to.append_arr_f32_from_iter(packed(all.len()), all.iter().copied()),
        Value::Reals(all) => to.append_arr_f64_from_iter(packed(all.len()), all.iter().copied()),
    }
}
