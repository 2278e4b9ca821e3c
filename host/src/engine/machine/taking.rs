//! Takes that are there: listing, opening, playing and editing them; recording after a countdown, again, and over them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_take::{Edit, EditList};

use super::line::Line;
use super::{Engine, EngineEvent, Problem, Request, Shell, TakeName, recording_goes_on};
use crate::engine::input::{WorkId, WorkNews};
use crate::engine::playback::Play;
use crate::engine::player::Player;
use crate::failure::Failure;
use crate::takes::opened::OpenedTake;
use crate::takes::orders::{TakeOrder, TakeResult};

/// How often the character of a take that plays is drawn.
const PLAY_FRAME_SECONDS: f64 = 1.0 / 60.0;
/// How long an overdub takes to come in and to go, seconds.
const OVERDUB_BLEND: f64 = 0.25;
/// The longest countdown.
const LONGEST_COUNTDOWN: f64 = 60.0;

/// What goes on with takes.
#[derive(Debug, Default)]
pub(super) struct Taking {
    player: Option<Player>,
    works: u32,
    /// Work in progress, and whether it was cancelled.
    under_way: Vec<(WorkId, bool)>,
    /// The latest take to be opened; an earlier one that comes late is not shown.
    opening: Option<WorkId>,
    /// Somebody looks at the list.
    is_listed: bool,
    /// When to begin a take, and what was last said about it.
    countdown: Option<(f64, Option<u32>)>,
    overdub: Option<Overdub>,
    /// The take that was recorded last.
    latest: Option<PathBuf>,
}

/// Bones being recorded over a take.
#[derive(Debug)]
struct Overdub {
    bones: Vec<String>,
    /// The same and everything below them, in the order of the skeleton.
    is_over: Vec<bool>,
    /// When it began, seconds on the clock of the older take's recording.
    at: f64,
}

impl Engine {
    /// When the playhead or a countdown has to go on.
    pub(super) fn taking_wakes_at(&self) -> Option<f64> {
        let plays = self.taking.player.as_ref().is_some_and(|player| player.playback().playing);
        let frame = plays.then_some(self.last_frame + PLAY_FRAME_SECONDS);
        let second = self.taking.countdown.map(|(at, _)| at - ((at - self.last_input).ceil() - 1.0).max(0.0));
        [frame, second].into_iter().flatten().min_by(f64::total_cmp)
    }

    pub(super) fn work(&mut self, order: TakeOrder, shell: &mut dyn Shell) {
        self.taking.works += 1;
        let work = WorkId(self.taking.works);
        self.taking.under_way.push((work, false));
        if matches!(order, TakeOrder::Open(_) | TakeOrder::Edit { .. }) {
            self.taking.opening = Some(work);
        }
        shell.ask(Request::Work { work, order });
    }

    pub(super) fn cancel_work(&mut self, shell: &mut dyn Shell) {
        for (work, cancelled) in &mut self.taking.under_way {
            *cancelled = true;
            shell.ask(Request::CancelWork(*work));
        }
        if self.taking.countdown.take().is_some() {
            shell.tell(EngineEvent::Countdown { seconds_left: 0 });
        }
    }

    pub(super) fn hear_work(&mut self, now: f64, work: WorkId, news: WorkNews, shell: &mut dyn Shell) {
        let Some(index) = self.taking.under_way.iter().position(|(id, _)| *id == work) else { return };
        let result = match news {
            WorkNews::Progress { stage, done } => {
                shell.tell(EngineEvent::Busy { task: stage, fraction: Some(done as f32) });
                return;
            }
            WorkNews::Over(result) => result,
        };
        let (_, cancelled) = self.taking.under_way.remove(index);
        shell.tell(EngineEvent::Idle);
        let failure = match result {
            Ok(result) => self.work_is_done(now, work, result, shell).err(),
            Err(failure) => (!cancelled).then_some(failure),
        };
        if let Some(failure) = failure {
            shell.tell(EngineEvent::Problem(Problem::from(&failure)));
        }
    }

    fn work_is_done(
        &mut self,
        now: f64,
        work: WorkId,
        result: TakeResult,
        shell: &mut dyn Shell,
    ) -> Result<(), Failure> {
        match result {
            TakeResult::Listed(library) => shell.tell(EngineEvent::Takes(Arc::new(library))),
            TakeResult::Opened(take) => {
                if self.taking.opening.take_if(|opening| *opening == work).is_some() {
                    self.show_take(now, take, shell)?;
                }
                self.list_again(shell);
            }
            TakeResult::Changed => self.list_again(shell),
            TakeResult::Discarded(path) => {
                shell.tell(EngineEvent::Discarded { path });
                self.list_again(shell);
            }
            TakeResult::Exported(receipt) => shell.tell(EngineEvent::Exported(receipt)),
        }
        Ok(())
    }

    pub(super) fn list_takes(&mut self, shell: &mut dyn Shell) {
        self.taking.is_listed = true;
        self.list_again(shell);
    }

    fn list_again(&mut self, shell: &mut dyn Shell) {
        if self.taking.is_listed {
            self.work(TakeOrder::List { except: self.recording.clone() }, shell);
        }
    }

    pub(super) fn open_take(&mut self, path: PathBuf, shell: &mut dyn Shell) -> Result<(), Failure> {
        if self.recording.is_some() {
            return Err(recording_goes_on("open another"));
        }
        self.work(TakeOrder::Open(path), shell);
        Ok(())
    }

    /// Shows a take in place of the puppet, on its own character.
    fn show_take(&mut self, now: f64, take: Arc<OpenedTake>, shell: &mut dyn Shell) -> Result<(), Failure> {
        if self.recording.is_some() {
            return Err(recording_goes_on("open another"));
        }
        let shown = self.pipeline.as_ref().map(|pipeline| pipeline.puppeteer().character());
        if shown.is_none_or(|shown| shown.content_hash() != take.character.content_hash()) {
            self.enter(now, take.character.clone(), shell)?;
        }
        self.taking.player = Some(match self.taking.player.take() {
            Some(player) if player.take().path == take.path => player.replace(take.clone())?,
            _ => Player::new(take.clone())?,
        });
        shell.tell(EngineEvent::TakeOpened(take));
        self.tell_frame(now, shell);
        Ok(())
    }

    /// Whether the puppet is to be seen: alone, or over a take.
    pub(super) fn draws_puppet(&self) -> bool {
        self.taking.player.is_none() || self.taking.overdub.is_some()
    }

    pub(super) fn close_take(&mut self, shell: &mut dyn Shell) {
        self.taking.opening = None;
        if self.taking.player.take().is_some() {
            shell.tell(EngineEvent::TakeClosed);
            self.frame_waits = matches!(self.line, Line::Open(_));
        }
    }

    pub(super) fn play(&mut self, now: f64, play: Play, shell: &mut dyn Shell) {
        let overdubs = self.taking.overdub.is_some();
        let Some(player) = self.taking.player.as_mut().filter(|_| !overdubs) else { return };
        player.play(now, play);
        self.tell_frame(now, shell);
    }

    pub(super) fn edit_take(&mut self, list: EditList, shell: &mut dyn Shell) -> Result<(), Failure> {
        let Some(player) = &self.taking.player else {
            return Err(Failure::usage("no take is open", "open one first"));
        };
        if self.recording.is_some() {
            return Err(recording_goes_on("edit one"));
        }
        let take = player.take().path.clone();
        self.work(TakeOrder::Edit { take, list }, shell);
        Ok(())
    }

    pub(super) fn discard(&mut self, take: PathBuf, shell: &mut dyn Shell) -> Result<(), Failure> {
        if self.recording.as_ref() == Some(&take) {
            return Err(recording_goes_on("discard it"));
        }
        if self.taking.player.as_ref().is_some_and(|player| player.take().path == take) {
            self.close_take(shell);
        }
        self.taking.latest.take_if(|latest| *latest == take);
        self.work(TakeOrder::Discard(take), shell);
        Ok(())
    }

    pub(super) fn record_after(&mut self, now: f64, seconds: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        self.ready_to_record()?;
        let wait = if seconds.is_finite() { seconds.clamp(0.0, LONGEST_COUNTDOWN) } else { 0.0 };
        if self.recording.is_none() {
            self.taking.countdown = Some((now + wait, None));
            self.look_after_takes(now, shell)?;
        }
        Ok(())
    }

    /// The last attempt goes into the bin, and another begins.
    pub(super) fn record_again(&mut self, now: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        self.ready_to_record()?;
        let overdub = self.taking.overdub.take();
        if self.recording.is_some() {
            self.stop_recording(shell);
        }
        if let Some(latest) = self.taking.latest.take() {
            self.discard(latest, shell)?;
        }
        match overdub {
            Some(overdub) => self.overdub_from(now, &overdub.bones, Some(overdub.at), shell),
            None => self.start_recording(now, shell),
        }
    }

    /// Records bones over the open take while it plays from where its playhead is.
    pub(super) fn overdub(&mut self, now: f64, bones: &[String], shell: &mut dyn Shell) -> Result<(), Failure> {
        if self.recording.is_some() {
            return Ok(());
        }
        self.overdub_from(now, bones, None, shell)
    }

    fn overdub_from(
        &mut self,
        now: f64,
        bones: &[String],
        at: Option<f64>,
        shell: &mut dyn Shell,
    ) -> Result<(), Failure> {
        let character = self.ready_to_record()?;
        let Some(player) = &self.taking.player else {
            return Err(Failure::usage("there is no take to record over", "open one first"));
        };
        if character.skeleton != player.take().character.skeleton {
            return Err(Failure::usage("the puppet moves another character than the take", "open the take again"));
        }
        let begins = player.take().begins.ok_or_else(|| {
            Failure::usage(
                "the take's edits change its speed or repeat it",
                "take those edits back, then record over it",
            )
        })?;
        let skeleton = &character.skeleton;
        let mut is_over: Vec<bool> = skeleton.bones().iter().map(|bone| bones.contains(&bone.name)).collect();
        for (bone, own) in skeleton.bones().iter().enumerate() {
            is_over[bone] |= own.parent.is_some_and(|parent| is_over[parent]);
        }
        if !is_over.contains(&true) {
            return Err(Failure::usage("no limb is armed", "arm the limbs that you want to record"));
        }
        let beside = player.take().path.clone();
        let seconds = at.map_or(player.playback().seconds, |at| at - begins);
        self.record_as(now, TakeName::Beside(beside), shell)?;
        if let Some(player) = &mut self.taking.player {
            player.play(now, Play::Loop(false));
            player.play(now, Play::Seek(seconds));
            player.play(now, Play::Start);
            let at = begins + player.playback().seconds;
            self.taking.overdub = Some(Overdub { bones: bones.to_vec(), is_over, at });
        }
        Ok(())
    }

    /// A take is complete on disk.
    pub(super) fn take_saved(&mut self, path: &Path, shell: &mut dyn Shell) {
        self.taking.latest = Some(path.to_owned());
        let overdub = self.taking.overdub.take();
        let list = self.taking.player.as_ref().map(|player| player.take().list.clone());
        match (overdub, list, path.file_name()) {
            (Some(Overdub { bones, at, .. }), Some(mut list), Some(name)) => {
                let take = name.to_string_lossy().into_owned();
                let (from, to) = (None, None);
                list.add([Edit::Overdub { take, bones, at, from, to, blend: OVERDUB_BLEND }]);
                if let Err(failure) = self.edit_take(list, shell) {
                    shell.tell(EngineEvent::Problem(Problem::from(&failure)));
                }
            }
            _ => self.list_again(shell),
        }
    }

    /// Moves the playhead, ends what the take's end ends, counts down.
    pub(super) fn look_after_takes(&mut self, now: f64, shell: &mut dyn Shell) -> Result<(), Failure> {
        if let Some((at, told)) = self.taking.countdown {
            let left = (at - now).max(0.0).ceil() as u32;
            if told != Some(left) {
                self.taking.countdown = Some((at, Some(left)));
                shell.tell(EngineEvent::Countdown { seconds_left: left });
            }
            if now >= at {
                self.taking.countdown = None;
                self.start_recording(now, shell)?;
            }
        }
        let Some(player) = self.taking.player.as_mut().filter(|player| player.playback().playing) else {
            return Ok(());
        };
        if now - self.last_frame < PLAY_FRAME_SECONDS {
            return Ok(());
        }
        player.advance(now);
        let is_over = !player.playback().playing;
        self.tell_frame(now, shell);
        if is_over && self.taking.overdub.is_some() {
            self.stop_recording(shell);
        }
        Ok(())
    }

    /// Draws the take, if one is shown.
    pub(super) fn tell_take_frame(&mut self, shell: &mut dyn Shell) -> bool {
        let Some(player) = &mut self.taking.player else { return false };
        let mut frame = shell.frame_buffer();
        let live = self.pipeline.as_ref().map(|pipeline| pipeline.puppeteer().pose());
        let over = self.taking.overdub.as_ref().map(|overdub| overdub.is_over.as_slice()).zip(live);
        if let Err(failure) = player.fill(&mut frame, over) {
            shell.tell(EngineEvent::Problem(Problem::from(&failure)));
        }
        if let Line::Open(open) = &self.line {
            frame.stats = self.frame_clock.stats(&open.counters);
        }
        shell.tell(EngineEvent::Frame(frame));
        shell.tell(EngineEvent::Playback(player.playback()));
        true
    }
}
