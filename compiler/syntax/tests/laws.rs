//! What holds for every input: no panic, spans in the file at characters' boundaries, children before parents,
//! errors in order; and every correct tree survives any white space.

use isograd_syntax::tree::Tree;
use isograd_syntax::{FileId, Files, Limits, Span, parse, print, render};
use proptest::prelude::*;

const WORDS: &[&str] = &[
    "module",
    "entity",
    "operation",
    "concept",
    "impl",
    "for",
    "fn",
    "export",
    "let",
    "csg",
    "eval",
    "if",
    "else",
    "in",
    "true",
    "INF",
    "define",
    "tensor",
    "interval",
    "real",
    "vec3",
    "x",
    "y",
    "0",
    "1.5",
    "2",
    "3x",
    "1.",
    "@",
    "\"",
    "é",
    "///",
    "//",
    "\n",
    "(",
    ")",
    "{",
    "}",
    "[",
    "]",
    "<",
    ">",
    ",",
    ";",
    ":",
    "::",
    ".",
    "..",
    "->",
    "=",
    "==",
    "!=",
    "<=",
    ">=",
    "+",
    "-",
    "*",
    "/",
    "%",
    "!",
    "&&",
    "||",
    "#",
    "fn f() -> real {",
    "x: real",
    "let x =",
    "f(x)",
    "; 3]",
];

fn spans(tree: &Tree) -> Vec<Span> {
    let blocks = tree.blocks.iter().flat_map(|b| b.stmts.iter().map(|s| s.span).chain([b.span]));
    let items = tree.items.iter().flat_map(|i| i.attributes.iter().map(|a| a.span).chain([i.span]));
    let exprs = tree.exprs.iter().map(|e| e.span).chain(tree.types.iter().map(|t| t.span));
    exprs.chain(blocks).chain(items).collect()
}

fn check(text: &str) {
    let limits = Limits { nesting: 20, ..Limits::default() };
    let parsed = parse(FileId(0), text, &limits);
    let mut files = Files::default();
    files.add("x.vola", text);
    let labels = parsed.diagnostics.iter().flat_map(|d| d.labels.iter().map(|l| l.span));
    for span in spans(&parsed.tree).into_iter().chain(labels) {
        assert!(text.get(span.start as usize..span.end as usize).is_some(), "{span:?} of {text:?}");
    }
    assert!(parsed.diagnostics.iter().all(isograd_syntax::Diagnostic::is_error));
    assert!(parsed.diagnostics.is_sorted_by_key(|d| d.labels[0].span.start));
    assert_eq!(print(&parsed.tree).is_empty(), parsed.tree.items.is_empty());
    assert_eq!(render::terminal(&parsed.diagnostics, &files, true).is_empty(), parsed.diagnostics.is_empty());
    assert_eq!(render::json(&parsed.diagnostics, &files).as_array().map(Vec::len), Some(parsed.diagnostics.len()));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_text_is_read(text in "\\PC{0,200}") {
        check(&text);
    }

    #[test]
    fn any_soup_of_tokens_is_read(words in prop::collection::vec(prop::sample::select(WORDS), 0..80), glue in "[ \n]{1}") {
        check(&words.concat());
        check(&words.join(&glue));
        check(&format!("fn f(x: real) -> real {{ {} }}", words.join(&glue)));
    }

    #[test]
    fn a_correct_file_cut_anywhere_is_read(from in 0..WHOLE.len(), to in 0..WHOLE.len()) {
        let (from, to) = (from.min(to), from.max(to));
        check(&WHOLE[from..to]);
        check(&format!("{}{}", &WHOLE[..from], &WHOLE[to..]));
    }
}

const WHOLE: &str = include_str!("whole.vola");

#[test]
fn the_whole_file_is_correct_and_white_space_means_nothing() {
    let parsed = parse(FileId(0), WHOLE, &Limits::default());
    assert_eq!(parsed.diagnostics, []);
    let (doc, code) = WHOLE.split_once('\n').unwrap();
    let spaced = format!("{doc}\r\n{}", code.replace(' ', " \t\r\n // c\n"));
    assert_eq!(print(&parse(FileId(0), &spaced, &Limits::default()).tree), print(&parsed.tree));
}
