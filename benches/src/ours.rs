//! Isograd's side: sources compiled, modules loaded, blocks run. Uses the compiler and the runtime as a host does.

use std::sync::Arc;

use isograd_compiler::{
    Artefact, Checked, Diagnostic, MemoryLoader, Options, Query, Request, Unwatched, Watch, check, compile, print_step,
    render,
};
use isograd_runtime::{Instance, Kernel, Runtime};

use crate::models::Model;

pub type Failure = Box<dyn std::error::Error>;

/// What is asked of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    Value,
    /// The value and the three partial derivatives.
    Gradient,
}

/// A program and a request.
pub struct Job {
    pub checked: Checked,
    pub request: Request,
    pub options: Options,
}

impl Job {
    /// Asks a program's `field`.
    pub fn new(name: &str, text: &str, queries: Vec<Query>) -> Self {
        Self::within(name, text, queries, Options::default())
    }

    /// As [`new`](Self::new), without the limits on sizes that a service sets.
    pub fn unlimited(name: &str, text: &str, queries: Vec<Query>) -> Self {
        let mut options = Options::default();
        let limits = &mut options.limits;
        for limit in [
            &mut limits.source_bytes,
            &mut limits.total_source_bytes,
            &mut limits.graph_nodes,
            &mut limits.derived_nodes,
            &mut limits.export_scalars,
        ] {
            *limit = u64::MAX;
        }
        Self::within(name, text, queries, options)
    }

    fn within(name: &str, text: &str, queries: Vec<Query>, options: Options) -> Self {
        let checked = check(name, text.as_bytes().to_vec(), &MemoryLoader::default(), &options, &Unwatched);
        Self { checked, request: Request { export: "field".to_owned(), queries, ..Request::default() }, options }
    }

    /// The artefact.
    pub fn compiled(&self, watch: &dyn Watch) -> Result<Artefact, Failure> {
        compile(&self.checked, &self.request, &self.options, watch).map_err(|errors| self.failure(&errors))
    }

    /// The nodes of the graph that a step leaves.
    pub fn nodes(&self, step: &str) -> Result<usize, Failure> {
        let text = print_step(&self.checked, &self.request, step, &self.options, &Unwatched);
        let text = text.map_err(|errors| self.failure(&errors))?;
        Ok(text.lines().filter(|line| line.trim_start().starts_with('%')).count())
    }

    fn failure(&self, errors: &[Diagnostic]) -> Failure {
        render::terminal(errors, &self.checked.files, false).into()
    }
}

/// Compiles a model, from its text.
pub fn compiled(model: &Model, asked: Asked, watch: &dyn Watch) -> Result<Artefact, Failure> {
    let options = Options::default();
    let text = model.vola.clone().into_bytes();
    let checked = check(model.name, text, &MemoryLoader::default(), &options, watch);
    let mut queries = vec![Query::Value];
    if asked == Asked::Gradient {
        queries.push(Query::Gradient("at".into()));
    }
    let request = Request { export: "field".to_owned(), queries, ..Request::default() };
    compile(&checked, &request, &options, watch)
        .map_err(|errors| render::terminal(&errors, &checked.files, false).into())
}

/// A module loaded, and an instance with a block of points in place.
pub struct Ours {
    pub kernel: Arc<Kernel>,
    instance: Instance,
}

impl Ours {
    /// Loads an artefact and fills the columns of its block.
    pub fn new(artefact: &Artefact, points: &[Vec<f32>; 3]) -> Result<Self, Failure> {
        let kernel = Runtime::default().load(artefact)?;
        let mut instance = kernel.instance()?;
        for (axis, column) in points.iter().enumerate() {
            for (place, x) in instance.input::<f32>(axis).iter_mut().zip(column) {
                *place = *x;
            }
        }
        Ok(Self { kernel, instance })
    }

    /// Loads an artefact and fills each input column: its name and a point's index give an element.
    pub fn filled(artefact: &Artefact, fill: &dyn Fn(&str, usize) -> f32) -> Result<Self, Failure> {
        let kernel = Runtime::default().load(artefact)?;
        let mut instance = kernel.instance()?;
        let names = artefact.manifest.inputs.iter().flat_map(|port| &port.columns).map(|column| &column.name);
        for (index, name) in names.enumerate() {
            for (point, place) in instance.input::<f32>(index).iter_mut().enumerate() {
                *place = fill(name, point);
            }
        }
        Ok(Self { kernel, instance })
    }

    /// Points of a block.
    pub const fn block(&self) -> usize {
        self.instance.block()
    }

    /// Computes the block; the results stay in the module's memory.
    pub fn run(&mut self) {
        let count = self.block();
        std::hint::black_box(self.instance.run(count, None).is_ok());
    }

    /// A column of the results of [`run`](Self::run).
    pub fn column(&self, index: usize) -> &[f32] {
        self.instance.output(index)
    }
}
