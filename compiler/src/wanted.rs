//! From a request to scalars: which outputs of the graph are wanted, differentiated by which inputs, and under which
//! names. Knows the program's types; knows nothing of how derivatives are made.

use isograd_program::typed::{Function, FunctionId};
use isograd_program::{Program, ScalarKind, Type};
use isograd_syntax::{Code, Diagnostic, Limits};
use isograd_transform::{Asked, Form, KinkReport, Source};

use crate::interface::{Argument, arguments};
use crate::kinks::COLUMNS;
use crate::{Differentiability, Query, Rate, Request, Wrt};

/// What a request wants of its export.
#[derive(Debug, Clone)]
pub struct Wanting {
    /// The export.
    pub export: FunctionId,
    /// Its parameters: name, type, rate.
    pub parameters: Vec<(String, Type, Rate)>,
    /// What is given for them. Its columns are the inputs of the graph that answers.
    pub arguments: Vec<Argument>,
    /// Per column of the arguments: whether it varies.
    pub varying: Vec<bool>,
    /// What is wanted by all queries in order. Names are those of the graph's outputs.
    pub asked: Vec<Asked>,
    /// The reports of kinks among the queries. Each adds its outputs to the export's results, in this order.
    pub reports: Vec<KinkReport>,
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
    /// Per [`Asked`] of the query: the name of what it is about, a result or a derivative.
    pub about: Vec<String>,
    /// Whether its columns are derivatives, which may be structurally 0.
    pub sparse: bool,
    /// Its index among the reports of kinks, if it is one.
    pub report: Option<usize>,
}

/// A scalar that a query is about.
struct Subject {
    /// As its column is named where it is all that is asked for: `value`, `value.x`, `at.x`, `value.x/at.x`.
    name: String,
    /// The output.
    output: usize,
    /// The inputs that it is differentiated by.
    by: Vec<usize>,
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
        let arguments = arguments(parameters.iter().map(|(name, ty, _)| (name.as_str(), ty)), &request.queries);
        let varies = |argument: &Argument| parameters.get(argument.parameter).is_some_and(|p| p.2 == Rate::Varying);
        let varying = arguments.iter().flat_map(|a| std::iter::repeat_n(varies(a), a.columns.len())).collect();
        let mut this = Self {
            export,
            parameters,
            arguments,
            varying,
            asked: Vec::new(),
            reports: Vec::new(),
            queries: Vec::new(),
        };
        if request.queries.is_empty() {
            return Err(Box::new(
                Diagnostic::global(Code::E1102, "the request has no query").help("ask for `value`, for example"),
            ));
        }
        for query in &request.queries {
            this.add(function, query, limits)?;
        }
        let smooth = request.differentiability == Differentiability::Smooth;
        this.reports.iter_mut().for_each(|report| report.smooth = smooth);
        Ok(this)
    }

    /// The inputs of the graph that answers.
    pub fn inputs(&self) -> Vec<(String, Source)> {
        self.arguments.iter().flat_map(|a| &a.columns).map(|c| (c.name.clone(), c.source)).collect()
    }

    fn add(&mut self, function: &Function, query: &Query, limits: &Limits) -> Result<(), Box<Diagnostic>> {
        let name = query.to_string();
        if self.queries.iter().any(|q| q.name == name) {
            return Err(Box::new(Diagnostic::global(Code::E1102, format!("the query `{name}` is asked for twice"))));
        }
        let (ty, columns, wanted) = match query {
            Query::Value => {
                let values = results(function).map(|(subject, _)| subject);
                one_each(function.result.to_string(), values.collect(), |_| Form::Itself)
            }
            Query::Gradient(_) | Query::Jacobian(_) | Query::Hessian(..) => {
                let (ty, subjects) = derivatives(function, query, &name, limits)?;
                one_each(ty, subjects, |_| Form::Itself)
            }
            Query::Directional(p) => {
                let over = indices(reals_of(function, p, &name)?);
                let (ty, subjects) = real_results(function, &name)?;
                one_each(ty, subjects, |_| Form::Directional(over.clone()))
            }
            Query::Bound { of, over, mean } => {
                let over = indices(reals_of(function, over, &name)?);
                let (ty, subjects) = match **of {
                    Query::Value => real_results(function, &name)?,
                    _ => derivatives(function, of, &name, limits)?,
                };
                let ty = interval_type(&ty);
                let form =
                    |_: &Subject| if *mean { Form::MeanValue(over.clone()) } else { Form::Enclosed(over.clone()) };
                several_each(ty, subjects, &["start", "end", "may_be_nan"], form)
            }
            Query::Lipschitz(p) => {
                let over = indices(reals_of(function, p, &name)?);
                let (ty, subjects) = real_results(function, &name)?;
                several_each(ty, subjects, &["norm", "may_be_nan"], |_| Form::Lipschitz(over.clone()))
            }
            Query::Kinks { by, tolerance } => {
                real_results(function, &name)?;
                let before = function.result.len() as usize + COLUMNS.len() * self.reports.len();
                let names = COLUMNS.map(|column| format!("{name}:{column}"));
                let by = indices(reals_of(function, by, &name)?);
                self.reports.push(KinkReport { names, by, tolerance: tolerance.size(), smooth: false });
                let subject = |(i, name): (usize, &&str)| Subject {
                    name: (*name).to_owned(),
                    output: before + i,
                    by: Vec::new(),
                };
                let ty = Type::Tuple(vec![Type::Bool, Type::Real, Type::Int, Type::Int]);
                one_each(ty.to_string(), COLUMNS.iter().enumerate().map(subject).collect(), |_| Form::Itself)
            }
        };
        within(limits, &name, columns.len())?;
        let mut rest = columns.iter();
        let about = wanted.iter().map(|(subject, ..)| subject.name.clone()).collect();
        for (subject, form, count) in wanted {
            let names = rest.by_ref().take(count).map(|column| format!("{name}:{column}")).collect();
            self.asked.push(Asked { names, output: subject.output, by: subject.by, form });
        }
        let sparse = match query {
            Query::Gradient(_) | Query::Jacobian(_) | Query::Hessian(..) | Query::Directional(_) => true,
            Query::Value | Query::Bound { .. } | Query::Lipschitz(_) | Query::Kinks { .. } => false,
        };
        let report = matches!(query, Query::Kinks { .. }).then(|| self.reports.len().saturating_sub(1));
        self.queries.push(Answer { name, ty, columns, about, sparse, report });
        Ok(())
    }
}

/// Type, names of columns, and what is asked for, each with the number of its columns.
type Columns = (String, Vec<String>, Vec<(Subject, Form, usize)>);

/// One column for each subject, with its name.
fn one_each(ty: String, subjects: Vec<Subject>, form: impl Fn(&Subject) -> Form) -> Columns {
    let columns = subjects.iter().map(|s| s.name.clone()).collect();
    let wanted = subjects.into_iter().map(|s| (form(&s), s)).map(|(form, s)| (s, form, 1)).collect();
    (ty, columns, wanted)
}

/// For each subject a column of each part. The only subject is not named: `start`; others are: `value.x.start`.
fn several_each(ty: String, subjects: Vec<Subject>, parts: &[&str], form: impl Fn(&Subject) -> Form) -> Columns {
    let only = subjects.len() == 1;
    let named = |s: &Subject, part: &str| if only { part.to_owned() } else { format!("{}.{part}", s.name) };
    let columns = subjects.iter().flat_map(|s| parts.iter().map(move |part| named(s, part))).collect();
    let wanted = subjects.into_iter().map(|s| (form(&s), s)).map(|(form, s)| (s, form, parts.len())).collect();
    (ty, columns, wanted)
}

/// The scalars of a result and their kinds.
fn results(function: &Function) -> impl Iterator<Item = (Subject, ScalarKind)> {
    let named = function.result.columns("value").into_iter().enumerate();
    named.map(|(output, name)| Subject { name, output, by: Vec::new() }).zip(function.result.scalars())
}

/// The real scalars of a result, and the type that has them.
fn real_results(function: &Function, query: &str) -> Result<(String, Vec<Subject>), Box<Diagnostic>> {
    let reals: Vec<Subject> =
        results(function).filter(|(_, kind)| *kind == ScalarKind::Real).map(|(subject, _)| subject).collect();
    let ty = match reals.len() {
        0 => {
            let (name, ty) = (&function.name, &function.result);
            let message = format!("{query}: the result of `{name}` is {ty} and has no reals");
            return Err(Box::new(
                Diagnostic::global(Code::E1102, message).help("ask for `value`, which has all kinds"),
            ));
        }
        n if n == function.result.len() as usize => function.result.to_string(),
        1 => Type::Real.to_string(),
        n => format!("real[{n}]"),
    };
    Ok((ty, reals))
}

/// The scalars of a gradient, Jacobian or Hessian in the order of LANGUAGE 13.1: for each scalar of the parameters,
/// the outer first, for each of the result. Also its type. `asking` is the query that it is part of.
fn derivatives(
    function: &Function,
    query: &Query,
    asking: &str,
    limits: &Limits,
) -> Result<(String, Vec<Subject>), Box<Diagnostic>> {
    let reals: Vec<Subject> =
        results(function).filter(|(_, kind)| *kind == ScalarKind::Real).map(|(subject, _)| subject).collect();
    let alone = function.result.len() == 1;
    let mut subjects = Vec::new();
    let ty = match query {
        Query::Hessian(p, q) => {
            let (inner, outer) = (reals_of(function, p, asking)?, reals_of(function, q, asking)?);
            within(limits, asking, reals.len().saturating_mul(inner.len()).saturating_mul(outer.len()))?;
            for (k, by2) in &outer {
                for (j, by) in &inner {
                    // Mixed second derivatives are symmetric: each is computed once.
                    let order = vec![*j.min(k), *j.max(k)];
                    let name = |value: &str| column(alone, value, &[by, by2]);
                    subjects.extend(reals.iter().map(|r| Subject {
                        name: name(&r.name),
                        output: r.output,
                        by: order.clone(),
                    }));
                }
            }
            second_derivative_type(reals.len(), inner.len(), outer.len())
        }
        Query::Gradient(p) | Query::Jacobian(p) => {
            let wrt = reals_of(function, p, asking)?;
            within(limits, asking, reals.len().saturating_mul(wrt.len()))?;
            for (j, by) in &wrt {
                let name = |value: &str| column(alone, value, &[by]);
                subjects.extend(reals.iter().map(|r| Subject { name: name(&r.name), output: r.output, by: vec![*j] }));
            }
            derivative_type(&function.result, reals.len(), type_of(function, p, asking)?, wrt.len())
        }
        _ => String::new(),
    };
    Ok((ty, subjects))
}

fn indices(reals: Vec<(usize, String)>) -> Vec<usize> {
    reals.into_iter().map(|(index, _)| index).collect()
}

/// `interval<vec3>` of `vec3`, `interval<real>[5]` of `real[5]`.
fn interval_type(ty: &str) -> String {
    match ty.split_once('[') {
        Some((each, count)) => format!("interval<{each}>[{count}"),
        None => format!("interval<{ty}>"),
    }
}

/// The name of a derivative's column: what it is differentiated by, after the result's scalar if that is not alone.
fn column(alone: bool, value: &str, by: &[&String]) -> String {
    let by = by.iter().map(|s| s.as_str()).collect::<Vec<_>>().join("/");
    if alone { by } else { format!("{value}/{by}") }
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
