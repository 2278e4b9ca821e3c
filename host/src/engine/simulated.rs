//! Simulated puppets by the names and options of the command line.

use std::path::Path;

use armature_sim::{Body, Motion, NoiseBurst, Puppet, PuppetSettings};

use crate::cli::SimulatedArgs;
use crate::failure::Failure;
use crate::inputs;

/// Makes the puppet that `sim:NAME` means: a preset, or one with a joint for each bone of a motion file.
pub fn puppet(name: &str, args: &SimulatedArgs) -> Result<Puppet, Failure> {
    let settings = settings(name, args)?;
    Puppet::new(settings).map_err(|e| Failure::usage(e.to_string(), ""))
}

fn settings(name: &str, args: &SimulatedArgs) -> Result<PuppetSettings, Failure> {
    let path = Path::new(name);
    let (body, motion) = if path.extension().is_some() {
        let motion = inputs::motion(path)?;
        let (body, track) = serve::puppet_from_motion(&motion, args.seed)
            .map_err(|e| Failure::input(format!("{name}: {e}"), "choose another motion file"))?;
        let chosen = if args.motion == DEFAULT_MOTION { Motion::Track(track) } else { chosen_motion(args, &body)? };
        (body, chosen)
    } else {
        let body = Body::preset(name, args.seed)
            .map_err(|e| Failure::usage(e.to_string(), "choose sim:human, sim:spider, sim:hand, or sim:FILE.bvh"))?;
        let motion = chosen_motion(args, &body)?;
        (body, motion)
    };
    let mut settings = PuppetSettings { motion, seed: args.seed, ..PuppetSettings::new(body) };
    settings.faults.bit_flip = args.flip;
    settings.faults.byte_drop = args.drop;
    settings.faults.noise = args
        .noise_burst()?
        .map(|(start, length)| NoiseBurst { start_micros: micros(start), duration_micros: micros(length) })
        .into_iter()
        .collect();
    Ok(settings)
}

/// The motion of a puppet for which none was chosen.
pub const DEFAULT_MOTION: &str = "walk+wave";

fn chosen_motion(args: &SimulatedArgs, body: &Body) -> Result<Motion, Failure> {
    if let Some(motion) = Motion::by_name(&args.motion) {
        return Ok(motion);
    }
    let path = Path::new(&args.motion);
    if path.extension().is_none() {
        let what = format!("there is no motion {:?}", args.motion);
        return Err(Failure::usage(what, "choose rest, walk, wave, walk+wave, wiggle, or a BVH file"));
    }
    let motion = inputs::motion(path)?;
    let track = serve::retarget(&motion, body).map_err(|e| {
        let remedy = format!("--device sim:{} gives a puppet with a joint for each of its bones", args.motion);
        Failure::input(format!("{}: {e}", args.motion), remedy)
    })?;
    Ok(Motion::Track(track))
}

fn micros(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64
}

mod serve {
    pub fn puppet_from_motion(_: &armature_rig::Motion, _: u64) -> Result<(armature_sim::Body, armature_sim::JointTrack), String> { Err("not yet".into()) }
    pub fn retarget(_: &armature_rig::Motion, _: &armature_sim::Body) -> Result<armature_sim::JointTrack, String> { Err("not yet".into()) }
}
