//! What the window knows of takes: the list, the open one and its playhead, what is armed, what is being exported.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use armature_take::{Edit, EditList, FrameRate};

use crate::engine::event::EngineEvent;
use crate::engine::playback::Playback;
use crate::files::{self, Overwrite};
use crate::takes::exports::Target;
use crate::takes::library::Library;
use crate::takes::opened::OpenedTake;
use crate::takes::orders::{ExportOrder, ExportReceipt};

/// Countdowns to choose from, seconds.
pub const COUNTDOWNS: [u8; 4] = [0, 3, 5, 10];

/// Everything about takes.
#[derive(Debug, Default)]
pub struct Desk {
    /// The takes of the folder.
    pub library: Arc<Library>,
    /// The take that is shown in place of the puppet.
    pub open: Option<Arc<OpenedTake>>,
    /// Increases with every take that is opened or edited.
    pub open_number: u64,
    /// Where it is.
    pub playback: Playback,
    /// The bones to be recorded over it, each with everything below.
    pub armed: BTreeSet<String>,
    /// How long to wait before a take begins, seconds.
    pub countdown: u8,
    /// How long it is yet.
    pub counting: Option<u32>,
    /// The take put into the bin last.
    pub discarded: Option<PathBuf>,
    /// What is asked of an export.
    pub export: Option<ExportForm>,
    /// What came of the last one.
    pub exported: Option<ExportReceipt>,
    /// Edits that were taken back, the latest last.
    undone: Vec<Edit>,
}

/// A program that takes are exported for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// The format that it reads best.
    pub target: Target,
    /// Its usual rate.
    pub rate: u32,
    /// What to do there.
    pub how: &'static str,
}

/// Programs to choose from.
pub const PRESETS: [Preset; 5] = [
    Preset { name: "Blender", target: Target::Glb, rate: 24, how: "File, Import, glTF 2.0" },
    Preset { name: "Maya", target: Target::Fbx, rate: 24, how: "File, Import" },
    Preset { name: "Unreal", target: Target::Fbx, rate: 30, how: "drag the file into the content browser" },
    Preset { name: "USD", target: Target::Usdz, rate: 24, how: "open the file, or reference it in a stage" },
    Preset {
        name: "Motion only",
        target: Target::Bvh,
        rate: 30,
        how: "skeleton and motion for any program that reads BVH",
    },
];

/// Formats to choose from, with their extensions and what they hold.
pub const FORMATS: [(Target, &str, &str); 5] = [
    (Target::Glb, "glb", "GLB"),
    (Target::Fbx, "fbx", "FBX"),
    (Target::Usdz, "usdz", "USDZ"),
    (Target::Bvh, "bvh", "BVH, motion only"),
    (Target::Vrma, "vrma", "VRMA, for VRM avatars"),
];

/// A format's extension.
pub fn extension(target: Target) -> &'static str {
    FORMATS.iter().find(|(of, ..)| *of == target).map_or("", |(_, extension, _)| extension)
}

/// What the export dialog holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportForm {
    /// The take.
    pub take: PathBuf,
    /// For which program.
    pub preset: usize,
    /// The format.
    pub target: Target,
    /// Frames a second, as typed.
    pub rate: String,
    /// Only from the in to the out point.
    pub only_range: bool,
    /// Whether a file that is there may be replaced.
    pub replace: bool,
    /// The file, as typed.
    pub to: String,
}

impl ExportForm {
    /// For a take, with the first preset.
    pub fn new(take: PathBuf, has_range: bool) -> Self {
        let mut form = Self {
            take,
            preset: 0,
            target: PRESETS[0].target,
            rate: String::new(),
            only_range: has_range,
            replace: false,
            to: String::new(),
        };
        form.choose(0);
        form
    }

    /// Follows a preset.
    pub fn choose(&mut self, preset: usize) {
        let Some(chosen) = PRESETS.get(preset) else { return };
        self.preset = preset;
        self.target = chosen.target;
        self.rate = chosen.rate.to_string();
        let file = self.take.with_extension(extension(self.target));
        let name = file.file_name().unwrap_or_default();
        let folder = self.take.parent().map(|folder| folder.join("Exports")).unwrap_or_default();
        self.to = folder.join(name).display().to_string();
    }

    /// The order, or what is wrong with what was typed.
    pub fn order(&self, range: Option<(f64, f64)>) -> Result<ExportOrder, String> {
        let rate: FrameRate = self.rate.trim().parse().map_err(|e: armature_take::FrameRateError| e.to_string())?;
        let to = PathBuf::from(self.to.trim());
        if files::extension_of(&to) != extension(self.target) {
            return Err(format!("give the file a name that ends in .{}", extension(self.target)));
        }
        let overwrite = Overwrite { force: self.replace };
        let range = range.filter(|_| self.only_range);
        Ok(ExportOrder { take: self.take.clone(), target: self.target, rate, range, to, overwrite })
    }
}

impl Desk {
    /// Applies what is about takes in an event.
    pub(super) fn update(&mut self, event: &EngineEvent) {
        match event {
            EngineEvent::Takes(library) => self.library = library.clone(),
            EngineEvent::TakeOpened(take) => {
                if self.open.as_ref().is_none_or(|open| open.path != take.path) {
                    self.undone.clear();
                    self.armed.clear();
                }
                self.open = Some(take.clone());
                self.open_number += 1;
            }
            EngineEvent::TakeClosed => {
                self.open = None;
                self.undone.clear();
            }
            EngineEvent::Playback(playback) => self.playback = *playback,
            EngineEvent::Countdown { seconds_left } => self.counting = (*seconds_left > 0).then_some(*seconds_left),
            EngineEvent::Recording { .. } => (self.counting, self.discarded) = (None, None),
            EngineEvent::Discarded { path } => self.discarded = Some(path.clone()),
            EngineEvent::Exported(receipt) => {
                self.exported = Some(receipt.clone());
                self.export = None;
            }
            _ => {}
        }
    }

    /// The open take's edits with another one.
    pub(super) fn with(&mut self, edit: Edit) -> Option<EditList> {
        let mut list = self.open.as_ref()?.list.clone();
        list.add([edit]);
        self.undone.clear();
        Some(list)
    }

    /// The open take's edits without the last one.
    pub(super) fn without_last(&mut self) -> Option<EditList> {
        let mut list = self.open.as_ref()?.list.clone();
        self.undone.push(list.edits.pop()?);
        Some(list)
    }

    /// The open take's edits with the one that was taken back last.
    pub(super) fn with_undone(&mut self) -> Option<EditList> {
        let mut list = self.open.as_ref()?.list.clone();
        list.add([self.undone.pop()?]);
        Some(list)
    }

    /// Whether there is an edit to take back.
    pub fn can_undo(&self) -> bool {
        self.open.as_ref().is_some_and(|open| !open.list.edits.is_empty())
    }

    /// Whether there is one to bring back.
    pub fn can_redo(&self) -> bool {
        self.open.is_some() && !self.undone.is_empty()
    }

    /// In and out point where only one of them is moved.
    pub(super) fn range_with(&self, from: Option<f64>, to: Option<f64>) -> Option<(f64, f64)> {
        let (first, last) = self.open.as_ref()?.span();
        let (old_from, old_to) = self.playback.range.unwrap_or((first, last));
        Some((from.unwrap_or(old_from), to.unwrap_or(old_to)))
    }
}

/// An edit in a few words.
pub fn edit_label(edit: &Edit) -> String {
    match edit {
        Edit::Overdub { bones, .. } => format!("Overdub {}", bones.join(", ")),
        Edit::Filter { filter } => format!("Filter {filter}"),
        Edit::Trim { from, to } => format!("Trim {from:.2} s to {to:.2} s"),
        Edit::Segment { name, .. } => format!("Segment {name}"),
        Edit::Marker { at, text } => format!("Marker at {at:.2} s: {text}"),
        Edit::Mute { bones, .. } => format!("Mute {}", bones.join(", ")),
        Edit::Smooth { cutoff, .. } => format!("Smooth above {cutoff} Hz"),
        Edit::Mirror => "Mirror".into(),
        Edit::Retime { speed } => format!("Speed × {speed}"),
        Edit::Loop { times, .. } => format!("Loop {times} times"),
        Edit::Hold { pose, .. } => format!("Hold the pose of {pose:.2} s"),
        Edit::Add { take, .. } => format!("Add {take}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_export_says_what_is_wrong_before_it_begins() {
        let mut form = ExportForm::new("takes/walk.take".into(), true);
        let order = form.order(Some((1.0, 2.0))).unwrap();
        assert_eq!(order.to, PathBuf::from("takes/Exports/walk.glb"));
        assert_eq!((order.range, order.rate.frames_per_second()), (Some((1.0, 2.0)), 24.0));
        form.rate = "often".into();
        assert!(form.order(None).unwrap_err().contains("not a frame rate"));
        let motion_only = PRESETS.iter().position(|preset| preset.target == Target::Bvh).unwrap();
        form.choose(motion_only);
        form.only_range = false;
        assert_eq!(form.order(Some((1.0, 2.0))).unwrap().range, None);
        form.to = "walk.glb".into();
        assert!(form.order(None).unwrap_err().contains(".bvh"));
    }

    #[test]
    fn edits_are_taken_back_and_brought_back() {
        let mut desk = Desk::default();
        assert!(desk.without_last().is_none() && !desk.can_undo());
        let open = |list: EditList| {
            let mut take = OpenedTake::default();
            take.list = list;
            EngineEvent::TakeOpened(Arc::new(take))
        };
        desk.update(&open(EditList::new("a.take")));
        let trimmed = desk.with(Edit::Trim { from: 1.0, to: 2.0 }).unwrap();
        desk.update(&open(trimmed.clone()));
        let before = desk.without_last().unwrap();
        assert_eq!(before, EditList::new("a.take"));
        desk.update(&open(before));
        assert!(desk.can_redo() && !desk.can_undo());
        assert_eq!(desk.with_undone(), Some(trimmed));
    }
}
