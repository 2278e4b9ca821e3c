//! Characters loaded on their own threads.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::characters;
use crate::characters::skin::SkinArgs;
use crate::engine::inbox::InboxSender;
use crate::engine::input::{Input, LoadId, LoadNews};

/// Every report makes the window draw, which takes time from the work.
const REPORT_EVERY: Duration = Duration::from_millis(100);

/// The characters being loaded.
#[derive(Debug, Default)]
pub(super) struct Loads {
    cancels: Vec<(LoadId, Arc<AtomicBool>)>,
}

impl Loads {
    /// Loads a character; its progress and result go into the inbox.
    pub(super) fn begin(&mut self, load: LoadId, source: String, skin: SkinArgs, inbox: InboxSender) {
        // A thread that is done no longer holds its flag.
        self.cancels.retain(|(_, cancel)| Arc::strong_count(cancel) > 1);
        let cancel = Arc::new(AtomicBool::new(false));
        self.cancels.push((load, cancel.clone()));
        std::thread::spawn(move || {
            let mut reported: Option<(String, Instant)> = None;
            let news = find(&source, skin, &mut |stage, done| {
                let is_news = |(before, at): &(String, Instant)| *before != stage || at.elapsed() >= REPORT_EVERY;
                if reported.as_ref().is_none_or(is_news) {
                    reported = Some((stage.clone(), Instant::now()));
                    inbox.send(Input::Loaded { load, news: LoadNews::Progress { stage, done } });
                }
                if cancel.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            // Nobody is waiting if the program has ended meanwhile.
            inbox.send(Input::Loaded { load, news });
        });
    }

    /// Cancels loading a character at its next progress report.
    pub(super) fn cancel(&self, load: LoadId) {
        for (_, cancel) in self.cancels.iter().filter(|(id, _)| *id == load) {
            cancel.store(true, Ordering::Relaxed);
        }
    }
}

/// Makes or reads a character.
pub(super) fn find(source: &str, skin: SkinArgs, progress: &mut dyn FnMut(String, f64) -> ControlFlow<()>) -> LoadNews {
    let found = characters::find(source, &mut |stage, done| progress(stage.to_string(), done));
    // What is opened in the window may have no mesh; its bones are shown.
    let found = found.and_then(|found| match found.character.shape {
        Some(_) => skin.apply(found, &mut |stage, done| progress(stage.to_string(), done)),
        None => Ok(found),
    });
    LoadNews::Over(found.map(|found| (Arc::new(found.character), found.warnings)))
}
