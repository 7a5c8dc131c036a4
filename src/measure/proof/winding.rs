//! Along curves and the edges of strips: parts one after another, and how often values go around 0.

use super::ball::Ball;
use super::curve::{Curve, OnLine, Part, PartLength, phases};
use super::failure::Failure;
use super::number::Number;
use super::rounded::{Complex, up};
use super::taylor::Taylor;
use crate::stopping::is_stopped;
use std::cell::OnceCell;

/// The largest lengths of a strip's parts, and the least, over 1.
const FIRST_PARTS: usize = 256;
const MOST_HALVINGS: usize = 7;

/// The parts of a line around a curve one after another; a part that is not good enough is halved.
pub(super) fn along(line: &OnLine, mut take: impl FnMut(&Part, bool) -> bool) -> bool {
    fn one(
        line: &OnLine,
        centre: f64,
        half: f64,
        lengths: &[OnceCell<PartLength>],
        take: &mut impl FnMut(&Part, bool) -> bool,
    ) -> bool {
        let Some((length, shorter)) = lengths.split_first() else { return false };
        let length = length.get_or_init(|| PartLength::new(half, line.modes()));
        if is_stopped() {
            return false;
        }
        if take(&line.part(centre, length), shorter.is_empty()) {
            return true;
        }
        let half = 0.5 * half;
        one(line, centre - half, half, shorter, take)
            && one(line, centre + half, half, shorter, take)
    }
    let half = 0.5 / FIRST_PARTS as f64;
    let lengths = [const { OnceCell::new() }; MOST_HALVINGS + 1];
    (0..FIRST_PARTS).all(|number| {
        let centre = (2 * number + 1) as f64 * half;
        one(line, centre, half, &lengths, &mut take)
    })
}

/// Turns of arguments as they pass by: how often they go around 0.
#[derive(Default)]
pub(super) struct Winding {
    last: Option<Complex>,
    first: Option<Complex>,
    turns: f64,
}

impl Winding {
    pub fn pass(&mut self, to: Complex) {
        if let Some(from) = self.last {
            let (re, im) = (from.re * to.re + from.im * to.im, from.re * to.im - from.im * to.re);
            self.turns += libm::atan2(im, re) / std::f64::consts::TAU;
        }
        self.first.get_or_insert(to);
        self.last = Some(to);
    }

    /// How often; NaN where that is not known.
    pub fn close(mut self) -> f64 {
        if let Some(first) = self.first {
            self.pass(first);
        }
        libm::round(self.turns)
    }
}

/// Whether a curve that is no farther than `distance` from this one goes around a point once, and around all that is no
/// farther than `around` from it.
pub(super) fn goes_around(
    curve: &Curve<Ball>,
    distance: f64,
    point: [f64; 2],
    around: f64,
) -> Result<(), Failure> {
    let once = "(10) the circle goes once around the point";
    if curve.cylinder {
        return Err(Failure::new(once, 0.0, 1.0));
    }
    // K′(φ + ω) is not looked at.
    let phases = phases(Ball::of(0.0), curve.modes.len());
    let line = OnLine::new(curve, &phases, 0.0);
    let off = up(distance + around);
    let (mut winding, mut least) = (Winding::default(), f64::INFINITY);
    let done = along(&line, |part, last| {
        let [x, y] = [0, 1].map(|k| part.point[k].minus(Taylor::of(point[k])));
        let apart = x.plus(y.times_i());
        let below = apart.below();
        if below > off {
            winding.pass(apart.centre());
        }
        if (below > off || last) && !(below >= least) {
            least = below;
        }
        below > off
    });
    if !done {
        let inequality = "(9) the circle is farther from the point than it is known";
        return Err(Failure::new(inequality, least, off));
    }
    let turns = winding.close();
    if turns.abs() == 1.0 {
        return Ok(());
    }
    Err(Failure::new(once, turns, 1.0))
}
