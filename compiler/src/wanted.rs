//! From a request to scalars: which outputs of the graph are wanted, differentiated by which inputs, and under which
//! names. Knows the program's types; knows nothing of how derivatives are made.

use isograd_program::typed::{Function, FunctionId};
use isograd_program::{Program, ScalarKind, Type};
use isograd_syntax::{Code, Diagnostic, Limits};
use isograd_transform::Wanted;

use crate::{Query, Rate, Request, Wrt};

/// What a request wants of its export.
#[derive(Debug, Clone)]
pub struct Wanting {
    /// The export.
    pub export: FunctionId,
    /// Its parameters: name, type, rate.
    pub parameters: Vec<(String, Type, Rate)>,
    /// Per flattened input: whether it varies.
    pub varying: Vec<bool>,
    /// The wanted scalars of all queries in order. Names are those of the graph's outputs.
    pub scalars: Vec<Wanted>,
    /// Per query: its name, its type, and the names of its columns.
    pub queries: Vec<Answer>,
}

/// The columns of one query.
#[derive(Debug, Clone)]
pub struct Answer {
    /// The query as written.
    pub name: String,
    /// Its type.
    pub ty: String,
    /// Names of its columns.
    pub columns: Vec<String>,
}

impl Wanting {
    /// Resolves a request.
    pub fn of(program: &Program, request: &Request, limits: &Limits) -> Result<Self, Box<Diagnostic>> {
        let (export, function) = find(program, &request.export)?;
        for name in request.rates.keys() {
            parameter(function, name, "the rates")?;
        }
        let rate = |i: usize, name: &str| {
            let default = if i == 0 { Rate::Varying } else { Rate::Uniform };
            request.rates.get(name).copied().unwrap_or(default)
        };
        let parameters: Vec<_> =
            function.params.iter().enumerate().map(|(i, p)| (p.name.clone(), p.ty.clone(), rate(i, &p.name))).collect();
        let varying = parameters
            .iter()
            .flat_map(|(_, ty, rate)| std::iter::repeat_n(*rate == Rate::Varying, ty.len() as usize))
            .collect();
        let mut this = Self { export, parameters, varying, scalars: Vec::new(), queries: Vec::new() };
        if request.queries.is_empty() {
            return Err(Box::new(
                Diagnostic::global(Code::E1102, "the request has no query").help("ask for `value`, for example"),
            ));
        }
        for query in &request.queries {
            this.add(function, query, limits)?;
        }
        Ok(this)
    }

    fn add(&mut self, function: &Function, query: &Query, limits: &Limits) -> Result<(), Box<Diagnostic>> {
        let name = query.to_string();
        if self.queries.iter().any(|q| q.name == name) {
            return Err(Box::new(Diagnostic::global(Code::E1102, format!("the query `{name}` is asked for twice"))));
        }
        let results = function.result.columns("value");
        let reals: Vec<(usize, &String)> = results
            .iter()
            .enumerate()
            .zip(function.result.scalars())
            .filter(|(_, s)| *s == ScalarKind::Real)
            .map(|(x, _)| x)
            .collect();
        // Type, names of columns, and for each the output and the inputs it is differentiated by.
        type Columns = (String, Vec<String>, Vec<(usize, Vec<usize>)>);
        let (ty, columns, wanted): Columns = match query {
            Query::Value => {
                let all = (0..results.len()).map(|i| (i, Vec::new())).collect();
                (function.result.to_string(), results.clone(), all)
            }
            Query::Gradient(p) | Query::Jacobian(p) => {
                let wrt = reals_of(function, p, &name)?;
                within(limits, &name, reals.len().saturating_mul(wrt.len()))?;
                let ty = derivative_type(&function.result, reals.len(), type_of(function, p, &name)?, wrt.len());
                let mut columns = Vec::new();
                let mut wanted = Vec::new();
                // Flattened as LANGUAGE 13.1: for each scalar of the parameter, for each of the result.
                for (j, by) in &wrt {
                    for (i, value) in &reals {
                        columns.push(column(&results, value, &[by]));
                        wanted.push((*i, vec![*j]));
                    }
                }
                (ty, columns, wanted)
            }
            Query::Hessian(p, q) => {
                let (inner, outer) = (reals_of(function, p, &name)?, reals_of(function, q, &name)?);
                within(limits, &name, reals.len().saturating_mul(inner.len()).saturating_mul(outer.len()))?;
                let ty = second_derivative_type(reals.len(), inner.len(), outer.len());
                let mut columns = Vec::new();
                let mut wanted = Vec::new();
                for (k, by2) in &outer {
                    for (j, by) in &inner {
                        for (i, value) in &reals {
                            columns.push(column(&results, value, &[by, by2]));
                            // Mixed second derivatives are symmetric: each is computed once.
                            wanted.push((*i, vec![*j.min(k), *j.max(k)]));
                        }
                    }
                }
                (ty, columns, wanted)
            }
        };
        within(limits, &name, columns.len())?;
        for (column, (output, by)) in columns.iter().zip(wanted) {
            self.scalars.push(Wanted { name: format!("{name}:{column}"), output, by });
        }
        self.queries.push(Answer { name, ty, columns });
        Ok(())
    }
}

/// The name of a derivative's column: what it is differentiated by, after the result's scalar if there are several.
fn column(results: &[String], value: &str, by: &[&String]) -> String {
    let by = by.iter().map(|s| s.as_str()).collect::<Vec<_>>().join("/");
    if results.len() == 1 { by } else { format!("{value}/{by}") }
}

/// The type that `diff` gives (LANGUAGE 13.1), or a count of reals where it gives none.
fn derivative_type(result: &Type, reals: usize, parameter: Option<&Type>, wrt: usize) -> String {
    let ty = match (result, parameter.unwrap_or(&Type::Error)) {
        (Type::Real, Type::Real) => Some(Type::Real),
        (Type::Real, Type::Vector(_) | Type::Quat) => vector(wrt).map(Type::Vector),
        (Type::Vector(_) | Type::Quat, Type::Real) => vector(reals).map(Type::Vector),
        (Type::Vector(_) | Type::Quat, Type::Vector(_) | Type::Quat) => {
            vector(wrt).zip(vector(reals)).map(|(columns, rows)| Type::Matrix { columns, rows })
        }
        _ => None,
    };
    ty.map_or_else(|| format!("real[{}]", reals * wrt), |t| t.to_string())
}

/// The type of `diff(diff(e, p), q)` for so many real results, reals of p and reals of q; a count of reals where the
/// language has none.
fn second_derivative_type(results: usize, inner: usize, outer: usize) -> String {
    let ty = match (results, inner, outer) {
        (1, 1, 1) => Some(Type::Real),
        (1, n, 1) | (1, 1, n) => vector(n).map(Type::Vector),
        (1, rows, columns) => vector(columns).zip(vector(rows)).map(|(columns, rows)| Type::Matrix { columns, rows }),
        _ => None,
    };
    ty.map_or_else(|| format!("real[{}]", results * inner * outer), |t| t.to_string())
}

/// The extent of a vector, if there is one of that size.
fn vector(n: usize) -> Option<u8> {
    u8::try_from(n).ok().filter(|n| (2..=4).contains(n))
}

fn find<'p>(program: &'p Program, name: &str) -> Result<(FunctionId, &'p Function), Box<Diagnostic>> {
    let mut exports = program.exports.iter().filter_map(|id| Some((*id, program.functions.get(id.0 as usize)?)));
    exports.clone().find(|(_, f)| f.name == name).ok_or_else(|| {
        let names: Vec<_> = exports.by_ref().map(|(_, f)| format!("`{}`", f.name)).collect();
        let help = if names.is_empty() {
            "the program has no exports: declare one with `export fn`".to_owned()
        } else {
            format!("the program exports {}", names.join(", "))
        };
        Box::new(Diagnostic::global(Code::E1102, format!("there is no export `{name}`")).help(help))
    })
}

fn parameter<'p>(function: &'p Function, name: &str, whose: &str) -> Result<&'p Type, Box<Diagnostic>> {
    function.params.iter().find(|p| p.name == name).map(|p| &p.ty).ok_or_else(|| {
        let names: Vec<_> = function.params.iter().map(|p| format!("`{}`", p.name)).collect();
        Box::new(
            Diagnostic::global(Code::E1102, format!("{whose}: `{}` has no parameter `{name}`", function.name))
                .help(format!("its parameters are {}", names.join(", "))),
        )
    })
}

/// The type that a query differentiates by; none if it is that of several parameters.
fn type_of<'p>(function: &'p Function, wrt: &Wrt, query: &str) -> Result<Option<&'p Type>, Box<Diagnostic>> {
    match (wrt, function.params.as_slice()) {
        (Wrt::Parameter(name), _) => parameter(function, name, query).map(Some),
        (Wrt::All, [only]) => Ok(Some(&only.ty)),
        (Wrt::All, _) => Ok(None),
    }
}

/// Indices among the flattened inputs, and names, of the reals that a query differentiates by.
fn reals_of(function: &Function, wrt: &Wrt, query: &str) -> Result<Vec<(usize, String)>, Box<Diagnostic>> {
    let ty = type_of(function, wrt, query)?;
    let mut index = 0;
    let mut reals = Vec::new();
    for param in &function.params {
        let is_wanted = match wrt {
            Wrt::Parameter(name) => param.name == *name,
            Wrt::All => true,
        };
        for (column, scalar) in param.ty.columns(&param.name).into_iter().zip(param.ty.scalars()) {
            if is_wanted && scalar == ScalarKind::Real {
                reals.push((index, column));
            }
            index += 1;
        }
    }
    if reals.is_empty() {
        let message = match ty {
            Some(ty) => format!("{query}: the parameter `{wrt}` is {ty} and has no reals to differentiate by"),
            None => format!("{query}: `{}` has no real parameters to differentiate by", function.name),
        };
        return Err(Box::new(Diagnostic::global(Code::E1102, message)));
    }
    Ok(reals)
}

fn within(limits: &Limits, query: &str, scalars: usize) -> Result<(), Box<Diagnostic>> {
    let limit = limits.export_scalars;
    if scalars as u64 <= limit {
        return Ok(());
    }
    let message = format!("the query `{query}` has {scalars} results, the limit `export_scalars` is {limit}");
    Err(Box::new(
        Diagnostic::global(Code::E1010, message).help("ask for fewer derivatives at once, or raise the limit"),
    ))
}
