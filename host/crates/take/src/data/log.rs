//! MCAP as it is on disk: schemas, channels and messages in chunks that are indexed by time.

use std::collections::BTreeMap;

use crc::{CRC_32_ISO_HDLC, Crc};

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// A chunk is closed when it is longer than this.
const CHUNK_BYTES: usize = 1 << 20;

const HEADER: u8 = 1;
const FOOTER: u8 = 2;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const MESSAGE_INDEX: u8 = 7;
const CHUNK_INDEX: u8 = 8;
const STATISTICS: u8 = 11;
const DATA_END: u8 = 15;

/// A log while it is written.
#[derive(Debug)]
pub(super) struct Log {
    out: Vec<u8>,
    /// Schemas and channels, which the end of the file repeats.
    declared: Vec<u8>,
    channels: u16,
    chunk: Chunk,
    chunk_indexes: Vec<u8>,
    chunks: u32,
    counts: BTreeMap<u16, u64>,
    span: Option<[u64; 2]>,
}

/// Messages that are not in the file yet.
#[derive(Debug, Default)]
struct Chunk {
    records: Vec<u8>,
    span: Option<[u64; 2]>,
    /// Times and places of the messages of each channel.
    index: BTreeMap<u16, Vec<[u64; 2]>>,
}

impl Log {
    pub(super) fn new(library: &str) -> Self {
        let mut out = MAGIC.to_vec();
        record(&mut out, HEADER, &[text(""), text(library)].concat());
        Self {
            out,
            declared: Vec::new(),
            channels: 0,
            chunk: Chunk::default(),
            chunk_indexes: Vec::new(),
            chunks: 0,
            counts: BTreeMap::new(),
            span: None,
        }
    }

    /// Declares a channel of messages with this schema; returns its number.
    pub(super) fn channel(
        &mut self,
        topic: &str,
        schema: &str,
        encoding: &str,
        description: &[u8],
        metadata: &[(&str, String)],
    ) -> u16 {
        self.channels += 1;
        let id = self.channels.to_le_bytes();
        let said = [&id[..], &text(schema), &text(encoding), &with_length(description)].concat();
        let pairs = metadata.iter().flat_map(|(key, value)| [text(key), text(value)].concat()).collect::<Vec<u8>>();
        let channel = [&id[..], &id, &text(topic), &text(encoding), &with_length(&pairs)].concat();
        let mut records = Vec::new();
        record(&mut records, SCHEMA, &said);
        record(&mut records, CHANNEL, &channel);
        self.declared.extend(&records);
        self.chunk.records.extend(records);
        self.channels
    }

    /// Adds a message; those of a channel come in the order of their times, nanoseconds.
    pub(super) fn message(&mut self, channel: u16, sequence: u32, nanos: u64, data: &[u8]) {
        let place = self.chunk.records.len() as u64;
        let head = [&channel.to_le_bytes()[..], &sequence.to_le_bytes(), &nanos.to_le_bytes(), &nanos.to_le_bytes()];
        record(&mut self.chunk.records, MESSAGE, &[&head.concat(), data].concat());
        self.chunk.index.entry(channel).or_default().push([nanos, place]);
        *self.counts.entry(channel).or_default() += 1;
        let widened = |span: Option<[u64; 2]>| Some(span.map_or([nanos; 2], |[a, b]| [a.min(nanos), b.max(nanos)]));
        (self.chunk.span, self.span) = (widened(self.chunk.span), widened(self.span));
        if self.chunk.records.len() > CHUNK_BYTES {
            self.close_chunk();
        }
    }

    fn close_chunk(&mut self) {
        let Chunk { records, span, index } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return;
        }
        let [start, end] = span.unwrap_or_default();
        let (length, place) = (records.len() as u64, self.out.len() as u64);
        let mut content = [start, end, length].map(u64::to_le_bytes).concat();
        content.extend(CRC.checksum(&records).to_le_bytes());
        content.extend(text(""));
        content.extend(length.to_le_bytes());
        content.extend(records);
        record(&mut self.out, CHUNK, &content);
        let after = self.out.len() as u64;
        let mut places = Vec::new();
        for (channel, messages) in index {
            places.extend(channel.to_le_bytes());
            places.extend((self.out.len() as u64).to_le_bytes());
            let entries: Vec<u8> = messages.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
            record(&mut self.out, MESSAGE_INDEX, &[&channel.to_le_bytes()[..], &with_length(&entries)].concat());
        }
        let mut content = [start, end, place, after - place].map(u64::to_le_bytes).concat();
        content.extend(with_length(&places));
        content.extend((self.out.len() as u64 - after).to_le_bytes());
        content.extend(text(""));
        content.extend([length, length].map(u64::to_le_bytes).concat());
        record(&mut self.chunk_indexes, CHUNK_INDEX, &content);
        self.chunks += 1;
    }

    /// The whole file.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.close_chunk();
        record(&mut self.out, DATA_END, &0_u32.to_le_bytes());
        let start = self.out.len();
        self.out.extend(&self.declared);
        self.out.extend(&self.chunk_indexes);
        let [first, last] = self.span.unwrap_or_default();
        let mut content = self.counts.values().sum::<u64>().to_le_bytes().to_vec();
        content.extend(self.channels.to_le_bytes());
        content.extend([u32::from(self.channels), 0, 0, self.chunks].map(u32::to_le_bytes).concat());
        content.extend([first, last].map(u64::to_le_bytes).concat());
        let counts: Vec<u8> = self
            .counts
            .iter()
            .flat_map(|(channel, count)| [&channel.to_le_bytes()[..], &count.to_le_bytes()].concat())
            .collect();
        content.extend(with_length(&counts));
        record(&mut self.out, STATISTICS, &content);
        // The checksum covers the summary and the footer up to itself.
        self.out.push(FOOTER);
        self.out.extend(20_u64.to_le_bytes());
        self.out.extend([start as u64, 0].map(u64::to_le_bytes).concat());
        let checksum = CRC.checksum(&self.out[start..]);
        self.out.extend(checksum.to_le_bytes());
        self.out.extend(MAGIC);
        self.out
    }
}

fn record(out: &mut Vec<u8>, kind: u8, content: &[u8]) {
    out.push(kind);
    out.extend((content.len() as u64).to_le_bytes());
    out.extend(content);
}

fn text(text: &str) -> Vec<u8> {
    with_length(text.as_bytes())
}

fn with_length(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat()
}
