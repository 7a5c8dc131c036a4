//! Noble numbers, which are badly approximated by fractions, and bounds for sums of small divisors.

use super::ball::{Ball, BallCentre, BallOf};
use super::number::Number;
use super::rounded::{down, up};
use crate::error::Error;

/// The noble number [0; a₁, …, a_r, 1, 1, …]: a continued fraction that ends in ones.
///
/// Noble numbers are irrational, and Diophantine: |kω − m| ≥ γ/k for all integers k ≥ 1 and m, with a γ > 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NobleNumber {
    quotients: Vec<u32>,
}

/// The most quotients before the ones, and the largest of them.
const MOST_QUOTIENTS: usize = 24;
const LARGEST_QUOTIENT: u32 = 1_000_000;

impl NobleNumber {
    /// The number with the continued fraction [0; a₁, …, a_r, 1, 1, …].
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] for a quotient that is 0 or more than 10⁶, or for more than 24 quotients.
    pub fn new(quotients: Vec<u32>) -> Result<Self, Error> {
        let of = "quotients of a continued fraction before its ones";
        Error::check_count_range(of, quotients.len(), 0, MOST_QUOTIENTS)?;
        for &a in &quotients {
            let most = LARGEST_QUOTIENT as usize;
            Error::check_count_range("quotient of a continued fraction", a as usize, 1, most)?;
        }
        let mut quotients = quotients;
        while quotients.last() == Some(&1) {
            quotients.pop();
        }
        Ok(Self { quotients })
    }

    /// The noble number within `tolerance` of x, between 0 and 1, that is worst approximated by fractions: the one with
    /// the largest γ among those whose continued fraction begins like that of x or of a number near x.
    pub fn near(x: f64, tolerance: f64) -> Option<Self> {
        let mut best: Option<Self> = None;
        for from in
            [x, x - 0.5 * tolerance, x + 0.5 * tolerance, x - 0.8 * tolerance, x + 0.8 * tolerance]
        {
            let (mut quotients, mut rest) = (Vec::new(), from);
            while quotients.len() < MOST_QUOTIENTS && rest > 1e-9 {
                let a = (1.0 / rest).floor();
                if !(a >= 1.0 && a <= f64::from(LARGEST_QUOTIENT)) {
                    break;
                }
                quotients.push(a as u32);
                rest = 1.0 / rest - a;
                let Ok(found) = Self::new(quotients.clone()) else { break };
                let near = (found.value().centre() - x).abs() <= tolerance;
                // Of two that are as far the first, which is shorter or nearer.
                if near && best.as_ref().is_none_or(|best| found.gamma() > 1.01 * best.gamma()) {
                    best = Some(found);
                }
            }
        }
        best
    }

    /// The quotients a₁, …, a_r of the continued fraction, before its endless ones.
    pub fn quotients(&self) -> &[u32] {
        &self.quotients
    }

    /// A ball around a sum of two doubles that contains the noble number.
    pub fn value(&self) -> Ball {
        self.enclosed()
    }

    /// The number, enclosed in a ball of any kind.
    pub fn enclosed<C: BallCentre>(&self) -> BallOf<C> {
        let one = BallOf::of(1.0);
        self.complete_quotients()
            .last()
            .map_or_else(|| one.divided_by(golden()), |x| one.divided_by(*x))
    }

    /// ω_{r+1} = (1 + √5)/2, ω_r = a_r + 1/ω_{r+1}, …, ω₁.
    fn complete_quotients<C: BallCentre>(&self) -> Vec<BallOf<C>> {
        let mut out = vec![golden()];
        for &a in self.quotients.iter().rev() {
            let next = BallOf::of(a.into()).plus(BallOf::of(1.0).divided_by(out[out.len() - 1]));
            out.push(next);
        }
        out
    }

    /// A γ with |kω − m| ≥ γ/k for all integers k ≥ 1 and m.
    ///
    /// For q_n ≤ k < q_{n+1} it is |kω − m| ≥ |q_nω − p_n|, and q_n|q_nω − p_n| = 1/(ω_{n+1} + q_{n−1}/q_n). From
    /// n = r on ω_{n+1} stays, and q_{n−1}/q_n goes to its limit from both sides by turns, so that the first two are
    /// the extremes.
    ///
    /// Source: Khinchin, Continued fractions (1964), §§ 6 and 13.
    pub fn gamma(&self) -> f64 {
        let mut complete: Vec<Ball> = self.complete_quotients();
        complete.reverse();
        let mut quotients = self.quotients.clone();
        // One more of the ones.
        quotients.push(1);
        complete.push(golden());
        let mut ratio = Ball::of(0.0);
        let mut gamma = f64::INFINITY;
        for (n, next) in complete.iter().enumerate() {
            let own = Ball::of(1.0).divided_by(next.plus(ratio)).lower();
            gamma = if own >= gamma { gamma } else { own };
            if let Some(&a) = quotients.get(n) {
                ratio = Ball::of(1.0).divided_by(Ball::of(a.into()).plus(ratio));
            }
        }
        gamma
    }
}

/// A ball that contains the golden ratio (1 + √5)/2.
fn golden<C: BallCentre>() -> BallOf<C> {
    BallOf::of(5.0).sqrt().plus(BallOf::of(1.0)).scaled(0.5)
}

/// Writes the continued fraction with its endless ones in parentheses, such as `[0; 1, 2, (1)]`.
impl std::fmt::Display for NobleNumber {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let listed: Vec<String> =
            self.quotients.iter().map(u32::to_string).chain(["(1)".into()]).collect();
        write!(f, "[0; {}]", listed.join(", "))
    }
}

/// Parses `golden`, a continued fraction such as `[0; 1, 2, (1)]`, or a decimal. A decimal stands for the noble number
/// with the largest γ within half a unit of its last digit.
impl std::str::FromStr for NobleNumber {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let text = text.trim();
        let expected =
            "golden, a continued fraction such as [0; 1, 2, (1)], or a decimal between 0 and 1";
        let wrong =
            |why: &str| Err(Error::invalid("rotation number", format!("{text}{why}"), expected));
        if text == "golden" {
            return Self::new(Vec::new());
        }
        if let Some(inner) = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            let Some((whole, rest)) = inner.split_once(';') else { return wrong("") };
            let listed: Vec<&str> = rest.split(',').map(str::trim).collect();
            let Some(("(1)", quotients)) = listed.split_last().map(|(last, all)| (*last, all))
            else {
                let why = match inner.contains('(') {
                    true => {
                        ", which does not end in (1), the only period that there is a theorem for here"
                    }
                    false => ", which is rational: it does not end in (1)",
                };
                return wrong(why);
            };
            let quotients: Result<Vec<u32>, _> = quotients.iter().map(|a| a.parse()).collect();
            return match (whole.trim(), quotients) {
                ("0", Ok(quotients)) => Self::new(quotients),
                _ => wrong(""),
            };
        }
        if text.contains('/') {
            return wrong(", which is rational");
        }
        let Ok(value) = text.parse::<f64>() else { return wrong("") };
        if !(value > 0.0 && value < 1.0) {
            return wrong(", of which whole turns are to be left out");
        }
        let digits = text.split_once('.').map_or(0, |(_, digits)| digits.len());
        let tolerance = 0.5 * libm::pow(10.0, -(digits as f64));
        match Self::near(value, tolerance) {
            Some(found) => Ok(found),
            None => wrong(
                ", with no noble number of small quotients so near: give it fewer or more digits",
            ),
        }
    }
}

/// Upper bounds, in terms of |η|, of the solution ξ of ξ(φ) − ξ(φ + ω) = η(φ) − ⟨η⟩.
#[derive(Clone, Debug)]
pub struct Divisors {
    /// Lower bounds of 4 sin²πkω, k = 1, 2, ….
    squares: Vec<f64>,
    gamma: f64,
}

/// How many divisors are taken as they are.
const DIVISORS: usize = 1500;

impl Divisors {
    /// The divisors of a rotation number.
    pub fn new(omega: &NobleNumber) -> Self {
        let (value, gamma) = (omega.value(), omega.gamma());
        let square = |k: usize| {
            let turns = value.scaled(k as f64);
            let rest = turns.minus(Ball::of(libm::round(turns.centre())));
            let (s, _) = rest.times(Ball::PI).sin_cos();
            let below = s.mignitude();
            down(4.0 * down(below * below))
        };
        Self { squares: (1..=DIVISORS).map(square).collect(), gamma }
    }

    /// The constant γ of the Diophantine condition.
    pub fn gamma(&self) -> f64 {
        self.gamma
    }

    /// The bound A(δ) = 1/(√96 γδ), which doubles when δ is halved.
    pub fn scaling_bound(&self, delta: f64) -> f64 {
        const INVERSE_ROOT_96: f64 = 0.102_062_072_615_966;
        up(INVERSE_ROOT_96 / down(self.gamma * delta))
    }

    /// A(δ) with |ξ| ≤ A(δ)|η|, where |ξ| is taken on a strip narrower by δ than that of |η|.
    pub fn bound(&self, delta: f64) -> f64 {
        let h = Ball::PI.scaled(4.0 * delta);
        let x = h.negated().exp().upper();
        let (mut power, mut sum) = (1.0, 0.0);
        for square in &self.squares {
            power = up(power * x);
            sum = up(sum + up(power / square));
        }
        // The rest: π²/(48γ²) x^n (n² + 2n/h + 2/h²), with the first n that is not summed.
        let (n, h) = ((DIVISORS + 1) as f64, down(h.lower()));
        power = up(power * x);
        let moments = up(up(n * n) + up(up(up(2.0 * n) / h) + up(2.0 / down(h * h))));
        let factor = up(0.205_617 / down(self.gamma * self.gamma));
        sum = up(sum + up(up(factor * power) * moments));
        let actual = up(2.0 * up(sum.sqrt()));
        let scaling = self.scaling_bound(delta);
        if actual < scaling { actual } else { scaling }
    }
}
