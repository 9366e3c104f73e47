//! Columns of numbers, and their way into and out of a module's memory.

use isograd_compiler::{ColumnType, Precision};

/// Numbers of one input scalar: one per point, or a single one for all points. Reals may be given in either precision
/// and are rounded to the module's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Values<'a> {
    /// Reals.
    F32(&'a [f32]),
    /// Reals.
    F64(&'a [f64]),
    /// Ints, or bools as 0 and 1.
    I32(&'a [i32]),
}

impl Values<'_> {
    /// How many numbers.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self {
            Self::F32(x) => x.len(),
            Self::F64(x) => x.len(),
            Self::I32(x) => x.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The first number that does not lie between two ends, NaN included, and its place; `read` rounds it first.
    pub(crate) fn first_outside(&self, lo: f64, hi: f64, read: impl Fn(f64) -> f64) -> Option<(usize, f64)> {
        let outside = |x: &f64| !(lo..=hi).contains(&read(*x));
        match self {
            Self::F32(x) => x.iter().map(|x| f64::from(*x)).enumerate().find(|(_, x)| outside(x)),
            Self::F64(x) => x.iter().copied().enumerate().find(|(_, x)| outside(x)),
            Self::I32(x) => x.iter().map(|x| f64::from(*x)).enumerate().find(|(_, x)| outside(x)),
        }
    }

    /// Whether a scalar of this kind can be given so.
    pub(crate) const fn fits(&self, scalar: ColumnType) -> bool {
        matches!((self, scalar), (Self::I32(_), ColumnType::Int | ColumnType::Bool))
            || matches!((self, scalar), (Self::F32(_) | Self::F64(_), ColumnType::Real))
    }
}

/// Numbers of one output scalar, one per point. A module of precision f32 gives `F32`, one of f64 `F64`; ints and
/// bools (0 or 1) are `I32` in both.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Reals.
    F32(Vec<f32>),
    /// Reals.
    F64(Vec<f64>),
    /// Ints, or bools.
    I32(Vec<i32>),
}

impl Column {
    /// How many numbers.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self {
            Self::F32(x) => x.len(),
            Self::F64(x) => x.len(),
            Self::I32(x) => x.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of a point as f64, exactly.
    #[must_use]
    pub fn get(&self, point: usize) -> Option<f64> {
        match self {
            Self::F32(x) => x.get(point).map(|x| f64::from(*x)),
            Self::F64(x) => x.get(point).copied(),
            Self::I32(x) => x.get(point).map(|x| f64::from(*x)),
        }
    }

    pub(crate) fn zeros(scalar: ColumnType, precision: Precision, points: usize) -> Self {
        match (scalar, precision) {
            (ColumnType::Real, Precision::F32) => Self::F32(vec![0.0; points]),
            (ColumnType::Real, Precision::F64) => Self::F64(vec![0.0; points]),
            (ColumnType::Int | ColumnType::Bool, _) => Self::I32(vec![0; points]),
        }
    }

    /// Cuts the column into pieces for blocks of this many points.
    pub(crate) fn pieces(&mut self, block: usize) -> Vec<Piece<'_>> {
        match self {
            Self::F32(x) => x.chunks_mut(block).map(Piece::F32).collect(),
            Self::F64(x) => x.chunks_mut(block).map(Piece::F64).collect(),
            Self::I32(x) => x.chunks_mut(block).map(Piece::I32).collect(),
        }
    }
}

/// The part of an output column that one block fills.
pub(crate) enum Piece<'a> {
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
    I32(&'a mut [i32]),
}

impl Piece<'_> {
    /// Copies the block's results out of the module's memory.
    pub(crate) fn take(&mut self, bytes: &[u8]) {
        match self {
            Self::F32(to) => copy(to, bytes),
            Self::F64(to) => copy(to, bytes),
            Self::I32(to) => copy(to, bytes),
        }
    }
}

fn copy<T: bytemuck::Pod>(to: &mut [T], bytes: &[u8]) {
    let to: &mut [u8] = bytemuck::cast_slice_mut(to);
    let n = to.len().min(bytes.len());
    if let (Some(to), Some(from)) = (to.get_mut(..n), bytes.get(..n)) {
        to.copy_from_slice(from);
    }
}

/// Fills `count` elements of a column in the module's memory from `from` on (the one number again and again if there
/// is only one), and `padded − count` more with copies of the last.
pub(crate) fn put(
    values: Values<'_>,
    precision: Precision,
    from: usize,
    count: usize,
    padded: usize,
    bytes: &mut [u8],
) {
    match (values, precision) {
        (Values::F32(x), Precision::F32) => fill(x, from, count, padded, bytes, |x| x),
        (Values::F64(x), Precision::F64) => fill(x, from, count, padded, bytes, |x| x),
        #[expect(clippy::cast_possible_truncation, reason = "rounding to the module's precision")]
        (Values::F64(x), Precision::F32) => fill(x, from, count, padded, bytes, |x| x as f32),
        (Values::F32(x), Precision::F64) => fill(x, from, count, padded, bytes, f64::from),
        (Values::I32(x), _) => fill(x, from, count, padded, bytes, |x| x),
    }
}

fn fill<T: Copy, U: bytemuck::Pod>(
    values: &[T],
    from: usize,
    count: usize,
    padded: usize,
    bytes: &mut [u8],
    convert: impl Fn(T) -> U,
) {
    let to: &mut [U] = bytemuck::try_cast_slice_mut(bytes).unwrap_or(&mut []);
    let source = if values.len() == 1 { values } else { values.get(from..from + count).unwrap_or(&[]) };
    let Some(last) = source.last().copied() else { return };
    for (place, value) in to.iter_mut().zip(source) {
        *place = convert(*value);
    }
    to.iter_mut().take(padded).skip(source.len()).for_each(|place| *place = convert(last));
}
