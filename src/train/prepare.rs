//! Prepares pairs for a network: units, initial angles, and which pairs are held out.

use super::{fit_rotations, fit_units, slow_time};
use crate::error::Error;
use crate::flow::{Pairs, Region};
use crate::layer::{Reversor, TorusAction};
use crate::phase::Units;
use crate::random::Stream;

/// What is known of pairs, and how to prepare them.
#[derive(Clone, Copy, Debug)]
pub struct Preparation<'a> {
    /// The name of the pairs in errors.
    pub place: &'a str,
    /// The circle action of the limit ε = 0.
    pub action: &'a TorusAction,
    /// The ε that the network is built with.
    pub epsilon: f64,
    /// The flow time of the network, where it is known.
    pub flow_time: Option<f64>,
    /// Whether the twists of the network are of order one rather than scaled by ε; an unknown flow time is then 1.
    pub of_order_one: bool,
    /// The initial angle of all circles, where it is known.
    pub theta: Option<f64>,
    /// Whether units are fitted to the pairs.
    pub units: bool,
    /// The reflections S of networks that are reversible: units keep the origin of the half of the
    /// coordinates whose signs S changes.
    pub reversors: &'a [Reversor],
    /// The share of the pairs that is held out.
    pub validation: f64,
    /// The seed of the held-out choice.
    pub seed: u64,
}

/// Pairs in the coordinates of a network, with its initial angles and flow time.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The pairs to train on, in units of the network.
    pub pairs: Pairs,
    /// The held-out pairs, if there are any.
    pub held_out: Option<Pairs>,
    /// The units of the data, where they differ from those of `pairs`.
    pub units: Option<Units>,
    /// The box around all pairs, in units of the data.
    pub region: Option<Region>,
    /// The angles of the rotation nearest to the pairs, one for each circle.
    pub nearest: Vec<f64>,
    /// The initial angles of the circles.
    pub angles: Vec<f64>,
    /// The flow time of the network. Where it is not known: how far the slow coordinates move over
    /// |ε|, or 1 where the twists are of order one.
    pub flow_time: f64,
}

/// Fails where an action and pairs differ in their degrees of freedom.
pub(super) fn check_planes(place: &str, action: &TorusAction, pairs: &Pairs) -> Result<(), Error> {
    if pairs.dof() == action.dof() {
        return Ok(());
    }
    let found = format!("{} weights", action.dof());
    let expected = format!("{} weights, one for each plane of {place}", pairs.dof());
    Err(Error::invalid("circle action", found, expected))
}

impl Preparation<'_> {
    /// Fits units and angles to pairs, and chooses which are held out.
    ///
    /// # Errors
    /// [`Error::Invalid`] when the action and the pairs differ in their degrees of freedom, two
    /// circles share a plane and no angle is known, the share is not in [0, 1), the flow time is
    /// not a positive number, or the seed is too large for a scene. At ε = 0 a flow time that is
    /// not known is infinite, unless the twists are of order one.
    pub fn prepare(&self, pairs: Pairs) -> Result<Prepared, Error> {
        let Self { place, action, epsilon, validation, .. } = *self;
        check_planes(place, action, &pairs)?;
        // A report repeats it by a scene, and TOML has no larger integers.
        if i64::try_from(self.seed).is_err() {
            return Err(Error::invalid("seed", self.seed, format!("at most {}", i64::MAX)));
        }
        if !(0.0..1.0).contains(&validation) {
            let expected = "a share of at least 0 and less than 1";
            return Err(Error::invalid("validation", validation, expected));
        }
        if let Some(time) = self.flow_time {
            Error::check_range("flow time", time, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        if let (Some(plane), None) = (action.shared_plane(), self.theta) {
            let expected = "circles of planes of their own, or an angle θ";
            let found = format!("plane {} in several circles", plane + 1);
            return Err(Error::invalid("circle action", found, expected));
        }
        let region = pairs.region();
        let units = if self.units { fit_units(&pairs, action) } else { None };
        let units = { self.reversors.iter() }
            .fold(units, |units, reversor| Some(units?.about_zero(reversor.half())));
        let pairs = match &units {
            None => pairs,
            Some(units) => pairs.to_network(place, units)?,
        };
        let nearest = fit_rotations(&pairs, action);
        let angles = nearest.iter().map(|nearest| self.theta.unwrap_or(*nearest)).collect();
        let slow = || match self.of_order_one {
            true => 1.0,
            false => slow_time(&pairs, action, &nearest) / epsilon.abs(),
        };
        let flow_time = self.flow_time.unwrap_or_else(slow);
        let mut stream = Stream::new(self.seed, "data/held-out");
        // Pairs at values of controls that are trained on would not test values between them.
        let (pairs, held_out) = match pairs.split_by_controls(validation, &mut stream) {
            Some((pairs, held_out)) => (pairs, Some(held_out)),
            None => pairs.split(validation, &mut stream),
        };
        Ok(Prepared { pairs, held_out, units, region, nearest, angles, flow_time })
    }
}
