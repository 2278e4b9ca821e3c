//! A file taken apart, with everything compressed in it unpacked.

use super::container::Document;
use super::draco::unpack_primitives;
use super::meshopt::unpack_views;
use crate::FormatError;
use crate::model::Resolver;

/// Parses either form, fetches the buffers and unpacks them: whoever reads the document sees plain arrays.
pub(super) fn open<'b>(file: &'b str, bytes: &'b [u8], resolver: Resolver) -> Result<Document<'b>, FormatError> {
    let mut document = Document::read(file, bytes, resolver)?;
    unpack_views(&mut document)?;
    unpack_primitives(&mut document)?;
    Ok(document)
}
