//! The limits of the service, beside those of the language: name, default and meaning, declared once.
//! Says what may be asked for; knows nothing of who counts it.

/// A limit as a problem shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LimitValue {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: u64,
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
            /// Every limit with its value.
            #[must_use]
            pub fn all(&self) -> Vec<LimitValue> {
                vec![$( self.$field(), )+]
            }

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
