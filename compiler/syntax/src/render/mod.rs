//! Diagnostics as text for a terminal and as JSON for programs. Shows what the diagnostic says and nothing else;
//! any span may be shown, also one that lies outside its file or inside a character.

mod json;
mod terminal;
mod window;

pub use json::json;
pub use terminal::terminal;

/// `start..end` moved into `text`, to boundaries of characters, in order.
fn clamp(text: &str, start: u32, end: u32) -> (usize, usize) {
    let start = text.floor_char_boundary(start as usize);
    let end = text.ceil_char_boundary(end as usize);
    (start, end.max(start))
}
