//! Runs the files of `tests/language`: programs with the results or diagnostics that LANGUAGE demands, each in both
//! precisions and with both sweeps, through the whole pipeline; on a Vulkan device in f32 with both sweeps and in f64
//! forward. Knows nothing of what the programs mean.
//!
//! A file holds cases, as `corpus` divides it; lines of a program may say what is expected of it.
//!
//! ```text
//! //@ EXPORT                   the next lines are about this export (at first `f`)
//! //= 1,2 => 3                 flattened arguments, flattened result; bools are 0 and 1
//! //= gradient(p): 1,2 => 3    the result of a query
//! //! E0506 E0506              codes that must be among the diagnostics; W codes do not stop the program
//! //! only E0201 W0701         the same, and there is no other error
//! //% smooth 1                  the whole case in the mode `smooth` with that sensitivity
//! ```

mod support;

use std::process::ExitCode;
use std::str::FromStr;

use isograd_compiler::{Checked, DerivativeMode, Diagnostic, Precision, Query, Sensitivity, Unwatched, inspect};
use isograd_graph::Value;
use isograd_program::typed::Function;
use isograd_testkit::corpus;
use libtest_mimic::{Arguments, Failed, Trial};
use support::{Graphs, Sweep, Varying};

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let cases: Vec<Case> = corpus::language().iter().map(parse).collect();
    let rows = |c: &Case| c.checks.iter().map(|k| k.rows.len()).sum::<usize>();
    println!(
        "{} programs: {} with {} rows of results, {} with diagnostics",
        cases.len(),
        cases.iter().filter(|c| !c.checks.is_empty()).count(),
        cases.iter().map(rows).sum::<usize>(),
        cases.iter().filter(|c| !c.codes.is_empty()).count(),
    );
    let trials = cases.into_iter().map(|case| Trial::test(case.name.clone(), move || run(&case))).collect();
    let conclusion = libtest_mimic::run(&arguments, trials);
    if arguments.list {
        return conclusion.exit_code();
    }
    let (report, failed) = support::gpu::report();
    println!("{report}");
    if failed { ExitCode::FAILURE } else { conclusion.exit_code() }
}

/// A program and what must become of it.
struct Case {
    name: String,
    source: String,
    checks: Vec<Check>,
    codes: Vec<String>,
    /// Whether no other errors are allowed.
    only: bool,
    /// The sensitivity, if the mode is `smooth`.
    smooth: Option<Sensitivity>,
}

/// Points of one query of one export, and its results there.
struct Check {
    export: String,
    query: Query,
    rows: Vec<(Vec<f64>, Vec<f64>)>,
}

fn parse(case: &corpus::Case) -> Case {
    let mut parsed = Case {
        name: case.name.clone(),
        source: case.program(),
        checks: Vec::new(),
        codes: Vec::new(),
        only: false,
        smooth: None,
    };
    let mut export = "f";
    for line in case.text.lines() {
        let fail = |what: &str| -> ! { panic!("{}: {what}: {line}", case.name) };
        let Some((directive, rest)) = line.split_at_checked(3) else { continue };
        let rest = rest.trim();
        match directive {
            "//@" => export = rest,
            "//!" => {
                let codes = rest.strip_prefix("only").map(str::trim_start);
                parsed.only |= codes.is_some();
                parsed.codes.extend(codes.unwrap_or(rest).split_whitespace().map(str::to_owned));
            }
            "//%" => match rest.strip_prefix("smooth ").map(str::parse) {
                Some(Ok(sensitivity)) => parsed.smooth = Some(sensitivity),
                _ => fail("no mode and sensitivity"),
            },
            "//=" => {
                let (query, row) = rest.split_once(": ").unwrap_or(("value", rest));
                let query = Query::from_str(query).unwrap_or_else(|e| fail(&e.to_string()));
                let Some((point, result)) = row.split_once("=>") else { fail("no `=>`") };
                let row = (numbers(point), numbers(result));
                match parsed.checks.last_mut() {
                    Some(check) if check.export == export && check.query == query => check.rows.push(row),
                    _ => parsed.checks.push(Check { export: export.to_owned(), query, rows: vec![row] }),
                }
            }
            "//+" => fail("inside of a case"),
            _ => {}
        }
    }
    let expects = parsed.only || !parsed.checks.is_empty() || !parsed.codes.is_empty();
    assert!(expects, "{} expects nothing", parsed.name);
    parsed
}

fn numbers(list: &str) -> Vec<f64> {
    let list = list.split(',').filter(|_| !list.trim().is_empty());
    list.map(|x| x.trim().parse().unwrap_or_else(|e| panic!("`{x}`: {e}"))).collect()
}

fn run(case: &Case) -> Result<(), Failed> {
    let checked = support::check(&case.source);
    let diagnostics = inspect(&checked, &support::options(), || Unwatched);
    let found: Vec<&str> = diagnostics.iter().map(|d| d.code.name()).collect();
    let all = || format!("found {found:?}\n{}", support::listed(&diagnostics));
    // What compiling says of each export is among what inspecting says of all.
    for export in checked.exports() {
        let (Ok(late) | Err(late)) = support::compile(&checked, &export.name);
        for d in late {
            let same =
                |o: &Diagnostic| (o.code, &o.message, o.labels.first()) == (d.code, &d.message, d.labels.first());
            if d.is_error() && !diagnostics.iter().any(same) {
                return Err(format!("only compiling `{}` says {}: {}", export.name, d.code.name(), d.message).into());
            }
        }
    }

    for code in &case.codes {
        let demanded = case.codes.iter().filter(|c| *c == code).count();
        if found.iter().filter(|c| *c == code).count() < demanded {
            return Err(format!("expected {code} {demanded} times: {}", all()).into());
        }
    }
    let demanded = |d: &str| case.codes.iter().filter(|c| *c == d).count();
    if let Some(code) =
        found.iter().find(|d| case.only && d.starts_with('E') && found.iter().filter(|o| o == d).count() > demanded(d))
    {
        return Err(format!("{code} follows from the others: {}", all()).into());
    }
    if case.codes.iter().any(|c| c.starts_with('E')) {
        return Ok(());
    }
    if found.iter().any(|c| c.starts_with('E')) {
        return Err(all().into());
    }
    for check in &case.checks {
        let function = support::export(&checked, &check.export);
        for precision in [Precision::F32, Precision::F64] {
            for (sweep, mode) in SWEEPS {
                verify(&checked, function, check, precision, (sweep, mode), case.smooth).map_err(|e| {
                    let (query, export, precision) = (&check.query, &check.export, precision.name());
                    format!("{query} of `{export}` in {precision}, {}: {e}", mode.name())
                })?;
            }
        }
    }
    Ok(())
}

/// The ways to compute derivatives.
const SWEEPS: [(Sweep, DerivativeMode); 2] =
    [(Sweep::Forward, DerivativeMode::Forward), (Sweep::Reverse, DerivativeMode::Reverse)];

/// All evaluations of one query agree with what is expected, and where they must, with each other to the bit.
fn verify(
    checked: &Checked,
    function: &Function,
    check: &Check,
    precision: Precision,
    (sweep, mode): (Sweep, DerivativeMode),
    smooth: Option<Sensitivity>,
) -> Result<(), String> {
    let kinds = support::inputs(function);
    let mut points = Vec::new();
    for (point, _) in &check.rows {
        if point.len() != kinds.len() {
            return Err(format!("{} arguments are given, {} needed", point.len(), kinds.len()));
        }
        points.push(kinds.iter().zip(point).map(|(k, x)| support::value(*k, *x, precision)).collect::<Vec<_>>());
    }
    let queries = std::slice::from_ref(&check.query);
    let graphs = Graphs::in_mode(checked, &check.export, queries, precision, sweep, smooth);
    let graphs = graphs.map_err(|e| support::listed(&e))?;
    let emitted = graphs.emitted(&points);
    expect("reference before kernels", check, &graphs.oracle(&points))?;
    expect("reference of what is emitted", check, &emitted)?;

    let request = |varying| support::smooth(support::request(function, queries, precision, mode, varying), smooth);
    let together = support::evaluated(checked, &request(Varying::All), &points)?;
    expect("WebAssembly", check, &together)?;
    same_bits("WebAssembly", &together, "the reference", &emitted)?;
    if precision == Precision::F32 || (mode == DerivativeMode::Forward && support::gpu::doubles()) {
        // By the rules the bits are those of WebAssembly, and so what is expected.
        support::gpu::judge(checked, &request(Varying::All), &points).map_err(|e| format!("SPIR-V: {e}"))?;
    }
    for (i, point) in points.iter().enumerate() {
        let alone = support::evaluated(checked, &request(Varying::First), std::slice::from_ref(point))?;
        same_bits("a point alone, the other parameters uniform", &alone, "all points", &together[i..=i])?;
    }
    Ok(())
}

fn expect(who: &str, check: &Check, found: &[Vec<Value>]) -> Result<(), String> {
    for ((point, expected), found) in check.rows.iter().zip(found) {
        if expected.len() != found.len() {
            return Err(format!("{who}: {} results, {} expected", found.len(), expected.len()));
        }
        for (i, (e, f)) in expected.iter().zip(found).enumerate() {
            let x = support::number(*f);
            let tolerance = if matches!(f, Value::Real(_)) { 1e-5 * e.abs().max(1.0) } else { 0.0 };
            let agree = *e == x || (e.is_nan() && x.is_nan()) || (e - x).abs() <= tolerance && e.is_finite();
            if !agree {
                return Err(format!("{who}: at {point:?} scalar {i} is {x}, expected {e}"));
            }
        }
    }
    Ok(())
}

fn same_bits(a: &str, left: &[Vec<Value>], b: &str, right: &[Vec<Value>]) -> Result<(), String> {
    for (i, (l, r)) in left.iter().zip(right).enumerate() {
        if l.len() != r.len() || !l.iter().zip(r).all(|(l, r)| l.same_bits(*r)) {
            return Err(format!("point {i}: {a} gives {l:?}, {b} {r:?}"));
        }
    }
    Ok(())
}
