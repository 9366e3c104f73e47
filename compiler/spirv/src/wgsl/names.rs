//! Identifiers: from names of the source and of queries to what WGSL accepts, each once. Knows the words of WGSL; knows
//! nothing of what is named.

use std::sync::LazyLock;

use naga::keywords::wgsl::{BUILTIN_IDENTIFIERS, RESERVED};
use rustc_hash::{FxHashMap, FxHashSet};
use unicode_ident::{is_xid_continue, is_xid_start};

/// The identifier that texts in WGSL have for a name, if no other name has it already: letters and digits stay, whatever
/// lies between them becomes one underscore, a name that does not begin with a letter gets `v_` in front, and a word of
/// WGSL an underscore behind. So `gradient(at)` is `gradient_at`, and `at.x` is `at_x`. It has no two underscores in a row.
#[must_use]
pub fn identifier(name: &str) -> String {
    let mut text = String::with_capacity(name.len());
    for part in name.split(|c: char| !is_xid_continue(c) || c == '_').filter(|part| !part.is_empty()) {
        let begins = if text.is_empty() { part.starts_with(is_xid_start) } else { true };
        match (text.is_empty(), begins) {
            (true, true) => {}
            (true, false) => text.push_str("v_"),
            (false, _) => text.push('_'),
        }
        text.push_str(part);
    }
    if text.is_empty() {
        text.push('v');
    }
    if is_word(&text) {
        text.push('_');
    }
    text
}

/// Whether it means something in WGSL.
fn is_word(text: &str) -> bool {
    static WORDS: LazyLock<FxHashSet<&str>> =
        LazyLock::new(|| RESERVED.iter().chain(BUILTIN_IDENTIFIERS).copied().collect());
    // `vec3f` and `mat2x2h`.
    let short =
        (text.starts_with("vec") || text.starts_with("mat")) && text.len() <= 7 && text.ends_with(['f', 'h', 'i', 'u']);
    short || WORDS.contains(text)
}

/// The names of one scope and of all scopes in it.
#[derive(Debug, Default)]
pub struct Names {
    /// Those that are taken, each with how many have wished for it.
    taken: FxHashMap<String, u32>,
    locals: u32,
}

impl Names {
    /// A name that no other has, as near to a wish as can be.
    pub fn take(&mut self, wish: &str) -> String {
        self.claim(identifier(wish))
    }

    /// The same for a wish that is an identifier already.
    pub fn claim(&mut self, wish: String) -> String {
        let Some(wishes) = self.taken.get_mut(&wish) else {
            self.taken.insert(wish.clone(), 1);
            return wish;
        };
        let mut number = *wishes;
        let name = loop {
            number += 1;
            let name = format!("{}_{number}", wish.trim_end_matches('_'));
            if !self.taken.contains_key(&name) {
                break name;
            }
        };
        self.taken.insert(wish, number);
        self.taken.insert(name.clone(), 1);
        name
    }

    /// A name for a value that has none: `v0`, `v1`, …
    pub fn local(&mut self) -> String {
        loop {
            let name = format!("v{}", self.locals);
            self.locals += 1;
            if !self.taken.contains_key(&name) {
                return name;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_identifiers() {
        for (name, want) in [
            ("at.x", "at_x"),
            ("gradient(at)", "gradient_at"),
            ("∂value/∂at.x", "value_at_x"),
            ("smooth", "smooth_"),
            ("select", "select_"),
            ("vec3f", "vec3f_"),
            ("_", "v"),
            ("__a__b_", "a_b"),
            ("0", "v_0"),
            ("größe", "größe"),
            ("", "v"),
            ("fn", "fn_"),
            ("vector", "vector"),
        ] {
            assert_eq!(identifier(name), want, "{name}");
        }
    }

    #[test]
    fn no_name_is_given_twice() {
        let mut names = Names::default();
        let mut given = FxHashSet::default();
        for wish in ["a.b", "a_b", "a b", "a_b_2", "a_b_3", "v0", "v1", "fn", "fn_", "fn", "a_b"] {
            assert!(given.insert(names.take(wish)), "{wish}");
        }
        for _ in 0..5 {
            assert!(given.insert(names.local()));
        }
        assert!(given.contains("v2") && !given.contains("v7"));
    }
}
