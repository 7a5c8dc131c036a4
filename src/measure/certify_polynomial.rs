//! The structure certificate of a symplectic polynomial.

use super::certify::Certificate;
use super::coordinate::Coordinate;
use super::inversion::ThereAndBack;
use super::laws;
use super::measurable::Measurable;
use super::measured_step::{MeasuredStep, MeasuredSteps, TrackedStep};
use super::samples::CertificateOptions;
use super::tally::Tally;
use crate::error::Error;
use crate::flow::{Region, Symmetries, SymplecticPolynomial};
use crate::network::Rollout;
use crate::phase::{Direction, Map};
use crate::random::Stream;
use crate::scalar::Scalar;

/// Tests the laws of a symplectic polynomial, by the steps that it takes in roll-outs: that it is symplectic, that it
/// and its inverse undo each other, and that it has its [symmetries](crate::flow::Symmetries).
///
/// Points are uniform in the box of its pairs in the frame of the map, shrunk by 1/√(2n) about its middle, so that they
/// are among the pairs where these fill the ellipsoid in the box; those whose images are outside of the box of the
/// images of the pairs are left out, since beyond the pairs Newton's method need not converge. The inverse is tested at
/// their images. The radius of the options is not used.
///
/// # Errors
/// Those of [`CertificateOptions::check`]; when nearly no points have images in the box.
pub fn certify_polynomial(
    map: &SymplecticPolynomial,
    options: CertificateOptions,
) -> Result<Certificate, Error> {
    options.check()?;
    let dim = 2 * Map::<f64>::dof(map);
    let mut stream = Stream::new(options.seed, "certificate/polynomial");
    let starts = map.sample(options.samples, &mut stream)?;
    let request = Rollout { steps: 1, every: 1 };
    let ends = map.rollout(&starts, request)?.split_off(starts.len());
    let there = PolynomialAndInverse::new(map.clone());
    let back = there.clone().exchanged();
    let mut tallies = polynomial_laws(&there, &back, map.symmetries(), [&starts, &ends]);
    if let Some(reversor) = map.symmetries().reversor {
        let plain = "S∘P∘S∘P = Id";
        let stated = format!("{plain}, {}", reversor.equation());
        tallies = tallies.into_iter().map(|tally| tally.restating(plain, &stated)).collect();
    }
    let region = Region::around(dim, [&starts[..]]);
    let region = region.ok_or_else(|| Error::invalid("samples", 0, "at least one"))?;
    let between = |(low, high): (&f64, &f64)| Coordinate::Between(*low, *high);
    let domain = region.low.iter().zip(&region.high).map(between).collect();
    Ok(Certificate::of(options, tallies).with_domain(domain))
}

/// The laws of a map by a polynomial and of its inverse `back`, at points `starts` and at their images `ends`: that
/// both are symplectic, undo each other and give the same bits on vector registers, and that `there` has these
/// symmetries.
pub fn polynomial_laws(
    there: &dyn Measurable,
    back: &dyn Measurable,
    symmetries: &Symmetries,
    [starts, ends]: [&[f64]; 2],
) -> Vec<Tally> {
    let forward = Direction::Forward;
    let mut tallies = vec![
        laws::symplecticity_of_any(there, starts),
        laws::inversion("inversion of P", "P⁻¹∘P = Id", there, forward, starts),
        laws::inversion("inversion of P", "P∘P⁻¹ = Id", back, forward, ends),
        laws::evaluation(&OneWay(there), starts),
        laws::evaluation(&OneWay(back), ends),
    ];
    if let Some(reversor) = symmetries.reversor {
        tallies.push(laws::reversibility(there, reversor, starts));
    }
    if !symmetries.mirrored.is_empty() {
        tallies.push(commutation(there, &symmetries.mirrored, starts));
    }
    tallies.push(laws::determinant(there, starts));
    tallies
}

/// A symplectic polynomial and another as its inverse, each by the steps that it takes in roll-outs.
#[derive(Clone)]
pub struct PolynomialAndInverse {
    forward: SymplecticPolynomial,
    backward: SymplecticPolynomial,
}

impl PolynomialAndInverse {
    /// A polynomial and its inverse.
    pub fn new(forward: SymplecticPolynomial) -> Self {
        let backward = forward.inverted();
        Self { forward, backward }
    }

    /// A polynomial, and one that is said to be its inverse.
    pub fn claimed(forward: SymplecticPolynomial, backward: SymplecticPolynomial) -> Self {
        Self { forward, backward }
    }

    /// The inverse map: the two polynomials exchanged.
    pub fn exchanged(self) -> Self {
        Self { forward: self.backward, backward: self.forward }
    }
}

impl<S: Scalar> Map<S> for PolynomialAndInverse {
    fn dof(&self) -> usize {
        Map::<S>::dof(&self.forward)
    }
    fn forward(&self, z: &mut [S]) {
        self.forward.forward(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.backward.forward(z);
    }
}

impl Measurable for PolynomialAndInverse {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        vec![Box::new(TrackedStep { map: self, direction })]
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        let map = match direction {
            Direction::Forward => &self.forward,
            Direction::Inverse => &self.backward,
        };
        map.move_all(points);
    }
}

/// A map of which only the way forward is asked for.
struct OneWay<'a>(&'a dyn Measurable);

impl Map<f64> for OneWay<'_> {
    fn dof(&self) -> usize {
        self.0.dof()
    }
    fn forward(&self, z: &mut [f64]) {
        self.0.forward(z);
    }
    fn has_inverse(&self) -> bool {
        false
    }
}

impl Measurable for OneWay<'_> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.0.measured_steps(direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.0.move_points(direction, points);
    }
}

/// The reflection (q_j, p_j) ↦ (−q_j, −p_j) of some planes.
struct Mirror<'a> {
    dof: usize,
    planes: &'a [usize],
}

impl<S: Scalar> Map<S> for Mirror<'_> {
    fn dof(&self) -> usize {
        self.dof
    }
    fn forward(&self, z: &mut [S]) {
        for plane in self.planes {
            for k in [plane - 1, self.dof + plane - 1] {
                z[k] = -z[k];
            }
        }
    }
    fn inverse(&self, z: &mut [S]) {
        self.forward(z);
    }
}

/// M∘P⁻¹∘M∘P = Id, with the mirror M.
fn commutation(map: &dyn Measurable, planes: &[usize], points: &[f64]) -> Tally {
    let dof = map.dof();
    let mirror = || -> Box<dyn MeasuredStep> {
        let map = Mirror { dof, planes };
        Box::new(TrackedStep { map, direction: Direction::Forward })
    };
    let mut back = vec![mirror()];
    back.extend(map.measured_steps(Direction::Inverse));
    back.push(mirror());
    let both = ThereAndBack::new(map.measured_steps(Direction::Forward), back);
    let results = laws::each_point(points, 2 * dof).map(|z| both.ratio(z));
    Tally::of_ratios("mirror", "M∘P⁻¹∘M∘P = Id").extend_at(points, 2 * dof, results)
}
