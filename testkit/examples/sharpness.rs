//! Renders `examples/bevelled_union.vola` three times by sphere tracing, coloured by how sharply the surface bends:
//! `exact`, `smooth`, and with derivatives of an approximation. All numbers come from compiled modules; this program
//! knows a camera, a light and a scale of colours, and nothing of the shape or of its derivatives.
//!
//! `cargo run --release --example sharpness -- FOLDER` writes three PNGs into the folder.
#![allow(clippy::print_stdout, reason = "it says what it wrote")]

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use image::{Rgb, RgbImage};
use isograd_compiler::{
    Checked, Differentiability, MemoryLoader, Options, Precision, Query, Request, Sensitivity, Unwatched, Wrt, check,
    compile,
};
use isograd_runtime::{EvalOptions, Runtime, Values};

const SIZE: u32 = 720;
/// Points per pixel are the square of this.
const SAMPLES: u32 = 2;
/// The field grows at most √2 times as fast as the distance.
const LIPSCHITZ: f64 = std::f64::consts::SQRT_2;
/// Steps of a ray, which end at the surface or in the void.
const STEPS: usize = 400;
const FAR: f64 = 8.0;
const NEAR: f64 = 1e-8;
/// What is bent more counts as an edge: to a radius below a third.
const THRESHOLD: f64 = 3.0;
/// Edges 0.01 wide.
const SENSITIVITY: &str = "10";

/// A picture: its name, the export that tells how sharp the surface is, and the mode of the whole program.
const PICTURES: [(&str, &str, Differentiability); 3] = [
    ("exact", "sharpness", Differentiability::Exact),
    ("smooth", "sharpness", Differentiability::Smooth),
    ("approximated", "approximated", Differentiability::Exact),
];

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("sharpness: name the folder to write to")?);
    fs::create_dir_all(&folder)?;
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/bevelled_union.vola");
    let checked =
        check("bevelled_union.vola", fs::read(file)?, &MemoryLoader::default(), &Options::default(), &Unwatched);
    let runtime = Runtime::default();
    for (name, export, differentiability) in PICTURES {
        let at = || Wrt::Parameter("at".to_owned());
        let program = Program { checked: &checked, runtime: &runtime, differentiability };
        let distance = |points: &[DVec3]| program.columns("field", Query::Value, points);
        let hits = trace(&rays(), distance)?;
        let points: Vec<DVec3> = hits.iter().flatten().copied().collect();
        let normals = program.columns("field", Query::Gradient(at()), &points)?;
        let bends = program.columns(export, Query::Value, &points)?;
        let mut shades = (0..points.len()).map(|i| {
            let normal = DVec3::from_array(std::array::from_fn(|axis| normals[axis][i]));
            shade(normal, bends[0][i])
        });
        let colours: Vec<DVec3> =
            hits.iter().map(|hit| hit.and_then(|_| shades.next()).unwrap_or(BACKGROUND)).collect();
        let path = folder.join(format!("{name}.png"));
        picture(&colours).save(&path)?;
        let sharp = bends[0].iter().filter(|bend| **bend > THRESHOLD).count();
        println!("{}: {sharp} of {} points are sharp", path.display(), points.len());
    }
    Ok(())
}

/// A checked program in a mode.
struct Program<'a> {
    checked: &'a Checked,
    runtime: &'a Runtime,
    differentiability: Differentiability,
}

impl Program<'_> {
    /// The columns of a query at points.
    fn columns(&self, export: &str, query: Query, points: &[DVec3]) -> Result<Vec<Vec<f64>>, Failure> {
        let smooth = self.differentiability == Differentiability::Smooth;
        let request = Request {
            export: export.to_owned(),
            queries: vec![query],
            precision: Precision::F64,
            differentiability: self.differentiability,
            sensitivity: smooth.then(|| SENSITIVITY.parse::<Sensitivity>()).transpose()?,
            ..Request::default()
        };
        let artefact = compile(self.checked, &request, &Options::default(), &Unwatched)
            .map_err(|all| all.iter().map(|d| d.message.as_str()).collect::<Vec<_>>().join("; "))?;
        let axes: [Vec<f64>; 3] = std::array::from_fn(|axis| points.iter().map(|p| p[axis]).collect());
        let inputs = axes.each_ref().map(|column| Values::F64(column));
        let columns = self.runtime.load(&artefact)?.evaluate(&inputs, points.len(), &EvalOptions::default())?;
        Ok(columns.iter().map(|c| (0..points.len()).map(|i| c.get(i).unwrap_or(f64::NAN)).collect()).collect())
    }
}

/// Where rays start, and their directions, row by row.
fn rays() -> Vec<(DVec3, DVec3)> {
    let eye = DVec3::new(2.3, 2.6, 3.4);
    let ahead = (DVec3::new(0.0, 0.1, 0.0) - eye).normalize();
    let right = ahead.cross(DVec3::Y).normalize();
    let up = right.cross(ahead);
    let width = SIZE * SAMPLES;
    let along = |i: u32| (f64::from(i) + 0.5) / f64::from(width) - 0.5;
    let ray = |row: u32, column: u32| (eye, (ahead + 0.72 * (along(column) * right - along(row) * up)).normalize());
    (0..width).flat_map(|row| (0..width).map(move |column| ray(row, column))).collect()
}

/// Where rays meet the surface: each steps by what the field promises to be free (Hart, *Sphere tracing*, 1996).
fn trace(
    rays: &[(DVec3, DVec3)],
    distance: impl Fn(&[DVec3]) -> Result<Vec<Vec<f64>>, Failure>,
) -> Result<Vec<Option<DVec3>>, Failure> {
    let mut hits = vec![None; rays.len()];
    let mut under_way: Vec<(usize, f64)> = (0..rays.len()).map(|i| (i, 0.0)).collect();
    for _ in 0..STEPS {
        if under_way.is_empty() {
            break;
        }
        let points: Vec<DVec3> = under_way.iter().map(|(i, t)| rays[*i].0 + *t * rays[*i].1).collect();
        let free = distance(&points)?.remove(0);
        let mut further = Vec::with_capacity(under_way.len());
        for ((&(i, t), &point), free) in under_way.iter().zip(&points).zip(free) {
            if free < NEAR {
                hits[i] = Some(point);
            } else if t < FAR {
                further.push((i, t + free / LIPSCHITZ));
            }
        }
        under_way = further;
    }
    Ok(hits)
}

const BACKGROUND: DVec3 = DVec3::new(0.96, 0.96, 0.95);

/// Blue where the surface is flat, red towards the threshold, yellow beyond.
fn shade(gradient: DVec3, bend: f64) -> DVec3 {
    let (flat, bent, sharp) = (DVec3::new(0.25, 0.42, 0.62), DVec3::new(0.80, 0.22, 0.16), DVec3::new(1.0, 0.86, 0.25));
    let colour = if bend > THRESHOLD { sharp } else { flat.lerp(bent, bend / THRESHOLD) };
    let light = gradient.normalize_or_zero().dot(DVec3::new(0.35, 0.8, 0.5).normalize()).max(0.0);
    colour * (0.45 + 0.55 * light)
}

/// Means over the points of each pixel.
fn picture(colours: &[DVec3]) -> RgbImage {
    let width = SIZE * SAMPLES;
    RgbImage::from_fn(SIZE, SIZE, |x, y| {
        let near = (0..SAMPLES).flat_map(|j| (0..SAMPLES).map(move |i| (y * SAMPLES + j, x * SAMPLES + i)));
        let sum: DVec3 = near.map(|(row, column)| colours[(row * width + column) as usize]).sum();
        let mean = sum / f64::from(SAMPLES * SAMPLES);
        Rgb(mean.to_array().map(|c| (c * 255.0).round().clamp(0.0, 255.0) as u8))
    })
}
