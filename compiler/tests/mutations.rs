//! One slip of the pen costs about one message (LANGUAGE 19.2): in valid programs single tokens are deleted, doubled
//! or replaced, and the errors are counted. Knows nothing of which errors are the right ones.

use std::fs;
use std::path::Path;

use isograd_compiler::{Diagnostic, Limits, MemoryLoader, Options, Unwatched, check, inspect, render};
use isograd_syntax::lexer::{Lexer, TokenKind};

/// Mutations of all programs together.
const MUTATIONS: usize = 3_000;

/// Errors per mutation that makes any, on average.
const AVERAGE: f64 = 1.12;

/// Errors of the worst mutation: a name that is used in several bodies is unknown in each of them.
const WORST: usize = 6;

/// Valid programs: the examples and the cases of the language tests that expect results.
fn corpus() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut programs = Vec::new();
    for folder in ["examples", "examples/thesis"] {
        for path in files(&root.join(folder), "vola") {
            programs.push(fs::read_to_string(path).unwrap());
        }
    }
    let folder = root.join("testkit/tests/language");
    for path in files(&folder, "cases") {
        let text = fs::read_to_string(path).unwrap();
        let mut parts = text.split("//# ");
        let mut preamble = String::new();
        for line in parts.next().unwrap_or("").lines() {
            preamble += &match line.strip_prefix("//+ ") {
                Some(included) => fs::read_to_string(folder.join(included)).unwrap(),
                None => format!("{line}\n"),
            };
        }
        let valid =
            parts.filter(|case| case.contains("\n//= ") && !case.contains("\n//! E") && !case.contains("\n//?"));
        programs.extend(valid.map(|case| format!("{preamble}// {case}")));
    }
    programs
}

fn files(folder: &Path, extension: &str) -> Vec<std::path::PathBuf> {
    let mut found: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    found.retain(|p| p.extension().is_some_and(|e| e == extension));
    found.sort();
    found
}

/// xorshift64* (Vigna 2016).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % n
    }
}

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

fn mutate(text: &str, random: &mut Random) -> String {
    // The preamble of the cases is the same everywhere; most of what is mutated should be the case itself.
    let own = text.find("\n// ").filter(|_| random.below(4) > 0).unwrap_or(0);
    let all = tokens(text, own);
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
    let corpus = corpus();
    assert!(corpus.len() > 50, "{} programs", corpus.len());
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let (mut mutations, mut total) = (0_usize, 0_usize);
    let mut worst: Vec<(usize, String)> = Vec::new();
    for round in 0..MUTATIONS {
        let program = &corpus[round % corpus.len()];
        if round < corpus.len() && !errors(program).0.is_empty() {
            panic!("not valid:\n{}", errors(program).1);
        }
        let mutated = mutate(program, &mut random);
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
