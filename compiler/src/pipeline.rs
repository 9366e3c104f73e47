//! The pipeline: the one place that lists the steps of a compilation. Each step is a function of another crate; what
//! stands here is their order, and what becomes of their errors.

use std::collections::{BTreeMap, BTreeSet};

use isograd_elaborate::{Elaborated, Metadata, elaborate, metadata};
use isograd_graph::{Exhausted, Graph, Node, NodeId, Op, Origin, Precision, Verified, Watch, verify};
use isograd_program::typed::{Function, FunctionId, Param};
use isograd_program::{Loader, Program, Type};
use isograd_syntax::tree::Tree;
use isograd_syntax::{Code, Diagnostic, Diagnostics, FileId, Files, Limits, Span};
use isograd_transform::{
    Answering, DifferentiateError, Jump, KinkPlace, KinkReport, Smoothed, Suspect, Sweep, Width, answer, cost,
    differentiate, fold, kept_jumps, kernels, optimise, reverse_is_plausible, schedule, smooth, specialise, suspects,
};

use crate::emit::{emit, possible};
use crate::inspect::Influences;
use crate::kinks;
use crate::seal::{self, Found, Identity};
use crate::wanted::Wanting;
use crate::{
    Artefact, DerivativeMode, Derivatives, Differentiability, Request, Specialised, Target, WithStd, strict, within,
};

/// The steps of a compilation, in order. `--emit` and `--timings` name them.
pub const STEPS: &[&str] = &[
    "load",          // files are read and parsed, from import to import
    "check",         // names and types: trees become a typed program
    "elaborate",     // csg trees, calls and vectors dissolve: the program becomes a graph
    "smooth",        // in that mode, operations with kinks are replaced by smooth ones
    "kinks",         // reports of kinks become results
    "derive",        // the queries become `diff` nodes
    "differentiate", // `diff` nodes become tangents
    "fold",          // constants are computed in f64 and rounded once
    "specialise",    // what a box decides is dropped
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
    Module(Target, &'a [u8]),
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
                Stage::Module(target, bytes) => printed(target, bytes),
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
    possible(request).map_err(|d| vec![d])?;
    let wanting = Wanting::of(program, request, limits).map_err(|d| vec![*d])?;
    let width = request.width().map_err(|d| vec![*d])?;
    let boxes = within::boxes(request, &wanting).map_err(|d| vec![*d])?;

    watch.step("elaborate");
    let Elaborated { graph, origins, carried, mut warnings, diffs } =
        elaborate(program, wanting.export, limits, watch)?;
    let steps = Steps { options, origins: &origins, carried: &carried, export: &request.export };
    let graph = steps.checked("elaborate", graph, observe)?;

    watch.step("smooth");
    let (graph, diffs) = smoothed(graph, diffs, width, &steps, watch)?;
    let graph = steps.checked("smooth", graph, observe)?;
    let mut influences = Influences::default();
    influences.add(&graph, &diffs, watch);
    warnings.extend(influences.warnings(checked, &warnings));

    watch.step("kinks");
    let (graph, kinks) = reported_kinks(graph, &wanting.reports, request.precision, &steps, watch)?;
    let kinks = kinks::described(&kinks, &origins, &checked.files);
    let graph = steps.checked("kinks", graph, observe)?;

    watch.step("derive");
    let Answering { graph, jumps } =
        answer(&graph, &wanting.inputs(), &wanting.asked, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("derive", graph, observe)?;
    if width.is_some() {
        warnings.extend(steps.kept_jumps(&graph, watch));
    }

    let exports = checked.exports();
    let parameters = exports.iter().find(|e| e.name == request.export).map_or(&[][..], |e| e.parameters.as_slice());
    if request.differentiability == Differentiability::Strict {
        steps.proved(&graph, &wanting, parameters, request.precision, watch)?;
    }

    let precision = request.precision;
    let (graph, derivatives) = cheaper(graph, request, &steps, watch, observe)?;
    let graph = steps.checked("fold", graph, observe)?;
    let zeros = zeros(&graph);

    watch.step("specialise");
    let (graph, specialised) = match &boxes {
        Some(boxes) => {
            let left = specialise(&graph, boxes, precision, nodes, watch).map_err(|e| steps.exhausted(e))?;
            // Counted after the same algebra, so that the difference is what the box decides.
            let count = |graph: &Graph| {
                let graph = optimise(graph, precision, nodes, watch).map_err(|e| steps.exhausted(e))?;
                Ok::<_, Vec<Diagnostic>>(u32::try_from(graph.operations()).unwrap_or(u32::MAX))
            };
            let specialised = Specialised { from: count(&graph)?, to: count(&left)? };
            (left, Some(specialised))
        }
        None => (graph, None),
    };
    let graph = steps.checked("specialise", graph, observe)?;

    watch.step("kernels");
    let graph = kernels(&graph, precision, request.target.family(), nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("kernels", graph, observe)?;

    watch.step("optimise");
    let graph = optimise(&graph, precision, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("optimise", graph, observe)?;

    watch.step("schedule");
    let graph = schedule(&graph, precision, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let graph = steps.checked("schedule", graph, observe)?;

    watch.step("emit");
    let verified = verify(graph).map_err(|e| vec![internal(&e.to_string())])?;
    let place = |code, origin, message: &str| steps.placed(code, origin, message);
    let emitted = emit(&verified, request, &wanting, place).map_err(|d| vec![d])?;

    watch.step("seal");
    let identity = Identity::of(&checked.digest, request, &wanting);
    let found = Found { derivatives, zeros: &zeros, jumps: &jumps, kinks: &kinks, specialised };
    let manifest = seal::manifest(&identity, request, &wanting, parameters, &emitted.places, emitted.work, found);
    let bytes = emitted.seal(&manifest);
    observe("emit", Stage::Module(request.target, &bytes));
    observe("seal", Stage::Module(request.target, &bytes));
    Ok(Artefact { bytes, manifest, warnings })
}

/// Adds the outputs of each report to the results of an export. Kinks are those of its values, so derivatives and
/// enclosures inside the program are expanded first.
fn reported_kinks(
    mut graph: Graph,
    reports: &[KinkReport],
    precision: Precision,
    steps: &Steps<'_>,
    watch: &dyn Watch,
) -> Result<(Graph, Vec<Vec<KinkPlace>>), Vec<Diagnostic>> {
    let limits = &steps.options.limits;
    let nodes = usize::try_from(limits.derived_nodes).unwrap_or(usize::MAX);
    let results = graph.outputs.len();
    if !reports.is_empty() {
        graph = differentiate(graph, Sweep::Forward, precision, limits.diff_order, nodes, watch)
            .map_err(|e| steps.underivable(e))?;
    }
    let mut found = Vec::new();
    for report in reports {
        let places;
        (graph, places) =
            isograd_transform::kinks(&graph, results, report, nodes, watch).map_err(|e| steps.exhausted(e))?;
        found.push(places);
    }
    Ok((graph, found))
}

/// Per output of a folded graph: whether it is 0, before any algebra on values.
fn zeros(graph: &Graph) -> Vec<bool> {
    let is_zero = |node: Option<Node>| matches!(node, Some(Node::Real(bits)) if f64::from_bits(bits) == 0.0);
    graph.outputs.iter().map(|output| is_zero(graph.get(output.node))).collect()
}

/// The derivatives that each `diff` of the program asks for.
type Diffs = Vec<(Span, Vec<NodeId>)>;

/// The graph and its `diff`s with smooth operations of this width, or as they are.
fn smoothed(
    graph: Graph,
    diffs: Diffs,
    width: Option<Width>,
    steps: &Steps<'_>,
    watch: &dyn Watch,
) -> Result<(Graph, Diffs), Vec<Diagnostic>> {
    let Some(width) = width else { return Ok((graph, diffs)) };
    let nodes = usize::try_from(steps.options.limits.derived_nodes).unwrap_or(usize::MAX);
    let Smoothed { graph, places } = smooth(&graph, width, nodes, watch).map_err(|e| steps.exhausted(e))?;
    let place = |id: &NodeId| places.get(id.index()).copied();
    let diffs = diffs.into_iter().map(|(span, nodes)| (span, nodes.iter().filter_map(place).collect()));
    Ok((graph, diffs.collect()))
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
        let result = differentiate(graph.clone(), *sweep, request.precision, limits.diff_order, nodes, watch);
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
            Sweep::Reverse => (DerivativeMode::Reverse, &mut derivatives.reverse, cost.saturating_add(cost / 10)),
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

/// Nodes that a proof of differentiability computes at most, loops counted as often as they run.
const PROOF_STEPS: u64 = 2_000_000;

const NESTING: &str = "this `bound` would be nested in itself as often as the loop iterates";

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

    fn span(&self, origin: Origin) -> Option<isograd_syntax::Span> {
        self.origins.get(origin.0 as usize).copied()
    }

    fn placed(&self, code: Code, origin: Origin, message: &str) -> Diagnostic {
        match self.span(origin) {
            Some(span) => Diagnostic::new(code, span, message),
            None => Diagnostic::global(code, message),
        }
    }

    /// W0702 for the jumps that a smooth graph keeps on the way of a derivative.
    fn kept_jumps(&self, graph: &Graph, watch: &dyn Watch) -> Vec<Diagnostic> {
        let warning = |jump: Jump| {
            let what = match jump.op {
                Op::RealToInt => "the cast to int".to_owned(),
                op => format!("`{}`", kinks::spelled(op)),
            };
            let message = format!("{what} keeps its jumps in the mode `smooth`");
            let diagnostic = match self.origins.get(jump.origin.0 as usize) {
                Some(span) => Diagnostic::new(Code::W0702, *span, message).here("on the way of a derivative"),
                None => Diagnostic::global(Code::W0702, message),
            };
            diagnostic
                .note("the derivative is that between the jumps; only kinks, comparisons and branches become smooth")
                .help(
                    "differentiate nothing past a rounding, or make the steps with `step` or `if`, which become smooth",
                )
        };
        kept_jumps(graph, watch).into_iter().map(warning).collect()
    }

    /// E0703 and E0704, if something is not proved to be differentiable (LANGUAGE 14.2).
    fn proved(
        &self,
        graph: &Graph,
        wanting: &Wanting,
        parameters: &[Parameter],
        precision: Precision,
        watch: &dyn Watch,
    ) -> Result<(), Vec<Diagnostic>> {
        let names: Vec<String> = wanting.parameters.iter().map(|(name, ..)| name.clone()).collect();
        let ranges = strict::ranges(&wanting.arguments, parameters, &names);
        let Some(suspects) = suspects(graph, &ranges, precision, PROOF_STEPS, watch) else {
            return Err(self.exhausted(Exhausted::Time));
        };
        let columns: Vec<String> = wanting.inputs().into_iter().map(|(name, _)| name).collect();
        let place = |code, suspect: &Suspect, message: &str| self.placed(code, suspect.origin, message);
        let mut found = Diagnostics::default();
        found.extend(strict::diagnostics(&suspects, parameters, &columns, precision, place));
        if found.has_errors() { Err(reported(found, &self.options.limits)) } else { Ok(()) }
    }

    pub(crate) fn underivable(&self, why: DifferentiateError) -> Vec<Diagnostic> {
        let (origin, code, message, help) = match why {
            DifferentiateError::Exhausted(why) => return self.exhausted(why),
            DifferentiateError::Growing { diff, carried } => {
                let mut diagnostic = self.placed(Code::E0705, diff, GROWING);
                if let Some((name, span)) = carried.and_then(|c| self.carried.get(&c).zip(self.span(c))) {
                    diagnostic = diagnostic
                        .here(format!("depends on its own result, through `{name}`"))
                        .label(span, format!("`{name}` is carried from one iteration to the next"));
                }
                return vec![
                    diagnostic
                        .help("differentiate after the loop, or by a value that is computed in the same iteration"),
                ];
            }
            DifferentiateError::Nesting { bound, carried } => {
                let mut diagnostic = self.placed(Code::E0705, bound, NESTING);
                if let Some((name, span)) = carried.and_then(|c| self.carried.get(&c).zip(self.span(c))) {
                    diagnostic = diagnostic
                        .here(format!("depends on its own result, through `{name}`"))
                        .label(span, format!("`{name}` is carried from one iteration to the next"));
                }
                return vec![
                    diagnostic.help("enclose after the loop, or over a value that is computed in the same iteration"),
                ];
            }
            DifferentiateError::LoopBound { call, bound } => {
                let mut diagnostic = self
                    .placed(Code::E0805, call, "the number of iterations of a loop depends on what `bound` replaces")
                    .here("encloses a value that the loop computes");
                if let Some(span) = self.span(bound) {
                    diagnostic =
                        diagnostic.label(span, "this bound of the loop depends on the second argument of `bound`");
                }
                return vec![
                    diagnostic
                        .note("over an interval the loop would run no definite number of times")
                        .help("let the loop run as often as may be needed, and decide in its body by `if` what counts"),
                ];
            }
            DifferentiateError::Order(origin) => (
                origin,
                Code::E1009,
                format!("derivatives nest more than {} deep here", self.options.limits.diff_order),
                "lower the order, or raise the limit `diff_order`",
            ),
        };
        vec![self.placed(code, origin, &message).help(help)]
    }
}

/// A bug of the compiler, said as one.
fn internal(what: &str) -> Diagnostic {
    Diagnostic::global(Code::E1103, format!("the compiler made a malformed graph: {what}"))
        .help("this is a bug of Isograd: please report it with the program")
}

/// A module as text.
fn printed(target: Target, bytes: &[u8]) -> String {
    match target {
        Target::Wasm => wasmprinter::print_bytes(bytes).unwrap_or_else(|e| format!(";; {e}\n")),
        Target::Spirv => isograd_spirv::disassemble(bytes).unwrap_or_else(|e| format!("; {e}\n")),
        Target::Wgsl | Target::Glsl | Target::Hlsl | Target::Msl => String::from_utf8_lossy(bytes).into_owned(),
    }
}
