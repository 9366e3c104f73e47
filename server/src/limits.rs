//! The limits of the service, beside those of the language: name, default and meaning, declared once; and how both
//! are set by name and listed. Says what may be asked for; knows nothing of who counts it.

use isograd_compiler::Limits;
use serde_json::{Value, json};

/// A limit as a problem shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LimitValue {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: u64,
}

/// One limit of [`ServerLimits::ALL`].
#[derive(Debug, Clone, Copy)]
pub struct ServerLimit {
    /// The name of the field, of the flag and of the key in a server's configuration.
    pub name: &'static str,
    /// The default value.
    pub default: u64,
    /// What it counts.
    pub about: &'static str,
    /// Reads it.
    pub get: fn(&ServerLimits) -> u64,
    /// Changes it.
    pub set: fn(&mut ServerLimits, u64),
}

macro_rules! limits {
    ($( $(#[doc = $doc:literal])+ $field:ident : $default:literal; )+) => {
        /// The limits of one server. Each getter-like method of the same name pairs the value with its name.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct ServerLimits { $( $(#[doc = $doc])+ pub $field: u64, )+ }

        impl Default for ServerLimits {
            fn default() -> Self { Self { $( $field: $default, )+ } }
        }

        impl ServerLimits {
            /// Every limit: its name, default and meaning.
            pub const ALL: &'static [ServerLimit] = &[
                $( ServerLimit { name: stringify!($field), default: $default, about: concat!($($doc),+),
                                 get: |l| l.$field, set: |l, v| l.$field = v }, )+
            ];

            $(
                $(#[doc = $doc])+
                #[must_use]
                pub const fn $field(&self) -> LimitValue {
                    LimitValue { name: stringify!($field), value: self.$field }
                }
            )+
        }
    };
}

limits! {
    /// Bytes of the body that posts a program.
    program_bytes: 16_777_216;
    /// Files of a posted program.
    program_files: 256;
    /// Bytes of the body that asks for an evaluation.
    evaluate_bytes: 67_108_864;
    /// Points of one evaluation.
    points: 1_000_000;
    /// Points × output columns of one evaluation.
    output_scalars: 16_000_000;
    /// Queries of one request.
    queries: 64;
    /// Milliseconds that an evaluation may take.
    evaluation_ms: 10_000;
    /// Milliseconds in which a body must have arrived.
    body_ms: 30_000;
    /// Bytes of all bodies held at a time.
    buffered_bytes: 268_435_456;
    /// Requests that may wait for a free worker.
    queue: 64;
    /// Milliseconds that running requests get to finish when the server is told to stop.
    shutdown_ms: 30_000;
}

/// Why a limit cannot be set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LimitError {
    /// No limit has the name.
    #[error("there is no limit `{name}`; the limits are {}", known.join(", "))]
    Unknown {
        /// The name.
        name: String,
        /// Those there are.
        known: Vec<&'static str>,
    },
    /// It cannot be as large as that.
    #[error("the limit `{name}` is at most {most}")]
    TooLarge {
        /// The limit.
        name: &'static str,
        /// Its greatest value.
        most: u64,
    },
}

/// Changes a limit: one of the language, or of the service if there is one. The two share no name.
///
/// # Errors
/// If there is no limit of this name, or the value is more than it may be given.
pub fn set(
    name: &str,
    value: u64,
    language: &mut Limits,
    service: Option<&mut ServerLimits>,
) -> Result<(), LimitError> {
    let known = Limits::ALL.iter().map(|l| l.name);
    if let Some(limit) = Limits::ALL.iter().find(|l| l.name == name) {
        if value > limit.most {
            return Err(LimitError::TooLarge { name: limit.name, most: limit.most });
        }
        (limit.set)(language, value);
        return Ok(());
    }
    let Some(service) = service else {
        return Err(LimitError::Unknown { name: name.to_owned(), known: known.collect() });
    };
    if let Some(limit) = ServerLimits::ALL.iter().find(|l| l.name == name) {
        (limit.set)(service, value);
        return Ok(());
    }
    Err(LimitError::Unknown {
        name: name.to_owned(),
        known: known.chain(ServerLimits::ALL.iter().map(|l| l.name)).collect(),
    })
}

/// The limits of the language as JSON: `{name, value, default, code, about}`, the code being that of the diagnostic
/// that reports it.
#[must_use]
pub fn language_json(values: &Limits, defaults: &Limits) -> Value {
    let one = |l: &isograd_compiler::Limit| {
        let (value, default) = ((l.get)(values), (l.get)(defaults));
        json!({ "name": l.name, "value": value, "default": default, "code": l.code.name(), "about": l.about.trim() })
    };
    Limits::ALL.iter().map(one).collect()
}

/// The limits of a service as JSON: `{name, value, default, about}`.
#[must_use]
pub fn service_json(values: &ServerLimits) -> Value {
    let one = |l: &ServerLimit| json!({ "name": l.name, "value": (l.get)(values), "default": l.default, "about": l.about.trim() });
    ServerLimits::ALL.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_set_by_its_name() {
        let (mut language, mut service) = (Limits::default(), ServerLimits::default());
        for (i, name) in Limits::ALL.iter().map(|l| l.name).chain(ServerLimits::ALL.iter().map(|l| l.name)).enumerate()
        {
            set(name, i as u64, &mut language, Some(&mut service)).unwrap();
        }
        let values: Vec<u64> = Limits::ALL.iter().map(|l| (l.get)(&language)).collect();
        let served: Vec<u64> = ServerLimits::ALL.iter().map(|l| (l.get)(&service)).collect();
        let count = values.len() + served.len();
        // A name that both had would be set twice in the one and never in the other.
        assert_eq!([values, served].concat(), (0..count as u64).collect::<Vec<_>>());
    }

    #[test]
    fn an_unknown_name_is_answered_with_those_there_are() {
        let mut limits = Limits::default();
        let error = |name, service| set(name, 1, &mut Limits::default(), service).unwrap_err().to_string();
        assert!(error("point", None).starts_with("there is no limit `point`; the limits are source_bytes, "));
        assert!(!error("points", None).contains("program_bytes"));
        assert!(error("point", Some(&mut ServerLimits::default())).ends_with("queue, shutdown_ms"));
        set("nesting", 7, &mut limits, None).unwrap();
        assert_eq!(limits, Limits { nesting: 7, ..Limits::default() });
        let error = set("nesting", 513, &mut limits, None).unwrap_err();
        assert_eq!(error.to_string(), "the limit `nesting` is at most 512");
        assert_eq!(limits.nesting, 7);
        set("nesting", 512, &mut limits, None).unwrap();
    }
}
