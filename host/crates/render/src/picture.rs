//! A picture in memory and its file formats.

use std::io::Cursor;

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;

use crate::RenderError;

/// A picture in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// 4·width·height bytes: sRGB and alpha (255 in pictures that are drawn here), rows from the top.
    pub rgba: Vec<u8>,
}

/// An encoded picture whose pixels need more bytes is a mistake that would only fill the memory.
const LARGEST_DECODED: usize = 512 << 20;
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
    let mut encoder = png::Encoder::new(&mut bytes, picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&picture.rgba)?;
    writer.finish()?;
    Ok(bytes)
}

/// Why an encoded picture could not be read.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// Its first bytes are those of another format.
    #[error("it is neither PNG nor JPEG")]
    OtherFormat,
    /// Damaged, or of a kind that PNG allows and the decoder does not support.
    #[error("as PNG it is damaged: {0}")]
    Png(#[from] png::DecodingError),
    /// Damaged, or of a kind that JPEG allows and the decoder does not support.
    #[error("as JPEG it is damaged: {0}")]
    Jpeg(String),
    /// More pixels per side than the caller accepts.
    #[error("its {width}×{height} pixels are more than {limit} per side")]
    TooLarge {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Longest side.
        limit: u32,
    },
}

/// Reads a PNG or JPEG file of at most `longest_side` pixels per side; its first bytes determine which. Grey and
/// indexed pictures become colour, 16 bits per channel become 8, and colour profiles are ignored: the result counts as
/// sRGB.
pub fn decode_picture(bytes: &[u8], longest_side: u32) -> Result<Picture, DecodeError> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        decode_png(bytes, longest_side)
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        decode_jpeg(bytes, longest_side)
    } else {
        Err(DecodeError::OtherFormat)
    }
}

fn decode_png(bytes: &[u8], longest_side: u32) -> Result<Picture, DecodeError> {
    let limits = png::Limits { bytes: LARGEST_DECODED };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width, reader.info().height);
    check_sides([width as usize, height as usize], longest_side)?;
    let size = reader.output_buffer_size().filter(|size| *size <= LARGEST_DECODED);
    let size = size.ok_or(png::DecodingError::LimitsExceeded)?;
    let mut samples = vec![0; size];
    let frame = reader.next_frame(&mut samples)?;
    samples.truncate(frame.buffer_size());
    if frame.bit_depth == png::BitDepth::Sixteen {
        let eight = |pair: &[u8; 2]| ((u32::from(u16::from_be_bytes(*pair)) + 128) / 257) as u8;
        samples = samples.as_chunks::<2>().0.iter().map(eight).collect();
    }
    Ok(Picture { width, height, rgba: rgba(&samples, frame.color_type.samples()) })
}

fn decode_jpeg(bytes: &[u8], longest_side: u32) -> Result<Picture, DecodeError> {
    let damaged = |error: zune_jpeg::errors::DecodeErrors| DecodeError::Jpeg(error.to_string());
    let unbounded =
        DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(bytes), unbounded);
    decoder.decode_headers().map_err(damaged)?;
    let (width, height) = decoder.dimensions().ok_or_else(|| DecodeError::Jpeg("it has no frame".into()))?;
    check_sides([width, height], longest_side)?;
    let is_grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let (wanted, channels) = if is_grey { (ColorSpace::Luma, 1) } else { (ColorSpace::RGB, 3) };
    decoder.set_options(unbounded.jpeg_set_out_colorspace(wanted));
    let samples = decoder.decode().map_err(damaged)?;
    Ok(Picture { width: width as u32, height: height as u32, rgba: rgba(&samples, channels) })
}

fn check_sides([width, height]: [usize; 2], limit: u32) -> Result<(), DecodeError> {
    let fits = width.max(height) <= limit as usize;
    if fits { Ok(()) } else { Err(DecodeError::TooLarge { width, height, limit }) }
}

/// Converts pixels of grey, grey and alpha, colour, or colour and alpha to colour and alpha.
fn rgba(samples: &[u8], channels: usize) -> Vec<u8> {
    let pixels = samples.chunks_exact(channels);
    match channels {
        1 => pixels.flat_map(|p| [p[0], p[0], p[0], 255]).collect(),
        2 => pixels.flat_map(|p| [p[0], p[0], p[0], p[1]]).collect(),
        3 => pixels.flat_map(|p| [p[0], p[1], p[2], 255]).collect(),
        _ => samples.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_reads_back_as_it_was() {
        let picture = Picture { width: 3, height: 2, rgba: (0..24).collect() };
        assert_eq!(decode_picture(&encode_png(&picture).unwrap(), 3).unwrap(), picture);
    }

    /// A PNG with these samples, and a palette and transparency where they need one.
    fn png_of(color: png::ColorType, depth: png::BitDepth, size: [u32; 2], data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == png::ColorType::Indexed {
            encoder.set_palette(vec![10, 20, 30, 40, 50, 60]);
            encoder.set_trns(vec![255, 128]);
        }
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn every_kind_of_png_becomes_colours_and_alpha() {
        use png::BitDepth::{Eight, One, Sixteen};
        use png::ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
        for (color, depth, data, expected) in [
            (Grayscale, Eight, vec![7, 200], [7, 7, 7, 255, 200, 200, 200, 255]),
            (Grayscale, One, vec![0b0100_0000], [0, 0, 0, 255, 255, 255, 255, 255]),
            (GrayscaleAlpha, Eight, vec![7, 1, 200, 2], [7, 7, 7, 1, 200, 200, 200, 2]),
            (Rgb, Eight, vec![1, 2, 3, 4, 5, 6], [1, 2, 3, 255, 4, 5, 6, 255]),
            (Rgba, Eight, vec![1, 2, 3, 4, 5, 6, 7, 8], [1, 2, 3, 4, 5, 6, 7, 8]),
            (Indexed, Eight, vec![1, 0], [40, 50, 60, 128, 10, 20, 30, 255]),
            // A step of 8 bits is 257 of 16: 0x0180 is closer to the first, 0x0182 to the second.
            (Grayscale, Sixteen, vec![0x01, 0x80, 0x01, 0x82], [1, 1, 1, 255, 2, 2, 2, 255]),
        ] {
            let picture = decode_picture(&png_of(color, depth, [2, 1], &data), 2).unwrap();
            assert_eq!(picture, Picture { width: 2, height: 1, rgba: expected.to_vec() }, "{color:?} {depth:?}");
        }
    }

    /// JPEGs of 16×8 pixels, all of one grey (188) or colour (200, 100, 50), made by libjpeg.
    const GREY: &[u8] = include_bytes!("../tests/pictures/grey.jpg");
    const COLOR: &[u8] = include_bytes!("../tests/pictures/color.jpg");

    #[test]
    fn jpeg_becomes_colours_and_alpha() {
        for (bytes, expected) in [(GREY, [188, 188, 188, 255]), (COLOR, [200, 100, 50, 255])] {
            let picture = decode_picture(bytes, 16).unwrap();
            assert_eq!((picture.width, picture.height, picture.rgba.len()), (16, 8, 4 * 16 * 8));
            for (at, pixel) in picture.rgba.chunks_exact(4).enumerate() {
                let near = pixel.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 3);
                assert!(near, "{pixel:?} at {at}, not {expected:?}");
            }
        }
    }

    #[test]
    fn what_is_no_picture_is_told_apart_from_a_damaged_one() {
        let whole = encode_png(&Picture { width: 3, height: 2, rgba: (0..24).collect() }).unwrap();
        assert!(matches!(decode_picture(b"RIFF....WEBP", 9), Err(DecodeError::OtherFormat)));
        assert!(matches!(decode_picture(&[], 9), Err(DecodeError::OtherFormat)));
        for length in 8..whole.len() - 12 {
            assert!(matches!(decode_picture(&whole[..length], 9), Err(DecodeError::Png(_))), "{length} bytes");
        }
        for length in 3..GREY.len() {
            // The decoder returns what it has of a file that is cut off within its pixels.
            assert!(matches!(decode_picture(&GREY[..length], 16), Err(DecodeError::Jpeg(_)) | Ok(_)), "{length} bytes");
        }
        assert!(matches!(decode_picture(&whole, 2), Err(DecodeError::TooLarge { width: 3, height: 2, limit: 2 })));
        assert!(matches!(decode_picture(GREY, 15), Err(DecodeError::TooLarge { width: 16, height: 8, limit: 15 })));
    }

    #[test]
    fn no_pixels_is_an_error() {
        assert!(matches!(check_size([0, 5], 10), Err(RenderError::BadSize { .. })));
        assert!(matches!(check_size([5, 11], 10), Err(RenderError::BadSize { .. })));
    }
}
