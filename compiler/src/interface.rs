//! What a host gives an export so that queries can be answered: points, boxes, directions. Knows parameters and
//! queries; knows nothing of how either is computed or written.

use isograd_program::{ScalarKind, Type};
use isograd_transform::Source;
use serde::{Deserialize, Serialize};

use crate::{Query, Wrt};

/// What numbers of a parameter are given for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Its value.
    #[default]
    Point,
    /// The ends between which its reals may lie; its other scalars have a value.
    Box,
    /// How fast its reals change along a direction.
    Direction,
}

/// What a host gives for one parameter in one role.
#[derive(Debug, Clone, PartialEq)]
pub struct Argument {
    /// The index of the parameter.
    pub parameter: usize,
    /// In which role.
    pub role: Role,
    /// The name to give it by: `at`, `at.box` where the point is given as well, `at.direction`.
    pub name: String,
    /// The type that has its scalars; in a box each real has two ends.
    pub ty: Type,
    /// Its numbers in order.
    pub columns: Vec<ArgumentColumn>,
}

/// One number of an [`Argument`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArgumentColumn {
    /// Its name: `at.x`, `at.x.start`, `at.x.end`, `at.x.direction`.
    pub name: String,
    /// What it holds.
    pub kind: ScalarKind,
    /// The index of the parameter's scalar that it is about.
    pub scalar: usize,
    /// What it is to the inputs of the export, which count the scalars of all parameters.
    pub source: Source,
}

/// What must be given for the queries, in the order of the parameters and for each its point, box and direction. A
/// parameter that ranges over a box in every query has no point.
#[must_use]
pub fn arguments<'a>(parameters: impl IntoIterator<Item = (&'a str, &'a Type)>, queries: &[Query]) -> Vec<Argument> {
    let mut arguments = Vec::new();
    let mut before = 0;
    for (index, (name, ty)) in parameters.into_iter().enumerate() {
        let parameter = Described { index, name, ty, before };
        before += ty.len() as usize;
        let has_reals = ty.scalars().contains(&ScalarKind::Real);
        let is_meant = |wrt: Option<&Wrt>| match wrt {
            Some(Wrt::All) => has_reals,
            Some(Wrt::Parameter(meant)) => has_reals && meant == name,
            None => false,
        };
        let point = queries.is_empty() || queries.iter().any(|q| !is_meant(q.boxed()));
        if point {
            arguments.push(parameter.point());
        }
        if queries.iter().any(|q| is_meant(q.boxed())) {
            arguments.push(parameter.boxed(!point));
        }
        if queries.iter().any(|q| is_meant(q.directed())) {
            arguments.push(parameter.direction());
        }
    }
    arguments
}

struct Described<'a> {
    index: usize,
    name: &'a str,
    ty: &'a Type,
    /// Scalars of the parameters before it.
    before: usize,
}

impl Described<'_> {
    fn scalars(&self) -> impl Iterator<Item = (usize, String, ScalarKind)> {
        let names = self.ty.columns(self.name);
        names.into_iter().zip(self.ty.scalars()).enumerate().map(|(i, (name, kind))| (i, name, kind))
    }

    fn column(&self, name: String, kind: ScalarKind, scalar: usize, source: fn(usize) -> Source) -> ArgumentColumn {
        ArgumentColumn { name, kind, scalar, source: source(self.before + scalar) }
    }

    fn argument(&self, role: Role, name: String, ty: Type, columns: Vec<ArgumentColumn>) -> Argument {
        Argument { parameter: self.index, role, name, ty, columns }
    }

    fn point(&self) -> Argument {
        let columns = self.scalars().map(|(i, name, kind)| self.column(name, kind, i, Source::Point)).collect();
        self.argument(Role::Point, self.name.to_owned(), self.ty.clone(), columns)
    }

    /// `alone` if no point is given, so that the box has the other scalars as well.
    fn boxed(&self, alone: bool) -> Argument {
        let mut columns = Vec::new();
        for (i, name, kind) in self.scalars() {
            if kind == ScalarKind::Real {
                columns.push(self.column(format!("{name}.start"), kind, i, Source::Start));
                columns.push(self.column(format!("{name}.end"), kind, i, Source::End));
            } else if alone {
                columns.push(self.column(name, kind, i, Source::Point));
            }
        }
        let (name, ty) =
            if alone { (self.name.to_owned(), self.ty.clone()) } else { (format!("{}.box", self.name), self.reals()) };
        self.argument(Role::Box, name, ty, columns)
    }

    fn direction(&self) -> Argument {
        let reals = self.scalars().filter(|(_, _, kind)| *kind == ScalarKind::Real);
        let columns =
            reals.map(|(i, name, kind)| self.column(format!("{name}.direction"), kind, i, Source::Direction)).collect();
        self.argument(Role::Direction, format!("{}.direction", self.name), self.reals(), columns)
    }

    /// The parameter's type, or a tuple of its reals if it has scalars of other kinds.
    fn reals(&self) -> Type {
        let scalars = self.ty.scalars();
        let reals = scalars.iter().filter(|kind| **kind == ScalarKind::Real).count();
        match reals {
            n if n == scalars.len() => self.ty.clone(),
            1 => Type::Real,
            n => Type::Tuple(vec![Type::Real; n]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(ty: &Type, queries: &[&str]) -> Vec<(String, Vec<String>)> {
        let queries: Vec<Query> = queries.iter().map(|q| q.parse().unwrap()).collect();
        let parameters = [("p", ty), ("n", &Type::Int)];
        let shown = |a: Argument| (a.name, a.columns.into_iter().map(|c| c.name).collect());
        arguments(parameters, &queries).into_iter().map(shown).collect()
    }

    fn expect(ty: &Type, queries: &[&str], expected: &[(&str, &[&str])]) {
        let expected: Vec<(String, Vec<String>)> =
            expected.iter().map(|(n, c)| ((*n).to_owned(), c.iter().map(|c| (*c).to_owned()).collect())).collect();
        assert_eq!(names(ty, queries), expected, "{queries:?}");
    }

    #[test]
    fn a_point_is_given_where_a_query_needs_it() {
        let (vec2, n) = (Type::Vector(2), ("n", &["n"][..]));
        let ends = &["p.x.start", "p.x.end", "p.y.start", "p.y.end"][..];
        expect(&vec2, &["value"], &[("p", &["p.x", "p.y"]), n]);
        expect(&vec2, &["bound", "lipschitz(p)"], &[("p", ends), n]);
        expect(&vec2, &["bound(p)", "value"], &[("p", &["p.x", "p.y"]), ("p.box", ends), n]);
        let direction = ("p.direction", &["p.x.direction", "p.y.direction"][..]);
        expect(&vec2, &["directional(p)"], &[("p", &["p.x", "p.y"]), direction, n]);
        expect(&vec2, &["directional(*)"], &[("p", &["p.x", "p.y"]), direction, n]);
    }

    #[test]
    fn scalars_that_are_no_reals_are_given_once() {
        let pair = Type::Tuple(vec![Type::Real, Type::Int, Type::Real]);
        let n = ("n", &["n"][..]);
        let ends = &["p.0.start", "p.0.end", "p.2.start", "p.2.end"][..];
        expect(&pair, &["bound(p)"], &[("p", &["p.0.start", "p.0.end", "p.1", "p.2.start", "p.2.end"]), n]);
        expect(&pair, &["bound(p)", "value"], &[("p", &["p.0", "p.1", "p.2"]), ("p.box", ends), n]);
        let sources: Vec<Source> = arguments([("n", &Type::Int), ("p", &pair)], &["bound(p)".parse().unwrap()])
            .iter()
            .flat_map(|a| a.columns.iter().map(|c| c.source))
            .collect();
        use Source::{End, Point, Start};
        assert_eq!(sources, [Point(0), Start(1), End(1), Point(2), Start(3), End(3)]);
    }
}
