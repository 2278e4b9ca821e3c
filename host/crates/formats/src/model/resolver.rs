//! Files referenced by a file.

/// Returns the bytes of a file that another file references (a glTF buffer, a texture, a material library), by the name
/// given there. The error is a sentence for the user.
pub type Resolver<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;
