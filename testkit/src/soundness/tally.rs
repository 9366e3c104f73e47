//! What a soundness run counts. Knows nothing of what is enclosed.

/// Counts of boxes of one subject.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tally {
    /// Boxes enclosed.
    pub boxes: u64,
    /// Points compared with an enclosure.
    pub samples: u64,
    /// Values that were not enclosed.
    pub escapes: u64,
    /// Enclosures that may be NaN.
    pub flagged: u64,
    /// Those of them over boxes of finite numbers.
    pub flagged_finite: u64,
    /// Values that are NaN, of finite operands.
    pub nan: u64,
    /// Values that were not enclosed after an overflow or underflow on the way, which LANGUAGE 15.4 leaves open.
    pub open: u64,
    logarithms: f64,
    ratios: u64,
}

impl Tally {
    /// Adds how much wider an enclosure is than the hull of what was sampled, if both have a width.
    pub fn measure(&mut self, enclosure: (f64, f64), hull: (f64, f64)) {
        let (wide, narrow) = (enclosure.1 - enclosure.0, hull.1 - hull.0);
        let ratio = wide / narrow;
        if narrow > 0.0 && wide > 0.0 && ratio.is_finite() {
            self.logarithms += ratio.ln();
            self.ratios += 1;
        }
    }

    /// The geometric mean of these ratios.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "far below 2⁵³")]
    pub fn tightness(&self) -> Option<f64> {
        (self.ratios > 0).then(|| (self.logarithms / self.ratios as f64).exp())
    }

    /// Both together.
    pub fn add(&mut self, other: &Self) {
        self.boxes += other.boxes;
        self.samples += other.samples;
        self.escapes += other.escapes;
        self.flagged += other.flagged;
        self.flagged_finite += other.flagged_finite;
        self.nan += other.nan;
        self.open += other.open;
        self.logarithms += other.logarithms;
        self.ratios += other.ratios;
    }
}
