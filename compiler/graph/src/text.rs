//! The text form of a graph, written and read: one node a line, regions indented. Knows how nodes are spelled; whether
//! a graph is well formed is the verifier's business.

use std::fmt;
use std::fmt::Write as _;
use std::str::FromStr;

use crate::{Args, Graph, Input, Node, NodeId, Op, Origin, Output, Part, Precision, Scalar};

/// The text form.
#[must_use]
pub fn print(graph: &Graph) -> String {
    let mut out = String::new();
    if let Some(precision) = graph.precision {
        let _ = writeln!(out, "precision {}", precision.name());
    }
    let mut depth = 0_usize;
    for (id, node) in graph.iter() {
        if matches!(node, Node::Else { .. } | Node::End { .. }) {
            depth = depth.saturating_sub(1);
        }
        let _ = writeln!(out, "{:indent$}{}", "", line(graph, id, node), indent = depth * 2);
        if matches!(node, Node::Gamma { .. } | Node::Theta { .. } | Node::Else { .. }) {
            depth += 1;
        }
    }
    for output in &graph.outputs {
        let _ = writeln!(out, "output {} %{}", output.name, output.node.0);
    }
    out
}

fn line(graph: &Graph, id: NodeId, node: Node) -> String {
    let n = id.0;
    match node {
        Node::Input(i) => {
            let name = graph.inputs.get(i as usize).map_or("?", |input| input.name.as_str());
            format!("%{n} = input {name}: {}", graph.scalar(id))
        }
        Node::Real(bits) => format!("%{n} = real {:?}", f64::from_bits(bits)),
        Node::Int(x) => format!("%{n} = int {x}"),
        Node::Bool(x) => format!("%{n} = bool {x}"),
        Node::Apply(op, args) => {
            let mut text = format!("%{n} = {op}");
            for arg in args.as_slice() {
                let _ = write!(text, " %{}", arg.0);
            }
            text
        }
        Node::Fresh(x) => format!("%{n} = fresh %{}", x.0),
        Node::Diff { value, wrt } => format!("%{n} = diff %{} %{}", value.0, wrt.0),
        Node::Within { wrt, lo, hi, nan, next } => {
            let next = if next == NodeId::NONE { String::new() } else { format!(" %{}", next.0) };
            format!("%{n} = within %{} %{} %{} %{}{next}", wrt.0, lo.0, hi.0, nan.0)
        }
        Node::Bound { value, within, part } => format!("%{n} = {} %{} %{}", part.name(), value.0, within.0),
        Node::Gamma { cond, .. } => format!("%{n} = gamma %{}", cond.0),
        Node::Else { .. } => format!("%{n} = else"),
        Node::Theta { lo, hi, .. } => format!("%{n} = theta %{} %{}", lo.0, hi.0),
        Node::Counter { theta } => format!("%{n} = counter %{}", theta.0),
        Node::Carried { theta, init } => format!("%{n} = carried %{} %{}", theta.0, init.0),
        Node::End { .. } => format!("%{n} = end"),
        Node::Join { end, then, otherwise } => format!("%{n} = join %{} %{} %{}", end.0, then.0, otherwise.0),
        Node::Final { end, carried, next } => format!("%{n} = final %{} %{} %{}", end.0, carried.0, next.0),
        Node::Tape { end, value, every } => format!("%{n} = tape %{} %{} {every}", end.0, value.0),
        Node::Recall { tape, at } => format!("%{n} = recall %{} %{}", tape.0, at.0),
    }
}

/// A line that is no part of a graph's text form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParseError {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub what: String,
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.what)
    }
}

impl std::error::Error for ParseError {}

/// Reads what [`print()`] writes; indentation means nothing. Origins are not part of the text. The graph is as well
/// formed as the text: [`crate::verify()`] it before use.
///
/// # Errors
/// If a line is no node, or nodes are not numbered in order.
pub fn parse(text: &str) -> Result<Graph, ParseError> {
    let mut reader = Reader { graph: Graph::default(), open: Vec::new() };
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if !line.is_empty() {
            reader.line(line).map_err(|what| ParseError { line: index + 1, what })?;
        }
    }
    Ok(reader.graph)
}

struct Reader {
    graph: Graph,
    /// The gammas and thetas that are not closed.
    open: Vec<NodeId>,
}

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let (word, rest) = line.split_once(' ').ok_or("a line has a word and what belongs to it")?;
        match word {
            "precision" => {
                let all = [Precision::F32, Precision::F64];
                let found = all.into_iter().find(|p| p.name() == rest);
                self.graph.precision = Some(found.ok_or_else(|| format!("there is no precision `{rest}`"))?);
            }
            "output" => {
                let (name, node) = rest.rsplit_once(' ').ok_or("an output has a name and a node")?;
                self.graph.outputs.push(Output { name: name.to_owned(), node: id(node)? });
            }
            _ => {
                let here = NodeId(u32::try_from(self.graph.len()).unwrap_or(u32::MAX));
                if id(word)? != here {
                    return Err(format!("the next node is %{}, not {word}", here.0));
                }
                self.node(here, rest.strip_prefix("= ").ok_or("a node's number is followed by `=`")?)?;
            }
        }
        Ok(())
    }

    fn node(&mut self, here: NodeId, text: &str) -> Result<(), String> {
        let (word, rest) = text.split_once(' ').unwrap_or((text, ""));
        let operands: Vec<&str> = rest.split_whitespace().collect();
        let ids = || operands.iter().map(|x| id(x)).collect::<Result<Vec<_>, _>>();
        let wrong = || format!("`{word}` has other operands than `{rest}`");
        let scalar = |of: NodeId| self.graph.scalar(of);
        let (node, scalar) = match word {
            "input" => {
                let (name, kind) = rest.rsplit_once(": ").ok_or("an input has a name and a kind")?;
                let kinds = [Scalar::Real, Scalar::Int, Scalar::Bool];
                let scalar = kinds.into_iter().find(|s| s.to_string() == kind);
                let scalar = scalar.ok_or_else(|| format!("there is no kind `{kind}`"))?;
                let index = u32::try_from(self.graph.inputs.len()).unwrap_or(u32::MAX);
                self.graph.inputs.push(Input { name: name.to_owned(), scalar });
                (Node::Input(index), scalar)
            }
            "real" => (Node::real(number(rest)?), Scalar::Real),
            "int" => (Node::Int(number(rest)?), Scalar::Int),
            "bool" => (Node::Bool(number(rest)?), Scalar::Bool),
            "else" => {
                let gamma = self.open.last().copied().ok_or("there is no branch to continue")?;
                let Some(Node::Gamma { otherwise, .. }) = self.graph.nodes.get_mut(gamma.index()) else {
                    return Err("there is no branch to continue".to_owned());
                };
                *otherwise = here;
                (Node::Else { gamma }, Scalar::Bool)
            }
            "end" => {
                let begin = self.open.pop().ok_or("there is nothing to end")?;
                if let Some(Node::Gamma { end, .. } | Node::Theta { end, .. }) = self.graph.nodes.get_mut(begin.index())
                {
                    *end = here;
                }
                (Node::End { begin }, Scalar::Bool)
            }
            "tape" => {
                let &[end, value, every] = operands.as_slice() else { return Err(wrong()) };
                let (end, value) = (id(end)?, id(value)?);
                (Node::Tape { end, value, every: number(every)? }, scalar(value))
            }
            _ => match (word, ids()?.as_slice()) {
                ("fresh", [x]) => (Node::Fresh(*x), scalar(*x)),
                ("diff", [value, wrt]) => (Node::Diff { value: *value, wrt: *wrt }, Scalar::Real),
                ("within", &[wrt, lo, hi, nan, ref next @ ..]) if next.len() < 2 => {
                    let next = next.first().copied().unwrap_or(NodeId::NONE);
                    (Node::Within { wrt, lo, hi, nan, next }, Scalar::Bool)
                }
                ("lower" | "upper" | "maybenan", &[value, within]) => {
                    let part = Part::ALL.into_iter().find(|p| p.name() == word).unwrap_or(Part::Lower);
                    (Node::Bound { value, within, part }, part.scalar())
                }
                ("gamma", [cond]) => {
                    self.open.push(here);
                    (Node::Gamma { cond: *cond, otherwise: NodeId::NONE, end: NodeId::NONE }, Scalar::Bool)
                }
                ("theta", [lo, hi]) => {
                    self.open.push(here);
                    (Node::Theta { lo: *lo, hi: *hi, end: NodeId::NONE }, Scalar::Int)
                }
                ("counter", [theta]) => (Node::Counter { theta: *theta }, Scalar::Int),
                ("carried", [theta, init]) => (Node::Carried { theta: *theta, init: *init }, scalar(*init)),
                ("join", [end, then, otherwise]) => {
                    (Node::Join { end: *end, then: *then, otherwise: *otherwise }, scalar(*then))
                }
                ("final", [end, carried, next]) => {
                    (Node::Final { end: *end, carried: *carried, next: *next }, scalar(*carried))
                }
                ("recall", [tape, at]) => (Node::Recall { tape: *tape, at: *at }, scalar(*tape)),
                ("within" | "lower" | "upper" | "maybenan" | "recall", _) => return Err(wrong()),
                ("fresh" | "diff" | "gamma" | "theta" | "counter" | "carried" | "join" | "final", _) => {
                    return Err(wrong());
                }
                (name, args) => {
                    let op = Op::ALL.iter().find(|op| op.def().name == name);
                    let op = *op.ok_or_else(|| format!("there is no operation `{name}`"))?;
                    if args.len() != op.def().operands.len() {
                        return Err(wrong());
                    }
                    (Node::Apply(op, Args::new(args)), op.def().result)
                }
            },
        };
        self.graph.nodes.push(node);
        self.graph.scalars.push(scalar);
        self.graph.origins.push(Origin::default());
        Ok(())
    }
}

fn id(text: &str) -> Result<NodeId, String> {
    let digits = text.strip_prefix('%').ok_or_else(|| format!("`{text}` is no node: nodes are %0, %1, …"))?;
    number(digits).map(NodeId)
}

fn number<T: FromStr>(text: &str) -> Result<T, String> {
    text.parse().map_err(|_| format!("`{text}` is not what stands here"))
}
