//! Results as aligned columns and as CSV. Knows columns of numbers and their names, nothing else.

use std::io::{self, Write};

use isograd_compiler::{Kink, Rate, ScalarKind};
use isograd_server::outputs::{NumberedKink, Numbers, Outputs};
use isograd_server::values::{Inputs, Interface};

/// Columns that belong together.
struct Group {
    title: String,
    columns: Vec<Column>,
}

/// A column and the width of its widest cell.
struct Column {
    name: String,
    numbers: Numbers,
    width: usize,
}

/// Between two columns, and between two groups.
const GAP: &str = "  ";
const WALL: &str = "  │  ";

/// Writes inputs that vary, then outputs, one point per line.
pub fn write_table(w: &mut impl Write, interface: &Interface<'_>, inputs: Inputs, outputs: Outputs) -> io::Result<()> {
    let points = outputs.points;
    let mut groups = Vec::new();
    for (argument, values) in interface.arguments.iter().zip(inputs.values) {
        if values.rate == Rate::Uniform {
            continue;
        }
        let columns = argument.columns.iter().zip(values.columns);
        let columns = columns.map(|(of, column)| (of.name.clone(), numbers(of.kind, column))).collect();
        groups.push(group(argument.name.clone(), columns, points));
    }
    let mut kinks = Vec::new();
    for output in outputs.outputs {
        kinks.extend(output.kinks.into_iter().map(|kink| (output.name.clone(), kink)));
        let columns = output.columns.into_iter().map(|c| (c.name, c.numbers)).collect();
        groups.push(group(output.name, columns, points));
    }
    write_heads(w, &groups)?;
    let mut cell = Vec::new();
    for point in 0..points {
        for (g, group) in groups.iter().enumerate() {
            if g > 0 {
                w.write_all(WALL.as_bytes())?;
            }
            for (c, column) in group.columns.iter().enumerate() {
                if c > 0 {
                    w.write_all(GAP.as_bytes())?;
                }
                cell.clear();
                column.numbers.write(&mut cell, point)?;
                pad(w, column.width.saturating_sub(cell.len()))?;
                w.write_all(&cell)?;
            }
        }
        w.write_all(b"\n")?;
    }
    kinks.iter().try_for_each(|(query, kink)| write_kink(w, query, kink))
}

/// Says below a table what a number of its column `kink` means.
fn write_kink(w: &mut impl Write, query: &str, NumberedKink { kink, of }: &NumberedKink) -> io::Result<()> {
    let Kink { operation, place, set, discriminant, derivatives: [below, inside, above], .. } = of;
    writeln!(w, "{query}: kink {kink} is `{operation}` at {place}, where {set}")?;
    writeln!(w, "  side -1: {below}; side 0: {inside}; side 1: {above}; by the sign of {discriminant}")
}

/// Writes a header and one row per point. A column of the value has its own name, one of a derivative has the
/// query's in front: `gradient(at).at.x`.
pub fn write_csv(w: &mut impl Write, outputs: &Outputs) -> io::Result<()> {
    let columns: Vec<_> = outputs.outputs.iter().flat_map(|o| o.columns.iter().map(move |c| (o, c))).collect();
    for (i, (output, column)) in columns.iter().enumerate() {
        let comma = if i > 0 { "," } else { "" };
        match output.name.as_str() {
            "value" => write!(w, "{comma}{}", column.name)?,
            name => write!(w, "{comma}{name}.{}", column.name)?,
        }
    }
    w.write_all(b"\n")?;
    for point in 0..outputs.points {
        for (i, (_, column)) in columns.iter().enumerate() {
            if i > 0 {
                w.write_all(b",")?;
            }
            column.numbers.write(w, point)?;
        }
        w.write_all(b"\n")?;
    }
    Ok(())
}

/// Inputs as they were given.
#[expect(clippy::cast_possible_truncation, reason = "ints and truth values were checked when they were read")]
fn numbers(kind: ScalarKind, column: Vec<f64>) -> Numbers {
    match kind {
        ScalarKind::Real => Numbers::F64(column),
        ScalarKind::Int => Numbers::Int(column.into_iter().map(|x| x as i32).collect()),
        ScalarKind::Bool => Numbers::Bool(column.into_iter().map(|x| x as i32).collect()),
    }
}

fn group(title: String, columns: Vec<(String, Numbers)>, points: usize) -> Group {
    let mut columns: Vec<Column> = columns
        .into_iter()
        .map(|(name, numbers)| {
            let name = if name == title { String::new() } else { name };
            let mut cell = Vec::new();
            let mut width = name.chars().count();
            for point in 0..points {
                cell.clear();
                // Writing to memory does not fail.
                let _ = numbers.write(&mut cell, point);
                width = width.max(cell.len());
            }
            Column { name, numbers, width }
        })
        .collect();
    let short = title.chars().count().saturating_sub(width(&columns));
    if let Some(first) = columns.first_mut() {
        first.width += short;
    }
    Group { title, columns }
}

fn width(columns: &[Column]) -> usize {
    columns.iter().map(|c| c.width).sum::<usize>() + GAP.len() * columns.len().saturating_sub(1)
}

/// The titles of the groups, then the names of the columns if any differs from its group's.
fn write_heads(w: &mut impl Write, groups: &[Group]) -> io::Result<()> {
    let mut lines = [String::new(), String::new()];
    for (g, group) in groups.iter().enumerate() {
        let wall = if g > 0 { WALL } else { "" };
        let names: Vec<String> = group.columns.iter().map(|c| format!("{:>1$}", c.name, c.width)).collect();
        let [titles, columns] = &mut lines;
        titles.push_str(wall);
        columns.push_str(wall);
        titles.push_str(&format!("{:>1$}", group.title, width(&group.columns)));
        columns.push_str(&names.join(GAP));
    }
    let [titles, columns] = lines;
    writeln!(w, "{}", titles.trim_end())?;
    if groups.iter().any(|g| g.columns.iter().any(|c| !c.name.is_empty())) {
        writeln!(w, "{}", columns.trim_end())?;
    }
    let rules: Vec<String> = groups.iter().map(|g| "─".repeat(width(&g.columns))).collect();
    writeln!(w, "{}", rules.join("──┼──"))
}

fn pad(w: &mut impl Write, count: usize) -> io::Result<()> {
    const SPACES: [u8; 64] = [b' '; 64];
    let mut left = count;
    while left > 0 {
        let some = left.min(SPACES.len());
        w.write_all(SPACES.get(..some).unwrap_or(&SPACES))?;
        left -= some;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use isograd_compiler::{Export, Parameter, Query, Type};
    use isograd_server::outputs::{Output, OutputColumn};
    use isograd_server::values::Values;

    use super::*;

    fn outputs() -> Outputs {
        let column = |name: &str, x: &[f32]| OutputColumn { name: name.to_owned(), numbers: Numbers::F32(x.to_vec()) };
        Outputs {
            export: "f".to_owned(),
            points: 2,
            outputs: vec![
                Output {
                    name: "value".to_owned(),
                    ty: "real".to_owned(),
                    columns: vec![column("value", &[0.5, -12.25])],
                    kinks: Vec::new(),
                },
                Output {
                    name: "gradient(at)".to_owned(),
                    ty: "vec2".to_owned(),
                    columns: vec![column("at.x", &[1.0, f32::NAN]), column("at.y", &[0.0, -0.125])],
                    kinks: Vec::new(),
                },
            ],
        }
    }

    #[test]
    fn a_table_is_aligned() {
        let export = Export {
            name: "f".to_owned(),
            parameters: vec![
                Parameter { name: "at".to_owned(), ty: Type::Vector(2), default: None, range: None },
                Parameter { name: "n".to_owned(), ty: Type::Int, default: None, range: None },
            ],
            result: Type::Real,
            doc: None,
        };
        let varying = Values { rate: Rate::Varying, columns: vec![vec![1.0, 2.0], vec![3.0, 0.25]] };
        let inputs = Inputs { values: vec![varying, Values::uniform(&[3.0])], points: 2 };
        let mut text = Vec::new();
        let interface = Interface::of(&export, &[Query::Value]);
        write_table(&mut text, &interface, inputs, outputs()).unwrap();
        let expected = concat!(
            "        at  │   value  │  gradient(at)\n",
            "at.x  at.y  │          │  at.x    at.y\n",
            "────────────┼──────────┼──────────────\n",
            " 1.0   3.0  │     0.5  │   1.0     0.0\n",
            " 2.0  0.25  │  -12.25  │   nan  -0.125\n",
        );
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }

    #[test]
    fn csv_names_columns_apart() {
        let mut text = Vec::new();
        write_csv(&mut text, &outputs()).unwrap();
        let expected = "value,gradient(at).at.x,gradient(at).at.y\n0.5,1.0,0.0\n-12.25,nan,-0.125\n";
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }
}
