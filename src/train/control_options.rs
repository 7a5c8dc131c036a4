//! The controls that pairs depend on, and how a network depends on them.

use crate::error::Error;
use crate::flow::Pairs;
use crate::network::{ControlRange, Controls};
use serde::{Deserialize, Serialize};

/// Options of the controls (the parameters λ of the maps); their ranges are taken from the pairs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlOptions {
    /// Their names, in the order of the columns. Default: `lambda`, or `lambda1`, `lambda2` and so on.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// The total degree of the polynomials in the controls that give the parameters of the network. Default: the
    /// highest degree up to 4 for which the products of the controls are fewer than their values in the pairs, so
    /// that no value is learnt by heart, and linearly independent at these values; at least 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub degree: Option<usize>,
}

impl ControlOptions {
    /// The highest degree that is chosen by default.
    pub const USUAL: usize = 4;

    /// The controls of these pairs; None where they have none.
    ///
    /// # Errors
    /// When there are more or fewer names than columns, or a control has one value only; those of
    /// [`Controls::check`].
    pub fn of_pairs(&self, pairs: &Pairs) -> Result<Option<Controls>, Error> {
        let rows: Vec<&[f64]> = pairs.conditions().iter().map(|c| &*c.controls).collect();
        self.of_values(&rows)
    }

    /// The controls that take these values, a row for each map.
    ///
    /// # Errors
    /// Those of [`ControlOptions::of_pairs`].
    pub fn of_values(&self, rows: &[&[f64]]) -> Result<Option<Controls>, Error> {
        let count = rows.first().map_or(0, |row| row.len());
        if count == 0 {
            return match (self.names.first(), self.degree) {
                (None, None) => Ok(None),
                (name, degree) => {
                    let degree = degree.map(|degree| format!("a degree of {degree}"));
                    let found = name.cloned().or(degree).unwrap_or_default();
                    let expected = "none: the pairs have no values of controls (`lambda`)";
                    Err(Error::invalid("controls", found, expected))
                }
            };
        }
        if !self.names.is_empty() {
            Error::check_count("names of controls", count, self.names.len())?;
        }
        let range = |k: usize| {
            let values = || rows.iter().map(|row| row[k]);
            // no NaN: values of conditions are finite
            let (low, high) = (values().reduce(f64::min), values().reduce(f64::max));
            let name = match self.names.get(k) {
                Some(name) => name.clone(),
                None if count == 1 => "lambda".into(),
                None => format!("lambda{}", k + 1),
            };
            ControlRange { name, low: low.unwrap_or(0.0), high: high.unwrap_or(0.0) }
        };
        let mut maps = rows.to_vec();
        maps.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        maps.dedup();
        let of = |degree| Controls { ranges: (0..count).map(range).collect(), degree };
        let controls = match self.degree {
            Some(degree) => of(degree),
            None => {
                let learnt = |degree: &usize| {
                    let controls = of(*degree);
                    controls.terms() < maps.len() && are_independent(&controls, &maps)
                };
                of((1..=Self::USUAL).take_while(learnt).last().unwrap_or(1))
            }
        };
        controls.check()?;
        if !are_independent(&controls, &maps) {
            let found = format!("{} products of degree {}", controls.terms(), controls.degree);
            let expected = format!(
                "a lower degree, or more values: the {} that the pairs have do not determine these",
                maps.len()
            );
            return Err(Error::invalid("controls", found, expected));
        }
        Ok(Some(controls))
    }
}

/// Whether the products of the controls are linearly independent at these values, by the Gram–Schmidt method.
fn are_independent(controls: &Controls, rows: &[&[f64]]) -> bool {
    /// A linearly independent product keeps at least this share of its size.
    const LEFT: f64 = 1e-6;
    if controls.check().is_err() || controls.terms() > rows.len() {
        return false;
    }
    let of_rows: Vec<Vec<f64>> = rows.iter().map(|row| controls.products(row)).collect();
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut before: Vec<Vec<f64>> = Vec::new();
    for k in 0..controls.terms() {
        let mut column: Vec<f64> = of_rows.iter().map(|products| products[k]).collect();
        let size = dot(&column, &column).sqrt();
        for unit in &before {
            let part = dot(&column, unit);
            column.iter_mut().zip(unit).for_each(|(v, u)| *v -= part * u);
        }
        let left = dot(&column, &column).sqrt();
        if !(left > LEFT * size) {
            return false;
        }
        column.iter_mut().for_each(|v| *v /= left);
        before.push(column);
    }
    true
}
