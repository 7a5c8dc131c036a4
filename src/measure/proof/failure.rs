//! The reasons why a theorem is not proved.

/// The reason why a theorem is not proved: the inequality that fails, and by how much.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// The inequality, with its number in the guide.
    pub inequality: &'static str,
    /// The value that was found for one side of the inequality.
    pub found: f64,
    /// The bound that it had to stay below or above.
    pub needed: f64,
    /// ρ of the strip on which the proof was tried, if the failure belongs to a strip.
    pub strip: Option<f64>,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { inequality, found, needed, strip } = self;
        write!(f, "{inequality}: found {found:.3e} against {needed:.3e}")?;
        match strip {
            Some(rho) => write!(f, ", ρ = {rho:.1e}"),
            None => Ok(()),
        }
    }
}

impl Failure {
    pub(super) fn new(inequality: &'static str, found: f64, needed: f64) -> Self {
        Self { inequality, found, needed, strip: None }
    }

    /// The number of the inequality, in brackets.
    pub fn number(&self) -> &'static str {
        self.inequality.split_inclusive(')').next().unwrap_or_default()
    }

    /// Advice on what may help.
    pub fn advice(&self) -> &'static str {
        match self.number() {
            "(1)" => {
                "polynomial kicks have no poles, and smaller weights have them farther away; a circle farther \
                 from the edge of what the model was trained on"
            }
            "(3)" | "(4)" => "a circle farther from islands, whose K′ bends less",
            "(5)" => {
                "a model whose rotation number changes across circles: where it does not, the theorem says nothing"
            }
            "(9)" | "(10)" => "a circle that goes around the mean of its points",
            _ => {
                "a rotation number farther from fractions of small denominators, or a circle farther from \
                 islands; or more points and digits than the search goes to"
            }
        }
    }
}
