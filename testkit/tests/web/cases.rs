//! Programs for the web page, with their inputs and what the runtime makes of them. Knows nothing of browsers.

use isograd_compiler::{
    Artefact, ColumnType, MemoryLoader, Options, Port, Precision, Query, Rate, Request, Unwatched, check, compile,
};
use isograd_runtime::{Column, EvalOptions, Runtime, Settings, Values};
use isograd_testkit::points::Random;

/// A program and where it is evaluated.
pub struct Case {
    pub name: &'static str,
    source: &'static str,
    queries: &'static [&'static str],
    precision: Precision,
    /// Parameters that vary besides the first.
    varying: &'static [&'static str],
    points: usize,
    /// Whether points come from a file, not from the address.
    pub file: bool,
    uniforms: &'static [(&'static str, f64)],
}

const BALL: &str = "
module std::sphere;
export fn field(at: vec3, radius: real) -> real { csg s = Sphere(radius); eval s.Sdf3d(at) }
";

const MELTED: &str = "
module std::sphere;
module std::box;
module std::smooth_union;
module std::trans3d;
export fn field(at: vec3, turn: real = 0.25) -> real {
    csg tree = SmoothUnion(0.3){ Sphere(1.0) }{ Trans3d([sin(turn * at.z), 0.5, 0.0]){ Box([0.75, 0.5, 1.0]) } };
    eval tree.Sdf3d(at)
}
";

const FRACTAL: &str = "
export fn field(at: vec3, iterations: int, scale: real) -> real {
    let z = at;
    let stretch = 1.0;
    for i in 0..iterations {
        z = clamp(z, [-1.0; 3], [1.0; 3]) * 2.0 - z;
        let grow = clamp(1.0 / dot(z, z), 1.0, 4.0);
        z = z * grow * scale + at;
        stretch = stretch * grow * abs(scale) + 1.0;
    }
    length(z) / stretch
}
";

const PAIR: &str = "
export fn field(at: vec2, n: int) -> real { min(length(at) - 1.0, abs(at.x - n::<real>)) }
";

/// All cases. Blocks have 64 to 4096 points, of which 4 to 16 are computed at once.
pub const ALL: &[Case] = &[
    Case {
        name: "ball",
        source: BALL,
        queries: &["value", "gradient(at)"],
        precision: Precision::F32,
        varying: &[],
        points: 37,
        file: false,
        uniforms: &[("radius", 0.8)],
    },
    Case {
        name: "melted f32",
        source: MELTED,
        queries: &["value", "gradient(at)", "gradient(turn)"],
        precision: Precision::F32,
        varying: &[],
        points: 9001,
        file: true,
        uniforms: &[],
    },
    Case {
        name: "melted f64",
        source: MELTED,
        queries: &["value", "gradient(at)", "hessian(at)"],
        precision: Precision::F64,
        varying: &["turn"],
        points: 4999,
        file: true,
        uniforms: &[],
    },
    Case {
        name: "fractal",
        source: FRACTAL,
        queries: &["value", "gradient(at)", "gradient(scale)"],
        precision: Precision::F64,
        varying: &[],
        points: 101,
        file: false,
        uniforms: &[("iterations", 6.0), ("scale", -1.5)],
    },
    Case {
        name: "kinks",
        source: PAIR,
        queries: &["value", "gradient(at)", "kinks(at)"],
        precision: Precision::F32,
        varying: &["n"],
        points: 5003,
        file: true,
        uniforms: &[],
    },
];

/// A case, compiled and evaluated.
pub struct Prepared {
    pub artefact: Artefact,
    pub points: usize,
    /// By column: a number for each point, or one for all.
    pub inputs: Vec<(String, Vec<f64>)>,
    /// What the runtime computes.
    pub outputs: Vec<Column>,
}

/// Points at which rounding and signs show.
const SPECIAL: [f64; 9] = [0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-40, 3e38, 0.1];

impl Prepared {
    pub fn new(case: &Case) -> Self {
        let options = Options { verify: true, ..Options::default() };
        let checked = check("main.vola", case.source.into(), &MemoryLoader::default(), &options, &Unwatched);
        assert!(checked.is_ok(), "{:?}", checked.diagnostics);
        let request = Request {
            export: "field".into(),
            queries: case.queries.iter().map(|q| q.parse::<Query>().expect("a query")).collect(),
            precision: case.precision,
            rates: case.varying.iter().map(|name| ((*name).to_owned(), Rate::Varying)).collect(),
            ..Request::default()
        };
        let artefact = compile(&checked, &request, &options, &Unwatched).unwrap_or_else(|e| panic!("{e:?}"));
        let mut random = Random::new(7);
        let mut inputs = Vec::new();
        let mut given: Vec<Vec<f64>> = Vec::new();
        for port in &artefact.manifest.inputs {
            for (k, column) in port.columns.iter().enumerate() {
                let numbers = match (port.rate, column.scalar) {
                    (Rate::Varying, ColumnType::Real) => (0..case.points)
                        .map(|i| {
                            SPECIAL
                                .get(i / 3)
                                .filter(|_| i % 3 == k)
                                .copied()
                                .unwrap_or_else(|| random.within((-2.0, 2.0)))
                        })
                        .collect(),
                    (Rate::Varying, _) => (0..case.points).map(|i| f64::from((i % 5) as i32 - 2)).collect(),
                    (Rate::Uniform, _) => {
                        let number = case.uniforms.iter().find(|(name, _)| *name == column.name);
                        let default = column.default.map(|x| x.0);
                        vec![number.map(|(_, x)| *x).or(default).expect("a uniform's number")]
                    }
                };
                // What has a default is left out, so that the page must take it.
                if port.rate == Rate::Varying || column.default.is_none() {
                    inputs.push((column.name.clone(), numbers.clone()));
                }
                given.push(numbers);
            }
        }
        let ints: Vec<Vec<i32>> = given.iter().map(|x| x.iter().map(|x| *x as i32).collect()).collect();
        let columns = artefact.manifest.inputs.iter().flat_map(|port| &port.columns);
        let values: Vec<Values<'_>> = columns
            .zip(given.iter().zip(&ints))
            .map(|(column, (reals, ints))| match column.scalar {
                ColumnType::Real => Values::F64(reals),
                ColumnType::Int | ColumnType::Bool => Values::I32(ints),
            })
            .collect();
        let kernel = Runtime::new(Settings::default()).load(&artefact).expect("loads");
        let outputs = kernel.evaluate(&values, case.points, &EvalOptions::default()).expect("evaluates");
        let block = artefact.manifest.memory().expect("WebAssembly").block as usize;
        assert!(!case.file || case.points > block, "{}: {} points, blocks have {block}", case.name, case.points);
        Self { artefact, points: case.points, inputs, outputs }
    }

    /// How many columns of inputs vary.
    pub fn varying(&self) -> usize {
        let varying = |port: &&Port| port.rate == Rate::Varying;
        self.artefact.manifest.inputs.iter().filter(varying).map(|port| port.columns.len()).sum()
    }

    pub fn has_default(&self, name: &str) -> bool {
        let mut columns = self.artefact.manifest.inputs.iter().flat_map(|port| &port.columns);
        columns.any(|c| c.name == name && c.default.is_some())
    }

    /// The titles of the columns of outputs.
    pub fn titles(&self) -> Vec<String> {
        let title = |port: &Port, name: &str| match port.name == name {
            true => name.to_owned(),
            false => format!("{} {name}", port.name),
        };
        let outputs = &self.artefact.manifest.outputs;
        outputs.iter().flat_map(|port| port.columns.iter().map(move |c| title(port, &c.name))).collect()
    }
}
