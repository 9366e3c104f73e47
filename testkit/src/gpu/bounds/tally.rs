//! Counts of verdicts. Knows nothing of how they come about.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::AddAssign;

use super::Verdict;

/// How many points had which verdict.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tally {
    /// Within the bounds, ambiguous points included.
    pub within: usize,
    /// Of those: points where rounding decides between results, one of which was met.
    pub ambiguous: usize,
    /// Outside of them.
    pub outside: usize,
    /// With too many choices to be judged.
    pub unjudged: usize,
    /// Not judged, by rule.
    pub special: BTreeMap<&'static str, usize>,
    ratios: Vec<f64>,
    ulps: Vec<f64>,
}

impl Tally {
    /// Counts a verdict.
    pub fn add(&mut self, verdict: &Verdict) {
        match verdict {
            Verdict::Within { ratio, ulps, ambiguous } => {
                self.within += 1;
                self.ambiguous += usize::from(*ambiguous);
                self.ratios.push(*ratio);
                self.ulps.push(*ulps);
            }
            Verdict::Outside { .. } => self.outside += 1,
            Verdict::Ambiguous => self.unjudged += 1,
            Verdict::Special(rule) => *self.special.entry(rule).or_default() += 1,
        }
    }

    /// All points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.within + self.outside + self.unjudged + self.special.values().sum::<usize>()
    }

    /// The largest ratio of a point within the bounds.
    #[must_use]
    pub fn worst(&self) -> f64 {
        self.ratios.iter().fold(0.0, |a, b| a.max(*b))
    }

    /// The ratio that a share of the points within the bounds does not exceed.
    #[must_use]
    pub fn ratio(&self, share: f64) -> f64 {
        quantile(&self.ratios, share)
    }

    /// The bound, in units in the last place, that a share of the points does not exceed.
    #[must_use]
    pub fn ulps(&self, share: f64) -> f64 {
        quantile(&self.ulps, share)
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "a place")]
fn quantile(all: &[f64], share: f64) -> f64 {
    let mut all = all.to_vec();
    all.sort_by(f64::total_cmp);
    let place = (share * all.len().saturating_sub(1) as f64) as usize;
    all.get(place).copied().unwrap_or(0.0)
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.within += other.within;
        self.ambiguous += other.ambiguous;
        self.outside += other.outside;
        self.unjudged += other.unjudged;
        for (rule, n) in other.special {
            *self.special.entry(rule).or_default() += n;
        }
        self.ratios.extend(other.ratios);
        self.ulps.extend(other.ulps);
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} points: {} within ({} ambiguous), {} outside, {} with too many choices; ratio median {:.3} worst {:.3}, \
             bound median {:.1} ulp, 90 % {:.0} ulp",
            self.points(),
            self.within,
            self.ambiguous,
            self.outside,
            self.unjudged,
            self.ratio(0.5),
            self.worst(),
            self.ulps(0.5),
            self.ulps(0.9),
        )?;
        for (rule, n) in &self.special {
            write!(f, "; not judged by rule: {rule} {n}")?;
        }
        Ok(())
    }
}
