//! A Kalman filter whose states are the parts of a residual's noise: residuals go in, innovations come out.
//!
//! Under the right model and noise the innovations are independent and each has the variance that it is given with.
//! The covariance is kept as U D Uᵀ, U unit upper triangular and D diagonal, so that it cannot lose its
//! definiteness to rounding, in `f32` and over any number of readings.

use muslip::real::Real;

/// How one part of the noise goes in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind<T> {
    /// An Ornstein-Uhlenbeck process: forgets exponentially, of constant variance.
    Forgetting {
        /// Time in s, > 0, in which its correlation falls to 1/e.
        time_constant_s: T,
    },
    /// Stays what it is over a run.
    Constant,
    /// The level of a balance in integrated form, driven by the noise of the readings that are integrated: a step of
    /// `dt` adds (std dt)². Nothing is known of it at the start. Only as the first part.
    Walk,
    /// As [`Kind::Forgetting`], but not seen itself: it is integrated into the walk, times a known gain.
    Integrated {
        /// Time in s, > 0, in which its correlation falls to 1/e.
        time_constant_s: T,
    },
    /// As [`Kind::Constant`], but integrated into the walk, times a known gain.
    IntegratedConstant,
}

impl<T: Real> Kind<T> {
    fn time_constant_s(self) -> Option<T> {
        match self {
            Self::Forgetting { time_constant_s } | Self::Integrated { time_constant_s } => {
                Some(time_constant_s)
            }
            Self::Constant | Self::Walk | Self::IntegratedConstant => None,
        }
    }

    fn is_integrated(self) -> bool {
        matches!(self, Self::Integrated { .. } | Self::IntegratedConstant)
    }
}

/// One part of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part<T> {
    /// How it goes in time.
    pub kind: Kind<T>,
    /// Its standard deviation, >= 0, in its own unit; of a walk that of one reading of its rate. 0: it is absent.
    pub std: T,
}

/// Why parts make no filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PartError {
    /// A standard deviation is not finite or negative, or its square is not finite.
    Std,
    /// A time constant is not finite and positive.
    TimeConstant,
    /// A walk stands elsewhere than first, or a part is integrated and there is no walk.
    Walk,
}

impl core::fmt::Display for PartError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Std => "a part's standard deviation is outside its range",
            Self::TimeConstant => "a part's time constant is not positive",
            Self::Walk => "a walk is not the first part, or parts are integrated into none",
        })
    }
}

impl core::error::Error for PartError {}

/// One reading against what the readings before it say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<T> {
    /// Reading minus its prediction, in the reading's unit.
    pub value: T,
    /// Variance that it has under the model, in that unit squared, > 0.
    pub variance: T,
    /// False where the gate refused the reading: the filter has not taken it up.
    pub fused: bool,
}

impl<T: Real> Innovation<T> {
    /// The innovation over its standard deviation: of mean 0 and variance 1 under the right model.
    #[inline]
    pub fn normalised(&self) -> T {
        self.value / self.variance.sqrt()
    }
}

/// The filter for `N` parts.
///
/// | symbol | here | shape |
/// |---|---|---|
/// | x | the parts as they are now | N |
/// | P = U D Uᵀ | their covariance | N×N |
/// | Φ | [`predict`](Self::predict): what each part keeps, and what goes into the walk | N×N, upper triangular |
/// | h, r | `row`, `variance` of [`update`](Self::update) | N, scalar |
///
/// ```text
/// predict   x ← Φ x        U D Uᵀ ← Φ U D Uᵀ Φᵀ + Q,   Q = diag(σ² (1 − e^(−2 dt/τ)))
/// update    y = z − h x    s = h U D Uᵀ hᵀ + r         x += P hᵀ y / s
/// ```
///
/// As Φ is upper triangular, Φ U needs no new factorisation; each part's Q is one modification of rank one (W. S.
/// Agee and R. H. Turner, White Sands Missile Range Technical Report 38, 1972) and a reading is taken up by G. J.
/// Bierman, Factorization Methods for Discrete Sequential Estimation, Academic Press 1977, chapter V. Memory: N² + 9 N
/// numbers. Parts that forget are cheapest when they stand first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whitener<T, const N: usize> {
    parts: [Part<T>; N],
    state: [T; N],
    /// Columns of U: of column j what stands above its one, at j.
    columns: [[T; N]; N],
    /// D.
    diagonal: [T; N],
    /// What each part keeps of itself over a step of `step_s`, its inverse, and what that step drives it by.
    kept: [T; N],
    inverse_kept: [T; N],
    driven: [T; N],
    step_s: T,
    level_known: bool,
}

impl<T: Real, const N: usize> Whitener<T, N> {
    /// The filter before its first reading.
    ///
    /// # Errors
    /// [`PartError`] for the first part that is outside its range.
    pub fn new(parts: [Part<T>; N]) -> Result<Self, PartError> {
        let walks = matches!(parts.first(), Some(part) if part.kind == Kind::Walk);
        for (i, part) in parts.iter().enumerate() {
            let in_range = part.std >= T::ZERO && part.std.squared().is_finite();
            if !in_range {
                return Err(PartError::Std);
            }
            if let Some(tau) = part.kind.time_constant_s()
                && !(tau > T::ZERO && tau.is_finite())
            {
                return Err(PartError::TimeConstant);
            }
            let walk = part.kind == Kind::Walk;
            if (walk && i > 0) || (part.kind.is_integrated() && !walks) {
                return Err(PartError::Walk);
            }
        }
        let mut diagonal = [T::ZERO; N];
        for (d, part) in diagonal.iter_mut().zip(&parts) {
            if part.kind != Kind::Walk {
                *d = part.std.squared();
            }
        }
        Ok(Self {
            parts,
            state: [T::ZERO; N],
            columns: [[T::ZERO; N]; N],
            diagonal,
            kept: [T::ONE; N],
            inverse_kept: [T::ONE; N],
            driven: [T::ZERO; N],
            step_s: T::ZERO,
            level_known: false,
        })
    }

    /// The parts as they are thought to be now, each in its own unit.
    pub fn state(&self) -> &[T; N] {
        &self.state
    }

    /// Lets `dt_s` pass, in s, >= 0. What is integrated enters the walk times its gain in `rates` (of other parts
    /// not read), which holds over the step.
    #[inline]
    pub fn predict(&mut self, dt_s: T, rates: &[T; N]) {
        if dt_s != self.step_s {
            self.take_step(dt_s);
        }
        if self.walks() {
            self.integrate(dt_s, rates);
        }
        for (x, kept) in self.state.iter_mut().zip(&self.kept) {
            *x *= *kept;
        }
        let each = self.columns.iter_mut().zip(&mut self.diagonal);
        let each = each.zip(self.kept.iter().zip(&self.inverse_kept));
        for (j, ((column, d), (kept, inverse))) in each.enumerate() {
            // U has a one at j.
            for (u, share) in column.iter_mut().zip(&self.kept).take(j) {
                *u *= *share * *inverse;
            }
            *d *= kept.squared();
        }
        for i in (0..N).rev() {
            self.drive(i);
        }
    }

    /// Moves the level by what is known of it: the integral of readings, or a change of what it is counted from.
    #[inline]
    pub fn shift_level(&mut self, by: T) {
        if let Some(level) = self.state.first_mut() {
            *level += by;
        }
    }

    /// Forgets the level: the next reading only says where it is. Without effect where there is no walk.
    #[inline]
    pub fn forget_level(&mut self) {
        self.level_known = false;
    }

    /// Takes a reading of `row` · parts with noise of `variance` (> 0) up. An innovation beyond `gate_stds` of its
    /// standard deviations is told and not fused. `None` where the reading only says where the level is.
    ///
    /// The row is 1 for a walk, 0 for what is integrated, and for others the gain by which they enter the reading.
    #[inline]
    pub fn update(
        &mut self,
        reading: T,
        row: &[T; N],
        variance: T,
        gate_stds: T,
    ) -> Option<Innovation<T>> {
        if self.walks() && !self.level_known {
            self.find_level(reading, row, variance);
            return None;
        }
        let value = reading - dot(row, &self.state);
        let f = self.project(row);
        let total = variance + self.covariance(&f, &f);
        let fused = value.squared() <= gate_stds.squared() * total;
        if fused {
            let scale = value / total;
            let gain = self.reduce(&f, variance);
            for (x, gain) in self.state.iter_mut().zip(&gain) {
                *x += *gain * scale;
            }
        }
        Some(Innovation {
            value,
            variance: total,
            fused,
        })
    }

    /// What the parts are thought to add to a reading of this row, in the reading's unit.
    #[inline]
    pub fn prediction(&self, row: &[T; N]) -> T {
        dot(row, &self.state)
    }

    /// Covariance of two sums of parts, a P bᵀ: of each other where `a` and `b` are as [`project`](Self::project)
    /// gives them.
    #[inline]
    pub(crate) fn covariance(&self, a: &[T; N], b: &[T; N]) -> T {
        let each = a.iter().zip(b).zip(&self.diagonal);
        each.fold(T::ZERO, |sum, ((a, b), d)| sum + *d * (*a * *b))
    }

    /// Uᵀ rowᵀ.
    #[inline]
    pub(crate) fn project(&self, row: &[T; N]) -> [T; N] {
        let mut out = [T::ZERO; N];
        let each = out.iter_mut().zip(row.iter().zip(&self.columns));
        for (j, (out, (own, column))) in each.enumerate() {
            *out = *own;
            for (u, h) in column.iter().zip(row).take(j) {
                *out += *u * *h;
            }
        }
        out
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        // Nothing times zero but what is not finite leaves a trace; a number too many is no zero.
        let mut sum = T::ZERO;
        for (j, column) in self.columns.iter().enumerate() {
            for u in column.iter().take(j) {
                sum += *u * T::ZERO;
            }
        }
        for (x, d) in self.state.iter().zip(&self.diagonal) {
            sum += *x * T::ZERO + *d * T::ZERO;
        }
        sum == T::ZERO
    }

    fn walks(&self) -> bool {
        matches!(self.parts.first(), Some(part) if part.kind == Kind::Walk)
    }

    /// Lets the walk take up what is integrated over a step, as it is before the step.
    fn integrate(&mut self, dt_s: T, rates: &[T; N]) {
        let mut along = [T::ZERO; N];
        for ((along, part), rate) in along.iter_mut().zip(&self.parts).zip(rates) {
            if part.kind.is_integrated() {
                *along = *rate * dt_s;
            }
        }
        self.shift_level(dot(&along, &self.state));
        for (j, (column, own)) in self.columns.iter_mut().zip(&along).enumerate().skip(1) {
            let entering = column.iter().zip(&along).take(j);
            let entering = entering.fold(*own, |sum, (u, along)| sum + *u * *along);
            if let Some(level) = column.first_mut() {
                *level += entering;
            }
        }
    }

    /// What a step of time makes of each part.
    fn take_step(&mut self, dt_s: T) {
        self.step_s = dt_s;
        let each = self.kept.iter_mut().zip(&mut self.inverse_kept);
        for ((part, driven), (kept, inverse)) in self.parts.iter().zip(&mut self.driven).zip(each) {
            let variance = part.std.squared();
            match part.kind.time_constant_s() {
                Some(tau) => {
                    // What is below any digit is left at a size whose inverse, and its powers, are finite.
                    *kept = Real::max((-(dt_s / tau)).exp(), T::EPSILON);
                    *inverse = T::ONE / *kept;
                    // 1 − e^(−2t) as (1 − e^−t)(1 + e^−t): half of the digits lost.
                    *driven = variance * ((T::ONE - *kept) * (T::ONE + *kept));
                }
                None if part.kind == Kind::Walk => *driven = variance * dt_s.squared(),
                None => *driven = T::ZERO,
            }
        }
    }

    /// Adds what drives one part to its variance: U D Uᵀ + q e eᵀ.
    ///
    /// Written so that nothing cancels: what a column keeps is a quotient of variances and not one less another.
    fn drive(&mut self, index: usize) {
        let mut left = self.driven.get(index).copied().unwrap_or(T::ZERO);
        if left <= T::ZERO {
            return;
        }
        let mut direction = [T::ZERO; N];
        if let Some(own) = direction.get_mut(index) {
            *own = T::ONE;
        }
        let each = self.columns.iter_mut().zip(&mut self.diagonal).enumerate();
        for (j, (column, d)) in each.rev().skip(N - 1 - index) {
            let a = direction.get(j).copied().unwrap_or(T::ZERO);
            let after = *d + left * a * a;
            if after <= T::ZERO {
                continue;
            }
            let inverse = T::ONE / after;
            let (keeps, takes) = (*d * inverse, left * a * inverse);
            *d = after;
            left *= keeps;
            for (u, b) in column.iter_mut().zip(&mut direction).take(j) {
                let before = *u;
                *u = keeps * before + takes * *b;
                *b -= a * before;
            }
        }
    }

    /// A reading's reduction of the covariance; P hᵀ as it was before.
    fn reduce(&mut self, f: &[T; N], variance: T) -> [T; N] {
        let mut gain = [T::ZERO; N];
        let mut alpha = variance;
        let mut inverse = T::ONE / variance;
        let each = self.columns.iter_mut().zip(&mut self.diagonal);
        for (j, ((column, d), f)) in each.zip(f).enumerate() {
            let v = *d * *f;
            let lambda = -*f * inverse;
            let before = alpha;
            alpha += *f * v;
            inverse = T::ONE / alpha;
            *d *= before * inverse;
            for (u, gain) in column.iter_mut().zip(&mut gain).take(j) {
                let old = *u;
                *u = old + *gain * lambda;
                *gain += old * v;
            }
            if let Some(own) = gain.get_mut(j) {
                *own = v;
            }
        }
        gain
    }

    /// The limit of an update from a level of infinite variance: level = reading − the other parts − noise.
    fn find_level(&mut self, reading: T, row: &[T; N], variance: T) {
        if let Some(level) = self.state.first_mut() {
            *level = T::ZERO;
        }
        self.shift_level(reading - dot(row, &self.state));
        for (j, (column, own)) in self.columns.iter_mut().zip(row).enumerate().skip(1) {
            let others = column.iter().zip(row).take(j).skip(1);
            let entering = others.fold(*own, |sum, (u, h)| sum + *u * *h);
            if let Some(level) = column.first_mut() {
                *level = -entering;
            }
        }
        if let Some(d) = self.diagonal.first_mut() {
            *d = variance;
        }
        self.level_known = true;
    }
}

#[inline]
fn dot<T: Real, const N: usize>(a: &[T; N], b: &[T; N]) -> T {
    a.iter().zip(b).fold(T::ZERO, |sum, (a, b)| sum + *a * *b)
}
