//! From the 2024 dialect to the current one (LANGUAGE 20.2): edits of the text, construct by construct, then the
//! formatter. Knows the forms that have a newer one; the meaning of the program stays what it was.

use std::collections::BTreeSet;

use isograd_program::{Builtin, Loader};
use isograd_syntax::lexer::{Lexer, TokenKind};
use isograd_syntax::tree::{BlockId, Expr, ExprId, ExprKind, Item, ItemKind, Stmt, StmtKind, Tree, TypeKind};
use isograd_syntax::{FileId, Limits, Span, format, parse};

use crate::{Checked, WithStd};

/// The current form of a program's entry file, formatted: `s`, `i`, `CSG` become `real`, `int`, `csg`; `define` and
/// bare exports become functions with their type; `t.C(x)` and `t()` become `eval t.C(x)` and `t`; a loop that a `let`
/// binds becomes a statement; modules beside the file are named from `self`. A loop expression elsewhere, or one
/// whose body or bounds use the name that is bound, stays as it is: it means the same in both dialects.
///
/// `None` if the program has errors: then some types are not known.
#[must_use]
pub fn migrate(checked: &Checked, loader: &dyn Loader) -> Option<String> {
    let program = checked.program.as_ref()?;
    let (tree, text) = (&checked.tree, checked.files.get(FileId(0))?.text.as_str());
    let mut called: BTreeSet<&str> = program.definitions.iter().map(|d| d.name.as_str()).collect();
    called.extend(program.functions.iter().map(|f| f.name.as_str()));
    called.extend(Builtin::ALL.iter().map(|b| b.name()));
    called.extend(["diff", "bound"]);
    let mut edits = Edits { text, tree, list: Vec::new(), recalled: BTreeSet::new(), taken: identifiers(text) };
    let libraries = WithStd(loader).libraries();
    for item in &tree.items {
        edits.item(item, &libraries, |name| {
            let exports = program.exports.iter().filter_map(|id| program.functions.get(id.0 as usize));
            exports.into_iter().find(|f| f.name == name).map(|f| f.result.to_string())
        });
    }
    for ty in &tree.types {
        let TypeKind::Word { name, .. } = &ty.kind else { continue };
        let current = match name.as_str() {
            "s" => "real",
            "i" => "int",
            "CSG" => "csg",
            _ => continue,
        };
        edits.replace(Span { end: ty.span.start + u32::try_from(name.len()).unwrap_or(0), ..ty.span }, current);
    }
    for expr in &tree.exprs {
        match &expr.kind {
            ExprKind::Eval { tree, word: false, .. } => edits.insert(tree.span.start, "eval "),
            ExprKind::Call { callee, args, blocks }
                if args.is_empty() && blocks.is_empty() && !called.contains(callee.text.as_str()) =>
            {
                // Parentheses around the call are part of its span and stay.
                let end = edits.closing(callee.span.end);
                edits.recalled.insert(callee.span.start);
                edits.replace(Span { start: callee.span.end, end, ..callee.span }, "");
            }
            _ => {}
        }
    }
    for stmt in tree.blocks.iter().flat_map(|b| &b.stmts) {
        edits.statement(stmt);
    }
    let edited = edits.apply();
    // What nests as deep as the host allows for the program may do so here; no edit adds a bracket around another.
    let limits = Limits { nesting: u64::MAX, ..Limits::default() };
    let parsed = parse(FileId(0), &edited, &limits);
    Some(format(&edited, &parsed.tree))
}

/// Replacements of pieces of a text; none overlaps another.
struct Edits<'a> {
    text: &'a str,
    tree: &'a Tree,
    list: Vec<(u32, u32, String)>,
    /// Where a csg variable is written as a call, `t()`.
    recalled: BTreeSet<u32>,
    /// Names that new variables may not have.
    taken: BTreeSet<String>,
}

impl<'a> Edits<'a> {
    fn replace(&mut self, span: Span, by: &str) {
        self.list.push((span.start, span.end, by.to_owned()));
    }

    fn insert(&mut self, at: u32, text: &str) {
        self.list.push((at, at, text.to_owned()));
    }

    /// One past the next `)`.
    fn closing(&self, from: u32) -> u32 {
        let rest = self.text.get(from as usize..).unwrap_or("");
        from + rest.find(')').and_then(|at| u32::try_from(at + 1).ok()).unwrap_or(0)
    }

    fn item(&mut self, item: &Item, libraries: &[String], result_of: impl Fn(&str) -> Option<String>) {
        match &item.kind {
            ItemKind::Module { path } => {
                let Some(first) = path.first() else { return };
                let library = path.len() > 1 && libraries.contains(&first.text);
                if first.text != "self" && !library {
                    self.insert(first.span.start, "self::");
                }
            }
            ItemKind::Function { define: true, body, .. } => {
                let start = item.span.start;
                self.replace(Span { end: start + 6, ..item.span }, "fn");
                self.result(*body, "csg");
            }
            ItemKind::Function { export: true, name, result: None, body, .. } => {
                let Some(result) = result_of(&name.text) else { return };
                self.insert(name.span.start, "fn ");
                self.result(*body, &result);
            }
            _ => {}
        }
    }

    fn result(&mut self, body: BlockId, ty: &str) {
        if let Some(block) = self.tree.blocks.get(body.0 as usize) {
            self.insert(block.span.start, &format!("-> {ty} "));
        }
    }

    /// `let r = for v = e in a..b { B };` becomes `let r = e; for i in a..b { B[v := r] }`.
    fn statement(&mut self, stmt: &Stmt) {
        let StmtKind::Bind { name: bound, value, .. } = &stmt.kind else { return };
        let Some(Expr { kind: ExprKind::Loop { name, init, lo, body, .. }, span }) = self.expr(*value) else { return };
        let (Some(init), Some(lo)) = (self.expr(*init), self.expr(*lo)) else { return };
        let Some(body) = self.tree.blocks.get(body.0 as usize) else { return };
        let inside = |s: &Span| body.span.start <= s.start && s.end <= body.span.end;
        let heads = |s: &Span| lo.span.start <= s.start && s.end <= body.span.start;
        let renamed = bound.text != name.text;
        // The name that is bound would come into reach of the bounds, and of the body under its own name.
        if self.uses(&bound.text).iter().any(|s| heads(s) || (renamed && inside(s))) {
            return;
        }
        let uses: Vec<Span> = self.uses(&name.text).into_iter().filter(inside).collect();
        if renamed {
            // Where the body hides the name, a use of it may mean another value.
            let hides = |s: &Stmt| match &s.kind {
                StmtKind::Bind { name: n, .. } | StmtKind::For { counter: n, .. } => uses.contains(&n.span),
                _ => false,
            };
            let hidden = self.tree.blocks.iter().flat_map(|b| &b.stmts).any(hides);
            let nested = self.tree.exprs.iter().any(|e| matches!(e.kind, ExprKind::Loop { .. }) && inside(&e.span));
            if hidden || nested {
                return;
            }
            for place in uses {
                self.replace(place, &bound.text);
            }
        }
        let counter = self.fresh();
        let start = span.start;
        self.replace(Span { start, end: init.span.start, ..*span }, "");
        self.replace(Span { start: init.span.end, end: lo.span.start, ..*span }, &format!(";\nfor {counter} in "));
        // What stands between the body and the statement's end is the `;`, perhaps after a parenthesis.
        self.replace(Span { start: body.span.end, end: stmt.span.end, ..*span }, "");
    }

    fn expr(&self, id: ExprId) -> Option<&'a Expr> {
        self.tree.exprs.get(id.0 as usize)
    }

    /// Where a name stands for a variable: not after a dot, before an argument list, or in a type.
    fn uses(&self, name: &str) -> Vec<Span> {
        let types = |at: u32| self.tree.types.iter().any(|t| t.span.start <= at && at < t.span.end);
        let mut lexer = Lexer::new(self.text);
        let mut uses = Vec::new();
        let mut before = None;
        loop {
            let token = lexer.token();
            if token.kind == TokenKind::End {
                return uses;
            }
            let called = lexer.clone().token().kind == TokenKind::LParen;
            let span = Span::new(FileId(0), at(token.start), at(token.end));
            let named = token.kind == TokenKind::Ident && self.text.get(token.start..token.end) == Some(name);
            let variable = !called || self.recalled.contains(&span.start);
            if named && before != Some(TokenKind::Dot) && variable && !types(span.start) {
                uses.push(span);
            }
            before = Some(token.kind);
        }
    }

    /// A name that the file does not have, and that no other edit has taken.
    fn fresh(&mut self) -> String {
        let numbered = (2..).map(|n| format!("i{n}"));
        let free = std::iter::once("i".to_owned()).chain(numbered).find(|name| !self.taken.contains(name));
        let name = free.unwrap_or_default();
        self.taken.insert(name.clone());
        name
    }

    fn apply(mut self) -> String {
        self.list.sort();
        let mut out = String::new();
        let mut from = 0;
        for (start, end, by) in self.list {
            out.push_str(self.text.get(from as usize..start as usize).unwrap_or(""));
            out.push_str(&by);
            from = end.max(from);
        }
        out.push_str(self.text.get(from as usize..).unwrap_or(""));
        out
    }
}

/// A position in a file, which is far smaller than 4 GiB.
fn at(byte: usize) -> u32 {
    u32::try_from(byte).unwrap_or(u32::MAX)
}

/// Every identifier of a text.
fn identifiers(text: &str) -> BTreeSet<String> {
    let mut lexer = Lexer::new(text);
    let mut all = BTreeSet::new();
    loop {
        let token = lexer.token();
        match token.kind {
            TokenKind::End => return all,
            TokenKind::Ident => {
                all.insert(text.get(token.start..token.end).unwrap_or("").to_owned());
            }
            _ => {}
        }
    }
}
