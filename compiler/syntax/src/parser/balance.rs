//! Which syntax errors of an item are guesses: where brackets do not match, only the first error tells what is wrong.
//! Looks at brackets, semicolons and nothing else; so it knows no grammar but that of a splat.

use super::{K, Parser};
use crate::Code;
use crate::lexer::Token;

/// Ranges of an item's text in which brackets do not match.
pub(super) enum Balance {
    /// Nowhere; or in these, which end with their statements, and in no other.
    Statements(Vec<(usize, usize)>),
    /// Braces do not match, so that no statement is certain.
    Nowhere,
}

/// A bracket that is open: what closes it, and where it is.
type Open = (K, usize);

impl Parser<'_> {
    /// How the brackets from `start` to here match.
    pub(super) fn balance(&self, start: usize) -> Balance {
        let mut open: Vec<Open> = Vec::new();
        let mut wrong: Vec<(usize, usize)> = Vec::new();
        // Where this statement begins, and whether a bracket of it was closed that is not open.
        let (mut begin, mut stray) = (start, false);
        let tokens: Vec<Token> = self.tokens_in(start, self.previous.end).collect();
        for (at, token) in tokens.iter().enumerate() {
            match token.kind {
                K::LParen => open.push((K::RParen, token.start)),
                K::LBracket => open.push((K::RBracket, token.start)),
                K::RParen | K::RBracket => {
                    stray |= open.last().is_none_or(|(close, _)| *close != token.kind);
                    if inner(&open).any(|(close, _)| *close == token.kind) {
                        while open.pop().is_some_and(|(close, _)| close != token.kind) {}
                    }
                }
                K::Semi if open.last().is_some_and(|(close, _)| is_splat(*close, tokens.get(at + 1..))) => {}
                K::Semi | K::LBrace | K::RBrace => {
                    let unclosed = if token.kind == K::LBrace { None } else { inner(&open).last().map(|(_, b)| *b) };
                    if stray || unclosed.is_some() {
                        let from = if stray { begin } else { usize::MAX };
                        wrong.push((from.min(unclosed.unwrap_or(begin)), token.end));
                    }
                    if token.kind != K::LBrace {
                        while open.pop_if(|(close, _)| *close != K::RBrace).is_some() {}
                    }
                    match token.kind {
                        K::LBrace => open.push((K::RBrace, token.start)),
                        K::RBrace if open.pop().is_none() => return Balance::Nowhere,
                        _ => {}
                    }
                    (begin, stray) = (token.end, false);
                }
                _ => {}
            }
        }
        if open.iter().any(|(close, _)| *close == K::RBrace) {
            return Balance::Nowhere;
        }
        if stray || !open.is_empty() {
            let from = if stray { begin } else { usize::MAX };
            wrong.push((from.min(open.first().map_or(begin, |(_, b)| *b)), self.previous.end));
        }
        Balance::Statements(wrong)
    }

    /// Of the errors from `first` on, which belong to one item, keeps one syntax error of each range that is wrong.
    pub(super) fn drop_guesses(&mut self, first: usize, balance: &Balance) {
        let mut errors = self.diagnostics.split_off(first.min(self.diagnostics.len()));
        errors.sort_by_key(|d| d.labels.first().map(|l| l.span.start));
        let mut told: Vec<(usize, usize)> = Vec::new();
        errors.retain(|d| {
            let at = d.labels.first().map_or(0, |l| l.span.start as usize);
            let range = match balance {
                Balance::Nowhere => Some((0, usize::MAX)),
                Balance::Statements(wrong) => wrong.iter().copied().find(|(start, end)| (*start..=*end).contains(&at)),
            };
            let syntax = [Code::E0201, Code::E0202, Code::E0203, Code::E0205, Code::E0206].contains(&d.code);
            let Some(range) = range.filter(|_| syntax) else { return true };
            let new = !told.contains(&range);
            told.push(range);
            new
        });
        self.diagnostics.extend(errors);
    }
}

/// Whether a `;` in a bracket that ends with `close` is that of a splat: an integer comes next, or the bracket ends
/// before anything that could end a statement.
fn is_splat(close: K, rest: Option<&[Token]>) -> bool {
    let rest = rest.unwrap_or_default();
    if close != K::RBrace && rest.first().is_some_and(|t| t.kind == K::Int) {
        return true;
    }
    let mut inside = 0_u64;
    for token in rest {
        match token.kind {
            K::LParen | K::LBracket => inside += 1,
            K::RParen | K::RBracket if inside > 0 => inside -= 1,
            K::RBracket => return close == K::RBracket,
            K::RParen | K::Semi | K::LBrace | K::RBrace | K::Let | K::Csg => return false,
            _ => {}
        }
    }
    false
}

/// The brackets that are open inside of the innermost open brace, the innermost first.
fn inner(open: &[Open]) -> impl Iterator<Item = &Open> {
    open.iter().rev().take_while(|(close, _)| *close != K::RBrace)
}
