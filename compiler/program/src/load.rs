//! Modules: from an entry file to all files of a program and its libraries, each read and parsed once
//! (LANGUAGE 10.1 to 10.4). Does no input or output itself and knows nothing of what the items in a file mean.

use std::collections::{BTreeMap, VecDeque};

use isograd_syntax::{
    Code, Diagnostic, FileId, Files, Limits, Span,
    tree::{Ident, ItemKind, Tree},
};

use crate::suggest::similar;

/// Where a file is, without file system: `library` is the root, or the directory of the entry file if there is none;
/// from there `ups` directories up, then down along `path`, whose last element is the file without `.vola`.
/// `module self::super::a::b;` in the entry file is `ups` 1 and `path` `["a", "b"]`. Two equal paths are one file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModulePath {
    /// The canonical name of the library; `None` for files of the program.
    pub library: Option<String>,
    /// Directories above the root; always 0 in a library.
    pub ups: u32,
    /// Directories, then the file's stem.
    pub path: Vec<String>,
}

/// What the host knows about files. Implementations decide where libraries are and which directories may be read.
pub trait Loader {
    /// The registered libraries, for messages and for rule 10.2.3; aliases are names of their own.
    fn libraries(&self) -> Vec<String>;

    /// The one name of a library that has several (`stdlib` is `std`), so that its files are loaded once.
    fn canonical(&self, library: &str) -> String {
        library.to_owned()
    }

    /// The one spelling of a path that can be written in several ways, where the host knows better: a program in
    /// `d/` may reach its own file as `self::super::d::file`.
    fn resolve(&self, at: ModulePath) -> ModulePath {
        at
    }

    /// Whether a program may read there at all; a host may confine programs to a directory (LANGUAGE 10.3).
    fn allows(&self, _at: &ModulePath) -> bool {
        true
    }

    /// The bytes of a file, or a sentence that says what was tried and why it failed.
    ///
    /// # Errors
    /// If there is no such file or it cannot be read.
    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String>;
}

/// A file of the program or of a library.
#[derive(Debug, Clone, PartialEq)]
pub struct Module {
    /// Its text.
    pub file: FileId,
    /// Its tree; empty if the text could not be read.
    pub tree: Tree,
    /// The library it belongs to; `None` for the program.
    pub library: Option<String>,
    /// Where it is.
    pub path: ModulePath,
    /// The modules it imports, as indices of [`Loaded::modules`], in source order; those that failed are left out.
    pub imports: Vec<usize>,
    /// Whether it imports something that could not be loaded, so that names it uses may be declared there.
    pub incomplete: bool,
}

/// All files that a program consists of. If `diagnostics` holds an error, some items may be missing or incomplete;
/// modules and trees know which.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loaded {
    /// The texts.
    pub files: Files,
    /// The modules, the entry file first, then in the order of their first import, breadth first.
    pub modules: Vec<Module>,
    /// What is wrong with texts, syntax and imports, by file.
    pub diagnostics: Vec<Diagnostic>,
}

/// Loads and parses the entry file and everything it reaches. `entry_name` is shown in diagnostics and gives the
/// directory for the names of the other files; the loader is not asked for the entry file.
#[must_use]
pub fn load(entry_name: &str, entry: Vec<u8>, loader: &dyn Loader, limits: &Limits) -> Loaded {
    let libraries = loader.libraries();
    let mut state =
        State { entry_name, loader, limits, libraries, loaded: Loaded::default(), known: BTreeMap::new(), bytes: 0 };
    let stem = entry_name.rsplit(['/', '\\']).next().unwrap_or(entry_name);
    let stem = stem.strip_suffix(".vola").unwrap_or(stem);
    let at = loader.resolve(ModulePath { library: None, ups: 0, path: vec![stem.to_owned()] });
    let mut queue = VecDeque::new();
    queue.extend(state.add(at, entry_name.to_owned(), entry, None));
    while let Some(index) = queue.pop_front() {
        if !state.follow(index, &mut queue) {
            state.loaded.modules.iter_mut().for_each(|m| m.incomplete = true);
            break;
        }
    }
    let mut loaded = state.loaded;
    loaded.diagnostics.sort_by_key(|d| d.labels.first().map(|l| (l.span.file, l.span.start)));
    loaded
}

struct State<'a> {
    entry_name: &'a str,
    loader: &'a dyn Loader,
    limits: &'a Limits,
    libraries: Vec<String>,
    loaded: Loaded,
    /// Every path asked for, with its module if it could be read.
    known: BTreeMap<ModulePath, Option<usize>>,
    bytes: u64,
}

impl State<'_> {
    /// Loads what a module imports; false if a limit of the whole program is reached.
    fn follow(&mut self, index: usize, queue: &mut VecDeque<usize>) -> bool {
        let Some(module) = self.loaded.modules.get(index) else { return true };
        let from = module.path.clone();
        let imports: Vec<(Vec<Ident>, Span)> = module
            .tree
            .items
            .iter()
            .filter_map(|item| match &item.kind {
                ItemKind::Module { path } => Some((path.clone(), item.span)),
                _ => None,
            })
            .collect();
        for (path, span) in imports {
            let at = match self.locate(&from, &path, span) {
                Ok(at) => at,
                Err(diagnostic) => {
                    self.loaded.diagnostics.push(*diagnostic);
                    self.incomplete(index);
                    continue;
                }
            };
            let target = match self.known.get(&at) {
                Some(known) => *known,
                None => {
                    if self.loaded.modules.len() as u64 >= self.limits.modules {
                        self.too_many_modules(span);
                        return false;
                    }
                    let target = self.read(&at, &path, span);
                    if self.bytes > self.limits.total_source_bytes {
                        return false;
                    }
                    queue.extend(target);
                    target
                }
            };
            match (target, self.loaded.modules.get_mut(index)) {
                (Some(target), Some(module)) => module.imports.push(target),
                _ => self.incomplete(index),
            }
        }
        true
    }

    fn incomplete(&mut self, index: usize) {
        if let Some(module) = self.loaded.modules.get_mut(index) {
            module.incomplete = true;
        }
    }

    /// The rules of LANGUAGE 10.2. A path without `self` whose first element is no library is relative to the
    /// importing file (10.2.4).
    fn locate(&self, from: &ModulePath, path: &[Ident], span: Span) -> Result<ModulePath, Box<Diagnostic>> {
        let malformed = |at: Span, message: &str| {
            Box::new(Diagnostic::new(Code::E0308, at, message).help(
                "a path is `self::…::file`, `self::super::…::file` or `library::…::file`, where `…` are directories",
            ))
        };
        let Some(first) = path.first() else { return Err(malformed(span, "a module path needs a file")) };
        let mut at = ModulePath { library: from.library.clone(), ups: from.ups, path: from.path.clone() };
        at.path.pop();
        let mut rest = path;
        if first.text == "self" {
            rest = path.get(1..).unwrap_or(&[]);
        } else if path.len() > 1 && self.libraries.contains(&first.text) {
            at = ModulePath { library: Some(self.loader.canonical(&first.text)), ups: 0, path: Vec::new() };
            rest = path.get(1..).unwrap_or(&[]);
            if let Some(up) = rest.first().filter(|e| e.text == "super") {
                return Err(malformed(up.span, "`super` may not follow a library"));
            }
        }
        let names = rest.iter().skip_while(|e| e.text == "super");
        for element in rest.iter().take_while(|e| e.text == "super") {
            if at.path.pop().is_some() {
                continue;
            }
            if let Some(library) = &at.library {
                let message = format!("this path leaves the directory of the library `{library}`");
                return Err(malformed(element.span, &message));
            }
            at.ups = at.ups.saturating_add(1);
        }
        let depth = at.path.len();
        for element in names {
            if element.text == "super" || element.text == "self" {
                let message = format!("`{}` may stand at the start of a module path only", element.text);
                return Err(malformed(element.span, &message));
            }
            at.path.push(element.text.clone());
        }
        if at.path.len() == depth {
            return Err(malformed(span, "this path names a directory, not a file"));
        }
        let at = self.loader.resolve(at);
        if !self.loader.allows(&at) {
            let message = format!("`{}` is outside of the directory that may be read", self.display(&at));
            return Err(Box::new(
                Diagnostic::new(Code::E0308, span, message).help("move the file into the program's directory"),
            ));
        }
        Ok(at)
    }

    fn read(&mut self, at: &ModulePath, path: &[Ident], span: Span) -> Option<usize> {
        match self.loader.read(at) {
            Ok(bytes) => {
                let name = self.display(at);
                self.add(at.clone(), name, bytes, Some(span))
            }
            Err(tried) => {
                self.known.insert(at.clone(), None);
                let diagnostic = self.not_found(at, path, span, tried);
                self.loaded.diagnostics.push(diagnostic);
                None
            }
        }
    }

    fn not_found(&self, at: &ModulePath, path: &[Ident], span: Span, tried: String) -> Diagnostic {
        let first = path.first().map_or("", |e| e.text.as_str());
        let registered = match self.libraries.as_slice() {
            [] => "no library is registered".to_owned(),
            names => format!("registered libraries: {}", names.join(", ")),
        };
        let shown = self.display(at);
        if first != "self" && first != "super" && path.len() > 1 && !self.libraries.iter().any(|l| l == first) {
            let place = path.first().map_or(span, |e| e.span);
            let near = similar(first, self.libraries.iter().map(String::as_str));
            let help = match near.first() {
                Some(near) => format!("did you mean `{near}`?"),
                None => "register the library, or write `self::` in front for a file of your own".to_owned(),
            };
            return Diagnostic::new(Code::E0306, place, format!("there is no library `{first}`"))
                .note(format!("without a library of that name the path means `{shown}`, which was not found either"))
                .note(registered)
                .help(help);
        }
        let place = path.first().zip(path.last()).map_or(span, |(first, last)| first.span.to(last.span));
        let diagnostic = Diagnostic::new(Code::E0307, place, format!("module file `{shown}` not found"))
            .here("imported here")
            .note(tried);
        if path.len() == 1 && self.libraries.iter().any(|l| l == first) {
            return diagnostic
                .note(registered)
                .help(format!("a library is imported file by file: `module {first}::prelude;`"));
        }
        let help = match at.library {
            Some(_) => "check the spelling: the library has no such file",
            None => "check the spelling, or add the file; `self` is the directory of the importing file",
        };
        diagnostic.note(registered).help(help)
    }

    /// Adds a file that has been read; `None` if its text cannot be used.
    fn add(&mut self, at: ModulePath, name: String, mut bytes: Vec<u8>, importer: Option<Span>) -> Option<usize> {
        let size = bytes.len() as u64;
        let oversized = size > self.limits.source_bytes;
        self.bytes = self.bytes.saturating_add(size);
        let spent = self.bytes > self.limits.total_source_bytes;
        if oversized || spent {
            self.loaded.files.add(name.clone(), "");
            self.known.insert(at, None);
            self.loaded.diagnostics.push(if oversized {
                too_large(Code::E1001, importer, &name, size, "source_bytes", self.limits.source_bytes)
            } else {
                too_large(
                    Code::E1002,
                    importer,
                    &name,
                    self.bytes,
                    "total_source_bytes",
                    self.limits.total_source_bytes,
                )
            });
            return None;
        }
        let mark = if bytes.starts_with(&[0xEF, 0xBB, 0xBF]) { 3 } else { 0 };
        bytes.drain(..mark);
        let text = match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => {
                self.known.insert(at, None);
                self.not_utf8(name, &error, mark, importer);
                return None;
            }
        };
        let file = self.loaded.files.add(name, text);
        let text = self.loaded.files.get(file).map_or("", |f| f.text.as_str());
        let parsed = isograd_syntax::parse(file, text, self.limits);
        self.loaded.diagnostics.extend(parsed.diagnostics);
        let index = self.loaded.modules.len();
        self.known.insert(at.clone(), Some(index));
        let library = at.library.clone();
        let module = Module { file, tree: parsed.tree, library, path: at, imports: Vec::new(), incomplete: false };
        self.loaded.modules.push(module);
        Some(index)
    }

    /// Keeps the readable part of the text, so that the place of the first bad byte can be shown.
    fn not_utf8(&mut self, name: String, error: &std::string::FromUtf8Error, mark: usize, importer: Option<Span>) {
        let valid = error.utf8_error().valid_up_to();
        let prefix = error.as_bytes().get(..valid).and_then(|b| std::str::from_utf8(b).ok()).unwrap_or("");
        let message = format!("`{name}` is not UTF-8: byte {} starts no character", valid + mark);
        let file = self.loaded.files.add(name, prefix);
        let end = u32::try_from(valid).unwrap_or(u32::MAX);
        let mut diagnostic = Diagnostic::new(Code::E0101, Span::new(file, end, end), message)
            .here("the text before this place is readable")
            .help("save the file as UTF-8");
        if let Some(span) = importer {
            diagnostic = diagnostic.label(span, "imported here");
        }
        self.loaded.diagnostics.push(diagnostic);
    }

    fn too_many_modules(&mut self, span: Span) {
        let limit = self.limits.modules;
        self.loaded.diagnostics.push(
            Diagnostic::new(Code::E1003, span, format!("the program has more than {limit} files"))
                .help("put several items into one file, or raise the limit `modules`"),
        );
    }

    /// The file name as the user would write it, seen from where the entry file's name is seen from.
    fn display(&self, at: &ModulePath) -> String {
        let mut parts: Vec<&str> = match &at.library {
            Some(library) => vec![library],
            None => self.entry_name.split('/').collect(),
        };
        if at.library.is_none() {
            parts.pop();
        }
        for _ in 0..at.ups {
            match parts.last() {
                None | Some(&("" | "." | "..")) => parts.push(".."),
                Some(_) => {
                    parts.pop();
                }
            }
        }
        parts.extend(at.path.iter().map(String::as_str));
        format!("{}.vola", parts.join("/"))
    }
}

/// At the import; the entry file has none, and its text is not kept.
fn too_large(code: Code, importer: Option<Span>, name: &str, size: u64, limit: &str, value: u64) -> Diagnostic {
    let message = match code {
        Code::E1001 => format!("`{name}` has {size} bytes, more than the {value} allowed"),
        _ => format!("with `{name}` the sources have {size} bytes, more than the {value} allowed"),
    };
    let diagnostic = match importer {
        Some(span) => Diagnostic::new(code, span, message).here("imported here"),
        None => Diagnostic::global(code, message),
    };
    diagnostic.help(format!("make the program smaller, or raise the limit `{limit}`"))
}
