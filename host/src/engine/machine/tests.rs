//! The engine driven by lists of inputs, without threads, lines, files and clocks.

use armature_device::{DeviceNotice, DeviceProblem, Event, RefusalReason, RequestKind, Topology};
use armature_rig::{CalibrationStep, JointTree, Mapping, MappingEntry, Part, PartKind, PartUid, Progress};
use armature_take::{Take, summarize, verify};

use super::script::{ADDRESS, Session, arm, info, rope, topology};
use super::*;
use crate::engine::command::{CharacterChoice, RunPlan};
use crate::engine::input::{LineId, LineNews, OpenLine};
use crate::failure::FailureKind;

fn problems(told: &[EngineEvent]) -> Vec<&str> {
    let problems = told.iter().filter_map(|event| match event {
        EngineEvent::Problem(problem) => Some(problem.what.as_str()),
        _ => None,
    });
    problems.collect()
}

fn has(told: &[EngineEvent], is: impl Fn(&EngineEvent) -> bool) -> bool {
    told.iter().any(is)
}

fn is_frame(event: &EngineEvent) -> bool {
    matches!(event, EngineEvent::Frame(_))
}

fn run_over(told: &[EngineEvent]) -> Option<&Result<RunSummary, Failure>> {
    told.iter().find_map(|event| if let EngineEvent::RunOver(outcome) = event { Some(&**outcome) } else { None })
}

#[test]
fn a_puppet_connects_is_zeroed_and_moves_the_character() {
    let mut session = Session::new(EngineSettings::default());
    assert!(has(session.load(0.0), |e| matches!(e, EngineEvent::CharacterLoaded(c) if c.name == "arm")));
    let told = session.ask(1.0, Command::Connect(ADDRESS.into()));
    assert!(matches!(told, [EngineEvent::Connecting { address }] if address == ADDRESS));
    assert_eq!(session.asked(), [Request::Connect { line: LineId(1), address: ADDRESS.into() }]);
    assert_eq!(session.engine.wakes_at(), None, "connecting costs no time at all");
    let opened = OpenLine { address: ADDRESS.into(), began: 1.0, ..OpenLine::default() };
    let told = session.at(2.0, Input::Connected { line: LineId(1), outcome: Ok(opened) });
    assert!(matches!(told, [EngineEvent::LineOpened { .. }]));
    let told = session.event(2.1, Event::Connected(info()));
    assert!(matches!(told, [EngineEvent::Connected { device, .. }] if device.starts_with("Arm")));
    let told = session.event(2.2, Event::Topology(topology()));
    assert!(
        matches!(told, [EngineEvent::Topology { .. }, EngineEvent::Mapping { bone_of_part, .. }, EngineEvent::RestPoseAwaited]
        if *bone_of_part == [Some(0)])
    );
    assert_eq!(session.asked(), [Request::Stream { line: LineId(1), samples_per_second: 250.0 }]);
    let told = session.sample(2.3, 1000);
    assert!(matches!(told, [EngineEvent::Zeroed { sensors: 1, unreadable: 0 }, EngineEvent::Frame(_)]), "{told:?}");
    assert_eq!(session.script.kept.len(), 1, "a zero is kept");
    let told = session.sample(2.4, 1000 + 1024);
    let [EngineEvent::Frame(frame)] = told else { panic!("{told:?}") };
    assert!((frame.angles[0] - std::f32::consts::FRAC_PI_2).abs() < 1e-5);
    assert_eq!((frame.stats.samples, frame.stats.latency_p99_micros), (2, 150.0));
}

#[test]
fn samples_are_asked_for_when_the_character_is_prepared_for_the_puppet() {
    let mut session = Session::new(EngineSettings::default());
    session.connect(0.0);
    assert!(!session.asked().iter().any(|request| matches!(request, Request::Stream { .. })));
    let told = session.load(5.0);
    assert!(has(told, |e| matches!(e, EngineEvent::Topology { .. })), "{told:?}");
    assert_eq!(session.asked(), [Request::Stream { line: LineId(1), samples_per_second: 250.0 }]);
    assert!(has(session.sample(5.1, 10), is_frame));
}

#[test]
fn frames_are_thinned_and_the_last_one_is_not_forgotten() {
    let mut session = Session::ready();
    assert!(has(session.sample(0.2, 1000), is_frame));
    assert!(!has(session.sample(0.201, 1100), is_frame) && !has(session.sample(0.202, 1200), is_frame));
    let wakes_at = session.engine.wakes_at().unwrap();
    assert!((wakes_at - 0.203).abs() < 1e-9, "{wakes_at}");
    let told = session.tick(wakes_at + 1e-9);
    assert!(matches!(told, [EngineEvent::Frame(frame)] if frame.angles[0] > 0.3), "{told:?}");
    assert_eq!(session.engine.wakes_at(), None);
}

#[test]
fn a_recording_begins_after_zero_and_ends_whole() {
    let mut session = Session::new(EngineSettings::default());
    session.load(0.0);
    assert_eq!(problems(session.ask(0.0, Command::StartRecording)), ["there is no puppet to record"]);
    session.connect(0.0);
    assert_eq!(problems(session.ask(0.1, Command::StartRecording)), ["the rest pose is not known yet"]);
    session.sample(0.2, 1000);
    let told = session.ask(0.3, Command::StartRecording);
    assert!(matches!(told, [EngineEvent::Recording { samples: 0, .. }]));
    for index in 0..5 {
        session.sample(0.4 + 0.1 * f64::from(index), 1000 + index as u16);
    }
    let load = Command::LoadCharacter(CharacterChoice::BuiltIn("hand"));
    for refused in [load, Command::Zero, Command::Calibrate(CalibrationStep::Sweep)] {
        assert_eq!(problems(session.ask(0.9, refused)), ["a take is being recorded"]);
    }
    let told = session.ask(1.0, Command::StopRecording);
    assert!(matches!(told, [EngineEvent::Saved { samples: 5, lost: 0, .. }]), "{told:?}");
    let take = session.take(0);
    assert_eq!((take.samples().count(), take.header().unix_micros), (5, Some(7)));
    assert!(verify(&take, &mut |_, _| std::ops::ControlFlow::Continue(())).unwrap().is_exact());
    assert!(session.ask(1.1, Command::StopRecording).is_empty());
}

#[test]
fn a_disk_that_is_full_ends_the_take_once_and_the_session_goes_on() {
    let mut session = Session::ready();
    session.script.room = Some(2_000);
    session.ask(0.2, Command::StartRecording);
    let failed = |event: &EngineEvent| matches!(event, EngineEvent::RecordingFailed(_));
    let mut told = Vec::new();
    for index in 0..200 {
        told.extend(session.sample(0.3 + 0.01 * f64::from(index), 1000).iter().filter(|e| failed(e)).cloned());
    }
    let [EngineEvent::RecordingFailed(problem)] = &told[..] else { panic!("{told:?}") };
    assert!(problem.remedy.contains("inspect"), "{problem:?}");
    let (written, _) = Take::read(&session.script.takes[0].0.lock().unwrap().0).unwrap();
    assert!(written.samples().count() > 5, "what was written until then can be read");
    assert!(session.ask(3.0, Command::StopRecording).is_empty());
    session.script.room = None;
    let told = session.ask(3.1, Command::StartRecording);
    assert!(matches!(told, [EngineEvent::Recording { samples: 0, .. }]), "{told:?}");

    // In a run it is what the run failed of.
    let mut session = run_session(RunPlan { record: Some("run.take".into()), ..RunPlan::default() });
    session.script.room = Some(2_000);
    session.connect(0.0);
    measured(&mut session, 0.1, 9.0);
    let told = session.news(9.1, LineNews::Closed);
    assert!(matches!(run_over(told), Some(Err(failure)) if failure.what.starts_with("run.take")), "{told:?}");
}

#[test]
fn inverse_kinematics_of_many_bones_shows_how_far_it_is() {
    for (bones, slow) in [(20, false), (160, true)] {
        let entry = MappingEntry::new(armature_rig::PartUid([3; 12]), format!("bone {}", bones - 1));
        let mapping = Some(Mapping { entries: vec![entry], ..Mapping::default() });
        let mut session = Session::new(EngineSettings { mapping, ..EngineSettings::default() });
        let news = LoadNews::Over(Ok((rope(bones), Vec::new())));
        session.at(0.0, Input::Loaded { load: LoadId::BROUGHT_ALONG, news });
        let told = session.connect(0.0).to_vec();
        assert!(problems(&told).is_empty(), "{told:?}");
        let busy = |event: &EngineEvent| matches!(event, EngineEvent::Busy { fraction: Some(_), .. });
        assert_eq!(
            (has(&told, busy), has(&told, |event| matches!(event, EngineEvent::Idle))),
            (slow, slow),
            "{told:?}"
        );
    }
}

#[test]
fn preparing_inverse_kinematics_can_be_cancelled() {
    let entry = MappingEntry::new(armature_rig::PartUid([3; 12]), "bone 19");
    let mapping = Some(Mapping { entries: vec![entry], ..Mapping::default() });
    let mut session = Session::new(EngineSettings { mapping, ..EngineSettings::default() });
    let loaded = || Input::Loaded { load: LoadId::BROUGHT_ALONG, news: LoadNews::Over(Ok((rope(20), Vec::new()))) };
    session.at(0.0, loaded());
    session.script.stops = true;
    let told = session.connect(0.0).to_vec();
    assert!(problems(&told).iter().any(|what| what.contains("was cancelled")), "{told:?}");
    session.script.stops = false;
    session.sample(0.1, 1000);
    assert!(has(session.sample(0.2, 1010), is_frame), "the joints are followed all the same");
    let told = session.at(0.3, loaded()).to_vec();
    assert!(problems(&told).is_empty(), "{told:?}");
    assert!(session.engine.puppeteer().unwrap().ik_problem().is_none());
}

#[test]
fn a_run_that_fails_says_where_its_take_is_if_the_old_one_is_kept() {
    let mut session = run_session(RunPlan { record: Some("run.take".into()), ..RunPlan::default() });
    session.connect(0.0);
    measured(&mut session, 0.1, 0.35);
    let mut impossible = topology();
    impossible.parts[0].counts_per_turn = 1;
    let told = session.event(0.5, Event::Topology(impossible));
    assert!(problems(told).iter().any(|what| what.contains("run.take.part")), "{told:?}");
}

#[test]
fn a_line_that_breaks_and_comes_back_is_in_the_take() {
    let mut session = Session::ready();
    session.ask(0.2, Command::StartRecording);
    session.sample(0.3, 1000);
    let lost = Event::Notice(DeviceNotice::LineLost { reason: "unplugged".into() });
    let told = session.event(0.4, lost);
    assert!(matches!(told, [EngineEvent::Problem(_), EngineEvent::LineBroken]), "{told:?}");
    let told = session.event(1.0, Event::Notice(DeviceNotice::WaitsForStart));
    assert!(matches!(told, [EngineEvent::Waiting(why)] if why.what.contains("boot loader")), "{told:?}");
    let back = Event::Notice(DeviceNotice::LineBack { seconds: 40.0, at: None });
    assert_eq!(problems(session.event(40.4, back)).len(), 1, "a window waits as long as it takes");
    session.event(40.4, Event::Restarted);
    session.event(40.5, Event::Topology(topology()));
    assert!(has(session.sample(40.6, 1000), is_frame));
    session.ask(41.0, Command::StopRecording);
    let summary = summarize(&session.take(0));
    assert_eq!((summary.samples, summary.restarts, summary.reconnects), (2, 1, 1));
}

#[test]
fn a_line_that_ends_saves_the_take_and_can_be_opened_again_once_it_is_closed() {
    let mut session = Session::ready();
    session.ask(0.2, Command::StartRecording);
    session.sample(0.3, 1000);
    session.asked();
    let told = session.news(0.4, LineNews::Over);
    assert!(matches!(told, [EngineEvent::Saved { samples: 1, .. }, EngineEvent::Disconnected { problem: Some(_) }]));
    assert_eq!(session.asked(), [Request::Close(LineId(1))]);
    assert!(session.sample(0.5, 1000).is_empty(), "what comes late is not heard");
    session.ask(0.6, Command::Connect(ADDRESS.into()));
    assert_eq!(session.asked(), [], "the port is still in use");
    session.news(0.7, LineNews::Closed);
    assert_eq!(session.asked(), [Request::Connect { line: LineId(2), address: ADDRESS.into() }]);
    // The user changes their mind before it is open.
    let told = session.ask(0.8, Command::Disconnect);
    assert!(matches!(told, [EngineEvent::Disconnected { problem: None }]));
    let late = Input::Connected { line: LineId(2), outcome: Ok(OpenLine::default()) };
    assert!(session.at(0.9, late).is_empty());
    assert_eq!(session.asked(), [Request::Close(LineId(2))]);
}

#[test]
fn a_line_that_does_not_open_is_reported() {
    let mut session = Session::new(EngineSettings::default());
    session.ask(0.0, Command::Connect("tcp:nowhere:1".into()));
    let refused = Input::Connected { line: LineId(1), outcome: Err(Failure::device("nobody answers", "")) };
    let told = session.at(0.1, refused);
    assert!(matches!(told, [EngineEvent::Disconnected { problem: Some(p) }] if p.what == "nobody answers"));
}

#[test]
fn another_kind_of_part_and_a_calibration_that_cannot_be_saved_stop_nothing() {
    let part =
        Part { uid: PartUid([3; 12]), kind: PartKind::TwistBendTwist, parent: None, outlet: 0, counts_per_turn: 4096 };
    let mut calibration = Calibration::default();
    calibration.add_missing(&JointTree::new(vec![part]).unwrap());
    let mut session = Session::new(EngineSettings { calibration, ..EngineSettings::default() });
    session.script.keeps_nothing = true;
    session.load(0.0);
    let told = session.connect(0.1);
    assert!(problems(told).iter().any(|what| what.contains("another kind")), "{told:?}");
    let told = session.sample(0.2, 1000);
    assert!(has(told, |e| matches!(e, EngineEvent::Zeroed { sensors: 1, unreadable: 0 })), "{told:?}");
    assert!(problems(told).iter().any(|what| what.contains("calibration.toml")), "{told:?}");
    let [EngineEvent::Frame(frame)] = session.sample(0.3, 1000 + 1024) else { panic!("it goes on") };
    assert!((frame.angles[0] - std::f32::consts::FRAC_PI_2).abs() < 1e-5);
}

fn run_session(plan: RunPlan) -> Session {
    let settings =
        EngineSettings { zero_policy: ZeroPolicy::AtStart, samples_per_second: 10.0, ..EngineSettings::default() };
    let mut session = Session::new(settings);
    session.ask(0.0, Command::Run(Box::new(plan)));
    session.load(0.0);
    session
}

#[test]
fn a_run_records_for_its_time_and_says_what_came_of_it_when_the_line_is_closed() {
    let plan = RunPlan { seconds: Some(1.0), record: Some("run.take".into()), ..RunPlan::default() };
    let mut session = run_session(plan);
    session.connect(0.0);
    // Eight samples a second, after the one that zeroes.
    let mut now = 0.125;
    while !session.asked().contains(&Request::Close(LineId(1))) {
        session.sample(now, 1000);
        session.tick(now + 0.0625);
        now += 0.125;
        assert!(now < 3.0, "the run is over after a second");
    }
    assert!(run_over(&session.script.told).is_none());
    let told = session.news(now, LineNews::Closed);
    let summary = run_over(told).unwrap().as_ref().unwrap().clone();
    let (path, recorded) = summary.take.clone().unwrap();
    assert_eq!((path.to_str(), recorded.samples, summary.poses), (Some("run.take"), 8, 8));
    assert!((summary.seconds - 1.0).abs() < 1e-9 && summary.trouble.is_none());
    assert_eq!(summary.counters.samples, u64::from(session.sequence), "the last count of the session");
    assert_eq!(summary.joints_bones_driven, (1, 1, 1));
    assert_eq!(session.take(0).samples().count(), 8);
    assert!(has(
        &session.script.told,
        |e| matches!(e, EngineEvent::Busy { task, .. } if task.starts_with("recording"))
    ));
}

#[test]
fn a_run_gives_up_a_puppet_that_says_nothing_and_a_line_that_stays_lost() {
    let mut silent = run_session(RunPlan::default());
    silent.open(3.0);
    assert!(silent.tick(14.9).is_empty() || run_over(&silent.script.told).is_none());
    silent.tick(15.1);
    let told = silent.news(15.2, LineNews::Closed);
    let Some(Err(failure)) = run_over(told) else { panic!("{told:?}") };
    assert!(failure.what.contains("did not describe itself"), "{failure}");

    let mut lost = run_session(RunPlan { record: Some("run.take".into()), ..RunPlan::default() });
    lost.connect(0.0);
    measured(&mut lost, 0.1, 0.35);
    lost.event(0.5, Event::Notice(DeviceNotice::LineLost { reason: "unplugged".into() }));
    lost.tick(30.4);
    assert!(!lost.asked().contains(&Request::Close(LineId(1))), "the line may come back");
    lost.tick(30.6);
    let told = lost.news(30.7, LineNews::Closed);
    let summary = run_over(told).unwrap().as_ref().unwrap();
    assert!(summary.trouble.as_ref().unwrap().what.contains("unplugged"));
    assert_eq!(lost.take(0).samples().count(), 2, "the take up to there is safe");
}

#[test]
fn a_puppet_that_is_silent_at_the_end_is_trouble_and_one_that_refuses_is_not_called_silent() {
    for (last, quiet) in [(3.0, true), (4.8, false)] {
        let mut session = run_session(RunPlan { seconds: Some(5.0), ..RunPlan::default() });
        session.connect(0.0);
        measured(&mut session, 0.1, last);
        session.tick(5.4);
        let told = session.news(5.5, LineNews::Closed);
        let trouble = run_over(told).unwrap().as_ref().unwrap().trouble.as_ref();
        assert_eq!(trouble.map(|t| t.kind), quiet.then_some(FailureKind::Device), "{trouble:?}");
        assert!(trouble.is_none_or(|t| t.what.contains("no more samples for the last 2.")), "{trouble:?}");
    }

    let problem = DeviceProblem::Refused { request: RequestKind::Start, reason: RefusalReason::Busy };
    let mut session = run_session(RunPlan::default());
    session.connect(0.0);
    session.event(0.5, Event::Problem(problem.clone()));
    session.tick(12.1);
    let told = session.news(12.2, LineNews::Closed);
    assert!(matches!(run_over(told), Some(Err(failure)) if failure.what == problem.to_string()), "{told:?}");

    let mut session = run_session(RunPlan::default());
    session.connect(0.0);
    session.tick(12.1);
    let told = session.news(12.2, LineNews::Closed);
    assert!(matches!(run_over(told), Some(Err(failure)) if failure.what.contains("sends no samples")), "{told:?}");
}

#[test]
fn an_interrupt_ends_a_run_tidily() {
    let mut session = run_session(RunPlan { record: Some("run.take".into()), ..RunPlan::default() });
    session.connect(0.0);
    measured(&mut session, 0.1, 0.35);
    session.ask(0.5, Command::Quit);
    assert!(!session.engine.is_over(), "the line is still to be closed");
    let told = session.news(0.6, LineNews::Closed);
    assert!(run_over(told).unwrap().as_ref().unwrap().trouble.is_none());
    assert!(session.engine.is_over());
    assert_eq!(session.take(0).samples().count(), 2);
}

#[test]
fn a_run_without_a_line_or_a_character_fails_at_once() {
    let mut session = run_session(RunPlan::default());
    session.ask(0.0, Command::Connect(ADDRESS.into()));
    let refused = Input::Connected { line: LineId(1), outcome: Err(Failure::device("no such port", "")) };
    assert!(matches!(run_over(session.at(0.1, refused)), Some(Err(failure)) if failure.what == "no such port"));

    let wanted = IkArgs { pin: vec!["arm".into()], ..IkArgs::default() };
    let mut session = Session::new(EngineSettings { ik: wanted, ..EngineSettings::default() });
    session.ask(0.0, Command::Run(Box::default()));
    assert!(matches!(run_over(session.load(0.0)), Some(Err(failure)) if failure.what.contains("has no mesh")));
}

fn measured(session: &mut Session, from: f64, to: f64) {
    let mut now = from;
    while now < to {
        session.sample(now, 1500);
        now += 0.1;
    }
}

#[test]
fn calibration_steps_are_done_one_after_the_other_and_report_their_seconds() {
    let mut session = Session::new(EngineSettings { zero_policy: ZeroPolicy::OnRequest, ..EngineSettings::default() });
    session.ask(0.0, Command::CalibrateAll(vec![CalibrationStep::Zero, CalibrationStep::Heading]));
    session.load(0.0);
    session.connect(0.0);
    measured(&mut session, 0.1, 9.0);
    let steps: Vec<_> = session
        .script
        .told
        .iter()
        .filter_map(|event| match event {
            EngineEvent::Calibrating { step, progress: Progress::Countdown { .. } } => Some((*step, "countdown")),
            EngineEvent::Calibrating { step, .. } => Some((*step, "measuring")),
            EngineEvent::Calibrated { step, measured: 1, failed: 0 } => Some((*step, "done")),
            EngineEvent::CalibrationOver(Ok(reports)) => Some((reports[1].step, "all done")),
            _ => None,
        })
        .collect();
    let of = |step: CalibrationStep| [(step, "countdown"); 3].into_iter().chain([(step, "measuring"), (step, "done")]);
    let wanted: Vec<_> = of(CalibrationStep::Zero)
        .chain(of(CalibrationStep::Heading))
        .chain([(CalibrationStep::Heading, "all done")])
        .collect();
    assert_eq!(steps, wanted);
    assert_eq!(session.script.kept.len(), 2);
    let zero = session.engine.puppeteer().unwrap().calibration().part(armature_rig::PartUid([3; 12])).unwrap();
    assert_eq!(zero[0].zero_counts, Some(1500));
}

#[test]
fn a_calibration_step_ends_without_samples_and_can_be_given_up() {
    let mut session = Session::ready();
    session.ask(1.0, Command::Calibrate(CalibrationStep::Zero));
    assert!(session.engine.wakes_at().is_some(), "somebody has to end it");
    let told = session.tick(5.0);
    assert!(matches!(told, [EngineEvent::Idle, EngineEvent::Problem(p)] if p.what.contains("no sample")), "{told:?}");

    session.ask(6.0, Command::Calibrate(CalibrationStep::Zero));
    assert!(matches!(session.ask(6.5, Command::Cancel), [EngineEvent::Idle]));
    assert_eq!(session.engine.wakes_at(), None);
    measured(&mut session, 7.0, 12.0);
    assert_eq!(session.script.kept.len(), 1, "nothing but the zero at the beginning");
}

#[test]
fn calibrating_ends_with_whatever_goes_wrong() {
    let begin = || {
        let mut session = Session::new(EngineSettings::default());
        session.ask(0.0, Command::CalibrateAll(vec![CalibrationStep::Zero]));
        session.load(0.0);
        session.connect(0.0);
        session
    };
    let why = |told: &[EngineEvent]| {
        let failure = told.iter().find_map(|event| match event {
            EngineEvent::CalibrationOver(Err(failure)) => Some(failure.what.clone()),
            _ => None,
        });
        failure.unwrap_or_else(|| panic!("{told:?}"))
    };
    assert_eq!(why(begin().tick(12.1)), "the puppet sends no samples");
    assert!(why(begin().news(1.0, LineNews::Over)).contains("the line was closed"));
    assert!(why(begin().ask(1.0, Command::Quit)).contains("interrupted; nothing was changed"));
    let refused = Event::Problem(DeviceProblem::Silent { seconds: 3 });
    assert!(why(begin().event(1.0, refused)).contains("nothing for 3 s"));
}

#[test]
fn loading_can_be_given_up_or_changed() {
    let mut session = Session::new(EngineSettings::default());
    session.ask(0.0, Command::LoadCharacter(CharacterChoice::BuiltIn("hand")));
    session.ask(0.1, Command::LoadCharacter(CharacterChoice::File("fox.glb".into())));
    assert_eq!(
        session.asked(),
        [
            Request::Load { load: LoadId(1), source: "hand".into() },
            Request::CancelLoad(LoadId(1)),
            Request::Load { load: LoadId(2), source: "fox.glb".into() }
        ]
    );
    let over = |load, outcome| Input::Loaded { load: LoadId(load), news: LoadNews::Over(outcome) };
    assert!(session.at(0.2, over(1, Ok((arm(), Vec::new())))).is_empty(), "nobody wants the hand any more");
    let progress = LoadNews::Progress { stage: "weights".into(), done: 0.5 };
    let told = session.at(0.3, Input::Loaded { load: LoadId(2), news: progress });
    assert!(matches!(told, [EngineEvent::Busy { task, fraction: Some(_) }] if task == "weights"));
    session.ask(0.4, Command::Cancel);
    assert_eq!(session.asked(), [Request::CancelLoad(LoadId(2))]);
    assert!(matches!(session.at(0.5, over(2, Err(Failure::usage("cancelled", "")))), [EngineEvent::Idle]));
    assert!(session.at(0.6, over(1, Ok((arm(), Vec::new())))).is_empty(), "nor afterwards");
}

#[test]
fn quitting_saves_the_recording_and_waits_for_the_line() {
    let mut session = Session::ready();
    session.ask(0.2, Command::StartRecording);
    session.sample(0.3, 1000);
    let told = session.ask(0.4, Command::Quit);
    assert!(matches!(told, [EngineEvent::Saved { .. }, EngineEvent::Disconnected { problem: None }]));
    assert!(!session.engine.is_over());
    session.news(0.5, LineNews::Closed);
    assert!(session.engine.is_over());
    assert_eq!(session.take(0).samples().count(), 1);
}

/// Everything that a day brings.
fn eventful() -> Session {
    let mut session = Session::new(EngineSettings::default());
    session.ask(0.0, Command::ListDevices);
    session.at(0.0, Input::Listed(Ok(Vec::new())));
    session.ask(0.0, Command::LoadCharacter(CharacterChoice::BuiltIn("hand")));
    let news = LoadNews::Over(Ok((arm(), vec!["a texture is missing".into()])));
    session.at(0.5, Input::Loaded { load: LoadId(1), news });
    session.connect(1.0);
    measured(&mut session, 1.1, 2.0);
    session.ask(2.0, Command::StartRecording);
    measured(&mut session, 2.1, 3.0);
    session.event(3.0, Event::Lost { count: 2, next_sequence: 30 });
    session.event(3.0, Event::Restarted);
    session.event(3.1, Event::Topology(Topology { epoch: 1, ..topology() }));
    measured(&mut session, 3.2, 4.0);
    // Refused in the middle of a take, heeded after it.
    session.ask(4.0, Command::Zero);
    session.ask(4.0, Command::StopRecording);
    session.ask(4.0, Command::Zero);
    measured(&mut session, 4.1, 5.0);
    session.ask(5.0, Command::Calibrate(CalibrationStep::Sweep));
    measured(&mut session, 5.1, 29.0);
    session.ask(29.1, Command::Disconnect);
    session.news(29.2, LineNews::Closed);
    session.ask(29.3, Command::Quit);
    session
}

#[test]
fn a_recorded_list_of_inputs_replays_a_whole_session() {
    let first = eventful();
    assert!(first.engine.is_over());
    let mut again = Session::new(EngineSettings::default());
    for (now, input) in &first.happened {
        again.at(*now, input.clone());
    }
    let words = |session: &Session| -> Vec<String> { session.script.told.iter().map(|e| format!("{e:?}")).collect() };
    let kinds = |name: &str| words(&first).iter().filter(|event| event.starts_with(name)).count();
    assert!(kinds("Frame") > 200 && kinds("Calibrating") > 20 && kinds("Saved") == 1, "{:?}", kinds("Frame"));
    assert_eq!(words(&first), words(&again));
    assert_eq!(first.script.asked, again.script.asked);
    assert_eq!(first.script.kept, again.script.kept);
    let bytes = |session: &Session| session.script.takes[0].0.lock().unwrap().0.clone();
    assert_eq!(bytes(&first), bytes(&again));
}
