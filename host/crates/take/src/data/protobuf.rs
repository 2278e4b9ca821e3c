//! Messages in the encoding of Protocol Buffers: fields one after the other, each with its number and kind.

/// A message while it is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Message {
    bytes: Vec<u8>,
}

impl Message {
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// A whole number; zero is what a field is that is not there.
    pub(super) fn number(self, field: u32, value: u64) -> Self {
        if value == 0 { self } else { self.given_number(field, value) }
    }

    /// A whole number that is written even if it is zero.
    pub(super) fn given_number(mut self, field: u32, value: u64) -> Self {
        self.key(field, 0);
        self.varint(value);
        self
    }

    /// A number that is written even if it is zero, as fields are that may be missing.
    pub(super) fn given_double(mut self, field: u32, value: Option<f64>) -> Self {
        if let Some(value) = value {
            self.key(field, 1);
            self.bytes.extend(value.to_le_bytes());
        }
        self
    }

    /// A number of double precision.
    pub(super) fn double(self, field: u32, value: f64) -> Self {
        self.given_double(field, (value.to_bits() != 0).then_some(value))
    }

    /// A text.
    pub(super) fn text(self, field: u32, text: &str) -> Self {
        if text.is_empty() { self } else { self.packed(field, text.as_bytes()) }
    }

    /// A message within this one.
    pub(super) fn message(self, field: u32, message: &Self) -> Self {
        self.packed(field, &message.bytes)
    }

    /// Whole numbers, packed.
    pub(super) fn numbers(self, field: u32, values: impl Iterator<Item = u64>) -> Self {
        let mut packed = Self::default();
        values.for_each(|value| packed.varint(value));
        if packed.bytes.is_empty() { self } else { self.packed(field, &packed.bytes) }
    }

    fn packed(mut self, field: u32, bytes: &[u8]) -> Self {
        self.key(field, 2);
        self.varint(bytes.len() as u64);
        self.bytes.extend(bytes);
        self
    }

    fn key(&mut self, field: u32, kind: u32) {
        self.varint(u64::from((field << 3) | kind));
    }

    /// Seven bits a byte, the lowest first.
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push((value as u8) | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the format's description.
    #[test]
    fn bytes_are_those_of_the_description() {
        assert_eq!(Message::default().number(1, 150).into_bytes(), [0x08, 0x96, 0x01]);
        assert_eq!(Message::default().text(2, "testing").into_bytes(), b"\x12\x07testing");
        let inner = Message::default().number(1, 150);
        assert_eq!(Message::default().message(3, &inner).into_bytes(), [0x1a, 0x03, 0x08, 0x96, 0x01]);
        let packed = Message::default().numbers(6, [3, 270, 86_942].into_iter());
        assert_eq!(packed.into_bytes(), [0x32, 0x06, 0x03, 0x8e, 0x02, 0x9e, 0xa7, 0x05]);
    }
}
