//! Exports and modules as clients see them: parameters with type, default and range, result, documentation (LANGUAGE
//! 9.3); manifests. Writes values in the shape in which an evaluation takes them; knows nothing of where it is shown.

use isograd_compiler::{Export, FORMS, Manifest, Parameter, ScalarKind, Type};
use serde_json::{Value, json};

/// `{name, parameters: [{name, type, columns, default, range: {lower, upper}}], result: {name, type, columns}, doc}`;
/// what an export does not declare is null.
#[must_use]
pub fn export(export: &Export) -> Value {
    json!({
        "name": export.name,
        "parameters": export.parameters.iter().map(parameter).collect::<Vec<_>>(),
        "result": port("value", &export.result),
        "doc": export.doc,
    })
}

/// What can be asked of any export: `[{query, gives}]`.
#[must_use]
pub fn queries() -> Value {
    FORMS.iter().map(|q| json!({ "query": q.form, "gives": q.gives })).collect()
}

/// The manifest of a module for a file of its own: JSON for reading as well, one line's end at the end.
#[must_use]
pub fn manifest(manifest: &Manifest) -> String {
    // Its fields are text, numbers and lists of them: nothing that has no JSON.
    let mut text = serde_json::to_string_pretty(manifest).unwrap_or_default();
    text.push('\n');
    text
}

fn port(name: &str, ty: &Type) -> Value {
    json!({ "name": name, "type": ty.to_string(), "columns": ty.columns(name) })
}

fn parameter(parameter: &Parameter) -> Value {
    let mut described = port(&parameter.name, &parameter.ty);
    if let Some(object) = described.as_object_mut() {
        let default = parameter.default.as_ref().map(|default| value(&parameter.ty, default));
        let range = parameter.range.as_ref().map(
            |(lower, upper)| json!({ "lower": value(&parameter.ty, lower), "upper": value(&parameter.ty, upper) }),
        );
        object.insert("default".to_owned(), default.unwrap_or(Value::Null));
        object.insert("range".to_owned(), range.unwrap_or(Value::Null));
    }
    described
}

/// One scalar as itself, several as a flat list.
#[must_use]
pub fn value(ty: &Type, scalars: &[f64]) -> Value {
    let mut values: Vec<Value> = ty.scalars().into_iter().zip(scalars).map(|(kind, x)| scalar(kind, *x)).collect();
    match ty {
        Type::Real | Type::Int | Type::Bool => values.pop().unwrap_or(Value::Null),
        _ => Value::Array(values),
    }
}

#[expect(clippy::cast_possible_truncation, reason = "the compiler holds ints and truth values exactly as f64")]
fn scalar(kind: ScalarKind, x: f64) -> Value {
    match kind {
        ScalarKind::Real if x.is_finite() => json!(x),
        ScalarKind::Real => json!(if x.is_nan() {
            "nan"
        } else if x > 0.0 {
            "inf"
        } else {
            "-inf"
        }),
        ScalarKind::Int => json!(x as i32),
        ScalarKind::Bool => json!(x != 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_the_shape_of_inputs() {
        assert_eq!(value(&Type::Real, &[1.0]).to_string(), "1.0");
        assert_eq!(value(&Type::Int, &[-4.0]).to_string(), "-4");
        assert_eq!(value(&Type::Bool, &[1.0]).to_string(), "true");
        assert_eq!(value(&Type::Vector(2), &[0.1, f64::NEG_INFINITY]).to_string(), r#"[0.1,"-inf"]"#);
        let pair = Type::Tuple(vec![Type::Int, Type::Vector(2)]);
        assert_eq!(value(&pair, &[3.0, 0.5, 2.0]).to_string(), "[3,0.5,2.0]");
    }
}
