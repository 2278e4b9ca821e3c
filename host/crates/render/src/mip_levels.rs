//! Smaller versions of an image, for surfaces on which its texels are smaller than pixels.

use crate::Picture;
use crate::srgb::{linear_from_srgb, srgb_from_linear};

/// The image halved again and again down to one texel, without the image itself. Each texel is the mean of four of the
/// level before, of colours in linear light; `is_srgb`: whether they are stored as sRGB. Opacity is always linear.
pub(crate) fn mip_levels(picture: &Picture, is_srgb: bool) -> Vec<Picture> {
    let linear: [f32; 256] = std::array::from_fn(|byte| {
        let value = byte as f32 / 255.0;
        if is_srgb { linear_from_srgb(value) } else { value }
    });
    let mut levels: Vec<Picture> = Vec::new();
    loop {
        let above = levels.last().unwrap_or(picture);
        if above.width <= 1 && above.height <= 1 {
            return levels;
        }
        levels.push(halved(above, &linear, is_srgb));
    }
}

fn halved(above: &Picture, linear: &[f32; 256], is_srgb: bool) -> Picture {
    let [width, height] = [above.width, above.height].map(|side| (side / 2).max(1));
    let mut rgba = Vec::with_capacity(4 * width as usize * height as usize);
    let texel = |x: u32, y: u32| {
        let start = 4 * (y.min(above.height - 1) as usize * above.width as usize + x.min(above.width - 1) as usize);
        &above.rgba[start..start + 4]
    };
    for y in 0..height {
        for x in 0..width {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| texel(2 * x + dx, 2 * y + dy));
            for channel in 0..3 {
                let mean = 0.25 * four.iter().map(|texel| linear[usize::from(texel[channel])]).sum::<f32>();
                let stored = if is_srgb { srgb_from_linear(mean) } else { mean };
                rgba.push((255.0 * stored + 0.5) as u8);
            }
            let opacity: u32 = four.iter().map(|texel| u32::from(texel[3])).sum();
            rgba.push(((opacity + 2) / 4) as u8);
        }
    }
    Picture { width, height, rgba }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_means_of_light_down_to_one_texel() {
        // Black and white columns, half of them clear.
        let rgba = (0..5 * 4).flat_map(|k| if k % 5 % 2 == 0 { [0, 0, 0, 255] } else { [255, 255, 255, 0] }).collect();
        let picture = Picture { width: 5, height: 4, rgba };
        let [srgb, plain] = [true, false].map(|is_srgb| mip_levels(&picture, is_srgb));
        let sizes: Vec<[u32; 2]> = srgb.iter().map(|level| [level.width, level.height]).collect();
        assert_eq!(sizes, [[2, 2], [1, 1]]);
        // Half the light is 188 as sRGB.
        assert_eq!(srgb[0].rgba[..4], [188, 188, 188, 128]);
        assert_eq!(plain[1].rgba, [128, 128, 128, 128]);
        assert!(mip_levels(&srgb[1], true).is_empty());
    }

    #[test]
    fn even_colours_stay_as_they_are() {
        for byte in 0..=255 {
            let picture = Picture { width: 2, height: 2, rgba: vec![byte; 16] };
            for is_srgb in [true, false] {
                assert_eq!(mip_levels(&picture, is_srgb)[0].rgba, [byte; 4], "{byte} {is_srgb}");
            }
        }
    }
}
