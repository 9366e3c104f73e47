//! Reads specimens and has them judged. Knows the directives and nothing of the laws.

use std::fs;
use std::path::{Path, PathBuf};

use isograd_testkit::library::{Claim, Class, Field, Measured, Order, Point, Side, judge as judge_field};

use crate::kernels::Kernels;

/// An export with what is claimed of it.
#[derive(Debug, Clone)]
pub struct Specimen {
    pub entry: String,
    pub export: String,
    pub claim: Claim,
    /// 2 or 3.
    pub dimension: usize,
    source: String,
}

/// All specimens of all files.
pub fn all() -> Vec<Specimen> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/stdlib");
    let mut files: Vec<PathBuf> = fs::read_dir(&directory)
        .expect("the folder of specimens")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "vola"))
        .collect();
    files.sort();
    let read = |file: &PathBuf| {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        parse(&stem, &fs::read_to_string(file).expect("a readable file"))
    };
    files.iter().flat_map(read).collect()
}

/// The specimens of one program.
///
/// # Panics
/// At directives that say nothing, and exports of which nothing is claimed.
pub fn parse(entry: &str, source: &str) -> Vec<Specimen> {
    let mut all: Vec<Specimen> = Vec::new();
    let mut said: Vec<(&str, &str)> = Vec::new();
    for line in source.lines() {
        let fail = |what: &str| -> ! { panic!("testkit/tests/stdlib/{entry}.vola: {what}: {line}") };
        if let Some(directive) = line.strip_prefix("//#") {
            let directive = directive.trim();
            said.push(directive.split_once(' ').unwrap_or((directive, "")));
        } else if let Some(rest) = line.strip_prefix("export fn ") {
            let Some((export, rest)) = rest.split_once('(') else { fail("no parameters") };
            let dimension = match rest.split(')').next() {
                Some("p: vec3") => 3,
                Some("p: vec2") => 2,
                _ => fail("the parameter must be `p: vec3` or `p: vec2`"),
            };
            let claim = claim(&said, dimension).unwrap_or_else(|e| fail(&e));
            said.clear();
            let (entry, export) = (entry.to_owned(), export.to_owned());
            all.push(Specimen { entry, export, claim, dimension, source: source.to_owned() });
        }
    }
    assert!(said.is_empty(), "{entry}: directives after the last export: {said:?}");
    assert!(!all.is_empty(), "{entry}: no specimen");
    all
}

fn claim(said: &[(&str, &str)], dimension: usize) -> Result<Claim, String> {
    let mut claim = Claim { class: None, side: None, lipschitz: None, within: (-2.0, 2.0), critical: Vec::new() };
    let mut map = false;
    for (what, how) in said {
        let number = |text: &str| text.trim().parse::<f64>().map_err(|e| format!("`{text}`: {e}"));
        match (*what, how.trim()) {
            ("class", "E") => claim.class = Some(Class::Exact),
            ("class", "U") => claim.class = Some(Class::Unit),
            ("class", "L") => claim.class = Some(Class::Lower),
            ("class", "N") => claim.class = Some(Class::Neither),
            ("map", "") => map = true,
            ("outside", "") => claim.side = Some(Side::Outside),
            ("inside", "") => claim.side = Some(Side::Inside),
            ("lipschitz", constant) => claim.lipschitz = Some(number(constant)?),
            ("within", range) => {
                let (lo, hi) = range.split_once("..").ok_or("no `..`")?;
                claim.within = (number(lo)?, number(hi)?);
            }
            ("critical", points) => {
                for text in points.split(';') {
                    let numbers = text.split(',').map(number).collect::<Result<Vec<f64>, String>>()?;
                    if numbers.len() != dimension {
                        return Err(format!("`{text}` is no point"));
                    }
                    let mut point: Point = [0.0; 3];
                    point[..dimension].copy_from_slice(&numbers);
                    claim.critical.push(point);
                }
            }
            _ => return Err(format!("`{what} {how}` is no directive")),
        }
    }
    if map == claim.class.is_some() {
        return Err("either a class or `map` must be claimed".to_owned());
    }
    if claim.side.is_some() && claim.class < Some(Class::Unit) {
        return Err("only E and U are claimed for one side".to_owned());
    }
    if claim.lipschitz.is_some() && claim.class != Some(Class::Neither) {
        return Err("a Lipschitz constant is for class N".to_owned());
    }
    Ok(claim)
}

/// Has a specimen judged as it is compiled.
pub fn judge(specimen: &Specimen) -> Result<Measured, String> {
    let Specimen { entry, export, claim, dimension, source } = specimen;
    let kernels = Kernels::compile(source, export, *dimension)?;
    let components = if claim.class.is_none() { 3 } else { 1 };
    if kernels.components() != components {
        return Err(format!("`{export}` has {} results; it must have {components}", kernels.components()));
    }
    let mut all = Measured::default();
    for component in 0..components {
        let double = |points: &[Point], order: Order| kernels.double(points, order, component);
        let single = |points: &[Point], _: Order| kernels.single(points, component);
        let name = format!("{entry}: {export}");
        let field = Field { name: &name, dimension: *dimension, double: &double, single: &single };
        all.join(&judge_field(&field, claim).map_err(|e| e.to_string())?);
    }
    Ok(all)
}
