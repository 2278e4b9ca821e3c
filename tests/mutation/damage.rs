//! What happens to a file, decided by a seed.

use crate::samples::Sample;
use crate::seal::seal;

/// A damaged file, and what was done to it.
pub(crate) struct Damaged {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    pub(crate) done: String,
}

/// A stream of numbers from a seed (`SplitMix64`).
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn of_seed(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// A number below `end`, which is not 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    pub(crate) fn one_of<'t, T>(&mut self, list: &'t [T]) -> &'t T {
        &list[self.below(list.len())]
    }
}

/// One of the samples after one to three kinds of damage, mostly one.
pub(crate) fn damaged(samples: &[Sample], seed: u64) -> Damaged {
    let mut dice = Dice::of_seed(seed);
    let sample = dice.one_of(samples);
    let mut bytes = sample.bytes.clone();
    let mut done = Vec::new();
    for _ in 0..*dice.one_of(&[1, 1, 1, 2, 3]) {
        if !bytes.is_empty() {
            done.push(damage(&mut bytes, samples, &mut dice));
        }
    }
    // Otherwise a wrong checksum would be all that readers see.
    if dice.below(3) > 0 && seal(&sample.name, &mut bytes) {
        done.push("checksums made right".to_owned());
    }
    Damaged { name: sample.name.clone(), bytes, done: done.join(", ") }
}

fn damage(bytes: &mut Vec<u8>, samples: &[Sample], dice: &mut Dice) -> String {
    match dice.below(11) {
        0 => flip(bytes, dice),
        1 => cut_off(bytes, dice),
        2 | 3 => replace_number(bytes, dice),
        4 => replace_binary_number(bytes, dice),
        5 => duplicate_block(bytes, dice),
        6 => remove_block(bytes, dice),
        7 => swap_header(bytes, samples, dice),
        8 | 9 => change_number(bytes, dice),
        _ => exchange_lines(bytes, dice),
    }
}

fn flip(bytes: &mut [u8], dice: &mut Dice) -> String {
    let count = 1 + dice.below(8);
    for _ in 0..count {
        let at = dice.below(bytes.len());
        bytes[at] ^= 1 << dice.below(8);
    }
    format!("{count} bits flipped")
}

fn cut_off(bytes: &mut Vec<u8>, dice: &mut Dice) -> String {
    let end = dice.below(bytes.len());
    bytes.truncate(end);
    format!("cut off at byte {end}")
}

const ODD_NUMBERS: [&str; 20] = [
    "nan",
    "-nan(ind)",
    "1.#IND",
    "inf",
    "-inf",
    "1e999",
    "-1e308",
    "1e-320",
    "3.5e38",
    "-1",
    "0",
    "65536",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999999",
    "-9223372036854775808",
    "",
];

/// Where a number in text is, if there is one.
fn number(bytes: &[u8], dice: &mut Dice) -> Option<std::ops::Range<usize>> {
    let is_part = |b: u8| b.is_ascii_digit() || b == b'.' || b == b'-';
    let start = dice.below(bytes.len());
    let mut turn = (0..bytes.len()).map(|step| (start + step) % bytes.len());
    let mut from = turn.find(|&at| bytes[at].is_ascii_digit())?;
    while from > 0 && is_part(bytes[from - 1]) {
        from -= 1;
    }
    let end = (from..bytes.len()).find(|&at| !is_part(bytes[at])).unwrap_or(bytes.len());
    Some(from..end)
}

/// A number in text becomes one that readers may not expect.
fn replace_number(bytes: &mut Vec<u8>, dice: &mut Dice) -> String {
    let Some(place) = number(bytes, dice) else { return flip(bytes, dice) };
    let odd = *dice.one_of(&ODD_NUMBERS);
    let done = format!("the number at bytes {place:?} is {odd:?}");
    bytes.splice(place, odd.bytes());
    done
}

/// A digit in text becomes another: mostly still a valid file, of another shape.
fn change_number(bytes: &mut [u8], dice: &mut Dice) -> String {
    let Some(place) = number(bytes, dice) else { return flip(bytes, dice) };
    let digits: Vec<usize> = place.filter(|&at| bytes[at].is_ascii_digit()).collect();
    let at = *dice.one_of(&digits);
    bytes[at] = b'0' + dice.below(10) as u8;
    format!("the digit at byte {at} is {}", char::from(bytes[at]))
}

const ODD_WORDS: [u32; 14] = [
    0,
    1,
    u32::MAX,
    0x7FFF_FFFF,
    0x8000_0000,
    0x0000_FFFF,
    0x0001_0000,
    0x7F80_0000,
    0xFF80_0000,
    0x7FC0_0000,
    0x7F7F_FFFF,
    0x0000_0001,
    0x4F00_0000,
    0x3F80_0000,
];

/// Four or eight bytes become an odd number: a count, an index, infinity or no number.
fn replace_binary_number(bytes: &mut [u8], dice: &mut Dice) -> String {
    let word = *dice.one_of(&ODD_WORDS);
    let word = if dice.below(4) == 0 { word.to_be_bytes() } else { word.to_le_bytes() };
    let repeat = 1 + dice.below(2);
    let at = dice.below(bytes.len()) / 4 * 4;
    for (slot, byte) in bytes[at..].iter_mut().zip(word.repeat(repeat)) {
        *slot = byte;
    }
    format!("{repeat} words at byte {at} are {word:02x?}")
}

fn block(bytes: &[u8], dice: &mut Dice) -> std::ops::Range<usize> {
    let start = dice.below(bytes.len());
    start..start + 1 + dice.below((bytes.len() - start).min(200))
}

fn duplicate_block(bytes: &mut Vec<u8>, dice: &mut Dice) -> String {
    let range = block(bytes, dice);
    let copy = bytes[range.clone()].to_vec();
    let times = *dice.one_of(&[1, 1, 2, 20]);
    bytes.splice(range.end..range.end, copy.repeat(times));
    format!("bytes {range:?} are there {} times", times + 1)
}

fn remove_block(bytes: &mut Vec<u8>, dice: &mut Dice) -> String {
    let range = block(bytes, dice);
    bytes.drain(range.clone());
    format!("bytes {range:?} are gone")
}

/// The beginning of one file before the rest of another.
fn swap_header(bytes: &mut Vec<u8>, samples: &[Sample], dice: &mut Dice) -> String {
    let other = dice.one_of(samples);
    let length = *dice.one_of(&[4, 12, 84, 200]);
    let head = &other.bytes[..other.bytes.len().min(length)];
    let end = bytes.len().min(length);
    bytes.splice(..end, head.iter().copied());
    format!("the first {length} bytes are those of {}", other.name)
}

fn exchange_lines(bytes: &mut Vec<u8>, dice: &mut Dice) -> String {
    let mut lines: Vec<Vec<u8>> = bytes.split_inclusive(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    let (a, b) = (dice.below(lines.len()), dice.below(lines.len()));
    lines.swap(a, b);
    *bytes = lines.concat();
    format!("the lines {a} and {b} are exchanged")
}
