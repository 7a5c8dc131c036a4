//! What stands at the head of source code.

use crate::error::Error;
use crate::io::StoredModel;

/// What a reader of the code is to know of its model.
pub(super) struct About<'a> {
    pub(super) name: &'a str,
    pub(super) digest: String,
    /// The lines of the comment at the head of the code.
    pub(super) lines: Vec<String>,
}

impl<'a> About<'a> {
    pub(super) fn of(
        stored: &StoredModel,
        name: &'a str,
        member: Option<&str>,
    ) -> Result<Self, Error> {
        let (map, digest) = (stored.model.composition(), stored.digest()?);
        let mut lines = vec![
            format!(
                "A map of {} numbers, made by gyroceptron {}",
                2 * map.dof(),
                env!("CARGO_PKG_VERSION")
            ),
            format!("from the model with the digest {digest}."),
        ];
        lines.extend(member.map(|member| format!("It is {member}.")));
        let architecture = stored.model.architecture();
        if architecture.is_symplectic() {
            lines.push("It is symplectic and has an exact inverse, but for rounding.".into());
        }
        lines.push(match stored.provenance.flow_time {
            Some(time) => format!("epsilon is {}, the flow time {time}.", architecture.epsilon),
            None => format!("epsilon is {}.", architecture.epsilon),
        });
        lines.push(match &stored.section {
            None => "Points are q1 ... qn, p1 ... pn, in the units of the data.".into(),
            Some(_) => {
                "Points are x1 ... xn, y1 ... yn of the section, in the units of the data.".into()
            }
        });
        if let Some(region) = &stored.provenance.region {
            let numbers =
                |of: &[f64]| of.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ");
            lines.push(format!("Training points lie between ({})", numbers(&region.low)));
            lines.push(format!("and ({}).", numbers(&region.high)));
        }
        Ok(Self { name, digest, lines })
    }
}
