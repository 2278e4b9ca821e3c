//! Takes: what a puppet sent, how it was interpreted and the resulting poses; recording, replay, export.
//!
//! A take holds raw samples with the device's own times, the puppet's topology, calibration and mapping, the
//! character's skeleton, the solved poses to the last bit, and what was lost. From samples to a take, and from the take
//! to a file for other programs:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_rig::{Bone, Calibration, PartUid, RawSample, SensorState, Skeleton, Transform, propose, skeleton_puppet};
//! use armature_take::{ExportSettings, Header, PoseSource, Take, TakeWriter, export_bvh};
//!
//! let arm = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
//! let skeleton = Skeleton::new(vec![arm])?;
//! let (tree, _) = skeleton_puppet(&skeleton, 4096, |part| PartUid([part as u8; 12]))?;
//! let mut writer = TakeWriter::new(Vec::new(), &Header::default())?;
//! writer.skeleton(&skeleton)?;
//! writer.topology(0, &tree)?;
//! writer.calibration(&Calibration::for_tree(&tree))?;
//! writer.mapping(&propose(&tree, &skeleton).mapping)?;
//! for step in 0..120_u16 {
//!     let (counts, states) = (vec![0, 10 * step, 0], vec![SensorState::Ok; 3]);
//!     let device_micros = 8_333 * u64::from(step);
//!     writer.sample(&RawSample { device_micros, sequence: step.into(), epoch: 0, counts, states }, None)?;
//! }
//! let (take, report) = Take::read(&writer.finish()?)?;
//! assert!(report.is_whole());
//! let settings = ExportSettings { poses: PoseSource::SolvedAgain, ..ExportSettings::default() };
//! let exported = export_bvh(&take, &settings, &mut |_stage, _done| ControlFlow::Continue(()))?;
//! assert_eq!(exported.motion.resampled.motion.frames.len(), 30);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`file`] | [`TakeWriter`] appends records, [`Take::read`] reads them; the format byte by byte |
//! | [`replay`](mod@replay) | [`replay()`] solves every sample again; [`verify`] compares each pose bit for bit |
//! | [`edit`] | [`apply_edits`]: trim, overdub, smooth and so on, by a text file beside the takes |
//! | [`curves`](mod@curves) | [`curves()`]: what every joint said over time, raw and filtered, in so many steps |
//! | [`compare`](mod@compare) | [`compare()`]: the poses of one take against those of another |
//! | [`time`] | [`Timeline::recorded`] puts poses on one timeline; [`resample`] brings them to a constant rate; [`FrameRate`] and [`Timecode`] name frames |
//! | [`keys`] | [`reduce_keys`]: fewer keys, with a bound on what that changes |
//! | [`export`] | [`export_bvh`] and [`export_glb`]; [`bvh_of`], [`glb_of`], [`fbx_of`], [`usd_of`] and [`vrma_of`] of a motion |
//! | [`dressed`] | [`Dress::apply`]: another program's names of bones, rest pose and first frame |
//! | [`data`] | [`csv_of`], [`npz_of`] and [`mcap_of`]: samples, angles and poses as numbers |
//! | [`shapes`] | [`ShapeTrack::of`] a take: the weights of blend shapes over its time |
//! | [`summary`] | [`summarize`]: counts, times and losses |
//! | [`receipt`](mod@receipt) | [`receipt()`]: what the measurement is worth: rate, jitter, losses, lag, drift |

pub mod compare;
pub mod curves;
pub mod data;
pub mod dressed;
pub mod edit;
pub mod export;
pub mod file;
pub mod keys;
pub mod receipt;
pub mod replay;
pub mod shapes;
pub mod summary;
pub mod time;

pub use compare::{CompareError, Comparison, PoseDifference, Tolerance, compare};
pub use curves::{Curves, JointCurve, Span, curves};
pub use data::{McapError, csv_of, csv_of_motion, mcap_of, npz_of};
pub use dressed::{Dress, Dressed};
pub use edit::{Edit, EditError, EditList, EditListError, Edited, apply_edits};
pub use export::{
    ExportError, ExportSettings, Exported, MotionTakeError, PoseSource, Surface, TakeMotion, bvh_of, check_surface,
    edited_motion, export_bvh, export_glb, fbx_of, glb_of, motion_take, take_motion, usd_of, vrma_of,
};
pub use file::{
    ClockFault, Event, EventKind, Header, InverseKinematicsHeader, MAGIC, MAJOR_VERSION, MAX_PARTS, MAX_PAYLOAD_BYTES,
    MINOR_VERSION, PREAMBLE_BYTES, PackedPose, PayloadError, Problem, RECORD_OVERHEAD_BYTES, ReadReport, Record,
    RecordKind, Sample, ShapeSetting, Take, TakeError, TakeWriter, Topology, Totals, UnknownRecords, WriteError,
};
pub use keys::{KeyError, KeyReport, KeySettings, ReducedKeys, reduce_keys};
pub use receipt::{Arrival, FilterLag, Jitter, LAG_AT_SPEEDS, Posing, Receipt, receipt};
pub use replay::{
    Completing, Difference, ReplayError, ReplaySummary, Replayed, SettingError, Verification, replay, solve_again,
    solve_on_ground, verify, verify_completed, with_ground,
};
pub use shapes::ShapeTrack;
pub use summary::{SilentJoint, Summary, summarize};
pub use time::{
    ClockFaults, ClockRestart, FrameRate, FrameRateError, HeldGap, ResampleError, ResampleSettings, Resampled,
    Timecode, TimecodeError, Timeline, TimelineReport, resample,
};
