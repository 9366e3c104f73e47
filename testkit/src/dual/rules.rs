//! The dual oracle's own operations: value, first and second derivatives of each, as a textbook has them, and the
//! conventions of LANGUAGE 13.6 as cases of their own. Deliberately not derived from the op table.

use isograd_graph::Op;

use super::{Arithmetic, Cell, Jet};

/// An operation of `N` operands at a point.
struct Local<const N: usize> {
    value: f64,
    first: [f64; N],
    second: [[f64; N]; N],
    /// Terms that cancel in the first derivatives, for the shaking.
    rough: f64,
    /// Terms that cancel in the second derivatives, for the shaking.
    cancelled: f64,
}

impl Local<1> {
    const fn of(value: f64, first: f64, second: f64) -> Self {
        Self { value, first: [first], second: [[second]], rough: 0.0, cancelled: 0.0 }
    }
}

impl Local<2> {
    /// By the second derivatives f_xx, f_xy, f_yy.
    const fn two(value: f64, first: [f64; 2], [xx, xy, yy]: [f64; 3]) -> Self {
        Self { value, first, second: [[xx, xy], [xy, yy]], rough: 0.0, cancelled: 0.0 }
    }
}

impl<const N: usize> Local<N> {
    const fn rough(mut self, size: f64) -> Self {
        self.rough = size;
        self
    }

    const fn cancelling(mut self, size: f64) -> Self {
        self.cancelled = size;
        self
    }
}

/// Whether a real result of the operation is piecewise constant.
pub const fn is_constant(op: Op) -> bool {
    matches!(op, Op::Floor | Op::Ceil | Op::Trunc | Op::Round | Op::Sign | Op::IntToReal)
}

/// 1/(1 + e⁻ᵘ).
fn logistic(u: f64) -> f64 {
    1.0 / (1.0 + (-u).exp())
}

/// Applies an operation. Operands of other kinds than the operation has count as 0, false or NaN.
pub fn apply(run: &mut Arithmetic, op: Op, x: &[Cell]) -> Cell {
    let real = |i: usize| x.get(i).map_or(Jet::constant(f64::NAN), |c| c.jet());
    let value = |i: usize| real(i).value;
    let int = |i: usize| match x.get(i) {
        Some(Cell::Int(n)) => *n,
        _ => 0,
    };
    let truth = |i: usize| x.get(i) == Some(&Cell::Bool(true));
    let (u, v) = (value(0), value(1));
    match op {
        // Directed rounding: the exact result is the same.
        Op::Add | Op::AddDown | Op::AddUp => rounded(run, [real(0), real(1)], Local::two(u + v, [1.0, 1.0], [0.0; 3])),
        Op::Sub => rounded(run, [real(0), real(1)], Local::two(u - v, [1.0, -1.0], [0.0; 3])),
        Op::Mul | Op::MulDown | Op::MulUp => {
            rounded(run, [real(0), real(1)], Local::two(u * v, [v, u], [0.0, 1.0, 0.0]))
        }
        Op::Div | Op::DivDown | Op::DivUp => rounded(run, [real(0), real(1)], quotient(u, v)),
        Op::Neg => linear(run, real(0), -1.0),
        Op::Sqrt | Op::SqrtDown | Op::SqrtUp => rounded(run, [real(0)], sqrt(u)),
        Op::InverseSqrt => {
            let r = 1.0 / u.sqrt();
            rounded(run, [real(0)], Local::of(r, -0.5 * r / u, 0.75 * r / (u * u)).rough(2.0))
        }
        Op::Abs => {
            let slope = direction(run, u);
            linear_to(run, real(0), u.abs(), slope)
        }
        Op::Min => chosen(run, v < u, real(1), real(0)),
        Op::Max => chosen(run, u < v, real(1), real(0)),
        Op::Fract => {
            run.decide(u.floor().to_bits());
            linear_to(run, real(0), u - u.floor(), 1.0)
        }
        Op::Mod => {
            let whole = (u / v).floor();
            run.decide(whole.to_bits());
            rounded(run, [real(0), real(1)], Local::two(u - v * whole, [1.0, -whole], [0.0; 3]))
        }
        Op::Floor => jump(run, u.floor()),
        Op::Ceil => jump(run, u.ceil()),
        Op::Trunc => jump(run, u.trunc()),
        Op::Round => jump(run, u.round()),
        Op::Sign => {
            let sign = if u > 0.0 {
                1.0
            } else if u < 0.0 {
                -1.0
            } else {
                u
            };
            jump(run, sign)
        }
        Op::Length2 => length(run, [real(0), real(1)]),
        Op::Length3 => length(run, [real(0), real(1), real(2)]),
        Op::Length4 => length(run, [real(0), real(1), real(2), real(3)]),
        Op::Unit => {
            let rule = if v == 0.0 { Local::two(0.0, [0.0; 2], [0.0; 3]) } else { quotient(u, v) };
            rounded(run, [real(0), real(1)], rule)
        }
        Op::Exp => rounded(run, [real(0)], Local::of(u.exp(), u.exp(), u.exp())),
        Op::Exp2 => {
            let (power, log) = (u.exp2(), std::f64::consts::LN_2);
            rounded(run, [real(0)], Local::of(power, power * log, power * log * log))
        }
        Op::Log => rounded(run, [real(0)], Local::of(u.ln(), 1.0 / u, -1.0 / (u * u))),
        Op::Log2 => {
            let slope = 1.0 / (u * std::f64::consts::LN_2);
            rounded(run, [real(0)], Local::of(u.log2(), slope, -slope / u))
        }
        Op::Pow => {
            // A term whose operand is not active is dropped: its formula may be NaN (LANGUAGE 13.5).
            rounded(run, [real(0), real(1)], power(u, v))
        }
        Op::Sin => rounded(run, [real(0)], Local::of(u.sin(), u.cos(), -u.sin())),
        Op::Cos => rounded(run, [real(0)], Local::of(u.cos(), -u.sin(), -u.cos())),
        Op::Tan => {
            let (t, c) = (u.tan(), u.cos());
            rounded(run, [real(0)], Local::of(t, 1.0 / (c * c), 2.0 * t / (c * c)))
        }
        Op::Asin => rounded(run, [real(0)], arcsine(u)),
        Op::Acos => {
            let Local { first: [first], second: [[second]], cancelled, .. } = arcsine(u);
            rounded(run, [real(0)], Local::of(u.acos(), -first, -second).cancelling(cancelled))
        }
        Op::Atan => {
            let s = u.mul_add(u, 1.0);
            rounded(run, [real(0)], Local::of(u.atan(), 1.0 / s, -2.0 * u / (s * s)))
        }
        Op::Atan2 => rounded(run, [real(0), real(1)], angle(u, v)),
        Op::Sinh => rounded(run, [real(0)], Local::of(u.sinh(), u.cosh(), u.sinh())),
        Op::Cosh => rounded(run, [real(0)], Local::of(u.cosh(), u.sinh(), u.cosh())),
        Op::Tanh => {
            let t = u.tanh();
            let slope = (1.0 - t) * (1.0 + t);
            rounded(run, [real(0)], Local::of(t, slope, -2.0 * t * slope).rough(2.0).cancelling(2.0))
        }
        Op::Asinh => {
            let s = u.mul_add(u, 1.0);
            rounded(run, [real(0)], Local::of(u.asinh(), 1.0 / s.sqrt(), -u / (s * s.sqrt())))
        }
        Op::Acosh => rounded(run, [real(0)], arcosine(u)),
        Op::Atanh => {
            let s = (1.0 - u) * (1.0 + u);
            rounded(run, [real(0)], Local::of(u.atanh(), 1.0 / s, 2.0 * u / (s * s)).cancelling(2.0 / (s * s)))
        }
        Op::Softplus => {
            let (share, rest) = (logistic(u), logistic(-u));
            rounded(run, [real(0)], Local::of(u.max(0.0) + (-u.abs()).exp().ln_1p(), share, share * rest))
        }
        Op::Sigmoid => {
            let (share, rest) = (logistic(u), logistic(-u));
            let slope = share * rest;
            rounded(run, [real(0)], Local::of(share, slope, slope * (rest - share)).cancelling(slope))
        }
        Op::Rounded => linear(run, real(0), 1.0),
        Op::NextDown => linear_to(run, real(0), u.next_down(), 1.0),
        Op::NextUp => linear_to(run, real(0), u.next_up(), 1.0),
        Op::Below | Op::Lowered => {
            // What these give of a zero is not said.
            run.doubtful |= truth(1) && u == 0.0;
            linear_to(run, real(0), if truth(1) { u.next_down() } else { u }, 1.0)
        }
        Op::Above | Op::Raised => {
            run.doubtful |= truth(1) && u == 0.0;
            linear_to(run, real(0), if truth(1) { u.next_up() } else { u }, 1.0)
        }
        Op::ProductBelow | Op::WideProductBelow => truth_of(run, u.mul_add(v, -value(2)) < 0.0),
        Op::WideProductAbove => truth_of(run, 0.0 < u.mul_add(v, -value(2))),
        Op::Copysign => {
            let side = if v.is_sign_negative() { -1.0 } else { 1.0 };
            let slope = direction(run, u) * side;
            run.decide(u64::from(v.is_sign_negative()));
            linear_to(run, real(0), u.abs() * side, slope)
        }
        Op::Exponent => Cell::Int(decided(run, exponent(u))),
        Op::Scale => {
            let factor = f64::from(int(1).clamp(-1022, 1023)).exp2();
            linear(run, real(0), factor)
        }
        Op::Lt => truth_of(run, u < v),
        Op::Le => truth_of(run, u <= v),
        Op::Eq => truth_of(run, u == v),
        Op::Ne => truth_of(run, u != v),
        Op::And => Cell::Bool(truth(0) && truth(1)),
        Op::Or => Cell::Bool(truth(0) || truth(1)),
        Op::Not => Cell::Bool(!truth(0)),
        Op::Select => Cell::Real(if truth(0) { real(1) } else { real(2) }),
        Op::SelectInt => Cell::Int(if truth(0) { int(1) } else { int(2) }),
        Op::SelectBool => Cell::Bool(if truth(0) { truth(1) } else { truth(2) }),
        Op::IntAdd => wrapped(i64::from(int(0)) + i64::from(int(1))),
        Op::IntSub => wrapped(i64::from(int(0)) - i64::from(int(1))),
        Op::IntMul => wrapped(i64::from(int(0)) * i64::from(int(1))),
        Op::IntDiv => wrapped(if int(1) == 0 { 0 } else { i64::from(int(0)) / i64::from(int(1)) }),
        Op::IntRem => {
            let (a, b) = (i64::from(int(0)), i64::from(int(1)));
            // Floored: the sign of b (LANGUAGE 4.4).
            let rest = if b == 0 { 0 } else { ((a % b) + b) % b };
            wrapped(rest)
        }
        Op::IntNeg => wrapped(-i64::from(int(0))),
        Op::IntAbs => wrapped(i64::from(int(0)).abs()),
        Op::IntMin => Cell::Int(int(0).min(int(1))),
        Op::IntMax => Cell::Int(int(0).max(int(1))),
        Op::IntSign => Cell::Int(int(0).signum()),
        Op::IntEq => Cell::Bool(int(0) == int(1)),
        Op::IntLt => Cell::Bool(int(0) < int(1)),
        Op::IntLe => Cell::Bool(int(0) <= int(1)),
        Op::IntToReal => Cell::Real(Jet::constant(f64::from(int(0)))),
        #[expect(clippy::cast_possible_truncation, reason = "saturation and 0 for NaN are what the language says")]
        Op::RealToInt => Cell::Int(decided(run, u as i32)),
    }
}

/// The chain rule: f′ = Σ fᵢ·xᵢ′, and by both seeds Σ fᵢ·xᵢ″ + Σᵢⱼ fᵢⱼ·xᵢ′·xⱼ′, over active operands only.
fn rounded<const N: usize>(run: &mut Arithmetic, x: [Jet; N], f: Local<N>) -> Cell {
    let first = |part: fn(&Jet) -> Option<f64>| {
        let mut terms = x.iter().zip(f.first).filter_map(|(x, slope)| part(x).map(|d| slope * d)).peekable();
        let rough: f64 = x.iter().filter_map(part).map(|d| f.rough * d.abs()).sum();
        terms.peek().is_some().then(|| terms.fold((0.0, rough), |(sum, size), t| (sum + t, size + t.abs())))
    };
    let (a, b) = (first(|x| x.a), first(|x| x.b));
    let mut both = first(|x| x.ab);
    for (i, row) in f.second.iter().enumerate() {
        for (j, second) in row.iter().enumerate() {
            if let (Some(da), Some(db)) = (x[i].a, x[j].b)
                && (*second != 0.0 || f.cancelled != 0.0)
            {
                let (sum, size) = both.unwrap_or_default();
                let scale = second.abs().max(f.cancelled.abs());
                both = Some((sum + second * (da * db), size + (scale * da * db).abs()));
            }
        }
    }
    for (i, slope) in f.first.iter().enumerate() {
        let finite = slope.is_finite() && f.second[i].iter().all(|x| x.is_finite());
        run.doubtful |= run.dependent.get(i) == Some(&true) && !finite;
    }
    let value = run.shaken(f.value, f.value);
    let mut part = |p: Option<(f64, f64)>| p.map(|(sum, size)| run.shaken(sum, size));
    Cell::Real(Jet { value, a: part(a), b: part(b), ab: part(both) })
}

/// x times an exact factor.
fn linear(run: &mut Arithmetic, x: Jet, slope: f64) -> Cell {
    linear_to(run, x, slope * x.value, slope)
}

/// `value`, which changes `slope` times as fast as x: ±x, or 0 where a convention says so.
fn linear_to(run: &mut Arithmetic, x: Jet, value: f64, slope: f64) -> Cell {
    run.doubtful |= run.dependent[0] && !slope.is_finite();
    let part = |p: Option<f64>| p.map(|p| slope * p);
    Cell::Real(Jet { value, a: part(x.a), b: part(x.b), ab: part(x.ab) })
}

/// The slope of |x|: 0 in the kink (LANGUAGE 13.6).
fn direction(run: &mut Arithmetic, x: f64) -> f64 {
    let slope = if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else if x == 0.0 {
        0.0
    } else {
        f64::NAN
    };
    run.decide(slope.to_bits());
    slope
}

/// One of two operands, whole: nothing of the other (LANGUAGE 13.7).
fn chosen(run: &mut Arithmetic, second: bool, yes: Jet, no: Jet) -> Cell {
    run.decide(u64::from(second));
    Cell::Real(if second { yes } else { no })
}

/// Piecewise constant: derivative 0 everywhere.
fn jump(run: &mut Arithmetic, value: f64) -> Cell {
    run.decide(value.to_bits());
    Cell::Real(Jet::constant(value))
}

fn decided(run: &mut Arithmetic, value: i32) -> i32 {
    run.decide(u64::from(value.unsigned_abs()) << 1 | u64::from(value < 0));
    value
}

fn truth_of(run: &mut Arithmetic, value: bool) -> Cell {
    run.decide(u64::from(value));
    Cell::Bool(value)
}

/// Modulo 2³².
#[expect(clippy::cast_possible_truncation, reason = "ints wrap")]
const fn wrapped(value: i64) -> Cell {
    Cell::Int(value as i32)
}

/// a/b: ¹⁄ᵦ and −a/b²; 0, −1/b², 2a/b³.
fn quotient(a: f64, b: f64) -> Local<2> {
    let q = a / b;
    Local::two(q, [1.0 / b, -(q / b)], [0.0, -(1.0 / b / b), 2.0 * (q / b / b)])
}

/// ¹⁄₂ₓ√x and −1/(4x√x); all 0 at 0, where the slope is infinite.
fn sqrt(x: f64) -> Local<1> {
    let root = x.sqrt();
    if x == 0.0 { Local::of(root, 0.0, 0.0) } else { Local::of(root, 0.5 / root, -0.25 / (x * root)) }
}

/// ‖x‖: xᵢ/‖x‖ and (δᵢⱼ − xᵢxⱼ/‖x‖²)/‖x‖; all 0 where the length computes 0.
fn length<const N: usize>(run: &mut Arithmetic, x: [Jet; N]) -> Cell {
    let value = x.iter().map(|x| x.value * x.value).sum::<f64>().sqrt();
    let mut f = Local { value, first: [0.0; N], second: [[0.0; N]; N], rough: 0.0, cancelled: 0.0 };
    if value != 0.0 {
        f.cancelled = 1.0 / value;
        f.first = x.map(|x| x.value / value);
        for i in 0..N {
            for j in 0..N {
                let delta = if i == j { 1.0 } else { 0.0 };
                f.second[i][j] = (delta - f.first[i] * f.first[j]) / value;
            }
        }
    }
    rounded(run, x, f)
}

/// aᵇ: b·aᵇ⁻¹ and aᵇ·ln a; b(b−1)·aᵇ⁻², aᵇ⁻¹(1 + b·ln a), aᵇ·ln² a. At a = 0 the slope by a is 0 for 0 ≤ b < 1, and
/// the terms with ln 0 are 0 for b ≥ 0; a convention holds for the derivatives of the derivative too.
fn power(a: f64, b: f64) -> Local<2> {
    let value = a.powf(b);
    // Multiplying by a 0 that belongs to the formula must not meet an infinity that the 0 makes disappear.
    let slope = |e: f64| if a == 0.0 && (0.0..1.0).contains(&e) { 0.0 } else { e * a.powf(e - 1.0) };
    if a == 0.0 && b >= 0.0 {
        let by_a = if b < 1.0 { 0.0 } else { b * slope(b - 1.0) };
        let mixed = if b < 1.0 { 0.0 } else { a.powf(b - 1.0) };
        return Local::two(value, [slope(b), 0.0], [by_a, mixed, 0.0]);
    }
    let log = a.ln();
    let mixed = a.powf(b - 1.0) * (1.0 + b * log);
    let cancelled = a.powf(b - 1.0) * (1.0 + (b * log).abs());
    Local::two(value, [slope(b), value * log], [b * (b - 1.0) * a.powf(b - 2.0), mixed, value * log * log])
        .cancelling(if cancelled.is_finite() { cancelled } else { 0.0 })
}

/// arcsin: 1/√(1−x²) and x/(1−x²)^³ᐟ²; both 0 at ±1, where the slope is infinite.
fn arcsine(x: f64) -> Local<1> {
    let square = (1.0 - x) * (1.0 + x);
    if square == 0.0 {
        return Local::of(x.asin(), 0.0, 0.0);
    }
    let chord = square.sqrt();
    Local::of(x.asin(), 1.0 / chord, x / (square * chord)).cancelling(1.0 / (square * chord))
}

/// arcosh: 1/√(x²−1) and −x/(x²−1)^³ᐟ²; both 0 at 1, where the slope is infinite; NaN below.
fn arcosine(x: f64) -> Local<1> {
    if x == 1.0 {
        return Local::of(0.0, 0.0, 0.0);
    }
    let root = (x - 1.0).sqrt() * (x + 1.0).sqrt();
    Local::of(x.acosh(), 1.0 / root, -x / (root * root * root))
}

/// The angle of (x, y) with h² = x² + y²: x/h², −y/h²; −2xy/h⁴, (y²−x²)/h⁴, 2xy/h⁴; all 0 where h computes 0.
fn angle(y: f64, x: f64) -> Local<2> {
    let h = (y * y + x * x).sqrt();
    let value = y.atan2(x);
    if h == 0.0 {
        return Local::two(value, [0.0; 2], [0.0; 3]);
    }
    let (cosine, sine) = (x / h, y / h);
    let twice = 2.0 * sine * cosine / h / h;
    Local::two(value, [cosine / h, -sine / h], [-twice, (sine * sine - cosine * cosine) / h / h, twice])
        .cancelling(1.0 / h / h)
}

/// ⌊log₂|x|⌋ by comparison with powers of 2.
fn exponent(x: f64) -> i32 {
    let x = x.abs();
    if x < f64::MIN_POSITIVE {
        return -1023;
    }
    if !x.is_finite() {
        return 1024;
    }
    let (mut lo, mut hi) = (-1022, 1024);
    while hi - lo > 1 {
        let middle = lo + (hi - lo) / 2;
        if x >= f64::from(middle).exp2() {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    lo
}
