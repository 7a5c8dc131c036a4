//! The integrators by name, on many points.

use super::charged::{Boris, VelocitySplitting};
use super::natural::InNaturalCoordinates;
use super::numerical_method::NumericalMethod;
use super::request::Request;
use super::runge_kutta::RungeKutta4;
use super::tableau::DormandPrince8;
use super::{
    AveragedSettings, GaussLegendreSettings, MultiRevolutionSettings, Splitting,
    StroboscopicSettings,
};
use crate::error::Error;
use crate::scalar::max_or_nan;
use crate::system::{Hamiltonian, System};
use serde::{Deserialize, Serialize};

/// Makes the enum of all integrators of lines `Name = "name in scenes" by value`, or, with settings, `Name = "name in
/// scenes" of Settings`.
macro_rules! integrators {
    (
        without settings {
            $($(#[doc = $doc:literal])* $name:ident = $kind:literal by $method:expr;)*
        }
        with settings {
            $($(#[doc = $doc_of:literal])* $of:ident = $kind_of:literal of $settings:ty;)*
        }
    ) => {
        /// A numerical integrator, as scenes name it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(tag = "kind", deny_unknown_fields)]
        pub enum Integrator {
            $($(#[doc = $doc])* #[serde(rename = $kind)] $name,)*
            $($(#[doc = $doc_of])* #[serde(rename = $kind_of)] $of($settings),)*
        }

        impl Integrator {
            fn method(&self) -> &dyn NumericalMethod {
                match self {
                    $(Self::$name => &$method,)*
                    $(Self::$of(settings) => settings,)*
                }
            }
        }
    };
}

integrators! {
    without settings {
        /// The classical Runge–Kutta method of order 4, [`runge_kutta_4`](super::runge_kutta_4).
        RungeKutta4 = "runge-kutta-4" by RungeKutta4;
        /// The Runge–Kutta method of order 4 in natural coordinates,
        /// [`natural_runge_kutta_4`](super::natural_runge_kutta_4).
        NaturalRungeKutta4 = "natural-runge-kutta-4" by InNaturalCoordinates::RUNGE_KUTTA_4;
        /// The Runge–Kutta method of Dormand and Prince of order 8,
        /// [`Tableau::DORMAND_PRINCE_8`](super::Tableau::DORMAND_PRINCE_8).
        DormandPrince8 = "dormand-prince-8" by DormandPrince8;
        /// The method of order 8 of [`Tableau::DORMAND_PRINCE_8`](super::Tableau::DORMAND_PRINCE_8) in the natural
        /// coordinates of a system.
        NaturalDormandPrince8 = "natural-dormand-prince-8" by InNaturalCoordinates::DORMAND_PRINCE_8;
        /// Strang's splitting of order 2, [`Splitting::STRANG`].
        Strang = "strang" by Splitting::STRANG;
        /// Yoshida's splitting of order 4, [`Splitting::YOSHIDA_4`].
        Yoshida4 = "yoshida-4" by Splitting::YOSHIDA_4;
        /// The splitting ABA(8,6,4) of nearly integrable systems, [`Splitting::ABA_864`].
        Aba864 = "aba-864" by Splitting::ABA_864;
        /// The splitting ABA(10,6,4) of nearly integrable systems, [`Splitting::ABA_1064`].
        Aba1064 = "aba-1064" by Splitting::ABA_1064;
        /// Boris' method for a charged particle, of order 2, [`boris`](super::boris).
        Boris = "boris" by Boris;
        /// The symplectic splitting for a charged particle, of order 2,
        /// [`velocity_splitting`](super::velocity_splitting).
        VelocitySplitting = "velocity-splitting" by VelocitySplitting;
    }
    with settings {
        /// The implicit Gauss–Legendre method with s stages, of order 2s, [`GaussLegendre`](super::GaussLegendre).
        GaussLegendre = "gauss-legendre" of GaussLegendreSettings;
        /// Stroboscopic averaging, which integrates the slow motion in long steps,
        /// [`Stroboscopic`](super::Stroboscopic).
        Stroboscopic = "stroboscopic" of StroboscopicSettings;
        /// Multi-revolution compositions, which replace many fast periods by a few,
        /// [`MultiRevolution`](super::MultiRevolution).
        MultiRevolution = "multi-revolution" of MultiRevolutionSettings;
        /// The averaged equation of first or second order in ε, [`Averaged`](super::Averaged).
        Averaged = "averaged" of AveragedSettings;
    }
}

impl Integrator {
    /// The name used in tables.
    pub fn name(self) -> String {
        self.method().name()
    }

    /// Whether it uses an average over the fast angle that was worked out on paper for its system.
    pub fn is_closed_average(self) -> bool {
        self.method().is_closed_average()
    }

    /// The BibTeX entry that reports cite, of methods that are not in all textbooks.
    pub fn bibtex(self) -> Option<&'static str> {
        self.method().bibtex()
    }

    /// Fails unless its parameters are in range: 1 to 64 stages, 1 to 1000 steps in a period and at most three
    /// differences, or 3 to 1000 angles, and an order that is implemented.
    ///
    /// # Errors
    /// [`Error::CountOutOfRange`] for a number out of range, [`Error::Invalid`] for an order that is not implemented.
    pub fn check(self) -> Result<(), Error> {
        self.method().check()
    }

    /// Whether another method, and not itself with smaller steps, estimates the error of its trajectories.
    pub fn is_judged_by_another(self) -> bool {
        self.method().finer().is_some()
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
        run(self.method(), &Request { interval, steps, kept }, system, initial)
    }

    /// [`Integrator::trajectories`] by half steps, or by a finer method where steps leave some of the error: what
    /// estimates the error of those trajectories.
    ///
    /// # Errors
    /// Those of [`Integrator::trajectories`], of an integrator that was checked.
    pub(super) fn finer_trajectories(
        self,
        system: &System,
        initial: &[f64],
        interval: f64,
        steps: usize,
        kept: usize,
    ) -> Result<Vec<f64>, Error> {
        let finer = self.method().finer();
        let method = finer.as_deref().unwrap_or_else(|| self.method());
        let request = Request { interval, steps: steps.saturating_mul(2), kept };
        run(method, &request, system, initial)
    }

    /// Fails unless its parameters are in range and it can integrate this system.
    ///
    /// # Errors
    /// Those of [`Integrator::check`]; [`Error::Invalid`] when the system lacks what the method needs: parts with
    /// exact flows, natural coordinates, a particle in a magnetic field, one circle action, or its average.
    pub fn check_for(self, system: &System) -> Result<(), Error> {
        self.check()?;
        self.method().check_for(system)
    }
}

/// The states that a request asks for, where a later interval is like the first.
fn run(
    method: &dyn NumericalMethod,
    request: &Request,
    system: &System,
    initial: &[f64],
) -> Result<Vec<f64>, Error> {
    if request.kept > 1 {
        check_repeated(system, initial, request.interval)?;
    }
    method.trajectories(request, system, initial)
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
