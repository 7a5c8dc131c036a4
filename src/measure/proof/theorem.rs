//! The theorem of the guide's chapter on proofs, an a-posteriori theorem on invariant circles: its hypotheses, checked
//! with rigorous enclosures.

use super::ball::{Ball, BallCentre, BallOf};
use super::centre::{Centre, ThreeWords, TwoWords};
use super::curve::{Curve, OnLine, Wave, phases, roots_of_unity};
use super::failure::Failure;
use super::noble_number::{Divisors, NobleNumber};
use super::number::{Jet, Number};
use super::plane_map::{PlaneMap, Prepared};
use super::rounded::{down, up};
use super::taylor::Taylor;
use super::winding::{Winding, along, goes_around};
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// A nearly invariant curve, with the strips and points with which the theorem is tried on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The frequency ω of the circle, for which F(K(φ)) is nearly K(φ + ω).
    pub omega: NobleNumber,
    /// c_k of both components for k = 0 … M, K(φ) = Σ_{|k| ≤ M} c_k e^{2πikφ}: real and imaginary parts, each the
    /// sum of two doubles.
    pub modes: Vec<[[f64; 2]; 4]>,
    /// The half-width ρ of the strip |Im φ| ≤ ρ on which the theorem is applied.
    pub rho: f64,
    /// The half-width ρ̂ > ρ of the strip |Im φ| ≤ ρ̂ on which F∘K is shown to be analytic and bounded.
    pub rho_hat: f64,
    /// The number of points at which F∘K is enclosed, a power of two.
    pub points: usize,
    /// Whether the curve is around a cylinder: then φ is added to the first component.
    pub cylinder: bool,
}

/// The constants of the theorem for a candidate: bounds on the strip, all rounded outward.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constants {
    /// The number of doubles with which the values at points were enclosed: two, or three where two were too few.
    pub words: usize,
    /// The constant γ of the Diophantine condition |kω − m| ≥ γ/k.
    pub gamma: f64,
    /// |F∘K − K(· + ω)| on |Im φ| ≤ ρ.
    pub residual: f64,
    /// The part of `residual` from modes that the points do not resolve: aliasing and truncation.
    pub aliasing: f64,
    /// |F∘K − c₀| on |Im φ| ≤ ρ̂, where c₀ is the centre of K.
    pub image: f64,
    /// An upper bound of |K′|, where K′ is the derivative of the curve, on |Im φ| ≤ ρ.
    pub tangent: f64,
    /// An upper bound of |N| on |Im φ| ≤ ρ, where N = JK′/(K′·K′) is normal to the curve.
    pub normal: f64,
    /// An upper bound of |DF·N|, the image of the normal vector N, on |Im φ| ≤ ρ.
    pub moved_normal: f64,
    /// |T|, where T (the torsion) is the component of DF·N along K′(· + ω).
    pub torsion: f64,
    /// A lower bound of |⟨T⟩|.
    pub mean_torsion: f64,
    /// |D²F| around the image of the strip under K.
    pub second: f64,
    /// κ of the first Newton step: the next error is at most κ|E|².
    pub kappa: f64,
    /// 16κ|E| at the step from which on convergence is proved for all further steps at once.
    pub margin: f64,
    /// The number of steps before that, which are bounded one by one.
    pub steps: usize,
    /// An upper bound of the distance of the invariant circle from K, on the real line.
    pub distance: f64,
}

/// The most points at which F∘K is enclosed.
pub(super) const MOST_POINTS: usize = 1 << 14;
/// Curves are not as large as this.
const MOST_OF_MODES: f64 = 1e50;

/// Below what part of the quantity a remainder is taken as good.
const FINE: f64 = 0.02;

/// The Euclidean norm of complex numbers of which upper bounds are known.
fn norm(parts: &[f64]) -> f64 {
    let mut sum = 0.0;
    for part in parts {
        sum = up(sum + up(part * part));
    }
    up(sum.sqrt())
}

/// The larger one; NaN where either is.
fn larger(a: f64, b: f64) -> f64 {
    crate::scalar::max_or_nan(a, b)
}

fn is_fine(value: &Taylor, size: f64) -> bool {
    value.remainder() <= FINE * size
}

/// The cross product a × b of two vectors of the plane.
fn cross<N: Number>(a: [N; 2], b: [N; 2]) -> N {
    a[0].times(b[1]).minus(a[1].times(b[0]))
}

/// Bounds of |E| on a strip.
struct Residual {
    all: f64,
    /// The part of it that is not from the coefficients of the points.
    aliasing: f64,
    /// What the modes of K leave, without the rounding of the values: no bound, but what more digits may come to.
    without_rounding: f64,
}

/// What is bounded along the edge of the strip.
struct OnStrip {
    tangent: f64,
    /// A lower bound of |K′·K′| on |Im φ| ≤ ρ.
    square: f64,
    normal: f64,
    moved_normal: f64,
    torsion: f64,
    /// An upper bound of the norm |DF| of the derivative of the map around the curve.
    first: f64,
    second: f64,
}

impl Candidate {
    pub(super) fn curve<C: BallCentre>(&self) -> Curve<BallOf<C>> {
        let number = |[high, low]: [f64; 2]| BallOf::around([high, low, 0.0], 0.0);
        let wave = |re: [f64; 2], im: [f64; 2]| Wave::new(number(re), number(im));
        let modes = self.modes.iter().map(|[a, b, c, d]| [wave(*a, *b), wave(*c, *d)]);
        Curve { modes: modes.collect(), cylinder: self.cylinder }
    }

    /// Fails unless the candidate has the form that the theorem requires.
    ///
    /// # Errors
    /// [`Error::Invalid`] and [`Error::OutOfRange`] with the number.
    pub fn check(&self) -> Result<(), Error> {
        let most = self.points / 4;
        Error::check_count_range("modes of a circle", self.modes.len(), 2, most + 1)?;
        if !self.points.is_power_of_two() || self.points > MOST_POINTS {
            let expected = format!("a power of two, at most {MOST_POINTS}");
            return Err(Error::invalid("points of a proof", self.points, expected));
        }
        for [high, low] in self.modes.iter().flatten() {
            if !(high.abs() < MOST_OF_MODES && high + low == *high) {
                let expected = "sums of two doubles, the second below the rounding of the first";
                return Err(Error::invalid(
                    "modes of a circle",
                    format!("{high:e} + {low:e}"),
                    expected,
                ));
            }
        }
        let constant = self.modes[0];
        if constant[1] != [0.0; 2] || constant[3] != [0.0; 2] {
            return Err(Error::invalid(
                "constant mode of a circle",
                constant[1][0],
                "a real number",
            ));
        }
        if !(self.rho > 0.0 && self.rho < self.rho_hat && self.rho_hat < 1.0) {
            let expected = format!("above 0 and below that of ρ̂, {}", self.rho_hat);
            return Err(Error::invalid("width of the strip of a proof", self.rho, expected));
        }
        Ok(())
    }

    /// Tries to prove the theorem for the map with this candidate: returns its constants, or the inequality that fails.
    ///
    /// # Errors
    /// Those of [`PlaneMap::check_symplectic`] and [`Candidate::check`].
    pub fn prove(&self, map: &PlaneMap) -> Result<Result<Constants, Failure>, Error> {
        map.check_symplectic()?;
        self.check()?;
        if self.cylinder != map.cylinder {
            let expected =
                "a curve around a cylinder for a map of one, and of a plane for a map of a plane";
            return Err(Error::invalid(
                "circle",
                format!("of a cylinder: {}", self.cylinder),
                expected,
            ));
        }
        let proved = self.constants(&map.prepared()).and_then(|constants| {
            if !self.cylinder {
                // That it goes around once, so that ω is its rotation number, and it has an inside.
                let centre = [self.modes[0][0][0], self.modes[0][2][0]];
                goes_around(&self.curve(), constants.distance, centre, 0.0)?;
            }
            Ok(constants)
        });
        Ok(proved.map_err(|failure| Failure { strip: Some(self.rho), ..failure }))
    }

    /// [`Candidate::prove`] by the numbers alone, whatever the kinds of step: what is not symplectic is to fail, too.
    #[doc(hidden)]
    pub fn prove_by_numbers(&self, map: &PlaneMap) -> Result<Constants, Failure> {
        self.constants(&map.prepared())
    }

    /// |E| on the strip, and the part of it that is from aliasing and truncation.
    #[doc(hidden)]
    pub fn residual_bounds(&self, map: &PlaneMap) -> Result<[f64; 2], Failure> {
        let map = &map.prepared();
        let phases = phases(self.omega.value(), self.points);
        let image = self.image_bound(map, &self.curve(), &phases)?;
        let Residual { all, aliasing, .. } = self.residual::<TwoWords>(map, image)?;
        Ok([all, aliasing])
    }

    fn constants(&self, map: &Prepared<'_>) -> Result<Constants, Failure> {
        let omega = self.omega.value();
        let curve = self.curve();
        let phases = phases(omega, self.points);
        let divisors = Divisors::new(&self.omega);
        let image = self.image_bound(map, &curve, &phases)?;
        let mut residual = self.residual::<TwoWords>(map, image)?;
        // What K and K′ may change by in all steps.
        let tangent = curve_size(&curve);
        let room = Room { point: 1e-9 * tangent, slope: 1e-5 * tangent };
        let strip = self.on_strip(map, &curve, &phases, room)?;
        let mean = self.mean_torsion(map, &curve, &phases, strip.torsion);
        // Less room for K′ is enough, and more than a small torsion has.
        let close = |residual: f64| {
            let mut closed = Err(Failure::new("(8) there is room", 0.0, 0.0));
            for shrunk in [1.0, 1e-2, 1e-4] {
                let room = Room { slope: shrunk * room.slope, ..room };
                closed = Bounds::with_room(&strip, mean, room)
                    .and_then(|bounds| bounds.close(&divisors, self.rho, residual, room));
                if closed.is_ok() {
                    break;
                }
            }
            closed
        };
        let (mut words, mut closed) = (TwoWords::WORDS, close(residual.all));
        if closed.is_err() && close(residual.without_rounding).is_ok() {
            // More digits can do what these could not.
            words = ThreeWords::WORDS;
            residual = self.residual::<ThreeWords>(map, image)?;
            closed = close(residual.all);
        }
        closed.map(|closed| Constants {
            words,
            gamma: divisors.gamma(),
            residual: residual.all,
            aliasing: residual.aliasing,
            image,
            tangent: strip.tangent,
            normal: strip.normal,
            moved_normal: strip.moved_normal,
            torsion: strip.torsion,
            mean_torsion: mean,
            second: strip.second,
            kappa: closed.kappa,
            margin: closed.margin,
            steps: closed.steps,
            distance: closed.distance,
        })
    }

    /// |F∘K − c₀| on |Im φ| ≤ ρ̂: on its edge, the maximum of the modulus. The steps refuse poles on the way.
    fn image_bound(
        &self,
        map: &Prepared<'_>,
        curve: &Curve<Ball>,
        phases: &[Wave<Ball>],
    ) -> Result<f64, Failure> {
        let line = OnLine::new(curve, phases, self.rho_hat);
        let centre = curve.modes[0].each_ref().map(|c| c.re.centre());
        let mut bound = 0.0;
        let done = along(&line, |part, last| {
            let mut z = part.point;
            map.apply(&mut z);
            let z = [0, 1].map(|k| z[k].minus(Taylor::of(centre[k])));
            let z = if map.cylinder() { [z[0].minus(part.turns()), z[1]] } else { z };
            let size = norm(&z.map(|z| z.above()));
            let good = size.is_finite() && (last || z.iter().all(|z| is_fine(z, size)));
            if good {
                bound = larger(bound, size);
            }
            good
        });
        let analytic = "(1) F∘K is analytic and bounded on |Im φ| ≤ ρ̂, no pole of tanh near";
        let failure = |found| Failure::new(analytic, found, self.rho_hat);
        if done && bound.is_finite() { Ok(bound) } else { Err(failure(f64::INFINITY)) }
    }

    /// |E| on |Im φ| ≤ ρ with the values at points in balls of a kind.
    fn residual<C: BallCentre>(&self, map: &Prepared<'_>, image: f64) -> Result<Residual, Failure> {
        let omega = self.omega.enclosed::<C>();
        let phases = phases(omega, self.points);
        let roots = roots_of_unity(self.points);
        let error = error_of(map, &self.curve(), &phases, omega, self.points, &roots);
        let tau = Ball::TAU;
        let power = |count: usize, width: f64| {
            tau.scaled(count as f64).times(Ball::of(width).negated()).exp()
        };
        let (n, rho_hat) = (self.points, self.rho_hat);
        let rest = down(1.0 - power(n, rho_hat).upper());
        let growth = |k: usize| tau.scaled(k as f64).times(Ball::of(self.rho)).exp().upper();
        // A mode of F∘K is |F_k| ≤ image·e^{−2πkρ̂}: from some k on that is less than what is known of it otherwise,
        // and a geometric sum.
        let narrowing = Ball::of(rho_hat).minus(Ball::of(self.rho));
        let step = tau.times(narrowing).negated().exp().upper();
        let beyond = |k: usize| {
            let first = tau.scaled(k as f64).times(narrowing).negated().exp().upper();
            up(up(2.0 * image) * up(first / down(1.0 - step)))
        };
        let aliased = |k: usize| {
            let two = up(power(n - k, rho_hat).upper() + power(n + k, rho_hat).upper());
            up(up(image * two) / rest)
        };
        let mut best =
            Residual { all: f64::INFINITY, aliasing: f64::INFINITY, without_rounding: 0.0 };
        let (mut sum, mut alias) = (0.0, 0.0);
        for (k, [x, y]) in error.modes.iter().enumerate() {
            let both = if k == 0 { 1.0 } else { 2.0 };
            let (growth, aliased) = (both * growth(k), aliased(k));
            let own = norm(&[x.above(), y.above()]);
            sum = up(sum + up(growth * own));
            if k < self.modes.len() {
                let exact = [x, y].map(|c| Wave::new(c.re.exact(), c.im.exact()).above());
                best.without_rounding = up(best.without_rounding + up(growth * norm(&exact)));
            }
            alias = up(alias + up(growth * aliased));
            if k + 1 < self.modes.len() {
                continue;
            }
            let rest = up(alias + beyond(k + 1));
            let all = up(sum + rest);
            if all < best.all {
                best = Residual { all, aliasing: rest, ..best };
            }
        }
        match best.all.is_finite() {
            true => Ok(best),
            false => Err(Failure::new("(2) |E| is finite", sum, f64::MAX)),
        }
    }

    /// Bounds along |Im φ| = ρ, with K and what is around it.
    fn on_strip(
        &self,
        map: &Prepared<'_>,
        curve: &Curve<Ball>,
        phases: &[Wave<Ball>],
        room: Room,
    ) -> Result<OnStrip, Failure> {
        let line = OnLine::new(curve, phases, self.rho);
        let mut out = OnStrip {
            tangent: 0.0,
            square: f64::INFINITY,
            normal: 0.0,
            moved_normal: 0.0,
            torsion: 0.0,
            first: 0.0,
            second: 0.0,
        };
        let mut winding = Winding::default();
        let done = along(&line, |part, last| {
            let mut z = [0, 1]
                .map(|axis| Jet::<Taylor, true>::start(part.point[axis].widened(room.point), axis));
            map.apply(&mut z);
            let (slope, next) = (part.slope, part.next_slope);
            let square = |l: [Taylor; 2]| l[0].times(l[0]).plus(l[1].times(l[1]));
            let own_square = square(slope);
            if !(own_square.below() > 0.0) {
                return false;
            }
            let normal = |l: [Taylor; 2], square: Taylor| {
                let inverse = square.inverse();
                [l[1].scaled(-1.0).times(inverse), l[0].times(inverse)]
            };
            let (n, next_n) = (normal(slope, own_square), normal(next, square(next)));
            let moved = z.map(|row| row.first[0].times(n[0]).plus(row.first[1].times(n[1])));
            let torsion = cross(moved, next_n);
            let sizes = |v: [Taylor; 2]| norm(&v.map(|v| v.above()));
            let second = norm(&z.map(|row| {
                let [a, b, c] = row.second.map(|h| h.above());
                norm(&[a, b, b, c])
            }));
            let first = norm(&z.map(|row| norm(&row.first.map(|d| d.above()))));
            let values = [sizes(moved), torsion.above(), second, first];
            let good = values.iter().all(|v| v.is_finite())
                && (last
                    || moved.iter().all(|m| is_fine(m, values[0]))
                        && z.iter().flat_map(|row| row.second).all(|h| is_fine(&h, second)));
            if !good {
                return false;
            }
            out.tangent = larger(out.tangent, sizes(slope));
            out.square =
                if own_square.below() < out.square { own_square.below() } else { out.square };
            out.normal = larger(out.normal, sizes(n));
            out.moved_normal = larger(out.moved_normal, values[0]);
            out.torsion = larger(out.torsion, values[1]);
            out.second = larger(out.second, second);
            out.first = larger(out.first, first);
            winding.pass(own_square.centre());
            true
        });
        let turns = winding.close();
        let failure = |inequality, found, needed| Err(Failure::new(inequality, found, needed));
        if !done {
            let what = "(3) K′·K′ has no zero and DF, D²F are bounded on |Im φ| ≤ ρ";
            return failure(what, f64::INFINITY, self.rho);
        }
        if !(turns.abs() < 0.5) {
            let what = "(3) K′·K′ has no zero on |Im φ| ≤ ρ: it goes around 0 along the edge";
            return failure(what, turns, 0.0);
        }
        Ok(out)
    }

    /// |⟨T⟩| at least: the mean at points on the real line, and what aliasing may add.
    fn mean_torsion(
        &self,
        map: &Prepared<'_>,
        curve: &Curve<Ball>,
        phases: &[Wave<Ball>],
        torsion: f64,
    ) -> f64 {
        let count = (self.points / 2).max(2 * self.modes.len()).next_power_of_two();
        let roots = roots_of_unity(count);
        let mut sum = Ball::of(0.0);
        for (_, moved, next_normal) in frames(map, curve, phases, count, &roots) {
            sum = sum.plus(cross(moved, next_normal));
        }
        let e = Ball::TAU.scaled(count as f64).times(Ball::of(self.rho)).negated().exp().upper();
        let aliasing = up(up(2.0 * torsion) * up(e / down(1.0 - e)));
        down(sum.scaled(1.0 / count as f64).mignitude() - aliasing)
    }
}

/// A bound of |K′| to measure lengths with: it need not be sharp.
fn curve_size(curve: &Curve<Ball>) -> f64 {
    let modes = curve.modes.iter().enumerate();
    let of = |(k, [x, y]): (usize, &[Wave<Ball>; 2])| {
        2.0 * std::f64::consts::TAU * k as f64 * norm(&[x.above(), y.above()])
    };
    modes.map(of).sum::<f64>() + if curve.cylinder { 1.0 } else { 0.0 }
}

/// The coefficients of F∘K − K(· + ω) from the values at so many points, up to half as many.
pub(super) fn error_of<C: BallCentre>(
    map: &Prepared<'_>,
    curve: &Curve<BallOf<C>>,
    phases: &[Wave<BallOf<C>>],
    omega: BallOf<C>,
    count: usize,
    roots: &[Wave<BallOf<C>>],
) -> Curve<BallOf<C>> {
    let mut values = curve.values(count, roots);
    for (j, z) in values.iter_mut().enumerate() {
        let turns = BallOf::of(j as f64 / count as f64);
        if map.cylinder() {
            z[0] = z[0].plus(turns);
        }
        map.apply(z);
        if map.cylinder() {
            z[0] = z[0].minus(turns);
        }
    }
    let mut out = Curve::of_values(&values, roots, count / 2 - 1, map.cylinder());
    let rotated = curve.rotated(phases);
    for (mode, own) in out.modes.iter_mut().zip(&rotated.modes) {
        for axis in 0..2 {
            mode[axis] = mode[axis].minus(own[axis]);
        }
    }
    if map.cylinder() {
        out.modes[0][0].re = out.modes[0][0].re.minus(omega);
    }
    out
}

/// The points K, DF·N and N(φ + ω) at equal distances.
fn frames<'a>(
    map: &'a Prepared<'a>,
    curve: &Curve<Ball>,
    phases: &[Wave<Ball>],
    count: usize,
    roots: &[Wave<Ball>],
) -> impl Iterator<Item = ([Ball; 2], [Ball; 2], [Ball; 2])> {
    let mut points = curve.values(count, roots);
    let slope = curve.slope(Ball::TAU);
    let [mut slopes, mut next] =
        [slope.values(count, roots), slope.rotated(phases).values(count, roots)];
    if curve.cylinder {
        for (j, point) in points.iter_mut().enumerate() {
            point[0] = point[0].plus(Ball::of(j as f64 / count as f64));
        }
        for slope in slopes.iter_mut().chain(&mut next) {
            slope[0] = slope[0].plus(Ball::of(1.0));
        }
    }
    let normal = |l: [Ball; 2]| {
        let square = l[0].times(l[0]).plus(l[1].times(l[1]));
        [l[1].negated().divided_by(square), l[0].divided_by(square)]
    };
    points.into_iter().zip(slopes).zip(next).map(move |((point, slope), next)| {
        let mut z = [0, 1].map(|axis| Jet::<Ball, false>::start(point[axis], axis));
        map.apply(&mut z);
        let n = normal(slope);
        let moved = z.map(|row| row.first[0].times(n[0]).plus(row.first[1].times(n[1])));
        (point, moved, normal(next))
    })
}

/// How far K and K′ may go from where they are in all steps.
#[derive(Clone, Copy, Debug)]
struct Room {
    point: f64,
    slope: f64,
}

/// Bounds for every curve within the room.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    tangent: f64,
    normal: f64,
    moved_normal: f64,
    torsion: f64,
    /// An upper bound of 1/|⟨T⟩|, where ⟨T⟩ is the mean torsion.
    inverse_mean: f64,
    second: f64,
}

/// What has come of the recursion.
struct Closed {
    kappa: f64,
    margin: f64,
    steps: usize,
    distance: f64,
}

impl Bounds {
    fn with_room(strip: &OnStrip, mean: f64, room: Room) -> Result<Self, Failure> {
        let (l, eta) = (strip.tangent, room.slope);
        let tangent = up(l + eta);
        let change = up(up(2.0 * up(l * eta)) + up(eta * eta));
        let square = down(strip.square - change);
        let normal = up(tangent / square);
        // |Ñ − N| ≤ η₁/m̃ + ℓ(2ℓη₁ + η₁²)/(m m̃).
        let normal_change = up(up(eta / square) + up(up(l * change) / down(strip.square * square)));
        let moved_change =
            up(up(strip.second * up(room.point * normal)) + up(strip.first * normal_change));
        let moved_normal = up(strip.moved_normal + moved_change);
        let torsion_change = up(up(moved_change * normal) + up(strip.moved_normal * normal_change));
        let torsion = up(strip.torsion + torsion_change);
        let (known, mean) = (mean, down(mean - torsion_change));
        let failure = |inequality, found, needed| Err(Failure::new(inequality, found, needed));
        if !(square > 0.0) {
            return failure("(4) |K′·K′| stays away from 0 in all steps", strip.square, change);
        }
        if !(mean > 0.0) {
            return failure("(5) |⟨T⟩| stays away from 0 in all steps", known, torsion_change);
        }
        Ok(Self {
            tangent,
            normal,
            moved_normal,
            torsion,
            inverse_mean: up(1.0 / mean),
            second: strip.second,
        })
    }

    /// κ(δ) and C_Δ(δ), with |E₊| ≤ κ|E|² and |Δ| ≤ C_Δ|E|.
    fn step(&self, a: f64, delta: f64) -> [f64; 2] {
        let Self { tangent, normal, moved_normal, torsion, inverse_mean, second } = *self;
        let x_n =
            up(up(inverse_mean * normal)
                + up(up(1.0 + up(inverse_mean * torsion)) * up(a * tangent)));
        let x_l = up(a * up(normal + up(torsion * x_n)));
        let c = up(up(tangent * x_l) + up(normal * x_n));
        let linear = up(up(0.5 * normal) + up(x_l + up(up(normal * moved_normal) * x_n)));
        let kappa = up(up(linear / delta) + up(0.5 * up(second * up(c * c))));
        [kappa, c]
    }

    /// The recursion e₊ = κ(δ)e², δ halved at each step.
    fn close(
        &self,
        divisors: &Divisors,
        rho: f64,
        residual: f64,
        room: Room,
    ) -> Result<Closed, Failure> {
        const MOST_STEPS: usize = 12;
        let failure = |inequality, found, needed| Err(Failure::new(inequality, found, needed));
        let (mut delta, mut e) = (down(rho / 7.0), residual);
        let (mut moved, mut bent, mut first) = (0.0, 0.0, None);
        let mut before = f64::INFINITY;
        for steps in 0..=MOST_STEPS {
            let [scaling, c_scaling] = self.step(divisors.scaling_bound(delta), delta);
            let margin = up(16.0 * up(scaling * e));
            let [kappa, c] = self.step(divisors.bound(delta), delta);
            let first = *first.get_or_insert(kappa);
            if margin < 0.01 {
                // From here on e falls by 0.01/16 or more a step, where C_Δ grows by 4 and C_Δ/δ by 8.
                let step = up(c_scaling * e);
                moved = up(moved + up(step * 1.01));
                bent = up(bent + up(up(step / delta) * 1.01));
                if !(moved <= room.point) {
                    return failure("(7) Σ C_Δ|E| leaves K in its room", moved, room.point);
                }
                if !(bent <= room.slope) {
                    return failure("(8) Σ C_Δ|E|/δ leaves K′ in its room", bent, room.slope);
                }
                return Ok(Closed { kappa: first, margin, steps, distance: moved });
            }
            moved = up(moved + up(c * e));
            bent = up(bent + up(up(c * e) / delta));
            let next = up(kappa * up(e * e));
            if !(next < before) || !(next < e) {
                break;
            }
            before = next;
            e = next;
            // Exact.
            delta *= 0.5;
        }
        let kappa = first.unwrap_or(f64::NAN);
        failure("(6) κ|E| < 1: the first step makes the error smaller", up(kappa * residual), 1.0)
    }
}
