//! The colours of winding numbers.

use crate::pictures::ink::mix;

/// A winding number and its colour, sRGB: outside is nearly white, inside is warm, places wound around twice are red,
/// and inside-out ones are blue.
const STOPS: [(f64, [u8; 3]); 6] = [
    (-1.0, [0x1f, 0x4e, 0x9c]),
    (-0.5, [0x7f, 0xa9, 0xdb]),
    (0.0, [0xf3, 0xf3, 0xf1]),
    (1.0, [0xf0, 0xa0, 0x4b]),
    (2.0, [0xbf, 0x2a, 0x2a]),
    (3.0, [0x5a, 0x0c, 0x1e]),
];

/// Beyond these the colour stays the same.
pub(super) const LOWEST: f64 = STOPS[0].0;
pub(super) const HIGHEST: f64 = STOPS[STOPS.len() - 1].0;
/// Shown for NaN.
const UNKNOWN: [u8; 3] = [0xff, 0x00, 0xff];

/// The colour of a winding number, sRGB.
pub(super) fn color(winding: f64) -> [u8; 3] {
    if winding.is_nan() {
        return UNKNOWN;
    }
    let winding = winding.clamp(LOWEST, HIGHEST);
    let interval = STOPS.windows(2).find(|pair| winding <= pair[1].0);
    interval.map_or(UNKNOWN, |pair| {
        let ((from, a), (to, b)) = (pair[0], pair[1]);
        mix(a, b, (winding - from) / (to - from))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_have_their_colours_and_the_rest_lies_between() {
        for (winding, expected) in STOPS {
            assert_eq!(color(winding), expected);
        }
        assert_eq!(color(-7.0), STOPS[0].1);
        assert_eq!(color(99.0), STOPS[5].1);
        assert_eq!(color(f64::NAN), UNKNOWN);
        let between = color(0.5);
        assert!(between[0] >= 0xf0 && (0x4b..0xf1).contains(&between[2]), "{between:?}");
    }
}
