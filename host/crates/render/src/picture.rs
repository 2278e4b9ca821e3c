//! A finished picture and its file format.

use image::ImageEncoder as _;
use image::codecs::png::PngEncoder;

use crate::RenderError;

/// A picture in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// 4·width·height bytes: sRGB and alpha (always 255), rows from the top.
    pub rgba: Vec<u8>,
}

/// The longest side of a picture made on the CPU.
pub(crate) const CPU_SIDE_LIMIT: u32 = 16_384;

pub(crate) fn check_size(size: [u32; 2], limit: u32) -> Result<(), RenderError> {
    if size.iter().all(|side| (1..=limit).contains(side)) {
        Ok(())
    } else {
        Err(RenderError::BadSize { width: size[0], height: size[1], limit })
    }
}

/// The bytes of a PNG file.
pub fn encode_png(picture: &Picture) -> Result<Vec<u8>, RenderError> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(
        &picture.rgba,
        picture.width,
        picture.height,
        image::ExtendedColorType::Rgba8,
    )?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_reads_back_as_it_was() {
        let picture = Picture { width: 3, height: 2, rgba: (0..24).collect() };
        let read = image::load_from_memory(&encode_png(&picture).unwrap()).unwrap().into_rgba8();
        assert_eq!((read.width(), read.height(), read.into_raw()), (3, 2, picture.rgba));
    }

    #[test]
    fn no_pixels_is_an_error() {
        assert!(matches!(check_size([0, 5], 10), Err(RenderError::BadSize { .. })));
        assert!(matches!(check_size([5, 11], 10), Err(RenderError::BadSize { .. })));
    }
}
