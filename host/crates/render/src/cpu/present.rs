//! Twin of `shader/present.wgsl`.

use glam::Vec3;

/// A pixel's bytes; `pixel` is its centre, from the upper left.
pub(crate) fn fragment(light: Vec3, pixel: [f32; 2]) -> [u8; 3] {
    let noise = dither(pixel);
    light.to_array().map(|l| {
        // A float cast rounds towards zero and turns NaN into zero.
        ((srgb_from_linear(shoulder(l)) + noise).clamp(0.0, 1.0) * 255.0 + 0.5) as u8
    })
}

fn shoulder(light: f32) -> f32 {
    if light > 0.7 { 1.0 - 0.3 * ((0.7 - light) / 0.3).exp() } else { light }
}

fn srgb_from_linear(light: f32) -> f32 {
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

fn dither([x, y]: [f32; 2]) -> f32 {
    let fract = |value: f32| value - value.floor();
    (fract(52.982_92 * fract(x * 0.067_110_56 + y * 0.005_837_15)) - 0.5) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::srgb::linear_from_srgb;

    #[test]
    fn colours_below_the_shoulder_come_back() {
        for byte in 0..=200_u8 {
            let light = linear_from_srgb(f32::from(byte) / 255.0);
            let back = fragment(Vec3::splat(light), [10.5, 20.5])[0];
            assert!(light > 0.7 || byte.abs_diff(back) <= 1, "{byte} came back as {back}");
        }
    }

    #[test]
    fn brighter_light_is_never_darker() {
        let curve: Vec<f32> = (0..400).map(|i| srgb_from_linear(shoulder(i as f32 * 0.01))).collect();
        assert!(curve.windows(2).all(|pair| pair[0] <= pair[1]) && curve[399] <= 1.0);
    }
}
