//! The integrators by name, on many points.
//!
//! A new one needs a file with its step for points of any scalar type, a variant of [`Integrator`] with its name, an
//! arm in `checked_trajectories` and in `check_for`, and, if it runs on SIMD lanes, an `impl` of `Method`.

use super::request::{Method, Request};
use super::{
    Averaged, GaussLegendre, MultiRevolution, Splitting, Stroboscopic, Tableau, boris,
    natural_runge_kutta_4, runge_kutta_4, velocity_splitting,
};
use crate::error::Error;
use crate::scalar::{Pack, WIDTH, max_or_nan};
use crate::system::{
    FullOrbit, Hamiltonian, NaturalCoordinates, NearlyPeriodic, ParticleField, Splittable, System,
    each_system,
};
use serde::{Deserialize, Serialize};

/// A numerical integrator, as scenes name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Integrator {
    /// [`runge_kutta_4`].
    #[serde(rename = "runge-kutta-4")]
    RungeKutta4,
    /// [`natural_runge_kutta_4`].
    #[serde(rename = "natural-runge-kutta-4")]
    NaturalRungeKutta4,
    /// [`Tableau::DORMAND_PRINCE_8`].
    #[serde(rename = "dormand-prince-8")]
    DormandPrince8,
    /// [`Tableau::DORMAND_PRINCE_8`] in natural coordinates.
    #[serde(rename = "natural-dormand-prince-8")]
    NaturalDormandPrince8,
    /// [`Splitting::STRANG`].
    Strang,
    /// [`Splitting::YOSHIDA_4`].
    #[serde(rename = "yoshida-4")]
    Yoshida4,
    /// [`Splitting::ABA_864`].
    #[serde(rename = "aba-864")]
    Aba864,
    /// [`Splitting::ABA_1064`].
    #[serde(rename = "aba-1064")]
    Aba1064,
    /// [`GaussLegendre`].
    GaussLegendre {
        /// s, the number of stages.
        stages: usize,
    },
    /// [`boris`].
    Boris,
    /// [`velocity_splitting`].
    VelocitySplitting,
    /// [`Stroboscopic`].
    Stroboscopic {
        /// Steps of a splitting in a period.
        micro: usize,
        /// The number m of central differences, with errors O(ε²ᵐ); 0 is the forward difference, with errors O(ε).
        #[serde(default = "two")]
        differences: usize,
        /// The splitting.
        #[serde(default, skip_serializing_if = "MicroSteps::is_usual")]
        by: MicroSteps,
    },
    /// [`MultiRevolution`].
    MultiRevolution {
        /// Steps of a splitting in a period.
        micro: usize,
        /// 2 or 4, in the size of the steps.
        order: usize,
        /// The splitting.
        #[serde(default, skip_serializing_if = "MicroSteps::is_usual")]
        by: MicroSteps,
    },
    /// [`Averaged`].
    Averaged {
        /// 1 or 2: over times of 1/ε errors are O(ε) and O(ε²).
        order: usize,
        /// The angles of an average.
        #[serde(default = "sixteen")]
        angles: usize,
        /// Whether the closed form of the average, of first order, is used: the angles then only serve to enter and
        /// leave the averaged coordinates.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        closed: bool,
    },
}

/// The splitting whose steps a period is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MicroSteps {
    /// [`Splitting::ABA_1064`].
    #[default]
    #[serde(rename = "aba-1064")]
    Aba1064,
    /// [`Splitting::STRANG`].
    Strang,
}

impl MicroSteps {
    fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    fn words(self) -> &'static str {
        match self {
            Self::Aba1064 => "steps",
            Self::Strang => "steps of Strang",
        }
    }

    fn splitting(self) -> Splitting {
        match self {
            Self::Aba1064 => Splitting::ABA_1064,
            Self::Strang => Splitting::STRANG,
        }
    }
}

/// The angles that scenes do not name.
fn sixteen() -> usize {
    16
}

/// The differences that scenes do not name.
fn two() -> usize {
    2
}

impl Integrator {
    /// The name used in tables.
    pub fn name(self) -> String {
        match self {
            Self::RungeKutta4 => "RK4".into(),
            Self::NaturalRungeKutta4 => "RK4 in natural coordinates".into(),
            Self::DormandPrince8 => "Dormand–Prince 8".into(),
            Self::NaturalDormandPrince8 => "Dormand–Prince 8 in natural coordinates".into(),
            Self::Boris => "Boris".into(),
            Self::VelocitySplitting => "splitting of ½v_x², ½v_y² and φ".into(),
            Self::Stroboscopic { micro, differences, by } => {
                let order = (2 * differences).max(1);
                format!("stroboscopic averaging of order {order}, {micro} {} a period", by.words())
            }
            Self::MultiRevolution { micro, order, by } => {
                let steps = by.words();
                format!("multi-revolution composition of order {order}, {micro} {steps} a period")
            }
            Self::Averaged { angles, closed: true, .. } => {
                format!("averaged equation of order 1, closed form, {angles} angles")
            }
            Self::Averaged { order, angles, .. } => {
                format!("averaged equation of order {order}, {angles} angles")
            }
            Self::GaussLegendre { stages: 1 } => "Gauss–Legendre, 1 stage".into(),
            Self::GaussLegendre { stages } => format!("Gauss–Legendre, {stages} stages"),
            Self::Strang | Self::Yoshida4 | Self::Aba864 | Self::Aba1064 => {
                self.splitting().map_or_else(String::new, |splitting| splitting.name.into())
            }
        }
    }

    /// The splitting behind the name, if it is one.
    pub fn splitting(self) -> Option<Splitting> {
        match self {
            Self::Strang => Some(Splitting::STRANG),
            Self::Yoshida4 => Some(Splitting::YOSHIDA_4),
            Self::Aba864 => Some(Splitting::ABA_864),
            Self::Aba1064 => Some(Splitting::ABA_1064),
            Self::RungeKutta4
            | Self::NaturalRungeKutta4
            | Self::DormandPrince8
            | Self::NaturalDormandPrince8
            | Self::GaussLegendre { .. }
            | Self::Boris
            | Self::VelocitySplitting
            | Self::Averaged { .. }
            | Self::MultiRevolution { .. }
            | Self::Stroboscopic { .. } => None,
        }
    }

    /// Fails unless its parameters are in range: 1 to 64 stages, 1 to 1000 steps in a period and at most three
    /// differences, or 3 to 1000 angles, and an order that is implemented.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] for a number out of range, [`Error::Invalid`] for an order that is not implemented.
    pub fn check(self) -> Result<(), Error> {
        const MOST: usize = 64;
        match self {
            Self::GaussLegendre { stages } => Error::check_count_range("stages", stages, 1, MOST),
            Self::MultiRevolution { micro, order, .. } => {
                Error::check_count_range("micro", micro, 1, 1000)?;
                if ![2, 4].contains(&order) {
                    return Err(Error::invalid("order", order, "2 or 4"));
                }
                Ok(())
            }
            Self::Stroboscopic { micro, differences, .. } => {
                Error::check_count_range("micro", micro, 1, 1000)?;
                let most = Stroboscopic::MOST_DIFFERENCES;
                Error::check_count_range("differences", differences, 0, most)
            }
            Self::Averaged { order, angles, closed } => {
                Error::check_count_range("order", order, 1, 2)?;
                if closed && order == 2 {
                    let found = "order 2 and closed";
                    return Err(Error::invalid("integrator", found, "order 1 of a closed form"));
                }
                Error::check_count_range("angles", angles, 3, 1000)
            }
            _ => Ok(()),
        }
    }

    /// The integrator that, with twice as many steps, estimates the error of this one: usually the same one. For
    /// averaging, a finer map of a period and one more difference, since more steps do not reduce those errors.
    pub(super) fn finer(self) -> Self {
        match self {
            Self::Stroboscopic { micro, differences, by } => {
                Self::Stroboscopic { micro: 2 * micro, differences: differences + 1, by }
            }
            // More steps or angles do not reduce the error of averaging itself, nor that of a period.
            Self::Averaged { .. } | Self::MultiRevolution { .. } => {
                Self::Stroboscopic { micro: 16, differences: 3, by: MicroSteps::Aba1064 }
            }
            other => other,
        }
    }

    /// Fails where a distance of two of its states is not finite.
    pub(super) fn check_finite(self, distance: f64, time: f64) -> Result<(), Error> {
        if distance.is_finite() {
            return Ok(());
        }
        let place = format!("a trajectory over time {time}");
        Err(Error::Diverged { what: self.name(), place })
    }

    /// The states of trajectories from each of the points in `initial`, 2n
    /// numbers each, at the times `interval`, 2·`interval`, … `kept`·`interval`,
    /// `steps` equal steps in each: an array (kept, M, 2n).
    ///
    /// Eight trajectories run together, one in each lane; splittings interleave the stages of
    /// several such groups, and all threads share the groups. Each trajectory has the same bits as
    /// if computed alone, on any processor. With Gauss–Legendre, trajectories whose stages have
    /// converged wait for the others in each step.
    ///
    /// # Errors
    /// Those of [`Integrator::check_for`]. When there are no steps, points are not whole, the interval is not finite
    /// or is not a whole number of the periods that the method needs, the states do not fit into memory, or the stages
    /// of Gauss–Legendre do not converge.
    /// Other methods may diverge without an error: their states are then not finite.
    pub fn trajectories(
        self,
        system: &System,
        initial: &[f64],
        interval: f64,
        steps: usize,
        kept: usize,
    ) -> Result<Vec<f64>, Error> {
        self.check_for(system)?;
        self.checked_trajectories(system, initial, interval, steps, kept)
    }

    /// [`Integrator::trajectories`] of an integrator that was checked, or of the [`Integrator::finer`] one.
    pub(super) fn checked_trajectories(
        self,
        system: &System,
        initial: &[f64],
        interval: f64,
        steps: usize,
        kept: usize,
    ) -> Result<Vec<f64>, Error> {
        let request = Request { interval, steps, kept };
        if kept > 1 {
            check_repeated(system, initial, interval)?;
        }
        match (self, system) {
            (Self::Boris, System::FullOrbit(system)) => request.step(&Boris, system, initial),
            (Self::VelocitySplitting, System::FullOrbit(system)) => {
                request.step(&VelocitySplitting, system, initial)
            }
            (Self::Boris | Self::VelocitySplitting, _) => Err(self.not_a_particle()),
            (
                Self::NaturalRungeKutta4 | Self::NaturalDormandPrince8,
                System::FieldLines(system),
            ) => {
                let eighth = self == Self::NaturalDormandPrince8;
                let tableau = eighth.then_some(Tableau::DORMAND_PRINCE_8);
                request.step(&InNaturalCoordinates { tableau }, system, initial)
            }
            (Self::NaturalRungeKutta4 | Self::NaturalDormandPrince8, _) => {
                Err(self.no_natural_coordinates())
            }
            (Self::Stroboscopic { micro, differences, by }, _) => {
                let parts = Parts::Stroboscopic((by.splitting(), micro), differences);
                self.by_parts(&request, parts, system, initial)
            }
            (Self::MultiRevolution { micro, order, by }, _) => {
                let parts = Parts::MultiRevolution((by.splitting(), micro), order);
                self.by_parts(&request, parts, system, initial)
            }
            (Self::Averaged { order, angles, closed }, _) => {
                self.by_average(&request, (angles, order, closed), system, initial)
            }
            _ => match self.splitting() {
                Some(splitting) => {
                    self.by_parts(&request, Parts::Split(splitting), system, initial)
                }
                None => each_system!(system, system => self.by_field(&request, system, initial)),
            },
        }
    }

    /// Fails unless its parameters are in range and it can integrate this system.
    ///
    /// # Errors
    /// Those of [`Integrator::check`]; [`Error::Invalid`] when the system lacks what the method needs: parts with
    /// exact flows, natural coordinates, a particle in a magnetic field, one circle action, or its average.
    pub fn check_for(self, system: &System) -> Result<(), Error> {
        self.check()?;
        match (self, system) {
            (Self::Boris | Self::VelocitySplitting, System::FullOrbit(_)) => Ok(()),
            (Self::Boris | Self::VelocitySplitting, _) => Err(self.not_a_particle()),
            (Self::NaturalRungeKutta4 | Self::NaturalDormandPrince8, System::FieldLines(_)) => {
                Ok(())
            }
            (Self::NaturalRungeKutta4 | Self::NaturalDormandPrince8, _) => {
                Err(self.no_natural_coordinates())
            }
            (Self::Averaged { .. }, System::FieldLines(_) | System::ThreeOscillators(_)) => {
                Err(self.no_circle_of_planes())
            }
            (Self::Averaged { .. }, System::ParticleField(system))
                if system.dof() > Averaged::MOST_DOF =>
            {
                let most = Averaged::MOST_DOF;
                let (found, expected) =
                    (system.dof(), format!("{most} degrees of freedom or fewer"));
                Err(Error::invalid(&self.name(), found, expected))
            }
            (Self::Averaged { closed: true, .. }, System::FullOrbit(_) | System::VanDerPol(_)) => {
                Err(self.no_closed_form())
            }
            (Self::Stroboscopic { .. } | Self::MultiRevolution { .. }, System::FieldLines(_)) => {
                Err(self.nothing_to_split())
            }
            (Self::Stroboscopic { .. } | Self::MultiRevolution { .. }, system)
                if system.torus().1.len() > 1 =>
            {
                let expected = "another integrator: the limit of the system has no period";
                Err(Error::invalid("integrator", self.name(), expected))
            }
            (_, System::FieldLines(_)) if self.splitting().is_some() => {
                Err(self.nothing_to_split())
            }
            _ => Ok(()),
        }
    }

    fn nothing_to_split(self) -> Error {
        let expected = "another integrator: the system has no parts with exact flows";
        Error::invalid("integrator", self.name(), expected)
    }

    fn no_natural_coordinates(self) -> Error {
        let expected = "another integrator: the system has no coordinates but canonical ones";
        Error::invalid("integrator", self.name(), expected)
    }

    fn no_closed_form(self) -> Error {
        let expected = "another integrator: the average over the circle has no closed form";
        Error::invalid("integrator", self.name(), expected)
    }

    fn no_circle_of_planes(self) -> Error {
        let expected = "another integrator: the limit of the system turns no coordinate planes along one circle";
        Error::invalid("integrator", self.name(), expected)
    }

    fn not_a_particle(self) -> Error {
        let expected =
            "another integrator: this one is of charged particles, the system full-orbit";
        Error::invalid("integrator", self.name(), expected)
    }

    /// By the flows of the parts of a system.
    fn by_parts(
        self,
        request: &Request,
        parts: Parts,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        match system {
            System::Oscillators(system) => parts.trajectories(request, system, initial),
            System::ParticleField(system) => parts.trajectories(request, system, initial),
            System::FullOrbit(system) => parts.trajectories(request, system, initial),
            System::CellularDrift(system) => parts.trajectories(request, system, initial),
            System::ThreeOscillators(system) => parts.trajectories(request, system, initial),
            System::VanDerPol(system) => parts.trajectories(request, system, initial),
            System::FieldLines(_) => Err(self.nothing_to_split()),
        }
    }

    /// By the averaged equation of a system whose limit turns coordinate planes along one circle.
    fn by_average(
        self,
        request: &Request,
        (angles, order, closed): (usize, usize, bool),
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        macro_rules! average {
            ($system:expr) => {{
                let method = Averaged::new($system, request.interval, angles, order);
                let method = if closed { method.in_closed_form() } else { method };
                request.step(&method, $system, initial)
            }};
        }
        match system {
            System::Oscillators(system) => average!(system),
            System::FullOrbit(system) => average!(system),
            System::CellularDrift(system) => average!(system),
            System::VanDerPol(system) => average!(system),
            System::ParticleField(system) => {
                let without = system.without_profiles();
                let method = Averaged::new(&without, request.interval, angles, order);
                let method = if closed { method.in_closed_form() } else { method };
                request.step(&InPlanes { without, method }, system, initial)
            }
            System::FieldLines(_) | System::ThreeOscillators(_) => Err(self.no_circle_of_planes()),
        }
    }

    /// By a method that takes the equations of motion alone.
    fn by_field(
        self,
        request: &Request,
        system: &(impl Hamiltonian + Sync),
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        match self {
            Self::GaussLegendre { stages } => {
                let method = GaussLegendre::new(stages);
                method.trajectories(system, initial, *request)
            }
            Self::DormandPrince8 => {
                let method = Explicit { tableau: Tableau::DORMAND_PRINCE_8 };
                request.step(&method, system, initial)
            }
            _ => request.step(&RungeKutta4, system, initial),
        }
    }
}

/// Fails unless an interval is of whole periods of a system: its states are taken from one such
/// time to the next.
pub(crate) fn whole_periods(interval: f64, period: f64) -> Result<(), Error> {
    let periods = interval / period;
    if (periods - periods.round()).abs() <= 1e-9 * periods.abs().max(1.0) {
        return Ok(());
    }
    Err(Error::invalid("interval", interval, format!("a multiple of the period {period}")))
}

/// Fails unless all later intervals have the same flow as the one that begins at time 0: the interval has to be a whole
/// number of periods of the system or, where it has no period, its vector field the same an interval later.
pub(super) fn check_repeated(
    system: &impl Hamiltonian,
    initial: &[f64],
    interval: f64,
) -> Result<(), Error> {
    if let Some(period) = system.period() {
        return whole_periods(interval, period);
    }
    // Of no symmetry of a period.
    const SHARES: [f64; 2] = [0.127, 0.618];
    let dim = 2 * system.dof();
    let (mut now, mut later) = (vec![0.0; dim], vec![0.0; dim]);
    for z in initial.chunks_exact(dim) {
        for time in SHARES.map(|share| share * interval) {
            system.vector_field(z, time, &mut now);
            system.vector_field(z, time + interval, &mut later);
            let size = now.iter().chain(&later).map(|v| v.abs()).fold(0.0, max_or_nan);
            let change = now.iter().zip(&later).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan);
            if change > 1e-9 * size {
                let expected = format!(
                    "a multiple of the period of H in time: the vector field at {z:?} changes by \
                     {change:.1e} from time {time} to {}",
                    time + interval
                );
                return Err(Error::invalid("interval", interval, expected));
            }
        }
    }
    Ok(())
}

struct RungeKutta4;

impl<H: Hamiltonian> Method<H> for RungeKutta4 {
    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            runge_kutta_4(system, z, interval, steps);
        }
    }
}

/// By a tableau, which is known when it runs: of a constant one each stage would be compiled by itself.
struct Explicit {
    tableau: Tableau<'static>,
}

impl<H: Hamiltonian> Method<H> for Explicit {
    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            self.tableau.take(system, z, interval, steps);
        }
    }
}

/// In natural coordinates, RK4 where there is no tableau.
struct InNaturalCoordinates {
    tableau: Option<Tableau<'static>>,
}

impl<H: NaturalCoordinates> Method<H> for InNaturalCoordinates {
    const NATURAL: bool = true;

    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            match self.tableau {
                Some(tableau) => tableau.take_natural(system, z, interval, steps),
                None => natural_runge_kutta_4(system, z, interval, steps),
            }
        }
    }
    #[inline(always)]
    fn enter<V: Pack>(&self, system: &H, z: &mut [V]) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            system.to_natural(z);
        }
    }
    #[inline(always)]
    fn leave<V: Pack>(&self, system: &H, z: &mut [V]) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            system.to_canonical(z);
        }
    }
}

struct Boris;

impl Method<FullOrbit> for Boris {
    #[inline(always)]
    fn take<V: Pack>(&self, system: &FullOrbit, z: &mut [V], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(4) {
            boris(system, z, interval, steps);
        }
    }
}

struct VelocitySplitting;

impl Method<FullOrbit> for VelocitySplitting {
    #[inline(always)]
    fn take<V: Pack>(&self, system: &FullOrbit, z: &mut [V], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(4) {
            velocity_splitting(system, z, interval, steps);
        }
    }
}

impl<H: NearlyPeriodic> Method<H> for Averaged {
    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: f64, steps: usize) {
        let constants = |z: &[V]| {
            let (mut point, mut out) = (vec![0.0; z.len()], [[0.0; WIDTH]; 2]);
            let mut lanes = [0.0; WIDTH];
            for lane in 0..V::LANES {
                for (number, component) in point.iter_mut().zip(z) {
                    component.store(&mut lanes[..V::LANES]);
                    *number = lanes[lane];
                }
                let of_point = system.average_constants(&point).unwrap_or([f64::NAN; 2]);
                out.iter_mut().zip(of_point).for_each(|(out, constant)| out[lane] = constant);
            }
            out.map(|lanes| V::load(&lanes[..V::LANES]))
        };
        for z in z.chunks_exact_mut(2 * system.dof()) {
            Averaged::take(self, system, z, steps, constants);
        }
    }
}

/// The averaged equation of a particle in its field, in the coordinates whose planes the limit turns.
struct InPlanes {
    without: ParticleField,
    method: Averaged,
}

impl Method<ParticleField> for InPlanes {
    const NATURAL: bool = true;

    #[inline(always)]
    fn take<V: Pack>(&self, _: &ParticleField, z: &mut [V], interval: f64, steps: usize) {
        Method::take(&self.method, &self.without, z, interval, steps);
    }
    #[inline(always)]
    fn enter<V: Pack>(&self, system: &ParticleField, z: &mut [V]) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            Splittable::enter(system, z);
        }
    }
    #[inline(always)]
    fn leave<V: Pack>(&self, system: &ParticleField, z: &mut [V]) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            Splittable::leave(system, z);
        }
    }
}

impl<H: Splittable> Method<H> for Stroboscopic {
    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: f64, steps: usize) {
        Stroboscopic::take(self, system, z, steps);
    }
}

impl<H: Splittable> Method<H> for MultiRevolution {
    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: f64, steps: usize) {
        MultiRevolution::take(self, system, z, steps);
    }
}

/// What is made of the flows of the parts of a system.
#[derive(Clone, Copy)]
enum Parts {
    Split(Splitting),
    /// With so many steps of a splitting in a period, and so many differences.
    Stroboscopic((Splitting, usize), usize),
    /// With so many steps in a period, and of this order.
    MultiRevolution((Splitting, usize), usize),
}

impl Parts {
    /// Trajectories of a system, or the error that there are no steps.
    fn trajectories(
        self,
        request: &Request,
        system: &(impl Splittable + Sync),
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        Error::check_count_range("steps", request.steps, 1, usize::MAX)?;
        match self {
            Self::Split(splitting) => {
                let steps = splitting.steps(system, request.interval / request.steps as f64);
                let method = MultiRevolution::of_steps(steps, request.steps);
                request.step(&method, system, initial)
            }
            Self::Stroboscopic(micro, differences) => {
                let method = Stroboscopic::new(system, request.interval, micro, differences);
                request.step(&method, system, initial)
            }
            Self::MultiRevolution(micro, order) => {
                let (time, count) = (request.interval, request.steps);
                let method = MultiRevolution::new(system, time, count, micro, order);
                request.step(&method, system, initial)
            }
        }
    }
}
