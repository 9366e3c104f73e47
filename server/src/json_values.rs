//! Values of parameters written in JSON: one value, or a list with one value per point.
//! Reads into two flat lists, so that a large body costs little more than its numbers; knows no type until asked.

use std::fmt;

use isograd_compiler::{Parameter, Rate, ScalarKind, Type};
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
    /// The values of a parameter: one if the shape is that of its type, nested or flattened, many if it is a list of
    /// such. A type of n ≥ 1 scalars cannot be both, because a list of k values has k·n scalars and a value n, and a
    /// list of one value is nested deeper than the value.
    ///
    /// # Errors
    /// Which value does not fit, and what would.
    pub fn values(&self, parameter: &Parameter) -> Result<Values, Misfit> {
        let kinds = parameter.ty.scalars();
        let end = self.marks.len();
        if matches(&parameter.ty, &self.marks) == Some(end) {
            return self.columns(parameter, &kinds, Rate::Uniform);
        }
        let Some((Mark::Open, list)) = self.marks.split_first() else { return Err(self.misfit(parameter, None)) };
        let mut rest = list;
        let mut index = 0;
        while rest.first() != Some(&Mark::Close) {
            let Some(after) = matches(&parameter.ty, rest).and_then(|n| rest.get(n..)) else {
                return Err(self.misfit(parameter, Some(index)));
            };
            rest = after;
            index += 1;
        }
        self.columns(parameter, &kinds, Rate::Varying)
    }

    /// Deals the scalars out to columns, checking kinds.
    fn columns(&self, parameter: &Parameter, kinds: &[ScalarKind], rate: Rate) -> Result<Values, Misfit> {
        let points = self.scalars.len() / kinds.len().max(1);
        let mut columns: Vec<Vec<f64>> = kinds.iter().map(|_| Vec::with_capacity(points)).collect();
        let marks = self.marks.iter().filter(|m| matches!(m, Mark::Number | Mark::Truth));
        let mut scalars = self.scalars.iter().zip(marks);
        for index in 0..points {
            for (i, (kind, column)) in kinds.iter().zip(&mut columns).enumerate() {
                let Some((x, mark)) = scalars.next() else { continue };
                let fitting = match (kind, mark) {
                    (ScalarKind::Real, Mark::Truth) => Err("a number"),
                    (ScalarKind::Int, Mark::Truth) => Err("an int"),
                    _ => fits(*kind, *x),
                };
                let fitting = fitting.map_err(|expected| {
                    let names = parameter.ty.columns(&parameter.name);
                    let name = names.get(i).map_or(parameter.name.as_str(), String::as_str);
                    let found = if *mark == Mark::Truth { (*x == 1.0).to_string() } else { x.to_string() };
                    let place = if rate == Rate::Varying { format!(" in value {index}") } else { String::new() };
                    Misfit(format!("`{name}`{place} is {found}; expected {expected}"))
                });
                column.push(fitting?);
            }
        }
        Ok(Values { rate, columns })
    }

    fn misfit(&self, parameter: &Parameter, index: Option<usize>) -> Misfit {
        let example = example(&parameter.ty);
        let place = match index {
            Some(index) if self.marks.get(1) == Some(&Mark::Open) || parameter.ty.len() == 1 => {
                format!("value {index} of {} has", describe(parameter))
            }
            _ => format!("{} has", describe(parameter)),
        };
        Misfit(format!(
            "{place} the wrong shape: expected one value such as {example}, or a list of them, one per point"
        ))
    }
}

/// How many marks a value of the type takes at the start of `marks`; `None` if there is none.
fn matches(ty: &Type, marks: &[Mark]) -> Option<usize> {
    if matches!(ty, Type::Real | Type::Int | Type::Bool) {
        return matches!(marks.first()?, Mark::Number | Mark::Truth).then_some(1);
    }
    if *marks.first()? != Mark::Open {
        return None;
    }
    let flat = ty.len() as usize;
    let scalars = marks.get(1..=flat).is_some_and(|m| m.iter().all(|m| matches!(m, Mark::Number | Mark::Truth)));
    if scalars && marks.get(flat + 1) == Some(&Mark::Close) {
        return Some(flat + 2);
    }
    let mut at = 1;
    let mut element = |ty: &Type| {
        at += matches(ty, marks.get(at..)?)?;
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

/// `[0.0, 0.0, 0.0]`, as a message shows it.
fn example(ty: &Type) -> String {
    let list = |elements: Vec<String>| format!("[{}]", elements.join(", "));
    match ty {
        Type::Int => "0".to_owned(),
        Type::Bool => "false".to_owned(),
        Type::Vector(n) => list(vec!["0.0".to_owned(); usize::from(*n)]),
        Type::IntVector(n) => list(vec!["0".to_owned(); usize::from(*n)]),
        Type::Quat => "[0.0, 0.0, 0.0, 1.0]".to_owned(),
        Type::Interval(inner) => list(vec![example(inner); 2]),
        Type::Matrix { columns, rows } => list(vec![example(&Type::Vector(*rows)); usize::from(*columns)]),
        Type::Tuple(elements) => list(elements.iter().map(example).collect()),
        Type::Real | Type::Csg | Type::Error => "0.0".to_owned(),
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
        let shaped: Shaped = serde_json::from_str(text).map_err(|e| e.to_string())?;
        shaped.values(&Parameter { name: "p".to_owned(), ty, default: None, range: None }).map_err(|m| m.0)
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
