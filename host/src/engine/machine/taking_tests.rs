//! Takes in the engine: played, edited, recorded over, thrown away.

use std::ops::ControlFlow;
use std::path::Path;

use armature_take::{Edit, EditList};

use super::script::{Session, arm};
use super::*;
use crate::engine::input::{WorkId, WorkNews};
use crate::engine::playback::{Play, Playback};
use crate::takes::opened::{self, OpenedTake};
use crate::takes::orders::{TakeOrder, TakeResult};

/// A session that has recorded a take of a second, the joint turning by a count each sample.
fn recorded() -> Session {
    let mut session = Session::ready();
    session.ask(0.2, Command::StartRecording);
    for index in 0..=100 {
        session.sample(1.0 + 0.01 * f64::from(index), 1000 + index as u16);
    }
    session.ask(2.1, Command::StopRecording);
    session.asked();
    session
}

fn opened(session: &Session, list: EditList) -> Arc<OpenedTake> {
    let take = session.take(0);
    let never = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
    Arc::new(opened::prepare(Path::new("arm-0.take"), &take, list, arm(), never).unwrap())
}

/// The same with its take on show.
fn shown() -> Session {
    let mut session = recorded();
    session.ask(2.2, Command::OpenTake("arm-0.take".into()));
    let [Request::Work { work, order: TakeOrder::Open(_) }] = &session.asked()[..] else { panic!("it is opened") };
    let take = opened(&session, EditList::new("arm-0.take"));
    let told = session.at(2.3, over(*work, TakeResult::Opened(take)));
    assert!(told.iter().any(|event| matches!(event, EngineEvent::TakeOpened(_))), "{told:?}");
    assert!(told.iter().any(|event| matches!(event, EngineEvent::Frame(_))), "its first pose is shown");
    assert!(!told.iter().any(|event| matches!(event, EngineEvent::CharacterLoaded(_))), "it is the same character");
    session
}

fn over(work: WorkId, result: TakeResult) -> Input {
    Input::Worked { work, news: WorkNews::Over(Ok(result)) }
}

fn playback(told: &[EngineEvent]) -> Playback {
    let last = told.iter().rev().find_map(|event| match event {
        EngineEvent::Playback(playback) => Some(*playback),
        _ => None,
    });
    last.unwrap_or_else(|| panic!("{told:?}"))
}

#[test]
fn a_take_plays_loops_and_stands_still_where_it_is_told() {
    let mut session = shown();
    assert!(playback(session.ask(3.0, Command::Play(Play::Start))).playing);
    assert!(session.engine.wakes_at().is_some(), "it plays by itself");
    assert!((playback(session.tick(3.4)).seconds - 0.4).abs() < 1e-9);
    assert!((playback(session.tick(4.25)).seconds - 0.25).abs() < 1e-9, "it begins again");
    let still = playback(session.ask(4.35, Command::Play(Play::Pause)));
    assert!(!still.playing && (still.seconds - 0.35).abs() < 1e-9);
    assert_eq!(session.engine.wakes_at(), None, "a still take costs nothing");
    let step = playback(session.ask(5.0, Command::Play(Play::Step { forward: true })));
    assert!((step.seconds - 0.36).abs() < 1e-5, "{step:?}");
    let step = playback(session.ask(5.0, Command::Play(Play::Step { forward: false })));
    assert!((step.seconds - 0.35).abs() < 1e-5, "{step:?}");
    session.ask(5.0, Command::Play(Play::Range(Some((0.5, 0.7)))));
    session.ask(5.0, Command::Play(Play::Loop(false)));
    session.ask(5.0, Command::Play(Play::Speed(0.5)));
    session.ask(6.0, Command::Play(Play::Start));
    assert!((playback(session.tick(6.2)).seconds - 0.6).abs() < 1e-9, "half as fast, from the in point");
    let end = playback(session.tick(9.0));
    assert!(!end.playing && (end.seconds - 0.7).abs() < 1e-9);
    for seconds in [f64::NAN, f64::INFINITY, -7.0] {
        let first = playback(session.ask(9.1, Command::Play(Play::Seek(seconds))));
        assert!((first.seconds).abs() < 1e-9, "{first:?}");
    }
}

#[test]
fn the_puppet_is_not_drawn_over_a_take_until_that_is_closed() {
    let mut session = shown();
    let told = session.sample(3.0, 2000);
    assert!(told.is_empty(), "{told:?}");
    let told = session.ask(3.1, Command::CloseTake);
    assert!(matches!(told[0], EngineEvent::TakeClosed), "{told:?}");
    assert!(session.sample(3.2, 2000).iter().any(|event| matches!(event, EngineEvent::Frame(_))));
}

#[test]
fn the_take_that_was_asked_for_last_is_shown() {
    let mut session = recorded();
    session.ask(2.2, Command::OpenTake("old.take".into()));
    session.ask(2.2, Command::OpenTake("arm-0.take".into()));
    let take = opened(&session, EditList::new("arm-0.take"));
    assert!(session.at(2.3, over(WorkId(1), TakeResult::Opened(take.clone()))).len() == 1, "only that it is idle");
    let told = session.at(2.4, over(WorkId(2), TakeResult::Opened(take)));
    assert!(told.iter().any(|event| matches!(event, EngineEvent::TakeOpened(_))));
    let failure = Failure::input("gone", "look for it");
    let told = session.at(2.5, Input::Worked { work: WorkId(2), news: WorkNews::Over(Err(failure)) });
    assert!(told.is_empty(), "that work was over");
}

#[test]
fn a_trim_is_kept_beside_the_take_and_shown() {
    let mut session = shown();
    session.ask(3.0, Command::Play(Play::Seek(0.5)));
    let mut list = EditList::new("arm-0.take");
    list.add([Edit::Trim { from: 0.2, to: 0.6 }]);
    session.ask(3.1, Command::EditTake(list.clone()));
    let asked = session.asked();
    let [Request::Work { work, order: TakeOrder::Edit { list: kept, .. } }] = &asked[..] else { panic!("{asked:?}") };
    assert_eq!(*kept, list);
    let trimmed = opened(&session, list);
    assert!((trimmed.span().1 - 0.4).abs() < 1e-9 && trimmed.span().0 == 0.0 && trimmed.begins == Some(0.2));
    let at = playback(session.at(3.2, over(*work, TakeResult::Opened(trimmed))));
    assert!((at.seconds - 0.4).abs() < 1e-9, "the playhead stays in the take");
}

#[test]
fn a_countdown_counts_and_can_be_given_up() {
    let mut session = Session::ready();
    let left = |told: &[EngineEvent]| match told {
        [EngineEvent::Countdown { seconds_left }] => *seconds_left,
        _ => u32::MAX,
    };
    assert_eq!(left(session.ask(1.0, Command::RecordAfter(3.0))), 3);
    assert_eq!(session.engine.wakes_at(), Some(2.0));
    assert_eq!(left(session.tick(2.0)), 2);
    assert_eq!(left(session.ask(2.5, Command::Cancel)), 0);
    assert_eq!(session.engine.wakes_at(), None);
    session.ask(3.0, Command::RecordAfter(1.0));
    let told = session.tick(4.0);
    assert!(told.iter().any(|event| matches!(event, EngineEvent::Recording { .. })), "{told:?}");
}

#[test]
fn the_last_attempt_goes_into_the_bin_and_another_begins() {
    let mut session = recorded();
    session.ask(3.0, Command::RecordAgain);
    let discards = |asked: &[Request], path: &str| {
        asked.iter().any(|request| {
            matches!(request, Request::Work { order: TakeOrder::Discard(lies), .. } if lies == Path::new(path))
        })
    };
    assert!(discards(&session.asked(), "arm-0.take"));
    session.sample(3.1, 1000);
    let told = session.ask(3.2, Command::RecordAgain).to_vec();
    assert!(told.iter().any(|event| matches!(event, EngineEvent::Saved { .. })), "{told:?}");
    assert!(discards(&session.asked(), "arm-1.take"), "in the middle of a take too");
    session.sample(3.3, 1000);
    let told = session.ask(3.4, Command::StopRecording);
    assert!(
        matches!(told, [EngineEvent::Saved { path, samples: 1, .. }] if path == Path::new("arm-2.take")),
        "{told:?}"
    );
}

#[test]
fn limbs_are_recorded_over_a_take_while_it_plays() {
    let mut session = shown();
    let told = session.ask(3.0, Command::Overdub { bones: vec!["leg".into()] });
    assert!(matches!(told, [EngineEvent::Problem(problem)] if problem.what.contains("armed")), "{told:?}");
    session.ask(3.0, Command::Play(Play::Seek(0.4)));
    session.asked();
    let told = session.ask(3.0, Command::Overdub { bones: vec!["arm".into()] });
    assert!(told.iter().any(|event| matches!(event, EngineEvent::Recording { .. })), "{told:?}");
    for index in 1..50 {
        let told = session.sample(3.0 + 0.01 * f64::from(index), 2000);
        assert!(!told.iter().any(|event| matches!(event, EngineEvent::Problem(_))), "{told:?}");
    }
    let told = session.tick(3.7).to_vec();
    assert!(told.iter().any(|event| matches!(event, EngineEvent::Saved { .. })), "it ends with the take: {told:?}");
    let asked = session.asked();
    let [Request::Work { order: TakeOrder::Edit { take, list }, .. }] = &asked[..] else { panic!("{asked:?}") };
    let [Edit::Overdub { take: over, bones, at, .. }] = &list.edits[..] else { panic!("{list:?}") };
    assert_eq!(
        (take.as_path(), over.as_str(), bones.as_slice()),
        (Path::new("arm-0.take"), "over-1.take", &["arm".to_owned()][..])
    );
    assert!((at - 0.4).abs() < 1e-9);
}

#[test]
fn the_same_inputs_give_the_same_session() {
    let mut session = shown();
    session.ask(3.0, Command::Play(Play::Start));
    session.tick(3.4);
    session.ask(3.5, Command::Overdub { bones: vec!["arm".into()] });
    session.sample(3.6, 2000);
    session.ask(3.7, Command::StopRecording);
    let mut again = Session::new(EngineSettings::default());
    for (now, input) in session.happened.clone() {
        again.at(now, input);
    }
    assert_eq!(format!("{:?}", again.script.told), format!("{:?}", session.script.told));
    assert!(again.script.asked.ends_with(&session.script.asked), "{:?}", again.script.asked);
}
