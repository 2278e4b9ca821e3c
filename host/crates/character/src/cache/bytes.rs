//! Little-endian numbers and length-prefixed lists, written and read defensively: no count is trusted before the bytes
//! after it are there.

use super::error::CacheError;

/// Bytes being written.
#[derive(Default)]
pub(super) struct Writer(pub(super) Vec<u8>);

impl Writer {
    pub(super) fn byte(&mut self, value: u8) {
        self.0.push(value);
    }

    pub(super) fn count(&mut self, value: usize) {
        self.0.extend((value as u64).to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn bytes(&mut self, value: &[u8]) {
        self.count(value.len());
        self.0.extend(value);
    }

    pub(super) fn f32s<const K: usize>(&mut self, values: [f32; K]) {
        for value in values {
            self.0.extend(value.to_le_bytes());
        }
    }

    /// A flag, then the value if there is one.
    pub(super) fn option<T>(&mut self, value: Option<T>, write: impl FnOnce(&mut Self, T)) {
        self.byte(u8::from(value.is_some()));
        if let Some(value) = value {
            write(self, value);
        }
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    /// The length, then each item with its fixed number of bytes.
    pub(super) fn list<T>(&mut self, values: &[T], mut write: impl FnMut(&mut Self, &T)) {
        self.count(values.len());
        for value in values {
            write(self, value);
        }
    }
}

/// Bytes being read, with the position for error messages.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The position of the next byte.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    pub(super) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub(super) fn bad(&self, what: impl Into<String>) -> CacheError {
        CacheError::Malformed { byte: self.at, what: what.into() }
    }

    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], CacheError> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or(CacheError::Truncated { byte: self.at, needed: count, left: self.left() })?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    pub(super) fn array<const K: usize>(&mut self) -> Result<[u8; K], CacheError> {
        let mut out = [0; K];
        out.copy_from_slice(self.take(K)?);
        Ok(out)
    }

    pub(super) fn byte(&mut self) -> Result<u8, CacheError> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn u16(&mut self) -> Result<u16, CacheError> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32, CacheError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn f64(&mut self) -> Result<f64, CacheError> {
        let value = f64::from_le_bytes(self.array()?);
        if value.is_finite() { Ok(value) } else { Err(self.bad("a number that is not finite")) }
    }

    pub(super) fn f32s<const K: usize>(&mut self) -> Result<[f32; K], CacheError> {
        let mut out = [0.0; K];
        for value in &mut out {
            *value = f32::from_le_bytes(self.array()?);
            if !value.is_finite() {
                return Err(self.bad("a number that is not finite"));
            }
        }
        Ok(out)
    }

    /// A count of things that take at least `size` bytes each.
    pub(super) fn count(&mut self, size: usize) -> Result<usize, CacheError> {
        let value = u64::from_le_bytes(self.array()?);
        let fits = usize::try_from(value).ok().filter(|&n| n <= self.left() / size.max(1));
        fits.ok_or_else(|| self.bad(format!("a count of {value}, more than the rest of the file can hold")))
    }

    pub(super) fn bytes(&mut self) -> Result<&'a [u8], CacheError> {
        let count = self.count(1)?;
        self.take(count)
    }

    pub(super) fn text(&mut self) -> Result<String, CacheError> {
        let bytes = self.bytes()?.to_vec();
        String::from_utf8(bytes).map_err(|_| self.bad("text that is not UTF-8"))
    }

    /// A list of things that take at least `size` bytes each.
    pub(super) fn list<T>(
        &mut self,
        size: usize,
        mut read: impl FnMut(&mut Self) -> Result<T, CacheError>,
    ) -> Result<Vec<T>, CacheError> {
        let count = self.count(size)?;
        (0..count).map(|_| read(self)).collect()
    }

    /// A flag, and what follows if it is set.
    pub(super) fn option<T>(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<T, CacheError>,
    ) -> Result<Option<T>, CacheError> {
        match self.byte()? {
            0 => Ok(None),
            1 => read(self).map(Some),
            flag => Err(self.bad(format!("a flag that is {flag}, neither 0 nor 1"))),
        }
    }
}
