//! Random boxes and values inside of them. Knows no operation.

use isograd_graph::{Precision, Scalar, Value};

use super::{INF, NAN};

/// `SplitMix64`: seeded points.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// From 0 to 1.
    pub fn part(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}

pub fn special(r: &mut Random, p: Precision) -> f64 {
    let (most, least) = match p {
        Precision::F32 => (f64::from(f32::MAX), f64::from(f32::MIN_POSITIVE)),
        Precision::F64 => (f64::MAX, f64::MIN_POSITIVE),
    };
    let tiny = next_up(p, 0.0);
    let x = r.of(&[0.0, tiny, 3.0 * tiny, least, most, 0.5, 1.0, next_up(p, 1.0), 1.5, 2.0, 3.0, INF]);
    if r.one_in(2) { x } else { -x }
}

pub fn next_up(p: Precision, x: f64) -> f64 {
    match p {
        Precision::F32 => f64::from((x as f32).next_up()),
        Precision::F64 => x.next_up(),
    }
}

pub fn next_down(p: Precision, x: f64) -> f64 {
    -next_up(p, -x)
}

/// What an operand is taken from.
#[derive(Clone, Copy, Debug)]
pub enum Box {
    Real { lo: f64, hi: f64, nan: bool },
    Int(i32, i32),
    Bool { yes: bool, no: bool },
}

impl Box {
    pub fn random(r: &mut Random, scalar: Scalar, domain: (f64, f64), p: Precision) -> Self {
        match scalar {
            Scalar::Real => {
                let (lo, hi) = real_box(r, domain, p);
                Self::Real { lo, hi, nan: r.one_in(8) }
            }
            Scalar::Int => {
                let (x, y) = (some_int(r, domain), some_int(r, domain));
                let y = if r.one_in(4) { x } else { y };
                Self::Int(x.min(y), x.max(y))
            }
            Scalar::Bool => {
                let yes = r.one_in(2);
                Self::Bool { yes, no: !yes || r.one_in(2) }
            }
        }
    }

    /// The ends of this box, if the other is of its kind.
    pub fn like(&self, other: Self) -> Self {
        match (*self, other) {
            (Self::Real { lo, hi, .. }, Self::Real { nan, .. }) => Self::Real { lo, hi, nan },
            (Self::Int(..), Self::Int(..)) => *self,
            _ => other,
        }
    }

    /// Values inside; the ends first.
    pub fn samples(&self, r: &mut Random, others: &[Self], p: Precision) -> Vec<Value> {
        match *self {
            Self::Real { lo, hi, nan } => {
                let mut inside = vec![lo, hi];
                let (near, far) = (lo.clamp(-1e30, 1e30), hi.clamp(-1e30, 1e30));
                let mut candidates = vec![0.0, -0.0, near + (far - near) * r.part(), special(r, p)];
                candidates.push(r.of(&[
                    lo / 2.0 + hi / 2.0,
                    lo.floor() + 0.5,
                    lo.ceil(),
                    next_up(p, lo),
                    next_down(p, hi),
                ]));
                for other in others {
                    if let Self::Real { lo, hi, .. } = other {
                        candidates.extend([*lo, *hi]);
                    }
                }
                for x in candidates {
                    let x = p.round(x);
                    if lo <= x && x <= hi && !inside.iter().any(|y| y.to_bits() == x.to_bits()) {
                        inside.push(x);
                    }
                }
                if lo.to_bits() == hi.to_bits() {
                    inside.remove(1);
                }
                if nan {
                    inside.push(NAN);
                }
                inside.into_iter().map(Value::Real).collect()
            }
            Self::Int(lo, hi) => {
                let mut inside = vec![lo, hi];
                let mut candidates = vec![0, 1, -1, i32::MIN, i32::MAX, lo.wrapping_add(1), hi.wrapping_sub(1)];
                candidates.extend(
                    (0..4).map(|_| (i64::from(lo) + ((i64::from(hi) - i64::from(lo)) as f64 * r.part()) as i64) as i32),
                );
                for other in others {
                    if let Self::Int(lo, hi) = other {
                        candidates.extend([*lo, *hi]);
                    }
                }
                inside.extend(candidates.into_iter().filter(|x| lo < *x && *x < hi));
                inside.sort_unstable();
                inside.dedup();
                inside.into_iter().map(Value::Int).collect()
            }
            Self::Bool { yes, no } => {
                [(yes, true), (no, false)].iter().filter(|(may, _)| *may).map(|(_, x)| Value::Bool(*x)).collect()
            }
        }
    }

    pub fn inputs(&self, to: &mut Vec<Value>) {
        match *self {
            Self::Real { lo, hi, nan } => to.extend([Value::Real(lo), Value::Real(hi), Value::Bool(nan)]),
            Self::Int(lo, hi) => to.extend([Value::Int(lo), Value::Int(hi)]),
            Self::Bool { yes, no } => to.extend([Value::Bool(yes), Value::Bool(no)]),
        }
    }
}

pub fn some_real(r: &mut Random, domain: (f64, f64), p: Precision) -> f64 {
    let x = match r.below(5) {
        0 => special(r, p),
        1 => (domain.0 + (domain.1 - domain.0) * r.part()).round(),
        2 => match p {
            Precision::F32 => f64::from(f32::from_bits(r.bits() as u32)),
            Precision::F64 => f64::from_bits(r.bits()),
        },
        _ => domain.0 + (domain.1 - domain.0) * r.part(),
    };
    if x.is_nan() { 1.0 } else { p.round(x) }
}

pub fn real_box(r: &mut Random, domain: (f64, f64), p: Precision) -> (f64, f64) {
    let (x, y) = (some_real(r, domain, p), some_real(r, domain, p));
    match r.below(8) {
        0 => (x, x),
        1 => (x, next_up(p, next_up(p, x))),
        2 => (-x.abs(), y.abs()),
        3 => (x, INF),
        4 => (-INF, x),
        _ => (x.min(y), x.max(y)),
    }
}

pub fn some_int(r: &mut Random, domain: (f64, f64)) -> i32 {
    match r.below(4) {
        0 => r.of(&[0, 1, -1, 2, -2, i32::MAX, i32::MIN, i32::MAX - 1, i32::MIN + 1, 46341, 1 << 24, (1 << 24) + 1]),
        1 => r.bits() as i32,
        _ => (domain.0 + (domain.1 - domain.0) * r.part()) as i32,
    }
}
