//! How large the derivatives of the thesis's scenarios are after `optimise`: nodes, inputs and constants included, in
//! total. Knows no reason why; a change that makes one larger is to be seen here.

#![allow(clippy::pedantic, reason = "tests")]

use isograd_compiler::{MemoryLoader, Options, Request, Unwatched, check, print_step};

/// A scenario of `examples/thesis`, a query, and how many nodes it may have after `fold` (before) and `optimise`.
const MOST: [(&str, &str, usize, usize); 8] = [
    // The thesis needs 20 (fig. 4.8).
    ("sphere", "gradient(at)", 7, 17),
    ("sphere", "hessian(at)", 24, 38),
    ("hard_union", "gradient(at)", 67, 87),
    ("hard_union", "hessian(at)", 97, 125),
    ("smooth_union", "gradient(at)", 117, 126),
    ("smooth_union", "hessian(at)", 215, 223),
    ("blob", "gradient(at)", 4471, 4036),
    ("blob", "hessian(at)", 11160, 10197),
];

fn nodes(scenario: &str, query: &str, step: &str) -> usize {
    let file = format!("{}/../examples/thesis/{scenario}.vola", env!("CARGO_MANIFEST_DIR"));
    let options = Options::default();
    let source = std::fs::read(&file).unwrap();
    let program = check("main.vola", source, &MemoryLoader::default(), &options, &Unwatched);
    assert!(program.is_ok(), "{:?}", program.diagnostics);
    let request = Request { export: "field".into(), queries: vec![query.parse().unwrap()], ..Request::default() };
    let text = print_step(&program, &request, step, &options, &Unwatched).unwrap();
    text.lines().filter(|line| line.contains(" = ")).count()
}

#[test]
fn derivatives_of_the_scenarios_are_no_larger_than_they_were() {
    println!("{:>14} {:>13} {:>6} {:>9}", "scenario", "query", "fold", "optimise");
    let mut larger = Vec::new();
    for (scenario, query, fold, optimise) in MOST {
        let found = (nodes(scenario, query, "fold"), nodes(scenario, query, "optimise"));
        println!("{scenario:>14} {query:>13} {:>6} {:>9}", found.0, found.1);
        if found.0 > fold || found.1 > optimise {
            larger.push(format!("{scenario} {query}: {found:?} nodes, at most {:?} before", (fold, optimise)));
        }
    }
    assert!(larger.is_empty(), "{larger:#?}");
}
