//! The window with a scripted engine: clicks become commands, events become labels.
//!
//! With `ARMATURE_SNAPSHOTS=FOLDER` the windows are also written as PNG files for viewing.

mod puppets;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use armature::app::controls::Controls;
use armature::app::{Start, Window};
use armature::engine::command::{CharacterChoice, Command};
use armature::engine::event::{EngineEvent, FoundDevice, Problem};
use armature::engine::link::{EngineLink, link};
use armature::engine::playback::{Play, Playback};
use armature::takes::library::{Library, ListedTake};
use armature::takes::orders::ExportReceipt;
use armature_rig::CalibrationStep;
use armature_take::{Edit, EditList};
use eframe::egui::{Event, Key, Modifiers, PointerButton, Pos2, Vec2, pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

/// A window and the engine's end of its link.
struct Stage {
    harness: Harness<'static, Window>,
    engine: EngineLink,
}

impl Stage {
    fn open(start: Start) -> Self {
        let (sender, receiver): (_, Receiver<EngineLink>) = channel();
        let builder = Harness::builder().with_size(Vec2::new(1280.0, 800.0)).with_step_dt(0.1);
        let make = move |context: &mut eframe::CreationContext<'_>| {
            let (app, engine) = link(|| {});
            sender.send(engine).expect("the test waits for it");
            Window::new(context, app, start)
        };
        // Layout and clicks need no graphics; pictures do.
        let mut harness =
            if snapshots().is_some() { builder.wgpu().build_eframe(make) } else { builder.build_eframe(make) };
        let engine = receiver.try_recv().expect("the window has made its link");
        harness.run_steps(3);
        Self { harness, engine }
    }

    fn tell(&mut self, events: impl IntoIterator<Item = EngineEvent>) {
        for event in events {
            self.engine.send(event);
        }
        self.harness.run_steps(3);
    }

    fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        // A panel that appears needs a few frames to find its size.
        self.harness.run_steps(6);
    }

    fn press(&mut self, key: Key) {
        self.press_with(Modifiers::NONE, key);
    }

    fn press_with(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        // A panel that appears needs a few frames to find its size.
        self.harness.run_steps(4);
    }

    fn click_at(&mut self, pos: Pos2) {
        self.harness.event(Event::PointerMoved(pos));
        for pressed in [true, false] {
            let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
            self.harness.event(Event::PointerButton { pos, button, pressed, modifiers });
            self.harness.run_steps(1);
        }
        self.harness.run_steps(2);
    }

    fn commands(&self) -> Vec<Command> {
        std::iter::from_fn(|| self.engine.try_command()).collect()
    }

    fn sees(&self, text: &str) -> bool {
        self.harness.query_all_by_label_contains(text).next().is_some()
    }

    fn snapshot(&mut self, name: &str) {
        let Some(folder) = snapshots() else { return };
        self.harness.run_steps(12);
        let picture = self.harness.render().expect("a picture of the window");
        picture.save(folder.join(format!("{name}.png"))).expect("the folder can be written");
    }
}

fn snapshots() -> Option<std::path::PathBuf> {
    std::env::var_os("ARMATURE_SNAPSHOTS").map(Into::into)
}

fn connected() -> Stage {
    let mut stage = Stage::open(Start::default());
    let character = puppets::character();
    let frame = puppets::frame(&character);
    stage.tell([
        EngineEvent::CharacterLoaded(Arc::new(character)),
        EngineEvent::Connected { address: "sim:human".into(), device: "Armature simulator 1.0".into() },
        EngineEvent::Topology { tree: puppets::tree() },
        EngineEvent::Mapping { bone_of_part: puppets::mapping(), solved: Vec::new() },
        EngineEvent::Frame(frame),
    ]);
    stage.commands();
    stage
}

#[test]
fn an_empty_window_teaches_what_to_do() {
    let mut stage = Stage::open(Start::default());
    let human = Command::LoadCharacter(CharacterChoice::BuiltIn("human"));
    assert_eq!(stage.commands(), [Command::ListDevices, Command::ListTakes, human]);
    assert!(stage.sees("Start a simulated one above"));
    stage.tell([EngineEvent::Busy { task: "Making the human".into(), fraction: Some(0.4) }]);
    assert!(stage.sees("Making the human"));
    stage.snapshot("1-empty");
    stage.tell([EngineEvent::CharacterLoaded(Arc::new(puppets::character()))]);
    assert!(stage.sees("plug a puppet in and choose its port."));
    stage.snapshot("2-character");
}

#[test]
fn presets_addresses_and_ports_connect() {
    let mut stage = Stage::open(Start::default());
    stage.commands();
    stage.click("Connect");
    assert_eq!(stage.commands(), [Command::Connect("sim:human".into())]);
    assert!(stage.sees("Connecting to sim:human"));
    stage.click("Give up");
    assert_eq!(stage.commands(), [Command::Disconnect]);
    stage.tell([
        EngineEvent::Disconnected { problem: None },
        EngineEvent::Devices(vec![FoundDevice { address: "serial:/dev/ttyACM0".into(), label: "Puppet hub".into() }]),
    ]);
    stage.snapshot("8-ports");
    stage.harness.get_by_label_contains("Puppet hub").click();
    stage.harness.run_steps(2);
    assert_eq!(stage.commands(), [Command::Connect("serial:/dev/ttyACM0".into())]);
    stage.tell([EngineEvent::Disconnected { problem: None }]);
    stage.click("Refresh");
    stage.press_with(Modifiers::COMMAND, Key::K);
    let again = Command::Connect("serial:/dev/ttyACM0".into());
    assert_eq!(stage.commands(), [Command::ListDevices, again], "to the last address");
}

#[test]
fn zero_and_record_by_click_and_by_key() {
    let mut stage = connected();
    stage.click("Zero");
    stage.press(Key::Z);
    assert_eq!(stage.commands(), [Command::Zero, Command::Zero]);
    stage.click("Record");
    assert_eq!(stage.commands(), [Command::StartRecording]);
    stage.tell([EngineEvent::Recording { seconds: 12.44, samples: 4976 }]);
    for key in [Key::Z, Key::Space, Key::R, Key::Escape, Key::Backspace] {
        stage.press(key);
    }
    stage.click("Disconnect");
    assert_eq!(stage.commands(), [], "no key re-zeroes, disconnects or stops in the middle of a take");
    stage.snapshot("4-recording");
    stage.click("Stop");
    stage.press_with(Modifiers::SHIFT, Key::R);
    assert_eq!(stage.commands(), [Command::StopRecording, Command::StopRecording]);
    let path = "/home/kim/Armature/2026-03-01 walk.take".into();
    stage.tell([EngineEvent::Saved { path, seconds: 12.5, samples: 5000, lost: 0 }]);
    assert!(stage.sees("Take saved: 0:12.5") && stage.sees("2026-03-01 walk.take"));
    stage.snapshot("5-saved");
    stage.click("Close");
    assert!(!stage.sees("Take saved"));
}

#[test]
fn calibration_steps_are_in_the_menu_of_zero() {
    for step in CalibrationStep::ALL {
        let mut stage = connected();
        stage.harness.get_by_label("Zero").click_secondary();
        stage.harness.run_steps(6);
        stage.snapshot("9-calibrate");
        stage.click(&format!("Calibrate: {step}"));
        assert_eq!(stage.commands(), [Command::Calibrate(step)]);
        let task = format!("Get ready, 3 s: {}", step.instructions()[0]);
        stage.tell([EngineEvent::Busy { task, fraction: None }]);
        let instruction = stage.harness.get_by_label_contains("Get ready, 3 s").rect();
        let cross = stage.harness.get_by_label("Cancel").rect();
        assert!(instruction.right() <= cross.left() && cross.right() < 1270.0, "{step}: {instruction} {cross}");
        stage.snapshot("10-instruction");
        stage.tell([EngineEvent::Idle, EngineEvent::Calibrated { step, measured: 40, failed: 0 }]);
        assert!(!stage.sees("Get ready"), "the step is over");
    }
}

#[test]
fn what_the_line_does_to_the_stream_is_counted_at_the_bottom() {
    let stage = connected();
    for name in ["Lost", "Checksum errors", "Resyncs"] {
        assert!(stage.harness.query_by_label(name).is_some(), "{name}");
    }
}

#[test]
fn shortcuts_work_after_tab_and_ignore_a_held_key() {
    let mut stage = connected();
    // Some button gets the keyboard focus.
    stage.press(Key::Tab);
    for repeat in [false, true, true] {
        let modifiers = Modifiers::NONE;
        stage.harness.event(Event::Key { key: Key::R, physical_key: None, pressed: true, repeat, modifiers });
        stage.harness.run_steps(2);
    }
    assert_eq!(stage.commands(), [Command::StartRecording], "only the press counts, not its repetitions");
}

#[test]
fn a_command_is_found_by_typing() {
    let mut stage = connected();
    stage.press_with(Modifiers::COMMAND, Key::P);
    assert!(stage.sees("Find a command"));
    stage.harness.event(Event::Text("calib sweep".into()));
    stage.harness.run_steps(4);
    stage.snapshot("11-palette");
    stage.press(Key::Enter);
    assert_eq!(stage.commands(), [Command::Calibrate(CalibrationStep::Sweep)]);
    assert!(!stage.sees("Find a command"), "it has done its work");
    stage.press_with(Modifiers::COMMAND, Key::P);
    stage.harness.event(Event::Text("r".into()));
    stage.press(Key::R);
    assert_eq!(stage.commands(), [], "a field for text keeps its keys");
    stage.press(Key::Escape);
    assert!(!stage.sees("Find a command"));
}

#[test]
fn one_sheet_has_all_keys() {
    let mut stage = connected();
    stage.press(Key::F1);
    for text in ["Keys and mouse", "F1 or ?", "Shift+R", "Ctrl+P"] {
        assert!(stage.sees(text), "{text}");
    }
    stage.snapshot("12-keys");
    stage.press(Key::Escape);
    assert!(!stage.sees("Shift+R"));
}

#[test]
fn menus_hold_every_command_and_follow_other_programs() {
    let mut stage = connected();
    stage.click("View");
    stage.snapshot("13-menu");
    stage.click("Mouse and keys as in Blender");
    assert!(stage.harness.state().state().controls == Controls::Blender);
    stage.click("Take");
    stage.harness.get_all_by_label_contains("Record").last().expect("an entry").click();
    stage.harness.run_steps(4);
    assert_eq!(stage.commands(), [Command::StartRecording]);
}

#[test]
fn what_is_not_possible_says_why() {
    let mut stage = Stage::open(Start::default());
    stage.commands();
    stage.press(Key::R);
    assert!(stage.sees("Connect a puppet first"));
    assert_eq!(stage.commands(), []);
}

#[test]
fn without_a_puppet_there_is_nothing_to_zero_or_record() {
    let mut stage = Stage::open(Start::default());
    stage.commands();
    stage.press(Key::Z);
    stage.press(Key::R);
    stage.click("Zero");
    stage.click("Record");
    assert_eq!(stage.commands(), []);
}

#[test]
fn a_joint_shows_its_bone_its_states_and_blinks() {
    let mut stage = connected();
    assert!(stage.sees("400 Hz") && stage.sees("0.31 / 0.84 ms"));
    stage.snapshot("3-live");
    stage.snapshot("3-live");
    stage.click("forearm.L");
    assert!(stage.sees("moves the bone forearm.L"));
    stage.snapshot("6-selected");
    stage.click("Blink");
    assert!(matches!(stage.commands().as_slice(), [Command::Blink(uid)] if uid.0[11] == 6));
    stage.press(Key::Escape);
    assert!(!stage.sees("moves the bone forearm.L"));
}

#[test]
fn a_click_on_the_character_selects_the_joint() {
    let mut stage = connected();
    // The spine is visible there from the camera's initial position; see the snapshot `3-live`.
    stage.click_at(pos2(766.0, 245.0));
    assert_eq!(stage.harness.state().state().selected, Some(1), "the spine");
    stage.click_at(pos2(1200.0, 500.0));
    assert_eq!(stage.harness.state().state().selected, None, "nothing");
}

#[test]
fn a_problem_comes_with_its_remedy_and_goes_when_dismissed() {
    let mut stage = connected();
    let problem =
        Problem { what: "The puppet stopped answering.".into(), remedy: "Check the cable, then connect again.".into() };
    stage.tell([EngineEvent::Problem(problem.clone())]);
    stage.tell([EngineEvent::Disconnected { problem: Some(problem) }]);
    assert!(stage.sees("The puppet stopped answering.") && stage.sees("Check the cable"));
    stage.snapshot("7-problem");
    stage.click("Dismiss");
    assert!(!stage.sees("The puppet stopped answering."));
}

#[test]
fn characters_are_chosen_by_click_and_on_the_command_line() {
    let start = Start { device: Some("sim:hand".into()), character: CharacterChoice::BuiltIn("hand") };
    let mut stage = Stage::open(start);
    let first = stage.commands();
    assert!(first.contains(&Command::LoadCharacter(CharacterChoice::BuiltIn("hand"))));
    assert!(first.contains(&Command::Connect("sim:hand".into())));
    stage.tell([EngineEvent::Disconnected { problem: None }]);
    // The first match of a name is the simulated puppet's button, the second the character's.
    let mut click_nth = |label: &str, nth: usize| {
        stage.harness.get_all_by_label(label).nth(nth).expect("both buttons").click();
        stage.harness.run_steps(2);
        stage.commands()
    };
    assert_eq!(click_nth("Spider", 1), [Command::LoadCharacter(CharacterChoice::BuiltIn("spider"))]);
    let human = [Command::LoadCharacter(CharacterChoice::BuiltIn("human")), Command::Connect("sim:human".into())];
    assert_eq!(click_nth("Human", 0), human, "a simulated human comes with a human to look at");
}

#[test]
fn an_engine_that_ends_is_not_silence() {
    let Stage { mut harness, engine } = connected();
    drop(engine);
    harness.get_by_label("Zero").click();
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("The engine of this program has stopped").is_some());
}

#[test]
fn waiting_and_working_draw_little() {
    let mut stage = Stage::open(Start::default());
    stage.tell([EngineEvent::CharacterLoaded(Arc::new(puppets::character()))]);
    stage.commands();
    let until_next_frame = |stage: &mut Stage| {
        // What appears fades in.
        stage.harness.run_steps(30);
        let delays = stage.harness.output().viewport_output.values().map(|viewport| viewport.repaint_delay);
        delays.min().expect("a window")
    };
    stage.click("Connect");
    assert!(stage.sees("Connecting to sim:human"));
    let connecting = until_next_frame(&mut stage);
    assert!(connecting >= Duration::from_secs(1), "nothing moves while connecting: {connecting:?}");
    stage.tell([EngineEvent::Busy { task: "Computing weights".into(), fraction: Some(0.4) }]);
    let busy = until_next_frame(&mut stage);
    assert!(busy >= Duration::from_millis(200), "the work needs the processor: {busy:?}");
}

fn library() -> Library {
    let take = |name: &str, seconds: f64, rating, note: &str| ListedTake {
        path: format!("/home/kim/takes/{name}.take").into(),
        seconds,
        samples: (seconds * 250.0) as u64,
        rating,
        note: note.into(),
        ..ListedTake::default()
    };
    let broken = ListedTake { trouble: Some("it ends within its header".into()), ..take("human-4", 0.0, 0, "") };
    let lossy = ListedTake { lost: 31, edited: true, ..take("human-2", 12.25, 0, "") };
    let takes = vec![broken, take("walk", 2.0, 4, "good start, late end"), lossy];
    Library { folder: "/home/kim/takes".into(), takes, bin: vec![take("human", 3.1, 0, "")] }
}

/// A window with a list of takes, one of which is open.
fn with_take() -> (Stage, Arc<armature::characters::LoadedCharacter>) {
    let mut stage = connected();
    let character = stage.harness.state().state().character.clone().expect("the puppet's");
    let take = puppets::take(&character, EditList::new("walk.take"));
    stage.tell([
        EngineEvent::Takes(Arc::new(library())),
        EngineEvent::TakeOpened(take),
        EngineEvent::Playback(Playback { seconds: 0.62, ..Playback::default() }),
    ]);
    stage.commands();
    (stage, character)
}

#[test]
fn from_the_first_run_to_an_exported_take() {
    let mut stage = Stage::open(Start::default());
    let character = Arc::new(puppets::character());
    stage.tell([EngineEvent::CharacterLoaded(character.clone())]);
    stage.commands();
    stage.click("Connect");
    assert_eq!(stage.commands(), [Command::Connect("sim:human".into())], "one click to a moving character");
    stage.tell([
        EngineEvent::Connected { address: "sim:human".into(), device: "Armature simulator 1.0".into() },
        EngineEvent::Topology { tree: puppets::tree() },
        EngineEvent::Mapping { bone_of_part: puppets::mapping(), solved: Vec::new() },
        EngineEvent::Frame(puppets::frame(&character)),
    ]);
    stage.click("Record");
    stage.tell([EngineEvent::Recording { seconds: 1.9, samples: 475 }]);
    stage.click("Stop");
    assert_eq!(stage.commands(), [Command::StartRecording, Command::StopRecording]);
    let path = std::path::PathBuf::from("/home/kim/takes/walk.take");
    stage.tell([
        EngineEvent::Saved { path: path.clone(), seconds: 2.0, samples: 171, lost: 0 },
        EngineEvent::Takes(Arc::new(library())),
    ]);
    stage.click("Open the take");
    assert_eq!(stage.commands(), [Command::OpenTake(path.clone())]);
    stage.tell([
        EngineEvent::TakeOpened(puppets::take(&character, EditList::new("walk.take"))),
        EngineEvent::Playback(Playback::default()),
    ]);
    stage.press(Key::Space);
    assert_eq!(stage.commands(), [Command::Play(Play::Start)]);
    stage.tell([EngineEvent::Playback(Playback { seconds: 0.4, playing: true, ..Playback::default() })]);
    stage.press(Key::I);
    let range = Some((0.4, 2.0));
    assert_eq!(stage.commands(), [Command::Play(Play::Range(range))]);
    stage.tell([EngineEvent::Playback(Playback { seconds: 0.4, range, ..Playback::default() })]);
    stage.press_with(Modifiers::COMMAND, Key::T);
    let mut list = EditList::new("walk.take");
    list.add([Edit::Trim { from: 0.4, to: 2.0 }]);
    assert_eq!(stage.commands(), [Command::EditTake(list.clone())]);
    stage.tell([
        EngineEvent::TakeOpened(puppets::take(&character, list)),
        EngineEvent::Playback(Playback { seconds: 0.3, ..Playback::default() }),
    ]);
    assert!(stage.sees("walk, 1 edit"));
    stage.snapshot("14-trimmed");
    stage.press_with(Modifiers::COMMAND, Key::E);
    stage.snapshot("15-export");
    stage.click("Export");
    let asked = stage.commands();
    let [Command::Export(order)] = &asked[..] else { panic!("{asked:?}") };
    assert_eq!((order.to.display().to_string(), &order.take), ("/home/kim/takes/Exports/walk.glb".into(), &path));
    stage.tell([EngineEvent::Exported(ExportReceipt {
        path: order.to.clone(),
        contents: "39 frames at 24 a second, 15 bones, 412 408 bytes".into(),
        measured: "85.5 samples a second, 30 lost, a gap of 0.310 s".into(),
        notes: vec!["no samples between 0.590 s and 0.900 s: the pose before is held there".into()],
    })]);
    assert!(stage.sees("Exported: walk.glb") && stage.sees("No samples between"));
    stage.snapshot("16-exported");
}

#[test]
fn takes_are_opened_rated_and_thrown_away_with_a_way_back() {
    let (mut stage, _) = with_take();
    stage.click("Open human-2");
    assert_eq!(stage.commands(), [Command::OpenTake("/home/kim/takes/human-2.take".into())]);
    stage.click("Open human-4");
    assert_eq!(stage.commands(), [], "what cannot be read is not opened");
    stage.click("5 of 5 for human-2");
    let (take, note) = ("/home/kim/takes/human-2.take".into(), String::new());
    assert_eq!(stage.commands(), [Command::Annotate { take, note, rating: 5 }]);
    stage.press(Key::Delete);
    assert_eq!(stage.commands(), [Command::Discard("/home/kim/takes/walk.take".into())]);
    let binned = std::path::PathBuf::from("/home/kim/takes/Bin/walk.take");
    stage.tell([EngineEvent::TakeClosed, EngineEvent::Discarded { path: binned.clone() }]);
    stage.snapshot("17-bin");
    stage.click("Bring it back");
    assert_eq!(stage.commands(), [Command::Restore(binned)]);
    stage.click("Bin (1)");
    stage.click("Restore");
    assert_eq!(stage.commands(), [Command::Restore("/home/kim/takes/human.take".into())]);
}

#[test]
fn the_timeline_is_scrubbed_marked_and_armed() {
    let (mut stage, character) = with_take();
    stage.snapshot("18-timeline");
    let ruler = stage.harness.get_by_label("Time").rect();
    stage.click_at(pos2(ruler.right() - 10.0, ruler.center().y));
    let asked = stage.commands();
    let Some(Command::Play(Play::Seek(end))) = asked.first() else { panic!("{asked:?}") };
    assert!((end - 2.0).abs() < 0.02, "the end of the take: {end}");
    stage.press(Key::M);
    let mut marked = EditList::new("walk.take");
    marked.add([Edit::Marker { at: 0.62, text: "Marker 1".into() }]);
    assert_eq!(stage.commands(), [Command::EditTake(marked.clone())]);
    stage.tell([EngineEvent::TakeOpened(puppets::take(&character, marked.clone()))]);
    stage.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(stage.commands(), [Command::EditTake(EditList::new("walk.take"))], "it is taken back");
    stage.tell([EngineEvent::TakeOpened(puppets::take(&character, EditList::new("walk.take")))]);
    stage.press_with(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
    assert_eq!(stage.commands(), [Command::EditTake(marked)], "and brought back");
    stage.harness.get_all_by_label("Arm spine").next().expect("a limb").click();
    stage.harness.run_steps(2);
    stage.press(Key::R);
    assert_eq!(stage.commands(), [Command::Overdub { bones: vec!["spine".into()] }]);
    for (key, play) in [(Key::ArrowLeft, Play::Step { forward: false }), (Key::L, Play::Loop(false))] {
        stage.press(key);
        assert_eq!(stage.commands(), [Command::Play(play)]);
    }
    stage.click("Close the take");
    assert_eq!(stage.commands(), [Command::CloseTake]);
}

#[test]
fn panels_fit_small_and_large_windows() {
    for (width, height) in [(1000.0, 650.0), (1600.0, 1000.0)] {
        let (mut stage, _) = with_take();
        stage.harness.set_size(Vec2::new(width, height));
        stage.harness.run_steps(6);
        for label in ["Play", "Trim", "Export…", "Record", "Open walk", "Close the take"] {
            let rect = stage.harness.get_by_label(label).rect();
            assert!(rect.right() <= width + 1.0 && rect.bottom() <= height + 1.0, "{label} at {width}: {rect}");
        }
        stage.snapshot(&format!("19-take-{width}"));
    }
}
