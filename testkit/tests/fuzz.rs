//! The short form of the fuzz targets in `fuzz/`: the same laws on the seed corpus (every acceptance program, the
//! standard library, the examples), on 2,000 mutations of it and on 2,000 programs grown from seeds.

use std::fs;
use std::path::PathBuf;

use isograd_testkit::corpus;
use isograd_testkit::laws::{self, Judgement};
use isograd_testkit::points::Random;
use isograd_testkit::programs::{Choices, program};

const GENERATED: usize = 2_000;

/// Every program of the tests, the library and the examples.
fn corpus() -> Vec<String> {
    let programs: Vec<String> = corpus::all().into_iter().map(|(_, text)| text).collect();
    assert!(programs.len() > 900, "only {} programs", programs.len());
    programs
}

/// One to four edits: bytes exchanged, pieces taken out, doubled, or brought from another program.
fn mutated(random: &mut Random, corpus: &[String]) -> Vec<u8> {
    let mut bytes = corpus[random.below(corpus.len())].clone().into_bytes();
    let piece = |random: &mut Random, bytes: &[u8]| {
        let from = random.below(bytes.len() + 1);
        let to = (from + random.below(40)).min(bytes.len());
        from..to
    };
    for _ in 0..=random.below(4) {
        let at = piece(random, &bytes);
        match random.below(5) {
            0 => drop(bytes.drain(at)),
            1 => {
                let copy = bytes[at.clone()].to_vec();
                bytes.splice(at.end..at.end, copy);
            }
            2 => {
                let other = corpus[random.below(corpus.len())].as_bytes();
                let from = piece(random, other);
                bytes.splice(at, other[from].iter().copied());
            }
            3 => {
                let token = b"(){}[]<>,;:.=+-*/%!&|#\"'\\0 \n\xff\xc3"[random.below(28)];
                bytes.insert(at.start, token);
            }
            _ => {
                for byte in &mut bytes[at.start..(at.start + 1).min(at.end)] {
                    *byte ^= 1 << random.below(8);
                }
            }
        }
    }
    bytes
}

fn holds(judgement: Judgement) -> usize {
    judgement.unwrap_or_else(|failure| panic!("{failure}")).judged
}

#[test]
fn the_corpus_and_its_mutations_are_read_checked_and_specialised() {
    let corpus = corpus();
    let mut random = Random::new(2026);
    let mutations: Vec<Vec<u8>> = (0..GENERATED).map(|_| mutated(&mut random, &corpus)).collect();
    let mut exports = 0;
    for bytes in corpus.iter().map(String::as_bytes).chain(mutations.iter().map(Vec::as_slice)) {
        holds(laws::parsed(bytes));
        holds(laws::checked(bytes));
        exports += holds(laws::elaborated(bytes));
    }
    println!("{} programs, {GENERATED} mutations: {exports} exports specialised", corpus.len());
    assert!(exports > corpus.len(), "only {exports} exports were specialised");
}

#[test]
fn grown_programs_have_no_errors() {
    let mut exports = 0;
    for seed in 0..GENERATED as u64 {
        let judgement = laws::structured(Choices::Seeded(Random::new(seed)));
        exports += judgement.unwrap_or_else(|failure| panic!("seed {seed}: {failure}")).judged;
    }
    println!("{GENERATED} grown programs: {exports} exports specialised");
    assert!(exports * 10 > GENERATED * 2 * 9, "only {exports} exports were specialised");
}

#[test]
fn programs_are_grown_by_their_choices() {
    let grown = |seed| program(Choices::Seeded(Random::new(seed)));
    assert_eq!(grown(1), grown(1));
    assert_ne!(grown(1), grown(2));
    assert_eq!(program(Choices::Bytes(&[])), program(Choices::Bytes(&[0; 64])));
}

/// Gives the fuzzer its seeds: a file for each program, in the folder that `ISOGRAD_SEEDS` names.
#[test]
fn seeds() {
    let Some(folder) = std::env::var_os("ISOGRAD_SEEDS").map(PathBuf::from) else { return };
    fs::create_dir_all(&folder).expect("the folder of seeds");
    for (name, text) in corpus::all() {
        fs::write(folder.join(name), text).expect("a seed");
    }
}
