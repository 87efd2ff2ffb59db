//! Recordings for Foxglove and other players: MCAP, messages in JSON, a chunk for each moment.
//!
//! ```text
//!   magic │ Header │ Chunk: Message, Message, … │ MessageIndex of each channel │ Chunk … │ DataEnd
//!         │ Schema, Channel, … │ ChunkIndex … │ Statistics │ Footer: where the summary begins │ magic
//! ```
//!
//! Not compressed. Players find a moment by the indices at the end, which take some bytes a message. The crate `mcap` writes the same, at 20
//! further crates.
//!
//! Source: the MCAP format specification, version 0 (mcap.dev/spec).

use std::io::{self, Write};

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Opcodes.
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const STATISTICS: u8 = 0x0b;
const DATA_END: u8 = 0x0f;

/// What is recorded under a topic.
#[derive(Debug, Clone, Copy)]
pub struct Channel {
    /// Topic, as `/lidar/points`.
    pub topic: &'static str,
    /// Name of its schema, as `foxglove.PointCloud`.
    pub schema: &'static str,
    /// Its JSON schema.
    pub json_schema: &'static str,
}

/// A recording that is being written.
pub struct Mcap<W: Write> {
    out: W,
    at: u64,
    channels: &'static [Channel],
    counts: Vec<u64>,
    chunks: Vec<Vec<u8>>,
    first_ns: Option<u64>,
    last_ns: u64,
}

/// A record's content.
#[derive(Default)]
struct Content(Vec<u8>);

impl Content {
    fn u16(mut self, number: u16) -> Self {
        self.0.extend(number.to_le_bytes());
        self
    }

    fn u32(mut self, number: usize) -> Self {
        self.0.extend((number as u32).to_le_bytes());
        self
    }

    fn u64(mut self, number: u64) -> Self {
        self.0.extend(number.to_le_bytes());
        self
    }

    fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    fn text(self, text: &str) -> Self {
        self.u32(text.len()).bytes(text.as_bytes())
    }

    fn record(self, opcode: u8) -> Vec<u8> {
        let mut record = vec![opcode];
        record.extend((self.0.len() as u64).to_le_bytes());
        record.extend(self.0);
        record
    }
}

impl<W: Write> Mcap<W> {
    /// Begins a recording.
    pub fn begin(out: W, channels: &'static [Channel]) -> io::Result<Self> {
        let mut mcap = Mcap {
            out,
            at: 0,
            channels,
            counts: vec![0; channels.len()],
            chunks: Vec::new(),
            first_ns: None,
            last_ns: 0,
        };
        mcap.write_bytes(&MAGIC)?;
        let library = concat!("gdtof ", env!("CARGO_PKG_VERSION"));
        mcap.write_bytes(&Content::default().text("").text(library).record(HEADER))?;
        Ok(mcap)
    }

    fn write_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    fn definitions(&self) -> Vec<u8> {
        let mut records = Vec::new();
        for (number, channel) in (1u16..).zip(self.channels) {
            let schema = Content::default().u16(number).text(channel.schema);
            records.extend(
                schema
                    .text("jsonschema")
                    .text(channel.json_schema)
                    .record(SCHEMA),
            );
            let content = Content::default()
                .u16(number)
                .u16(number)
                .text(channel.topic);
            records.extend(content.text("json").u32(0).record(CHANNEL));
        }
        records
    }

    /// Records a moment: a message of each of some channels, by their numbers.
    pub fn moment(
        &mut self,
        time_ns: u64,
        messages: &[(usize, serde_json::Value)],
    ) -> io::Result<()> {
        let mut records = if self.chunks.is_empty() {
            self.definitions()
        } else {
            Vec::new()
        };
        let mut indices = Vec::new();
        for (channel, json) in messages {
            let place = Content::default().u16(*channel as u16 + 1).u32(16);
            let place = place.u64(time_ns).u64(records.len() as u64);
            indices.push((*channel, place.record(MESSAGE_INDEX)));
            let message = Content::default()
                .u16(*channel as u16 + 1)
                .u32(self.counts[*channel] as usize)
                .u64(time_ns)
                .u64(time_ns)
                .bytes(&serde_json::to_vec(json)?);
            records.extend(message.record(MESSAGE));
            self.counts[*channel] += 1;
        }
        let (begin, size) = (self.at, records.len() as u64);
        let chunk = Content::default().u64(time_ns).u64(time_ns).u64(size);
        let chunk = chunk
            .u32(crc32fast::hash(&records) as usize)
            .text("")
            .u64(size)
            .bytes(&records);
        self.write_bytes(&chunk.record(CHUNK))?;
        let chunk_length = self.at - begin;
        let mut places = Content::default();
        let begin_of_indices = self.at;
        for (channel, index) in indices {
            places = places.u16(channel as u16 + 1).u64(self.at);
            self.write_bytes(&index)?;
        }
        let index = Content::default()
            .u64(time_ns)
            .u64(time_ns)
            .u64(begin)
            .u64(chunk_length);
        let index = index
            .u32(places.0.len())
            .bytes(&places.0)
            .u64(self.at - begin_of_indices);
        self.chunks
            .push(index.text("").u64(size).u64(size).record(CHUNK_INDEX));
        self.first_ns.get_or_insert(time_ns);
        self.last_ns = time_ns;
        Ok(())
    }

    /// Writes the summary.
    pub fn finish(mut self) -> io::Result<W> {
        self.write_bytes(&Content::default().u32(0).record(DATA_END))?;
        let begin = self.at;
        let mut counts = Content::default();
        for (number, count) in (1u16..).zip(&self.counts) {
            counts = counts.u16(number).u64(*count);
        }
        let channels = self.channels.len();
        let statistics = Content::default()
            .u64(self.counts.iter().sum())
            .u16(channels as u16)
            .u32(channels)
            .u32(0)
            .u32(0)
            .u32(self.chunks.len())
            .u64(self.first_ns.unwrap_or(0))
            .u64(self.last_ns)
            .u32(counts.0.len())
            .bytes(&counts.0)
            .record(STATISTICS);
        let mut summary = self.definitions();
        summary.extend(statistics);
        summary.extend(self.chunks.concat());
        self.write_bytes(&summary)?;
        // No offsets of groups, no checksum.
        self.write_bytes(&Content::default().u64(begin).u64(0).u32(0).record(FOOTER))?;
        self.write_bytes(&MAGIC)?;
        Ok(self.out)
    }
}
