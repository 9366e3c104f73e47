//! Recursive descent over LANGUAGE 2: tokens to a tree, always to the end of the file, several errors per run.
//! Knows the grammar; looks up no name, checks no type, and recurses only with brackets, blocks and prefix words.

mod balance;
mod expressions;
mod items;
mod recovery;
mod statements;
mod types;

use std::collections::VecDeque;

use crate::lexer::{Fault, Lexer, Token, TokenKind};
use crate::tree::{Block, BlockId, Expr, ExprId, ExprKind, Ident, Tree, TypeExpr, TypeId, TypeKind};
use crate::{Code, Diagnostic, FileId, Limits, Span};

use TokenKind as K;

/// What parsing gives.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parsed {
    /// The tree. It is complete if there are no diagnostics.
    pub tree: Tree,
    /// Errors in source order, at most `limits.diagnostics`.
    pub diagnostics: Vec<Diagnostic>,
    /// Errors beyond that.
    pub omitted: u64,
}

/// Reads one file. Never fails: what is wrong is reported and left out, or becomes [`ExprKind::Error`].
#[must_use]
pub fn parse(file: FileId, text: &str, limits: &Limits) -> Parsed {
    let mut parser = Parser::new(file, text, limits);
    parser.file();
    let (skipped, lost) = (parser.names_in(&parser.given_up), parser.names_in(&parser.lost));
    let incomplete = parser.lost.iter().any(|(start, end)| parser.may_declare_anything(*start, *end));
    let Parser { tree, mut diagnostics, omitted, .. } = parser;
    let incomplete = incomplete || tree.incomplete;
    let tree = Tree { skipped, lost, incomplete, ..tree };
    diagnostics.sort_by_key(|d| d.labels.first().map(|l| (l.span.start, l.span.end)));
    Parsed { tree, diagnostics, omitted }
}

/// Something could not be read. It has been reported; whoever can recover does, everyone else passes it on.
#[derive(Debug, Clone, Copy)]
struct Abort;

type Parse<T> = Result<T, Abort>;

struct Parser<'a> {
    file: FileId,
    text: &'a str,
    lexer: Lexer<'a>,
    /// Tokens read ahead.
    ahead: VecDeque<Token>,
    /// The token consumed last.
    previous: Token,
    tree: Tree,
    diagnostics: Vec<Diagnostic>,
    omitted: u64,
    capacity: usize,
    /// Characters before this were reported by the lexer's side; a `>=` taken apart is read twice.
    scanned: usize,
    /// An unexpected token that starts here was reported or follows from what was.
    quiet_at: Option<usize>,
    nesting: u64,
    depth: u64,
    /// Whether [`Code::E1004`] was reported for this item; more of it would say nothing new.
    too_deep: bool,
    /// `if` and `for` inside each other's heads, where no bracket counts.
    heads: u64,
    /// The brackets that must close, innermost last.
    closers: Vec<K>,
    /// Between a head's word and its `{` a call takes no blocks (LANGUAGE 2.2).
    in_head: bool,
    /// Heads being read, with brackets in them or not.
    open_heads: u64,
    /// Inside a block that stands where none may, which is reported once.
    in_bare_block: bool,
    /// Blocks that were given up at the next item; their `}` may still come.
    unclosed: u64,
    /// Brackets that did not match, so far.
    mismatches: u64,
    /// Keywords that were reported where a name of this item is defined: later they are read as that name.
    keyword_names: Vec<K>,
    /// Whether the head of this item has an error.
    broken_head: bool,
    /// Ranges of text inside of items that were given up, in source order, none in another.
    given_up: Vec<(usize, usize)>,
    /// The same between items.
    lost: Vec<(usize, usize)>,
}

impl<'a> Parser<'a> {
    fn new(file: FileId, text: &'a str, limits: &Limits) -> Self {
        let text = text.get(..text.floor_char_boundary(u32::MAX as usize - 1)).unwrap_or("");
        Self {
            file,
            text,
            lexer: Lexer::new(text),
            ahead: VecDeque::with_capacity(4),
            previous: Token { kind: K::End, start: 0, end: 0 },
            tree: Tree::default(),
            diagnostics: Vec::new(),
            omitted: 0,
            capacity: usize::try_from(limits.diagnostics).unwrap_or(usize::MAX),
            scanned: 0,
            quiet_at: None,
            nesting: limits.nesting.min(Limits::most("nesting")),
            depth: 0,
            too_deep: false,
            heads: 0,
            closers: Vec::new(),
            in_head: false,
            open_heads: 0,
            in_bare_block: false,
            unclosed: 0,
            mismatches: 0,
            keyword_names: Vec::new(),
            broken_head: false,
            given_up: Vec::new(),
            lost: Vec::new(),
        }
    }

    /// How many errors were found so far.
    fn errors(&self) -> u64 {
        self.diagnostics.len() as u64 + self.omitted
    }

    /// What was read from `start` to here is left out of the tree, or not all that stands there is in it.
    fn give_up(&mut self, start: Token) {
        let end = self.previous.end;
        while self.given_up.last().is_some_and(|(from, _)| *from >= start.start) {
            self.given_up.pop();
        }
        if start.start < end {
            self.given_up.push((start.start, end));
        }
    }

    /// The names in ranges of the text.
    fn names_in(&self, ranges: &[(usize, usize)]) -> Vec<Ident> {
        let tokens = ranges.iter().flat_map(|(start, end)| self.tokens_in(*start, *end));
        tokens.filter(|t| t.kind == K::Ident).map(|t| self.ident(t)).collect()
    }

    fn tokens_in(&self, start: usize, end: usize) -> impl Iterator<Item = Token> + use<'a> {
        let mut lexer = self.lexer.clone();
        lexer.seek(start);
        std::iter::from_fn(move || Some(lexer.token())).take_while(move |t| t.kind != K::End && t.end <= end)
    }

    /// Whether a range of lost text holds a path of a module, or the word of an item and no name behind it.
    fn may_declare_anything(&self, start: usize, end: usize) -> bool {
        let next = self.tokens_in(start, end).skip(1).map(|t| t.kind).chain([K::End]);
        self.tokens_in(start, end).map(|t| t.kind).zip(next).any(|pair| match pair {
            (K::Module, _) => true,
            (K::ColonColon, after) => after != K::Lt,
            (K::Entity | K::Operation | K::Concept | K::Fn, after) => after != K::Ident,
            (K::Export, after) => !matches!(after, K::Fn | K::Ident),
            _ => false,
        })
    }

    /// The token `distance` after the current one.
    fn peek(&mut self, distance: usize) -> Token {
        loop {
            if let Some(token) = self.ahead.get(distance) {
                return *token;
            }
            let token = self.lexer.token();
            if let K::Bad(fault) = token.kind {
                self.report_bad(fault, token);
            }
            self.ahead.push_back(token);
        }
    }

    fn current(&mut self) -> Token {
        self.peek(0)
    }

    fn kind(&mut self) -> K {
        self.peek(0).kind
    }

    fn at(&mut self, kind: K) -> bool {
        self.kind() == kind
    }

    /// Consumes the current token; the end of the file stays.
    fn bump(&mut self) -> Token {
        let token = self.peek(0);
        if token.kind != K::End {
            self.ahead.pop_front();
            self.previous = token;
        }
        token
    }

    fn eat(&mut self, kind: K) -> bool {
        let found = self.at(kind);
        if found {
            self.bump();
        }
        found
    }

    /// Consumes `kind` or reports that it is missing.
    fn expect(&mut self, kind: K) -> Parse<Token> {
        if self.at(kind) { Ok(self.bump()) } else { self.unexpected(&format!("`{}`", kind.text())) }
    }

    /// Takes exactly one `>` and reads the rest again (LANGUAGE 1.8.4).
    fn close_angle(&mut self) -> Parse<()> {
        let token = self.current();
        if token.kind != K::Ge {
            return self.expect(K::Gt).map(|_| ());
        }
        self.previous = Token { kind: K::Gt, start: token.start, end: token.start + 1 };
        self.ahead.clear();
        self.lexer.seek(token.start + 1);
        Ok(())
    }

    /// A name. A keyword in its place is reported as such and taken for the name, if what follows (`follow`) shows
    /// that it was meant as one.
    fn name(&mut self, what: &str, follow: &[K]) -> Parse<Ident> {
        let token = self.current();
        if token.kind == K::Ident {
            self.bump();
            return Ok(self.ident(token));
        }
        let next = self.peek(1).kind;
        if !token.kind.is_keyword() || !follow.contains(&next) {
            return self.unexpected(what);
        }
        self.bump();
        self.keyword_names.push(token.kind);
        self.report(|p| {
            let word = token.kind.text();
            Diagnostic::new(Code::E0204, p.span(token), format!("the keyword `{word}` cannot be used as a name"))
                .here("keyword")
                .help(format!("choose another name, for example `{word}_`"))
        });
        Ok(self.ident(token))
    }

    fn ident(&self, token: Token) -> Ident {
        Ident { text: self.written(token).to_owned(), span: self.span(token) }
    }

    fn written(&self, token: Token) -> &'a str {
        self.text.get(token.start..token.end).unwrap_or("")
    }

    fn span(&self, token: Token) -> Span {
        self.range(token.start, token.end)
    }

    fn range(&self, start: usize, end: usize) -> Span {
        let offset = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
        Span::new(self.file, offset(start), offset(end.max(start)))
    }

    /// From a token to the one consumed last.
    fn since(&self, start: Token) -> Span {
        self.range(start.start, self.previous.end)
    }

    fn push_expr(&mut self, kind: ExprKind, span: Span) -> ExprId {
        let id = ExprId(u32::try_from(self.tree.exprs.len()).unwrap_or(u32::MAX));
        self.tree.exprs.push(Expr { kind, span });
        id
    }

    fn push_block(&mut self, block: Block) -> BlockId {
        let id = BlockId(u32::try_from(self.tree.blocks.len()).unwrap_or(u32::MAX));
        self.tree.blocks.push(block);
        id
    }

    fn push_type(&mut self, kind: TypeKind, span: Span) -> TypeId {
        let id = TypeId(u32::try_from(self.tree.types.len()).unwrap_or(u32::MAX));
        self.tree.types.push(TypeExpr { kind, span });
        id
    }

    /// An expression of the tree; `Error` never happens, ids come from [`Self::push_expr`].
    fn expr_kind(&self, id: ExprId) -> &ExprKind {
        self.tree.exprs.get(id.0 as usize).map_or(&ExprKind::Error, |e| &e.kind)
    }

    fn expr_span(&self, id: ExprId) -> Span {
        self.tree.exprs.get(id.0 as usize).map_or(self.range(0, 0), |e| e.span)
    }

    /// Consumes an opening bracket, runs `body`, which consumes the closing one, and keeps account of the nesting.
    /// `None` if that is too deep: reported, and skipped to the bracket's end.
    fn bracketed<T>(&mut self, close: K, body: impl FnOnce(&mut Self, Token) -> Parse<T>) -> Parse<Option<T>> {
        let open = self.current();
        if self.depth >= self.nesting {
            self.report_too_deep(open);
            self.skip_balanced();
            return Ok(None);
        }
        self.bump();
        self.depth += 1;
        self.closers.push(close);
        let in_head = std::mem::replace(&mut self.in_head, false);
        let result = body(self, open);
        self.in_head = in_head;
        self.closers.pop();
        self.depth -= 1;
        result.map(Some)
    }

    /// Elements separated by commas up to `close`, the last comma optional; `open` has been consumed. A broken
    /// element is reported, and stands in the list as `hole` makes it. Also whether there was a last comma.
    fn list<T>(
        &mut self,
        open: Token,
        close: K,
        mut items: Vec<T>,
        mut element: impl FnMut(&mut Self) -> Parse<T>,
        hole: impl Fn(&mut Self, Token) -> Option<T>,
    ) -> Parse<(Vec<T>, bool)> {
        loop {
            if self.eat(close) {
                return Ok((items, true));
            }
            if self.ends_brackets() {
                self.report_unclosed(open, close);
                return Ok((items, false));
            }
            let start = self.current();
            match element(self) {
                Ok(item) => items.push(item),
                Err(Abort) => {
                    self.sync_list(close)?;
                    self.give_up(start);
                    items.extend(hole(self, start));
                }
            }
            let (more, complete) = self.separator(open, close)?;
            if !complete {
                items.extend(hole(self, start));
            }
            if !more {
                return Ok((items, false));
            }
        }
    }

    /// After an element: whether a comma was there, and whether nothing unreadable was before that or the end.
    fn separator(&mut self, open: Token, close: K) -> Parse<(bool, bool)> {
        if self.eat(K::Comma) {
            return Ok((true, true));
        }
        let complete = self.close(open, close, "`,` or ")?;
        Ok((self.previous.kind == K::Comma, complete))
    }

    /// Consumes `close`, or reports and recovers; `or` says what else may stand here, and if that is a comma, it may
    /// be what is consumed instead. Whether `close` was there.
    fn close(&mut self, open: Token, close: K, or: &str) -> Parse<bool> {
        if self.eat(close) {
            return Ok(true);
        }
        let start = self.current();
        let found = start.kind;
        let other_closer = matches!(found, K::RParen | K::RBracket);
        let head_ends = found == K::LBrace && self.open_heads > 0;
        if other_closer || head_ends || self.ends_brackets() {
            self.report_unclosed(open, close);
            if other_closer && !self.closers.contains(&found) {
                self.bump();
            }
            return Ok(false);
        }
        let _: Parse<()> = self.unexpected(&format!("{or}`{}`", close.text()));
        self.sync_list(close)?;
        while or.is_empty() && self.eat(K::Comma) {
            self.sync_list(close)?;
        }
        self.bump();
        self.give_up(start);
        Ok(false)
    }

    fn report(&mut self, diagnostic: impl FnOnce(&Self) -> Diagnostic) {
        if self.diagnostics.len() < self.capacity {
            let diagnostic = diagnostic(self);
            self.diagnostics.push(diagnostic);
        } else {
            self.omitted += 1;
        }
    }

    #[cold]
    #[inline(never)]
    fn report_bad(&mut self, fault: Fault, token: Token) {
        if token.start < self.scanned {
            return;
        }
        self.scanned = token.end;
        self.report(|p| {
            let (span, written) = (p.span(token), clip(p.written(token)));
            match fault {
                Fault::Characters => {
                    let diagnostic = Diagnostic::new(Code::E0102, span, format!("`{written}` starts no token"));
                    match written.chars().next() {
                        Some('&' | '|') => diagnostic.help("the logical operators are `&&` and `||`"),
                        Some('"' | '\'') => diagnostic.note("there are no strings or characters in Vola"),
                        Some('^') => diagnostic.help("`pow(a, b)` raises to a power"),
                        Some('?') => diagnostic.help("choose with `if condition { a } else { b }`"),
                        _ => diagnostic.help("remove it"),
                    }
                }
                Fault::Number => Diagnostic::new(Code::E0103, span, format!("malformed number `{written}`"))
                    .help("numbers are written `12`, `1.5`, `1e3` or `1.5e-3`, with digits on both sides of the point"),
                Fault::IntTooLarge => {
                    Diagnostic::new(Code::E0104, span, format!("the int literal `{written}` is too large"))
                        .note("the largest int is 2147483647")
                        .help(format!("if a real is meant, write `{written}.0`"))
                }
            }
        });
    }

    #[cold]
    #[inline(never)]
    fn report_too_deep(&mut self, token: Token) {
        if std::mem::replace(&mut self.too_deep, true) {
            return;
        }
        let limit = self.nesting;
        self.report(|p| {
            Diagnostic::new(Code::E1004, p.span(token), format!("nested more than {limit} deep"))
                .here("this is the first that is too deep")
                .note(format!("brackets, blocks and prefix operators inside each other: limit `nesting`, {limit}"))
                .help(if limit < Limits::most("nesting") {
                    "give inner parts names with `let` or move them to functions, or raise the limit `nesting`"
                } else {
                    "give inner parts names with `let` or move them to functions"
                })
        });
    }

    #[cold]
    #[inline(never)]
    fn report_unclosed(&mut self, open: Token, close: K) {
        self.mismatches += 1;
        let found = self.current();
        if self.quiet_at == Some(found.start) || matches!(found.kind, K::Bad(_)) {
            return;
        }
        self.quiet_at = Some(found.start);
        self.report(|p| {
            let (opened, close) = (p.written(open), close.text());
            Diagnostic::new(Code::E0202, p.place(found), format!("`{opened}` is not closed"))
                .here(format!("expected `{close}`, found {}", p.describe(found)))
                .label(p.span(open), "opened here")
        });
    }

    /// Reports the current token (E0201), unless that would follow from an error already reported.
    #[cold]
    #[inline(never)]
    fn unexpected<T>(&mut self, expected: &str) -> Parse<T> {
        let found = self.current();
        let follows = matches!(found.kind, K::Bad(_)) || matches!(self.previous.kind, K::Bad(_));
        if follows || self.quiet_at == Some(found.start) {
            return Err(Abort);
        }
        self.quiet_at = Some(found.start);
        let hint = self.hint(found);
        self.report(|p| {
            let described = p.describe(found);
            let message = format!("expected {expected}, found {described}");
            let ends_line = p.text.get(p.previous.end..found.start).is_some_and(|between| between.contains('\n'));
            let forgotten = ends_line && found.kind != K::End && matches!(expected.get(..3), Some("`;`" | "`,`"));
            let place = if forgotten { p.range(p.previous.end, p.previous.end) } else { p.place(found) };
            let mut diagnostic = Diagnostic::new(Code::E0201, place, message).here(format!("expected {expected}"));
            if forgotten {
                diagnostic = diagnostic.label(p.span(found), format!("found {described}"));
            }
            match hint {
                Some(hint) => diagnostic.help(hint),
                None => diagnostic,
            }
        });
        Err(Abort)
    }

    /// Where to point for a token: the end of the file is best shown after the last token.
    fn place(&self, token: Token) -> Span {
        if token.kind == K::End { self.range(self.previous.end, self.previous.end) } else { self.span(token) }
    }

    fn describe(&self, token: Token) -> String {
        match token.kind {
            K::End => "the end of the file".to_owned(),
            K::Bad(_) => token.kind.text().to_owned(),
            K::Ident | K::Int | K::Real | K::Index => {
                format!("{} `{}`", token.kind.text(), clip(self.written(token)))
            }
            kind if kind.is_keyword() => format!("keyword `{}`", kind.text()),
            kind => format!("`{}`", kind.text()),
        }
    }

    /// What to do about frequent forms of other languages (LANGUAGE 2.7).
    fn hint(&mut self, found: Token) -> Option<&'static str> {
        let previous = self.written(self.previous);
        Some(match (found.kind, self.previous.kind) {
            (K::Assign, K::Plus | K::Minus | K::Star | K::Slash | K::Percent) => {
                "there is no compound assignment: write `x = x + e;`"
            }
            (K::Assign, K::Ident | K::Index | K::Int | K::Real | K::RParen | K::RBracket) => {
                "`==` compares; `x = e;` assigns and is a statement of its own"
            }
            (K::Colon, K::Ident) => "a `let` has no type annotation; cast the value: `e::<int>`",
            (K::LBracket, _) => "components are read with `.0` or `.x`; an index is a literal",
            (K::Plus | K::Star | K::Slash, K::RBrace) => "put an `if` that is part of an expression in parentheses",
            (_, K::Ident) if previous == "return" => {
                "there is no `return`: the last expression of a block is its value"
            }
            (_, K::Ident) if previous == "while" => "there is no `while`: loops are `for i in lo..hi { … }`",
            (K::LBrace, K::LBrace | K::RBrace | K::Semi) => "there are no bare blocks: `if` and `for` have blocks",
            _ => return None,
        })
    }
}

/// At most 40 characters of text for a message, without control characters.
fn clip(text: &str) -> String {
    let shown: String =
        text.chars().take(40).flat_map(|c| if c.is_control() { vec!['\u{fffd}'] } else { vec![c] }).collect();
    if text.chars().nth(40).is_some() { shown + "…" } else { shown }
}
