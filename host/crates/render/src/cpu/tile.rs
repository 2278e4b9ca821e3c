//! The picture in tiles: which triangles touch one, what is visible in it, and its pixels.

use glam::{DVec2, Vec3};

use super::raster::ScreenTriangle;
use super::{background, mesh, overlay, present};
use crate::bone_shape::OverlayVertex;
use crate::contact_shadow::ContactShadow;
use crate::uniforms::Uniforms;
use crate::{MeshView, Samples};

const TILE: usize = 64;
const NOTHING: u32 = u32::MAX;

/// Where the samples are in a pixel; four as in Vulkan and Direct3D.
const ONE: [[f64; 2]; 1] = [[0.5, 0.5]];
const FOUR: [[f64; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];

/// Everything a tile needs.
pub(crate) struct Frame<'a> {
    pub(crate) uniforms: &'a Uniforms,
    pub(crate) shadow: &'a ContactShadow,
    pub(crate) mesh: MeshView<'a>,
    /// For each triangle of the mesh, its index in `paints`, or `NO_MATERIAL`.
    pub(crate) paint_of: &'a [u32],
    pub(crate) paints: &'a [mesh::Paint<'a>],
    pub(crate) skin: Vec<ScreenTriangle>,
    /// Drawn over the skin, the farthest first.
    pub(crate) blended: Vec<ScreenTriangle>,
    pub(crate) bones: Vec<ScreenTriangle>,
    pub(crate) overlay: &'a [OverlayVertex],
    pub(crate) samples: Samples,
    pub(crate) size: [u32; 2],
}

/// Indices into `skin`, `blended` and `bones`, in drawing order.
#[derive(Clone, Default)]
pub(crate) struct Bin {
    skin: Vec<u32>,
    blended: Vec<u32>,
    bones: Vec<u32>,
}

/// For each sample of each pixel, the index of a triangle or `NOTHING`, and the depth.
type Visible<const S: usize> = (Vec<[u32; S]>, Vec<[f32; S]>);

/// Pixels x0..x1, y0..y1 of a tile.
#[derive(Clone, Copy)]
struct Area {
    x: [usize; 2],
    y: [usize; 2],
}

impl Area {
    fn of_tile(index: usize, size: [u32; 2]) -> Self {
        let across = (size[0] as usize).div_ceil(TILE);
        let (column, row) = (index % across, index / across);
        let end = |tile: usize, side: u32| ((tile + 1) * TILE).min(side as usize);
        Self { x: [column * TILE, end(column, size[0])], y: [row * TILE, end(row, size[1])] }
    }

    fn width(&self) -> usize {
        self.x[1] - self.x[0]
    }

    /// The centre of a pixel of the area.
    fn center(&self, pixel: usize) -> [f32; 2] {
        [self.x[0] + pixel % self.width(), self.y[0] + pixel / self.width()].map(|corner| corner as f32 + 0.5)
    }

    fn pixels(&self) -> usize {
        self.width() * (self.y[1] - self.y[0])
    }

    /// The area that a triangle may touch; possibly empty.
    fn touched(&self, [low, high]: [DVec2; 2]) -> Self {
        let clamp = |value: f64, range: [usize; 2]| value.clamp(range[0] as f64, range[1] as f64) as usize;
        Self {
            x: [clamp(low.x.floor(), self.x), clamp(high.x.floor() + 1.0, self.x)],
            y: [clamp(low.y.floor(), self.y), clamp(high.y.floor() + 1.0, self.y)],
        }
    }
}

/// Sorts triangles into tiles.
pub(crate) fn bin(frame: &Frame) -> Vec<Bin> {
    let across = (frame.size[0] as usize).div_ceil(TILE);
    let down = (frame.size[1] as usize).div_ceil(TILE);
    let mut bins = vec![Bin::default(); across * down];
    let whole = Area { x: [0, frame.size[0] as usize], y: [0, frame.size[1] as usize] };
    let mut sort = |triangles: &[ScreenTriangle], list: fn(&mut Bin) -> &mut Vec<u32>| {
        for (index, triangle) in triangles.iter().enumerate() {
            let touched = whole.touched(triangle.bounds);
            if touched.x[0] >= touched.x[1] || touched.y[0] >= touched.y[1] {
                continue;
            }
            for row in touched.y[0] / TILE..=(touched.y[1] - 1) / TILE {
                for column in touched.x[0] / TILE..=(touched.x[1] - 1) / TILE {
                    list(&mut bins[row * across + column]).push(index as u32);
                }
            }
        }
    };
    sort(&frame.skin, |bin| &mut bin.skin);
    sort(&frame.blended, |bin| &mut bin.blended);
    sort(&frame.bones, |bin| &mut bin.bones);
    bins
}

/// Assembles the tiles.
pub(crate) fn assemble(tiles: &[Vec<[u8; 4]>], size: [u32; 2]) -> Vec<u8> {
    let width = size[0] as usize;
    let mut rgba = vec![0_u8; width * size[1] as usize * 4];
    for (index, tile) in tiles.iter().enumerate() {
        let area = Area::of_tile(index, size);
        for (row, pixels) in tile.chunks_exact(area.width()).enumerate() {
            let start = ((area.y[0] + row) * width + area.x[0]) * 4;
            rgba[start..start + pixels.len() * 4].copy_from_slice(pixels.as_flattened());
        }
    }
    rgba
}

impl Frame<'_> {
    /// The pixels of one tile, row by row.
    pub(crate) fn draw_tile(&self, index: usize, bin: &Bin) -> Vec<[u8; 4]> {
        let area = Area::of_tile(index, self.size);
        match self.samples {
            Samples::One => self.draw(area, bin, &ONE),
            Samples::Four => self.draw(area, bin, &FOUR),
        }
    }

    fn draw<const S: usize>(&self, area: Area, bin: &Bin, samples: &[[f64; 2]; S]) -> Vec<[u8; 4]> {
        let (seen, depths) = self.visible(area, bin, samples);
        let mut light = self.shade(area, &seen);
        self.blend(area, bin, samples, &depths, &mut light);
        self.draw_bones(area, bin, samples, &mut light);
        let mut pixels = Vec::with_capacity(area.pixels());
        for y in area.y[0]..area.y[1] {
            for x in area.x[0]..area.x[1] {
                let samples = &light[(y - area.y[0]) * area.width() + x - area.x[0]];
                let mean = samples.iter().sum::<Vec3>() / S as f32;
                let [r, g, b] = present::fragment(mean, [x as f32 + 0.5, y as f32 + 0.5]);
                pixels.push([r, g, b, 255]);
            }
        }
        pixels
    }

    /// The nearest skin triangle at every sample, and its depth.
    fn visible<const S: usize>(&self, area: Area, bin: &Bin, samples: &[[f64; 2]; S]) -> Visible<S> {
        let mut seen = vec![[NOTHING; S]; area.pixels()];
        let mut depths = vec![[1.0_f32; S]; area.pixels()];
        for &index in &bin.skin {
            let triangle = &self.skin[index as usize];
            let paint = &self.paints[self.paint_of[triangle.source as usize] as usize];
            let shows = |pixel| !paint.has_holes() || paint.shows(&self.surface(triangle, area.center(pixel)));
            for_samples(triangle, area, samples, |pixel, sample, at| {
                let depth = triangle.depth(at);
                if depth < depths[pixel][sample] && shows(pixel) {
                    depths[pixel][sample] = depth;
                    seen[pixel][sample] = index;
                }
            });
        }
        (seen, depths)
    }

    /// What is seen of a triangle at a pixel's centre, as with multisampling.
    fn surface(&self, triangle: &ScreenTriangle, [x, y]: [f32; 2]) -> mesh::Surface {
        let even = |at: f32| 2.0 * (0.5 * at).floor() + 0.5;
        let (left, top) = (even(x), even(y));
        let weights = [[x, y], [left, top], [left + 1.0, top], [left, top + 1.0]]
            .map(|[x, y]| triangle.source_weights(triangle.coordinates(f64::from(x), f64::from(y))));
        mesh::interpolate(&self.mesh, triangle.source, triangle.front, weights)
    }

    /// The light at every sample; a triangle is shaded once per pixel, at the pixel's centre, as with multisampling.
    fn shade<const S: usize>(&self, area: Area, seen: &[[u32; S]]) -> Vec<[Vec3; S]> {
        let mut light = Vec::with_capacity(seen.len());
        for (pixel, samples) in seen.iter().enumerate() {
            let center = area.center(pixel);
            let mut colors = [Vec3::ZERO; S];
            for sample in 0..S {
                let same = samples[..sample].iter().position(|earlier| *earlier == samples[sample]);
                colors[sample] = match (same, samples[sample]) {
                    (Some(earlier), _) => colors[earlier],
                    (None, NOTHING) => background::fragment(self.uniforms, self.shadow, center),
                    (None, index) => {
                        let triangle = &self.skin[index as usize];
                        let paint = self.paint_of[triangle.source as usize] as usize;
                        mesh::fragment(self.uniforms, &self.paints[paint], &self.surface(triangle, center)).truncate()
                    }
                };
            }
            light.push(colors);
        }
        light
    }

    /// Blends what is not opaque over the light behind it.
    fn blend<const S: usize>(
        &self,
        area: Area,
        bin: &Bin,
        samples: &[[f64; 2]; S],
        depths: &[[f32; S]],
        light: &mut [[Vec3; S]],
    ) {
        for &index in &bin.blended {
            let triangle = &self.blended[index as usize];
            let paint = &self.paints[self.paint_of[triangle.source as usize] as usize];
            // The samples of a pixel follow one another.
            let mut shaded = (usize::MAX, None);
            for_samples(triangle, area, samples, |pixel, sample, at| {
                if triangle.depth(at) >= depths[pixel][sample] {
                    return;
                }
                if shaded.0 != pixel {
                    let surface = self.surface(triangle, area.center(pixel));
                    let color = paint.shows(&surface).then(|| mesh::fragment(self.uniforms, paint, &surface));
                    shaded = (pixel, color);
                }
                if let Some(color) = shaded.1 {
                    let below = &mut light[pixel][sample];
                    *below = below.lerp(color.truncate(), color.w);
                }
            });
        }
    }

    fn draw_bones<const S: usize>(&self, area: Area, bin: &Bin, samples: &[[f64; 2]; S], light: &mut [[Vec3; S]]) {
        for &index in &bin.bones {
            let triangle = &self.bones[index as usize];
            // Flat: the first corner's colour is used.
            let color = overlay::vertex(self.uniforms, &self.overlay[triangle.source as usize * 3]);
            for_samples(triangle, area, samples, |pixel, sample, _| {
                let below = &mut light[pixel][sample];
                *below = below.lerp(color.truncate(), color.w);
            });
        }
    }
}

/// Calls `hit(pixel in the area, sample, barycentric coordinates)` for every sample that the triangle covers.
fn for_samples<const S: usize>(
    triangle: &ScreenTriangle,
    area: Area,
    samples: &[[f64; 2]; S],
    mut hit: impl FnMut(usize, usize, [f64; 3]),
) {
    let touched = area.touched(triangle.bounds);
    for y in touched.y[0]..touched.y[1] {
        for x in touched.x[0]..touched.x[1] {
            let pixel = (y - area.y[0]) * area.width() + x - area.x[0];
            for (sample, offset) in samples.iter().enumerate() {
                if let Some(at) = triangle.covers(x as f64 + offset[0], y as f64 + offset[1]) {
                    hit(pixel, sample, at);
                }
            }
        }
    }
}
