//! The one table of commands: what each is called, what it does, when it is possible, and its keys. Menus, the command
//! palette, the sheet of shortcuts, buttons and the keyboard all read it.

use std::sync::LazyLock;

use armature_rig::CalibrationStep;
use eframe::egui::{Context, Event, Key, KeyboardShortcut, Modifiers};

use super::action::Action;
use super::controls::Controls;
use super::desk::COUNTDOWNS;
use super::state::{Listed, Overlay, State};
use crate::characters::OWN;
use crate::engine::command::CharacterChoice;

/// Where a command is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Menu {
    Character,
    Puppet,
    Take,
    View,
    Help,
}

impl Menu {
    /// From left to right.
    pub(super) const ALL: [Self; 5] = [Self::Character, Self::Puppet, Self::Take, Self::View, Self::Help];

    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Character => "Character",
            Self::Puppet => "Puppet",
            Self::Take => "Take",
            Self::View => "View",
            Self::Help => "Help",
        }
    }
}

/// One command.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) menu: Menu,
    pub(super) text: &'static str,
    /// What it does, in a sentence.
    pub(super) tip: &'static str,
    pub(super) action: Action,
    keys: Vec<KeyboardShortcut>,
    /// Where other programs have other keys.
    other_keys: Vec<(Controls, Vec<KeyboardShortcut>)>,
    possible: fn(&State) -> Result<(), &'static str>,
    is_on: fn(&State) -> bool,
}

fn entry(menu: Menu, action: Action, text: &'static str, tip: &'static str) -> Entry {
    let (keys, other_keys) = (Vec::new(), Vec::new());
    Entry { menu, text, tip, action, keys, other_keys, possible: |_| Ok(()), is_on: |_| false }
}

fn plain(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::NONE, key)
}

fn shift(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::SHIFT, key)
}

fn alt(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::ALT, key)
}

fn command(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

impl Entry {
    /// With these keys, the first of which is shown.
    fn keys<const N: usize>(mut self, keys: [KeyboardShortcut; N]) -> Self {
        self.keys = keys.into();
        self
    }

    /// With other keys for those who come from another program.
    fn for_users_of<const N: usize>(mut self, controls: Controls, keys: [KeyboardShortcut; N]) -> Self {
        self.other_keys.push((controls, keys.into()));
        self
    }

    /// Only when this does not say why not.
    fn when(self, possible: fn(&State) -> Result<(), &'static str>) -> Self {
        Self { possible, ..self }
    }

    /// Something that is on or off.
    fn on(self, is_on: fn(&State) -> bool) -> Self {
        Self { is_on, ..self }
    }
}

static TABLE: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    let mut table = characters();
    table.extend(puppet());
    table.extend(takes());
    table.extend(view());
    table
});

fn characters() -> Vec<Entry> {
    let own = |name: &'static str, text, tip, is_on: fn(&State) -> bool| {
        entry(Menu::Character, Action::Load(CharacterChoice::BuiltIn(name)), text, tip)
            .when(State::can_change_character)
            .on(is_on)
    };
    let [human, spider, hand] = OWN;
    vec![
        own(human, "Human", "Show the built-in human", |state| state.shows(&CharacterChoice::BuiltIn(OWN[0]))),
        own(spider, "Spider", "Show the built-in spider", |state| state.shows(&CharacterChoice::BuiltIn(OWN[1]))),
        own(hand, "Hand", "Show the built-in hand", |state| state.shows(&CharacterChoice::BuiltIn(OWN[2]))),
        entry(
            Menu::Character,
            Action::OpenCharacter,
            "Open…",
            "A character, a mesh or a skeleton from a file; you can also drop it onto the window",
        )
        .keys([command(Key::O)])
        .when(State::can_change_character),
    ]
}

fn puppet() -> Vec<Entry> {
    let puppet = |action, text, tip| entry(Menu::Puppet, action, text, tip);
    let calibrate =
        |step, text, tip| entry(Menu::Puppet, Action::Calibrate(step), text, tip).when(State::can_calibrate);
    vec![
        puppet(Action::ConnectToField, "Connect", "Connect to the address in the field on the left")
            .keys([command(Key::K)])
            .when(State::can_connect),
        puppet(Action::Disconnect, "Disconnect", "Close the connection, or stop trying to connect")
            .when(State::can_disconnect),
        puppet(Action::ListDevices, "Refresh", "Look for plugged-in puppets again").keys([plain(Key::F5)]),
        puppet(Action::Zero, "Zero", "The puppet is in the character's rest pose now: make this zero")
            .keys([plain(Key::Z)])
            .when(State::can_calibrate),
        calibrate(CalibrationStep::Zero, "Calibrate: zero", "Zero after a countdown"),
        calibrate(
            CalibrationStep::Sweep,
            "Calibrate: sweep",
            "Move every joint from stop to stop: finds ranges and directions",
        ),
        calibrate(
            CalibrationStep::Mounting,
            "Calibrate: mounting",
            "Bend and twist every joint: finds how it is mounted",
        ),
        calibrate(CalibrationStep::Heading, "Calibrate: heading", "Finds where the puppet's front is"),
    ]
}

fn takes() -> Vec<Entry> {
    let take = |action, text, tip| entry(Menu::Take, action, text, tip);
    let mut table = vec![
        take(Action::Record, "Record", "Record a take, or the armed limbs over the open one")
            .keys([plain(Key::R)])
            .when(State::can_record),
        take(Action::StopRecording, "Stop", "Finish the take and save it").keys([shift(Key::R)]).when(State::recorded),
        take(
            Action::RecordAgain,
            "Record again",
            "Put the take being recorded, or the last one, into the bin and start another",
        )
        .keys([shift(Key::Backspace)])
        .when(State::live),
        take(Action::TogglePlay, "Play or pause", "Play the open take, or stand still")
            .keys([plain(Key::Space)])
            .for_users_of(Controls::Maya, [alt(Key::V)])
            .when(State::can_play)
            .on(|state| state.desk.playback.playing),
        take(Action::GoTo { end: false }, "To the start", "Or to the in point")
            .keys([plain(Key::Home)])
            .for_users_of(Controls::Blender, [shift(Key::ArrowLeft)])
            .when(State::can_play),
        take(Action::Step { forward: false }, "One pose back", "And stand still")
            .keys([plain(Key::ArrowLeft)])
            .for_users_of(Controls::Maya, [alt(Key::Comma)])
            .when(State::can_play),
        take(Action::Step { forward: true }, "One pose on", "And stand still")
            .keys([plain(Key::ArrowRight)])
            .for_users_of(Controls::Maya, [alt(Key::Period)])
            .when(State::can_play),
        take(Action::GoTo { end: true }, "To the end", "Or to the out point")
            .keys([plain(Key::End)])
            .for_users_of(Controls::Blender, [shift(Key::ArrowRight)])
            .when(State::can_play),
        take(Action::ToggleLoop, "Loop", "Begin again at the end")
            .keys([plain(Key::L)])
            .when(State::can_play)
            .on(|state| state.desk.playback.looping),
        take(Action::SetIn, "In", "The part to keep or export begins at the playhead")
            .keys([plain(Key::I)])
            .when(State::can_play),
        take(Action::SetOut, "Out", "The part to keep or export ends at the playhead")
            .keys([plain(Key::O)])
            .when(State::can_play),
        take(Action::ClearRange, "Without in and out", "Play and export the whole take again")
            .keys([shift(Key::I)])
            .when(State::can_trim),
        take(Action::Mark, "Mark", "Put a marker at the playhead").keys([plain(Key::M)]).when(State::can_edit),
        take(Action::Trim, "Trim", "Keep only what is between the in and the out point; the recording stays as it is")
            .keys([command(Key::T)])
            .when(State::can_trim),
        take(Action::UndoEdit, "Undo the last edit", "Take the open take's last edit back")
            .keys([command(Key::Z)])
            .when(State::can_undo),
        take(Action::RedoEdit, "Redo", "Bring back the edit that was taken back last")
            .keys([KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z)])
            .when(State::can_redo),
        take(Action::ShowExport, "Export…", "Write the take for another program")
            .keys([command(Key::E)])
            .when(State::can_play),
        take(Action::DiscardOpen, "Discard", "Put the open take into the bin")
            .keys([plain(Key::Delete)])
            .when(State::can_edit),
        take(Action::CloseTake, "Back to the puppet", "Close the take").keys([command(Key::W)]).when(State::can_play),
    ];
    let waits = [
        ("Record at once", "Without a countdown"),
        ("Record after 3 s", "With a countdown"),
        ("Record after 5 s", "With a countdown"),
        ("Record after 10 s", "With a countdown"),
    ];
    let on: [fn(&State) -> bool; 4] = [
        |state| state.desk.countdown == COUNTDOWNS[0],
        |state| state.desk.countdown == COUNTDOWNS[1],
        |state| state.desk.countdown == COUNTDOWNS[2],
        |state| state.desk.countdown == COUNTDOWNS[3],
    ];
    let waits = waits.into_iter().zip(COUNTDOWNS).zip(on);
    table.extend(waits.map(|(((text, tip), seconds), on)| take(Action::Countdown(seconds), text, tip).on(on)));
    table
}

fn view() -> Vec<Entry> {
    let view = |action, text, tip| entry(Menu::View, action, text, tip);
    let help = |action, text, tip| entry(Menu::Help, action, text, tip);
    vec![
        view(Action::FrameAll, "Frame", "Show the whole character")
            .keys([plain(Key::F)])
            .for_users_of(Controls::Blender, [plain(Key::Home)])
            .for_users_of(Controls::Maya, [plain(Key::A), plain(Key::F)]),
        view(Action::ToggleBones, "Bones", "Show or hide the bones").keys([plain(Key::B)]).on(|state| state.show_bones),
        view(Action::Follow(Controls::Armature), "Mouse and keys as in Armature", "Every button moves the camera")
            .on(|state| state.controls == Controls::Armature),
        view(
            Action::Follow(Controls::Blender),
            "Mouse and keys as in Blender",
            "The middle button moves the camera; Home frames the character",
        )
        .on(|state| state.controls == Controls::Blender),
        view(
            Action::Follow(Controls::Maya),
            "Mouse and keys as in Maya",
            "Alt and a button move the camera; A frames the character",
        )
        .on(|state| state.controls == Controls::Maya),
        view(Action::List(Listed::Joints), "Joints on the left", "List the puppet's joints")
            .keys([plain(Key::J)])
            .on(|state| state.listed == Listed::Joints),
        view(Action::List(Listed::Takes), "Takes on the left", "List the takes")
            .keys([plain(Key::T)])
            .on(|state| state.listed == Listed::Takes),
        view(Action::Back, "Close or deselect", "Close what lies over the window, else select nothing")
            .keys([plain(Key::Escape)]),
        help(Action::Toggle(Overlay::Palette), "Find a command…", "Type a part of its name").keys([command(Key::P)]),
        help(Action::Toggle(Overlay::Shortcuts), "Keys and mouse", "All shortcuts on one sheet").keys([
            plain(Key::F1),
            shift(Key::Questionmark),
            plain(Key::Questionmark),
        ]),
    ]
}

/// All commands.
pub(super) fn all() -> impl Iterator<Item = &'static Entry> {
    TABLE.iter()
}

/// The command that asks for this.
pub(super) fn of(action: &Action) -> Option<&'static Entry> {
    all().find(|entry| entry.action == *action)
}

impl Entry {
    /// Its keys, the first of which is shown.
    pub(super) fn keys_of(&self, controls: Controls) -> &[KeyboardShortcut] {
        self.other_keys.iter().find(|(of, _)| *of == controls).map_or(&self.keys, |(_, keys)| keys)
    }

    /// Its first key, as it is written on a keyboard.
    pub(super) fn key(&self, ctx: &Context, controls: Controls) -> Option<String> {
        self.keys_of(controls).first().map(|key| written(ctx, *key))
    }

    /// Why it is not possible now.
    pub(super) fn possible(&self, state: &State) -> Result<(), &'static str> {
        (self.possible)(state)
    }

    pub(super) fn is_on(&self, state: &State) -> bool {
        (self.is_on)(state)
    }

    /// What it does, with its key.
    pub(super) fn hint(&self, ctx: &Context, controls: Controls) -> String {
        self.key(ctx, controls).map_or_else(|| self.tip.to_owned(), |key| format!("{} ({key})", self.tip))
    }
}

/// A key as it is written on a keyboard.
pub(super) fn written(ctx: &Context, key: KeyboardShortcut) -> String {
    if key.logical_key == Key::Questionmark { "?".into() } else { ctx.format_shortcut(&key) }
}

/// The commands whose keys were pressed. A key that is held down counts once, and no button takes a key of the table
/// because it has the focus; only a field for text keeps the keys that write.
pub(super) fn pressed(ctx: &Context, state: &State) -> Vec<Action> {
    let typing = ctx.text_edit_focused();
    let mut actions = Vec::new();
    ctx.input_mut(|input| {
        input.events.retain(|event| {
            let Event::Key { key, pressed: true, repeat, modifiers, .. } = event else { return true };
            if typing && writes(*key, *modifiers) {
                return true;
            }
            let is_its = |shortcut: &KeyboardShortcut| {
                shortcut.logical_key == *key && modifiers.matches_exact(shortcut.modifiers)
            };
            let Some(entry) = all().find(|entry| entry.keys_of(state.controls).iter().any(is_its)) else {
                return true;
            };
            if !repeat {
                actions.push(match entry.possible(state) {
                    Ok(()) => entry.action.clone(),
                    Err(why) => Action::Explain(why),
                });
            }
            false
        });
    });
    actions
}

/// Whether a field for text needs the key.
fn writes(key: Key, modifiers: Modifiers) -> bool {
    let edits = matches!(key, Key::A | Key::C | Key::V | Key::X | Key::Y | Key::Z);
    let is_function = matches!(key, Key::Escape | Key::F1 | Key::F5);
    !is_function && (!modifiers.command || edits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_means_two_things_at_once() {
        for controls in Controls::ALL {
            for (index, entry) in TABLE.iter().enumerate() {
                for other in &TABLE[index + 1..] {
                    let shared = entry.keys_of(controls).iter().any(|key| other.keys_of(controls).contains(key));
                    assert!(!shared, "{controls:?}: {} and {}", entry.text, other.text);
                }
            }
        }
    }

    #[test]
    fn every_command_says_what_it_does() {
        for (index, entry) in TABLE.iter().enumerate() {
            assert!(!entry.text.is_empty() && entry.tip.len() > 5, "{entry:?}");
            assert!(TABLE[index + 1..].iter().all(|other| other.text != entry.text), "{} is there twice", entry.text);
            assert!(
                of(&entry.action).is_some_and(|found| std::ptr::eq(found, entry)),
                "{} shares its action",
                entry.text
            );
        }
        for name in OWN {
            let own = Action::Load(CharacterChoice::BuiltIn(name));
            assert_eq!(of(&own).map(|entry| entry.text.to_lowercase()).as_deref(), Some(name));
        }
        for step in CalibrationStep::ALL {
            assert_eq!(
                of(&Action::Calibrate(step)).map(|entry| entry.text.to_owned()),
                Some(format!("Calibrate: {step}"))
            );
        }
    }

    /// Whoever leans on a key by accident must be able to go on.
    #[test]
    fn no_single_key_ends_or_throws_away_a_take() {
        let ends = [Action::StopRecording, Action::Disconnect, Action::RecordAgain];
        for controls in Controls::ALL {
            for entry in TABLE.iter().filter(|entry| ends.contains(&entry.action)) {
                assert!(entry.keys_of(controls).iter().all(|key| key.modifiers.any()), "{}", entry.text);
            }
        }
    }

    #[test]
    fn a_field_for_text_keeps_what_it_needs() {
        assert!(
            writes(Key::R, Modifiers::NONE)
                && writes(Key::Z, Modifiers::COMMAND)
                && writes(Key::Space, Modifiers::NONE)
        );
        assert!(!writes(Key::P, Modifiers::COMMAND) && !writes(Key::F1, Modifiers::NONE));
    }
}
