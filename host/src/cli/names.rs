//! Help texts that list things by name or number: each list and number comes from the code it describes.

use armature_device::servo::ServoArm;
use armature_sim::Body;
use armature_sim::body::MOST_JOINTS;

use crate::characters::OWN;

/// Vertices of a coarser volume by default.
pub const VOLUME_VERTICES: usize = 10_000;

/// `sim:` addresses of the simulated puppets that need no file.
fn simulated() -> String {
    Body::presets().map(|(name, _)| format!("sim:{name}")).collect::<Vec<_>>().join(", ")
}

/// Help of `--device`.
pub(super) fn device_help() -> String {
    format!(
        "The puppet: {}, sim:joints:N (up to {MOST_JOINTS}), sim:FILE.bvh, serial:PATH[@BAUD], usb:VID:PID[,SERIAL], \
         hid:VID:PID[,SERIAL], tcp:HOST:PORT, or an arm of servos: feetech:PATH[@BAUD], dynamixel:PATH[@BAUD]",
        simulated()
    )
}

/// Help of `volume --vertices`.
pub(super) fn vertices_help() -> String {
    format!("About how many vertices the coarser volume has [default: {VOLUME_VERTICES}]")
}

/// Help of `demo --puppet`.
pub(super) fn puppet_help() -> String {
    format!("The simulated puppet: {} (human8: eight joints for a whole human)", Body::preset_names())
}

/// Help of `--preset`.
pub(super) fn arm_help() -> String {
    format!("Which arm of servos: {}", ServoArm::preset_names())
}

/// Help of `run --character`.
pub(super) fn character_help() -> String {
    format!(
        "The character: {}, a .armature file, or a mesh or motion file with a skeleton. Without it, the one that matches \
         the simulated puppet, else {}",
        OWN.join(", "),
        OWN[0]
    )
}

#[cfg(test)]
mod tests {
    use armature_sim::servo::ServoBusSettings;
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    fn help_of(command: &str) -> String {
        let mut cli = Cli::command();
        let found = cli.find_subcommand_mut(command).expect("a subcommand");
        found.render_long_help().to_string().split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn help_lists_every_puppet_character_and_arm_there_is() {
        let (run, demo) = (help_of("run"), help_of("demo"));
        for (name, _) in Body::presets() {
            assert!(run.contains(&format!("sim:{name},")) && demo.contains(name), "{name}");
            assert!(Body::preset(name, 1).is_ok(), "{name}");
        }
        for arm in ServoArm::presets() {
            assert!(run.contains(&arm.name) && help_of("calibrate").contains(&arm.name), "{}", arm.name);
        }
        for name in OWN {
            assert!(run.contains(&format!("{name},")), "{name}");
        }
        assert!(run.contains(&format!("up to {MOST_JOINTS}")));
        assert!(Body::preset(&format!("joints:{MOST_JOINTS}"), 1).is_ok());
        assert!(Body::preset(&format!("joints:{}", MOST_JOINTS + 1), 1).is_err());
    }

    #[test]
    fn the_simulator_has_the_arms_that_the_host_knows() {
        let simulated: Vec<&str> = ServoBusSettings::preset_names().collect();
        assert_eq!(simulated.join(", "), ServoArm::preset_names());
    }
}
