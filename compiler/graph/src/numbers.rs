//! Scalars: their kinds, the two precisions of `real`, and values for evaluation at compile time.

use std::fmt;

/// The kind of a scalar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Scalar {
    /// IEEE binary32 or binary64, by [`Precision`].
    Real,
    /// 32-bit two's complement.
    Int,
    /// A truth value.
    Bool,
}

impl fmt::Display for Scalar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Real => "real",
            Self::Int => "int",
            Self::Bool => "bool",
        })
    }
}

/// What `real` is (LANGUAGE 17.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Precision {
    /// binary32
    #[default]
    F32,
    /// binary64
    F64,
}

impl Precision {
    /// `f32` or `f64`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// Bytes of a real.
    #[must_use]
    pub const fn bytes(self) -> u32 {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The nearest `real`.
    #[must_use]
    pub fn round(self, x: f64) -> f64 {
        match self {
            #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
            Self::F32 => f64::from(x as f32),
            Self::F64 => x,
        }
    }
}

/// A value at compile time. A real of precision f32 is held as the f64 that equals it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A real.
    Real(f64),
    /// An int.
    Int(i32),
    /// A truth value.
    Bool(bool),
}

impl Value {
    /// Its kind.
    #[must_use]
    pub const fn scalar(self) -> Scalar {
        match self {
            Self::Real(_) => Scalar::Real,
            Self::Int(_) => Scalar::Int,
            Self::Bool(_) => Scalar::Bool,
        }
    }

    /// The value 0 of a kind.
    #[must_use]
    pub const fn zero(scalar: Scalar) -> Self {
        match scalar {
            Scalar::Real => Self::Real(0.0),
            Scalar::Int => Self::Int(0),
            Scalar::Bool => Self::Bool(false),
        }
    }

    /// Equal bits, where all NaNs are one (LANGUAGE 17.1).
    #[must_use]
    pub fn same_bits(self, other: Self) -> bool {
        match (self, other) {
            (Self::Real(a), Self::Real(b)) => a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()),
            (a, b) => a == b,
        }
    }
}
