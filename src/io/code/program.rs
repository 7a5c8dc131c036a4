//! A model as functions of straight-line code and a table of numbers.

use crate::error::Error;
use crate::layer::ElementaryMap;
use crate::network::{Composition, Model, Visitor};
use crate::phase::Direction;
use crate::scalar::{Operation, Scalar, Trace, Traced, constant};
use std::collections::BTreeMap;

/// A map as calls of functions one after another.
pub(super) type Calls = Vec<Call>;

/// A call of a function of a [`Program`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Call {
    /// The index of the called function in the list `functions` of the program.
    pub function: usize,
    /// Where its numbers begin in the table.
    pub numbers: usize,
}

/// The operations of a step, apart from its numbers: steps of one kind and size have the same.
#[derive(Debug, PartialEq)]
pub(super) struct Function {
    /// A name that no other has.
    pub name: String,
    /// The operations that are needed, and which number of the table a constant is.
    pub lines: Vec<Line>,
    /// What becomes of each number of the input.
    pub outputs: Vec<Traced>,
    /// The arguments of its polynomials.
    pub arguments: Vec<Traced>,
}

/// An operation of a [`Function`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    /// The number that the operation yields.
    pub result: Traced,
    /// The operation that yields it. A constant of a network is 0 here.
    pub operation: Operation,
    /// Which number of the table it is.
    pub number: Option<usize>,
}

/// A model as source code of any language.
#[derive(Debug)]
pub(super) struct Program {
    /// The number of coordinates of a point, 2n.
    pub dim: usize,
    pub functions: Vec<Function>,
    pub table: Vec<f64>,
    /// Where numbers that are in the table already begin.
    places: BTreeMap<Vec<u64>, usize>,
    /// To the coordinates that steps are made in, which a roll-out goes to once.
    pub to_chart: Calls,
    pub from_chart: Calls,
    /// The map and its inverse there.
    pub forward: Calls,
    pub inverse: Calls,
    /// z and a direction, to the map of z and the derivative of the map along it.
    pub tangent: Calls,
    /// To the coordinates in which actions are the invariant, and their sum.
    pub invariant: Option<(Calls, Function)>,
}

impl Program {
    pub fn from_model(model: &Model) -> Result<Self, Error> {
        let none = Vec::new;
        let mut out = Self {
            dim: 2 * model.composition().dof(),
            functions: Vec::new(),
            table: Vec::new(),
            places: BTreeMap::new(),
            to_chart: none(),
            from_chart: none(),
            forward: none(),
            inverse: none(),
            tangent: none(),
            invariant: None,
        };
        let [chart, inner] = model.chart_and_inner_map();
        let (map, step) = (model.composition(), Record { tangent: false });
        let moves_in_chart = model.rolls_out_in_chart();
        let stepped = if moves_in_chart { &inner } else { map };
        if moves_in_chart {
            out.to_chart = out.calls_of(&chart, Direction::Inverse, step)?;
            out.from_chart = out.calls_of(&chart, Direction::Forward, step)?;
        }
        out.forward = out.calls_of(stepped, Direction::Forward, step)?;
        out.inverse = out.calls_of(stepped, Direction::Inverse, step)?;
        out.tangent = out.calls_of(map, Direction::Forward, Record { tangent: true })?;
        if model.invariant().is_some() {
            let calls = out.calls_of(&chart, Direction::Inverse, step)?;
            let trace = Trace::new(out.dim, |z| vec![sum_of_actions(model, z)]);
            out.invariant =
                Some((calls, Function::from_trace("actions".to_owned(), &trace, None)?));
        }
        Ok(out)
    }

    /// Whether a step itself, and no kernel, looks at the bits of numbers.
    pub fn works_on_bits(&self) -> bool {
        let does = |line: &Line| {
            matches!(
                line.operation,
                Operation::AtMost(..)
                    | Operation::PowerOfLowBits(_)
                    | Operation::MinusBits(..)
                    | Operation::BitAsSign(..)
                    | Operation::SelectAbove(..)
                    | Operation::SelectNegative(_)
                    | Operation::NegatedWhere(..)
            )
        };
        self.functions.iter().any(|function| function.lines.iter().any(does))
    }

    fn calls_of(
        &mut self,
        map: &Composition<f64>,
        direction: Direction,
        record: Record,
    ) -> Result<Calls, Error> {
        let mut steps: Vec<_> = map.steps().iter().collect();
        if direction == Direction::Inverse {
            steps.reverse();
        }
        let traces = map.visit_steps(direction, record);
        let mut out = Vec::new();
        for (step, trace) in steps.into_iter().zip(traces) {
            if trace.is_identity() {
                continue;
            }
            let mut numbers = Vec::new();
            let made = Function::from_trace(String::new(), &trace, Some(&mut numbers))?;
            let same = |known: &Function| {
                known.lines == made.lines
                    && known.outputs == made.outputs
                    && known.arguments == made.arguments
            };
            let function = self.functions.iter().position(same).unwrap_or_else(|| {
                let kind = step.kind.name();
                let number = self.functions.len() + 1;
                let of_what = if record.tangent { "_tangent" } else { "" };
                let name = format!("{kind}{of_what}_{number}");
                self.functions.push(Function { name, ..made });
                number - 1
            });
            // Steps that share a layer share its numbers.
            let bits: Vec<u64> = numbers.iter().map(|value| value.to_bits()).collect();
            let next = self.table.len();
            let place = *self.places.entry(bits).or_insert(next);
            if place == next {
                self.table.extend(&numbers);
            }
            out.push(Call { function, numbers: place });
        }
        Ok(out)
    }
}

/// The invariant in the coordinates of its chart, added up as [`Model::invariant`] does.
fn sum_of_actions(model: &Model, z: &[Traced]) -> Traced {
    let circles = &model.architecture().circles;
    let mut actions = circles.iter().map(|circle| circle.invariant(z));
    match circles.len() {
        1 => actions.next().expect("one"),
        // What a sum of f64 begins with.
        _ => actions.fold(constant(-0.0), |sum, each| sum + each),
    }
}

impl Function {
    /// The operations of a trace that its results need. Parameters go to `numbers`, where there is such a table, and so
    /// do constants but for those that any network has.
    pub fn from_trace(
        name: String,
        trace: &Trace,
        mut numbers: Option<&mut Vec<f64>>,
    ) -> Result<Self, Error> {
        let results: Vec<Traced> = trace.outputs.iter().chain(&trace.arguments).copied().collect();
        let needed = trace.needed(&results);
        let mut places = vec![None; trace.operations.len()];
        let mut lines = Vec::new();
        let places_left = trace.operations.iter().zip(&needed).enumerate();
        for (place, (operation, _)) in places_left.filter(|(_, (_, needed))| **needed) {
            let (mut operation, mut number) = (operation.with_places(&places), None);
            if let Operation::Other(function) = operation {
                let expected = "steps of networks alone";
                return Err(Error::invalid("source code", function, expected));
            }
            // What the code has of any network stays where it is.
            let of_network = match operation {
                Operation::Parameter(value) => Some(value),
                Operation::Constant(value) => {
                    let of_any =
                        value.to_bits() == 0 || [0.5, 1.0, 2.0, 4.0].contains(&value.abs());
                    Some(value).filter(|_| !of_any)
                }
                _ => None,
            };
            if let (Some(numbers), Some(value)) = (&mut numbers, of_network) {
                number = Some(numbers.len());
                numbers.push(value);
                operation = Operation::Constant(0.0);
            }
            let result = Traced::from_place(lines.len());
            places[place] = Some(result);
            lines.push(Line { result, operation, number });
        }
        let moved = |of: &[Traced]| -> Vec<Traced> {
            of.iter().map(|number| places[number.place()].expect("a needed number")).collect()
        };
        let (outputs, arguments) = (moved(&trace.outputs), moved(&trace.arguments));
        Ok(Self { name, lines, outputs, arguments })
    }
}

/// The trace of a step.
#[derive(Clone, Copy)]
struct Record {
    tangent: bool,
}

impl<'a> Visitor<'a, f64> for Record {
    type Output = Trace;

    fn visit(self, map: impl ElementaryMap<f64> + 'a) -> Trace {
        let dim = 2 * map.dof();
        let scratch = || vec![Traced::zero(); dim + dim * dim];
        match self.tangent {
            false => Trace::new(dim, |z| {
                map.apply(z, &mut scratch());
                z.to_vec()
            }),
            true => Trace::new(2 * dim, |both| {
                let (z, direction) = both.split_at_mut(dim);
                map.jvp(z, direction, &mut scratch());
                both.to_vec()
            }),
        }
    }
}
