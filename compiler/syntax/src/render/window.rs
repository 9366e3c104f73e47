//! The part of a file that is worth showing around some places: whole lines if they are short, pieces if not.
//! Knows offsets only; keeps the renderer's work small whatever the file looks like.

use std::ops::Range;

/// Lines longer than this many bytes are cut around the places.
const LONG_LINE: usize = 400;
/// What is kept of a long line on both sides of a place.
const CONTEXT: usize = 60;
/// Lines shown of a place that spans many: the first and the last.
const LONG_PLACE: usize = 40;
/// Places further apart than this many lines get windows of their own.
const FAR: usize = 100;

/// Text cut out of a file.
#[derive(Debug)]
pub(super) struct Window {
    /// What is shown.
    pub text: String,
    /// The number of the first line, from 1.
    pub first_line: usize,
    /// Whether a line was cut, so that columns are not those of the file.
    pub cut: bool,
    /// Pieces of the file and where they are in `text`.
    pieces: Vec<(Range<usize>, usize)>,
    /// Index of each place (as given to [`windows`]) and where it is in `text`.
    pub places: Vec<(usize, Range<usize>)>,
}

/// Cuts windows out of `text`, so that each of `places` (in bounds, at character boundaries) is in one. The window
/// of the first place comes first, the others in the order of the text.
pub(super) fn windows(text: &str, places: &[Range<usize>]) -> Vec<Window> {
    let mut sorted: Vec<(usize, Range<usize>)> =
        places.iter().map(|place| shown(text, place.clone())).enumerate().collect();
    sorted.sort_by_key(|(_, place)| (place.start, place.end));
    let mut groups: Vec<Vec<(usize, Range<usize>)>> = Vec::new();
    let mut reach = 0;
    for (index, place) in sorted {
        let near = text.get(reach..place.start.max(reach)).is_some_and(|t| lines(t) <= FAR);
        reach = reach.max(place.end);
        match groups.last_mut() {
            Some(group) if near => group.push((index, place)),
            _ => groups.push(vec![(index, place)]),
        }
    }
    groups.sort_by_key(|group| group.iter().all(|(index, _)| *index != 0));
    groups.into_iter().map(|group| window(text, group)).collect()
}

/// A place as it is shown: the end of a file rather than the empty line after it, the first line of very many.
fn shown(text: &str, place: Range<usize>) -> Range<usize> {
    let written = text.trim_end().len();
    if place.start >= written && place.start == place.end {
        return written..written;
    }
    let inside = text.get(place.clone()).unwrap_or("");
    if lines(inside) <= LONG_PLACE {
        return place;
    }
    let line = inside.split('\n').next().unwrap_or("").trim_end_matches('\r');
    place.start..place.start + line.len()
}

fn lines(text: &str) -> usize {
    text.bytes().filter(|b| *b == b'\n').count()
}

fn window(text: &str, places: Vec<(usize, Range<usize>)>) -> Window {
    let first = places.iter().map(|(_, p)| p.start).min().unwrap_or(0);
    let last = places.iter().map(|(_, p)| p.end).max().unwrap_or(0);
    let start = text.get(..first).and_then(|t| t.rfind('\n')).map_or(0, |at| at + 1);
    let end = text.get(last..).and_then(|t| t.find('\n')).map_or(text.len(), |at| last + at);
    let first_line = text.get(..start).map_or(1, |t| lines(t) + 1);
    let mut window = Window { text: String::new(), first_line, cut: false, pieces: Vec::new(), places: Vec::new() };
    let mut at = start;
    for line in text.get(start..end).unwrap_or("").split('\n') {
        if at > start {
            window.text.push('\n');
        }
        let content = line.trim_end_matches('\r');
        if content.len() <= LONG_LINE {
            window.piece(text, at..at + content.len());
        } else {
            window.long_line(text, at..at + content.len(), &places);
        }
        at += line.len() + 1;
    }
    window.places = places.into_iter().map(|(index, p)| (index, window.find(p.start)..window.find(p.end))).collect();
    window
}

impl Window {
    fn piece(&mut self, text: &str, range: Range<usize>) {
        self.pieces.push((range.clone(), self.text.len()));
        self.text.push_str(text.get(range).unwrap_or(""));
    }

    /// Keeps what is near the ends of places.
    fn long_line(&mut self, text: &str, line: Range<usize>, places: &[(usize, Range<usize>)]) {
        self.cut = true;
        let mut keep: Vec<Range<usize>> = Vec::new();
        let mut ends: Vec<usize> = places.iter().flat_map(|(_, p)| [p.start, p.end]).collect();
        ends.retain(|at| line.contains(at) || *at == line.end);
        ends.push(line.start);
        ends.sort_unstable();
        for at in ends {
            let from = text.floor_char_boundary(at.saturating_sub(CONTEXT)).max(line.start);
            let to = text.ceil_char_boundary(at + CONTEXT).min(line.end);
            match keep.last_mut() {
                Some(previous) if previous.end >= from => previous.end = previous.end.max(to),
                _ => keep.push(from..to),
            }
        }
        let mut end = line.start;
        for range in keep {
            if range.start > end {
                self.text.push_str(" … ");
            }
            end = range.end;
            self.piece(text, range);
        }
        if end < line.end {
            self.text.push_str(" …");
        }
    }

    /// Where a byte of the file is in the window; for one that was cut out, where it would be.
    fn find(&self, at: usize) -> usize {
        let next = self.pieces.partition_point(|(range, _)| range.start <= at);
        match next.checked_sub(1).and_then(|k| self.pieces.get(k)) {
            Some((range, start)) => start + (at.min(range.end) - range.start),
            None => 0,
        }
    }
}
