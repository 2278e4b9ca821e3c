//! `--stream`: other programs that get the poses while they happen.

use armature_rig::Skeleton;
use clap::Args;

use super::sender::Streams;
use super::skeleton::StreamedSkeleton;
use super::target::{StreamKind, StreamTarget};
use crate::failure::Failure;

/// Live streams.
#[derive(Clone, Debug, Args)]
pub struct StreamArgs {
    #[arg(id = "streams", long = "stream", value_name = "TARGET", conflicts_with = "virtual_clock", help = stream_help())]
    #[expect(missing_docs, reason = "its help is put together from the kinds there are")]
    pub targets: Vec<StreamTarget>,
    /// Poses per second in each stream, at most
    #[arg(long, value_name = "HERTZ", default_value_t = 60.0, requires = "streams", value_parser = stream_rate)]
    pub stream_rate: f64,
}

impl StreamArgs {
    /// Opens the streams, if there are any.
    pub fn open(&self, subject: &str, skeleton: &Skeleton) -> Result<Option<Streams>, Failure> {
        if self.targets.is_empty() {
            return Ok(None);
        }
        Streams::open(&self.targets, self.stream_rate, StreamedSkeleton::new(subject, skeleton)).map(Some)
    }
}

fn stream_rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if rate.is_finite() && (1.0..=1000.0).contains(&rate) { Ok(rate) } else { Err("give 1 to 1000 a second".into()) }
}

fn stream_help() -> String {
    let [vmc, json, ws] = StreamKind::ALL.map(|kind| (kind.word(), kind.default_port()));
    format!(
        "Send each pose to another program while it happens; may be given several times. {}[:HOST][:PORT]: VMC over OSC, \
         for programs that show VRM avatars (humans only; port {} if none is given). {}[:HOST][:PORT]: one JSON object \
         a UDP datagram, any skeleton, for Blender with our extension ({}). {}[:ADDRESS][:PORT]: the same as a WebSocket \
         served here ({}). Without a host, this machine only",
        vmc.0, vmc.1, json.0, json.1, ws.0, ws.1
    )
}
