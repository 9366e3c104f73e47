//! The command line: every command and flag, declared once. Knows what may be written, not what it does.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use isograd_compiler::{
    DerivativeMode, Differentiability, Form, InvalidWithin, Number, Precision, Query, STEPS, Sensitivity, Target,
    Within, query_forms,
};
use isograd_server::Config;

use crate::Failure;

/// Compiles distance fields written in Vola and evaluates them with their derivatives.
///
/// Exit codes: 0 success, 1 the program or the data is wrong, 2 wrong usage.
#[derive(Debug, Parser)]
#[command(name = "isograd", version, max_term_width = 120)]
pub struct Isograd {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Report what is wrong with programs.
    Check(Check),
    /// List the exports of a program: documentation, parameters with defaults and ranges, results.
    Describe(Describe),
    /// Compile exports to WebAssembly or shaders, or show what a step of the compiler makes of them.
    #[command(after_help = "\
Examples:
  isograd compile ball.vola --query value --query 'gradient(at)'
  isograd compile ball.vola --target spirv --out-dir shaders
  isograd compile ball.vola --target wgsl --form library -o -
  isograd compile ball.vola --target spirv --emit emit")]
    Compile(Compile),
    /// Evaluate an export, or its derivatives, at points.
    #[command(after_help = "\
Examples:
  isograd eval ball.vola --args 1,2,3 --query value --query 'gradient(at)'
  isograd eval ball.vola --points points.csv --set radius=0.5 --format csv
  isograd eval ball.vola --set at=0,1,0,1,0,1 --set radius=0.5 --query 'bound(at)' --query 'lipschitz(at)'
  isograd eval ball.vola --points points.csv --set radius=0.5 --target spirv --format raw > values")]
    Eval(Eval),
    /// List the Vulkan devices, which evaluate the target spirv, in the order of preference.
    Devices(Devices),
    /// Format files in place: spaces, indentation, line ends; line breaks stay.
    Fmt(Fmt),
    /// Serve the HTTP API.
    Serve(Serve),
    /// Explain diagnostics by example; without a code, list them all.
    Explain(Explain),
    /// List the limits: name, default, the diagnostic that reports it, what it counts.
    Limits(Limits),
}

/// What every command takes that uses a program.
#[derive(Debug, Args)]
pub struct Reading {
    #[command(flatten)]
    pub sources: Sources,
    /// Fail if there are warnings.
    #[arg(long)]
    pub deny_warnings: bool,
}

/// What every command takes that reads a program.
#[derive(Debug, Args)]
pub struct Sources {
    #[command(flatten)]
    pub external: External,
    /// Change a limit of the language; `isograd limits` lists them. May be repeated.
    #[arg(long = "limit", value_name = "NAME=VALUE", value_parser = limit)]
    pub limits: Vec<(String, u64)>,
}

/// External modules.
#[derive(Debug, Args)]
pub struct External {
    /// Register a directory as a library, so that `module NAME::file;` finds it. May be repeated.
    #[arg(long = "library", value_name = "NAME=DIR", value_parser = library)]
    pub libraries: Vec<(String, PathBuf)>,
}

/// `isograd check`
#[derive(Debug, Args)]
pub struct Check {
    /// The entry files, each of a program.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// How to write the diagnostics.
    #[arg(long, value_enum, default_value_t = ReportFormat::Terminal)]
    pub format: ReportFormat,
    #[command(flatten)]
    pub reading: Reading,
}

/// `isograd describe`
#[derive(Debug, Args)]
pub struct Describe {
    /// The program's entry file.
    pub file: PathBuf,
    /// Write JSON, as the HTTP API does.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub reading: Reading,
}

/// `isograd compile`
#[derive(Debug, Args)]
pub struct Compile {
    /// The program's entry file.
    pub file: PathBuf,
    /// Compile this export only; without it, every export.
    #[arg(long, value_name = "NAME")]
    pub export: Option<String>,
    #[arg(long = "query", value_name = "QUERY", value_parser = query, help = query_help())]
    pub queries: Vec<Query>,
    /// What to compile to.
    #[arg(long, value_name = "TARGET", default_value = Target::default().name(), value_parser = targets(|_| true))]
    pub target: Target,
    /// What a host calls.
    #[arg(long, value_name = "FORM", default_value = Form::default().name(), value_parser = forms())]
    pub form: Form,
    /// The precision of `real`.
    #[arg(long, value_enum, default_value_t = PrecisionName::F32)]
    pub precision: PrecisionName,
    /// Which way derivatives are computed; the results differ by rounding only.
    #[arg(long, value_enum, default_value_t = ModeName::Auto)]
    pub mode: ModeName,
    #[command(flatten)]
    pub smoothing: Smoothing,
    #[command(flatten)]
    pub specialising: Specialising,
    /// Print what a step of the compiler leaves instead of writing a module; `emit` prints WebAssembly and SPIR-V as
    /// assembly. `tree` is parse, `program` is check, `graph` is optimise, `wat` is the emit of wasm.
    #[arg(long, value_name = "STEP", value_parser = PossibleValuesParser::new(emittable()))]
    pub emit: Option<String>,
    /// Print how long each step took and, with a module, which way its derivatives are computed.
    #[arg(long)]
    pub timings: bool,
    /// Write to this file; `-` is the standard output. A WebAssembly module contains its manifest; that of another
    /// module is written beside it, to FILE.json, which says how to call it. Beside the standard output there is none.
    #[arg(short = 'o', value_name = "FILE", conflicts_with = "out_dir")]
    pub output: Option<PathBuf>,
    #[arg(long, value_name = "DIR", conflicts_with = "emit", help = out_dir_help())]
    pub out_dir: Option<PathBuf>,
    #[command(flatten)]
    pub reading: Reading,
}

/// `isograd eval`
#[derive(Debug, Args)]
pub struct Eval {
    /// The program's entry file.
    pub file: PathBuf,
    /// The export to evaluate; may be left out if there is one.
    #[arg(long, value_name = "NAME")]
    pub export: Option<String>,
    /// One point: all parameters flattened, `x,y,z,…`, of a box start and end of each real; the last ones may be left
    /// out if they have defaults. May be repeated.
    #[arg(long, value_name = "A,B,…", allow_hyphen_values = true, conflicts_with_all = ["points", "set"])]
    pub args: Vec<String>,
    /// Points as CSV, `-` for the standard input. The header names scalars of parameters: `at.x,at.y,at.z`; of a box
    /// their ends: `at.x.start,at.x.end`; of a direction `at.x.direction`.
    #[arg(long, value_name = "FILE")]
    pub points: Option<PathBuf>,
    /// The value of a parameter that is the same at all points; of a box start and end of each real; of a direction
    /// `NAME.direction=A,B,…`. May be repeated.
    #[arg(long, value_name = "NAME=A,B,…", value_parser = assignment)]
    pub set: Vec<(String, String)>,
    #[arg(long = "query", value_name = "QUERY", value_parser = query, help = query_help())]
    pub queries: Vec<Query>,
    /// The precision of `real`.
    #[arg(long, value_enum, default_value_t = PrecisionName::F32)]
    pub precision: PrecisionName,
    /// Which way derivatives are computed; the results differ by rounding only.
    #[arg(long, value_enum, default_value_t = ModeName::Auto)]
    pub mode: ModeName,
    #[command(flatten)]
    pub smoothing: Smoothing,
    #[command(flatten)]
    pub specialising: Specialising,
    /// What to evaluate with. The results are the same bits, except where a device does not round as IEEE 754 says.
    #[arg(long, value_name = "TARGET", default_value = Target::default().name(), value_parser = targets(can_run))]
    pub target: Target,
    /// With `--target spirv`, on which device: a part of its name, or `discrete`, `integrated`, `virtual`, `cpu`. By
    /// default the first that `isograd devices` lists.
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// How to write the results.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Give up after this many seconds. With `--target spirv` a device is given the points piece by piece, some 64 MiB
    /// of numbers each, and has so long for each.
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..))]
    pub deadline: u64,
    #[command(flatten)]
    pub reading: Reading,
}

/// `isograd devices`
#[derive(Debug, Args)]
pub struct Devices {
    /// Write JSON.
    #[arg(long)]
    pub json: bool,
}

/// `isograd fmt`
#[derive(Debug, Args)]
pub struct Fmt {
    /// The files; `-` is the standard input, formatted to the standard output.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Write nothing; list the files that would change, and fail if there are any.
    #[arg(long)]
    pub check: bool,
    /// Also move from the 2024 dialect to the current one. Then a file must be without errors, what it imports too.
    #[arg(long)]
    pub migrate: bool,
    #[command(flatten)]
    pub sources: Sources,
}

/// `isograd serve`
#[derive(Debug, Args)]
pub struct Serve {
    /// Read the configuration from this TOML file: `listen`, `store`, `[libraries]`, `[limits]`. Flags win over it.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    #[arg(long, value_name = "ADDRESS", help = by_default("Where to listen; port 0 takes any free one", |c| c.listen.to_string()))]
    pub listen: Option<SocketAddr>,
    #[arg(long, value_name = "DIR", help = by_default("The directory that keeps posted programs", |c| c.store.display().to_string()))]
    pub store: Option<PathBuf>,
    /// Change a limit of the language or of the service; `isograd limits` lists them. May be repeated.
    #[arg(long = "limit", value_name = "NAME=VALUE", value_parser = limit)]
    pub limits: Vec<(String, u64)>,
    #[command(flatten)]
    pub external: External,
}

fn by_default(what: &str, default: fn(Config) -> String) -> String {
    format!("{what} [default: {}]", default(Config::default()))
}

/// `isograd explain`
#[derive(Debug, Args)]
pub struct Explain {
    /// Codes of diagnostics: `E0401`.
    #[arg(value_name = "CODE")]
    pub codes: Vec<String>,
}

/// `isograd limits`
#[derive(Debug, Args)]
pub struct Limits {
    /// Write JSON, as the HTTP API does.
    #[arg(long)]
    pub json: bool,
}

/// How diagnostics are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ReportFormat {
    /// Text with the source lines, on the standard error.
    Terminal,
    /// An array, on the standard output.
    Json,
    /// A SARIF 2.1.0 log, on the standard output.
    Sarif,
    /// Workflow commands that GitHub shows as annotations, on the standard output.
    Github,
}

/// How results are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Aligned columns for reading, the inputs beside the results.
    Table,
    /// One object, as from the HTTP API.
    Json,
    /// A header and one row per point, in the order of the points.
    Csv,
    /// The numbers alone, as bytes: the columns that `csv` has, in that order, each with the numbers of all points; no
    /// header, nothing in between. All is little-endian: reals are f32 or f64, as `--precision` says, ints i32, truth
    /// values i32, 0 or 1; a NaN has all bits set.
    Raw,
}

/// The precision of `real`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PrecisionName {
    /// Single.
    F32,
    /// Double.
    F64,
}

impl From<PrecisionName> for Precision {
    fn from(name: PrecisionName) -> Self {
        match name {
            PrecisionName::F32 => Self::F32,
            PrecisionName::F64 => Self::F64,
        }
    }
}

/// Which way derivatives are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ModeName {
    /// The cheaper of the two.
    Auto,
    /// Beside the values.
    Forward,
    /// Against the values.
    Reverse,
}

impl From<ModeName> for DerivativeMode {
    fn from(name: ModeName) -> Self {
        match name {
            ModeName::Auto => Self::Auto,
            ModeName::Forward => Self::Forward,
            ModeName::Reverse => Self::Reverse,
        }
    }
}

/// What becomes of kinks.
#[derive(Debug, Clone, Copy, Args)]
pub struct Smoothing {
    /// What becomes of operations that have no derivative somewhere.
    #[arg(long, value_enum, default_value_t = DifferentiabilityName::Exact)]
    pub differentiability: DifferentiabilityName,
    /// With `--differentiability smooth`, how smooth: kinks get the width 0.001 times this, in the units of the
    /// operands. [default: 1]
    #[arg(long, value_name = "NUMBER", value_parser = sensitivity)]
    pub sensitivity: Option<Sensitivity>,
}

/// The box that a module is specialised to.
#[derive(Debug, Clone, Args)]
pub struct Specialising {
    /// Specialise to a box, in which the parameter's scalars keep between these ends: what the box decides is dropped.
    /// Inside, results are the same bits. May be repeated, for different parameters.
    #[arg(long, value_name = "NAME=[LO,…]:[HI,…]", value_parser = within, allow_hyphen_values = true)]
    pub within: Vec<Within>,
}

impl Specialising {
    /// By parameter.
    pub fn boxes(&self) -> Result<BTreeMap<String, Vec<[Number; 2]>>, Failure> {
        let mut boxes = BTreeMap::new();
        for within in &self.within {
            if boxes.insert(within.parameter.clone(), within.ends.clone()).is_some() {
                return Err(Failure::Usage(format!("`--within` names `{}` twice", within.parameter)));
            }
        }
        Ok(boxes)
    }
}

/// What becomes of operations that have no derivative somewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DifferentiabilityName {
    /// Values are exact, derivatives at kinks follow conventions.
    Exact,
    /// As `exact`, but a kink that a derivative may meet is an error.
    Strict,
    /// Kinks and jumps become smooth, values included.
    Smooth,
}

impl From<DifferentiabilityName> for Differentiability {
    fn from(name: DifferentiabilityName) -> Self {
        match name {
            DifferentiabilityName::Exact => Self::Exact,
            DifferentiabilityName::Strict => Self::Strict,
            DifferentiabilityName::Smooth => Self::Smooth,
        }
    }
}

/// The targets by name; of those that cannot be chosen here, what to choose instead.
fn targets(chosen: fn(Target) -> bool) -> impl TypedValueParser<Value = Target> {
    let value = move |t: Target| PossibleValue::new(t.name()).help(about(t)).hide(!chosen(t));
    PossibleValuesParser::new(Target::ALL.map(value)).try_map(move |name| {
        let target = Target::ALL.into_iter().find(|t| t.name() == name).unwrap_or_default();
        let others: Vec<&str> = Target::ALL.into_iter().filter(|t| chosen(*t)).map(Target::name).collect();
        if chosen(target) {
            Ok(target)
        } else {
            Err(format!("{name} is for other programs; what can be evaluated here is {}", others.join(" and ")))
        }
    })
}

/// What modules of a target are.
const fn about(target: Target) -> &'static str {
    match target {
        Target::Wasm => "WebAssembly with 128-bit SIMD",
        Target::Spirv => "SPIR-V 1.3 for Vulkan 1.1",
        Target::Wgsl => "WGSL for WebGPU; its compilers may fuse sums of products",
        Target::Glsl => "GLSL 4.50, translated from WGSL; its compilers may round otherwise",
        Target::Hlsl => "HLSL of shader model 6.0, translated likewise",
        Target::Msl => "the Metal Shading Language 2.4, translated likewise",
    }
}

/// Whether `isograd eval` can evaluate what is compiled to a target.
const fn can_run(target: Target) -> bool {
    matches!(target, Target::Wasm | Target::Spirv)
}

/// The forms by name.
fn forms() -> impl TypedValueParser<Value = Form> {
    let about = |form| match form {
        Form::Kernel => "a whole that computes all points of a call",
        Form::Library => "a function of one point, for programs that link or contain it; not wasm",
    };
    PossibleValuesParser::new(Form::ALL.map(|f| PossibleValue::new(f.name()).help(about(f))))
        .map(|name| Form::ALL.into_iter().find(|f| f.name() == name).unwrap_or_default())
}

fn out_dir_help() -> String {
    let names = Target::ALL.map(|target| format!("EXPORT.{}", target.extension()));
    format!(
        "Write each export into this directory, by default the current one: by target {}; and the manifest of what is \
         no WebAssembly beside it, EXPORT.{}.json",
        names.join(", "),
        Target::Spirv.extension()
    )
}

/// Other names of steps.
const ALIASES: [(&str, &str); 4] = [("tree", "parse"), ("program", "check"), ("graph", "optimise"), ("wat", "emit")];

/// What `--emit` takes.
fn emittable() -> Vec<&'static str> {
    std::iter::once("parse").chain(STEPS.iter().copied()).chain(ALIASES.map(|(alias, _)| alias)).collect()
}

/// The step that a name stands for.
pub fn step(name: &str) -> &str {
    ALIASES.iter().find(|(alias, _)| *alias == name).map_or(name, |(_, step)| step)
}

fn query_help() -> String {
    format!(
        "What to compute, by default `value`: {}; `*` stands for all parameters. May be repeated. `isograd describe` \
         says what each gives",
        query_forms()
    )
}

fn query(text: &str) -> Result<Query, String> {
    text.parse::<Query>().map_err(|e| e.to_string())
}

fn within(text: &str) -> Result<Within, String> {
    text.parse().map_err(|e: InvalidWithin| e.to_string())
}

fn sensitivity(text: &str) -> Result<Sensitivity, String> {
    text.parse::<Sensitivity>().map_err(|e| e.to_string())
}

fn library(text: &str) -> Result<(String, PathBuf), String> {
    let (name, directory) = assignment(text)?;
    let directory = PathBuf::from(directory);
    usable(&name, &directory)?;
    Ok((name, directory))
}

/// Whether a library can have this name and directory.
pub fn usable(name: &str, directory: &Path) -> Result<(), String> {
    if !is_identifier(name) {
        return Err(format!("`{name}` cannot stand in `module {name}::…;`"));
    }
    if directory.is_dir() { Ok(()) } else { Err(format!("there is no directory `{}`", directory.display())) }
}

/// Whether there is a limit of this name depends on the command.
fn limit(text: &str) -> Result<(String, u64), String> {
    let (name, value) = assignment(text)?;
    match value.trim().replace('_', "").parse() {
        Ok(value) => Ok((name, value)),
        Err(_) => Err(format!("`{value}` is no whole number")),
    }
}

fn is_identifier(name: &str) -> bool {
    let mut characters = name.chars();
    characters.next().is_some_and(|c| c.is_alphabetic() || c == '_')
        && characters.all(|c| c.is_alphanumeric() || c == '_')
        && !matches!(name, "self" | "super")
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("expected a name, `=` and a value".to_owned()),
    }
}
