//! Edges, cheapest first.

use super::collapse::{Bench, Refusal, leaves_gap, placement};
use super::quadric::Quadric;
use super::surface::Surface;

/// Rounds over all edges after some were refused: what was in the way may be gone.
const MOST_ROUNDS: usize = 6;
/// Pairs of triangles tested per input triangle before a mesh counts as too tangled. Sound meshes need 100.
const PAIRS_PER_TRIANGLE: usize = 1500;
const PAIRS_FOR_FEW: usize = 10_000_000;

/// How collapsing ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ended {
    pub(super) refused_by_topology: usize,
    pub(super) refused_by_geometry: usize,
    pub(super) out_of_work: bool,
    pub(super) cancelled: bool,
}

/// An edge in the queue.
#[derive(Clone, Copy, Debug)]
struct Entry {
    ends: [u32; 2],
    /// Sum of how often the ends had changed when this was queued, above two bits of attempt.
    version: u32,
}

impl Entry {
    fn attempt(&self) -> u8 {
        (self.version & 3) as u8
    }
}

/// Low bits of a cost, in single precision, that are ignored: costs less than 1.6 % apart count as equal.
const BLUR: u32 = 17;

/// Edges in buckets of about equal cost, last in first out. A binary heap takes twice as long, and its order gives no
/// better result.
#[derive(Debug, Default)]
struct Queue {
    buckets: Vec<Vec<Entry>>,
    /// All buckets before this one are empty.
    first: usize,
}

impl Queue {
    fn push(&mut self, cost: f64, entry: Entry) {
        let bucket = ((cost.max(0.0) as f32).to_bits() >> BLUR) as usize;
        if bucket >= self.buckets.len() {
            self.buckets.resize_with(bucket + 1, Vec::new);
        }
        self.buckets[bucket].push(entry);
        self.first = self.first.min(bucket);
    }

    fn pop(&mut self) -> Option<Entry> {
        while let Some(bucket) = self.buckets.get_mut(self.first) {
            if let Some(entry) = bucket.pop() {
                return Some(entry);
            }
            self.first += 1;
        }
        None
    }

    fn clear(&mut self) {
        self.buckets.iter_mut().for_each(Vec::clear);
        self.first = 0;
    }
}

/// A surface being simplified.
#[derive(Debug)]
pub(super) struct Collapser<'a> {
    pub(super) surface: &'a mut Surface,
    /// For each vertex, around the surface's centre.
    pub(super) quadrics: Vec<Quadric>,
    /// For each vertex, the distance to the nearest sheet that faces it.
    pub(super) gaps: Vec<f64>,
    /// For each vertex, the one it was collapsed into; itself if it still exists.
    pub(super) into: Vec<u32>,
    versions: Vec<u32>,
    queue: Queue,
}

impl<'a> Collapser<'a> {
    pub(super) fn new(surface: &'a mut Surface, quadrics: Vec<Quadric>, gaps: Vec<f64>) -> Self {
        let into = (0..quadrics.len() as u32).collect();
        let versions = vec![0; quadrics.len()];
        Self { surface, quadrics, gaps, into, versions, queue: Queue::default() }
    }

    /// Collapses edges until `target` vertices are left or no edge may be collapsed. `report` is called now and then,
    /// and stops the work by returning `false`.
    pub(super) fn run(&mut self, target: usize, mut report: impl FnMut(usize) -> bool) -> Ended {
        let mut bench = Bench::new(self.surface);
        let most_pairs = PAIRS_PER_TRIANGLE.saturating_mul(self.surface.triangles.len()) + PAIRS_FOR_FEW;
        let mut ended = Ended::default();
        for _ in 0..MOST_ROUNDS {
            let before = self.surface.live_vertices;
            self.enter_all_edges();
            ended = Ended::default();
            let mut popped = 0_usize;
            while self.surface.live_vertices > target
                && let Some(entry) = self.queue.pop()
            {
                popped += 1;
                if popped.is_multiple_of(1024) && !report(self.surface.live_vertices) {
                    return Ended { cancelled: true, ..ended };
                }
                if bench.pairs > most_pairs {
                    return Ended { out_of_work: true, ..ended };
                }
                match self.try_edge(&mut bench, &entry) {
                    Ok(()) | Err(Refusal::Stale) => {}
                    Err(Refusal::Topology) => ended.refused_by_topology += 1,
                    Err(Refusal::Geometry) => {
                        ended.refused_by_geometry += usize::from(entry.attempt() == 0);
                        self.enter(entry.ends, entry.attempt() + 1);
                    }
                }
            }
            let live = self.surface.live_vertices;
            // Another round is not worth it if this one removed less than a hundredth of the vertices.
            if live <= target || 100 * (before - live) < before {
                break;
            }
        }
        ended
    }

    fn try_edge(&mut self, bench: &mut Bench, entry: &Entry) -> Result<(), Refusal> {
        let [kept, lost] = entry.ends;
        if self.version(entry.ends) != entry.version >> 2
            || self.into[kept as usize] != kept
            || self.into[lost as usize] != lost
        {
            return Err(Refusal::Stale);
        }
        let joined = self.quadrics[kept as usize].joined(&self.quadrics[lost as usize]);
        let Some((_, place)) = self.placement(entry.ends, &joined, entry.attempt()) else { return Err(Refusal::Stale) };
        let gap = self.gaps[kept as usize].min(self.gaps[lost as usize]);
        if entry.attempt() == 0 {
            bench.keeps_topology(self.surface, entry.ends)?;
        }
        if leaves_gap(&joined, place, self.surface.centre, gap) {
            return Err(Refusal::Geometry);
        }
        bench.keeps_shape(self.surface, entry.ends, place)?;
        self.surface.collapse(kept, lost, place);
        self.quadrics[kept as usize] = joined;
        self.gaps[kept as usize] = gap;
        self.into[lost as usize] = kept;
        self.versions[kept as usize] += 1;
        let mut others: Vec<u32> =
            self.surface.star(kept).flat_map(|t| self.surface.triangles[t as usize]).filter(|&v| v != kept).collect();
        others.sort_unstable();
        others.dedup();
        others.into_iter().for_each(|v| self.enter([kept.min(v), kept.max(v)], 0));
        Ok(())
    }

    fn enter_all_edges(&mut self) {
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(3 * self.surface.live_triangles);
        for t in (0..self.surface.triangles.len() as u32).filter(|&t| self.surface.is_alive(t)) {
            let [a, b, c] = self.surface.triangles[t as usize];
            edges.extend([[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]]);
        }
        edges.sort_unstable();
        edges.dedup();
        self.queue.clear();
        edges.into_iter().for_each(|ends| self.enter(ends, 0));
    }

    fn enter(&mut self, ends: [u32; 2], attempt: u8) {
        let joined = self.quadrics[ends[0] as usize].joined(&self.quadrics[ends[1] as usize]);
        if let Some((cost, _)) = self.placement(ends, &joined, attempt) {
            let version = self.version(ends) << 2 | u32::from(attempt);
            self.queue.push(cost, Entry { ends, version });
        }
    }

    fn placement(&self, ends: [u32; 2], joined: &Quadric, attempt: u8) -> Option<(f64, glam::DVec3)> {
        placement(joined, ends.map(|v| self.surface.positions[v as usize]), self.surface.centre, attempt)
    }

    fn version(&self, ends: [u32; 2]) -> u32 {
        self.versions[ends[0] as usize] + self.versions[ends[1] as usize]
    }
}
