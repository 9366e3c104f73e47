//! Mistakes planted in a module that is right: what the comparison must see. Knows words of SPIR-V; judges nothing.

use isograd_graph::{Builder, Graph, Mode, Scalar, Unwatched};

use super::prepared::Prepared;

/// A mistake that leaves a module valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mistake {
    /// The operands of a difference the other way round.
    Difference,
    /// The results of a selection the other way round.
    Selection,
    /// A comparison the other way round.
    Comparison,
    /// What a branch gives, of the wrong side.
    Branch,
    /// The last bit of a constant.
    Constant,
    /// A column of outputs in the place of another.
    Offset,
    /// A result that is not stored.
    Store,
    /// A product that is a sum.
    Product,
}

impl Mistake {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Difference,
        Self::Selection,
        Self::Comparison,
        Self::Branch,
        Self::Constant,
        Self::Offset,
        Self::Store,
        Self::Product,
    ];

    /// Makes the mistake. `None` if the module has no place for it.
    #[must_use]
    pub fn plant(self, right: &Prepared) -> Option<Prepared> {
        let mut wrong = right.clone();
        if self == Self::Offset {
            let mut columns: Vec<&mut u32> =
                wrong.manifest.outputs.iter_mut().flat_map(|p| p.columns.iter_mut().map(|c| &mut c.offset)).collect();
            let [first, second, ..] = columns.as_mut_slice() else { return None };
            std::mem::swap(*first, *second);
            return Some(wrong);
        }
        let mut words: Vec<u32> =
            right.module.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        // The number of the type of reals, whose constants have one more bit.
        let real = instructions(&words).find(|at| opcode(&words, *at) == TYPE_FLOAT).map(|at| words[at + 1]);
        let places: Vec<usize> = instructions(&words)
            .filter(|at| match (self, opcode(&words, *at)) {
                (Self::Difference, FSUB) | (Self::Comparison, LESS) | (Self::Product, FMUL) => true,
                (Self::Selection, SELECT) | (Self::Branch, PHI) => Some(words[at + 1]) == real,
                (Self::Constant, CONSTANT) => Some(words[at + 1]) == real && words[at + 3] != 0,
                (Self::Store, STORE) => true,
                _ => false,
            })
            .collect();
        let at = *places.last()?;
        match self {
            Self::Difference => words.swap(at + 3, at + 4),
            Self::Selection => words.swap(at + 4, at + 5),
            Self::Branch => words.swap(at + 3, at + 5),
            Self::Comparison => words[at] = (words[at] & !0xffff) | GREATER,
            Self::Product => words[at] = (words[at] & !0xffff) | FADD,
            Self::Constant => words[at + 3] ^= 1,
            Self::Store | Self::Offset => words.splice(at..at + 3, [NOP; 3]).for_each(drop),
        }
        wrong.module = words.into_iter().flat_map(u32::to_le_bytes).collect();
        Some(wrong)
    }
}

const TYPE_FLOAT: u32 = 22;
const CONSTANT: u32 = 43;
const STORE: u32 = 62;
const FADD: u32 = 129;
const FSUB: u32 = 131;
const FMUL: u32 = 133;
const SELECT: u32 = 169;
const LESS: u32 = 184;
const GREATER: u32 = 186;
const PHI: u32 = 245;
/// A whole instruction that does nothing.
const NOP: u32 = 1 << 16;

fn opcode(words: &[u32], at: usize) -> u32 {
    words[at] & 0xffff
}

/// Where the instructions begin, after the head of five words.
fn instructions(words: &[u32]) -> impl Iterator<Item = usize> + '_ {
    std::iter::successors(Some(5), |at| Some(at + (words[*at] >> 16).max(1) as usize).filter(|at| *at < words.len()))
}

/// A graph with a place for each mistake, which shows it at every point where a < b.
///
/// # Panics
/// Never: it is small.
#[must_use]
pub fn graph() -> Graph {
    let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
    let (x, y) = (b.input("a", Scalar::Real), b.input("b", Scalar::Real));
    let less = b.lt(x, y);
    b.gamma(less);
    b.otherwise();
    let end = b.end();
    let side = b.join(end, x, y);
    let chosen = b.select(less, y, x);
    let difference = b.sub(side, chosen);
    let third = b.real(1.0 / 3.0);
    let product = b.mul(difference, third);
    let sum = b.add(product, x);
    b.output("product", product);
    b.output("sum", sum);
    b.finish().expect("no budget")
}
