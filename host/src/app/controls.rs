//! Mouse and keys as people know them from other programs.

use eframe::egui::{Modifiers, PointerButton};

/// Whose habits the window follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Controls {
    /// Its own: every button does something useful.
    #[default]
    Armature,
    /// Blender's.
    Blender,
    /// Maya's.
    Maya,
}

/// What a drag does to the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Drag {
    /// Around the character.
    Orbit,
    /// Sideways.
    Pan,
    /// Nearer and further.
    Zoom,
}

impl Controls {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Armature, Self::Blender, Self::Maya];

    /// For menus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Armature => "Armature",
            Self::Blender => "Blender",
            Self::Maya => "Maya",
        }
    }

    /// How the camera is moved, on one line.
    pub fn navigation(self) -> &'static str {
        match self {
            Self::Armature => "Drag to orbit, Shift-drag to pan, wheel to zoom",
            Self::Blender => "Middle drag to orbit, with Shift to pan, with Ctrl or wheel to zoom",
            Self::Maya => "Alt-drag: left to orbit, middle to pan, right or wheel to zoom",
        }
    }

    /// What a drag with this button does.
    pub(super) fn drag(self, button: PointerButton, modifiers: Modifiers) -> Option<Drag> {
        use PointerButton::{Middle, Primary, Secondary};
        match self {
            Self::Armature => match button {
                Middle => Some(Drag::Pan),
                Primary if modifiers.shift => Some(Drag::Pan),
                Primary | Secondary => Some(Drag::Orbit),
                _ => None,
            },
            Self::Blender if button != Middle => None,
            Self::Blender if modifiers.shift => Some(Drag::Pan),
            Self::Blender if modifiers.command => Some(Drag::Zoom),
            Self::Blender => Some(Drag::Orbit),
            Self::Maya if !modifiers.alt => None,
            Self::Maya => match button {
                Primary => Some(Drag::Orbit),
                Middle => Some(Drag::Pan),
                Secondary => Some(Drag::Zoom),
                _ => None,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_program_can_orbit_and_pan() {
        let modifiers = [Modifiers::NONE, Modifiers::SHIFT, Modifiers::ALT, Modifiers::COMMAND];
        let buttons = [PointerButton::Primary, PointerButton::Middle, PointerButton::Secondary];
        for controls in Controls::ALL {
            let does =
                |drag: Drag| buttons.iter().any(|b| modifiers.iter().any(|m| controls.drag(*b, *m) == Some(drag)));
            assert!(does(Drag::Orbit) && does(Drag::Pan), "{controls:?}");
        }
        assert_eq!(Controls::Maya.drag(PointerButton::Primary, Modifiers::NONE), None, "a plain drag selects in Maya");
    }
}
