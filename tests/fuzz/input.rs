//! Inputs: what a real encoder wrote with some of it changed, and random bytes.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use std::fmt;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::rc::Rc;

/// The bytes of each file of an input.
#[derive(Clone)]
pub(crate) struct Input(pub(crate) Vec<Vec<u8>>);

impl fmt::Debug for Input {
    /// The bytes themselves are for a file.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lengths: Vec<usize> = self.0.iter().map(Vec::len).collect();
        write!(formatter, "files of {lengths:?} bytes")
    }
}

impl Input {
    /// The input that lies in a folder.
    pub(crate) fn read(folder: &Path, names: &[&str]) -> Self {
        let file =
            |name: &&str| fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{folder:?}: {name}: {error}"));
        Self(names.iter().map(file).collect())
    }

    /// Writes its files to a folder.
    pub(crate) fn write(&self, folder: &Path, names: &[&str]) {
        for (name, bytes) in names.iter().zip(&self.0) {
            // Not emptied first: some file systems then write to the disk at once, which takes longer than all else.
            let mut file = File::options().write(true).create(true).truncate(false).open(folder.join(name)).unwrap();
            file.write_all(bytes).unwrap();
            file.set_len(bytes.len() as u64).unwrap();
        }
    }

    /// Bytes of all files.
    pub(crate) fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }
}

/// Inputs made from `seeds`, which are of `files` files each. `words` mean something in a text of this kind.
pub(crate) fn inputs(
    seeds: Vec<Input>,
    files: usize,
    words: &'static [&'static str],
) -> impl Strategy<Value = Input> + use<> {
    let seeds: Rc<[Input]> = seeds.into();
    let changed = (any::<Index>(), vec(change(words), 1..8)).prop_map(move |(seed, changes)| {
        let mut input = seed.get(&seeds).clone();
        changes.iter().for_each(|change| change.apply(&mut input, &seeds));
        input
    });
    let random = vec(vec(any::<u8>(), 0..200), files).prop_map(Input);
    prop_oneof![15 => changed, 1 => random]
}

/// One change of an input.
#[derive(Clone, Debug)]
struct Change {
    file: Index,
    at: Index,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    /// Bits of one byte are turned over.
    Flip(u8),
    /// These bytes stand there in the place of others.
    Overwrite(Vec<u8>),
    Insert(Vec<u8>),
    Remove(usize),
    /// All that follows is missing.
    Cut,
    /// Some bytes stand there again and again.
    Repeat {
        length: usize,
        times: usize,
    },
    /// A part of a seed is put in.
    Splice {
        seed: Index,
        from: Index,
        length: usize,
    },
}

fn change(words: &'static [&'static str]) -> impl Strategy<Value = Change> {
    let number = prop_oneof![number(), number(), word(words)];
    let kind = prop_oneof![
        4 => any::<u8>().prop_map(|bits| Kind::Flip(bits.max(1))),
        4 => number.clone().prop_map(Kind::Overwrite),
        3 => number.prop_map(Kind::Insert),
        2 => (1..40_usize).prop_map(Kind::Remove),
        1 => Just(Kind::Cut),
        1 => (1..200_usize, 1..30_usize).prop_map(|(length, times)| Kind::Repeat { length, times }),
        2 => (any::<Index>(), any::<Index>(), 1..300_usize)
            .prop_map(|(seed, from, length)| Kind::Splice { seed, from, length }),
    ];
    (any::<Index>(), any::<Index>(), kind).prop_map(|(file, at, kind)| Change { file, at, kind })
}

/// A number of 1, 2, 4 or 8 bytes in either byte order: mostly one at which lengths go wrong.
fn number() -> impl Strategy<Value = Vec<u8>> + Clone {
    const EDGES: [u64; 16] = [
        0,
        1,
        0x7f,
        0x80,
        0xff,
        0x7fff,
        0xffff,
        0x10_0000,
        0x7fff_ffff,
        0x8000_0000,
        0xffff_ffff,
        1 << 40,
        0x7ff0_0000_0000_0000, // An infinite number.
        0x7fff_ffff_ffff_ffff,
        0xffff_ffff_ffff_fff7,
        u64::MAX,
    ];
    let value = prop_oneof![3 => select(EDGES.to_vec()), 1 => any::<u64>()];
    (value, select(vec![1_usize, 2, 4, 8]), any::<bool>()).prop_map(|(value, width, is_big_endian)| match is_big_endian
    {
        true => value.to_be_bytes()[8 - width..].to_vec(),
        false => value.to_le_bytes()[..width].to_vec(),
    })
}

fn word(words: &'static [&'static str]) -> impl Strategy<Value = Vec<u8>> + Clone {
    let words: Vec<Vec<u8>> = words.iter().map(|word| word.as_bytes().to_vec()).collect();
    select(if words.is_empty() { vec![vec![0]] } else { words })
}

impl Change {
    fn apply(&self, input: &mut Input, seeds: &[Input]) {
        let file = self.file.index(input.0.len());
        let bytes = &mut input.0[file];
        let at = self.at.index(bytes.len() + 1);
        let end = |length: usize| (at + length).min(bytes.len());
        match &self.kind {
            Kind::Flip(bits) => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= bits),
            Kind::Overwrite(new) => drop(bytes.splice(at..end(new.len()), new.iter().copied())),
            Kind::Insert(new) => drop(bytes.splice(at..at, new.iter().copied())),
            Kind::Remove(length) => drop(bytes.drain(at..end(*length))),
            Kind::Cut => bytes.truncate(at),
            Kind::Repeat { length, times } => {
                let again = bytes[at..end(*length)].repeat(*times);
                bytes.splice(at..at, again);
            }
            Kind::Splice { seed, from, length } => {
                let other = &seed.get(seeds).0[file];
                let from = from.index(other.len() + 1);
                let part = &other[from..(from + length).min(other.len())];
                bytes.splice(at..at, part.iter().copied());
            }
        }
    }
}
