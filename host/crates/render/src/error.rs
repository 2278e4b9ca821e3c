//! What can go wrong when making a picture.

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// This machine has no graphics adapter that wgpu can use.
    #[error(
        "no graphics adapter was found ({detail}). On Debian or Ubuntu, install a software one: apt install mesa-vulkan-drivers libvulkan1"
    )]
    NoAdapter {
        /// What wgpu reports.
        detail: String,
    },
    /// There is an adapter, but it provides no device.
    #[error(
        "the graphics adapter {adapter} does not work: {detail}. Update its driver, or set WGPU_BACKEND=vulkan or gl"
    )]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// What wgpu reports.
        detail: String,
    },
    /// The device reported an error.
    #[error("the graphics device failed: {detail}")]
    Device {
        /// What wgpu reports.
        detail: String,
    },
    /// A picture without pixels, or with more than is possible.
    #[error("a picture of {width}×{height} pixels cannot be made; each side must be 1 to {limit}")]
    BadSize {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The longest side possible.
        limit: u32,
    },
    /// An array of the mesh has a different length from the positions.
    #[error("the mesh has {vertices} vertices, but {got} {what}")]
    LengthMismatch {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The number of positions.
        vertices: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {vertex}, but there are only {vertices} vertices")]
    IndexOutOfRange {
        /// Zero-based triangle.
        triangle: usize,
        /// The offending zero-based vertex.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A part refers to triangles or a material that do not exist.
    #[error("mesh part {part} does not fit a mesh of {triangles} triangles and {materials} materials")]
    PartOutOfRange {
        /// Zero-based part.
        part: usize,
        /// How many triangles there are.
        triangles: usize,
        /// How many materials there are.
        materials: usize,
    },
    /// A texture's bytes do not fill its size.
    #[error(
        "a texture of {width}×{height} pixels needs {expected} bytes, but has {got} (or is larger than {limit} pixels per side)"
    )]
    BadTexture {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Bytes needed.
        expected: u64,
        /// Bytes given.
        got: usize,
        /// Longest side possible.
        limit: u32,
    },
    /// A character cannot be skinned, or not in this pose.
    #[error(transparent)]
    Skin(#[from] armature_deform::skin::SkinError),
    /// More than the adapter's buffers can hold.
    #[error(
        "{vertices} vertices in {poses} poses at once are more than this graphics adapter can skin; skin fewer poses at a time"
    )]
    TooMuchToSkin {
        /// Vertices of the character.
        vertices: usize,
        /// Poses requested.
        poses: usize,
    },
    /// Poses of the wrong kind for the method.
    #[error("stretched and twisted bones need their own kind of pose; frames are for the other methods")]
    OtherPoses,
    /// The PNG encoder refused.
    #[error("the picture could not be written as PNG: {0}")]
    Png(#[from] png::EncodingError),
}
