//! Inputs of `isograd eval`: from `--args`, `--set` and CSV to the values of parameters.
//! Says what is wrong by file, line and column; knows nothing of evaluation.

use std::fs::File;
use std::io::{self, Read, stdin};
use std::path::Path;

use csv::{ByteRecord, Reader, ReaderBuilder, Terminator};
use isograd_compiler::{Export, Rate, ScalarKind};
use isograd_server::values::{Inputs, Values, describe, parse, takes};

use crate::Failure;
use crate::args::Eval;

/// The inputs that the arguments give to an export.
pub fn gather(args: &Eval, export: &Export) -> Result<Inputs, Failure> {
    if !args.args.is_empty() {
        return from_args(&args.args, export);
    }
    let mut named = Vec::new();
    for (name, text) in &args.set {
        named.push((name.clone(), uniform(name, text, export)?));
    }
    if let Some(path) = &args.points {
        let fixed: Vec<&str> = args.set.iter().map(|(name, _)| name.as_str()).collect();
        let columns = from_csv(path, export, &fixed).map_err(Failure::Wrong)?;
        named.extend(columns);
    } else if named.is_empty() && export.parameters.iter().any(|p| p.default.is_none()) {
        let takes = takes(export);
        return Err(Failure::Wrong(format!(
            "no values for the parameters of `{}`: {takes}; give them with `--args`, `--points` or `--set`",
            export.name
        )));
    }
    Inputs::of(export, named).map_err(|e| Failure::Wrong(e.0))
}

/// All scalars of an export: their names and kinds.
fn scalars(export: &Export) -> Vec<(String, ScalarKind)> {
    export.parameters.iter().flat_map(|p| p.ty.columns(&p.name).into_iter().zip(p.ty.scalars())).collect()
}

fn list(text: &str) -> Vec<&str> {
    if text.trim().is_empty() { Vec::new() } else { text.split(',').map(str::trim).collect() }
}

/// `1 value`, `2 values`
fn counted(n: usize) -> String {
    if n == 1 { "1 value".to_owned() } else { format!("{n} values") }
}

/// The defaults of the parameters after the first `count` scalars; `None` if those end inside a parameter or are too
/// many, or a parameter after them has no default.
fn defaults_after(export: &Export, count: usize) -> Option<Vec<f64>> {
    let mut before = 0;
    let mut defaults = Vec::new();
    for parameter in &export.parameters {
        let end = before + parameter.ty.len() as usize;
        if before >= count {
            defaults.extend_from_slice(parameter.default.as_deref()?);
        } else if end > count {
            return None;
        }
        before = end;
    }
    (count <= before).then_some(defaults)
}

/// How many scalars must be given: those up to the last parameter without default.
fn required(export: &Export) -> usize {
    let optional = export.parameters.iter().rev().take_while(|p| p.default.is_some()).count();
    let needed = export.parameters.len() - optional;
    export.parameters.iter().take(needed).map(|p| p.ty.len() as usize).sum()
}

/// One point per text. A parameter other than the first is uniform if its value is the same at all points.
fn from_args(points: &[String], export: &Export) -> Result<Inputs, Failure> {
    let scalars = scalars(export);
    let mut columns: Vec<Vec<f64>> = vec![Vec::with_capacity(points.len()); scalars.len()];
    for text in points {
        let given = list(text);
        let Some(left_out) = defaults_after(export, given.len()) else {
            let has = counted(given.len());
            let (takes, n) = (takes(export), scalars.len());
            let fewer = match required(export) {
                least if least < n => format!("{n}, or fewer from {least} on up to the end of a parameter"),
                _ => n.to_string(),
            };
            return Err(Failure::Wrong(format!("`--args {text}` has {has}, `{}` takes {fewer}: {takes}", export.name)));
        };
        for (column, x) in columns.iter_mut().skip(given.len()).zip(left_out) {
            column.push(x);
        }
        for ((column, (name, kind)), cell) in columns.iter_mut().zip(&scalars).zip(given) {
            let x = parse(*kind, cell).map_err(|expected| {
                Failure::Wrong(format!("`--args {text}`: `{name}` is `{}`, expected {expected}", short(cell)))
            })?;
            column.push(x);
        }
    }
    let same = |column: &Vec<f64>| column.iter().all(|x| Some(x.to_bits()) == column.first().map(|f| f.to_bits()));
    let mut rest = columns.into_iter();
    let mut values = Vec::with_capacity(export.parameters.len());
    for (i, parameter) in export.parameters.iter().enumerate() {
        let mut columns: Vec<Vec<f64>> = rest.by_ref().take(parameter.ty.len() as usize).collect();
        let rate = if i > 0 && columns.iter().all(same) { Rate::Uniform } else { Rate::Varying };
        if rate == Rate::Uniform {
            columns.iter_mut().for_each(|c| c.truncate(1));
        }
        values.push(Values { rate, columns });
    }
    Ok(Inputs { values, points: points.len() })
}

/// `--set NAME=a,b,…`
fn uniform(name: &str, text: &str, export: &Export) -> Result<Values, Failure> {
    let Some(parameter) = export.parameters.iter().find(|p| p.name == name) else {
        let takes = takes(export);
        return Err(Failure::Wrong(format!(
            "`--set {name}={text}`: `{}` has no parameter `{name}`; {takes}",
            export.name
        )));
    };
    let given = list(text);
    let kinds = parameter.ty.scalars();
    if given.len() != kinds.len() {
        let has = counted(given.len());
        let n = kinds.len();
        return Err(Failure::Wrong(format!("`--set {name}={text}` has {has}, {} has {n}", describe(parameter))));
    }
    let names = parameter.ty.columns(name);
    let mut scalars = Vec::with_capacity(kinds.len());
    for ((kind, cell), column) in kinds.iter().zip(given).zip(names) {
        let x = parse(*kind, cell).map_err(|expected| {
            Failure::Wrong(format!("`--set {name}={text}`: `{column}` is `{}`, expected {expected}", short(cell)))
        })?;
        scalars.push(x);
    }
    Ok(Values::uniform(&scalars))
}

/// Every parameter whose columns are in the file; those of `fixed` must not be.
fn from_csv(path: &Path, export: &Export, fixed: &[&str]) -> Result<Vec<(String, Values)>, String> {
    let (source, name): (Box<dyn Read>, String) = if path == Path::new("-") {
        (Box::new(stdin()), "standard input".to_owned())
    } else {
        let shown = path.display().to_string();
        let file = File::open(path).map_err(|error| format!("cannot read `{shown}`: {error}"))?;
        (Box::new(file), shown)
    };
    let mut table = Table::open(source, name, export)?;
    for name in fixed {
        if let Some(parameter) = export.parameters.iter().find(|p| p.name == *name) {
            let columns = parameter.ty.columns(name);
            if let Some(column) = table.header.iter().find(|h| columns.contains(h)) {
                return Err(format!("{}: the column `{column}` gives `{name}`, and so does `--set`", table.name));
            }
        }
    }
    table.read()?;
    table.parameters(export)
}

/// A CSV file being read.
struct Table<R> {
    name: String,
    reader: Reader<Lines<R>>,
    header: Vec<String>,
    kinds: Vec<ScalarKind>,
    columns: Vec<Vec<f64>>,
}

impl<R: Read> Table<R> {
    /// Reads the header.
    fn open(source: R, name: String, export: &Export) -> Result<Self, String> {
        // Only `\n` ends a line, so that lines can be counted; the `\r` before it is trimmed like a space.
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .terminator(Terminator::Any(b'\n'))
            .buffer_capacity(1 << 16)
            .from_reader(Lines { source, ended: true });
        let mut record = ByteRecord::new();
        let known = scalars(export);
        let all: Vec<&str> = known.iter().map(|(n, _)| n.as_str()).collect();
        let all = all.join(",");
        let some = reader.read_byte_record(&mut record).map_err(|error| unreadable(&name, error))?;
        if !some {
            return Err(format!("{name}: the file is empty; its first line names columns of `{}`: {all}", export.name));
        }
        let mut header: Vec<String> = Vec::new();
        let mut kinds = Vec::new();
        for (i, cell) in record.iter().enumerate() {
            // Spreadsheets begin files with a byte order mark.
            let cell = if i == 0 { cell.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(cell) } else { cell };
            let column = String::from_utf8_lossy(cell).trim().to_owned();
            let place = format!("{name}:1: column {}", i + 1);
            let Some((_, kind)) = known.iter().find(|(n, _)| *n == column) else {
                let column = short(&column);
                return Err(format!("{place} is named `{column}`; `{}` has the columns {all}", export.name));
            };
            if header.contains(&column) {
                return Err(format!("{place} is named `{column}` as another column is; give each column once"));
            }
            header.push(column);
            kinds.push(*kind);
        }
        let columns = vec![Vec::new(); header.len()];
        Ok(Self { name, reader, header, kinds, columns })
    }

    /// Reads all rows.
    fn read(&mut self) -> Result<(), String> {
        let mut record = ByteRecord::new();
        while self.reader.read_byte_record(&mut record).map_err(|error| unreadable(&self.name, error))? {
            if record.len() == 1 && record.as_slice().trim_ascii().is_empty() {
                continue;
            }
            if record.len() != self.header.len() {
                let (found, expected) = (counted(record.len()), self.header.len());
                let header = self.header.join(",");
                let line = self.line(&record);
                return Err(format!("{}:{line}: the row has {found}, expected {expected}: {header}", self.name));
            }
            for (i, cell) in record.iter().enumerate() {
                let (Some(kind), Some(column)) = (self.kinds.get(i), self.columns.get_mut(i)) else { continue };
                let x = std::str::from_utf8(cell).map_err(|_| "UTF-8 text").and_then(|cell| parse(*kind, cell));
                match x {
                    Ok(x) => column.push(x),
                    Err(expected) => {
                        let header = self.header.get(i).map_or("", String::as_str);
                        let found = short(&String::from_utf8_lossy(cell));
                        let i = i + 1;
                        let name = &self.name;
                        let line = self.line(&record);
                        return Err(format!(
                            "{name}:{line}: column {i} (`{header}`) is `{found}`, expected {expected}"
                        ));
                    }
                }
            }
        }
        Ok(())
    }

    /// The line that the record just read begins in. All lines end with `\n`, but a record's own position is before
    /// the empty lines that were skipped; a quote that is never closed swallows the last end.
    fn line(&self, record: &ByteRecord) -> u64 {
        let inside = record.as_slice().iter().filter(|b| **b == b'\n').count() as u64;
        let after = self.reader.position().line();
        after.saturating_sub(1 + inside).max(record.position().map_or(0, csv::Position::line))
    }

    /// The parameters that the columns make.
    fn parameters(mut self, export: &Export) -> Result<Vec<(String, Values)>, String> {
        let mut named = Vec::new();
        for parameter in &export.parameters {
            let names = parameter.ty.columns(&parameter.name);
            let found: Vec<Option<usize>> = names.iter().map(|n| self.header.iter().position(|h| h == n)).collect();
            if found.iter().all(Option::is_none) {
                continue;
            }
            let missing: Vec<&str> =
                names.iter().zip(&found).filter(|(_, at)| at.is_none()).map(|(n, _)| n.as_str()).collect();
            if !missing.is_empty() {
                let plural = if missing.len() == 1 { "column" } else { "columns" };
                let (missing, described) = (missing.join(", "), describe(parameter));
                return Err(format!("{}: the {plural} {missing} of {described} is missing", self.name));
            }
            let columns =
                found.iter().flatten().filter_map(|at| self.columns.get_mut(*at).map(std::mem::take)).collect();
            named.push((parameter.name.clone(), Values { rate: Rate::Varying, columns }));
        }
        Ok(named)
    }
}

/// A source whose last line ends as the others do.
struct Lines<R> {
    source: R,
    ended: bool,
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.source.read(buffer)?;
        match buffer.get(..n).and_then(<[u8]>::last) {
            Some(last) => self.ended = *last == b'\n',
            None if !self.ended => {
                if let Some(first) = buffer.first_mut() {
                    *first = b'\n';
                    self.ended = true;
                    return Ok(1);
                }
            }
            None => {}
        }
        Ok(n)
    }
}

fn unreadable(name: &str, error: csv::Error) -> String {
    let error = io::Error::from(error);
    format!("cannot read `{name}`: {error}")
}

/// At most 40 characters of what a user wrote.
fn short(text: &str) -> String {
    let text = text.trim();
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", text.get(..end).unwrap_or("")),
        None => text.to_owned(),
    }
}
