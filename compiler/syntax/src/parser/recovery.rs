//! Where to go on after an error: the next element, the next statement, the next block, the next item.
//! Every function here only consumes tokens, each once, so that recovery is linear; none of them reports.

use super::{Abort, K, Parse, Parser};

impl Parser<'_> {
    /// Whether an item starts at the current token, which is possible nowhere inside an item.
    pub(super) fn at_item(&mut self) -> bool {
        let next = match self.kind() {
            K::Module | K::Entity | K::Operation | K::Concept | K::Impl | K::Fn | K::Export | K::Hash => {
                self.peek(1).kind
            }
            _ => return false,
        };
        if self.at(K::Hash) { next == K::LBracket } else { next == K::Ident || next.is_keyword() }
    }

    /// Whether no bracket but a block can still be open at the current token.
    pub(super) fn ends_brackets(&mut self) -> bool {
        let next = self.peek(1).kind;
        match self.kind() {
            K::Semi | K::RBrace | K::End => true,
            K::Let | K::Csg => next == K::Ident || next.is_keyword(),
            _ => self.at_item(),
        }
    }

    /// Whether the `;` at the current token is that of a splat.
    fn at_splat(&mut self) -> bool {
        self.at(K::Semi) && self.peek(1).kind == K::Int && self.peek(2).kind == K::RBracket
    }

    /// What is wrong at the current token follows from what was reported.
    fn quiet(&mut self) {
        self.quiet_at = Some(self.current().start);
    }

    /// Consumes one token, or a bracket with all that is in it. Stops early where an item starts.
    pub(super) fn skip_balanced(&mut self) {
        let mut open = 0_u64;
        loop {
            match self.kind() {
                K::LParen | K::LBracket | K::LBrace => open += 1,
                K::RParen | K::RBracket | K::RBrace => open = open.saturating_sub(1),
                K::End => return self.quiet(),
                _ if open > 0 && self.at_item() => return self.quiet(),
                _ => {}
            }
            self.bump();
            if open == 0 {
                return;
            }
        }
    }

    /// To the next `,` or to `close`, of this bracket; fails where the bracket cannot go on.
    pub(super) fn sync_list(&mut self, close: K) -> Parse<()> {
        loop {
            let kind = self.kind();
            if kind == K::Comma || kind == close {
                return Ok(());
            }
            if self.at_enclosing_closer() || (self.ends_brackets() && !(close == K::RBracket && self.at_splat())) {
                self.quiet();
                return Err(Abort);
            }
            self.skip_balanced();
        }
    }

    /// To the `{` of the block that follows a broken head.
    pub(super) fn sync_block(&mut self) -> Parse<()> {
        while !self.at(K::LBrace) {
            if self.at_enclosing_closer() || self.ends_brackets() {
                self.quiet();
                return Err(Abort);
            }
            self.skip_balanced();
        }
        Ok(())
    }

    /// To the end of the statement or of the bracket around it.
    pub(super) fn skip_to_end(&mut self) {
        while !self.at_enclosing_closer() && !self.ends_brackets() {
            self.skip_balanced();
        }
        self.quiet();
    }

    fn at_enclosing_closer(&mut self) -> bool {
        let kind = self.kind();
        matches!(kind, K::RParen | K::RBracket) && self.closers.contains(&kind)
    }

    /// To the next statement: after a `;`, before the `}` of this block, before a word that starts a statement.
    pub(super) fn sync_statement(&mut self) {
        let mut braces = 0_u64;
        loop {
            match self.kind() {
                K::End => return self.quiet(),
                _ if self.at_item() => return self.quiet(),
                K::RBrace if braces == 0 => return self.quiet(),
                K::Semi if braces == 0 && !self.at_splat() => {
                    self.bump();
                    return;
                }
                K::Let | K::If | K::For if braces == 0 => return,
                K::Csg if braces == 0 && self.peek(1).kind == K::Ident => return,
                K::LBrace => braces += 1,
                K::RBrace => braces -= 1,
                _ => {}
            }
            let block_ends = self.bump().kind == K::RBrace && braces == 0;
            if block_ends && matches!(self.kind(), K::Ident | K::Eval) {
                return;
            }
        }
    }

    /// To the next item.
    pub(super) fn sync_item(&mut self) {
        let mut braces = 0_u64;
        while !(self.at_item() || self.at(K::End) || (braces == 0 && self.at_define())) {
            match self.bump().kind {
                K::LBrace => braces += 1,
                K::RBrace => braces = braces.saturating_sub(1),
                _ => {}
            }
        }
        self.quiet();
    }
}
