use std::sync::Arc;

use armature_rig::{Bone, JointTree, Part, PartKind, Progress, SensorState, Skeleton, Transform};

use super::*;
use crate::app::state::Zeroed;
use crate::characters::LoadedCharacter;
use crate::engine::event::{EngineEvent, Frame, Stats};

fn part(number: u8, kind: PartKind, parent: Option<usize>, outlet: u8) -> Part {
    Part { uid: PartUid([number; 12]), kind, parent, outlet, counts_per_turn: 4096 }
}

/// A splitter with two limbs, of two joints and of one.
fn puppet() -> Arc<JointTree> {
    let parts = vec![
        part(1, PartKind::Splitter { outlets: 2 }, None, 0),
        part(2, PartKind::Bend, Some(0), 0),
        part(3, PartKind::Twist, Some(0), 1),
        part(4, PartKind::TwistBendTwist, Some(1), 0),
    ];
    Arc::new(JointTree::new(parts).expect("a tree"))
}

fn problem(what: &str) -> Problem {
    Problem { what: what.into(), remedy: "Try again.".into() }
}

fn connected() -> State {
    let mut state = State::default();
    state.update_state(EngineEvent::Connected { address: "sim:human".into(), device: "Simulator".into() });
    state.update_state(EngineEvent::Topology { tree: puppet() });
    state.update_state(EngineEvent::Frame(Box::new(Frame {
        angles: vec![0.5, 1.0, f32::NAN, -0.25, 0.0],
        states: vec![SensorState::Ok, SensorState::NoData, SensorState::Ok, SensorState::MagnetWeak, SensorState::Ok],
        ..Frame::default()
    })));
    state
}

#[test]
fn limbs_are_listed_one_after_the_other() {
    let rows: Vec<_> = connected().rows.iter().map(|row| (row.part, row.depth)).collect();
    assert_eq!(rows, [(0, 0), (1, 1), (3, 1), (2, 1)]);
}

#[test]
fn readings_are_never_an_angle_without_data() {
    let state = connected();
    assert_eq!(state.reading(0), (SensorState::Ok, Some(0.5)));
    assert_eq!(state.reading(1), (SensorState::NoData, None));
    assert_eq!(state.reading(2), (SensorState::Ok, None));
    assert_eq!(state.reading(99), (SensorState::NoData, None));
    assert_eq!(state.worst_state(3), SensorState::MagnetWeak);
    assert_eq!(state.worst_state(2), SensorState::NoData);
    assert_eq!(state.worst_state(0), SensorState::Ok);
}

#[test]
fn zero_and_record_need_a_live_puppet() {
    let mut state = State::default();
    assert_eq!(state.act(Action::Zero), None);
    assert_eq!(state.act(Action::Record), None);
    let mut state = connected();
    assert_eq!(state.act(Action::Zero), Some(Command::Zero));
    assert_eq!(state.act(Action::Record), Some(Command::StartRecording));
    state.update_state(EngineEvent::Recording { seconds: 0.0, samples: 0 });
    assert_eq!(state.act(Action::Disconnect), None, "a take is being recorded");
    assert_eq!(state.act(Action::StopRecording), Some(Command::StopRecording));
    state.update_state(EngineEvent::Saved { path: "a.take".into(), seconds: 2.0, samples: 800, lost: 0 });
    assert_eq!((state.recording, state.saved.as_ref().map(|s| s.samples)), (None, Some(800)));
}

#[test]
fn a_calibration_step_is_told_and_can_be_given_up() {
    let mut state = connected();
    let step = CalibrationStep::Sweep;
    assert_eq!(state.act(Action::Calibrate(step)), Some(Command::Calibrate(step)));
    assert_eq!(state.act(Action::Cancel), None, "nothing is under way yet");
    let countdown = Progress::Countdown { seconds_left: 2.4, instruction: "sweep every joint" };
    state.update_state(EngineEvent::Calibrating { step, progress: countdown });
    assert_eq!(state.busy, Some(("Get ready, 3 s: sweep every joint".into(), None)));
    let measuring = Progress::Measuring { seconds_left: 19.5, instruction: "sweep every joint" };
    state.update_state(EngineEvent::Calibrating { step, progress: measuring });
    assert_eq!(state.busy, Some(("Measuring, 20 s: sweep every joint".into(), None)));
    assert_eq!(state.act(Action::Cancel), Some(Command::Cancel));
    state.update_state(EngineEvent::Idle);
    state.update_state(EngineEvent::Calibrated { step, measured: 40, failed: 5 });
    assert!(matches!(state.zeroed, Some(Zeroed { step: CalibrationStep::Sweep, sensors: 40, unreadable: 5, .. })));
    assert_eq!(State::default().act(Action::Calibrate(step)), None, "there is no puppet");
}

#[test]
fn connecting_by_key_never_disconnects() {
    let mut state = State::default();
    state.address = "  sim:spider ".into();
    assert_eq!(state.act(Action::ConnectToField), Some(Command::Connect("sim:spider".into())));
    assert_eq!(state.connection, Connection::Connecting { address: "sim:spider".into() });
    assert_eq!(state.act(Action::ConnectToField), None);
    assert_eq!(connected().act(Action::ConnectToField), None);
    assert_eq!(state.act(Action::Disconnect), Some(Command::Disconnect));
    state.update_state(EngineEvent::Disconnected { problem: None });
    state.address = " ".into();
    assert_eq!(state.act(Action::ConnectToField), None);
}

#[test]
fn nothing_is_live_while_the_line_is_broken() {
    let mut state = connected();
    assert!(state.is_live() && state.can_calibrate().is_ok());
    state.update_state(EngineEvent::LineBroken);
    assert!(state.is_line_broken() && !state.is_live() && state.can_calibrate().is_err());
    assert_eq!(state.act(Action::Record), None);
    state.update_state(EngineEvent::LineRestored);
    assert!(state.is_live() && !state.is_line_broken());
    state.update_state(EngineEvent::LineBroken);
    state.update_state(EngineEvent::Disconnected { problem: None });
    assert!(!state.is_line_broken());
}

#[test]
fn the_choice_is_what_was_loaded_not_what_was_asked_for() {
    let mut state = State::default();
    let hand = CharacterChoice::BuiltIn("hand");
    assert_eq!(state.act(Action::Load(hand.clone())), Some(Command::LoadCharacter(hand.clone())));
    assert!(!state.shows(&hand) && !state.shows(&CharacterChoice::default()));
    let loaded = |source: &str| LoadedCharacter { source: source.into(), ..LoadedCharacter::default() };
    state.update_state(EngineEvent::CharacterLoaded(Arc::new(loaded("hand"))));
    assert!(state.shows(&hand));
    state.update_state(EngineEvent::CharacterLoaded(Arc::new(loaded("fox.glb"))));
    assert!(state.shows(&CharacterChoice::File("fox.glb".into())));
}

#[test]
fn a_lost_puppet_leaves_the_character_and_a_remedy() {
    let mut state = connected();
    state.update_state(EngineEvent::CharacterLoaded(Arc::new(LoadedCharacter::default())));
    state.update_state(EngineEvent::Recording { seconds: 1.0, samples: 3 });
    state.update_state(EngineEvent::Disconnected { problem: Some(problem("The cable was pulled.")) });
    assert!(state.character.is_some() && state.tree.is_none() && state.recording.is_none());
    assert_eq!(state.notices.len(), 1);
    assert_eq!(state.reading(0), (SensorState::NoData, None));
    state.update_state(EngineEvent::Connected { address: "x".into(), device: "y".into() });
    assert!(state.notices.is_empty(), "a new connection answers the old problem");
    state.update_state(EngineEvent::Problem(problem("The calibration cannot be read.")));
    state.update_state(EngineEvent::Waiting(problem("Its boot loader has the line.")));
    assert_eq!(state.notices.len(), 2);
    state.update_state(EngineEvent::Connected { address: "x".into(), device: "y".into() });
    assert_eq!(state.notices.len(), 1, "it has answered");
    assert!(!state.is_live(), "the last pose belongs to another puppet");
}

#[test]
fn problems_are_counted_and_the_newest_stay() {
    let mut state = State::default();
    for what in ["a", "b", "a", "c", "d"] {
        state.update_state(EngineEvent::Problem(problem(what)));
    }
    let shown: Vec<_> = state.notices.iter().map(|n| (n.problem.what.as_str(), n.count)).collect();
    assert_eq!(shown, [("a", 2), ("c", 1), ("d", 1)]);
    state.act(Action::DismissNotice(1));
    state.act(Action::DismissNotice(17));
    assert_eq!(state.notices.len(), 2);
}

#[test]
fn the_selection_follows_the_part_through_replugging() {
    let mut state = connected();
    state.act(Action::Select(Some(3)));
    let replugged = vec![part(4, PartKind::TwistBendTwist, None, 0), part(2, PartKind::Bend, Some(0), 0)];
    state.update_state(EngineEvent::Topology { tree: Arc::new(JointTree::new(replugged).unwrap()) });
    assert_eq!(state.selected, Some(0));
    let gone = vec![part(2, PartKind::Bend, None, 0)];
    state.update_state(EngineEvent::Topology { tree: Arc::new(JointTree::new(gone).unwrap()) });
    assert_eq!(state.selected, None);
}

#[test]
fn names_come_from_bones_where_there_are_any() {
    let mut state = connected();
    assert_eq!(state.part_label(1), "Bend joint");
    let bone = Bone { name: "elbow".into(), parent: None, rest: Transform::IDENTITY, tail: glam::Vec3::Y };
    let character = LoadedCharacter::bare("arm", "arm", Skeleton::new(vec![bone]).unwrap());
    state.update_state(EngineEvent::CharacterLoaded(Arc::new(character)));
    state.update_state(EngineEvent::Mapping { bone_of_part: vec![None, Some(0), Some(9)], solved: Vec::new() });
    assert_eq!((state.part_label(1).as_str(), state.parts_of_bone(0).collect::<Vec<_>>()), ("elbow", vec![1]));
    assert_eq!(state.bone_state(0), Some(SensorState::Ok));
    state.update_state(EngineEvent::Mapping {
        bone_of_part: vec![None, Some(0), Some(0), Some(9)],
        solved: vec![false],
    });
    assert_eq!((state.part_label(1).as_str(), state.part_label(2).as_str()), ("elbow bend", "elbow twist"));
    assert_eq!(state.bone_state(0), Some(SensorState::NoData), "the worse of both");
    assert_eq!(state.part_label(3), "Three-axis joint", "a bone that is not there names nothing");
}

#[test]
fn frames_are_handed_back_for_reuse() {
    let mut state = connected();
    let next = Frame { stats: Stats { samples: 7, ..Stats::default() }, ..Frame::default() };
    let old = state.update_state(EngineEvent::Frame(Box::new(next))).unwrap();
    assert_eq!(old.angles.len(), 5);
    assert!(state.update_state(EngineEvent::CharacterLoaded(Arc::default())).is_none());
}
