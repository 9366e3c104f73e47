//! One slip of the pen costs about one message (LANGUAGE 19.2): in valid programs single tokens are deleted, doubled
//! or replaced, and the errors are counted. Knows nothing of which errors are the right ones.

use std::fs;
use std::path::Path;

use isograd_compiler::{Diagnostic, Limits, MemoryLoader, Options, Unwatched, check, inspect, render};
use isograd_syntax::lexer::{Lexer, TokenKind};
use isograd_testkit::corpus;
use isograd_testkit::points::Random;

/// Mutations of all programs together.
const MUTATIONS: usize = 3_000;

/// Errors per mutation that makes any, on average.
const AVERAGE: f64 = 1.12;

/// Errors of the worst mutation. The sample changes with each program that is added to the corpus, and one mutation may
/// well make several independent errors, so this leaves room; what it catches are avalanches.
const WORST: usize = 12;

/// Ranges of the tokens after `from`.
fn tokens(text: &str, from: usize) -> Vec<(usize, usize)> {
    let mut lexer = Lexer::new(text);
    let mut found = Vec::new();
    loop {
        let token = lexer.token();
        if token.kind == TokenKind::End {
            return found;
        }
        if token.start >= from {
            found.push((token.start, token.end));
        }
    }
}

/// `before` bytes of the text are the same in many programs; most of what is mutated should be the program itself.
fn mutate(text: &str, before: usize, random: &mut Random) -> String {
    let all = tokens(text, if random.chance(75) { before } else { 0 });
    let (start, end) = all[random.below(all.len())];
    let token = &text[start..end];
    let (other_start, other_end) = all[random.below(all.len())];
    let new = match random.below(3) {
        0 => String::new(),
        1 => format!("{token} {token}"),
        _ => text[other_start..other_end].to_owned(),
    };
    format!("{}{new}{}", &text[..start], &text[end..])
}

fn errors(text: &str) -> (Vec<Diagnostic>, String) {
    // Mutated loops and choices can become large; that is not the point here.
    let limits = Limits { graph_nodes: 100_000, ..Limits::default() };
    let options = Options { limits, ..Options::default() };
    let checked = check("main.vola", text.into(), &MemoryLoader::default(), &options, &Unwatched);
    let found: Vec<Diagnostic> =
        inspect(&checked, &options, || Unwatched).into_iter().filter(Diagnostic::is_error).collect();
    if !checked.is_ok() {
        assert!(!found.is_empty(), "a program is refused without an error:\n{text}");
    }
    let shown = render::terminal(&found, &checked.files, false);
    (found, shown)
}

#[test]
fn one_wrong_token_makes_about_one_error() {
    let cases = corpus::language().into_iter().map(|case| (case.program(), case.before.len()));
    let examples = corpus::folder("examples").into_iter().map(|(_, text)| (text, 0));
    // Which of them must be valid is the business of the language tests.
    let corpus: Vec<(String, usize)> = examples.chain(cases).filter(|(p, _)| errors(p).0.is_empty()).collect();
    assert!(corpus.len() > 200, "{} programs", corpus.len());
    let mut random = Random::new(2026);
    let (mut mutations, mut total) = (0_usize, 0_usize);
    let mut worst: Vec<(usize, String)> = Vec::new();
    for round in 0..MUTATIONS {
        let (program, before) = &corpus[round % corpus.len()];
        let mutated = mutate(program, *before, &mut random);
        let (found, shown) = errors(&mutated);
        if found.is_empty() {
            continue;
        }
        (mutations, total) = (mutations + 1, total + found.len());
        worst.push((found.len(), shown));
    }
    worst.sort_by_key(|(n, _)| std::cmp::Reverse(*n));
    let average = total as f64 / mutations as f64;
    let most = worst.first().map_or(0, |w| w.0);
    println!("{MUTATIONS} mutations, {mutations} of them wrong: {average:.3} errors each, at most {most}");
    let shown: Vec<&str> = worst.iter().take(100).map(|(_, text)| text.as_str()).collect();
    let list = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mutations.txt");
    fs::write(&list, shown.join("\n=========\n")).unwrap();
    assert!(average <= AVERAGE && most <= WORST, "the worst are in {}", list.display());
}
