//! An export as its users run it: compiled to WebAssembly in both precisions, for the value alone, with the gradient,
//! and with the Hessian. Knows nothing of claims.

use std::sync::{Arc, LazyLock};

use isograd_compiler::{Precision, Query, Request};
use isograd_graph::Unwatched;
use isograd_runtime::{Column, EvalOptions, Kernel, Runtime, Values};
use isograd_testkit::library::{Jet, Order, Point};

use crate::support;

static RUNTIME: LazyLock<Runtime> = LazyLock::new(Runtime::default);

/// An export, compiled.
pub struct Kernels {
    value: Arc<Kernel>,
    gradient: Arc<Kernel>,
    hessian: Arc<Kernel>,
    single: Arc<Kernel>,
    dimension: usize,
}

impl Kernels {
    /// Compiles an export whose parameter is `p`.
    pub fn compile(source: &str, export: &str, dimension: usize) -> Result<Self, String> {
        let checked = support::check(source);
        if !checked.is_ok() {
            return Err(support::listed(&checked.diagnostics));
        }
        let kernel = |precision: Precision, queries: usize| {
            let all = [Query::Value, Query::Gradient("p".into()), Query::Hessian("p".into(), "p".into())];
            let request = Request {
                export: export.to_owned(),
                queries: all[..queries].to_vec(),
                precision,
                ..Request::default()
            };
            let artefact = isograd_compiler::compile(&checked, &request, &support::options(), &Unwatched);
            let artefact = artefact.map_err(|e| support::listed(&e))?;
            RUNTIME.load(&artefact).map_err(|e| e.to_string())
        };
        Ok(Self {
            value: kernel(Precision::F64, 1)?,
            gradient: kernel(Precision::F64, 2)?,
            hessian: kernel(Precision::F64, 3)?,
            single: kernel(Precision::F32, 3)?,
            dimension,
        })
    }

    /// How many reals the export returns.
    pub fn components(&self) -> usize {
        self.value.manifest().outputs.iter().map(|port| port.columns.len()).sum()
    }

    /// One component in f64.
    pub fn double(&self, points: &[Point], order: Order, component: usize) -> Result<Vec<Jet>, String> {
        let kernel = match order {
            Order::Value => &self.value,
            Order::Gradient => &self.gradient,
            Order::Hessian => &self.hessian,
        };
        self.jets(kernel, points, order, component)
    }

    /// One component in f32, with all derivatives.
    pub fn single(&self, points: &[Point], component: usize) -> Result<Vec<Jet>, String> {
        self.jets(&self.single, points, Order::Hessian, component)
    }

    fn jets(&self, kernel: &Kernel, points: &[Point], order: Order, component: usize) -> Result<Vec<Jet>, String> {
        let axes: Vec<Vec<f64>> =
            (0..self.dimension).map(|axis| points.iter().map(|point| point[axis]).collect()).collect();
        let inputs: Vec<Values<'_>> = axes.iter().map(|axis| Values::F64(axis)).collect();
        // The tests run side by side already.
        let options = EvalOptions { threads: Some(1), ..EvalOptions::default() };
        let columns = kernel.evaluate(&inputs, points.len(), &options).map_err(|e| e.to_string())?;
        let components = self.components();
        let (d, n) = (self.dimension, points.len());
        // A Jacobian has ∂e₀/∂w₀, ∂e₁/∂w₀, … (LANGUAGE 13.1), and so has each level of a Hessian.
        let column = |at: usize| columns.get(at * components + component).ok_or("a column is missing");
        let mut jets = vec![Jet::default(); n];
        let put = |column: &Column, jets: &mut [Jet], set: &dyn Fn(&mut Jet, f64)| {
            for (i, jet) in jets.iter_mut().enumerate() {
                set(jet, column.get(i).ok_or("a short column")?);
            }
            Ok::<_, String>(())
        };
        put(column(0)?, &mut jets, &|jet, x| jet.value = x)?;
        if order >= Order::Gradient {
            for i in 0..d {
                put(column(1 + i)?, &mut jets, &|jet, x| jet.gradient[i] = x)?;
            }
        }
        if order >= Order::Hessian {
            for (i, j) in (0..d).flat_map(|i| (0..d).map(move |j| (i, j))) {
                put(column(1 + d + i * d + j)?, &mut jets, &|jet, x| jet.hessian[i][j] = x)?;
            }
        }
        Ok(jets)
    }
}
