//! Text to tokens (LANGUAGE 1), one at a time and from any place, because a type may take half of a `>=`.
//! Knows characters; knows nothing of grammar, and reports nothing: what starts no token is a token of its own.

macro_rules! tokens {
    (keywords { $( $keyword:ident $word:literal )+ } punctuation { $( $mark:ident $chars:literal )+ }) => {
        /// What a token is.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum TokenKind {
            $( #[doc = concat!("`", $word, "`")] $keyword, )+
            $( #[doc = concat!("`", $chars, "`")] $mark, )+
            /// A name.
            Ident,
            /// Digits, at most 2147483647.
            Int,
            /// A number with a fraction or an exponent.
            Real,
            /// Digits after a single `.` (LANGUAGE 1.8.2).
            Index,
            /// Characters that form no token.
            Bad(Fault),
            /// The end of the file.
            End,
        }

        impl TokenKind {
            /// Every keyword (LANGUAGE 1.5) with its word.
            pub const KEYWORDS: &'static [(Self, &'static str)] = &[ $( (Self::$keyword, $word), )+ ];

            /// The characters of a keyword or of punctuation; a description of any other kind.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self {
                    $( Self::$keyword => $word, )+
                    $( Self::$mark => $chars, )+
                    Self::Ident => "identifier",
                    Self::Int | Self::Real => "number",
                    Self::Index => "index",
                    Self::Bad(_) => "characters that form no token",
                    Self::End => "end of the file",
                }
            }

            /// Whether it is a word that is never an identifier.
            #[must_use]
            pub const fn is_keyword(self) -> bool {
                matches!(self, $( Self::$keyword )|+)
            }
        }

        fn keyword(word: &str) -> Option<TokenKind> {
            match word {
                $( $word => Some(TokenKind::$keyword), )+
                _ => None,
            }
        }
    };
}

tokens! {
    keywords {
        Module "module" Entity "entity" Operation "operation" Concept "concept" Impl "impl" For "for" Fn "fn"
        Export "export" Let "let" Csg "csg" Eval "eval" If "if" Else "else" In "in" True "true" False "false"
        Inf "INF" Pi "PI" Euler "EULER"
    }
    punctuation {
        LParen "(" RParen ")" LBrace "{" RBrace "}" LBracket "[" RBracket "]" Lt "<" Gt ">" Comma "," Semi ";"
        Colon ":" ColonColon "::" Dot "." DotDot ".." Arrow "->" Assign "=" EqEq "==" NotEq "!=" Le "<=" Ge ">="
        Plus "+" Minus "-" Star "*" Slash "/" Percent "%" Not "!" AndAnd "&&" OrOr "||" Hash "#"
    }
}

/// Why characters form no token.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fault {
    /// Nothing starts with them (E0102).
    Characters,
    /// A number of none of the forms of LANGUAGE 1.6 (E0103).
    Number,
    /// An integer literal above 2147483647 (E0104).
    IntTooLarge,
}

/// A token: what and where, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Token {
    /// What it is.
    pub kind: TokenKind,
    /// The first byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

/// A position in a text, between tokens.
#[derive(Debug, Clone)]
pub struct Lexer<'a> {
    text: &'a str,
    position: usize,
    after_dot: bool,
}

impl<'a> Lexer<'a> {
    /// Starts at the beginning, after a byte order mark if there is one.
    #[must_use]
    pub fn new(text: &'a str) -> Self {
        let position = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        Self { text, position, after_dot: false }
    }

    /// Goes to `position`, which is between tokens and not after a single dot.
    pub fn seek(&mut self, position: usize) {
        self.position = position;
        self.after_dot = false;
    }

    /// The next token; at the end of the text [`TokenKind::End`], as often as asked.
    pub fn token(&mut self) -> Token {
        self.skip_trivia();
        let start = self.position;
        let kind = match self.peek() {
            None => TokenKind::End,
            Some(c) if c.is_ascii_digit() => self.number(),
            Some(c) if starts_identifier(c) => {
                self.skip_while(continues_identifier);
                keyword(self.text.get(start..self.position).unwrap_or("")).unwrap_or(TokenKind::Ident)
            }
            Some(_) => match punctuation(self.rest()) {
                Some(kind) => {
                    self.position += kind.text().len();
                    kind
                }
                None => self.bad_characters(),
            },
        };
        self.after_dot = kind == TokenKind::Dot;
        Token { kind, start, end: self.position }
    }

    fn rest(&self) -> &'a str {
        self.text.get(self.position..).unwrap_or("")
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn byte(&self, ahead: usize) -> u8 {
        self.text.as_bytes().get(self.position + ahead).copied().unwrap_or(0)
    }

    fn skip_while(&mut self, accept: impl Fn(char) -> bool) {
        let rest = self.rest();
        self.position += rest.find(|c| !accept(c)).unwrap_or(rest.len());
    }

    /// White space and comments (LANGUAGE 1.1 and 1.2).
    fn skip_trivia(&mut self) {
        loop {
            self.skip_while(is_space);
            if !self.rest().starts_with("//") {
                return;
            }
            self.skip_while(|c| c != '\n');
        }
    }

    fn digits(&mut self) {
        self.skip_while(|c| c.is_ascii_digit() || c == '_');
    }

    /// A number of LANGUAGE 1.6, or an index if it stands after a dot; the first character is a digit.
    fn number(&mut self) -> TokenKind {
        let start = self.position;
        if self.after_dot {
            self.skip_while(|c| c.is_ascii_digit());
            return self.number_end(TokenKind::Index);
        }
        self.digits();
        let mut kind = TokenKind::Int;
        if self.byte(0) == b'.' {
            if self.byte(1).is_ascii_digit() {
                self.position += 1;
                self.digits();
                kind = TokenKind::Real;
            } else if self.rest().chars().nth(1).is_none_or(|c| c != '.' && !starts_identifier(c)) {
                self.position += 1;
                return TokenKind::Bad(Fault::Number);
            }
        }
        if matches!(self.byte(0), b'e' | b'E') {
            let sign = usize::from(matches!(self.byte(1), b'+' | b'-'));
            self.position += 1 + sign;
            if !self.byte(0).is_ascii_digit() {
                self.skip_while(continues_identifier);
                return TokenKind::Bad(Fault::Number);
            }
            self.digits();
            kind = TokenKind::Real;
        }
        let kind = self.number_end(kind);
        let written = self.text.get(start..self.position).unwrap_or("");
        if kind == TokenKind::Int && int_value(written).is_none() { TokenKind::Bad(Fault::IntTooLarge) } else { kind }
    }

    /// A number ends where no character of a name follows.
    fn number_end(&mut self, kind: TokenKind) -> TokenKind {
        let end = self.position;
        self.skip_while(continues_identifier);
        if self.position == end { kind } else { TokenKind::Bad(Fault::Number) }
    }

    /// A run of characters that start no token. A string or character literal is taken whole, so that the words in
    /// it are not read as code.
    fn bad_characters(&mut self) -> TokenKind {
        while let Some(c) = self.peek() {
            if is_space(c)
                || c.is_ascii_digit()
                || starts_identifier(c)
                || self.rest().starts_with("//")
                || punctuation(self.rest()).is_some()
            {
                break;
            }
            self.position += c.len_utf8();
            if c == '"' || c == '\'' {
                let mut line = self.rest().char_indices().take_while(|(_, d)| *d != '\n');
                let close = if c == '"' { line.find(|(_, d)| *d == c) } else { line.take(3).find(|(_, d)| *d == c) };
                self.position += close.map_or(0, |(at, _)| at + 1);
            }
        }
        TokenKind::Bad(Fault::Characters)
    }
}

/// The value of an integer literal, if it is small enough.
#[must_use]
pub fn int_value(written: &str) -> Option<i32> {
    written.bytes().filter(|b| *b != b'_').try_fold(0_i32, |value, digit| {
        value.checked_mul(10)?.checked_add(i32::from(digit.checked_sub(b'0').filter(|d| *d < 10)?))
    })
}

/// The value of a real literal: the nearest f64.
#[must_use]
pub fn real_value(written: &str) -> Option<f64> {
    written.replace('_', "").parse().ok()
}

/// Space, tab, CR and LF.
fn is_space(c: char) -> bool {
    matches!(c, ' ' | '\t' | '\r' | '\n')
}

fn starts_identifier(c: char) -> bool {
    c == '_' || unicode_ident::is_xid_start(c)
}

fn continues_identifier(c: char) -> bool {
    unicode_ident::is_xid_continue(c)
}

/// The longest punctuation that `rest` starts with.
fn punctuation(rest: &str) -> Option<TokenKind> {
    use TokenKind as K;
    let mut bytes = rest.bytes();
    let (first, second) = (bytes.next()?, bytes.next().unwrap_or(0));
    Some(match (first, second) {
        (b':', b':') => K::ColonColon,
        (b'.', b'.') => K::DotDot,
        (b'-', b'>') => K::Arrow,
        (b'=', b'=') => K::EqEq,
        (b'!', b'=') => K::NotEq,
        (b'<', b'=') => K::Le,
        (b'>', b'=') => K::Ge,
        (b'&', b'&') => K::AndAnd,
        (b'|', b'|') => K::OrOr,
        (b'(', _) => K::LParen,
        (b')', _) => K::RParen,
        (b'{', _) => K::LBrace,
        (b'}', _) => K::RBrace,
        (b'[', _) => K::LBracket,
        (b']', _) => K::RBracket,
        (b'<', _) => K::Lt,
        (b'>', _) => K::Gt,
        (b',', _) => K::Comma,
        (b';', _) => K::Semi,
        (b':', _) => K::Colon,
        (b'.', _) => K::Dot,
        (b'=', _) => K::Assign,
        (b'+', _) => K::Plus,
        (b'-', _) => K::Minus,
        (b'*', _) => K::Star,
        (b'/', _) => K::Slash,
        (b'%', _) => K::Percent,
        (b'!', _) => K::Not,
        (b'#', _) => K::Hash,
        _ => return None,
    })
}
