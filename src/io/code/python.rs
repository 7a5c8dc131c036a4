//! Models in Python, of the arrays of JAX or of PyTorch.

use super::about::About;
use super::program::{Call, Calls, Function, Line, Program};
use crate::io::StoredModel;
use crate::phase::{AreaDensity, Units};
use crate::scalar::{Operation, TracedKernel};
use std::fmt::Write;

/// The Python library whose arrays the generated code computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrays {
    Jax,
    Torch,
}

const JAX: &str = include_str!("jax.py");
const TORCH: &str = include_str!("torch.py");
const CHART: &str = include_str!("chart.py");

/// A number to the last bit.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn list(values: &[f64]) -> String {
    let rows: Vec<String> = values
        .chunks(6)
        .map(|row| {
            format!("    {},\n", row.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", "))
        })
        .collect();
    format!("[\n{}]", rows.concat())
}

/// The lines of a function, and how each of its numbers is named afterwards.
fn body(function: &Function, inputs: &[String]) -> (String, Vec<String>) {
    let (mut out, mut names) = (String::new(), Vec::<String>::new());
    for Line { result, operation, number: place } in &function.lines {
        let of = |number: &crate::scalar::Traced| names[number.place()].clone();
        let value = match operation {
            Operation::Input(k) => {
                names.push(inputs[*k].clone());
                continue;
            }
            Operation::Constant(value) | Operation::Parameter(value) => {
                names.push(match place {
                    Some(place) => format!("c[{place}]"),
                    None if value.is_sign_negative() => format!("({})", number(*value)),
                    None => number(*value),
                });
                continue;
            }
            Operation::Kernel(kernel, part, x) => {
                let name = match (kernel, part) {
                    (TracedKernel::TanhSech2, 0) => "xp.tanh",
                    (TracedKernel::TanhSech2, _) => "sech2",
                    (TracedKernel::Lorentzian, 0) => "odd_lorentzian",
                    (TracedKernel::Lorentzian, _) => "lorentzian",
                    (TracedKernel::SinCos, 0) => "xp.sin",
                    (TracedKernel::SinCos, _) => "xp.cos",
                };
                format!("{name}({})", of(x))
            }
            Operation::Negative(x) => format!("-{}", of(x)),
            Operation::Sum(x, y) => format!("{} + {}", of(x), of(y)),
            Operation::Difference(x, y) => format!("{} - {}", of(x), of(y)),
            Operation::Product(x, y) => format!("{} * {}", of(x), of(y)),
            Operation::Quotient(x, y) => format!("{} / {}", of(x), of(y)),
            Operation::MulAdd([x, y, z]) => format!("{} * {} + {}", of(x), of(y), of(z)),
            Operation::Magnitude(x) => format!("xp.abs({})", of(x)),
            Operation::Sqrt(x) => format!("xp.sqrt({})", of(x)),
            Operation::WithSignOf(x, sign) => format!("with_sign({}, {})", of(x), of(sign)),
            Operation::AtMost(..)
            | Operation::PowerOfLowBits(_)
            | Operation::MinusBits(..)
            | Operation::BitAsSign(..)
            | Operation::SelectAbove(..)
            | Operation::SelectNegative(_)
            | Operation::NegatedWhere(..)
            | Operation::Other(_) => unreachable!("`Program::works_on_bits` is asked before"),
        };
        let at = result.place();
        let _ = writeln!(out, "    t{at} = {value}");
        names.push(format!("t{at}"));
    }
    (out, names)
}

fn coordinates(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("z{k}")).collect()
}

/// The elements of a tuple.
fn tuple(of: &[String]) -> String {
    format!("({},)", of.join(", "))
}

fn step(function: &Function) -> String {
    let inputs = coordinates(function.outputs.len());
    let (lines, names) = body(function, &inputs);
    let outputs: Vec<String> =
        function.outputs.iter().map(|output| names[output.place()].clone()).collect();
    let name = &function.name;
    format!(
        "def {name}(c, z):\n    {} = z\n{lines}    return {}\n\n\n",
        tuple(&inputs),
        tuple(&outputs)
    )
}

/// How many numbers a function takes.
fn count(function: &Function) -> usize {
    function.lines.iter().filter(|line| line.number.is_some()).count()
}

/// The longest group of calls that is looked for again.
const LONGEST: usize = 32;

/// Calls in groups: so many functions, and how often they are called one after another.
fn groups(calls: &[Call]) -> Vec<(&[Call], usize)> {
    let (mut out, mut rest) = (Vec::new(), calls);
    while !rest.is_empty() {
        let repeats = |period: usize| {
            let names = |of: &[Call]| of.iter().map(|call| call.function).collect::<Vec<_>>();
            let first = names(&rest[..period]);
            rest.chunks_exact(period).take_while(|next| names(next) == first).count()
        };
        // That which covers most; of these the shortest.
        let mut best = (1, repeats(1));
        for period in 2..=LONGEST.min(rest.len() / 2) {
            let times = repeats(period);
            if times > 1 && period * times > best.0 * best.1 {
                best = (period, times);
            }
        }
        // What is called once stands alone.
        let (period, times) = best;
        let (group, after) = rest.split_at(period * times);
        out.push((group, times));
        rest = after;
    }
    out
}

fn calls(name: &str, of: &Calls, program: &Program) -> String {
    let mut out = format!("def {name}(z):\n");
    for (group, times) in groups(of) {
        let period = group.len() / times;
        let functions: Vec<String> = group[..period]
            .iter()
            .map(|call| {
                let function = &program.functions[call.function];
                format!("({}, {})", function.name, count(function))
            })
            .collect();
        let starts: Vec<String> = group
            .chunks_exact(period)
            .map(|row| tuple(&row.iter().map(|call| call.numbers.to_string()).collect::<Vec<_>>()))
            .collect();
        let _ = writeln!(out, "    z = repeat({}, {}, z)", tuple(&functions), tuple(&starts));
    }
    out + "    return z\n\n\n"
}

/// Σ D_kj T_j T_k, the integral of a density along x from the middle of its box, over its scale.
fn primitive(plane: &AreaDensity) -> Vec<f64> {
    let count = plane.degrees()[0] + 1;
    plane.coefficients().chunks_exact(count).flat_map(|row| plane.integral(row)).collect()
}

fn charts(planes: &[Option<AreaDensity>]) -> String {
    let mut out = CHART.to_owned();
    out += "\n\nCHARTS = {\n";
    for (j, plane) in planes.iter().enumerate() {
        let Some(plane) = plane else { continue };
        let ([a, b], [c, d]) = (plane.low(), plane.high());
        let [x, y] = plane.degrees();
        let numbers = list(plane.coefficients()).replace('\n', "\n    ");
        let integrals = list(&primitive(plane)).replace('\n', "\n    ");
        let _ = write!(
            out,
            "    {j}: Chart(\n        low=({}, {}), high=({}, {}), scale={}, degrees=({x}, {y}),\n    density={numbers},\n    \
             primitive={integrals}),\n",
            number(a),
            number(b),
            number(c),
            number(d),
            number(plane.scale())
        );
    }
    out + "}\n\n\n"
}

pub(super) fn source(
    stored: &StoredModel,
    program: &Program,
    about: &About<'_>,
    arrays: Arrays,
) -> String {
    let dim = program.dim;
    let dof = dim / 2;
    let mut out = format!("\"\"\"{}\n\"\"\"\n\n", about.lines.join("\n"));
    out += match arrays {
        Arrays::Jax => JAX,
        Arrays::Torch => TORCH,
    };
    let _ = write!(
        out,
        "\n# `map` is left out: it would replace that of Python.\n\
         __all__ = [\"DIM\", \"DIGEST\", \"inverse\", \"iterate\"{}]\n\nDIM = {dim}\nDIGEST = \"{}\"\nTABLE = {}\n\n\n",
        if program.invariant.is_some() { ", \"invariant\"" } else { "" },
        about.digest,
        list(&program.table)
    );
    let of_points = program.functions.iter().filter(|function| function.outputs.len() == dim);
    of_points.for_each(|function| out += &step(function));
    for (function, of) in [
        ("to_chart", &program.to_chart),
        ("step", &program.forward),
        ("step_back", &program.inverse),
        ("from_chart", &program.from_chart),
    ] {
        out += &calls(function, of, program);
    }
    let planes: &[_] = stored.section.as_ref().map_or(&[], |section| section.planes());
    if !planes.is_empty() {
        out += &charts(planes);
    }
    let (mut to, mut from) = (String::new(), String::new());
    for (k, (centre, factor)) in stored.units.iter().flat_map(of_units).enumerate() {
        let (centre, factor) = (number(centre), number(factor));
        let _ = writeln!(to, "    z[{k}] = (z[{k}] - ({centre})) / {factor}");
        let _ = writeln!(from, "    z[{k}] = z[{k}] * {factor} + ({centre})");
    }
    let each = |call: &str| -> String {
        let with_chart = (0..planes.len()).filter(|j| planes[*j].is_some());
        with_chart
            .map(|j| {
                let k = dof + j;
                format!("    z[{j}], z[{k}] = {call}(CHARTS[{j}], z[{j}], z[{k}])\n")
            })
            .collect()
    };
    // What is not compiled once is compiled at each call.
    let (compiled, iterated) = match arrays {
        Arrays::Jax => ("@jax.jit\n", "@partial(jax.jit, static_argnames=\"steps\")\n"),
        Arrays::Torch => ("", ""),
    };
    let (to_section, from_section) = (each("to_canonical"), each("to_data"));
    let _ = write!(
        out,
        "def to_network(z):\n    \
         if z.ndim == 0 or z.shape[-1] != DIM:\n        \
         raise ValueError(f\"expected points (..., {{DIM}}), found the shape {{tuple(z.shape)}}\")\n    \
         z = [z[..., k] for k in range(DIM)]\n{to_section}{to}    return tuple(z)\n\n\n\
         def from_network(z):\n    z = list(z)\n{from}{from_section}    return xp.stack(z, -1)\n\n\n\
         {iterated}def iterate(z, steps):\n    \"\"\"So many steps of points (..., {dim}), or steps back where the number is \
         negative.\"\"\"\n    \
         z = to_chart(to_network(as_array(z)))\n    \
         z = times(step if steps >= 0 else step_back, abs(steps), z)\n    \
         return from_network(from_chart(z))\n\n\n\
         {compiled}def map(z):\n    \"\"\"A step of the map of points (..., {dim}).\"\"\"\n    return iterate(z, 1)\n\n\n\
         {compiled}def inverse(z):\n    \"\"\"A step back of points (..., {dim}).\"\"\"\n    return iterate(z, -1)\n"
    );
    if let Some((to_actions, actions)) = &program.invariant {
        let inputs = coordinates(dim);
        let (lines, names) = body(actions, &inputs);
        let _ = write!(out, "\n\n{}", calls("to_actions", to_actions, program));
        let area = stored.units.as_ref().map_or(1.0, Units::area);
        let _ = write!(
            out,
            "{compiled}def invariant(z):\n    \"\"\"The invariant of the model at points (..., {dim}).\"\"\"\n    \
             {} = to_actions(to_network(as_array(z)))\n{lines}    return {} * {}\n",
            tuple(&inputs),
            number(area),
            names[actions.outputs[0].place()]
        );
    }
    out
}

fn of_units(units: &Units) -> impl Iterator<Item = (f64, f64)> {
    units.centre().iter().copied().zip(units.factors().iter().copied())
}
