//! Isograd's side: sources compiled, modules loaded, blocks run. Uses the compiler and the runtime as a host does.

use std::sync::Arc;

use isograd_compiler::{Artefact, MemoryLoader, Options, Query, Request, Watch, check, compile, render};
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
