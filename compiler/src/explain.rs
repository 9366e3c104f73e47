//! The pages that explain the diagnostics: one for each code, a file of `docs/diagnostics/`. Holds their text and
//! knows nothing of what is in it; the tests read the pages and run their examples.

use isograd_syntax::{Code, for_each_code};

/// A page for each code; a code without its file does not compile.
macro_rules! pages {
    ($( $code:ident )+) => {
        /// The page about a diagnostic, in Markdown: the rule and its reason, an example that fails, the same
        /// example mended. Comments that start with `//@` in an example say what surrounds it: `file NAME` starts
        /// another file, `library NAME` registers the folder of that name, `limit NAME=VALUE` sets a limit, `query
        /// QUERY` asks for something else than the value, `differentiability MODE` for another mode, `target TARGET` and `precision
        /// PRECISION` for others, `byte 0xFF` ends the first file with a byte.
        #[must_use]
        pub const fn explain(code: Code) -> &'static str {
            match code {
                $( Code::$code => {
                    include_str!(concat!("../../docs/diagnostics/", stringify!($code), ".md"))
                } )+
            }
        }
    };
}

for_each_code!(pages);
