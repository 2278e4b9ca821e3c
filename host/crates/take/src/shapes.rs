//! The weights of blend shapes over a take's time.

use armature_rig::{Filter, Skeleton, StreamSolver};

use crate::file::{Record, Take};
use crate::replay::{filtered, settle};
use crate::time::DeviceClock;

/// Weights of blend shapes at the times of samples, microseconds since the take's first. Between two samples they go along
/// a straight line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapeTrack {
    names: Vec<String>,
    /// Increasing times, and one weight per name; `None` as long as nothing set it: the character's own.
    moments: Vec<(i64, Vec<Option<f32>>)>,
}

impl ShapeTrack {
    /// The weights that joints and hands gave to shapes, solved again from the samples. `None` for a take that sets no
    /// shape.
    pub fn of(take: &Take) -> Option<Self> {
        Self::solve(take, None)
    }

    /// The same with another filter on every joint.
    pub(crate) fn solve(take: &Take, filter: Option<Filter>) -> Option<Self> {
        let mut names: Vec<String> = Vec::new();
        for record in take.records() {
            let own: Vec<&str> = match record {
                Record::Shape(setting) => vec![&setting.name],
                Record::Mapping(mapping) => mapping.shapes.iter().map(|drive| drive.shape.as_str()).collect(),
                _ => Vec::new(),
            };
            for name in own {
                if !names.iter().any(|known| known == name) {
                    names.push(name.to_owned());
                }
            }
        }
        if names.is_empty() {
            return None;
        }
        let skeleton = take.skeleton().cloned().or_else(|| Skeleton::new(Vec::new()).ok())?;
        let mut solver = StreamSolver::new(skeleton);
        let mut clock = DeviceClock::new(take);
        let mut moments = Vec::new();
        for record in take.records() {
            match record {
                Record::Calibration(calibration) => solver.set_calibration(filtered(calibration, filter)),
                // Where the character stands and what swings says nothing of its shapes.
                Record::Ground(_) | Record::Dynamics(_) => {}
                Record::Sample(sample) => {
                    let micros = clock.next_sample();
                    // A sample that has no pose changes no weight either.
                    let _ = solver.solve(&sample.raw);
                    moments.push((micros, names.iter().map(|name| solver.shapes().get(name)).collect()));
                }
                other => {
                    let _ = settle(&mut solver, other);
                }
            }
        }
        moments.sort_by_key(|(micros, _)| *micros);
        moments.dedup_by_key(|(micros, _)| *micros);
        Some(Self { names, moments })
    }

    /// The names of the shapes.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The shapes that are set at a time, seconds since the take's first sample, and their weights. Before the first sample
    /// and after the last, those of that one.
    pub fn at(&self, seconds: f64) -> impl Iterator<Item = (&str, f32)> {
        let row = self.row(seconds * 1e6);
        self.names.iter().zip(row).filter_map(|(name, weight)| Some((name.as_str(), weight?)))
    }

    fn row(&self, micros: f64) -> Vec<Option<f32>> {
        let after = self.moments.partition_point(|(time, _)| *time as f64 <= micros);
        let Some((time, before)) = after.checked_sub(1).map(|index| &self.moments[index]) else {
            return self.moments.first().map_or_else(|| vec![None; self.names.len()], |(_, row)| row.clone());
        };
        match self.moments.get(after) {
            Some((next, row)) => blend(before, row, (micros - *time as f64) / (*next - *time) as f64),
            None => before.clone(),
        }
    }

    /// What is between two times, which starts at zero.
    pub(crate) fn trim(&mut self, from: i64, to: i64) {
        let ends = [(from, self.row(from as f64)), (to, self.row(to as f64))];
        self.moments.retain(|(time, _)| *time > from && *time < to);
        let [start, end] = ends;
        self.moments.insert(0, start);
        if to > from {
            self.moments.push(end);
        }
        self.moments.iter_mut().for_each(|(time, _)| *time -= from);
    }

    /// Every time becomes another one, later times no earlier than former ones.
    pub(crate) fn retime(&mut self, at: impl Fn(&mut i64)) {
        self.moments.iter_mut().for_each(|(time, _)| at(time));
        self.moments.dedup_by_key(|(time, _)| *time);
    }

    /// The span several times in a row; the last `fade` of a round goes over into the first of the next. `ease`: from 0 to
    /// 1 as its argument does.
    pub(crate) fn repeat(&mut self, (first, last): (i64, i64), times: u32, fade: i64, ease: fn(f64) -> f64) {
        let round = last - first - fade;
        let one: Vec<(i64, Vec<Option<f32>>)> = self
            .moments
            .iter()
            .filter(|(time, _)| (first..first + round).contains(time))
            .map(|(time, row)| {
                let over = (*time - first) as f64 / fade.max(1) as f64;
                let row = if fade > 0 && over < 1.0 {
                    blend(&self.row((*time + round) as f64), row, ease(over))
                } else {
                    row.clone()
                };
                (*time - first, row)
            })
            .collect();
        let closing = if fade > 0 { one.first().map(|(_, row)| row.clone()) } else { Some(self.row(last as f64)) };
        self.moments = (0..i64::from(times))
            .flat_map(|n| one.iter().map(move |(time, row)| (time + n * round, row.clone())))
            .chain(closing.map(|row| (i64::from(times) * round, row)))
            .collect();
    }

    /// Left and right change places: `blinkLeft` and `blinkRight`, `Smile_L` and `Smile_R`. Names without a counterpart
    /// stay.
    pub(crate) fn mirror(&mut self) {
        let other_side = |name: &String| {
            let at = |other: &str| self.names.iter().position(|known| known == other);
            [("Left", "Right"), ("left", "right"), ("_L", "_R"), (".L", ".R"), ("_l", "_r"), (".l", ".r")]
                .into_iter()
                .flat_map(|(left, right)| [(left, right), (right, left)])
                .find_map(|(from, to)| name.contains(from).then(|| at(&name.replace(from, to))).flatten())
        };
        let source: Vec<usize> =
            self.names.iter().enumerate().map(|(own, name)| other_side(name).unwrap_or(own)).collect();
        for (_, row) in &mut self.moments {
            *row = source.iter().map(|&from| row[from]).collect();
        }
    }
}

fn blend(a: &[Option<f32>], b: &[Option<f32>], part: f64) -> Vec<Option<f32>> {
    let between = |a: f32, b: f32| (f64::from(a) + (f64::from(b) - f64::from(a)) * part) as f32;
    a.iter().zip(b).map(|(a, b)| a.zip(*b).map(|(a, b)| if part >= 1.0 { b } else { between(a, b) }).or(*a)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mirror_swaps_weights_of_left_and_right() {
        let names = ["blinkLeft", "blinkRight", "Smile_L", "Smile_R", "jaw", "wink_L"].map(str::to_owned).to_vec();
        let row = |numbers: [f32; 6]| numbers.map(Some).to_vec();
        let mut track = ShapeTrack { names, moments: vec![(0, row([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))] };
        track.mirror();
        assert_eq!(track.moments[0].1, row([0.2, 0.1, 0.4, 0.3, 0.5, 0.6]));
    }

    #[test]
    fn a_weight_that_nothing_set_yet_is_not_invented() {
        let moments = vec![(0, vec![None]), (1_000_000, vec![Some(1.0)]), (2_000_000, vec![Some(0.5)])];
        let track = ShapeTrack { names: vec!["jaw".into()], moments };
        let at = |seconds: f64| track.at(seconds).next().map(|(_, weight)| weight);
        assert_eq!([at(-1.0), at(0.5), at(1.0), at(1.5), at(7.0)], [None, None, Some(1.0), Some(0.75), Some(0.5)]);
        assert_eq!(ShapeTrack::default().at(0.0).count(), 0);
    }
}
