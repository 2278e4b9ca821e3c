//! How to bind.

use armature_weights::endpoints::SplineFilter;
use armature_weights::handles::FREE_NEAR_JOINTS;
use armature_weights::heat::BoneHeatSettings;

use crate::handle_weights::{BiharmonicTier, WeightsOn};
use crate::skin_kind::{EndpointMethod, SkinKind};

/// Approximate number of vertices of the volume that weights are computed on by default: on the armadillo, the elephant
/// and the hand, weights with twice as many are no closer to those with four times as many
/// (`armature bench weights/convergence`).
pub const WEIGHT_VOLUME_VERTICES: usize = 5_000;

/// The most influences that a vertex can have.
pub const MOST_INFLUENCES: usize = 16;

/// How weights are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindMethod {
    /// Bounded biharmonic weights.
    Biharmonic(BiharmonicTier),
    /// Monotone weights, of this order of smoothness, 2 to 4.
    Monotone {
        /// The order.
        order: u8,
    },
    /// Bone heat on the surface.
    BoneHeat,
}

/// How much of a bone's twist and stretch has happened by each place along it (thesis figure 6.9).
#[derive(Clone, Debug, PartialEq)]
pub struct TwistCurve {
    /// The bone's name.
    pub bone: String,
    /// From places to shares of the whole, both 0 to 1.
    pub curve: SplineFilter,
}

/// How to bind.
#[derive(Clone, Debug, PartialEq)]
pub struct BindSettings {
    /// Compute new weights even if the model has an artist's.
    pub replace_rig: bool,
    /// Most influences that computed and transferred weights may give a vertex, 1 to [`MOST_INFLUENCES`].
    pub max_influences: usize,
    /// The same for weights that come with the model; `None` leaves them alone.
    pub limit_painted: Option<usize>,
    /// Give weights to what comes without in a rigged model: vertices that the artist left out get those around them, parts
    /// those of the parts they lie on.
    pub bind_unbound: bool,
    /// Parts, by name, that take their weights from the other parts even if they have some.
    pub transfer: Vec<String>,
    /// How weights are computed.
    pub method: BindMethod,
    /// What bounded biharmonic and monotone weights are computed on.
    pub on: WeightsOn,
    /// The fraction of its length over which a bone is released at each shared joint; not for bone heat.
    pub joint_release: f64,
    /// Smooth the weights that come with the model, and keep the extrema of each bone's weights that are at least this
    /// persistent, 0 to 1; `None` leaves them alone.
    pub smooth_weights: Option<f64>,
    /// Settings of the bone heat method.
    pub heat: BoneHeatSettings,
    /// How the skin follows the bones; endpoint weights are computed if it needs them.
    pub skin: SkinKind,
    /// How endpoint weights are computed; `None` as the bones' weights are, and as bounded biharmonic weights for those
    /// of an artist.
    pub endpoints: Option<EndpointMethod>,
    /// Where along bones their twist and stretch happens; evenly for all others.
    pub twist_curves: Vec<TwistCurve>,
}

impl Default for BindSettings {
    fn default() -> Self {
        Self {
            replace_rig: false,
            // Smooth weights reach far: where many bones meet, four would leave seams.
            max_influences: 8,
            limit_painted: None,
            bind_unbound: false,
            transfer: Vec::new(),
            method: BindMethod::Biharmonic(BiharmonicTier::Interactive),
            on: WeightsOn::Volume { vertices: WEIGHT_VOLUME_VERTICES },
            joint_release: FREE_NEAR_JOINTS,
            smooth_weights: None,
            heat: BoneHeatSettings::default(),
            skin: SkinKind::Linear,
            endpoints: None,
            twist_curves: Vec::new(),
        }
    }
}
