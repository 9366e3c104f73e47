//! The formatter: the same tokens and comments with the spaces and indentation of the house. Line breaks stay where the
//! author put them; knows nothing of line lengths, and never changes a token.

use rustc_hash::FxHashSet;

use crate::lexer::{Lexer, TokenKind};
use crate::tree::{ExprKind, ItemKind, Tree};

/// Formats a file that was parsed without errors into `tree`: one space around operators and after commas, four
/// spaces of indentation for each line that leaves brackets open, parameters below the first one if that stands beside
/// the parenthesis, at most one empty line in a row, a line for each item, LF, no byte order mark. The result parses
/// to the same tree, and formatting it again changes nothing.
#[must_use]
pub fn format(text: &str, tree: &Tree) -> String {
    let marks = Marks::of(text, tree);
    let pieces = pieces(text, &marks);
    let mut writer = Writer { out: String::with_capacity(text.len() + text.len() / 8), open: Vec::new(), line: 0 };
    let mut before: Option<&Piece<'_>> = None;
    for piece in &pieces {
        writer.piece(before, piece, &marks);
        before = Some(piece);
    }
    if !writer.out.is_empty() {
        writer.out.push('\n');
    }
    writer.out
}

/// Places in the text whose meaning a token alone does not show, by first byte.
#[derive(Default)]
struct Marks {
    /// `<` and `>` that are brackets.
    angles: FxHashSet<usize>,
    /// `{` of the blocks of scoped calls.
    scoped: FxHashSet<usize>,
    /// `..` between the ends of an interval or of a range.
    spaced: FxHashSet<usize>,
    /// `(` of the parameters of items.
    params: FxHashSet<usize>,
}

impl Marks {
    fn of(text: &str, tree: &Tree) -> Self {
        let mut marks = Self::default();
        let after = |from: u32, wanted: char| find(text, from as usize, wanted);
        for ty in &tree.types {
            let (start, end) = (ty.span.start as usize, ty.span.end as usize);
            let inside = text.get(start..end).unwrap_or("");
            marks.angles.extend(inside.char_indices().filter(|(_, c)| matches!(c, '<' | '>')).map(|(i, _)| start + i));
        }
        for expr in &tree.exprs {
            match &expr.kind {
                ExprKind::Cast { ty, .. } => {
                    if let Some(ty) = tree.types.get(ty.0 as usize) {
                        marks.angles.extend(after(ty.span.end, '>'));
                        let before = text.get(..ty.span.start as usize).and_then(|t| t.rfind('<'));
                        marks.angles.extend(before);
                    }
                }
                ExprKind::Call { blocks, .. } => {
                    let spans = blocks.iter().filter_map(|b| tree.blocks.get(b.0 as usize));
                    marks.scoped.extend(spans.map(|b| b.span.start as usize));
                }
                ExprKind::Interval { lo, .. } => marks.range(text, tree, *lo),
                _ => {}
            }
        }
        for item in &tree.items {
            match &item.kind {
                ItemKind::Impl { node, operands, .. } => {
                    if let (Some(_), Some(last)) = (operands.first(), operands.last()) {
                        marks.angles.extend(after(node.span.end, '<'));
                        marks.angles.extend(after(last.span.end, '>'));
                    }
                }
                ItemKind::Definition { name, params, .. } | ItemKind::Function { name, params, .. } => {
                    if !params.is_empty() {
                        marks.params.extend(after(name.span.end, '('));
                    }
                    for (lo, _) in params.iter().filter_map(|p| p.range) {
                        marks.range(text, tree, lo);
                    }
                }
                ItemKind::Module { .. } | ItemKind::Concept { .. } => {}
            }
        }
        marks
    }

    /// The `..` after the lower end.
    fn range(&mut self, text: &str, tree: &Tree, lo: crate::tree::ExprId) {
        let end = tree.exprs.get(lo.0 as usize).map(|e| e.span.end as usize);
        self.spaced.extend(end.and_then(|end| find(text, end, '.')));
    }
}

/// The first `wanted` at or after a byte, comments left out.
fn find(text: &str, from: usize, wanted: char) -> Option<usize> {
    let mut at = from;
    loop {
        let rest = text.get(at..)?;
        let (offset, c) = rest.char_indices().find(|(_, c)| *c == wanted || *c == '/')?;
        if c == wanted {
            return Some(at + offset);
        }
        at += offset + rest.get(offset..)?.find('\n').unwrap_or(rest.len() - offset);
    }
}

/// A token or a comment.
struct Piece<'a> {
    /// `None` is a comment.
    kind: Option<TokenKind>,
    text: &'a str,
    start: usize,
    /// Line breaks before it.
    breaks: usize,
    /// Whether it is a `-` without left operand.
    prefix: bool,
}

fn pieces<'a>(text: &'a str, marks: &Marks) -> Vec<Piece<'a>> {
    let mut lexer = Lexer::new(text);
    let mut pieces = Vec::new();
    let mut from = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    loop {
        let mut token = lexer.token();
        let trivia = text.get(from..token.start).unwrap_or("");
        let mut breaks = 0;
        let mut offset = from;
        for (i, line) in trivia.split('\n').enumerate() {
            breaks += usize::from(i > 0);
            let comment = line.trim();
            if !comment.is_empty() {
                pieces.push(Piece { kind: None, text: comment, start: offset, breaks, prefix: false });
                breaks = 0;
            }
            offset += line.len() + 1;
        }
        if token.kind == TokenKind::End {
            return pieces;
        }
        if token.kind == TokenKind::Ge && marks.angles.contains(&token.start) {
            // LANGUAGE 1.8.4: a type takes the `>`.
            token.kind = TokenKind::Gt;
            token.end = token.start + 1;
            lexer.seek(token.end);
        }
        let prefix = token.kind == TokenKind::Minus && !pieces.last().is_some_and(|p| ends_operand(p, breaks, marks));
        let text = text.get(token.start..token.end).unwrap_or("");
        pieces.push(Piece { kind: Some(token.kind), text, start: token.start, breaks, prefix });
        from = token.end;
    }
}

struct Writer {
    out: String,
    /// The open brackets.
    open: Vec<Open>,
    line: usize,
}

/// An open bracket.
struct Open {
    kind: TokenKind,
    /// The line it was opened on.
    line: usize,
    /// Where lines inside it begin, if not at a multiple of four.
    column: Option<usize>,
}

impl Writer {
    fn piece(&mut self, before: Option<&Piece<'_>>, piece: &Piece<'_>, marks: &Marks) {
        let closes = piece.kind.is_some_and(is_closer);
        if let Some(before) = before {
            let breaks = self.breaks(before, piece);
            if breaks == 0 {
                if spaced(before, piece, self.open.last().map(|o| o.kind), marks) || joins(before, piece) {
                    self.out.push(' ');
                }
                if piece.kind.is_some()
                    && before.kind == Some(TokenKind::LParen)
                    && marks.params.contains(&before.start)
                {
                    let column = self.out.chars().rev().take_while(|c| *c != '\n').count();
                    self.open.iter_mut().rev().take(1).for_each(|o| o.column = Some(column));
                }
            } else {
                for _ in 0..breaks {
                    self.out.push('\n');
                    self.line += 1;
                }
                self.indent(before, piece, closes);
            }
        }
        match piece.kind {
            Some(_) if closes => {
                self.open.pop();
            }
            Some(kind @ (TokenKind::LParen | TokenKind::LBracket | TokenKind::LBrace)) => {
                self.open.push(Open { kind, line: self.line, column: None });
            }
            _ => {}
        }
        self.out.push_str(piece.text);
    }

    /// How many line breaks stand between two pieces.
    fn breaks(&self, before: &Piece<'_>, piece: &Piece<'_>) -> usize {
        let comment = before.kind.is_none();
        if comment {
            // A comment ends with its line.
            let limit = if piece.kind.is_some_and(is_closer) { 1 } else { 2 };
            return piece.breaks.clamp(1, limit);
        }
        let ends = matches!(before.kind, Some(TokenKind::Semi | TokenKind::RBrace)) && self.open.is_empty();
        match piece.kind {
            None => piece.breaks.min(if before.kind == Some(TokenKind::LBrace) { 1 } else { 2 }),
            Some(TokenKind::LBrace) => 0,
            Some(kind) if is_closer(kind) => piece.breaks.min(1),
            Some(TokenKind::LParen) if before.kind == Some(TokenKind::Ident) => 0,
            Some(_) if ends => piece.breaks.clamp(1, 2),
            Some(_) if matches!(before.kind, Some(TokenKind::LBrace | TokenKind::LParen | TokenKind::LBracket)) => {
                piece.breaks.min(1)
            }
            Some(_) => piece.breaks.min(2),
        }
    }

    /// Four spaces for each line that has left brackets open, and for a statement that goes on; parameters stand below
    /// the first one.
    fn indent(&mut self, before: &Piece<'_>, piece: &Piece<'_>, closes: bool) {
        let open = self.open.get(..self.open.len() - usize::from(closes && !self.open.is_empty())).unwrap_or(&[]);
        let hanging = open.iter().rposition(|o| o.column.is_some());
        let column = hanging.and_then(|at| open.get(at)?.column).unwrap_or(0);
        let inside = open.get(hanging.map_or(0, |at| at + 1)..).unwrap_or(&[]);
        let mut lines: Vec<usize> = inside.iter().map(|o| o.line).collect();
        lines.dedup();
        let in_block = self.open.last().is_none_or(|o| o.kind == TokenKind::LBrace);
        let goes_on = in_block
            && !closes
            && piece.kind.is_some()
            && before.kind.is_some_and(|kind| {
                let ends = matches!(kind, TokenKind::Semi | TokenKind::LBrace | TokenKind::RBrace);
                // An attribute before its item.
                let attribute = kind == TokenKind::RBracket && self.open.is_empty();
                !ends && !attribute
            });
        let steps = lines.len() + usize::from(goes_on);
        self.out.extend(std::iter::repeat_n(' ', column + 4 * steps));
    }
}

const fn is_closer(kind: TokenKind) -> bool {
    matches!(kind, TokenKind::RParen | TokenKind::RBracket | TokenKind::RBrace)
}

/// Whether a token ends an operand, so that a `-` after so many line breaks subtracts.
fn ends_operand(piece: &Piece<'_>, breaks: usize, marks: &Marks) -> bool {
    use TokenKind as T;
    match piece.kind {
        None => false,
        Some(T::Gt) => marks.angles.contains(&piece.start),
        // On a line of its own it begins the value of a block, after a statement.
        Some(T::RBrace) => breaks == 0,
        Some(T::Ident | T::Int | T::Real | T::Index | T::RParen | T::RBracket) => true,
        Some(kind) => matches!(kind, T::True | T::False | T::Inf | T::Pi | T::Euler),
    }
}

/// Whether a space stands between two pieces of one line.
fn spaced(before: &Piece<'_>, piece: &Piece<'_>, around: Option<TokenKind>, marks: &Marks) -> bool {
    use TokenKind as T;
    let (Some(a), Some(b)) = (before.kind, piece.kind) else { return true };
    let angle = |p: &Piece<'_>| marks.angles.contains(&p.start);
    match (a, b) {
        (T::LBrace, T::RBrace) => false,
        (_, T::LBrace) if marks.scoped.contains(&piece.start) => false,
        (T::LBrace, _) | (_, T::LBrace | T::RBrace) => true,
        (T::LParen | T::LBracket | T::Hash | T::Dot | T::ColonColon | T::Not, _) => false,
        (_, T::RParen | T::RBracket | T::Comma | T::Semi | T::Dot | T::ColonColon | T::Colon) => false,
        (T::DotDot, _) => marks.spaced.contains(&before.start),
        (_, T::DotDot) => marks.spaced.contains(&piece.start),
        (T::Lt, _) if angle(before) => false,
        (_, T::Lt | T::Gt) if angle(piece) => false,
        (T::Minus, _) if before.prefix => false,
        (T::Ident | T::Csg, T::LParen) => false,
        (T::RParen, T::LParen) => around != Some(T::LBrace),
        _ => true,
    }
}

/// Whether two tokens would be read as others if nothing stood between them.
fn joins(before: &Piece<'_>, piece: &Piece<'_>) -> bool {
    match (before.kind, piece.kind) {
        (Some(TokenKind::Index), _) | (_, None) | (None, _) => false,
        // `1 .0` is an access.
        (Some(TokenKind::Int), Some(TokenKind::Dot)) => true,
        _ => Lexer::new(&format!("{}{}", before.text, piece.text)).token().end != before.text.len(),
    }
}
