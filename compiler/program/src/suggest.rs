//! Similar names for "did you mean". Knows characters only, not what a name stands for.

/// The candidates most similar to `name`, all equally near, at most three.
pub(crate) fn similar<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let wanted: Vec<char> = name.chars().collect();
    if wanted.is_empty() || wanted.len() > LONGEST {
        return Vec::new();
    }
    let most = (wanted.len() / 3).max(1);
    let mut found: Vec<(usize, &str)> = candidates
        .into_iter()
        .filter(|c| *c != name)
        .filter_map(|c| {
            if c.len() > 4 * LONGEST {
                return None;
            }
            if c.to_lowercase() == name.to_lowercase() {
                return Some((0, c));
            }
            let letters: Vec<char> = c.chars().collect();
            if letters.len().abs_diff(wanted.len()) > most {
                return None;
            }
            let d = distance(&wanted, &letters);
            (d <= most && d < wanted.len().max(letters.len())).then_some((d, c))
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    let least = found.first().map_or(0, |(d, _)| *d);
    found.into_iter().take_while(|(d, _)| *d == least).take(3).map(|(_, c)| c).collect()
}

/// Longer names are compared with nothing, so that hostile sources cost no time.
const LONGEST: usize = 64;

/// The number of insertions, deletions, replacements and exchanges of neighbours that lead from a to b
/// (optimal string alignment).
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut row = vec![i + 1];
        for (j, y) in b.iter().enumerate() {
            let at = |row: &[usize], k: usize| row.get(k).copied().unwrap_or(usize::MAX / 2);
            let mut best = (at(&last, j) + usize::from(x != y)).min(at(&last, j + 1) + 1).min(at(&row, j) + 1);
            let swapped = i > 0 && j > 0 && a.get(i - 1) == Some(y) && b.get(j - 1) == Some(x);
            if swapped {
                best = best.min(at(&before, j - 1) + 1);
            }
            row.push(best);
        }
        before = std::mem::replace(&mut last, row);
    }
    last.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::similar;

    #[test]
    fn near_names_are_found_and_far_ones_are_not() {
        assert_eq!(similar("lenght", ["length", "light", "dot"]), ["length"]);
        assert_eq!(similar("sphere", ["Sphere", "spheres"]), ["Sphere"]);
        assert_eq!(similar("y", ["x"]), Vec::<&str>::new());
        assert_eq!(similar("radus", ["radius", "x"]), ["radius"]);
        assert_eq!(similar(&"a".repeat(100), ["a"]), Vec::<&str>::new());
    }
}
