//! From bytes to the library's scene, in our axes and unit.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use ufbx::{
    AllocatorOpts, CoordinateAxes, CoordinateAxis, FileFormat, GeometryTransformHandling, InheritModeHandling,
    LoadOpts, Node, SceneRoot, SpaceConversion,
};

use crate::FormatError;
use crate::text::quoted;

/// More than this is a mistake or an attack.
const MOST_BYTES: usize = 4 << 30;
/// The deepest tree of nodes.
const DEEPEST: u32 = 2_000;

/// Whether the first bytes are those of an FBX file.
pub(crate) fn is_fbx(bytes: &[u8]) -> bool {
    bytes.starts_with(b"Kaydara FBX Binary") || bytes.trim_ascii_start().starts_with(b"; FBX")
}

/// The scene in right-handed axes with +Y up, in metres.
pub(super) fn open(file: &str, bytes: &[u8]) -> Result<SceneRoot, FormatError> {
    let memory = || AllocatorOpts { memory_limit: MOST_BYTES, ..AllocatorOpts::default() };
    let options = LoadOpts {
        temp_allocator: memory(),
        result_allocator: memory(),
        node_depth_limit: DEEPEST,
        file_format: FileFormat::Fbx,
        target_axes: CoordinateAxes {
            right: CoordinateAxis::PositiveX,
            up: CoordinateAxis::PositiveY,
            front: CoordinateAxis::PositiveZ,
        },
        target_unit_meters: 1.0,
        space_conversion: SpaceConversion::ModifyGeometry,
        geometry_transform_handling: GeometryTransformHandling::ModifyGeometry,
        inherit_mode_handling: InheritModeHandling::Compensate,
        use_blender_pbr_material: true,
        ..LoadOpts::default()
    };
    ufbx::load_memory(bytes, options).map_err(|error| {
        let (short, more) = (error.description.to_string(), error.info());
        let more = if more.is_empty() { String::new() } else { format!(" ({})", quoted(more)) };
        let what = format!("the FBX file cannot be read: {}{more}", short.to_lowercase());
        FormatError::whole(file, what, "The file may be cut off or damaged; export it again, as binary FBX 7.4 or 7.5")
    })
}

/// A matrix of the library.
pub(super) fn affine(m: &ufbx::Matrix) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_cols(
            DVec3::new(m.m00, m.m10, m.m20),
            DVec3::new(m.m01, m.m11, m.m21),
            DVec3::new(m.m02, m.m12, m.m22),
        ),
        translation: DVec3::new(m.m03, m.m13, m.m23),
    }
}

/// A transform of the library.
pub(super) fn transform(t: &ufbx::Transform) -> DAffine3 {
    let rotation = DQuat::from_xyzw(t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w);
    let length = rotation.length();
    let rotation = if length.is_finite() && length > 1e-6 { rotation / length } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(vector(&t.scale), rotation, vector(&t.translation))
}

/// A vector of the library.
pub(super) fn vector(v: &ufbx::Vec3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

/// The node's number in the scene's list.
pub(super) fn number(node: &Node) -> usize {
    node.element.typed_id as usize
}
