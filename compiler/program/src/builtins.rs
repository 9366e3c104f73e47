//! The built-in functions of LANGUAGE 5: name, group, signature and meaning, one line each. What they lower to is
//! the elaborator's business.

/// Where a built-in stands in the look-up order of LANGUAGE 6.3.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Group {
    /// Wins over a user function of that name (5.1).
    Core,
    /// Loses to a user function of that name (5.2).
    Extension,
}

macro_rules! builtins {
    ($( $id:ident $name:literal $group:ident $signature:literal $doc:literal; )+) => {
        /// A built-in function, `diff` and `bound` excepted, which are instructions of their own.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Builtin { $( #[doc = $doc] $id, )+ }

        impl Builtin {
            /// All of them.
            pub const ALL: &'static [Self] = &[ $( Self::$id, )+ ];

            /// Its name.
            #[must_use]
            pub const fn name(self) -> &'static str { match self { $( Self::$id => $name, )+ } }

            /// Where it stands in the look-up order.
            #[must_use]
            pub const fn group(self) -> Group { match self { $( Self::$id => Group::$group, )+ } }

            /// Its signature for messages; R real, V vector of reals, I int or vector of ints.
            #[must_use]
            pub const fn signature(self) -> &'static str { match self { $( Self::$id => $signature, )+ } }
        }
    };
}

builtins! {
    Dot "dot" Core "dot(V, V) -> R, also quat" "Σ aᵢbᵢ";
    Cross "cross" Core "cross(vec3, vec3) -> vec3" "the cross product";
    Length "length" Core "length(V) -> R, also quat" "√(a·a)";
    Sqrt "sqrt" Core "sqrt(R | V)" "the square root";
    Exp "exp" Core "exp(R | V)" "eᵃ";
    Pow "pow" Core "pow(R, R) | pow(V, V)" "aᵇ";
    Min "min" Core "min(R | V | I, same)" "if b < a then b else a";
    Max "max" Core "max(R | V | I, same)" "if a < b then b else a";
    Clamp "clamp" Core "clamp(x, lo, hi), all R | V | I" "min(max(x, lo), hi)";
    Mix "mix" Core "mix(a, b, t), all R | V" "a(1−t) + bt";
    Lerp "lerp" Core "lerp(a, b, t), all R | V" "a(1−t) + bt";
    Mod "mod" Core "mod(R | V | I, same)" "a − b⌊a/b⌋";
    Fract "fract" Core "fract(R | V)" "a − ⌊a⌋";
    Abs "abs" Core "abs(R | V | I)" "the magnitude";
    Floor "floor" Core "floor(R | V)" "⌊a⌋";
    Ceil "ceil" Core "ceil(R | V)" "⌈a⌉";
    Round "round" Core "round(R | V)" "the nearest integer, ties away from zero";
    Sin "sin" Core "sin(R | V)" "sine";
    Cos "cos" Core "cos(R | V)" "cosine";
    Tan "tan" Core "tan(R | V)" "tangent";
    Asin "asin" Core "asin(R | V)" "arc sine";
    Acos "acos" Core "acos(R | V)" "arc cosine";
    Atan "atan" Core "atan(R | V)" "arc tangent";
    Sinh "sinh" Core "sinh(R | V)" "hyperbolic sine";
    Cosh "cosh" Core "cosh(R | V)" "hyperbolic cosine";
    Tanh "tanh" Core "tanh(R | V)" "hyperbolic tangent";
    Asinh "asinh" Core "asinh(R | V)" "inverse hyperbolic sine";
    Acosh "acosh" Core "acosh(R | V)" "inverse hyperbolic cosine";
    Atanh "atanh" Core "atanh(R | V)" "inverse hyperbolic tangent";
    Atan2 "atan2" Core "atan2(y: R, x: R) -> R" "the angle of the point (x, y)";
    Inverse "inverse" Core "inverse(matN) -> matN, also quat" "the matrix whose product with m is 1";
    Invert "invert" Core "invert(matN) -> matN, also quat" "the same as `inverse`";
    Normalize "normalize" Extension "normalize(V) -> V, also quat" "a / ‖a‖, 0 where ‖a‖ computes 0";
    Distance "distance" Extension "distance(V, V) -> R" "‖a − b‖";
    Reflect "reflect" Extension "reflect(V, V) -> V" "i − 2n(n·i)";
    Sign "sign" Extension "sign(R | V | I)" "1 above 0, −1 below 0, else a itself";
    Step "step" Extension "step(edge, x), both R | V" "0 if x < edge, else 1";
    Smoothstep "smoothstep" Extension "smoothstep(e0, e1, x), all R | V" "t²(3 − 2t), t = saturate((x−e0)/(e1−e0))";
    Saturate "saturate" Extension "saturate(R | V)" "clamp(a, 0, 1)";
    Trunc "trunc" Extension "trunc(R | V)" "toward zero";
    Log "log" Extension "log(R | V)" "the natural logarithm";
    Log2 "log2" Extension "log2(R | V)" "the logarithm to the base 2";
    Exp2 "exp2" Extension "exp2(R | V)" "2ᵃ";
    InverseSqrt "inversesqrt" Extension "inversesqrt(R | V)" "1/√a";
    Transpose "transpose" Extension "transpose(matWxH) -> matHxW" "rows as columns";
    Determinant "determinant" Extension "determinant(matN) -> R" "expansion along row 0";
    Quat "quat" Extension "quat(x, y, z, w) | quat(axis: vec3, angle: R)" "a quaternion";
    Conjugate "conjugate" Extension "conjugate(quat) -> quat" "(−u, w)";
    Rotate "rotate" Extension "rotate(quat, vec3) -> vec3" "v + 2 u×(u×v + wv)";
    ToMat3 "to_mat3" Extension "to_mat3(quat) -> mat3" "columns rotate(q, eₓ), rotate(q, e_y), rotate(q, e_z)";
}
