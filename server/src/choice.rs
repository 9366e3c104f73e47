//! How a request by HTTP names what is to be compiled: by fields of its JSON or of its query string, most of them the
//! same. Knows which names and texts are ones; knows nothing of routes and bodies.

use std::collections::BTreeMap;

use isograd_compiler::{
    DerivativeMode, Differentiability, Form, InvalidWithin, Precision, Query, Rate, Request, Sensitivity, Target,
    Within,
};

use crate::problem::{Kind, Problem};
use crate::program::Program;
use crate::select;
use crate::state::Service;

/// The fields as they were written.
#[derive(Debug, Default)]
pub struct Choice {
    /// The export; may be left out if there is one.
    pub export: Option<String>,
    /// By default the value.
    pub queries: Option<Vec<String>>,
    /// The precision of `real`.
    pub precision: Option<String>,
    /// Which way derivatives are computed.
    pub mode: Option<String>,
    /// What becomes of kinks.
    pub differentiability: Option<String>,
    /// How smooth they become.
    pub sensitivity: Option<String>,
    /// What to specialise to, a parameter each.
    pub within: Vec<String>,
    /// What to compile to.
    pub target: Option<String>,
    /// What a host calls.
    pub form: Option<String>,
}

/// A field of a query string that is given once, and where it is kept.
type Field = (&'static str, fn(&mut Choice) -> &mut Option<String>);

/// Those of every module.
const FIELDS: [Field; 6] = [
    ("export", |c| &mut c.export),
    ("precision", |c| &mut c.precision),
    ("mode", |c| &mut c.mode),
    ("differentiability", |c| &mut c.differentiability),
    ("sensitivity", |c| &mut c.sensitivity),
    ("form", |c| &mut c.form),
];

/// What an address that ends in the module's extension says already.
const TARGET: Field = ("target", |c| &mut c.target);

impl Choice {
    /// The fields of the query string of a module of a target.
    ///
    /// # Errors
    /// If it has others, or one of them twice.
    pub fn of_module(query: &str, target: Target) -> Result<Self, Problem> {
        let mut choice = Self::read(query, &FIELDS)?;
        choice.target = Some(target.name().to_owned());
        Ok(choice)
    }

    /// The fields of the query string of a manifest.
    ///
    /// # Errors
    /// If it has others, or one of them twice.
    pub fn of_manifest(query: &str) -> Result<Self, Problem> {
        let fields: Vec<Field> = FIELDS.into_iter().chain([TARGET]).collect();
        Self::read(query, &fields)
    }

    fn read(query: &str, fields: &[Field]) -> Result<Self, Problem> {
        let mut choice = Self::default();
        for (name, value) in form_urlencoded::parse(query.as_bytes()) {
            let value = value.into_owned();
            match &*name {
                "query" => choice.queries.get_or_insert_default().push(value),
                "within" => choice.within.push(value),
                _ => {
                    let (_, place) = fields.iter().find(|(field, _)| *field == name).ok_or_else(|| {
                        let shown: String = name.chars().take(50).collect();
                        let known: Vec<String> = fields.iter().map(|(field, _)| format!("`{field}`")).collect();
                        let known = known.join(", ");
                        let message = format!("unknown field `{shown}`, expected `query`, `within`, {known}");
                        Problem::new(Kind::InvalidRequest, message)
                    })?;
                    if place(&mut choice).replace(value).is_some() {
                        return Err(Problem::new(Kind::InvalidRequest, format!("`{name}` is given twice")));
                    }
                }
            }
        }
        Ok(choice)
    }

    /// The request to the compiler that this stands for; everything it names exists.
    ///
    /// # Errors
    /// If a name or a text is none, or the program has errors.
    pub fn request(&self, service: &Service, program: &Program) -> Result<Request, Problem> {
        let limit = service.limits.queries();
        if let Some(count) = self.queries.as_ref().map(|q| q.len() as u64).filter(|n| *n > limit.value) {
            return Err(Problem::over(limit, "queries", count));
        }
        if program.has_errors() {
            let (diagnostics, files) = (&program.diagnostics, &program.checked.files);
            return Err(Problem::diagnostics(diagnostics, files, &service.options.limits));
        }
        let precisions = [Precision::F32, Precision::F64];
        let precision = one_of("precision", self.precision.as_deref(), &precisions, Precision::name)?;
        let mode = one_of("mode", self.mode.as_deref(), &DerivativeMode::ALL, DerivativeMode::name)?;
        let differentiability = one_of(
            "differentiability",
            self.differentiability.as_deref(),
            &Differentiability::ALL,
            Differentiability::name,
        )?;
        let sensitivity = self.sensitivity.as_deref().map(str::parse::<Sensitivity>).transpose();
        let sensitivity = sensitivity.map_err(|e| Problem::new(Kind::InvalidRequest, e.to_string()))?;
        let mut within = BTreeMap::new();
        for text in &self.within {
            let part: Within =
                text.parse().map_err(|e: InvalidWithin| Problem::new(Kind::InvalidRequest, e.to_string()))?;
            if within.insert(part.parameter.clone(), part.ends).is_some() {
                let message = format!("`within` names `{}` twice", part.parameter);
                return Err(Problem::new(Kind::InvalidRequest, message));
            }
        }
        let exports = program.checked.exports();
        let export = select::export(&exports, self.export.as_deref())?;
        let queries = match &self.queries {
            None => vec![Query::Value],
            Some(texts) => texts
                .iter()
                .map(|text| text.parse::<Query>().map_err(|e| Problem::new(Kind::InvalidRequest, e.to_string())))
                .collect::<Result<_, _>>()?,
        };
        select::known(export, &queries)?;
        let rates = export
            .parameters
            .iter()
            .enumerate()
            .map(|(i, p)| (p.name.clone(), if i == 0 { Rate::Varying } else { Rate::Uniform }))
            .collect();
        Ok(Request {
            export: export.name.clone(),
            queries,
            precision,
            rates,
            mode,
            differentiability,
            sensitivity,
            within,
            target: one_of("target", self.target.as_deref(), &Target::ALL, Target::name)?,
            form: one_of("form", self.form.as_deref(), &Form::ALL, Form::name)?,
        })
    }
}

/// The value of a field that takes one of a few names; without it, the default.
fn one_of<T: Copy + Default>(
    field: &str,
    given: Option<&str>,
    all: &[T],
    name: fn(T) -> &'static str,
) -> Result<T, Problem> {
    let Some(given) = given else { return Ok(T::default()) };
    all.iter().copied().find(|value| name(*value) == given).ok_or_else(|| {
        let shown: String = given.chars().take(50).collect();
        let names: Vec<&str> = all.iter().map(|value| name(*value)).collect();
        let detail = format!("unknown {field} `{shown}`, expected one of {}", names.join(", "));
        Problem::new(Kind::InvalidRequest, detail)
    })
}
