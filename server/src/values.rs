//! Values of parameters: what the host gives, as columns of numbers, and what may go wrong between the two.
//! Knows types by their scalars; knows neither JSON nor CSV nor how anything is evaluated.

use isograd_compiler::{Argument, Export, Query, Rate, Role, ScalarKind, arguments};

use crate::describe::value;

/// The values of one argument, one column for each of its own. A number of any kind is held as f64, which is
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

/// Inputs of one evaluation: the values of all arguments in order, and how many points they make.
#[derive(Debug, Clone, PartialEq)]
pub struct Inputs {
    /// One per argument.
    pub values: Vec<Values>,
    /// The number of points.
    pub points: usize,
}

/// Why values do not fit an export; a whole sentence or several, with what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Misfit(pub String);

/// What an evaluation takes: an export and what its queries need to be given (see [`arguments`]).
#[derive(Debug, Clone)]
pub struct Interface<'e> {
    /// The export.
    pub export: &'e Export,
    /// What must be given.
    pub arguments: Vec<Argument>,
}

impl<'e> Interface<'e> {
    /// Of queries about an export.
    #[must_use]
    pub fn of(export: &'e Export, queries: &[Query]) -> Self {
        let parameters = export.parameters.iter().map(|p| (p.name.as_str(), &p.ty));
        Self { export, arguments: arguments(parameters, queries) }
    }

    /// The argument of this name.
    ///
    /// # Errors
    /// A sentence that says what there is instead.
    pub fn argument(&self, name: &str) -> Result<&Argument, String> {
        self.arguments.iter().find(|a| a.name == name).ok_or_else(|| {
            if let Some(hint) = self.hint(name) {
                return hint;
            }
            format!("`{}` has no parameter `{name}`; {}", self.export.name, takes(self))
        })
    }

    /// What to do about a name, of an argument or one of its columns, that would be one if other queries were asked.
    #[must_use]
    pub fn hint(&self, name: &str) -> Option<String> {
        let (of, what) = name.rsplit_once('.')?;
        let parameter =
            self.export.parameters.iter().find(|p| p.name == of || p.ty.columns(&p.name).contains(&of.to_owned()))?;
        let parameter = parameter.name.as_str();
        let is_boxed = || self.arguments.iter().any(|a| a.role == Role::Box && a.name == parameter);
        match what {
            "box" if is_boxed() => {
                Some(format!("no query needs the point of `{parameter}`: give its box as `{parameter}`"))
            }
            "box" | "start" | "end" => Some(format!(
                "`{name}` is not needed: no query ranges over a box of `{parameter}`, as `bound({parameter})` and \
                 `lipschitz({parameter})` do"
            )),
            "direction" => Some(format!(
                "`{name}` is not needed: no query goes along a direction, as `directional({parameter})` does"
            )),
            _ => None,
        }
    }

    /// What an argument is if it is not given, column by column: the default of its parameter, in a box as both ends.
    #[must_use]
    pub fn default(&self, argument: &Argument) -> Option<Vec<f64>> {
        let default = self.export.parameters.get(argument.parameter)?.default.as_ref()?;
        match argument.role {
            Role::Point | Role::Box => argument.columns.iter().map(|c| default.get(c.scalar).copied()).collect(),
            Role::Direction => None,
        }
    }
}

impl Inputs {
    /// Puts named values in the order of the arguments. All varying ones must have the same number of points. If none
    /// varies, the first varies with one point, which is the usual rate of it and so the usual module. One that is not
    /// named has its parameter's default (LANGUAGE 9.3).
    ///
    /// # Errors
    /// If an argument has neither value nor default, a value no argument, or the numbers of points differ.
    pub fn of(interface: &Interface<'_>, mut named: Vec<(String, Values)>) -> Result<Self, Misfit> {
        for (i, (name, _)) in named.iter().enumerate() {
            interface.argument(name).map_err(Misfit)?;
            if named.iter().take(i).any(|(earlier, _)| earlier == name) {
                return Err(Misfit(format!("the parameter `{name}` is given twice; give it once")));
            }
        }
        let mut values = Vec::with_capacity(interface.arguments.len());
        let mut missing = Vec::new();
        for argument in &interface.arguments {
            let given = named.iter().position(|(name, _)| *name == argument.name);
            match (given, interface.default(argument)) {
                (Some(at), _) => values.push(named.swap_remove(at).1),
                (None, Some(default)) => values.push(Values::uniform(&default)),
                (None, None) => missing.push(argument),
            }
        }
        if !missing.is_empty() {
            let what = match missing.as_slice() {
                some if some.iter().any(|a| a.role != Role::Point) => "",
                [_] => "the parameter ",
                _ => "the parameters ",
            };
            let missing: Vec<String> = missing.into_iter().map(describe).collect();
            return Err(Misfit(format!("no value for {what}{}", missing.join(", "))));
        }
        let points = count(interface, &values)?;
        if let Some(first) = values.first_mut().filter(|_| points.is_none()) {
            first.rate = Rate::Varying;
        }
        Ok(Self { values, points: points.unwrap_or(1) })
    }
}

/// The number of points of the varying values, if any vary.
fn count(interface: &Interface<'_>, values: &[Values]) -> Result<Option<usize>, Misfit> {
    let mut found: Option<(&str, usize)> = None;
    for (argument, values) in interface.arguments.iter().zip(values) {
        if values.rate == Rate::Uniform {
            continue;
        }
        let points = values.columns.first().map_or(0, Vec::len);
        match found {
            Some((name, before)) if before != points => {
                return Err(Misfit(format!(
                    "`{name}` has {before} values and `{}` has {points}; give every parameter that changes from \
                     point to point the same number of values",
                    argument.name
                )));
            }
            Some(_) => {}
            None => found = Some((&argument.name, points)),
        }
    }
    Ok(found.map(|(_, points)| points))
}

/// `at: vec3 (at.x, at.y, at.z)`, `time: real`, the box `r: real` (r.start, r.end).
#[must_use]
pub fn describe(argument: &Argument) -> String {
    let columns: Vec<&str> = argument.columns.iter().map(|c| c.name.as_str()).collect();
    let what = match argument.role {
        Role::Point => "",
        Role::Box => "the box ",
        Role::Direction => "the direction ",
    };
    match columns.as_slice() {
        [only] if *only == argument.name => format!("{what}`{}: {}`", argument.name, argument.ty),
        _ => format!("{what}`{}: {}` ({})", argument.name, argument.ty, columns.join(", ")),
    }
}

/// What an evaluation takes, for messages.
#[must_use]
pub fn takes(interface: &Interface<'_>) -> String {
    if interface.arguments.is_empty() {
        return "it takes no parameters".to_owned();
    }
    let argument = |a: &Argument| {
        let parameter = interface.export.parameters.get(a.parameter);
        match parameter.and_then(|p| Some((p, p.default.as_ref()?))) {
            Some((p, default)) if a.role != Role::Direction => {
                format!("{} with default {}", describe(a), value(&p.ty, default))
            }
            _ => describe(a),
        }
    };
    let arguments: Vec<String> = interface.arguments.iter().map(argument).collect();
    format!("it takes {}", arguments.join(", "))
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
    use isograd_compiler::{Parameter, Type};

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

    fn plain(export: &Export) -> Interface<'_> {
        Interface::of(export, &[Query::Value])
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
            Inputs::of(&plain(&export()), named(varying(&[&[1.0, 2.0], &[3.0, 4.0]]), Values::uniform(&[5.0])))
                .unwrap();
        assert_eq!(inputs.points, 2);
        assert_eq!(inputs.values[0].columns, [[1.0, 2.0], [3.0, 4.0]]);
        assert_eq!(inputs.values[1].rate, Rate::Uniform);
    }

    #[test]
    fn if_nothing_varies_the_first_parameter_does_with_one_point() {
        let inputs =
            Inputs::of(&plain(&export()), named(Values::uniform(&[1.0, 2.0]), Values::uniform(&[5.0]))).unwrap();
        assert_eq!((inputs.points, inputs.values[0].rate), (1, Rate::Varying));
        let inputs =
            Inputs::of(&plain(&export()), named(Values::uniform(&[1.0, 2.0]), varying(&[&[5.0, 6.0]]))).unwrap();
        assert_eq!((inputs.points, inputs.values[0].rate), (2, Rate::Uniform));
    }

    #[test]
    fn a_default_stands_in_for_what_is_not_given() {
        let mut export = export();
        export.parameters[1].default = Some(vec![7.0]);
        let at = || ("at".to_owned(), varying(&[&[1.0, 2.0], &[3.0, 4.0]]));
        let inputs = Inputs::of(&plain(&export), vec![at()]).unwrap();
        assert_eq!((inputs.points, &inputs.values[1]), (2, &Values::uniform(&[7.0])));
        let given = Inputs::of(&plain(&export), vec![at(), ("n".to_owned(), Values::uniform(&[5.0]))]).unwrap();
        assert_eq!(given.values[1], Values::uniform(&[5.0]));
        let missing = Inputs::of(&plain(&export), vec![("n".to_owned(), Values::uniform(&[5.0]))]).unwrap_err().0;
        assert_eq!(missing, "no value for the parameter `at: vec2` (at.x, at.y)");
        assert_eq!(takes(&plain(&export)), "it takes `at: vec2` (at.x, at.y), `n: int` with default 7");
        export.parameters[0].default = Some(vec![0.5, 1.5]);
        let all = Inputs::of(&plain(&export), Vec::new()).unwrap();
        assert_eq!((all.points, all.values[0].rate), (1, Rate::Varying));
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let misfit = |named| Inputs::of(&plain(&export()), named).unwrap_err().0;
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
