//! What is executed: the examples, the specimens of the standard library, each operation of the table, graphs and
//! programs grown from seeds, and functions of libraries. Knows where subjects come from; knows nothing of devices.

use std::collections::BTreeMap;
use std::sync::Arc;

use isograd_compiler::{
    Checked, DerivativeMode, Differentiability, Export, MemoryLoader, Options, Precision, Query, Rate, Request,
    ScalarKind, compile,
};
use isograd_graph::{Builder, Mode, Op, Unwatched};
use isograd_transform::Sweep;

use super::prepared::{At, Made, of_graph, of_library, of_request};
use crate::corpus;
use crate::laws::{Failure, expanded_derivatives};
use crate::points::{Random, operands, surprises};
use crate::programs::{Choices, program};
use crate::random::{self, INPUTS, Shape};

/// Where cases come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Corpus {
    /// `examples/`: every export with every query.
    Examples,
    /// `testkit/tests/stdlib`: every specimen.
    Library,
    /// Each operation of the table.
    Operations,
    /// Random graphs.
    Graphs,
    /// Derivatives of random graphs, in both sweeps: branches, loops, tapes.
    Derivatives,
    /// Random programs.
    Programs,
    /// Functions that a kernel of another author calls.
    Linked,
}

impl Corpus {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Examples,
        Self::Library,
        Self::Operations,
        Self::Graphs,
        Self::Derivatives,
        Self::Programs,
        Self::Linked,
    ];

    /// Its name in reports and at the beginning of its cases' names.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Examples => "examples",
            Self::Library => "standard library",
            Self::Operations => "operations",
            Self::Graphs => "graphs",
            Self::Derivatives => "derivatives of graphs",
            Self::Programs => "programs",
            Self::Linked => "linked functions",
        }
    }
}

/// Something to execute.
pub struct Case {
    /// Where it comes from.
    pub corpus: Corpus,
    /// Its name, which says how to find it again.
    pub name: String,
    /// The precision of its reals.
    pub precision: Precision,
    make: Box<Make>,
}

/// Makes a case of that name, with the tools or without.
type Make = dyn Fn(&str, bool) -> Result<Option<Made>, Failure> + Send + Sync;

impl Case {
    /// Compiles and evaluates it on the CPU; with the tools its modules are validated. `None` if there is nothing to
    /// execute: a grown program may exceed a limit.
    ///
    /// # Errors
    /// If something fails that should not.
    pub fn make(&self, tools: bool) -> Result<Option<Made>, Failure> {
        (self.make)(&self.name, tools)
    }
}

/// How much is executed.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Points of each kernel.
    pub points: usize,
    /// Random graphs; of programs and derivatives a part.
    pub graphs: u64,
}

impl Extent {
    /// What CI runs.
    pub const SHORT: Self = Self { points: 256, graphs: 60 };
    /// What `ISOGRAD_LONG` runs.
    pub const LONG: Self = Self { points: 2048, graphs: 2000 };
}

/// All cases; those of linked functions only with the tools, which link them.
#[must_use]
pub fn all(extent: &Extent, tools: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    examples(extent, &mut cases);
    library(extent, &mut cases);
    operations(&mut cases);
    graphs(extent, &mut cases);
    derivatives(extent, &mut cases);
    programs(extent, &mut cases);
    if tools {
        linked(extent, &mut cases);
    }
    cases
}

/// The extent that the environment asks for.
#[must_use]
pub fn extent() -> Extent {
    if std::env::var_os("ISOGRAD_LONG").is_some() { Extent::LONG } else { Extent::SHORT }
}

fn checked(name: &str, text: &str) -> Arc<Checked> {
    let loader = MemoryLoader::default();
    Arc::new(isograd_compiler::check(name, text.as_bytes().to_vec(), &loader, &Options::default(), &Unwatched))
}

/// The files of a folder, each with its path in the repository.
fn files(folder: &str) -> Vec<(String, Arc<Checked>)> {
    let mut files = Vec::new();
    for (path, text) in corpus::folder(folder) {
        let path = path.to_string_lossy().replace('\\', "/");
        let name = path.rsplit_once("/../").map_or(path.as_str(), |(_, name)| name).to_owned();
        let checked = checked(&name, &text);
        assert!(checked.is_ok(), "{name} has errors");
        files.push((name, checked));
    }
    files
}

/// Some queries of an export.
#[derive(Clone, Default)]
struct Asked {
    queries: Vec<Query>,
    precision: Precision,
    mode: DerivativeMode,
    /// Whether the parameters but the first are uniform.
    uniform: bool,
    differentiability: Differentiability,
}

impl Asked {
    fn of(queries: &[String]) -> Self {
        let queries = queries.iter().map(|q| q.parse().unwrap_or_else(|e| panic!("{e}"))).collect();
        Self { queries, ..Self::default() }
    }

    fn f64(self) -> Self {
        Self { precision: Precision::F64, ..self }
    }

    fn reverse(self) -> Self {
        Self { mode: DerivativeMode::Reverse, ..self }
    }

    fn uniform(self) -> Self {
        Self { uniform: true, ..self }
    }

    fn smooth(self) -> Self {
        Self { differentiability: Differentiability::Smooth, ..self }
    }

    fn request(&self, export: &Export) -> Request {
        let rate = |p: &isograd_compiler::Parameter| (p.name.clone(), Rate::Varying);
        let rates: BTreeMap<_, _> =
            if self.uniform { BTreeMap::new() } else { export.parameters.iter().map(rate).collect() };
        Request {
            export: export.name.clone(),
            queries: self.queries.clone(),
            precision: self.precision,
            rates,
            mode: self.mode,
            differentiability: self.differentiability,
            ..Request::default()
        }
    }

    fn name(&self, file: &str, export: &str) -> String {
        let queries: Vec<String> = self.queries.iter().map(ToString::to_string).collect();
        let mut name = format!("{file} {export}: {} in {}", queries.join(", "), self.precision.name());
        if self.mode != DerivativeMode::Auto {
            name = format!("{name}, {}", self.mode.name());
        }
        if self.uniform {
            name += ", others uniform";
        }
        if self.differentiability != Differentiability::default() {
            name += ", smooth";
        }
        name
    }
}

/// The parameters of an export that have reals.
fn real_parameters(export: &Export) -> Vec<String> {
    let real = |p: &&isograd_compiler::Parameter| p.ty.scalars().contains(&ScalarKind::Real);
    export.parameters.iter().filter(real).map(|p| p.name.clone()).collect()
}

/// The case of some queries. Queries that the export has no answer to in WebAssembly are left out one by one.
fn ask(
    cases: &mut Vec<Case>,
    corpus: Corpus,
    file: &str,
    checked: &Arc<Checked>,
    export: &Export,
    asked: Asked,
    n: usize,
) {
    let name = format!("{}: {}", corpus.name(), asked.name(file, &export.name));
    let (checked, export, precision, seed) = (Arc::clone(checked), export.clone(), asked.precision, seed(&name));
    let make = move |name: &str, tools: bool| {
        let Some(request) = answered(&checked, &export, &asked) else { return Ok(None) };
        let at = At::Seeded(n, seed);
        let made = match corpus {
            Corpus::Linked => of_library(&checked, &request, name, at),
            _ => of_request(&checked, &request, name, at, tools),
        };
        made.map(Some)
    };
    cases.push(Case { corpus, name, precision, make: Box::new(make) });
}

/// The request for those of the queries that compile to WebAssembly.
fn answered(checked: &Checked, export: &Export, asked: &Asked) -> Option<Request> {
    let request = |queries: Vec<Query>| Asked { queries, ..asked.clone() }.request(export);
    let compiles = |request: &Request| {
        !request.queries.is_empty() && compile(checked, request, &Options::default(), &Unwatched).is_ok()
    };
    let all = request(asked.queries.clone());
    if compiles(&all) {
        return Some(all);
    }
    let alone = asked.queries.iter().filter(|query| compiles(&request(vec![(*query).clone()])));
    let some = request(alone.cloned().collect());
    compiles(&some).then_some(some)
}

/// A seed of a name: FNV-1a.
fn seed(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

fn texts(queries: &[&str]) -> Vec<String> {
    queries.iter().map(|q| (*q).to_owned()).collect()
}

fn examples(extent: &Extent, cases: &mut Vec<Case>) {
    for (file, checked) in files("examples") {
        for export in checked.exports() {
            let mut add = |asked: Asked| ask(cases, Corpus::Examples, &file, &checked, &export, asked, extent.points);
            let parameters = real_parameters(&export);
            let Some(first) = parameters.first() else {
                add(Asked::of(&texts(&["value"])));
                add(Asked::of(&texts(&["value"])).f64());
                continue;
            };
            let value = texts(&["value", &format!("jacobian({first})")]);
            let along = [format!("directional({first})"), format!("kinks({first})")];
            add(Asked::of(&[value.clone(), along.to_vec()].concat()));
            add(Asked::of(&[format!("hessian({first})")]));
            for enclosure in ["bound(P)", "bound(P, mean)", "bound(jacobian(P), P)", "lipschitz(P)"] {
                add(Asked::of(&[enclosure.replace('P', first)]));
            }
            add(Asked::of(&texts(&["value", "jacobian(*)"])).reverse());
            add(Asked::of(&value).f64());
            add(Asked::of(&value).smooth());
            if export.parameters.len() > 1 {
                add(Asked::of(&value).uniform());
            }
        }
    }
}

fn library(extent: &Extent, cases: &mut Vec<Case>) {
    for (file, checked) in files("testkit/tests/stdlib") {
        for export in checked.exports() {
            let mut add = |queries: &[&str], precision| {
                let asked = Asked { precision, ..Asked::of(&texts(queries)) };
                ask(cases, Corpus::Library, &file, &checked, &export, asked, extent.points);
            };
            add(&["value", "jacobian(p)", "hessian(p)"], Precision::F32);
            add(&["bound(p)"], Precision::F32);
            add(&["value", "jacobian(p)"], Precision::F64);
        }
    }
}

fn operations(cases: &mut Vec<Case>) {
    for precision in [Precision::F32, Precision::F64] {
        for op in Op::ALL {
            cases.push(Case {
                corpus: Corpus::Operations,
                name: format!("operations: {op} in {}", precision.name()),
                precision,
                make: Box::new(move |name, tools| {
                    let mut b = Builder::new(Mode::Raw, usize::MAX, &Unwatched);
                    let operand = |(k, kind): (usize, &isograd_graph::Scalar)| b.input(format!("x{k}"), *kind);
                    let arguments: Vec<_> = op.def().operands.iter().enumerate().map(operand).collect();
                    let result = b.op(*op, &arguments);
                    b.output("y", result);
                    let graph = b.finish().expect("no budget");
                    of_graph(&graph, precision, false, false, name, operands(*op, precision), tools).map(Some)
                }),
            });
        }
    }
}

/// Rows of inputs of a random graph: most are tame, some surprise.
fn rows(precision: Precision, n: usize, seed: u64) -> Vec<Vec<isograd_graph::Value>> {
    let mut rows = surprises(&INPUTS, precision, n / 4, seed);
    let mut random = Random::new(!seed);
    while rows.len() < n {
        let value = |kind: &isograd_graph::Scalar| match random.value_within(*kind, (-2.0, 3.0)) {
            isograd_graph::Value::Real(x) => isograd_graph::Value::Real(precision.round(x)),
            other => other,
        };
        rows.push(INPUTS.iter().map(value).collect());
    }
    rows
}

/// One of the two precisions by a seed, f32 twice as often.
const fn precision(seed: u64) -> Precision {
    if seed % 3 == 2 { Precision::F64 } else { Precision::F32 }
}

fn graphs(extent: &Extent, cases: &mut Vec<Case>) {
    let n = extent.points;
    for seed in 0..extent.graphs {
        let precision = precision(seed);
        cases.push(Case {
            corpus: Corpus::Graphs,
            name: format!("graphs: seed {seed} in {}", precision.name()),
            precision,
            make: Box::new(move |name, tools| {
                let shape = Shape { size: 40, depth: 3, transcendental: seed % 4 == 0, tame: seed % 2 == 0 };
                let graph = random::graph(seed, &shape);
                of_graph(&graph, precision, seed % 5 != 0, seed % 3 == 0, name, rows(precision, n, seed), tools)
                    .map(Some)
            }),
        });
    }
}

fn derivatives(extent: &Extent, cases: &mut Vec<Case>) {
    let n = extent.points;
    for seed in 1000..1000 + extent.graphs / 2 {
        let precision = precision(seed);
        let sweep = if seed % 2 == 0 { Sweep::Reverse } else { Sweep::Forward };
        cases.push(Case {
            corpus: Corpus::Derivatives,
            name: format!("derivatives of graphs: seed {seed}, {sweep:?} in {}", precision.name()),
            precision,
            make: Box::new(move |name, tools| {
                let shape = Shape { size: 15, depth: 2, transcendental: seed % 4 == 0, tame: seed % 3 != 0 };
                let graph = expanded_derivatives(&random::graph(seed, &shape), sweep)?;
                of_graph(&graph, precision, true, false, name, rows(precision, n, seed), tools).map(Some)
            }),
        });
    }
}

fn programs(extent: &Extent, cases: &mut Vec<Case>) {
    let n = extent.points;
    for seed in 0..extent.graphs {
        let precision = precision(seed);
        cases.push(Case {
            corpus: Corpus::Programs,
            name: format!("programs: seed {seed} in {}", precision.name()),
            precision,
            make: Box::new(move |name, tools| {
                let checked = checked("program.vola", &program(Choices::Seeded(Random::new(seed))));
                let exports = checked.exports();
                let export = exports.get(usize::from(seed % 2 == 0)).or(exports.first());
                let Some(export) = export else { return Ok(None) };
                let asked = Asked { precision, ..Asked::of(&texts(&["value", "jacobian(*)"])) };
                // Values alone if there is nothing to differentiate; nothing if the program exceeds a limit.
                let value = Asked { precision, ..Asked::of(&texts(&["value"])) };
                for asked in [asked, value] {
                    let request = asked.request(export);
                    if compile(&checked, &request, &Options::default(), &Unwatched).is_ok() {
                        return of_request(&checked, &request, name, At::Seeded(n, seed), tools).map(Some);
                    }
                }
                Ok(None)
            }),
        });
    }
}

/// Signatures of every shape: scalars of each kind, vectors, arrays, structs, several parameters and results.
const SHAPES: &str = "
export fn one(x: real) -> real { x * x + 1.0 }
export fn reals(x: real, y: vec3, z: vec2) -> vec4 { [x, y.x * z.x, y.y + z.y, sin(y.z)] }
export fn matrix(m: mat3, v: vec3) -> mat3 { m * transpose(m) + [v; 3] }
export fn ints(n: int, k: vec2<int>) -> vec2<int> { k * k + (-k) / [n::<real>, 3.0]::<vec2<int>> }
export fn truth(a: bool, x: real) -> bool { !a && x < 0.5 }
export fn mixed(t: (real, int, bool), x: vec2) -> (int, vec2, bool, real) {
    (t.1 + 1, [t.0, x.y], t.2 || x.x > 0.0, t.0 / x.x)
}
export fn loops(x: vec2, n: int) -> real {
    let s = x.x;
    for i in 0..n % 7 { s = s * x.y + i::<real>; }
    if s > 1.0 { s = sqrt(s); }
    s
}
";

fn linked(extent: &Extent, cases: &mut Vec<Case>) {
    let shapes = ("shapes".to_owned(), checked("shapes.vola", SHAPES));
    assert!(shapes.1.is_ok(), "{:?}", shapes.1.diagnostics);
    for (file, checked) in std::iter::once(shapes).chain(files("examples")) {
        for export in checked.exports() {
            let first = real_parameters(&export).first().map(|p| format!("jacobian({p})"));
            let both: Vec<String> = std::iter::once("value".to_owned()).chain(first).collect();
            let mut add = |asked: Asked| ask(cases, Corpus::Linked, &file, &checked, &export, asked, extent.points);
            if file == "shapes" {
                add(Asked::of(&texts(&["value"])));
                add(Asked::of(&both).f64());
            }
            add(Asked::of(&both));
        }
    }
}
