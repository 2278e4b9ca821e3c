//! Little-endian fields of a payload: writing them, and reading them with bounds checks.

use glam::{Quat, Vec3};

use super::error::PayloadError;

/// The parent of a root and every other "none" among 16-bit indices.
pub(super) const NONE_U16: u16 = u16::MAX;

/// Appends fields to a payload.
pub(super) trait Put {
    fn put_u8(&mut self, value: u8);
    fn put_u16(&mut self, value: u16);
    fn put_u32(&mut self, value: u32);
    fn put_u64(&mut self, value: u64);
    fn put_f32(&mut self, value: f32);
    fn put_f64(&mut self, value: f64);
    fn put_vec3(&mut self, value: Vec3);
    fn put_quat(&mut self, value: Quat);
}

impl Put for Vec<u8> {
    fn put_u8(&mut self, value: u8) {
        self.push(value);
    }

    fn put_u16(&mut self, value: u16) {
        self.extend_from_slice(&value.to_le_bytes());
    }

    fn put_u32(&mut self, value: u32) {
        self.extend_from_slice(&value.to_le_bytes());
    }

    fn put_u64(&mut self, value: u64) {
        self.extend_from_slice(&value.to_le_bytes());
    }

    fn put_f32(&mut self, value: f32) {
        self.put_u32(value.to_bits());
    }

    fn put_f64(&mut self, value: f64) {
        self.put_u64(value.to_bits());
    }

    fn put_vec3(&mut self, value: Vec3) {
        value.to_array().into_iter().for_each(|number| self.put_f32(number));
    }

    fn put_quat(&mut self, value: Quat) {
        value.to_array().into_iter().for_each(|number| self.put_f32(number));
    }
}

/// The rest of a payload.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(super) fn new(payload: &'a [u8]) -> Self {
        Self { rest: payload }
    }

    pub(super) fn bytes(&mut self, count: usize, field: &'static str) -> Result<&'a [u8], PayloadError> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(PayloadError::TooShort { field })?;
        self.rest = rest;
        Ok(taken)
    }

    pub(super) fn array<const N: usize>(&mut self, field: &'static str) -> Result<[u8; N], PayloadError> {
        let (taken, rest) = self.rest.split_first_chunk().ok_or(PayloadError::TooShort { field })?;
        self.rest = rest;
        Ok(*taken)
    }

    pub(super) fn u8(&mut self, field: &'static str) -> Result<u8, PayloadError> {
        self.array(field).map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self, field: &'static str) -> Result<u16, PayloadError> {
        self.array(field).map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self, field: &'static str) -> Result<u32, PayloadError> {
        self.array(field).map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self, field: &'static str) -> Result<u64, PayloadError> {
        self.array(field).map(u64::from_le_bytes)
    }

    pub(super) fn f32(&mut self, field: &'static str) -> Result<f32, PayloadError> {
        self.u32(field).map(f32::from_bits)
    }

    pub(super) fn f64(&mut self, field: &'static str) -> Result<f64, PayloadError> {
        self.u64(field).map(f64::from_bits)
    }

    pub(super) fn vec3(&mut self, field: &'static str) -> Result<Vec3, PayloadError> {
        Ok(Vec3::new(self.f32(field)?, self.f32(field)?, self.f32(field)?))
    }

    pub(super) fn quat(&mut self, field: &'static str) -> Result<Quat, PayloadError> {
        Ok(Quat::from_xyzw(self.f32(field)?, self.f32(field)?, self.f32(field)?, self.f32(field)?))
    }

    /// A text preceded by its length in bytes as a 16-bit number.
    pub(super) fn text(&mut self, field: &'static str) -> Result<String, PayloadError> {
        let length = usize::from(self.u16(field)?);
        let bytes = self.bytes(length, field)?;
        std::str::from_utf8(bytes).map(str::to_owned).map_err(|_| PayloadError::NotText { field })
    }

    pub(super) fn left(&self) -> usize {
        self.rest.len()
    }
}
