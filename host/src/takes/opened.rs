//! A take as it is played: its poses after its edits, the character they move, and what its joints said.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_rig::{Pose, ShapeWeights, Skeleton};
use armature_take::{
    Curves, Edit, EditList, PackedPose, Receipt, Record, ShapeTrack, SilentJoint, Summary, Take, Timeline, curves,
    receipt, summarize,
};

use crate::characters::{self, LoadedCharacter};
use crate::failure::Failure;
use crate::files;
use crate::takes::{self, edits};

/// Curves are kept in at most this many steps: a take of ten minutes in steps of 0.15 s.
const CURVE_STEPS: usize = 4096;

/// A take, ready to be played.
#[derive(Debug, Default)]
pub struct OpenedTake {
    /// Its file.
    pub path: PathBuf,
    /// What is done to it.
    pub list: EditList,
    /// What it moves.
    pub character: Arc<LoadedCharacter>,
    /// For each bone, whether a joint turned it.
    pub driven: Vec<bool>,
    /// The bone that each curve's part moves.
    pub bone_of_curve: Vec<Option<usize>>,
    /// What its joints said, on the recording's own clock.
    pub curves: Curves,
    /// What the measurement is worth.
    pub receipt: Receipt,
    /// Joints that had no good reading for a second or longer, on the recording's clock.
    pub silent: Vec<SilentJoint>,
    /// Notes, on the clock of the edited take.
    pub markers: Vec<(f64, String)>,
    /// Named parts, on the clock of the edited take.
    pub segments: Vec<(String, f64, f64)>,
    /// What there is to know about it, in sentences.
    pub notes: Vec<String>,
    /// When the edited take begins on the recording's clock, seconds; `None` if its edits change its speed or order, so
    /// that the two clocks have nothing to do with each other.
    pub begins: Option<f64>,
    poses: Vec<(f64, PackedPose)>,
    shapes: Option<ShapeTrack>,
}

impl OpenedTake {
    /// Its name: the file's, without the extension.
    pub fn name(&self) -> String {
        self.path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Times of the first and the last pose, seconds.
    pub fn span(&self) -> (f64, f64) {
        match (self.poses.first(), self.poses.last()) {
            (Some((first, _)), Some((last, _))) => (*first, *last),
            _ => (0.0, 0.0),
        }
    }

    /// Number of poses.
    pub fn pose_count(&self) -> usize {
        self.poses.len()
    }

    /// Writes the pose in force at this time, seconds, into `pose`: the latest one not after it. Returns its number.
    pub fn pose_at(&self, seconds: f64, pose: &mut Pose) -> Option<usize> {
        let index = self.poses.partition_point(|(time, _)| *time <= seconds).saturating_sub(1);
        let (_, packed) = self.poses.get(index)?;
        packed.unpack(&self.character.skeleton, pose);
        Some(index)
    }

    /// Writes the weights of shapes at this time, seconds, into `shapes`: those that the take sets.
    pub fn shapes_at(&self, seconds: f64, shapes: &mut ShapeWeights) {
        *shapes = ShapeWeights::default();
        for (name, weight) in self.shapes.iter().flat_map(|track| track.at(seconds)) {
            // Between finite weights there are only finite ones.
            let _ = shapes.set(name, weight);
        }
    }

    /// The time of the pose before or behind the one at this time, seconds.
    pub fn neighbour(&self, seconds: f64, forward: bool) -> f64 {
        let after = self.poses.partition_point(|(time, _)| *time <= seconds + 1e-9);
        let index = if forward { after } else { after.saturating_sub(2) };
        self.poses.get(index.min(self.poses.len().saturating_sub(1))).map_or(0.0, |(time, _)| *time)
    }
}

/// The edit list of a take: beside it, with its name.
pub fn list_of(take: &Path) -> PathBuf {
    take.with_extension(edits::EXTENSION)
}

/// Opens a take with the edits of the list beside it, or with these.
pub fn open(
    path: &Path,
    list: Option<EditList>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<OpenedTake, Failure> {
    let (take, report) = takes::read(path)?;
    let mut notes: Vec<String> = report.problems.iter().map(ToString::to_string).collect();
    let list = match list {
        Some(list) => list,
        None => saved_list(path)?,
    };
    let character = character_of(path, &take, &mut notes, progress)?;
    let opened = prepare(path, &take, list, character, progress)?;
    notes.extend(opened.notes);
    Ok(OpenedTake { notes, ..opened })
}

/// Prepares a take that lies at this path for playing, with these edits and the character that it was recorded with.
pub fn prepare(
    path: &Path,
    take: &Take,
    list: EditList,
    character: Arc<LoadedCharacter>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<OpenedTake, Failure> {
    let cancelled = || Failure::usage("opening the take was cancelled", "");
    let Summary { silent_joints: silent, markers, .. } = summarize(take);
    // Not more than there are samples, or most steps would be empty.
    let steps = (take.samples().count() * 2 / 3).min(CURVE_STEPS);
    let mut opened = OpenedTake {
        path: path.to_owned(),
        curves: curves(take, steps, progress).ok_or_else(cancelled)?,
        receipt: receipt(take),
        silent,
        begins: begins(&list.edits),
        ..OpenedTake::default()
    };
    if list.edits.is_empty() && take.poses().next().is_some() {
        opened.markers = markers;
        opened.shapes = ShapeTrack::of(take);
        opened.poses = poses_of(Timeline::recorded(take));
    } else {
        let completion = takes::completion(take, &character)?;
        let edited = edits::apply_to(&list_of(path), &list, take, completion, progress)?;
        opened.poses = poses_of(Some(edited.timeline()));
        (opened.markers, opened.segments, opened.notes) = (edited.markers, edited.segments, edited.notes);
        opened.shapes = edited.shapes;
    }
    if opened.poses.is_empty() {
        return Err(Failure::input(format!("{} holds no pose", path.display()), "record it again"));
    }
    (opened.driven, opened.bone_of_curve) = moved_by_joints(take, &character.skeleton, &opened.curves);
    Ok(OpenedTake { list, character, ..opened })
}

fn poses_of(timeline: Option<Timeline<'_>>) -> Vec<(f64, PackedPose)> {
    let Some(timeline) = timeline else { return Vec::new() };
    (0..timeline.len()).filter_map(|index| timeline.get(index)).map(|(time, pose)| (time, pose.clone())).collect()
}

fn saved_list(path: &Path) -> Result<EditList, Failure> {
    let beside = list_of(path);
    let name = files::name_of(path);
    if !beside.exists() {
        return Ok(EditList::new(&name));
    }
    let list = edits::read(&beside)?;
    // Somebody's list of another take.
    Ok(if list.take == name { list } else { EditList::new(&name) })
}

/// The character that it was recorded with; without it, its bare bones.
fn character_of(
    path: &Path,
    take: &Take,
    notes: &mut Vec<String>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Arc<LoadedCharacter>, Failure> {
    let skeleton = take
        .skeleton()
        .ok_or_else(|| Failure::input(format!("{} holds no skeleton", path.display()), "record it with a character"))?;
    let recorded = &take.header().character_name;
    let why = match characters::find_for_take(path, recorded, progress) {
        Ok(found) if found.character.skeleton == *skeleton => return Ok(Arc::new(found.character)),
        Ok(_) => "is another one now".to_owned(),
        Err(failure) => format!("is not found ({})", failure.what),
    };
    notes.push(format!("the character {recorded:?} that it was recorded with {why}; only its bones are shown"));
    Ok(Arc::new(LoadedCharacter::bare(recorded, recorded, skeleton.clone())))
}

/// Where the edited take begins on the recording's clock.
fn begins(edits: &[Edit]) -> Option<f64> {
    edits.iter().try_fold(0.0, |begins, edit| match edit {
        Edit::Trim { from, .. } => Some(begins + from.max(0.0)),
        Edit::Retime { .. } | Edit::Loop { .. } => None,
        _ => Some(begins),
    })
}

/// For each bone, whether a joint turned it; the bone that each curve's part moves, by the last mapping.
fn moved_by_joints(take: &Take, skeleton: &Skeleton, curves: &Curves) -> (Vec<bool>, Vec<Option<usize>>) {
    let mut driven = vec![false; skeleton.len()];
    let mapping = take.records().iter().rev().find_map(|record| match record {
        Record::Mapping(mapping) => Some(mapping),
        _ => None,
    });
    let bone_of = |part| skeleton.find(&mapping?.entries.iter().find(|entry| entry.part == part)?.bone);
    let bones: Vec<Option<usize>> = curves.joints.iter().map(|joint| bone_of(joint.part)).collect();
    bones.iter().flatten().for_each(|&bone| driven[bone] = true);
    let of = |part| mapping?.shared.iter().find(|joint| joint.part == part);
    for (bone, _) in curves.joints.iter().filter_map(|joint| of(joint.part)).flat_map(|joint| &joint.bones) {
        skeleton.find(bone).into_iter().for_each(|bone| driven[bone] = true);
    }
    (driven, bones)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trims_add_up_and_other_clocks_are_not_guessed() {
        let trim = |from| Edit::Trim { from, to: 9.0 };
        assert_eq!(begins(&[]), Some(0.0));
        assert_eq!(begins(&[trim(1.0), Edit::Mirror, trim(0.5)]), Some(1.5));
        assert_eq!(begins(&[trim(1.0), Edit::Retime { speed: 2.0 }]), None);
    }
}
