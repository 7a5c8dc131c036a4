//! What the parts of a scene make of the paper's claims: its first table.

use super::shared::{Study, check_parts};
use crate::error::Error;
use crate::measure::timing::{AtError, Spread, WorkPrecision};
use crate::scalar::max_or_nan;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::part::Part;
use crate::scene::setup::Need;
use crate::scene::words::sets_of_weights;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use statrs::stats_tests::Alternative;
use statrs::stats_tests::mannwhitneyu::{MannWhitneyUMethod, mannwhitneyu};

/// A row for each part that has the name of a built-in scene of the paper's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClaimsOptions {}

impl Study for ClaimsOptions {
    fn name(&self) -> &'static str {
        "claims"
    }

    fn needs(&self) -> &'static [Need] {
        &[]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        check_parts(self.name(), scene)
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let with_command = |part| Some((Row::of(part)?, &part.command));
        let rows: Vec<(Row, &String)> = context.parts.iter().filter_map(with_command).collect();
        let mut table = Table::new([
            ("experiment", Format::Exact),
            ("what the paper claims", Format::Exact),
            ("what the authors published", Format::Exact),
            ("ours", Format::Exact),
            ("verdict", Format::Exact),
            ("command", Format::Exact),
        ]);
        for (row, command) in &rows {
            table.push([
                row.name.into(),
                row.claim.into(),
                row.published.into(),
                row.ours.clone().into(),
                row.verdict.clone().into(),
                (*command).clone().into(),
            ]);
        }
        let times: Vec<Block> = context.parts.iter().filter_map(run_times).flatten().collect();
        let data: Value = rows.iter().map(|(row, _)| row.data()).collect();
        Ok(Findings {
            title: "The paper's experiments".into(),
            results: Section { summary: vec![Block::Table(table)], data, ..Section::default() },
            timings: Section { summary: times, ..Section::default() },
            ..Findings::default()
        })
    }
}

/// An experiment of the paper.
pub(in crate::scene) struct Row {
    name: &'static str,
    claim: &'static str,
    published: &'static str,
    ours: String,
    pub(in crate::scene) verdict: String,
}

/// What a study of a part found, as data.
fn data<'a>(part: &'a Part<'_>, study: &str) -> Option<&'a Value> {
    part.study(study).map(|findings| &findings.results.data)
}

fn array(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The largest of some numbers; NaN when one is, or there is none.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.reduce(max_or_nan).unwrap_or(f64::NAN)
}

/// The held-out errors of a network from all its initial weights.
fn errors(part: &Part<'_>, network: &str) -> Vec<f64> {
    let Some(training) = data(part, "training") else { return Vec::new() };
    let models = array(&training["models"]).iter();
    let mut out: Vec<f64> = models
        .filter(|model| model["network"] == network)
        .map(|model| number(&model["best"]["validation"]))
        .collect();
    out.sort_by(f64::total_cmp);
    out
}

/// `median 1.2e-9, worst 2.0e-9 of 5 seeds`, and the worst.
fn over_seeds(part: &Part<'_>, network: &str) -> (String, f64) {
    let errors = errors(part, network);
    let worst = errors.last().copied().unwrap_or(f64::NAN);
    let Some(Spread { median, .. }) = Spread::from_values(errors.clone()) else {
        return ("not run".into(), worst);
    };
    match errors.len() {
        1 => (format!("{median:.1e}"), worst),
        count => (format!("median {median:.1e}, worst {worst:.1e} of {count} seeds"), worst),
    }
}

/// What a network did in the roll-out.
fn rollout<'a>(part: &'a Part<'_>, network: &str) -> Option<&'a Value> {
    array(&data(part, "rollout")?["models"]).iter().find(|model| model["name"] == network)
}

/// The largest relative change of an invariant, as the roll-out has it.
#[doc(hidden)]
pub fn change(of: &Value) -> f64 {
    number(&of["largest_change"])
}

fn percent(value: f64) -> String {
    Format::Percent.number(value)
}

/// Whether μ₀ of the net is an invariant as that of the system is.
fn own_invariant(part: &Part<'_>, network: &str) -> Option<(f64, f64)> {
    let own = change(&rollout(part, network)?["own_adiabatic"]["along_own_orbits"]);
    Some((own, change(&data(part, "rollout")?["reference_adiabatic"])))
}

#[doc(hidden)]
pub const REPRODUCED: &str = "reproduced";

/// A roll-out whose rms distance from the reference is less is close to it.
const CLOSE: f64 = 0.1;

/// The probability that networks of one error come out so far apart, at most.
const SIGNIFICANT: f64 = 0.05;

/// Orbits that go from those of the reference on the slow manifold by no more, over what these travel, stay on it.
const STAYS: f64 = 0.05;

/// An invariant that differs from another by no more, over its value at the start, is close to it.
const NEAR: f64 = 0.2;

/// The distances of roll-outs from all initial weights of a network.
fn rollouts_of_seeds(part: &Part<'_>, network: &str) -> Vec<f64> {
    let of = data(part, "rollout").map_or(&[][..], |data| array(&data["seeds"]));
    let errors = of.iter().find(|of| of["network"] == network);
    errors.map_or(&[][..], |of| array(&of["rms_errors"])).iter().map(number).collect()
}

/// What the series μ₀ + εμ₁ that a net owns does, with its weights as they are: each order with its standard error,
/// and the change of μ₀ at the ε of the training.
fn own_orders(part: &Part<'_>, network: &str) -> Option<([(f64, f64); 2], f64)> {
    let found = array(data(part, "own_invariant")?);
    let of = found.iter().find(|of| of["name"] == network)?;
    let order = |key: &str| (number(&of[key][0]), number(&of[key][1]));
    Some(([order("leading_order"), order("next_order")], number(&of["leading"][0])))
}

/// Whether μ₀ of a net changes by O(ε) and μ₀ + εμ₁ by O(ε²), from orders with their standard errors: what the paper
/// claims is a formal series.
#[doc(hidden)]
pub fn as_a_series([(leading, of_leading), (next, of_next)]: [(f64, f64); 2]) -> String {
    // A tenth for what is of higher order at the larger ε, and a line from which points stray by no more.
    let near = |found: f64, error: f64, order: f64| found >= 0.9 * order && error <= 0.1 * order;
    let good = near(leading, of_leading, 1.0) && near(next, of_next, 2.0);
    let orders = format!("μ₀ changes as ε^{leading:.2}, μ₀ + εμ₁ as ε^{next:.2}");
    if good { format!("{REPRODUCED} ({orders})") } else { format!("not ({orders})") }
}

fn own_verdict(part: &Part<'_>, network: &str) -> String {
    own_orders(part, network).map_or_else(|| "not run".into(), |(orders, _)| as_a_series(orders))
}

/// Which of two samples is smaller: by a rank test, and by whether their ranges overlap.
#[doc(hidden)]
pub fn ranked(ours: &[f64], theirs: &[f64]) -> String {
    let ends = |values: &[f64]| {
        let highest = largest(values.iter().copied());
        (-largest(values.iter().map(|v| -v)), highest)
    };
    let ((low, high), (their_low, their_high)) = (ends(ours), ends(theirs));
    if !(low <= high && their_low <= their_high) {
        return "undecided (a map is lost, or was not run)".into();
    }
    if ours.len().min(theirs.len()) < 2 {
        return "undecided (one set of initial weights)".into();
    }
    // The exact one of statrs 0.19 gives the complement for samples of one size.
    let test = mannwhitneyu(
        ours,
        theirs,
        MannWhitneyUMethod::AsymptoticInclContinuityCorrection,
        Alternative::TwoSided,
    );
    let Ok((_, p)) = test else { return "undecided (no rank test)".into() };
    let words = format!(
        "rank test p = {p:.2}, {} and {} sets of initial weights",
        ours.len(),
        theirs.len()
    );
    match p <= SIGNIFICANT {
        _ if high >= their_low && their_high >= low => {
            format!("undecided: ranges overlap ({words})")
        }
        false => format!("undecided: too few ({words})"),
        true if high < their_low => format!("{REPRODUCED} ({words})"),
        true => format!("not: the other way round ({words})"),
    }
}

fn judged(good: bool, yes: &str, no: &str) -> String {
    if good { yes.to_owned() } else { no.to_owned() }
}

/// What maps from all their initial weights do on the slow manifold and off it.
struct OnSlowManifold<'a> {
    found: &'a Value,
    networks: Vec<&'a str>,
}

impl<'a> OnSlowManifold<'a> {
    fn of(part: &'a Part<'_>) -> Option<Self> {
        let found = data(part, "slow_manifold")?;
        let names = array(&found["beside_reference"]).iter();
        let mut networks: Vec<&str> = names.filter_map(|of| of["network"].as_str()).collect();
        networks.dedup();
        Some(Self { found, networks })
    }

    /// Of all maps of a network.
    fn shares(&self, network: &str, key: &str) -> Vec<f64> {
        let of = array(&self.found["beside_reference"]).iter();
        of.filter(|of| of["network"] == network).map(|of| number(&of[key])).collect()
    }

    fn median(&self, network: &str, key: &str) -> f64 {
        Spread::from_values(self.shares(network, key)).map_or(f64::NAN, |spread| spread.median)
    }

    /// `7.5 % in the median of 5 sets of initial weights, 11 % at worst`.
    fn in_words(&self, network: &str, key: &str) -> String {
        let shares = self.shares(network, key);
        let or_lost = |share: f64| match share.is_nan() {
            true => "lost orbits".to_owned(),
            false => percent(share),
        };
        format!(
            "`{network}` {} in the median of {}, {} at worst",
            or_lost(self.median(network, key)),
            sets_of_weights(shares.len()),
            or_lost(largest(shares.into_iter()))
        )
    }

    fn on_in_words(&self) -> String {
        let of = |network: &&str| {
            let [system, manifold] =
                ["from_system", "from_manifold"].map(|key| percent(self.median(network, key)));
            format!(
                "{}; these are {manifold} away from the slow manifold; {system} from μ₀ = 0",
                self.in_words(network, "from_learnt")
            )
        };
        self.networks.iter().map(of).collect::<Vec<_>>().join(", ")
    }

    /// The distances of 𝔍₀∘ψ⁻¹ from μ₀, and how much μ₀ itself changes along the orbits of the first weights.
    fn off_in_words(&self) -> String {
        let of = |network: &&str| {
            let first = array(&self.found["off"]).iter().find(|of| of["name"] == **network);
            let orbits = first.map_or(&[][..], |of| array(&of["system"])).iter();
            let own = orbits.map(|of| number(&of["largest"]) / number(&of["initial"]).abs());
            let own = percent(largest(own));
            format!("{} (where μ₀ itself changes by {own})", self.in_words(network, "off"))
        };
        self.networks.iter().map(of).collect::<Vec<_>>().join(", ")
    }

    /// The networks of several sets of initial weights, or of one, whose median is no larger, in words.
    fn near(&self, key: &str, most: f64, has_several: bool) -> Option<String> {
        let is_near = |network: &&&str| {
            let several = self.shares(network, key).len() > 1;
            several == has_several && self.median(network, key) <= most
        };
        let near: Vec<String> =
            self.networks.iter().filter(is_near).map(|of| format!("`{of}`")).collect();
        Some(near.join(", ")).filter(|near| !near.is_empty())
    }

    fn judged(&self, key: &str, most: f64, within: &str) -> String {
        match [true, false].map(|has_several| self.near(key, most, has_several)) {
            [Some(near), _] => format!("{REPRODUCED} by {near} (the median within {within})"),
            [None, Some(near)] => {
                format!("undecided (within {within} by one set of initial weights: {near})")
            }
            [None, None] => format!("not (no median within {within})"),
        }
    }

    fn on(&self) -> String {
        self.judged("from_manifold", STAYS, "5 % of what the reference travels on it")
    }

    fn off(&self) -> String {
        self.judged("off", NEAR, "20 %")
    }
}

impl Row {
    pub(in crate::scene) fn of(part: &Part<'_>) -> Option<Self> {
        match part.name {
            "trajectories" => Self::trajectories(part),
            "oscillators-short" => Self::short(part),
            "oscillators-long" => Self::long(part),
            "particle-field" => Self::particle_field(part),
            "slow-manifold" => Self::slow_manifold(part),
            "adiabatic-profiles" => Self::profiles(part),
            "adiabatic-horizon" => Self::horizon(part),
            "published-weights" => Self::published_weights(part),
            "near-identity-penalty" => Self::penalty(part),
            _ => None,
        }
    }

    fn data(&self) -> Value {
        json!({
            "experiment": self.name,
            "claim": self.claim,
            "published": self.published,
            "ours": self.ours,
            "verdict": self.verdict,
        })
    }

    fn trajectories(part: &Part<'_>) -> Option<Self> {
        let each = array(data(part, "trajectories")?);
        let slow = |of: &Value| largest(array(&of["excursions"]).iter().map(|e| number(&e[1])));
        let (first, last) = (each.first()?, each.last()?);
        let (still, far) = (slow(first), slow(last));
        let drift = largest(array(&last["adiabatic"]).iter().map(|d| number(&d["largest"])));
        let good = still == 0.0 && far > 0.5 && drift > 0.1;
        Some(Self {
            name: "trajectories",
            claim: "the dynamics become complicated as ε grows from 0",
            published: "figure",
            ours: format!(
                "slow plane: excursion {still} at ε = {}, {far:.2} at ε = {}, where μ₀ changes by \
                 {drift:.2}",
                first["epsilon"], last["epsilon"]
            ),
            verdict: judged(
                good,
                "reproduced (the slow plane stands still at 0, μ₀ moves by 0.1 and more)",
                "not",
            ),
        })
    }

    fn short(part: &Part<'_>) -> Option<Self> {
        const PUBLISHED: f64 = 1.01e-8;
        let (errors, worst) = over_seeds(part, "gyroceptron");
        let rms = number(&rollout(part, "gyroceptron")?["rms_error"]);
        let (own, of_data) = own_invariant(part, "gyroceptron")?;
        let of_all = rollouts_of_seeds(part, "gyroceptron");
        let worst_rms = largest(of_all.iter().copied().chain([rms]));
        Some(Self {
            name: "oscillators-short",
            claim: "549 parameters predict the time-0.05 map; 40,000 steps match almost perfectly and \
            follow the averaged Hamiltonian",
            published: "MSE 1.01e-8 after 3 h 10 min",
            ours: format!(
                "MSE {errors}; {rms:.1e} rms from the reference over the states kept, {worst_rms:.1e} \
                 from the worst initial \
                 weights; at this ε its own μ₀ changes by {}, the system's by {}",
                percent(own),
                percent(of_data)
            ),
            verdict: format!(
                "error: {}; 40,000 steps: {}; its invariant: {}",
                judged(worst < PUBLISHED, "better", "larger than the published"),
                judged(worst_rms < CLOSE, "reproduced (rms below 0.1)", "not (rms above 0.1)"),
                own_verdict(part, "gyroceptron")
            ),
        })
    }

    fn long(part: &Part<'_>) -> Option<Self> {
        let (errors_of_gyroceptron, worst) = over_seeds(part, "gyroceptron");
        let (henon, _) = over_seeds(part, "henon-net");
        let (symp, _) = over_seeds(part, "symp-net");
        let (own, of_data) = own_invariant(part, "gyroceptron")?;
        let names = ["gyroceptron", "henon-net", "symp-net"];
        let by_error = |of: &str, other: &str| ranked(&errors(part, of), &errors(part, other));
        let rollouts = names.map(|name| rollouts_of_seeds(part, name));
        let words = rollouts.each_ref().map(|all| {
            let median = Spread::from_values(all.clone()).map_or(f64::NAN, |spread| spread.median);
            format!(
                "{median:.2} ({:.2} … {:.2})",
                -largest(all.iter().map(|v| -v)),
                largest(all.iter().copied())
            )
        });
        let map = judged(worst < 1e-5, "reproduced (MSE below 1e-5)", "not (MSE above 1e-5)");
        Some(Self {
            name: "oscillators-long",
            claim: "the gyroceptron (681) predicts the time-5 map well and owns an adiabatic \
            invariant; HénonNet (672) and SympNet (652) do not",
            published: "figure; seven trajectories in 5, 3 and 127 s (RK4: 6055 s)",
            ours: format!(
                "MSE {errors_of_gyroceptron}; HénonNet {henon}, SympNet {symp}; roll-out, rms, median and \
                 range over initial weights: {}, {}, {}; at \
                 this ε own μ₀ of the gyroceptron changes by {}, the system's by {}",
                words[0],
                words[1],
                words[2],
                percent(own),
                percent(of_data)
            ),
            verdict: format!(
                "error: {map}; errs less than HénonNet: {}; HénonNet than SympNet: {}; over the roll-out \
                 less than HénonNet: {}; its invariant: {}",
                by_error("gyroceptron", "henon-net"),
                by_error("henon-net", "symp-net"),
                ranked(&rollouts[0], &rollouts[1]),
                own_verdict(part, "gyroceptron")
            ),
        })
    }

    fn particle_field(part: &Part<'_>) -> Option<Self> {
        let slow = OnSlowManifold::of(part)?;
        let epsilon = part.epsilon?;
        let of = |name: &str| {
            let orbits = array(&slow.found["slow"]).iter().find(|of| of["name"] == name);
            let orbits = orbits.map_or(&[][..], |of| array(&of["largest_q_p_mu"]));
            [0, 1].map(|k| largest(orbits.iter().map(|o| number(&o[k]))) / epsilon.abs())
        };
        let ([q, p], [q_exact, p_exact]) = (of("gyroceptron"), of("reference"));
        let errors: Vec<String> = { slow.networks.iter() }
            .map(|network| format!("`{network}` {}", over_seeds(part, network).0))
            .collect();
        Some(Self {
            name: "particle-field",
            claim: "1033 parameters in 6-D: q and p stay very close to the slow manifold; off it \
            𝔍₀∘ψ⁻¹ stays close to μ₀",
            published: "figure",
            ours: format!(
                "MSE {}; from the learnt zero level set orbits go from the reference's by {}; from μ₀ = 0 \
                 q − q(0) − εpt ≤ {q:.1} ε and p − p(0) ≤ {p:.1} ε (reference: {q_exact:.1} ε, \
                 {p_exact:.1} ε); off it 𝔍₀∘ψ⁻¹ goes from μ₀ by {}",
                errors.join(", "),
                slow.on_in_words(),
                slow.off_in_words()
            ),
            verdict: format!("slow manifold: {}; off it: {}", slow.on(), slow.off()),
        })
    }

    fn slow_manifold(part: &Part<'_>) -> Option<Self> {
        let slow = OnSlowManifold::of(part)?;
        Some(Self {
            name: "slow-manifold",
            claim: "initial conditions on the zero level set of the learnt invariant integrate along the slow manifold",
            published: "a sentence",
            ours: format!(
                "from pairs near the manifold, θ fixed: from the learnt zero level set orbits go from the reference's \
                 by {}; off it 𝔍₀∘ψ⁻¹ goes from μ₀ by {}",
                slow.on_in_words(),
                slow.off_in_words()
            ),
            // The claim is of orbits on the manifold: off it the sizes stand beside the change of μ₀ itself.
            verdict: format!("slow manifold: {}", slow.on()),
        })
    }

    fn profiles(part: &Part<'_>) -> Option<Self> {
        let mut each: Vec<(f64, f64)> = array(data(part, "adiabatic_profiles")?)
            .iter()
            .map(|of| (number(&of["epsilon"]), number(&of["drift"]["largest"])))
            .collect();
        each.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (first, last) = (*each.first()?, *each.last()?);
        let slope = |(epsilon, drift): (f64, f64)| drift / epsilon;
        let falls = each.windows(2).all(|pair| pair[1].1 < pair[0].1);
        let bounded = each.iter().all(|of| slope(*of) <= 10.0 * slope(first));
        Some(Self {
            name: "adiabatic-profiles",
            claim: "μ of random weights stays over 10,000 iterations, the better the smaller ε",
            published: "figure for ε = 1e-1 … 1e-8",
            ours: format!(
                "largest change {:.2} ε at ε = {:e}, {:.2} ε at ε = {:e}",
                slope(first),
                first.0,
                slope(last),
                last.0
            ),
            verdict: judged(
                falls && bounded,
                "reproduced (falls with ε, D/ε within ten times that of the largest ε)",
                "not (does not fall in proportion to ε)",
            ),
        })
    }

    fn horizon(part: &Part<'_>) -> Option<Self> {
        let found = data(part, "adiabatic_horizon")?;
        let orbits = array(&found["orbits"]);
        let factor = array(&found["factors"]).iter().position(|factor| number(factor) == 1.1)?;
        let iterations = |o: &Value| o["iterations"].as_u64();
        let longest = orbits.iter().filter_map(iterations).max()?;
        let shortest = orbits.iter().filter_map(iterations).min()?;
        let of = |epsilon: f64| -> Vec<f64> {
            let of = orbits.iter().filter(|o| number(&o["epsilon"]) == epsilon);
            of.map(|o| o["horizons"][factor].as_f64().unwrap_or(f64::INFINITY)).collect()
        };
        let epsilons: Vec<f64> = orbits.iter().map(|o| number(&o["epsilon"])).collect();
        let most = largest(epsilons.iter().copied());
        let least = -epsilons.iter().filter(|e| **e > 0.0).map(|e| -e).fold(-most, max_or_nan);
        let median = |epsilon: f64| {
            let mut all = of(epsilon);
            all.sort_by(f64::total_cmp);
            all[(all.len() - 1) / 2]
        };
        let words = |n: f64| if n.is_finite() { n.to_string() } else { "not reached".into() };
        let never = |epsilon: f64| of(epsilon).iter().filter(|n| !n.is_finite()).count();
        let all = of(least).len();
        Some(Self {
            name: "adiabatic-horizon",
            claim: "N(ε) grows sharply as ε falls (ρ = 1.1); beyond ρ = 1.2 a point would take days",
            published: "figure, one set of weights",
            ours: format!(
                "{all} sets of weights: median N {} at ε = {most:e}, {} at ε = {least:e}, not \
                 reached in {:.0e} iterations by {} and {} of them; the longest orbit has {:.0e}",
                words(median(most)),
                words(median(least)),
                shortest as f64,
                never(most),
                never(least),
                longest as f64
            ),
            verdict: judged(
                median(least) > 2.0 * median(most),
                "reproduced (the median grows by more than twice)",
                "not (the median grows by less than twice)",
            ),
        })
    }

    fn published_weights(part: &Part<'_>) -> Option<Self> {
        let (ours, theirs) = (over_seeds(part, "ours").1, over_seeds(part, "published").1);
        let (own, _) = own_invariant(part, "ours")?;
        let (published, of_data) = own_invariant(part, "published")?;
        Some(Self {
            name: "published-weights",
            claim: "the trained gyroceptron owns an adiabatic invariant",
            published: "the weights of the time-0.05 map",
            ours: format!(
                "one step: {ours:.1e} against {theirs:.1e} of the published; own μ₀ changes by {} and \
                 {}, the system's by {}",
                percent(own),
                percent(published),
                percent(of_data)
            ),
            verdict: format!(
                "published: {}; ours: {}",
                own_verdict(part, "published"),
                own_verdict(part, "ours")
            ),
        })
    }

    fn penalty(part: &Part<'_>) -> Option<Self> {
        let models = array(&data(part, "rollout")?["models"]).iter();
        let of = |model: &Value| {
            let own = change(&model["own_adiabatic"]["along_own_orbits"]);
            let name = model["name"].as_str().unwrap_or_default().to_owned();
            (name, own)
        };
        let best = models.map(of).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let error = errors_of(part, &best.0);
        Some(Self {
            name: "near-identity-penalty",
            claim: "–",
            published: "–",
            ours: format!(
                "the penalty whose own μ₀ changes least, by {}: `{}`, MSE {error:.1e}",
                percent(best.1),
                best.0
            ),
            verdict: "beyond the paper".into(),
        })
    }
}

/// The held-out error of a network from its first initial weights.
fn errors_of(part: &Part<'_>, name: &str) -> f64 {
    let Some(training) = data(part, "training") else { return f64::NAN };
    let models = array(&training["models"]);
    let first = models.iter().find(|model| model["name"] == name);
    first.map_or(f64::NAN, |model| number(&model["best"]["validation"]))
}

/// Of the part with the three networks: seconds for the seven trajectories, beside those
/// of the paper.
fn run_times(part: &Part<'_>) -> Option<Vec<Block>> {
    const PAPER: [(&str, f64); 4] =
        [("gyroceptron", 5.0), ("henon-net", 3.0), ("symp-net", 127.0), ("RK4", 6055.0)];
    let timed = &part.study("work_precision")?.timings.data["rollout"];
    let methods = array(&timed["methods"]);
    let whole = number(&timed["time"]) * number(&timed["trajectories"]);
    let mut table = Table::new([
        ("method", Format::Exact),
        ("seconds for all trajectories, one thread", Format::Exponent(1)),
        ("rms error", Format::Exponent(1)),
        ("the paper's seconds, steps not stated", Format::Exact),
    ]);
    for method in methods {
        let name = method["name"].as_str()?;
        let setting = method["setting"].as_f64();
        let paper = PAPER.iter().find(|(of, _)| name.starts_with(of)).map(|(_, s)| *s);
        let steps = setting.map(|s| format!(", {s} steps between two states")).unwrap_or_default();
        table.push([
            format!("{name}{steps}").into(),
            method["seconds"]["median"].as_f64().map(|seconds| seconds * whole).into(),
            method["error"].as_f64().into(),
            paper.into(),
        ]);
    }
    if table.is_empty() {
        return None;
    }
    let judged: Vec<WorkPrecision> = serde_json::from_value(timed["methods"].clone()).ok()?;
    let mut out = vec![Block::Table(table)];
    out.extend(faster_than_integrators(&judged).map(Block::Text));
    Some(out)
}

/// How many times as long as its gyroceptron the paper's RK4 takes.
const PAPERS_FACTOR: f64 = 1200.0;

/// Whether networks are faster than integrators, as the paper has it, and in which order.
#[doc(hidden)]
pub fn faster_than_integrators(methods: &[WorkPrecision]) -> Option<String> {
    let of = |name: &str| methods.iter().find(|method| method.name == name);
    let seconds = |name: &str| Some(of(name)?.seconds?.median);
    let gyroceptron = of("gyroceptron")?;
    let [own, henon, symp] = [seconds("gyroceptron")?, seconds("henon-net")?, seconds("symp-net")?];
    let best = AtError::fastest(methods, gyroceptron.error?)?;
    let rk4 = AtError::of_curve(methods, "RK4", gyroceptron.error?);
    let factor = |at: &AtError<'_>| at.seconds / own;
    // The paper says by how much, on a machine and with a program of its own.
    let is_near = rk4.as_ref().is_some_and(|at| (PAPERS_FACTOR / 3.0..).contains(&factor(at)));
    let in_words = |at: &AtError<'_>| Format::Factor.number(factor(at));
    let is_fastest = factor(&best) > 1.0;
    Some(format!(
        "The paper's order, HénonNet before gyroceptron before SympNet: {}; a SympNet takes {} as long as \
         a HénonNet, the paper's 42 times. The paper's 1,200 times over RK4, or a third of that: {}; at the error of \
         the gyroceptron RK4 takes {} as long as it. Of all integrators {} is the fastest there and takes {}: {}.",
        judged(henon < own && own < symp, REPRODUCED, "not"),
        Format::Factor.number(symp / henon),
        judged(is_near, REPRODUCED, "not, its steps were small for no error that counts"),
        rk4.as_ref().map_or("no number of steps tried".into(), in_words),
        best.method.name,
        in_words(&best),
        judged(is_fastest, "the network is faster than each", "it is faster than the network"),
    ))
}
