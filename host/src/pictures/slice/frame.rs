//! Where the plane of a slice is in its picture.

/// Free space around the mesh, relative to its size.
const AROUND: f64 = 0.07;

/// How the plane's coordinates map to the (oversampled) picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Corners of the plot: left, top, right, bottom, in pixels.
    pub(super) plot: [f32; 4],
    /// Size of a finished pixel in pixels, times the picture's own scale.
    pub(super) unit: f32,
    /// Pixels per mesh unit.
    pub(super) scale: f64,
    /// The plane's coordinates at the centre of the plot.
    pub(super) centre: [f64; 2],
}

impl Frame {
    /// The plot in a picture of this size, around a box.
    pub(super) fn fit(size: [u32; 2], low: [f64; 2], high: [f64; 2]) -> Self {
        let unit = size[1].min(size[0]) as f32 / 960.0;
        let plot = [96.0 * unit, 72.0 * unit, size[0] as f32 - 170.0 * unit, size[1] as f32 - 84.0 * unit];
        let room = [f64::from(plot[2] - plot[0]), f64::from(plot[3] - plot[1])];
        let across = |k: usize| ((high[k] - low[k]) * (1.0 + 2.0 * AROUND)).max(f64::MIN_POSITIVE);
        let scale = (room[0] / across(0)).min(room[1] / across(1));
        Self { plot, unit, scale, centre: [0, 1].map(|k| f64::midpoint(low[k], high[k])) }
    }

    fn middle(&self) -> [f64; 2] {
        [
            f64::midpoint(self.plot[0].into(), self.plot[2].into()),
            f64::midpoint(self.plot[1].into(), self.plot[3].into()),
        ]
    }

    /// The pixel position of a point of the plane.
    pub(super) fn place(&self, p: [f64; 2]) -> [f32; 2] {
        let [x, y] = self.middle();
        [(x + (p[0] - self.centre[0]) * self.scale) as f32, (y - (p[1] - self.centre[1]) * self.scale) as f32]
    }

    /// The point of the plane at a pixel position.
    pub(super) fn point(&self, place: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.middle();
        [self.centre[0] + (place[0] - x) / self.scale, self.centre[1] - (place[1] - y) / self.scale]
    }
}
