//! Finding what a request names: an export, queries. Answers with what there is instead.
//! Knows names only; whether a query makes sense for a type is the compiler's business.

use isograd_compiler::{Export, Query, Wrt};

/// A name that the program does not have; the message says which names it has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct UnknownName(pub String);

/// The export of this name, or the only one.
///
/// # Errors
/// If there is none, or several and no name is given.
pub fn export<'a>(exports: &'a [Export], name: Option<&str>) -> Result<&'a Export, UnknownName> {
    let names: Vec<String> = exports.iter().map(|e| format!("`{}`", e.name)).collect();
    let all = names.join(", ");
    match (name, exports) {
        (_, []) => Err(UnknownName("the program has no export; mark a function with `export fn`".to_owned())),
        (None, [only]) => Ok(only),
        (None, _) => Err(UnknownName(format!("the program has several exports, choose one of {all}"))),
        (Some(name), _) => exports
            .iter()
            .find(|e| e.name == name)
            .ok_or_else(|| UnknownName(format!("there is no export `{name}`; the program exports {all}"))),
    }
}

/// Checks that the queries are about parameters of the export.
///
/// # Errors
/// If one is not.
pub fn known(export: &Export, queries: &[Query]) -> Result<(), UnknownName> {
    for query in queries {
        let missing = query.wrt().into_iter().find_map(|wrt| match wrt {
            Wrt::Parameter(name) if !export.parameters.iter().any(|p| p.name == *name) => Some(name),
            Wrt::Parameter(_) | Wrt::All => None,
        });
        let Some(name) = missing else { continue };
        let names: Vec<String> = export.parameters.iter().map(|p| format!("`{}`", p.name)).collect();
        let there = if names.is_empty() { "no parameters".to_owned() } else { names.join(", ") };
        return Err(UnknownName(format!("`{query}`: there is no parameter `{name}`; `{}` has {there}", export.name)));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use isograd_compiler::{Parameter, Type};

    use super::*;

    fn exports(names: &[&str]) -> Vec<Export> {
        let parameters = vec![Parameter { name: "at".to_owned(), ty: Type::Vector(3), default: None, range: None }];
        names
            .iter()
            .map(|n| Export { name: (*n).to_owned(), parameters: parameters.clone(), result: Type::Real, doc: None })
            .collect()
    }

    #[test]
    fn the_only_export_needs_no_name() {
        assert_eq!(export(&exports(&["a"]), None).unwrap().name, "a");
        assert_eq!(export(&exports(&["a", "b"]), Some("b")).unwrap().name, "b");
    }

    #[test]
    fn what_is_unknown_is_answered_with_what_there_is() {
        let error = |names, name| export(&exports(names), name).unwrap_err().0;
        assert!(error(&["a", "b"], None).contains("choose one of `a`, `b`"));
        assert!(error(&["a", "b"], Some("c")).contains("no export `c`; the program exports `a`, `b`"));
        assert!(error(&[], None).contains("export fn"));
        let all = exports(&["a"]);
        assert_eq!(known(&all[0], &[Query::Value, Query::Gradient("at".into())]), Ok(()));
        let message = known(&all[0], &[Query::Hessian("to".into(), "to".into())]).unwrap_err().0;
        assert_eq!(message, "`hessian(to)`: there is no parameter `to`; `a` has `at`");
    }
}
