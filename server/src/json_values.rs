//! Values of arguments written in JSON: one value, or a list with one value per point.
//! Reads into two flat lists, so that a large body costs little more than its numbers; knows no type until asked.

use std::fmt;

use isograd_compiler::{Argument, Rate, Role, ScalarKind, Type};
use serde::de::{self, Deserialize, DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};

use crate::values::{Misfit, Values, describe, fits};

/// What stands in the JSON, in the order of reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mark {
    /// `[`
    Open,
    /// `]`
    Close,
    /// A number, or "nan", "inf", "-inf".
    Number,
    /// `true` or `false`.
    Truth,
}

/// A JSON value of numbers, truth values and lists.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Shaped {
    marks: Vec<Mark>,
    scalars: Vec<f64>,
}

/// An object of such values, in order, duplicates kept so that they can be reported.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Named(pub Vec<(String, Shaped)>);

impl Shaped {
    /// The values of an argument: one if the shape is that of its type, nested or flattened, many if it is a list of
    /// such. In a box a real may be `[start, end]`; a number is both its ends. What can be read as one value is one.
    /// Where no reals are boxes a type of n ≥ 1 scalars cannot be both, because a list of k values has k·n scalars and
    /// a value n, and a list of one value is nested deeper than the value.
    ///
    /// # Errors
    /// Which value does not fit, and what would.
    pub fn values(&self, argument: &Argument) -> Result<Values, Misfit> {
        let shape = Shape { kinds: argument.ty.scalars(), boxed: argument.role == Role::Box };
        let mut ends = Vec::new();
        if shape.matches(&argument.ty, &self.marks, &mut ends) == Some(self.marks.len()) {
            return self.columns(argument, &shape, &ends, Rate::Uniform);
        }
        ends.clear();
        match shape.list(&argument.ty, &self.marks, &mut ends) {
            Ok(()) => self.columns(argument, &shape, &ends, Rate::Varying),
            Err(index) => Err(self.misfit(argument, index)),
        }
    }

    /// Deals the scalars out to columns, checking kinds. In a box, `ends` are the numbers that stand for each scalar.
    fn columns(&self, argument: &Argument, shape: &Shape, ends: &[u8], rate: Rate) -> Result<Values, Misfit> {
        let given = if shape.boxed { ends.len() } else { self.scalars.len() };
        let points = given / shape.kinds.len().max(1);
        let mut columns: Vec<Vec<f64>> = argument.columns.iter().map(|_| Vec::with_capacity(points)).collect();
        let marks = self.marks.iter().filter(|m| matches!(m, Mark::Number | Mark::Truth));
        let mut scalars = self.scalars.iter().zip(marks);
        let mut ends = ends.iter();
        for index in 0..points {
            let mut columns = argument.columns.iter().zip(&mut columns);
            for kind in &shape.kinds {
                let given = ends.next().copied().unwrap_or(1);
                let mut number = None;
                for end in 0..shape.columns(*kind) {
                    let Some((column, place)) = columns.next() else { continue };
                    if end < given
                        && let Some((x, mark)) = scalars.next()
                    {
                        number = Some(fitting(*kind, *x, *mark).map_err(|expected| {
                            let name = &column.name;
                            let found = if *mark == Mark::Truth { (*x == 1.0).to_string() } else { x.to_string() };
                            let at = if rate == Rate::Varying { format!(" in value {index}") } else { String::new() };
                            Misfit(format!("`{name}`{at} is {found}; expected {expected}"))
                        })?);
                    }
                    place.extend(number);
                }
            }
        }
        Ok(Values { rate, columns })
    }

    fn misfit(&self, argument: &Argument, index: Option<usize>) -> Misfit {
        let boxed = argument.role == Role::Box;
        let example = example(&argument.ty, boxed);
        let place = match index {
            Some(index) if self.marks.get(1) == Some(&Mark::Open) || argument.ty.len() == 1 => {
                format!("value {index} of {} has", describe(argument))
            }
            _ => format!("{} has", describe(argument)),
        };
        // Boxes where points are expected have the shape of boxes, and not that of points.
        let as_box = Shape { kinds: argument.ty.scalars(), boxed: true };
        let whole = as_box.matches(&argument.ty, &self.marks, &mut Vec::new()) == Some(self.marks.len());
        let is_box = !boxed && (whole || as_box.list(&argument.ty, &self.marks, &mut Vec::new()).is_ok());
        let hint = match argument.role {
            Role::Point if is_box => format!(
                "; boxes are for the parameters that `bound` and `lipschitz` range over, by the name `{}.box` if other \
                 queries need the point",
                argument.name
            ),
            _ => String::new(),
        };
        Misfit(format!(
            "{place} the wrong shape: expected one value such as {example}, or a list of them, one per point{hint}"
        ))
    }
}

/// The shape of an argument's values.
struct Shape {
    kinds: Vec<ScalarKind>,
    /// Whether reals may be `[start, end]`.
    boxed: bool,
}

impl Shape {
    /// Reads a list of values; `ends` gets how many numbers stand for each scalar.
    ///
    /// # Errors
    /// Which value does not fit, or none if there is no list.
    fn list(&self, ty: &Type, marks: &[Mark], ends: &mut Vec<u8>) -> Result<(), Option<usize>> {
        let Some((Mark::Open, mut rest)) = marks.split_first() else { return Err(None) };
        let mut index = 0;
        while rest.first() != Some(&Mark::Close) {
            rest = self.matches(ty, rest, ends).and_then(|n| rest.get(n..)).ok_or(Some(index))?;
            index += 1;
        }
        Ok(())
    }

    /// How many columns a scalar of this kind has.
    fn columns(&self, kind: ScalarKind) -> u8 {
        if self.boxed && kind == ScalarKind::Real { 2 } else { 1 }
    }

    /// How many marks a scalar takes at the start of `marks`; `None` if there is none.
    fn scalar(&self, kind: ScalarKind, marks: &[Mark], ends: &mut Vec<u8>) -> Option<usize> {
        const SCALAR: [Mark; 2] = [Mark::Number, Mark::Truth];
        match marks {
            [first, ..] if SCALAR.contains(first) => {
                if self.boxed {
                    ends.push(1);
                }
                Some(1)
            }
            [Mark::Open, start, end, Mark::Close, ..]
                if self.columns(kind) == 2 && SCALAR.contains(start) && SCALAR.contains(end) =>
            {
                ends.push(2);
                Some(4)
            }
            _ => None,
        }
    }

    /// How many marks a value of the type takes at the start of `marks`; `None` if there is none.
    fn matches(&self, ty: &Type, marks: &[Mark], ends: &mut Vec<u8>) -> Option<usize> {
        match ty {
            Type::Real => return self.scalar(ScalarKind::Real, marks, ends),
            Type::Int => return self.scalar(ScalarKind::Int, marks, ends),
            Type::Bool => return self.scalar(ScalarKind::Bool, marks, ends),
            _ => {}
        }
        if *marks.first()? != Mark::Open {
            return None;
        }
        let before = ends.len();
        if let Some(end) = self.flat(ty, marks, ends) {
            return Some(end);
        }
        ends.truncate(before);
        let mut at = 1;
        let mut element = |ty: &Type| {
            at += self.matches(ty, marks.get(at..)?, ends)?;
            Some(())
        };
        match ty {
            Type::Tuple(elements) => elements.iter().try_for_each(&mut element)?,
            Type::Matrix { columns, rows } => (0..*columns).try_for_each(|_| element(&Type::Vector(*rows)))?,
            Type::Interval(inner) => (0..2).try_for_each(|_| element(inner))?,
            _ => return None,
        }
        (marks.get(at) == Some(&Mark::Close)).then_some(at + 1)
    }

    /// The same for one list of all scalars of the type.
    fn flat(&self, ty: &Type, marks: &[Mark], ends: &mut Vec<u8>) -> Option<usize> {
        let mut at = 1;
        let mut scalar = |kind| {
            at += self.scalar(kind, marks.get(at..)?, ends)?;
            Some(())
        };
        match ty {
            Type::IntVector(n) => (0..*n).try_for_each(|_| scalar(ScalarKind::Int))?,
            Type::Vector(_) | Type::Quat | Type::Matrix { .. } => {
                (0..ty.len()).try_for_each(|_| scalar(ScalarKind::Real))?;
            }
            _ => ty.scalars().into_iter().try_for_each(scalar)?,
        }
        (marks.get(at) == Some(&Mark::Close)).then_some(at + 1)
    }
}

/// A number of a kind, or what was expected.
fn fitting(kind: ScalarKind, x: f64, mark: Mark) -> Result<f64, &'static str> {
    match (kind, mark) {
        (ScalarKind::Real, Mark::Truth) => Err("a number"),
        (ScalarKind::Int, Mark::Truth) => Err("an int"),
        _ => fits(kind, x),
    }
}

/// `[0.0, 0.0, 0.0]`, in a box `[[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]]`, as a message shows it.
fn example(ty: &Type, boxed: bool) -> String {
    let list = |elements: Vec<String>| format!("[{}]", elements.join(", "));
    let real = if boxed { "[0.0, 1.0]" } else { "0.0" };
    match ty {
        Type::Int => "0".to_owned(),
        Type::Bool => "false".to_owned(),
        Type::Vector(n) => list(vec![real.to_owned(); usize::from(*n)]),
        Type::IntVector(n) => list(vec!["0".to_owned(); usize::from(*n)]),
        Type::Quat if boxed => list(vec![real.to_owned(); 4]),
        Type::Quat => "[0.0, 0.0, 0.0, 1.0]".to_owned(),
        Type::Interval(inner) => list(vec![example(inner, boxed); 2]),
        Type::Matrix { columns, rows } => list(vec![example(&Type::Vector(*rows), boxed); usize::from(*columns)]),
        Type::Tuple(elements) => list(elements.iter().map(|ty| example(ty, boxed)).collect()),
        Type::Real | Type::Csg | Type::Error => real.to_owned(),
    }
}

impl<'de> Deserialize<'de> for Shaped {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut shaped = Self::default();
        Reader(&mut shaped).deserialize(deserializer)?;
        Ok(shaped)
    }
}

struct Reader<'a>(&'a mut Shaped);

impl<'de> DeserializeSeed<'de> for Reader<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl Reader<'_> {
    fn push(self, mark: Mark, x: f64) {
        self.0.marks.push(mark);
        self.0.scalars.push(x);
    }
}

impl<'de> Visitor<'de> for Reader<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, \"nan\", \"inf\", \"-inf\", true, false, or a list of these")
    }

    fn visit_bool<E>(self, x: bool) -> Result<(), E> {
        self.push(Mark::Truth, f64::from(u8::from(x)));
        Ok(())
    }

    fn visit_f64<E>(self, x: f64) -> Result<(), E> {
        self.push(Mark::Number, x);
        Ok(())
    }

    #[expect(clippy::cast_precision_loss, reason = "an integer beyond 2^53 is a real here, rounded like any other")]
    fn visit_i64<E>(self, x: i64) -> Result<(), E> {
        self.push(Mark::Number, x as f64);
        Ok(())
    }

    #[expect(clippy::cast_precision_loss, reason = "an integer beyond 2^53 is a real here, rounded like any other")]
    fn visit_u64<E>(self, x: u64) -> Result<(), E> {
        self.push(Mark::Number, x as f64);
        Ok(())
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<(), E> {
        let x = match text {
            "nan" => f64::NAN,
            "inf" => f64::INFINITY,
            "-inf" => f64::NEG_INFINITY,
            _ => return Err(E::invalid_value(de::Unexpected::Str(text), &self)),
        };
        self.push(Mark::Number, x);
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        self.0.marks.push(Mark::Open);
        while list.next_element_seed(Reader(self.0))?.is_some() {}
        self.0.marks.push(Mark::Close);
        Ok(())
    }
}

impl<'de> Deserialize<'de> for Named {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Object;
        impl<'de> Visitor<'de> for Object {
            type Value = Named;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of values by parameter name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Named, A::Error> {
                let mut named = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    named.push(entry);
                }
                Ok(Named(named))
            }
        }
        deserializer.deserialize_map(Object)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(ty: Type, text: &str) -> Result<Values, String> {
        given(&ty, "value", text)
    }

    fn given(ty: &Type, query: &str, text: &str) -> Result<Values, String> {
        let shaped: Shaped = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let arguments = isograd_compiler::arguments([("p", ty)], &[query.parse().unwrap()]);
        shaped.values(&arguments[0]).map_err(|m| m.0)
    }

    #[test]
    fn a_box_has_two_ends_for_each_real() {
        let boxes = |ty: &Type, text: &str| given(ty, "bound(p)", text);
        let one = |ty: &Type, text: &str| {
            let values = boxes(ty, text).unwrap();
            assert_eq!(values.rate, Rate::Uniform, "{text}");
            values.columns.iter().map(|c| c[0]).collect::<Vec<_>>()
        };
        let (real, vec2) = (Type::Real, Type::Vector(2));
        assert_eq!(one(&real, "[1, 2]"), [1.0, 2.0]);
        assert_eq!(one(&real, "1"), [1.0, 1.0]);
        assert_eq!(one(&vec2, "[[2, 1], [3, 4]]"), [2.0, 1.0, 3.0, 4.0]);
        assert_eq!(one(&vec2, "[5, [3, \"inf\"]]"), [5.0, 5.0, 3.0, f64::INFINITY]);
        let many = boxes(&vec2, "[[[1, 2], [3, 4]], [5, 6]]").unwrap();
        assert_eq!(many.rate, Rate::Varying);
        assert_eq!(many.columns, [[1.0, 5.0], [2.0, 5.0], [3.0, 6.0], [4.0, 6.0]]);
        let mixed = Type::Tuple(vec![Type::Real, Type::Int, vec2.clone()]);
        assert_eq!(one(&mixed, "[[1, 2], 3, [[4, 5], 6]]"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.0]);
        assert_eq!(one(&mixed, "[[1, 2], 3, 4, [5, 6]]"), [1.0, 2.0, 3.0, 4.0, 4.0, 5.0, 6.0]);

        let wrong = |ty, text| boxes(ty, text).unwrap_err();
        assert!(wrong(&mixed, "[1, [3, 4], [5, 6]]").contains("such as [[0.0, 1.0], 0, [[0.0, 1.0], [0.0, 1.0]]]"));
        assert!(wrong(&vec2, "[[1, 2, 3], 4]").contains("the box `p: vec2` (p.x.start, p.x.end, p.y.start, p.y.end)"));
        assert_eq!(wrong(&vec2, "[[1, true], 4]"), "`p.x.end` is true; expected a number");
        let point = given(&Type::Vector(3), "value", "[[1, 2], 3, 4]").unwrap_err();
        assert!(point.contains("by the name `p.box`"), "{point}");
        assert!(!given(&Type::Vector(3), "value", "[1, 3]").unwrap_err().contains("p.box"));
    }

    fn one(ty: Type, text: &str) -> Vec<f64> {
        let values = read(ty, text).unwrap();
        assert_eq!(values.rate, Rate::Uniform, "{text}");
        values.columns.iter().map(|c| c[0]).collect()
    }

    fn many(ty: Type, text: &str) -> Vec<Vec<f64>> {
        let values = read(ty, text).unwrap();
        assert_eq!(values.rate, Rate::Varying, "{text}");
        values.columns
    }

    #[test]
    fn the_shape_says_whether_there_is_one_value_or_many() {
        let mat2 = Type::Matrix { columns: 2, rows: 2 };
        let pair = Type::Tuple(vec![Type::Real, Type::Vector(2)]);
        assert_eq!(one(Type::Real, "0.5"), [0.5]);
        assert_eq!(many(Type::Real, "[0.5]"), [[0.5]]);
        assert_eq!(many(Type::Real, "[]"), [[0.0; 0]]);
        assert_eq!(one(Type::Vector(2), "[1, 2]"), [1.0, 2.0]);
        assert_eq!(many(Type::Vector(2), "[[1,2],[3,4]]"), [[1.0, 3.0], [2.0, 4.0]]);
        assert_eq!(one(mat2.clone(), "[1,2,3,4]"), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(one(mat2.clone(), "[[1,2],[3,4]]"), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(many(mat2.clone(), "[[1,2,3,4]]"), [[1.0], [2.0], [3.0], [4.0]]);
        assert_eq!(many(mat2, "[[[1,2],[3,4]],[5,6,7,8]]"), [[1.0, 5.0], [2.0, 6.0], [3.0, 7.0], [4.0, 8.0]]);
        assert_eq!(one(pair.clone(), "[1,[2,3]]"), [1.0, 2.0, 3.0]);
        assert_eq!(one(pair.clone(), "[1,2,3]"), [1.0, 2.0, 3.0]);
        assert_eq!(many(pair, "[[1,[2,3]]]"), [[1.0], [2.0], [3.0]]);
        assert_eq!(one(Type::Bool, "true"), [1.0]);
        assert_eq!(many(Type::Bool, "[0, true]"), [[0.0, 1.0]]);
        assert_eq!(one(Type::Real, "\"-inf\""), [f64::NEG_INFINITY]);
    }

    #[test]
    fn what_does_not_fit_is_named_with_its_place() {
        let error = |ty, text| read(ty, text).unwrap_err();
        let message = error(Type::Vector(3), "[[1,2,3],[1,2]]");
        assert!(message.contains("value 1 of `p: vec3`") && message.contains("[0.0, 0.0, 0.0]"), "{message}");
        assert!(error(Type::Vector(3), "[1,2]").starts_with("`p: vec3` (p.x, p.y, p.z) has the wrong shape"));
        assert!(error(Type::Vector(3), "1").contains("wrong shape"));
        assert!(error(Type::Real, "[[1]]").contains("wrong shape"));
        assert_eq!(
            error(Type::Int, "[1, 2.5]"),
            "`p` in value 1 is 2.5; expected an int from -2147483648 to 2147483647"
        );
        assert_eq!(error(Type::Vector(2), "[1, true]"), "`p.y` is true; expected a number");
        assert_eq!(error(Type::Bool, "2"), "`p` is 2; expected true, false, 0 or 1");
        assert!(error(Type::Real, "\"one\"").contains("expected a number, \"nan\""));
        assert!(error(Type::Real, "null").contains("expected a number"));
        assert!(error(Type::Real, "{}").contains("expected a number"));
    }

    #[test]
    fn deep_nesting_is_an_error() {
        let text = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
        assert!(read(Type::Real, &text).unwrap_err().contains("recursion limit"));
    }
}
