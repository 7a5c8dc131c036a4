//! The part that a block plays in a map, and what scales it.

use serde::{Deserialize, Serialize};

/// The part that a block plays in the map
///
/// P = R∘I_ε∘χ∘K_ε∘Φ_θ∘T_ε∘χ⁻¹, χ = ψ∘ψ_ε,
///
/// A part without a block is the identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// ψ, which conjugates the circle action.
    Conjugation,
    /// ψ_ε, the near-identity part of the chart χ.
    Chart,
    /// T_ε, the slow map: it commutes with the circle action.
    SlowMap,
    /// K_ε, the perturbation, in the coordinates of the chart.
    Perturbation,
    /// I_ε, the near-identity map, in the coordinates of the data.
    NearIdentity,
    /// R, a map of no circle action.
    None,
}

impl Part {
    /// All parts, in the order of their parameters in the named architectures.
    pub const ALL: [Self; 6] = [
        Self::Conjugation,
        Self::Chart,
        Self::SlowMap,
        Self::Perturbation,
        Self::NearIdentity,
        Self::None,
    ];

    /// The symbol of the part in equations.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Conjugation => "ψ",
            Self::Chart => "ψ_ε",
            Self::SlowMap => "T_ε",
            Self::Perturbation => "K_ε",
            Self::NearIdentity => "I_ε",
            Self::None => "R",
        }
    }

    /// What scales a block of this part, unless it says so.
    pub(super) fn usual_scale(self) -> Scale {
        match self {
            Self::Conjugation | Self::None => Scale::None,
            Self::Chart | Self::Perturbation | Self::NearIdentity => Scale::Epsilon,
            Self::SlowMap => Scale::EpsilonTime,
        }
    }

    /// The name of the part in files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Conjugation => "conjugation",
            Self::Chart => "chart",
            Self::SlowMap => "slow-map",
            Self::Perturbation => "perturbation",
            Self::NearIdentity => "near-identity",
            Self::None => "none",
        }
    }
}

/// The factor of the increments of a block's layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// No scale: the factor is 1.
    None,
    /// ε: the block is the identity at ε = 0.
    Epsilon,
    /// The flow time h as the factor.
    Time,
    /// εh, the product of ε and the flow time.
    EpsilonTime,
}

impl Scale {
    /// Whether ε is a factor.
    pub fn has_epsilon(self) -> bool {
        matches!(self, Self::Epsilon | Self::EpsilonTime)
    }

    /// Whether the flow time is a factor.
    pub fn has_time(self) -> bool {
        matches!(self, Self::Time | Self::EpsilonTime)
    }

    /// The factor in words.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::None => "1",
            Self::Epsilon => "ε",
            Self::Time => "h",
            Self::EpsilonTime => "εh",
        }
    }

    /// The factor beside ε, for this flow time.
    pub(super) fn time(self, flow_time: f64) -> Option<f64> {
        self.has_time().then_some(flow_time)
    }
}
