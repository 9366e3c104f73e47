//! The shapes of the standard library, as their specimens use them, as raw graphs. Knows where specimens lie; knows
//! nothing of what is claimed of them.

use isograd_compiler::{MemoryLoader, Options, check};
use isograd_elaborate::elaborate;
use isograd_graph::{Graph, Unwatched};

use crate::corpus;

/// An export of a specimen.
#[derive(Debug, Clone)]
pub struct Shape {
    /// The entry of the library.
    pub entry: String,
    /// The export.
    pub export: String,
    /// Its graph.
    pub graph: Graph,
}

/// All exports of all specimens.
///
/// # Errors
/// If one is no valid program.
pub fn standard() -> Result<Vec<Shape>, String> {
    let mut shapes = Vec::new();
    for (path, text) in corpus::folder("testkit/tests/stdlib") {
        let entry = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let options = Options::default();
        let checked = check("main.vola", text.into_bytes(), &MemoryLoader::default(), &options, &Unwatched);
        let program = checked.program.as_ref().ok_or_else(|| format!("{entry}: {:?}", checked.diagnostics))?;
        for id in &program.exports {
            let elaborated = elaborate(program, *id, &options.limits, &Unwatched);
            let graph = elaborated.map_err(|e| format!("{entry}: {e:?}"))?.graph;
            let export = program.functions[id.0 as usize].name.to_string();
            shapes.push(Shape { entry: entry.clone(), export, graph });
        }
    }
    Ok(shapes)
}
