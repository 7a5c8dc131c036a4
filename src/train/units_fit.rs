//! Fits units to data that were not made for a network.

use crate::flow::Pairs;
use crate::layer::TorusAction;
use crate::phase::Units;
use crate::scalar::max_or_nan;

/// Sizes between these are of order one, and stay what they are.
const SMALL: f64 = 0.5;
const LARGE: f64 = 2.0;
/// A ratio of p to q is left where another one does not make the rotation fit so many times
/// better, in the mean square.
const BETTER: f64 = 10.0;
/// A misfit below which all are as good.
const PERFECT: f64 = 1e-12;
/// A centre is within so many spreads of the mean.
const NEAR: f64 = 3.0;
/// The square of the sine of an angle below which it determines no ratio.
const TURNED: f64 = 1e-3;
/// The largest number of pairs that are used.
const PAIRS: usize = 10_000;

/// Units in which the widest plane of the pairs is of order one and the planes that the action turns move in circles;
/// None where they do already.
///
/// For a plane that turns along ellipses, the linear map nearest to the pairs gives the ratio of
/// its factors, and its centre where that is not 0. For a plane that does not turn, the spreads of
/// q and p become the same up to a factor of four, and the centre is its mean where this is further
/// from 0 than twice its spread. The unit of area is that of the widest plane. Apart from the ratio
/// of ellipses all factors are powers of two, so that a change of units causes no rounding.
///
/// # Panics
/// When the action and the pairs differ in their degrees of freedom.
pub fn fit_units(pairs: &Pairs, action: &TorusAction) -> Option<Units> {
    assert!(action.dof() == pairs.dof());
    let dof = pairs.dof();
    let pairs = pairs.thinned(PAIRS);
    let turns = |j: usize| action.circles().iter().any(|circle| circle.weights()[j] != 0);
    let planes: Vec<Plane> = (0..dof).map(|j| Plane::of(&pairs, j, turns(j))).collect();
    let area = planes.iter().map(|plane| plane.area).fold(0.0, max_or_nan);
    let unit = match area {
        area if (SMALL * SMALL..=LARGE * LARGE).contains(&area) || !area.is_normal() => 1.0,
        area => power_of_two(0.5 * libm::log2(area)),
    };
    let (mut centre, mut factors) = (vec![0.0; 2 * dof], vec![1.0; 2 * dof]);
    for (j, plane) in planes.iter().enumerate() {
        (centre[j], centre[dof + j]) = (plane.centre[0], plane.centre[1]);
        factors[j] = unit / plane.ratio.sqrt();
        factors[dof + j] = unit * unit / factors[j];
    }
    let plain = centre.iter().all(|c| *c == 0.0) && factors.iter().all(|s| *s == 1.0);
    if plain { None } else { Units::new(centre, factors).ok() }
}

fn power_of_two(exponent: f64) -> f64 {
    libm::exp2(exponent.round())
}

/// The fitted units of a plane.
struct Plane {
    centre: [f64; 2],
    /// The ratio of the factor of p to that of q.
    ratio: f64,
    /// The product of the spreads of q and p about the centre.
    area: f64,
}

/// Points of a plane before and after, (q, p, q′, p′).
type Moves = Vec<[f64; 4]>;

impl Plane {
    fn of(pairs: &Pairs, j: usize, turns: bool) -> Self {
        let (dof, dim) = (pairs.dof(), 2 * pairs.dof());
        let rows = pairs.input().chunks_exact(dim).zip(pairs.output().chunks_exact(dim));
        let moves: Moves = rows.map(|(z, w)| [z[j], z[dof + j], w[j], w[dof + j]]).collect();
        let (centre, ratio) = match turns {
            true => circles(&moves),
            false => ([0, 1].map(|half| apart(&moves, half)), 1.0),
        };
        let spread = [0, 1].map(|half| spread(&moves, half, centre[half]));
        let own = spread[1] / spread[0];
        let elongated = own.is_normal() && !(SMALL * SMALL..=LARGE * LARGE).contains(&own);
        // For a plane that turns, nothing determines the ratio where it comes round to where it
        // was.
        let ratio = match elongated && ratio == 1.0 && (!turns || at_rest(&moves, centre)) {
            true => power_of_two(0.5 * libm::log2(own)).powi(2),
            false => ratio,
        };
        Self { centre, ratio, area: spread[0] * spread[1] }
    }
}

/// Both values of a half of a plane, of each pair.
fn values(moves: &Moves, half: usize) -> impl Iterator<Item = f64> + '_ {
    moves.iter().flat_map(move |m| [m[half], m[half + 2]])
}

fn mean(moves: &Moves, half: usize) -> f64 {
    values(moves, half).sum::<f64>() / (2 * moves.len()) as f64
}

/// The root of the mean square about `centre`; 0 of a constant, whose mean is rounded.
fn spread(moves: &Moves, half: usize, centre: f64) -> f64 {
    const ROUNDING: f64 = 1e-10;
    let squares: f64 = values(moves, half).map(|v| (v - centre) * (v - centre)).sum();
    let largest = values(moves, half).map(f64::abs).fold(0.0, max_or_nan);
    let spread = (squares / (2 * moves.len()) as f64).sqrt();
    if spread > ROUNDING * largest { spread } else { 0.0 }
}

/// The mean, where it is far from 0.
fn apart(moves: &Moves, half: usize) -> f64 {
    let mean = mean(moves, half);
    if mean.abs() > LARGE * spread(moves, half, mean) { mean } else { 0.0 }
}

/// Whether pairs of a plane are at −z or z again, to a tenth.
fn at_rest(moves: &Moves, centre: [f64; 2]) -> bool {
    let mut sums = [0.0; 3];
    let sizes = [0, 1].map(|half| spread(moves, half, centre[half]));
    for m in moves {
        for half in 0..2 {
            let (a, b) = (m[half] - centre[half], m[half + 2] - centre[half]);
            let size = sizes[half];
            sums[0] += (a - b) * (a - b) / (size * size);
            sums[1] += (a + b) * (a + b) / (size * size);
            sums[2] += 1.0;
        }
    }
    sums[0].min(sums[1]) < 0.01 * sums[2]
}

/// The centre and the ratio that make the moves of a plane a rotation; 0 and 1 where they do
/// not make it a better one.
fn circles(moves: &Moves) -> ([f64; 2], f64) {
    let none = ([0.0; 2], 1.0);
    let about_zero = ratio_about(moves, [0.0; 2]).map(|ratio| ([0.0; 2], ratio));
    // A rotation by next to nothing has its fixed point anywhere.
    let near = |centre: &[f64; 2]| {
        (0..2).all(|half| {
            let mean = mean(moves, half);
            (centre[half] - mean).abs() <= NEAR * spread(moves, half, mean)
        })
    };
    let about_own = fixed_point(moves)
        .filter(near)
        .and_then(|centre| ratio_about(moves, centre).map(|ratio| (centre, ratio)));
    let shifted = about_own.map(|(centre, _)| (centre, 1.0));
    let candidates: Vec<([f64; 2], f64)> =
        [Some(none), about_zero, shifted, about_own].into_iter().flatten().collect();
    let misfits: Vec<f64> = candidates.iter().map(|(c, r)| misfit(moves, *c, *r)).collect();
    let least = misfits.iter().copied().fold(f64::INFINITY, |a, b| if b < a { b } else { a });
    let good = |misfit: &f64| *misfit <= (BETTER * least).max(PERFECT);
    misfits.iter().position(good).map_or(none, |index| candidates[index])
}

/// Sums of products of inputs and outputs about `centre`: (z zᵀ, w zᵀ).
fn products(moves: &Moves, centre: [f64; 2]) -> ([[f64; 2]; 2], [[f64; 2]; 2]) {
    let (mut own, mut cross) = ([[0.0; 2]; 2], [[0.0; 2]; 2]);
    for m in moves {
        for a in 0..2 {
            for b in 0..2 {
                let z = m[b] - centre[b];
                own[a][b] += (m[a] - centre[a]) * z;
                cross[a][b] += (m[a + 2] - centre[a]) * z;
            }
        }
    }
    (own, cross)
}

/// The matrix of the linear map about `centre` that is nearest to the moves.
fn linear(moves: &Moves, centre: [f64; 2]) -> [[f64; 2]; 2] {
    let (own, cross) = products(moves, centre);
    let determinant = own[0][0] * own[1][1] - own[0][1] * own[1][0];
    let inverse = [[own[1][1], -own[0][1]], [-own[1][0], own[0][0]]];
    let entry = |a: usize, b: usize| {
        (cross[a][0] * inverse[0][b] + cross[a][1] * inverse[1][b]) / determinant
    };
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

/// p over q of the ellipses that the linear map turns along: ( c, s/r ; −r s, c ).
fn ratio_about(moves: &Moves, centre: [f64; 2]) -> Option<f64> {
    let m = linear(moves, centre);
    let squared = -m[1][0] / m[0][1];
    let turned = -m[1][0] * m[0][1] > TURNED;
    (turned && squared > 0.0 && squared.is_finite()).then(|| squared.sqrt())
}

/// The point that the affine map nearest to the moves leaves where it is.
fn fixed_point(moves: &Moves) -> Option<[f64; 2]> {
    let count = moves.len() as f64;
    let before = [0, 1].map(|k| moves.iter().map(|m| m[k]).sum::<f64>() / count);
    let after = [0, 1].map(|k| moves.iter().map(|m| m[k + 2]).sum::<f64>() / count);
    // About their means: the shift of the inputs is that of the outputs too.
    let shifted: Moves = moves
        .iter()
        .map(|m| [m[0] - before[0], m[1] - before[1], m[2] - after[0], m[3] - after[1]])
        .collect();
    let m = linear(&shifted, [0.0; 2]);
    let rest = [[1.0 - m[0][0], -m[0][1]], [-m[1][0], 1.0 - m[1][1]]];
    let moved = [after[0] - before[0], after[1] - before[1]];
    let determinant = rest[0][0] * rest[1][1] - rest[0][1] * rest[1][0];
    let centre = [
        before[0] + (rest[1][1] * moved[0] - rest[0][1] * moved[1]) / determinant,
        before[1] + (rest[0][0] * moved[1] - rest[1][0] * moved[0]) / determinant,
    ];
    centre.iter().all(|c| c.is_finite()).then_some(centre)
}

/// The mean squared error of the nearest rotation about `centre`, p being in units of `ratio`
/// times that of q, over the mean square about the mean, which is the same for any centre.
fn misfit(moves: &Moves, centre: [f64; 2], ratio: f64) -> f64 {
    let (mut square, mut cosine, mut sine) = (0.0, 0.0, 0.0);
    let spreads = [0, 1].map(|half| spread(moves, half, mean(moves, half)));
    let size = spreads[0].powi(2) + (spreads[1] / ratio).powi(2);
    for m in moves {
        let (q, p) = (m[0] - centre[0], (m[1] - centre[1]) / ratio);
        let (x, y) = (m[2] - centre[0], (m[3] - centre[1]) / ratio);
        square += 0.5 * (q * q + p * p + x * x + y * y);
        cosine += q * x + p * y;
        sine += p * x - q * y;
    }
    (square - libm::hypot(cosine, sine)) / (size * moves.len() as f64)
}
