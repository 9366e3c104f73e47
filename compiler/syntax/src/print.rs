//! A tree as text, for `--emit parse`: items and statements one per line, expressions in prefix form.
//! Works off a list of what is still to print, so that no chain, however long, is recursion.

use std::fmt::Write as _;

use crate::tree::{
    Block, BlockId, Expr, ExprId, ExprKind, Ident, Item, ItemKind, Param, Stmt, StmtKind, Tree, TypeId, TypeKind,
};

/// The text of a tree. Equal trees print equally; spans are not shown.
#[must_use]
pub fn print(tree: &Tree) -> String {
    let mut printer = Printer { tree, out: String::new(), todo: Vec::new(), indent: 0 };
    for item in &tree.items {
        let parts = printer.item(item);
        printer.run(parts);
        printer.out.push('\n');
    }
    printer.out
}

/// Something still to print.
enum Part<'a> {
    Str(&'a str),
    Text(String),
    Expr(ExprId),
    Type(TypeId),
    Block(BlockId),
    Line,
    Indent,
    Dedent,
}

use Part as P;

struct Printer<'a> {
    tree: &'a Tree,
    out: String,
    todo: Vec<Part<'a>>,
    indent: usize,
}

impl<'a> Printer<'a> {
    fn run(&mut self, parts: Vec<Part<'a>>) {
        self.todo.extend(parts.into_iter().rev());
        while let Some(part) = self.todo.pop() {
            let more = match part {
                P::Str(text) => {
                    self.out.push_str(text);
                    continue;
                }
                P::Text(text) => {
                    self.out.push_str(&text);
                    continue;
                }
                P::Line => {
                    let _ = write!(self.out, "\n{:1$}", "", 2 * self.indent);
                    continue;
                }
                P::Indent => {
                    self.indent += 1;
                    continue;
                }
                P::Dedent => {
                    self.indent = self.indent.saturating_sub(1);
                    continue;
                }
                P::Expr(id) => self.tree.exprs.get(id.0 as usize).map(expr),
                P::Type(id) => self.tree.types.get(id.0 as usize).map(|t| ty(&t.kind)),
                P::Block(id) => self.tree.blocks.get(id.0 as usize).map(block),
            };
            self.todo.extend(more.unwrap_or_default().into_iter().rev());
        }
    }

    fn item(&self, item: &'a Item) -> Vec<Part<'a>> {
        let mut parts = Vec::new();
        for line in item.doc.iter().flat_map(|d| d.split('\n')) {
            parts.extend([P::Str("/// "), P::Str(line), P::Str("\n")]);
        }
        for attribute in &item.attributes {
            parts.extend([P::Str("#["), P::Str(&attribute.name.text)]);
            exprs(&mut parts, &attribute.args);
            parts.push(P::Str("]\n"));
        }
        parts.push(P::Str("("));
        match &item.kind {
            ItemKind::Module { path } => {
                parts.push(P::Str("module"));
                names(&mut parts, path);
            }
            ItemKind::Definition { operation, name, params: list } => {
                parts.push(P::Str(if *operation { "operation " } else { "entity " }));
                parts.push(P::Str(&name.text));
                params(&mut parts, list);
            }
            ItemKind::Concept { name, source, target } => {
                parts.extend([P::Str("concept "), P::Str(&name.text)]);
                if let Some(source) = source {
                    parts.extend([P::Str(" "), P::Type(*source)]);
                }
                parts.extend([P::Str(" -> "), P::Type(*target)]);
            }
            ItemKind::Impl { node, operands, concept, args, body } => {
                parts.extend([P::Str("impl "), P::Str(&node.text), P::Str(" (operands")]);
                names(&mut parts, operands);
                parts.extend([P::Str(") for "), P::Str(&concept.text), P::Str(" (args")]);
                names(&mut parts, args);
                parts.extend([P::Str(")"), P::Indent, P::Line, P::Block(*body), P::Dedent]);
            }
            ItemKind::Function { export, name, params: list, result, define, body } => {
                parts.push(P::Str(if *export { "export " } else { "" }));
                parts.push(P::Str(if *define { "define " } else { "fn " }));
                parts.push(P::Str(&name.text));
                params(&mut parts, list);
                if let Some(result) = result {
                    parts.extend([P::Str(" -> "), P::Type(*result)]);
                }
                parts.extend([P::Indent, P::Line, P::Block(*body), P::Dedent]);
            }
        }
        parts.push(P::Str(")"));
        parts
    }
}

fn names<'a>(parts: &mut Vec<Part<'a>>, names: &'a [Ident]) {
    for name in names {
        parts.extend([P::Str(" "), P::Str(&name.text)]);
    }
}

fn exprs(parts: &mut Vec<Part<'_>>, exprs: &[ExprId]) {
    for expr in exprs {
        parts.extend([P::Str(" "), P::Expr(*expr)]);
    }
}

fn params<'a>(parts: &mut Vec<Part<'a>>, params: &'a [Param]) {
    for param in params {
        parts.extend([P::Str(" ("), P::Str(&param.name.text), P::Str(" "), P::Type(param.ty)]);
        if let Some(default) = param.default {
            parts.extend([P::Str(" = "), P::Expr(default)]);
        }
        if let Some((lo, hi)) = param.range {
            parts.extend([P::Str(" in "), P::Expr(lo), P::Str(" .. "), P::Expr(hi)]);
        }
        parts.push(P::Str(")"));
    }
}

fn ty<'a>(kind: &'a TypeKind) -> Vec<Part<'a>> {
    match kind {
        TypeKind::Word { name, element } => {
            let mut parts = vec![P::Str(name)];
            if let Some(element) = element {
                parts.extend([P::Str("<"), P::Type(*element), P::Str(">")]);
            }
            parts
        }
        TypeKind::Tensor => vec![P::Str("tensor")],
        TypeKind::Interval(inner) => vec![P::Str("interval<"), P::Type(*inner), P::Str(">")],
        TypeKind::Tuple(items) => {
            let mut parts = vec![P::Str("(")];
            for (k, item) in items.iter().enumerate() {
                parts.extend([P::Str(if k == 0 { "" } else { ", " }), P::Type(*item)]);
            }
            parts.push(P::Str(")"));
            parts
        }
        TypeKind::Error => vec![P::Str("<error>")],
    }
}

fn block(block: &Block) -> Vec<Part<'_>> {
    let mut parts = vec![P::Str("(block"), P::Indent];
    for stmt in &block.stmts {
        parts.push(P::Line);
        parts.extend(statement(stmt));
    }
    if let Some(value) = block.value {
        parts.extend([P::Line, P::Str("(value "), P::Expr(value), P::Str(")")]);
    }
    parts.extend([P::Dedent, P::Str(")")]);
    parts
}

fn statement(stmt: &Stmt) -> Vec<Part<'_>> {
    match &stmt.kind {
        StmtKind::Bind { csg, name, value } => {
            let word = if *csg { "(csg " } else { "(let " };
            vec![P::Str(word), P::Str(&name.text), P::Str(" "), P::Expr(*value), P::Str(")")]
        }
        StmtKind::Assign { name, value } => {
            vec![P::Str("(set "), P::Str(&name.text), P::Str(" "), P::Expr(*value), P::Str(")")]
        }
        StmtKind::For { counter, lo, hi, body } => {
            let mut parts = vec![P::Str("(for "), P::Str(&counter.text)];
            parts.extend([P::Str(" "), P::Expr(*lo), P::Str(" .. "), P::Expr(*hi)]);
            parts.extend([P::Indent, P::Line, P::Block(*body), P::Dedent, P::Str(")")]);
            parts
        }
        StmtKind::If(value) => vec![P::Expr(*value)],
        StmtKind::Expr(value) => vec![P::Str("(drop "), P::Expr(*value), P::Str(")")],
        StmtKind::Empty => vec![P::Str("(empty)")],
    }
}

fn expr(expr: &Expr) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    match &expr.kind {
        ExprKind::Int(value) => parts.push(P::Text(value.to_string())),
        ExprKind::Real(value) => parts.push(P::Text(format!("{value:?}"))),
        ExprKind::Bool(value) => parts.push(P::Str(if *value { "true" } else { "false" })),
        ExprKind::Name(name) => parts.push(P::Str(name)),
        ExprKind::Unary { op, operand } => {
            parts.extend([P::Str("("), P::Str(op.text()), P::Str(" "), P::Expr(*operand), P::Str(")")]);
        }
        ExprKind::Binary { op, left, right, .. } => {
            parts.extend([P::Str("("), P::Str(op.text()), P::Str(" "), P::Expr(*left), P::Str(" ")]);
            parts.extend([P::Expr(*right), P::Str(")")]);
        }
        ExprKind::Cast { value, ty } => {
            parts.extend([P::Str("(cast "), P::Expr(*value), P::Str(" "), P::Type(*ty), P::Str(")")]);
        }
        ExprKind::Access { base, field } => {
            parts.extend([P::Str("(. "), P::Expr(*base), P::Str(" "), P::Str(&field.text), P::Str(")")]);
        }
        ExprKind::Call { callee, args, blocks } => {
            parts.extend([P::Str("(call "), P::Str(&callee.text)]);
            exprs(&mut parts, args);
            nested(&mut parts, blocks);
        }
        ExprKind::Eval { tree, concept, args, word } => {
            parts.push(P::Str(if *word { "(eval " } else { "(eval24 " }));
            parts.extend([P::Str(&tree.text), P::Str(" "), P::Str(&concept.text)]);
            exprs(&mut parts, args);
            parts.push(P::Str(")"));
        }
        ExprKind::Tuple(items) => {
            parts.push(P::Str("(tuple"));
            exprs(&mut parts, items);
            parts.push(P::Str(")"));
        }
        ExprKind::List(items) => {
            parts.push(P::Str("(list"));
            exprs(&mut parts, items);
            parts.push(P::Str(")"));
        }
        ExprKind::Splat { element, count } => {
            parts.extend([P::Str("(splat "), P::Expr(*element), P::Text(format!(" {count})"))]);
        }
        ExprKind::Interval { lo, hi } => {
            parts.extend([P::Str("(interval "), P::Expr(*lo), P::Str(" "), P::Expr(*hi), P::Str(")")]);
        }
        ExprKind::If { arms, otherwise } => {
            for (k, (condition, body)) in arms.iter().enumerate() {
                parts.push(if k == 0 { P::Str("(if ") } else { P::Line });
                parts.extend([P::Str(if k == 0 { "" } else { "elif " }), P::Expr(*condition)]);
                parts.extend([P::Indent, P::Line, P::Block(*body), P::Dedent]);
            }
            if let Some(body) = otherwise {
                parts.extend([P::Line, P::Str("else"), P::Indent, P::Line, P::Block(*body), P::Dedent]);
            }
            parts.push(P::Str(")"));
        }
        ExprKind::Loop { name, init, lo, hi, body } => {
            parts.extend([P::Str("(loop "), P::Str(&name.text), P::Str(" "), P::Expr(*init)]);
            parts.extend([P::Str(" in "), P::Expr(*lo), P::Str(" .. "), P::Expr(*hi)]);
            nested(&mut parts, std::slice::from_ref(body));
        }
        ExprKind::Partial(inner) => parts.extend([P::Str("<error> "), P::Expr(*inner)]),
        ExprKind::Error => parts.push(P::Str("<error>")),
    }
    parts
}

/// Blocks, each on a line of its own, and the closing parenthesis.
fn nested(parts: &mut Vec<Part<'_>>, blocks: &[BlockId]) {
    parts.push(P::Indent);
    for block in blocks {
        parts.extend([P::Line, P::Block(*block)]);
    }
    parts.extend([P::Dedent, P::Str(")")]);
}
