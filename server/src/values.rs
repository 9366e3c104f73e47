//! Values of parameters: what the host gives, as columns of numbers, and what may go wrong between the two.
//! Knows types by their scalars; knows neither JSON nor CSV nor how anything is evaluated.

use isograd_compiler::{Export, Parameter, Rate, ScalarKind};

use crate::describe::value;

/// The values of one parameter, one column per scalar (LANGUAGE 9.2). A number of any kind is held as f64, which is
/// exact for ints and bools; a real is rounded to the module's precision when it is used.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// One value per call, or one per point.
    pub rate: Rate,
    /// The columns; each has one element if uniform, one per point if varying.
    pub columns: Vec<Vec<f64>>,
}

impl Values {
    /// One value for all points.
    #[must_use]
    pub fn uniform(scalars: &[f64]) -> Self {
        Self { rate: Rate::Uniform, columns: scalars.iter().map(|x| vec![*x]).collect() }
    }
}

/// Inputs of one evaluation: the values of all parameters in order, and how many points they make.
#[derive(Debug, Clone, PartialEq)]
pub struct Inputs {
    /// One per parameter of the export.
    pub values: Vec<Values>,
    /// The number of points.
    pub points: usize,
}

/// Why values do not fit an export; a whole sentence or several, with what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Misfit(pub String);

impl Inputs {
    /// Puts named values in the order of the parameters. All varying ones must have the same number of points. If
    /// none varies, the first parameter varies with one point, which is the usual rate of it and so the usual module.
    /// A parameter that is not named has its default (LANGUAGE 9.3).
    ///
    /// # Errors
    /// If a parameter has neither value nor default, a value no parameter, or the numbers of points differ.
    pub fn of(export: &Export, mut named: Vec<(String, Values)>) -> Result<Self, Misfit> {
        for (i, (name, _)) in named.iter().enumerate() {
            if !export.parameters.iter().any(|p| p.name == *name) {
                return Err(Misfit(format!("`{}` has no parameter `{name}`; {}", export.name, takes(export))));
            }
            if named.iter().take(i).any(|(earlier, _)| earlier == name) {
                return Err(Misfit(format!("the parameter `{name}` is given twice; give it once")));
            }
        }
        let mut values = Vec::with_capacity(export.parameters.len());
        let mut missing = Vec::new();
        for parameter in &export.parameters {
            let given = named.iter().position(|(name, _)| *name == parameter.name);
            match (given, &parameter.default) {
                (Some(at), _) => values.push(named.swap_remove(at).1),
                (None, Some(default)) => values.push(Values::uniform(default)),
                (None, None) => missing.push(describe(parameter)),
            }
        }
        if !missing.is_empty() {
            let plural = if missing.len() == 1 { "parameter" } else { "parameters" };
            return Err(Misfit(format!("no value for the {plural} {}", missing.join(", "))));
        }
        let points = count(export, &values)?;
        if let Some(first) = values.first_mut().filter(|_| points.is_none()) {
            first.rate = Rate::Varying;
        }
        Ok(Self { values, points: points.unwrap_or(1) })
    }
}

/// The number of points of the varying values, if any vary.
fn count(export: &Export, values: &[Values]) -> Result<Option<usize>, Misfit> {
    let mut found: Option<(&str, usize)> = None;
    for (parameter, values) in export.parameters.iter().zip(values) {
        if values.rate == Rate::Uniform {
            continue;
        }
        let points = values.columns.first().map_or(0, Vec::len);
        match found {
            Some((name, before)) if before != points => {
                return Err(Misfit(format!(
                    "`{name}` has {before} values and `{}` has {points}; give every parameter that changes from \
                     point to point the same number of values",
                    parameter.name
                )));
            }
            Some(_) => {}
            None => found = Some((&parameter.name, points)),
        }
    }
    Ok(found.map(|(_, points)| points))
}

/// `at: vec3 (at.x, at.y, at.z)`, `time: real`.
#[must_use]
pub fn describe(parameter: &Parameter) -> String {
    let columns = parameter.ty.columns(&parameter.name);
    match columns.as_slice() {
        [only] if *only == parameter.name => format!("`{}: {}`", parameter.name, parameter.ty),
        _ => format!("`{}: {}` ({})", parameter.name, parameter.ty, columns.join(", ")),
    }
}

/// What an export takes, for messages.
#[must_use]
pub fn takes(export: &Export) -> String {
    if export.parameters.is_empty() {
        return "it takes no parameters".to_owned();
    }
    let parameter = |p: &Parameter| match &p.default {
        Some(default) => format!("{} with default {}", describe(p), value(&p.ty, default)),
        None => describe(p),
    };
    let parameters: Vec<String> = export.parameters.iter().map(parameter).collect();
    format!("it takes {}", parameters.join(", "))
}

/// Why a number cannot be a scalar of this kind.
///
/// # Errors
/// What was expected, if it cannot.
pub fn fits(kind: ScalarKind, x: f64) -> Result<f64, &'static str> {
    match kind {
        ScalarKind::Real => Ok(x),
        ScalarKind::Int if x.fract() == 0.0 && (-2_147_483_648.0..=2_147_483_647.0).contains(&x) => Ok(x),
        ScalarKind::Int => Err("an int from -2147483648 to 2147483647"),
        ScalarKind::Bool if x == 0.0 || x == 1.0 => Ok(x),
        ScalarKind::Bool => Err("true, false, 0 or 1"),
    }
}

/// A scalar written as text: a number, `nan`, `inf`, `-inf`, `true` or `false`.
///
/// # Errors
/// What was expected, if it is none.
pub fn parse(kind: ScalarKind, text: &str) -> Result<f64, &'static str> {
    let text = text.trim();
    match kind {
        ScalarKind::Real => text.parse::<f64>().map_err(|_| "a number"),
        ScalarKind::Int => text.parse::<i32>().map(f64::from).map_err(|_| "an int from -2147483648 to 2147483647"),
        ScalarKind::Bool => match text {
            "true" | "1" => Ok(1.0),
            "false" | "0" => Ok(0.0),
            _ => Err("true, false, 0 or 1"),
        },
    }
}

#[cfg(test)]
mod tests {
    use isograd_compiler::Type;

    use super::*;

    fn export() -> Export {
        let parameter = |name: &str, ty| Parameter { name: name.to_owned(), ty, default: None, range: None };
        Export {
            name: "f".to_owned(),
            parameters: vec![parameter("at", Type::Vector(2)), parameter("n", Type::Int)],
            result: Type::Real,
            doc: None,
        }
    }

    fn varying(columns: &[&[f64]]) -> Values {
        Values { rate: Rate::Varying, columns: columns.iter().map(|c| c.to_vec()).collect() }
    }

    fn named(at: Values, n: Values) -> Vec<(String, Values)> {
        vec![("n".to_owned(), n), ("at".to_owned(), at)]
    }

    #[test]
    fn values_take_the_order_of_the_parameters() {
        let inputs =
            Inputs::of(&export(), named(varying(&[&[1.0, 2.0], &[3.0, 4.0]]), Values::uniform(&[5.0]))).unwrap();
        assert_eq!(inputs.points, 2);
        assert_eq!(inputs.values[0].columns, [[1.0, 2.0], [3.0, 4.0]]);
        assert_eq!(inputs.values[1].rate, Rate::Uniform);
    }

    #[test]
    fn if_nothing_varies_the_first_parameter_does_with_one_point() {
        let inputs = Inputs::of(&export(), named(Values::uniform(&[1.0, 2.0]), Values::uniform(&[5.0]))).unwrap();
        assert_eq!((inputs.points, inputs.values[0].rate), (1, Rate::Varying));
        let inputs = Inputs::of(&export(), named(Values::uniform(&[1.0, 2.0]), varying(&[&[5.0, 6.0]]))).unwrap();
        assert_eq!((inputs.points, inputs.values[0].rate), (2, Rate::Uniform));
    }

    #[test]
    fn a_default_stands_in_for_what_is_not_given() {
        let mut export = export();
        export.parameters[1].default = Some(vec![7.0]);
        let at = || ("at".to_owned(), varying(&[&[1.0, 2.0], &[3.0, 4.0]]));
        let inputs = Inputs::of(&export, vec![at()]).unwrap();
        assert_eq!((inputs.points, &inputs.values[1]), (2, &Values::uniform(&[7.0])));
        let given = Inputs::of(&export, vec![at(), ("n".to_owned(), Values::uniform(&[5.0]))]).unwrap();
        assert_eq!(given.values[1], Values::uniform(&[5.0]));
        let missing = Inputs::of(&export, vec![("n".to_owned(), Values::uniform(&[5.0]))]).unwrap_err().0;
        assert_eq!(missing, "no value for the parameter `at: vec2` (at.x, at.y)");
        assert_eq!(takes(&export), "it takes `at: vec2` (at.x, at.y), `n: int` with default 7");
        export.parameters[0].default = Some(vec![0.5, 1.5]);
        let all = Inputs::of(&export, Vec::new()).unwrap();
        assert_eq!((all.points, all.values[0].rate), (1, Rate::Varying));
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let misfit = |named| Inputs::of(&export(), named).unwrap_err().0;
        assert_eq!(
            misfit(vec![("n".to_owned(), Values::uniform(&[1.0]))]),
            "no value for the parameter `at: vec2` (at.x, at.y)"
        );
        assert!(misfit(vec![]).contains("parameters `at: vec2` (at.x, at.y), `n: int`"));
        let extra = misfit(vec![("m".to_owned(), Values::uniform(&[1.0]))]);
        assert!(extra.contains("no parameter `m`") && extra.contains("`n: int`"), "{extra}");
        let lengths = misfit(named(varying(&[&[1.0], &[1.0]]), varying(&[&[1.0, 2.0]])));
        assert!(lengths.contains("`at` has 1 values and `n` has 2"), "{lengths}");
        let twice = misfit(vec![("n".to_owned(), Values::uniform(&[1.0])), ("n".to_owned(), Values::uniform(&[1.0]))]);
        assert!(twice.contains("given twice"), "{twice}");
    }

    #[test]
    fn scalars_of_each_kind_are_read_from_text() {
        assert_eq!(parse(ScalarKind::Real, " -1.5e3"), Ok(-1500.0));
        assert!(parse(ScalarKind::Real, "nan").unwrap().is_nan());
        assert_eq!(parse(ScalarKind::Real, "-inf"), Ok(f64::NEG_INFINITY));
        assert_eq!(parse(ScalarKind::Bool, "true"), Ok(1.0));
        assert_eq!(parse(ScalarKind::Int, "2147483648"), Err("an int from -2147483648 to 2147483647"));
        assert!(parse(ScalarKind::Real, "1,5").is_err() && parse(ScalarKind::Bool, "2").is_err());
        assert_eq!(fits(ScalarKind::Int, 3.5), Err("an int from -2147483648 to 2147483647"));
        assert_eq!(fits(ScalarKind::Int, -2_147_483_648.0), Ok(-2_147_483_648.0));
        assert!(fits(ScalarKind::Bool, f64::NAN).is_err());
    }
}
