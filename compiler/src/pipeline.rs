//! The pipeline: the one place that lists the steps of a compilation. Each step is a function of another crate; what
//! stands here is their order, and what becomes of their errors.

use std::collections::{BTreeMap, BTreeSet};

use isograd_elaborate::{Elaborated, Metadata, elaborate, metadata};
use isograd_graph::{Exhausted, Graph, Origin, Verified, Watch, verify};
use isograd_program::typed::{Function, FunctionId, Param};
use isograd_program::{Loader, Program, Type};
use isograd_syntax::tree::Tree;
use isograd_syntax::{Code, Diagnostic, Diagnostics, FileId, Files, Limits};
use isograd_transform::{
    DifferentiateError, Sweep, cost, derive, differentiate, fold, kernels, optimise, reverse_is_plausible, schedule,
};
use isograd_wasm::{EmitError, Plan, Split};

use crate::inspect::Influences;
use crate::seal::{self, Identity};
use crate::wanted::Wanting;
use crate::{Artefact, DerivativeMode, Derivatives, Request, WithStd};

/// The steps of a compilation, in order. `--emit` and `--timings` name them.
pub const STEPS: &[&str] = &[
    "load",          // files are read and parsed, from import to import
    "check",         // names and types: trees become a typed program
    "elaborate",     // csg trees, calls and vectors dissolve: the program becomes a graph
    "derive",        // the queries become `diff` nodes
    "differentiate", // `diff` nodes become tangents
    "fold",          // constants are computed in f64 and rounded once
    "kernels",       // transcendental functions become fragments of exact operations
    "optimise",      // rewrites that preserve bits
    "schedule",      // order of emission
    "emit",          // instructions
    "seal",          // manifest and id
];

/// What a host sets for all its compilations.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Limits of LANGUAGE 18.
    pub limits: Limits,
    /// Run the graph verifier after each transform, not only before emission.
    pub verify: bool,
}

/// A checked program.
#[derive(Debug, Clone)]
pub struct Checked {
    /// All files, for rendering diagnostics.
    pub files: Files,
    /// Errors and warnings, in source order.
    pub diagnostics: Vec<Diagnostic>,
    /// The typed program; `None` if there are errors.
    pub program: Option<Program>,
    /// BLAKE3 of all files with their names, hexadecimal: the program's id.
    pub digest: String,
    /// Defaults and ranges of the parameters of each export.
    metadata: Vec<(FunctionId, Vec<Metadata>)>,
    /// Of the entry file.
    pub(crate) tree: Tree,
    /// If there are errors, what was made of the program all the same.
    partial: Option<Program>,
    /// The files that belong to no library.
    own: BTreeSet<FileId>,
}

/// An export as shown to users.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// Its name.
    pub name: String,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
    /// Its result.
    pub result: Type,
    /// Its documentation.
    pub doc: Option<String>,
}

/// A parameter of an export. Its flattened scalars are `ty.columns(&name)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its type.
    pub ty: Type,
    /// Its default, scalar by scalar; a bool is 0 or 1 (LANGUAGE 9.3).
    pub default: Option<Vec<f64>>,
    /// The lower and the upper ends of its range, scalar by scalar.
    pub range: Option<(Vec<f64>, Vec<f64>)>,
}

impl Checked {
    /// Whether it compiled without errors.
    #[must_use]
    pub const fn is_ok(&self) -> bool {
        self.program.is_some()
    }

    /// The program, also one with errors.
    pub(crate) fn any_program(&self) -> Option<&Program> {
        self.program.as_ref().or(self.partial.as_ref())
    }

    /// Whether a file belongs to the program itself, not to a library.
    pub(crate) fn is_own(&self, file: FileId) -> bool {
        self.own.contains(&file)
    }

    /// The exports in source order; none if there are errors.
    #[must_use]
    pub fn exports(&self) -> Vec<Export> {
        let Some(program) = &self.program else { return Vec::new() };
        program
            .exports
            .iter()
            .filter_map(|id| {
                let function = program.functions.get(id.0 as usize)?;
                Some(Export {
                    name: function.name.clone(),
                    parameters: self.parameters(*id, function),
                    result: function.result.clone(),
                    doc: function.doc.clone(),
                })
            })
            .collect()
    }

    /// The parameters of an export with their metadata.
    fn parameters(&self, export: FunctionId, function: &Function) -> Vec<Parameter> {
        let metadata = self.metadata.iter().find(|(id, _)| *id == export).map_or(&[][..], |(_, m)| m.as_slice());
        let metadata = metadata.iter().cloned().chain(std::iter::repeat_with(Metadata::default));
        let parameter = |(p, m): (&Param, Metadata)| Parameter {
            name: p.name.clone(),
            ty: p.ty.clone(),
            default: m.default,
            range: m.range,
        };
        function.params.iter().zip(metadata).map(parameter).collect()
    }
}

/// Loads and checks a program. `entry_name` is the name shown in diagnostics; `loader` finds the files it imports,
/// and is extended by the standard library.
#[must_use]
pub fn check(entry_name: &str, entry: Vec<u8>, loader: &dyn Loader, options: &Options, watch: &dyn Watch) -> Checked {
    watch.step("load");
    let loaded = isograd_program::load(entry_name, entry, &WithStd(loader), &options.limits);
    let digest = seal::digest(&loaded.files);
    let mut found = Diagnostics::default();
    found.extend(loaded.diagnostics.iter().cloned());
    // What could not be read is known to the checker, which reports nothing that only follows from it.
    watch.step("check");
    let checked = isograd_program::check(&loaded, &options.limits);
    found.extend(checked.diagnostics);
    found.omit_errors(checked.omitted_errors);
    let metadata = evaluated(&checked.program, &options.limits, watch, &mut found);
    let (program, partial) =
        if found.has_errors() { (None, Some(checked.program)) } else { (Some(checked.program), None) };
    let own = loaded.modules.iter().filter(|m| m.library.is_none()).map(|m| m.file).collect();
    let tree = loaded.modules.into_iter().next().map(|m| m.tree).unwrap_or_default();
    let diagnostics = reported(found, &options.limits);
    Checked { files: loaded.files, diagnostics, program, digest, metadata, tree, partial, own }
}

/// The metadata of all exports without errors; what is wrong with it goes to `found`.
fn evaluated(
    program: &Program,
    limits: &Limits,
    watch: &dyn Watch,
    found: &mut Diagnostics,
) -> Vec<(FunctionId, Vec<Metadata>)> {
    let of = |export: &FunctionId| {
        let (metadata, wrong) = metadata(program, *export, limits, watch);
        found.extend(wrong);
        (*export, metadata)
    };
    program.exports.iter().filter(|e| !program.unsound.functions.contains(e)).map(of).collect()
}

/// Diagnostics in source order, at most as many as the limit allows; the rest is counted.
pub(crate) fn reported(found: Diagnostics, limits: &Limits) -> Vec<Diagnostic> {
    let report = found.finish(limits);
    let mut diagnostics = report.diagnostics;
    if report.omitted_errors > 0 {
        let message = match report.omitted_errors {
            1 => "1 more error is not shown".to_owned(),
            n => format!("{n} more errors are not shown"),
        };
        diagnostics
            .push(Diagnostic::global(Code::E1012, message).help("mend these first, or raise the limit `diagnostics`"));
    }
    diagnostics
}

/// What a step leaves, shown to an observer.
enum Stage<'a> {
    Graph(&'a Graph),
    Module(&'a [u8]),
}

/// Compiles one request.
///
/// # Errors
/// Diagnostics: of the program (specialisation, limits) or of the request (unknown export, parameter or query).
pub fn compile(
    checked: &Checked,
    request: &Request,
    options: &Options,
    watch: &dyn Watch,
) -> Result<Artefact, Vec<Diagnostic>> {
    run(checked, request, options, watch, &mut |_, _| {})
}

/// The text form of what a step leaves: one of [`STEPS`] from `check` on, or `parse`.
///
/// # Errors
/// As [`compile`], or if there is no such step.
pub fn print_step(
    checked: &Checked,
    request: &Request,
    step: &str,
    options: &Options,
    watch: &dyn Watch,
) -> Result<String, Vec<Diagnostic>> {
    match (step, &checked.program) {
        ("load" | "parse", _) => return Ok(isograd_syntax::print(&checked.tree)),
        ("check", Some(program)) => return Ok(isograd_program::print(program)),
        _ if STEPS.contains(&step) => {}
        _ => {
            let message = format!("there is no step `{step}`");
            return Err(vec![Diagnostic::global(Code::E1102, message).help(format!("steps: {}", STEPS.join(", ")))]);
        }
    }
    let mut text = None;
    run(checked, request, options, watch, &mut |name, stage| {
        if name == step {
            text = Some(match stage {
                Stage::Graph(graph) => isograd_graph::print(graph),
                Stage::Module(bytes) => wasmprinter::print_bytes(bytes).unwrap_or_else(|e| format!(";; {e}\n")),
            });
        }
    })?;
    text.ok_or_else(|| vec![Diagnostic::global(Code::E1102, format!("the step `{step}` leaves nothing to print"))])
}

fn run(
    checked: &Checked,
    request: &Request,
    options: &Options,
    watch: &dyn Watch,
    observe: &mut dyn FnMut(&'static str, Stage<'_>),
) -> Result<Artefact, Vec<Diagnostic>> {
    let Some(program) = &checked.program else { return Err(checked.diagnostics.clone()) };
    let limits = &options.limits;
    let nodes = usize::try_from(limits.derived_nodes).unwrap_or(usize::MAX);
    let wanting = Wanting::of(program, request, limits).map_err(|d| vec![*d])?;

    watch.step("elaborate");
    let Elaborated { graph, origins, carried, mut warnings, diffs } =
        elaborate(program, wanting.export, limits, watch)?;
    let mut influences = Influences::default();
    influences.add(&graph, &diffs, watch);
    warnings.extend(influences.warnings(checked, &warnings));
    let steps = Steps { options, origins: &origins, carried: &carried, export: &request.export };
    let graph = steps.checked("elaborate", graph, observe)?;

    watch.step("derive");
    let graph = derive(&graph, &wanting.scalars, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("derive", graph, observe)?;

    let precision = request.precision;
    let (graph, derivatives) = cheaper(graph, request, &steps, watch, observe)?;
    let graph = steps.checked("fold", graph, observe)?;

    watch.step("kernels");
    let graph = kernels(&graph, precision, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("kernels", graph, observe)?;

    watch.step("optimise");
    let graph = optimise(&graph, precision, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("optimise", graph, observe)?;

    watch.step("schedule");
    let graph = schedule(&graph, precision, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("schedule", graph, observe)?;

    watch.step("emit");
    let verified = verify(graph).map_err(|e| vec![internal(&e.to_string())])?;
    let emission =
        isograd_wasm::Options { precision, varying: &wanting.varying, vectors: None, split: Split::default() };
    let written = Plan::new(&verified, &emission).and_then(Plan::write).map_err(|e| vec![unemittable(&e)])?;

    watch.step("seal");
    let identity = Identity::of(&checked.digest, request, &wanting);
    let exports = checked.exports();
    let parameters = exports.iter().find(|e| e.name == request.export).map_or(&[][..], |e| e.parameters.as_slice());
    let manifest =
        seal::manifest(&identity, request, &wanting, parameters, &written.layout, written.facts, derivatives);
    let bytes = written.seal(&serde_json::to_vec(&manifest).unwrap_or_default()).bytes;
    observe("emit", Stage::Module(&bytes));
    observe("seal", Stage::Module(&bytes));
    Ok(Artefact { bytes, manifest, warnings })
}

/// The steps `differentiate` and `fold`, in the direction that the request names, or in both, of which one is kept: the
/// reverse one if its graph costs so much less that it makes up for the values it has to keep.
fn cheaper(
    graph: Graph,
    request: &Request,
    steps: &Steps<'_>,
    watch: &dyn Watch,
    observe: &mut dyn FnMut(&'static str, Stage<'_>),
) -> Result<(Graph, Derivatives), Vec<Diagnostic>> {
    let limits = &steps.options.limits;
    let nodes = usize::try_from(limits.derived_nodes).unwrap_or(usize::MAX);
    watch.step("differentiate");
    let sweeps: &[Sweep] = match request.mode {
        DerivativeMode::Forward => &[Sweep::Forward],
        DerivativeMode::Reverse => &[Sweep::Reverse],
        DerivativeMode::Auto if reverse_is_plausible(&graph) => &[Sweep::Forward, Sweep::Reverse],
        DerivativeMode::Auto => &[Sweep::Forward],
    };
    // One direction may exceed a limit that the other keeps.
    let mut failure = None;
    let mut keep = |result: Result<Graph, Vec<Diagnostic>>| match result {
        Ok(graph) => Some(graph),
        Err(why) => {
            failure.get_or_insert(why);
            None
        }
    };
    let mut derived = Vec::new();
    for sweep in sweeps {
        let result = differentiate(graph.clone(), *sweep, limits.diff_order, nodes, watch);
        derived.extend(keep(result.map_err(|e| steps.underivable(e))).map(|graph| (*sweep, graph)));
    }
    watch.step("fold");
    let mut derivatives = Derivatives { mode: DerivativeMode::Forward, forward: None, reverse: None };
    let mut best: Option<(u64, Graph, Graph)> = None;
    for (sweep, derived) in derived {
        let result = fold(&derived, request.precision, nodes, watch);
        let Some(folded) = keep(result.map_err(|e| steps.exhausted(e))) else { continue };
        let cost = cost(&folded);
        let (mode, place, weight) = match sweep {
            Sweep::Forward => (DerivativeMode::Forward, &mut derivatives.forward, cost),
            // All values wait in registers or memory until the walk comes back to them.
            Sweep::Reverse => (DerivativeMode::Reverse, &mut derivatives.reverse, cost.saturating_add(cost / 4)),
        };
        *place = Some(cost);
        if best.as_ref().is_none_or(|(least, ..)| weight < *least) {
            derivatives.mode = mode;
            best = Some((weight, derived, folded));
        }
    }
    match (best, failure) {
        (Some((_, derived, folded)), _) => {
            steps.checked("differentiate", derived, observe)?;
            Ok((folded, derivatives))
        }
        (None, why) => Err(why.unwrap_or_default()),
    }
}

const GROWING: &str = "the order of this derivative would grow with the number of iterations";

/// What the steps of one compilation have in common.
pub(crate) struct Steps<'a> {
    pub options: &'a Options,
    pub origins: &'a [isograd_syntax::Span],
    /// The names of the variables that loops carry.
    pub carried: &'a BTreeMap<Origin, String>,
    pub export: &'a str,
}

impl Steps<'_> {
    /// Shows a step's graph and, if the host wants it, verifies it.
    fn checked(
        &self,
        step: &'static str,
        graph: Graph,
        observe: &mut dyn FnMut(&'static str, Stage<'_>),
    ) -> Result<Graph, Vec<Diagnostic>> {
        observe(step, Stage::Graph(&graph));
        if !self.options.verify {
            return Ok(graph);
        }
        verify(graph).map(Verified::into_inner).map_err(|e| vec![internal(&format!("after `{step}`: {e}"))])
    }

    pub(crate) fn exhausted(&self, why: Exhausted) -> Vec<Diagnostic> {
        let limits = &self.options.limits;
        let export = self.export;
        vec![match why {
            Exhausted::Nodes(n) => Diagnostic::global(
                Code::E1008,
                format!("`{export}` with its derivatives needs more than {n} operations"),
            )
            .help("ask for fewer derivatives at once, or raise the limit `derived_nodes`"),
            Exhausted::Time => {
                let limit = limits.compile_time_ms;
                Diagnostic::global(Code::E1011, format!("compiling `{export}` took longer than {limit} ms"))
                    .help("simplify the program, or raise the limit `compile_time_ms`")
            }
        }]
    }

    pub(crate) fn underivable(&self, why: DifferentiateError) -> Vec<Diagnostic> {
        let (origin, code, message, help) = match why {
            DifferentiateError::Exhausted(why) => return self.exhausted(why),
            DifferentiateError::Growing { diff, carried } => {
                let place = |span| Diagnostic::new(Code::E0705, span, GROWING);
                let at = |origin: Origin| self.origins.get(origin.0 as usize).copied();
                let mut diagnostic = at(diff).map_or_else(|| Diagnostic::global(Code::E0705, GROWING), place);
                if let Some((name, span)) = carried.and_then(|c| self.carried.get(&c).zip(at(c))) {
                    diagnostic = diagnostic
                        .here(format!("depends on its own result, through `{name}`"))
                        .label(span, format!("`{name}` is carried from one iteration to the next"));
                }
                return vec![
                    diagnostic
                        .help("differentiate after the loop, or by a value that is computed in the same iteration"),
                ];
            }
            DifferentiateError::Order(origin) => (
                origin,
                Code::E1009,
                format!("derivatives nest more than {} deep here", self.options.limits.diff_order),
                "lower the order, or raise the limit `diff_order`",
            ),
        };
        let diagnostic = match self.origins.get(origin.0 as usize) {
            Some(span) => Diagnostic::new(code, *span, message),
            None => Diagnostic::global(code, message),
        };
        vec![diagnostic.help(help)]
    }
}

/// A bug of the compiler, said as one.
fn internal(what: &str) -> Diagnostic {
    Diagnostic::global(Code::E1103, format!("the compiler made a malformed graph: {what}"))
        .help("this is a bug of Isograd: please report it with the program")
}

fn unemittable(why: &EmitError) -> Diagnostic {
    Diagnostic::global(Code::E1103, format!("the module cannot be emitted: {why}"))
}
