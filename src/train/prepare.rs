//! Your own pairs, made ready for a network.

use super::{fit_rotation, fit_units, slow_time};
use crate::error::Error;
use crate::flow::{Pairs, Region};
use crate::layer::{Reversor, TorusAction};
use crate::phase::Units;
use crate::random::Stream;

/// What is known of pairs, and wanted of them.
#[derive(Clone, Copy, Debug)]
pub struct Preparation<'a> {
    /// What the pairs are called in errors.
    pub place: &'a str,
    /// The circles of their limit.
    pub action: &'a TorusAction,
    /// ε of the network.
    pub epsilon: f64,
    /// The flow time of the network, where it is known.
    pub flow_time: Option<f64>,
    /// Whether the twists of the network are of order one, and not scaled by ε: the flow time that is
    /// not known is 1 then.
    pub of_order_one: bool,
    /// The angle of all circles to start from, where it is known.
    pub theta: Option<f64>,
    /// Whether units are fitted to them.
    pub units: bool,
    /// S of the networks that are reversible: units keep the origin of the half whose signs it
    /// changes.
    pub reversors: &'a [Reversor],
    /// The share that is held out.
    pub validation: f64,
    /// The seed of the held-out choice.
    pub seed: u64,
}

/// Pairs in the coordinates of a network, and what to start it from.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The training pairs.
    pub pairs: Pairs,
    /// The others, if there are any.
    pub held_out: Option<Pairs>,
    /// The units of the data, where they are not those of the pairs here.
    pub units: Option<Units>,
    /// The box around all pairs, in units of the data.
    pub region: Option<Region>,
    /// The angles of the rotation nearest to the pairs, one for each circle.
    pub nearest: Vec<f64>,
    /// Those to start from.
    pub angles: Vec<f64>,
    /// The flow time of the network: how far the slow coordinates move, over ε, where it is not
    /// known.
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
    /// circles share a plane and no angle is known, the share is not of [0, 1), or the flow time is
    /// no positive number, or the seed one that no scene holds. At ε = 0 a flow time that is not
    /// known is infinite.
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
        let nearest: Vec<f64> =
            action.circles().iter().map(|circle| fit_rotation(&pairs, circle)).collect();
        let angles = nearest.iter().map(|nearest| self.theta.unwrap_or(*nearest)).collect();
        let slow = || match self.of_order_one {
            true => 1.0,
            false => slow_time(&pairs, action, &nearest) / epsilon.abs(),
        };
        let flow_time = self.flow_time.unwrap_or_else(slow);
        let mut stream = Stream::new(self.seed, "data/held-out");
        // Pairs at values that are learnt would say nothing of values between them.
        let (pairs, held_out) = match pairs.split_by_controls(validation, &mut stream) {
            Some((pairs, held_out)) => (pairs, Some(held_out)),
            None => pairs.split(validation, &mut stream),
        };
        Ok(Prepared { pairs, held_out, units, region, nearest, angles, flow_time })
    }
}
