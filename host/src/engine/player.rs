//! Playing a take: where the playhead is, and the character there. It reads no clock.

use std::sync::Arc;

use armature_rig::{Calibration, Pose, ShapeWeights};

use super::event::Frame;
use super::frames;
use super::playback::{Play, Playback, SPEEDS};
use super::puppeteer::{Puppeteer, ZeroPolicy};
use crate::failure::Failure;
use crate::takes::opened::OpenedTake;

/// A take being played.
#[derive(Debug)]
pub(super) struct Player {
    take: Arc<OpenedTake>,
    puppeteer: Puppeteer,
    playback: Playback,
    /// When the playhead was moved last, on the engine's clock.
    moved: Option<f64>,
    pose: Pose,
    shapes: ShapeWeights,
}

impl Player {
    /// A take at its start, standing still.
    pub(super) fn new(take: Arc<OpenedTake>) -> Result<Self, Failure> {
        let character = take.character.clone();
        let puppeteer = Puppeteer::new(character, None, Calibration::default(), ZeroPolicy::OnRequest)?;
        let playback = Playback { seconds: take.span().0, ..Playback::default() };
        Ok(Self { take, puppeteer, playback, moved: None, pose: Pose::default(), shapes: ShapeWeights::default() })
    }

    /// The same take after other edits; the playhead stays where it can.
    pub(super) fn replace(self, take: Arc<OpenedTake>) -> Result<Self, Failure> {
        let mut player = Self::new(take)?;
        player.playback = Playback { range: None, ..self.playback };
        player.playback.seconds = player.within(self.playback.seconds);
        player.moved = self.moved;
        Ok(player)
    }

    pub(super) fn take(&self) -> &Arc<OpenedTake> {
        &self.take
    }

    pub(super) fn playback(&self) -> Playback {
        self.playback
    }

    /// From where to where it plays.
    fn span(&self) -> (f64, f64) {
        self.playback.range.unwrap_or_else(|| self.take.span())
    }

    fn within(&self, seconds: f64) -> f64 {
        let (first, last) = self.take.span();
        if seconds.is_finite() { seconds.clamp(first, last) } else { first }
    }

    /// Does what is asked.
    pub(super) fn play(&mut self, now: f64, ask: Play) {
        self.advance(now);
        match ask {
            Play::Start => {
                let (first, last) = self.span();
                let is_there = (first..last).contains(&self.playback.seconds);
                self.playback.seconds = if is_there { self.playback.seconds } else { first };
                self.set_playing(true, now);
            }
            Play::Pause => self.set_playing(false, now),
            Play::Seek(seconds) => self.playback.seconds = self.within(seconds),
            Play::Step { forward } => {
                self.set_playing(false, now);
                self.playback.seconds = self.within(self.take.neighbour(self.playback.seconds, forward));
            }
            Play::Speed(speed) if speed.is_finite() => {
                self.playback.speed = speed.clamp(*SPEEDS.start(), *SPEEDS.end());
            }
            Play::Speed(_) => {}
            Play::Loop(looping) => self.playback.looping = looping,
            Play::Range(range) => {
                let range = range.map(|(from, to)| (self.within(from.min(to)), self.within(from.max(to))));
                self.playback.range = range.filter(|(from, to)| from < to);
            }
        }
    }

    fn set_playing(&mut self, playing: bool, now: f64) {
        self.playback.playing = playing;
        self.moved = playing.then_some(now);
    }

    /// Moves the playhead to where it is now. Returns whether it moves.
    pub(super) fn advance(&mut self, now: f64) -> bool {
        let Some(moved) = self.moved.replace(now).filter(|_| self.playback.playing) else {
            self.moved = self.playback.playing.then_some(now);
            return false;
        };
        let (first, last) = self.span();
        let mut seconds = self.playback.seconds + (now - moved).max(0.0) * self.playback.speed;
        if seconds >= last {
            if self.playback.looping && last > first {
                seconds = first + (seconds - last).rem_euclid(last - first);
            } else {
                seconds = last;
                self.set_playing(false, now);
            }
        }
        self.playback.seconds = seconds;
        true
    }

    /// Fills a frame with the character at the playhead. `over`: bones that another pose brings, as while they are
    /// overdubbed.
    pub(super) fn fill(&mut self, frame: &mut Frame, over: Option<(&[bool], &Pose)>) -> Result<(), Failure> {
        if self.take.pose_at(self.playback.seconds, &mut self.pose).is_some() {
            if let Some((bones, live)) = over {
                let live = live.parent_from_bone.iter().zip(bones);
                for (bone, (live, _)) in self.pose.parent_from_bone.iter_mut().zip(live).filter(|(_, (_, over))| **over)
                {
                    *bone = *live;
                }
            }
            self.take.shapes_at(self.playback.seconds, &mut self.shapes);
            self.puppeteer.show(&self.pose, &self.shapes)?;
        }
        frames::fill_character(frame, &self.puppeteer);
        frame.angles.clear();
        frame.states.clear();
        Ok(())
    }
}
