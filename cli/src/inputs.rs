//! Inputs of `isograd eval`: from `--args`, `--set` and CSV to the values of parameters.
//! Says what is wrong by file, line and column; knows nothing of evaluation.

use std::fs::File;
use std::io::{self, Read, stdin};
use std::path::Path;

use csv::{ByteRecord, Reader, ReaderBuilder, Terminator};
use isograd_compiler::{Argument, ArgumentColumn, Rate, Role, ScalarKind};
use isograd_server::values::{Inputs, Interface, Values, describe, parse, takes};

use crate::Failure;
use crate::args::Eval;

/// The inputs that the arguments of the command give to an export.
pub fn gather(args: &Eval, interface: &Interface<'_>) -> Result<Inputs, Failure> {
    if !args.args.is_empty() {
        return from_args(&args.args, interface);
    }
    let mut named = Vec::new();
    for (name, text) in &args.set {
        named.push((name.clone(), uniform(name, text, interface)?));
    }
    if let Some(path) = &args.points {
        let fixed: Vec<&str> = args.set.iter().map(|(name, _)| name.as_str()).collect();
        let columns = from_csv(path, interface, &fixed).map_err(Failure::Wrong)?;
        named.extend(columns);
    } else if named.is_empty() && interface.arguments.iter().any(|a| interface.default(a).is_none()) {
        let takes = takes(interface);
        return Err(Failure::Wrong(format!(
            "no values for the parameters of `{}`: {takes}; give them with `--args`, `--points` or `--set`",
            interface.export.name
        )));
    }
    Inputs::of(interface, named).map_err(|e| Failure::Wrong(e.0))
}

/// All numbers that an evaluation takes.
fn columns<'i>(interface: &'i Interface<'_>) -> impl Iterator<Item = &'i ArgumentColumn> {
    interface.arguments.iter().flat_map(|a| &a.columns)
}

/// The name of the scalar that a column is an end of, which stands for both ends if no point has that name.
fn both_ends(argument: &Argument, column: &ArgumentColumn, interface: &Interface<'_>) -> Option<String> {
    let name = column.name.strip_suffix(".start").or_else(|| column.name.strip_suffix(".end"))?;
    let is_free = || columns(interface).all(|c| c.name != name);
    (argument.role == Role::Box && is_free()).then(|| name.to_owned())
}

fn list(text: &str) -> Vec<&str> {
    if text.trim().is_empty() { Vec::new() } else { text.split(',').map(str::trim).collect() }
}

/// `1 value`, `2 values`
fn counted(n: usize) -> String {
    if n == 1 { "1 value".to_owned() } else { format!("{n} values") }
}

/// The defaults of the arguments after the first `count` scalars; `None` if those end inside an argument or are too
/// many, or an argument after them has no default.
fn defaults_after(interface: &Interface<'_>, count: usize) -> Option<Vec<f64>> {
    let mut before = 0;
    let mut defaults = Vec::new();
    for argument in &interface.arguments {
        let end = before + argument.columns.len();
        if before >= count {
            defaults.extend(interface.default(argument)?);
        } else if end > count {
            return None;
        }
        before = end;
    }
    (count <= before).then_some(defaults)
}

/// How many scalars must be given: those up to the last argument without default.
fn required(interface: &Interface<'_>) -> usize {
    let arguments = &interface.arguments;
    let optional = arguments.iter().rev().take_while(|a| interface.default(a).is_some()).count();
    arguments.iter().take(arguments.len() - optional).map(|a| a.columns.len()).sum()
}

/// One point per text. A parameter other than the first is uniform if its value is the same at all points.
fn from_args(points: &[String], interface: &Interface<'_>) -> Result<Inputs, Failure> {
    let scalars: Vec<&ArgumentColumn> = columns(interface).collect();
    let mut columns: Vec<Vec<f64>> = vec![Vec::with_capacity(points.len()); scalars.len()];
    for text in points {
        let given = list(text);
        let Some(left_out) = defaults_after(interface, given.len()) else {
            let has = counted(given.len());
            let (takes, n) = (takes(interface), scalars.len());
            let fewer = match required(interface) {
                least if least < n => format!("{n}, or fewer from {least} on up to the end of a parameter"),
                _ => n.to_string(),
            };
            let name = &interface.export.name;
            return Err(Failure::Wrong(format!("`--args {text}` has {has}, `{name}` takes {fewer}: {takes}")));
        };
        for (column, x) in columns.iter_mut().skip(given.len()).zip(left_out) {
            column.push(x);
        }
        for ((column, scalar), cell) in columns.iter_mut().zip(&scalars).zip(given) {
            let x = parse(scalar.kind, cell).map_err(|expected| {
                let name = &scalar.name;
                Failure::Wrong(format!("`--args {text}`: `{name}` is `{}`, expected {expected}", short(cell)))
            })?;
            column.push(x);
        }
    }
    let same = |column: &Vec<f64>| column.iter().all(|x| Some(x.to_bits()) == column.first().map(|f| f.to_bits()));
    let mut rest = columns.into_iter();
    let mut values = Vec::with_capacity(interface.arguments.len());
    for argument in &interface.arguments {
        let mut columns: Vec<Vec<f64>> = rest.by_ref().take(argument.columns.len()).collect();
        let is_uniform = argument.parameter > 0 && columns.iter().all(same);
        let rate = if is_uniform { Rate::Uniform } else { Rate::Varying };
        if rate == Rate::Uniform {
            columns.iter_mut().for_each(|c| c.truncate(1));
        }
        values.push(Values { rate, columns });
    }
    Ok(Inputs { values, points: points.len() })
}

/// `--set NAME=a,b,…`; for a box a number per column, or one per scalar, which is both ends of a real.
fn uniform(name: &str, text: &str, interface: &Interface<'_>) -> Result<Values, Failure> {
    let argument = interface.argument(name).map_err(|why| Failure::Wrong(format!("`--set {name}={text}`: {why}")))?;
    let given = list(text);
    let mut scalars: Vec<usize> = argument.columns.iter().map(|c| c.scalar).collect();
    scalars.dedup();
    let (n, fewer) = (argument.columns.len(), scalars.len());
    if given.len() != n && given.len() != fewer {
        let has = counted(given.len());
        let n = if fewer < n { format!("{n}, or {fewer} for a single point") } else { n.to_string() };
        return Err(Failure::Wrong(format!("`--set {name}={text}` has {has}, {} has {n}", describe(argument))));
    }
    let mut numbers = Vec::with_capacity(n);
    for (i, column) in argument.columns.iter().enumerate() {
        let at = if given.len() == n { Some(i) } else { scalars.iter().position(|s| *s == column.scalar) };
        let cell = at.and_then(|at| given.get(at)).copied().unwrap_or("");
        let x = parse(column.kind, cell).map_err(|expected| {
            let (column, cell) = (&column.name, short(cell));
            Failure::Wrong(format!("`--set {name}={text}`: `{column}` is `{cell}`, expected {expected}"))
        })?;
        numbers.push(x);
    }
    Ok(Values::uniform(&numbers))
}

/// Every parameter whose columns are in the file; those of `fixed` must not be.
fn from_csv(path: &Path, interface: &Interface<'_>, fixed: &[&str]) -> Result<Vec<(String, Values)>, String> {
    let (source, name): (Box<dyn Read>, String) = if path == Path::new("-") {
        (Box::new(stdin()), "standard input".to_owned())
    } else {
        let shown = path.display().to_string();
        let file = File::open(path).map_err(|error| format!("cannot read `{shown}`: {error}"))?;
        (Box::new(file), shown)
    };
    let mut table = Table::open(source, name, interface)?;
    for name in fixed {
        let Ok(argument) = interface.argument(name) else { continue };
        let is_given = |h: &&String| {
            argument.columns.iter().any(|c| c.name == **h || both_ends(argument, c, interface).as_ref() == Some(*h))
        };
        if let Some(column) = table.header.iter().find(is_given) {
            return Err(format!("{}: the column `{column}` gives `{name}`, and so does `--set`", table.name));
        }
    }
    table.read()?;
    table.arguments(interface)
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
    fn open(source: R, name: String, interface: &Interface<'_>) -> Result<Self, String> {
        // Only `\n` ends a line, so that lines can be counted; the `\r` before it is trimmed like a space.
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .terminator(Terminator::Any(b'\n'))
            .buffer_capacity(1 << 16)
            .from_reader(Lines { source, ended: true });
        let mut record = ByteRecord::new();
        let export = interface.export;
        let all: Vec<&str> = columns(interface).map(|c| c.name.as_str()).collect();
        let all = all.join(",");
        let mut known: Vec<(String, ScalarKind)> = columns(interface).map(|c| (c.name.clone(), c.kind)).collect();
        for argument in &interface.arguments {
            let points = argument.columns.iter().filter_map(|c| Some((both_ends(argument, c, interface)?, c.kind)));
            known.extend(points);
        }
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
                let hint = interface.hint(&column).map(|hint| format!("; {hint}")).unwrap_or_default();
                let column = short(&column);
                return Err(format!("{place} is named `{column}`; `{}` has the columns {all}{hint}", export.name));
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

    /// The arguments that the columns make.
    fn arguments(mut self, interface: &Interface<'_>) -> Result<Vec<(String, Values)>, String> {
        let mut named = Vec::new();
        for argument in &interface.arguments {
            let position = |name: &str| self.header.iter().position(|h| h == name);
            let mut found = Vec::with_capacity(argument.columns.len());
            for column in &argument.columns {
                let both = both_ends(argument, column, interface).and_then(|both| position(&both));
                let own = position(&column.name);
                if let (Some(own), Some(both)) =
                    (own.and_then(|i| self.header.get(i)), both.and_then(|i| self.header.get(i)))
                {
                    let message = format!("the column `{both}` gives both ends, and `{own}` one of them; give one");
                    return Err(format!("{}: {message}", self.name));
                }
                found.push(own.or(both));
            }
            if found.iter().all(Option::is_none) {
                continue;
            }
            let named_columns = argument.columns.iter().zip(&found);
            let missing: Vec<&str> =
                named_columns.filter(|(_, at)| at.is_none()).map(|(c, _)| c.name.as_str()).collect();
            if !missing.is_empty() {
                let plural = if missing.len() == 1 { "column" } else { "columns" };
                let (missing, described) = (missing.join(", "), describe(argument));
                return Err(format!("{}: the {plural} {missing} of {described} is missing", self.name));
            }
            let found: Vec<usize> = found.into_iter().flatten().collect();
            let mut columns = Vec::with_capacity(found.len());
            for (i, at) in found.iter().enumerate() {
                let Some(column) = self.columns.get_mut(*at) else { continue };
                // The next column may be the other end of the same box.
                columns.push(if found.get(i + 1) == Some(at) { column.clone() } else { std::mem::take(column) });
            }
            named.push((argument.name.clone(), Values { rate: Rate::Varying, columns }));
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
