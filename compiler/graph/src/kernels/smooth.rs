//! ln(1 + eˣ) and 1/(1 + e⁻ˣ) by e^−|x|, which never overflows. Knows nothing of what they smooth.

use super::exp::{exp_reduced, log_1p, times_power_of_two};
use super::write::{Real, write};
use crate::{Builder, NodeId, Precision};

/// ln(1 + eˣ) = ln(1 + e^−|x|), plus x where x is positive.
pub fn softplus(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let rest = log_1p(falling(x), x.constant(0.0), None);
        x.less(0.0).select(rest, x + rest)
    })
}

/// 1/(1 + e⁻ˣ) = 1/(1 + u) for positive x and u/(1 + u) for negative, u = e^−|x|. What rounding takes from 1 + u is given
/// back, because where u just exceeds a power of two its error counts double in the result.
pub fn sigmoid(b: &mut Builder<'_>, args: &[NodeId], p: Precision) -> NodeId {
    write(b, args, p, |[x]| {
        let u = falling(x);
        let sum = 1.0 + u;
        let rest = u - (sum - 1.0);
        let quotient = x.less(0.0).select(u, 1.0) / sum;
        quotient - quotient * (rest / sum)
    })
}

/// e^−|x|, from 1 down to 0.
fn falling(x: Real<'_>) -> Real<'_> {
    let (power, k) = exp_reduced((-x.abs()).at_least(x.by(-104.0, -746.0)));
    times_power_of_two(power, k)
}
