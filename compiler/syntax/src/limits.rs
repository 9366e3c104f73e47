//! The limits of LANGUAGE 18: name, default, code and meaning, declared once. Everything that counts against a
//! limit reads it here; a host may change each.

use crate::Code;

macro_rules! limits {
    ($( $(#[doc = $doc:literal])+ $field:ident : $default:literal $(of $most:literal)?, $code:ident; )+) => {
        /// The limits of one compilation.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct Limits { $( $(#[doc = $doc])+ pub $field: u64, )+ }

        impl Default for Limits {
            fn default() -> Self { Self { $( $field: $default, )+ } }
        }

        impl Limits {
            /// Every limit: its name, default, diagnostic and meaning.
            pub const ALL: &'static [Limit] = &[
                $( Limit { name: stringify!($field), default: $default, code: Code::$code, about: concat!($($doc),+),
                           most: most!($($most)?), get: |l| l.$field, set: |l, v| l.$field = v }, )+
            ];
        }
    };
}

macro_rules! most {
    () => {
        u64::MAX
    };
    ($most:literal) => {
        $most
    };
}

/// One limit of [`Limits::ALL`].
#[derive(Debug, Clone, Copy)]
pub struct Limit {
    /// The name of the field, of the flag and of the key in a server's configuration.
    pub name: &'static str,
    /// The default value.
    pub default: u64,
    /// The diagnostic that reports it.
    pub code: Code,
    /// What it counts.
    pub about: &'static str,
    /// The greatest value that it may be given.
    pub most: u64,
    /// Reads it.
    pub get: fn(&Limits) -> u64,
    /// Changes it.
    pub set: fn(&mut Limits, u64),
}

limits! {
    /// Bytes of one file.
    source_bytes: 1_048_576, E1001;
    /// Bytes of all files.
    total_source_bytes: 8_388_608, E1002;
    /// Files.
    modules: 256, E1003;
    /// Brackets, blocks and prefix operators inside each other; at most 512.
    nesting: 256 of 512, E1004;
    /// Nodes on a path of a csg tree; impls, calls, branches and loops inside each other after inlining.
    csg_depth: 1000, E1005;
    /// Iterations of csg loops, per export.
    unrolled_iterations: 65_536, E1006;
    /// Scalar operations after specialisation, per export.
    graph_nodes: 1_000_000, E1007;
    /// Scalar operations after derivatives.
    derived_nodes: 4_000_000, E1008;
    /// `diff` inside `diff`, including the host's query.
    diff_order: 6, E1009;
    /// Flattened parameters, and flattened results of an export or of one query.
    export_scalars: 4096, E1010;
    /// Milliseconds that a compilation may take.
    compile_time_ms: 10_000, E1011;
    /// Diagnostics reported in full.
    diagnostics: 100, E1012;
}

impl Limits {
    /// The greatest value of the limit with this name. For `nesting` it is what the 2 MiB of stack allow that a thread
    /// has by default, as the parser recurses with brackets.
    #[must_use]
    pub fn most(name: &str) -> u64 {
        Self::ALL.iter().find(|l| l.name == name).map_or(u64::MAX, |l| l.most)
    }
}

#[cfg(test)]
mod tests {
    use super::Limits;

    #[test]
    fn a_greatest_value_is_told() {
        assert_eq!(Limits::most("nesting"), 512);
        for limit in Limits::ALL.iter().filter(|l| l.most < u64::MAX) {
            assert!(limit.default <= limit.most && limit.about.contains(&format!("at most {}", limit.most)));
        }
    }
}
