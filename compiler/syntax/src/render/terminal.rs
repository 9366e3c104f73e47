//! Diagnostics as text with the source lines they are about, drawn by `annotate-snippets`.
//! Decides what is shown; knows nothing of terminals but whether they have colours.

use annotate_snippets::{AnnotationKind, Element, Group, Level, Origin, Renderer, Snippet, normalize_untrusted_str};

use super::clamp;
use super::window::windows;
use crate::{Diagnostic, FileId, Files, Label, Severity};

/// Longer messages are cut: they may quote what a user wrote.
const LONG_MESSAGE: usize = 1000;

/// The diagnostics one after the other, an empty line after each.
#[must_use]
pub fn terminal(diagnostics: &[Diagnostic], files: &Files, color: bool) -> String {
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    let mut out = String::new();
    for diagnostic in diagnostics {
        out.push_str(&one(diagnostic, files, &renderer));
        out.push_str("\n\n");
    }
    out
}

fn one(diagnostic: &Diagnostic, files: &Files, renderer: &Renderer) -> String {
    let level = match diagnostic.code.severity() {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let title = level.primary_title(clip(&diagnostic.message)).id(diagnostic.code.name());
    let mut group = Group::with_title(title);
    for file in files_of(diagnostic) {
        group = group.elements(snippets(diagnostic, files, file));
    }
    for note in &diagnostic.notes {
        group = group.element(Level::NOTE.message(normalize_untrusted_str(&clip(note))));
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(normalize_untrusted_str(&clip(help))));
    }
    renderer.render(&[group])
}

/// The files of the labels, that of the primary one first.
fn files_of(diagnostic: &Diagnostic) -> Vec<FileId> {
    let mut ids = Vec::new();
    for label in &diagnostic.labels {
        if !ids.contains(&label.span.file) {
            ids.push(label.span.file);
        }
    }
    ids
}

fn snippets(diagnostic: &Diagnostic, files: &Files, id: FileId) -> Vec<Element<'static>> {
    let Some(file) = files.get(id) else { return Vec::new() };
    let labels: Vec<(usize, &Label)> =
        diagnostic.labels.iter().enumerate().filter(|(_, label)| label.span.file == id).collect();
    let places: Vec<_> = labels
        .iter()
        .map(|(_, label)| {
            let (start, end) = clamp(&file.text, label.span.start, label.span.end);
            start..end
        })
        .collect();
    let mut elements = Vec::new();
    for (k, window) in windows(&file.text, &places).into_iter().enumerate() {
        let mut path = (k == 0).then(|| file.name.clone());
        if window.cut && path.is_some() {
            let first = places.first().map_or(0, |p| u32::try_from(p.start).unwrap_or(u32::MAX));
            let (line, column) = files.position(id, first);
            elements.push(Origin::path(path.take().unwrap_or_default()).line(line).char_column(column).into());
        }
        let mut snippet = Snippet::source(window.text).line_start(window.first_line).path(path);
        for (place, range) in window.places {
            let Some((index, label)) = labels.get(place) else { continue };
            let kind = if *index == 0 { AnnotationKind::Primary } else { AnnotationKind::Context };
            let text = if label.text.is_empty() { None } else { Some(clip(&label.text)) };
            snippet = snippet.annotation(kind.span(range).label(text));
        }
        elements.push(snippet.into());
    }
    elements
}

fn clip(text: &str) -> String {
    match text.get(..text.floor_char_boundary(LONG_MESSAGE)) {
        Some(head) if head.len() < text.len() => format!("{head}…"),
        _ => text.to_owned(),
    }
}
