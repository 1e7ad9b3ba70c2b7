//! The feature matrix of the MCAP conformance tests: every combination of optional features of a writer, on six small
//! inputs, is read with the right contents.

use super::*;
use crate::reader::record::HEAD;
use mcap::records::op;
use std::collections::BTreeSet;

/// An optional feature of a writer, named as in the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Feature {
    UseChunks,
    UseMessageIndex,
    UseStatistics,
    UseRepeatedSchemas,
    UseRepeatedChannelInfos,
    UseAttachmentIndex,
    UseMetadataIndex,
    UseChunkIndex,
    UseSummaryOffset,
    AddExtraDataToRecords,
}

use Feature::*;

const FEATURES: [Feature; 10] = [
    UseChunks,
    UseMessageIndex,
    UseStatistics,
    UseRepeatedSchemas,
    UseRepeatedChannelInfos,
    UseAttachmentIndex,
    UseMetadataIndex,
    UseChunkIndex,
    UseSummaryOffset,
    AddExtraDataToRecords,
];

/// The contents of a file.
#[derive(Clone, Debug, Default)]
struct Input {
    schema: bool,
    channel: bool,
    /// The log times. A single message has sequence number 10 and was published at 1; several are numbered from 0.
    messages: &'static [u64],
    attachment: bool,
    metadata: bool,
}

fn inputs() -> [Input; 6] {
    let with_schema = Input { schema: true, channel: true, ..Input::default() };
    [
        Input::default(),
        Input { channel: true, messages: &[2], ..Input::default() },
        Input { messages: &[2], ..with_schema.clone() },
        Input { messages: &[0, 2, 1, 3, 3, 5, 4, 7, 8, 9], ..with_schema },
        Input { attachment: true, ..Input::default() },
        Input { metadata: true, ..Input::default() },
    ]
}

/// All sets of features that are valid for an input.
fn variants(input: &Input) -> Vec<BTreeSet<Feature>> {
    let all = (0..1 << FEATURES.len()).map(|bits: u32| {
        let chosen = FEATURES.iter().enumerate().filter(|(place, _)| bits >> place & 1 == 1);
        chosen.map(|(_, feature)| *feature).collect::<BTreeSet<_>>()
    });
    let makes_sense = |features: &BTreeSet<Feature>| {
        let has = |feature| features.contains(&feature);
        let of_summary = [
            UseStatistics,
            UseRepeatedSchemas,
            UseRepeatedChannelInfos,
            UseAttachmentIndex,
            UseMetadataIndex,
            UseChunkIndex,
        ];
        (!has(UseAttachmentIndex) || input.attachment)
            && (!has(UseMetadataIndex) || input.metadata)
            && (!has(UseRepeatedSchemas) || input.schema)
            && (!has(UseRepeatedChannelInfos) || input.channel)
            && (!has(UseChunks) || input.channel)
            && (has(UseChunks) || !has(UseMessageIndex) && !has(UseChunkIndex))
            && (!has(UseSummaryOffset) || of_summary.into_iter().any(has))
    };
    all.filter(makes_sense).collect()
}

/// The fields of a record.
#[derive(Clone, Default)]
struct Body(Vec<u8>);

impl Body {
    fn u16(mut self, value: u16) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn u32(mut self, value: usize) -> Self {
        self.0.extend((value as u32).to_le_bytes());
        self
    }

    fn u64(mut self, value: u64) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    fn text(self, text: &str) -> Self {
        self.block(text.as_bytes())
    }

    /// Bytes with their length in front.
    fn block(self, bytes: &[u8]) -> Self {
        self.u32(bytes.len()).bytes(bytes)
    }
}

/// A file being written.
struct File {
    bytes: Vec<u8>,
    /// Whether records are padded where that is allowed.
    padded: bool,
}

impl File {
    /// Adds a record that may be padded, and returns its position and length.
    fn record(&mut self, opcode: u8, mut body: Body) -> (u64, u64) {
        if self.padded {
            body.0.extend([0x01, 0xff, 0xff]);
        }
        self.exact(opcode, &body)
    }

    /// Adds a record without padding.
    fn exact(&mut self, opcode: u8, body: &Body) -> (u64, u64) {
        let start = self.bytes.len() as u64;
        self.bytes.push(opcode);
        self.bytes.extend((body.0.len() as u64).to_le_bytes());
        self.bytes.extend(&body.0);
        (start, (HEAD + body.0.len()) as u64)
    }

    /// Adds a group of the summary, and stores its location unless it is empty.
    fn group(&mut self, groups: &mut Vec<(u8, u64, u64)>, opcode: u8, records: impl IntoIterator<Item = Body>) {
        let start = self.bytes.len() as u64;
        for body in records {
            self.record(opcode, body);
        }
        let length = self.bytes.len() as u64 - start;
        if length > 0 {
            groups.push((opcode, start, length));
        }
    }
}

fn schema() -> Body {
    Body::default().u16(1).text("Example").text("c").block(&[4, 5, 6])
}

fn channel(input: &Input) -> Body {
    let body = Body::default().u16(1).u16(u16::from(input.schema)).text("example");
    match input.schema {
        true => body.text("a").block(&Body::default().text("foo").text("bar").0),
        false => body.text("text").block(&[]),
    }
}

fn file(input: &Input, features: &BTreeSet<Feature>) -> Vec<u8> {
    let has = |feature| features.contains(&feature);
    let mut file = File { bytes: mcap::MAGIC.to_vec(), padded: has(AddExtraDataToRecords) };
    file.record(op::HEADER, Body::default().text("").text(""));

    // Records in a chunk are not padded.
    let mut chunk = has(UseChunks).then(|| File { bytes: Vec::new(), padded: false });
    let data = chunk.as_mut().unwrap_or(&mut file);
    if input.schema {
        data.record(op::SCHEMA, schema());
    }
    if input.channel {
        data.record(op::CHANNEL, channel(input));
    }
    let mut index = Body::default();
    for (number, &time) in input.messages.iter().enumerate() {
        let (sequence, published) = if input.messages.len() == 1 { (10, 1) } else { (number, time) };
        let body = Body::default().u16(1).u32(sequence).u64(time).u64(published).bytes(&[1, 2, 3]);
        let (start, _) = data.exact(op::MESSAGE, &body);
        index = index.u64(time).u64(start);
    }
    let mut attachments = Vec::new();
    if input.attachment {
        let fields =
            Body::default().u64(2).u64(1).text("myFile").text("application/octet-stream").u64(3).bytes(&[1, 2, 3]);
        let checksum = crc32fast::hash(&fields.0) as usize;
        let (start, length) = file.record(op::ATTACHMENT, fields.u32(checksum));
        let index = Body::default().u64(start).u64(length).u64(2).u64(1).u64(3);
        attachments.push(index.text("myFile").text("application/octet-stream"));
    }
    let mut metadata = Vec::new();
    if input.metadata {
        let pairs = Body::default().text("foo").text("bar");
        let (start, length) = file.record(op::METADATA, Body::default().text("myMetadata").block(&pairs.0));
        metadata.push(Body::default().u64(start).u64(length).text("myMetadata"));
    }
    let first = input.messages.iter().copied().min().unwrap_or_default();
    let last = input.messages.iter().copied().max().unwrap_or_default();
    let mut chunks = Vec::new();
    if let Some(chunk) = &chunk {
        let size = chunk.bytes.len() as u64;
        let body = Body::default().u64(first).u64(last).u64(size).u32(crc32fast::hash(&chunk.bytes) as usize);
        let (start, length) = file.exact(op::CHUNK, &body.text("").u64(size).bytes(&chunk.bytes));
        let (mut places, mut index_length) = (Body::default(), 0);
        if has(UseMessageIndex) {
            let (start, length) = file.record(op::MESSAGE_INDEX, Body::default().u16(1).block(&index.0));
            (places, index_length) = (places.u16(1).u64(start), length);
        }
        let body = Body::default().u64(first).u64(last).u64(start).u64(length).block(&places.0);
        chunks.push(body.u64(index_length).text("").u64(size).u64(size));
    }
    let checksum = crc32fast::hash(&file.bytes) as usize;
    file.exact(op::DATA_END, &Body::default().u32(checksum));

    let summary_start = file.bytes.len() as u64;
    let mut groups = Vec::new();
    file.group(&mut groups, op::SCHEMA, has(UseRepeatedSchemas).then(schema));
    file.group(&mut groups, op::CHANNEL, has(UseRepeatedChannelInfos).then(|| channel(input)));
    let counts = || {
        let body = Body::default().u64(input.messages.len() as u64).u16(u16::from(input.schema));
        let body = body.u32(usize::from(input.channel)).u32(usize::from(input.attachment));
        let body = body.u32(usize::from(input.metadata)).u32(usize::from(has(UseChunks))).u64(first).u64(last);
        match input.messages.len() as u64 {
            0 => body.block(&[]),
            count => body.block(&Body::default().u16(1).u64(count).0),
        }
    };
    file.group(&mut groups, op::STATISTICS, has(UseStatistics).then(counts));
    file.group(&mut groups, op::METADATA_INDEX, metadata.into_iter().filter(|_| has(UseMetadataIndex)));
    file.group(&mut groups, op::ATTACHMENT_INDEX, attachments.into_iter().filter(|_| has(UseAttachmentIndex)));
    file.group(&mut groups, op::CHUNK_INDEX, chunks.into_iter().filter(|_| has(UseChunkIndex)));
    let has_summary = !groups.is_empty();
    let offsets = if has(UseSummaryOffset) { file.bytes.len() as u64 } else { 0 };
    if has(UseSummaryOffset) {
        for (opcode, start, length) in groups {
            file.record(op::SUMMARY_OFFSET, Body::default().bytes(&[opcode]).u64(start).u64(length));
        }
    }
    let footer = Body::default().u64(if has_summary { summary_start } else { 0 }).u64(offsets);
    // The checksum covers the summary and the footer up to the checksum field, including the footer's header.
    let mut covered = file.bytes[summary_start as usize..].to_vec();
    covered.push(op::FOOTER);
    covered.extend(20u64.to_le_bytes());
    covered.extend(&footer.0);
    file.exact(op::FOOTER, &footer.u32(crc32fast::hash(&covered) as usize));
    file.bytes.extend(mcap::MAGIC);
    file.bytes
}

#[test]
fn every_combination_of_features_is_read_with_the_right_contents() {
    let folder = Folder::new();
    let mut files = 0;
    for input in inputs() {
        for features in variants(&input) {
            files += 1;
            let reader = open(&[folder.write("in.mcap", &file(&input, &features))]).unwrap();
            let of_file = &reader.files()[0];
            let channels: Vec<_> =
                of_file.channels().map(|(_, channel)| (channel.topic, channel.schema_name)).collect();
            let schema_name = if input.schema { "Example" } else { "" };
            let expected = input.channel.then(|| ("example".to_owned(), schema_name.to_owned()));
            assert_eq!(channels, Vec::from_iter(expected), "{input:?} {features:?}");
            assert_eq!(of_file.metadata("myMetadata").is_some(), input.metadata, "{input:?} {features:?}");
            assert_eq!(of_file.chunks(), usize::from(features.contains(&UseChunks)), "{input:?} {features:?}");
            let (seen, damage) = read_all(reader);
            let mut times_of_input = input.messages.to_vec();
            times_of_input.sort_unstable();
            assert_eq!((times(&seen), damage), (times_of_input, vec![]), "{input:?} {features:?}");
            assert!(seen.iter().all(|(_, topic, _, data)| topic == "example" && *data == [1, 2, 3]));
        }
    }
    assert_eq!(files, 416);
}

#[test]
fn the_files_of_the_matrix_are_valid() {
    for input in inputs() {
        for features in variants(&input) {
            let bytes = file(&input, &features);
            let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count();
            assert_eq!(messages, input.messages.len(), "{input:?} {features:?}");
        }
    }
}
