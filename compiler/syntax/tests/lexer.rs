//! Tokens: every trap of LANGUAGE 1.8, every form of number, names, comments.

use isograd_syntax::lexer::{Lexer, TokenKind, int_value, real_value};

/// The tokens of `text`, as written, malformed ones marked with `!`.
fn tokens(text: &str) -> Vec<String> {
    let mut lexer = Lexer::new(text);
    let mut tokens = Vec::new();
    loop {
        let token = lexer.token();
        if token.kind == TokenKind::End {
            return tokens;
        }
        let mark = if matches!(token.kind, TokenKind::Bad(_)) { "!" } else { "" };
        tokens.push(format!("{mark}{}", &text[token.start..token.end]));
    }
}

fn kinds(text: &str) -> Vec<TokenKind> {
    let mut lexer = Lexer::new(text);
    std::iter::from_fn(|| Some(lexer.token().kind).filter(|kind| *kind != TokenKind::End)).collect()
}

#[test]
fn a_dot_continues_a_number_only_before_a_digit() {
    assert_eq!(tokens("0..n"), ["0", "..", "n"]);
    assert_eq!(tokens("1..10"), ["1", "..", "10"]);
    assert_eq!(tokens("3.0..4.0"), ["3.0", "..", "4.0"]);
    assert_eq!(tokens("1e3..2e3"), ["1e3", "..", "2e3"]);
}

#[test]
fn digits_after_a_single_dot_are_an_index() {
    use TokenKind::{Dot, DotDot, Ident, Index, Int, Real};
    assert_eq!(kinds("t.0.1"), [Ident, Dot, Index, Dot, Index]);
    assert_eq!(kinds("t . 0.1"), [Ident, Dot, Index, Dot, Index]);
    assert_eq!(kinds("0..1.5"), [Int, DotDot, Real]);
    assert_eq!(tokens("t.0e5"), ["t", ".", "!0e5"]);
}

#[test]
fn angle_brackets_close_one_by_one() {
    assert_eq!(tokens("interval<vec3<real>>"), ["interval", "<", "vec3", "<", "real", ">", ">"]);
    assert_eq!(tokens("a>=b"), ["a", ">=", "b"]);
}

#[test]
fn a_lexer_can_start_inside_a_token() {
    let mut lexer = Lexer::new("x::<int>==y");
    lexer.seek(8);
    assert_eq!(lexer.token().kind, TokenKind::EqEq);
}

#[test]
fn minus_is_a_token_of_its_own() {
    assert_eq!(tokens("a--b * - c->d"), ["a", "-", "-", "b", "*", "-", "c", "->", "d"]);
}

#[test]
fn malformed_numbers_are_taken_whole() {
    for text in ["1.", "3x", "1e", "1e+", "0x1F", "1.5q", "2.5e-", "1_e_", "10u32"] {
        assert_eq!(tokens(text), [format!("!{text}")]);
    }
    assert_eq!(tokens("2147483648"), ["!2147483648"]);
    assert_eq!(tokens("1_0 2147483647 1_000.5_0 1E+3"), ["1_0", "2147483647", "1_000.5_0", "1E+3"]);
}

#[test]
fn values() {
    assert_eq!(int_value("2_147_483_647"), Some(i32::MAX));
    assert_eq!(int_value("2147483648"), None);
    assert_eq!(real_value("1_0.2_5e-1"), Some(1.025));
}

#[test]
fn names_are_xid() {
    assert_eq!(tokens("größe _ _a1 λx 半径 x̂"), ["größe", "_", "_a1", "λx", "半径", "x̂"]);
    assert_eq!(
        kinds("PI pi define self real Let"),
        [TokenKind::Pi, TokenKind::Ident, TokenKind::Ident, TokenKind::Ident, TokenKind::Ident, TokenKind::Ident]
    );
    for (kind, word) in TokenKind::KEYWORDS {
        assert_eq!(kinds(word), [*kind]);
    }
    assert_eq!(TokenKind::KEYWORDS.len(), 19);
}

#[test]
fn white_space_comments_and_byte_order_mark_separate() {
    assert_eq!(tokens("\u{feff}a// b\r\n\tc /// d\n//"), ["a", "c"]);
    assert_eq!(tokens("a\u{a0}b"), ["a", "!\u{a0}", "b"]);
    assert_eq!(tokens("a\u{feff}b"), ["a", "!\u{feff}", "b"]);
}

#[test]
fn runs_of_bad_characters_are_one_token() {
    assert_eq!(
        tokens("a @@€ b & c \"d e\" f 'x' g's"),
        ["a", "!@@€", "b", "!&", "c", "!\"d e\"", "f", "!'x'", "g", "!'", "s"]
    );
}
