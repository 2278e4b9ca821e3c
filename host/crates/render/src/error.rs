//! What can go wrong when a picture is made.

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// This machine has no graphics adapter that wgpu can use.
    #[error(
        "no graphics adapter was found ({detail}). On Debian or Ubuntu a software one comes with: apt install mesa-vulkan-drivers libvulkan1"
    )]
    NoAdapter {
        /// What wgpu says.
        detail: String,
    },
    /// There is an adapter, but it gives no device.
    #[error(
        "the graphics adapter {adapter} does not work: {detail}. Update its driver, or set WGPU_BACKEND=vulkan or gl"
    )]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// What wgpu says.
        detail: String,
    },
    /// The device reported an error.
    #[error("the graphics device failed: {detail}")]
    Device {
        /// What wgpu says.
        detail: String,
    },
    /// A picture without pixels, or with more than possible.
    #[error("a picture of {width}×{height} pixels cannot be made; each side has to be 1 to {limit}")]
    BadSize {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The longest side possible.
        limit: u32,
    },
    /// An array of the mesh has another length than the positions.
    #[error("the mesh has {vertices} vertices, but {got} {what}")]
    LengthMismatch {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The number of positions.
        vertices: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names vertex {vertex}, but there are only {vertices} vertices")]
    IndexOutOfRange {
        /// Zero-based triangle.
        triangle: usize,
        /// The offending zero-based vertex.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A texture's bytes do not fill its size.
    #[error(
        "a texture of {width}×{height} pixels needs {expected} bytes, but has {got} (or is larger than {limit} pixels a side)"
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
    Skin(#[from] armature_deform::SkinError),
    /// More than the adapter's buffers hold.
    #[error(
        "{vertices} vertices in {poses} poses at once are more than this graphics adapter can skin; skin fewer poses at a time"
    )]
    TooMuchToSkin {
        /// Vertices of the character.
        vertices: usize,
        /// Poses wanted.
        poses: usize,
    },
    /// Poses of the other kind than the method was made for.
    #[error("stretched and twisted bones need poses of their own, and frames are for the other methods")]
    OtherPoses,
    /// The PNG encoder refused.
    #[error("the picture could not be written as PNG: {0}")]
    Png(#[from] image::ImageError),
}
