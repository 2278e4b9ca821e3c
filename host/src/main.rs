//! The `armature` program: everything it does is in the library beside it.

use std::process::ExitCode;

fn main() -> ExitCode {
    quieten_graphics_without_a_session();
    armature::program::main()
}

/// Mesa's device selection asks the Wayland session which GPU it uses, and complains on standard error if there is no
/// session, as on a build machine.
fn quieten_graphics_without_a_session() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: this is the first thing the program does; there is no other thread that could read the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
