//! Types as written become [`Type`]s (LANGUAGE 3.1). Knows the words of all types and what other languages
//! call them; knows nothing of values.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{Tree, TypeId, TypeKind},
};

use super::{Report, tree};
use crate::{Type, suggest::similar};

const SUPPORTED: &str = "supported are real, int, bool, vec2 to vec4 of reals or ints, mat2 to mat4, mat2x3 and the like, quat, tuples, \
     intervals of real, int, vectors and matrices of reals, and csg";

/// The words of the type language, for suggestions.
const WORDS: [&str; 12] =
    ["real", "int", "bool", "quat", "csg", "vec2", "vec3", "vec4", "mat2", "mat3", "mat4", "interval"];

/// What other languages call it.
const FOREIGN: [(&str, &str); 16] = [
    ("float", "real"),
    ("f32", "real"),
    ("f64", "real"),
    ("double", "real"),
    ("number", "real"),
    ("scalar", "real"),
    ("i32", "int"),
    ("u32", "int"),
    ("uint", "int"),
    ("integer", "int"),
    ("boolean", "bool"),
    ("float2", "vec2"),
    ("float3", "vec3"),
    ("float4", "vec4"),
    ("quaternion", "quat"),
    ("tree", "csg"),
];

/// The type that is written there; [`Type::Error`] after a report.
pub(super) fn resolve(tree: &Tree, id: TypeId, report: &mut Report) -> Type {
    let written = tree::type_expr(tree, id);
    match &written.kind {
        TypeKind::Error => Type::Error,
        TypeKind::Tensor => {
            unsupported(report, written.span, "tensors of rank 3 and more are not supported");
            Type::Error
        }
        TypeKind::Interval(inner) => {
            let inner = resolve(tree, *inner, report);
            match inner {
                Type::Error => {}
                Type::Csg => csg_inside(report, written.span, "an interval"),
                inner if inner.is_end() => return inner.interval(),
                inner => {
                    let message = format!("an interval cannot have ends of type `{inner}`");
                    unsupported(report, written.span, &message);
                }
            }
            Type::Error
        }
        TypeKind::Tuple(elements) => {
            let types: Vec<Type> = elements.iter().map(|e| resolve(tree, *e, report)).collect();
            if let Some(at) = types.iter().position(|t| *t == Type::Csg) {
                let span = elements.get(at).map_or(written.span, |e| tree::type_expr(tree, *e).span);
                csg_inside(report, span, "a tuple");
                return Type::Error;
            }
            if types.contains(&Type::Error) { Type::Error } else { Type::Tuple(types) }
        }
        TypeKind::Word { name, element } => {
            let element = element.map(|e| (resolve(tree, e, report), tree::type_expr(tree, e)));
            match shape(name) {
                Some(shape) => match element {
                    None | Some((Type::Real, _)) => shape,
                    Some((Type::Error, _)) => Type::Error,
                    Some((element, inner)) => match (element, shape) {
                        (Type::Int, Type::Vector(n)) => Type::IntVector(n),
                        (_, shape) => {
                            let what = if matches!(shape, Type::Vector(_)) { "reals or ints" } else { "reals only" };
                            unsupported(report, inner.span, &format!("`{name}` holds {what}"));
                            Type::Error
                        }
                    },
                },
                None => word(name, element.is_some(), written.span, report),
            }
        }
    }
}

fn word(name: &str, has_element: bool, span: Span, report: &mut Report) -> Type {
    let ty = match name {
        "real" | "s" => Type::Real,
        "int" | "i" => Type::Int,
        "bool" => Type::Bool,
        "quat" => Type::Quat,
        "csg" | "CSG" => Type::Csg,
        "complex" | "none" => {
            unsupported(report, span, &format!("the type `{name}` is not supported"));
            return Type::Error;
        }
        _ => {
            let message = if name.starts_with("vec") || name.starts_with("mat") {
                format!("`{name}` is no supported size")
            } else {
                format!("there is no type `{name}`")
            };
            let foreign = FOREIGN.iter().find(|(f, _)| *f == name).map(|(_, ours)| *ours);
            let near = foreign.or_else(|| similar(name, WORDS).first().copied());
            let mut diagnostic = Diagnostic::new(Code::E0410, span, message).note(SUPPORTED);
            if let Some(near) = near {
                diagnostic = diagnostic.help(format!("did you mean `{near}`?"));
            }
            report.push(diagnostic);
            return Type::Error;
        }
    };
    if has_element {
        unsupported(report, span, &format!("`{name}` has no element type"));
        return Type::Error;
    }
    ty
}

/// `vecN`, `matN`, `matWxH` with extents from 2 to 4.
fn shape(name: &str) -> Option<Type> {
    let extent = |text: &str| match text {
        "2" => Some(2),
        "3" => Some(3),
        "4" => Some(4),
        _ => None,
    };
    if let Some(n) = name.strip_prefix("vec") {
        return extent(n).map(Type::Vector);
    }
    let extents = name.strip_prefix("mat")?;
    let (columns, rows) = extents.split_once('x').unwrap_or((extents, extents));
    Some(Type::Matrix { columns: extent(columns)?, rows: extent(rows)? })
}

fn unsupported(report: &mut Report, span: Span, message: &str) {
    report.push(Diagnostic::new(Code::E0410, span, message).note(SUPPORTED));
}

fn csg_inside(report: &mut Report, span: Span, place: &str) {
    report.push(
        Diagnostic::new(Code::E0603, span, format!("csg may not be part of {place}"))
            .help("csg may be a parameter or result of a function, or bound with `csg name = …;`"),
    );
}
