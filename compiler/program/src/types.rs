//! Types and their flattened layout (LANGUAGE 3, 9.2).

use std::fmt;

/// A type of the language. `Error` stands for a type that could not be determined and was reported.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Type {
    /// `real`
    Real,
    /// `int`
    Int,
    /// `bool`
    Bool,
    /// `vecN` of reals, 2 to 4.
    Vector(u8),
    /// `vecN<int>`, 2 to 4.
    IntVector(u8),
    /// `matWxH`: columns, rows; 2 to 4 each.
    Matrix {
        /// W.
        columns: u8,
        /// H.
        rows: u8,
    },
    /// `quat`
    Quat,
    /// A tuple; the empty one is the source of a concept without source.
    Tuple(Vec<Type>),
    /// `interval<T>`; T is what [`Type::is_end`] allows.
    Interval(Box<Type>),
    /// A csg tree.
    Csg,
    /// Reported elsewhere.
    Error,
}

/// The kind of one scalar of a flattened value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ScalarKind {
    /// A real.
    Real,
    /// An int.
    Int,
    /// A truth value.
    Bool,
}

impl Type {
    /// The scalars of the flattened value in order (LANGUAGE 9.2); none for csg.
    #[must_use]
    pub fn scalars(&self) -> Vec<ScalarKind> {
        match self {
            Self::Real => vec![ScalarKind::Real],
            Self::Int => vec![ScalarKind::Int],
            Self::Bool => vec![ScalarKind::Bool],
            Self::Vector(_) | Self::Matrix { .. } | Self::Quat => vec![ScalarKind::Real; self.len() as usize],
            Self::IntVector(n) => vec![ScalarKind::Int; usize::from(*n)],
            Self::Interval(inner) => [inner.scalars(), inner.scalars()].concat(),
            Self::Tuple(elements) => elements.iter().flat_map(Self::scalars).collect(),
            Self::Csg | Self::Error => Vec::new(),
        }
    }

    /// The number of scalars of the flattened value.
    #[must_use]
    pub fn len(&self) -> u32 {
        match self {
            Self::Real | Self::Int | Self::Bool => 1,
            Self::Vector(n) | Self::IntVector(n) => u32::from(*n),
            Self::Interval(inner) => 2 * inner.len(),
            Self::Matrix { columns, rows } => u32::from(*columns) * u32::from(*rows),
            Self::Quat => 4,
            Self::Tuple(elements) => elements.iter().map(Self::len).sum(),
            Self::Csg | Self::Error => 0,
        }
    }

    /// The number of scalars of the value while a program runs: an interval there has a third part after its ends, a
    /// bool for each of their scalars that says whether it may be NaN (LANGUAGE 15.6).
    #[must_use]
    pub fn width(&self) -> u32 {
        match self {
            Self::Interval(inner) => 3 * inner.len(),
            Self::Tuple(elements) => elements.iter().map(Self::width).sum(),
            other => other.len(),
        }
    }

    /// Calls `f` with each part that is no tuple, in order.
    pub fn each_part(&self, f: &mut impl FnMut(&Self)) {
        match self {
            Self::Tuple(elements) => elements.iter().for_each(|e| e.each_part(f)),
            other => f(other),
        }
    }

    /// Whether the value has no scalars.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether it is `int` or a vector of ints.
    #[must_use]
    pub const fn is_int(&self) -> bool {
        matches!(self, Self::Int | Self::IntVector(_))
    }

    /// Whether there are intervals with ends of this type (LANGUAGE 3.1).
    #[must_use]
    pub const fn is_end(&self) -> bool {
        matches!(self, Self::Real | Self::Int | Self::Vector(_) | Self::Matrix { .. })
    }

    /// The type of the ends of an interval; another type itself.
    #[must_use]
    pub fn ends(&self) -> &Self {
        match self {
            Self::Interval(inner) => inner,
            other => other,
        }
    }

    /// The interval with ends of this type.
    #[must_use]
    pub fn interval(self) -> Self {
        Self::Interval(Box::new(self))
    }

    /// Names of the flattened scalars below `root`: `at.x`, `m.x.y`, `t.0.z`, `i.start`; the root itself for a scalar.
    #[must_use]
    pub fn columns(&self, root: &str) -> Vec<String> {
        const FIELDS: [&str; 4] = ["x", "y", "z", "w"];
        let fields = |n: u8| FIELDS.iter().take(usize::from(n)).map(|f| format!("{root}.{f}"));
        match self {
            Self::Real | Self::Int | Self::Bool => vec![root.to_owned()],
            Self::Vector(n) | Self::IntVector(n) => fields(*n).collect(),
            Self::Interval(inner) => {
                ["start", "end"].into_iter().flat_map(|end| inner.columns(&format!("{root}.{end}"))).collect()
            }
            Self::Quat => fields(4).collect(),
            Self::Matrix { columns, rows } => fields(*columns).flat_map(|c| Self::Vector(*rows).columns(&c)).collect(),
            Self::Tuple(elements) => {
                elements.iter().enumerate().flat_map(|(i, t)| t.columns(&format!("{root}.{i}"))).collect()
            }
            Self::Csg | Self::Error => Vec::new(),
        }
    }
}

impl fmt::Display for Type {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Real => f.write_str("real"),
            Self::Int => f.write_str("int"),
            Self::Bool => f.write_str("bool"),
            Self::Vector(n) => write!(f, "vec{n}"),
            Self::IntVector(n) => write!(f, "vec{n}<int>"),
            Self::Interval(inner) => write!(f, "interval<{inner}>"),
            Self::Matrix { columns, rows } if columns == rows => write!(f, "mat{columns}"),
            Self::Matrix { columns, rows } => write!(f, "mat{columns}x{rows}"),
            Self::Quat => f.write_str("quat"),
            Self::Csg => f.write_str("csg"),
            Self::Error => f.write_str("?"),
            Self::Tuple(elements) => {
                f.write_str("(")?;
                for (i, t) in elements.iter().enumerate() {
                    if i > 0 {
                        f.write_str(", ")?;
                    }
                    t.fmt(f)?;
                }
                f.write_str(")")
            }
        }
    }
}
